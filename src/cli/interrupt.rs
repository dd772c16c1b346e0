//! Ctrl-C: the first one ends the work with what there is, the second one ends the program.

use crate::planner::Stop;

/// A flag that the first Ctrl-C (or a request to terminate) raises.
pub(super) fn stop_on_interrupt() -> Stop {
    let stop = Stop::new();
    let raised = stop.clone();
    // Fails only if a handler is there already; then Ctrl-C ends the program as usual.
    let _ = ctrlc::set_handler(move || {
        if raised.is_raised() {
            std::process::exit(130);
        }
        raised.raise();
    });
    stop
}
