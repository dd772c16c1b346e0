//! Guidance that a search asks for once it has lasted for some time.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{Guide, Sampler};

type Ask = Box<dyn FnOnce() -> Option<Guide> + Send>;

/// Directed sampling for so many samples, guided from then on by what is answered then, if anything is.
///
/// The networks take a fixed time whatever the mission, and many a search is over sooner. As the moment is counted in samples, it
/// does not depend on the machine.
pub struct Deferred {
    after: u64,
    ask: Mutex<Option<Ask>>,
    answer: OnceLock<Option<Arc<Guide>>>,
}

impl Deferred {
    /// After so many samples the built-in networks cannot cost much: on the machine that it was measured on (`docs/guidance.md`),
    /// encoding and networks take a quarter of the time of so many samples. Most searches on maps like the paper's have found
    /// their best plan long before.
    pub const WORTH_IT: u64 = 100;

    /// Asks after so many samples, once: searches that run side by side share the answer.
    #[must_use]
    pub fn new(after: u64, ask: impl FnOnce() -> Option<Guide> + Send + 'static) -> Arc<Self> {
        Arc::new(Self {
            after,
            ask: Mutex::new(Some(Box::new(ask))),
            answer: OnceLock::new(),
        })
    }

    /// The sampler of all samples from this one on, counted from 1, once the time has come; waits for the answer.
    pub(in crate::planner) fn successor(&self, sample: u64) -> Option<Sampler> {
        if sample <= self.after {
            return None;
        }
        let answer = self.answer.get_or_init(|| {
            let ask = self
                .ask
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            ask.and_then(|ask| ask()).map(Arc::new)
        });
        Some(match answer {
            Some(guide) => Sampler::Guided(Arc::clone(guide)),
            None => Sampler::Directed,
        })
    }
}

impl std::fmt::Debug for Deferred {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Deferred")
            .field("after", &self.after)
            .field("answered", &self.answer.get().is_some())
            .finish_non_exhaustive()
    }
}
