//! When work with skills has to end.

use std::time::{Duration, Instant};

use crate::planner::{EndReason, Stop};

/// Steps between two looks at the clock and the stop flag.
const STEPS: u64 = 256;

/// When a search has to end: on automata of thousands of states a tree can be full of skills for seconds before the first sample.
#[derive(Clone, Debug)]
pub(super) struct Budget {
    stop: Stop,
    until: Option<Instant>,
}

impl Budget {
    /// Of so many seconds from a moment on.
    pub(super) fn new(stop: &Stop, began: Instant, seconds: Option<f64>) -> Self {
        let time = seconds.map(|s| Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX));
        Self {
            stop: stop.clone(),
            until: time.and_then(|time| began.checked_add(time)),
        }
    }

    /// Why it has to end now, if it has.
    pub(super) fn over(&self) -> Option<EndReason> {
        if self.stop.is_raised() {
            return Some(EndReason::Stopped);
        }
        let late = self.until.is_some_and(|until| Instant::now() >= until);
        late.then_some(EndReason::Time)
    }

    /// Whether it has to end after so many short steps: looked at now and then.
    pub(super) fn is_over_after(&self, steps: u64) -> bool {
        steps.is_multiple_of(STEPS) && self.is_over()
    }

    pub(super) fn is_over(&self) -> bool {
        self.over().is_some()
    }
}
