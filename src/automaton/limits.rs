//! How large a translation may grow.

use std::time::{Duration, Instant};

use super::TranslateError;

/// Limits of a translation; what exceeds them ends with an error that says which one was hit.
///
/// Results never depend on the clock: a translation either ends in time or fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The most states that any automaton on the way may have. 20,000 by default.
    pub states: usize,
    /// The most transitions that any automaton on the way may have. 1,000,000 by default.
    pub transitions: usize,
    /// The most time to spend; `None` for no limit. 10 s by default.
    pub time: Option<Duration>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            states: 20_000,
            transitions: 1_000_000,
            time: Some(Duration::from_secs(10)),
        }
    }
}

/// The clock of one translation.
pub(super) struct Watch<'l> {
    pub(super) limits: &'l Limits,
    start: Instant,
}

impl<'l> Watch<'l> {
    pub(super) fn new(limits: &'l Limits) -> Self {
        Self {
            limits,
            start: Instant::now(),
        }
    }

    /// Other limits by the same clock.
    pub(super) fn within<'m>(&self, limits: &'m Limits) -> Watch<'m> {
        Watch {
            limits,
            start: self.start,
        }
    }

    /// Fails when the time is over.
    pub(super) fn tick(&self) -> Result<(), TranslateError> {
        match self.limits.time {
            Some(limit) if self.start.elapsed() > limit => Err(TranslateError::Time { limit }),
            _ => Ok(()),
        }
    }

    /// Fails when there are too many states or transitions, or the time is over.
    pub(super) fn check(&self, states: usize, transitions: usize) -> Result<(), TranslateError> {
        if states > self.limits.states {
            let limit = self.limits.states;
            return Err(TranslateError::States { limit });
        }
        if transitions > self.limits.transitions {
            let limit = self.limits.transitions;
            return Err(TranslateError::Transitions { limit });
        }
        self.tick()
    }
}
