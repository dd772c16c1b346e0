//! Guidance that a search asks for once it has lasted for some time.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{Guide, Sampler};

/// A question that is asked once; `None` if nobody knows.
pub type Ask = Box<dyn FnOnce() -> Option<Guide> + Send>;

/// Directed sampling for so many samples, guided from then on by what is answered then, if anything is; in stages, where one answer
/// comes sooner than the next.
///
/// The networks take a fixed time whatever the mission, and many a search is over sooner. As the moments are counted in samples,
/// they do not depend on the machine, nor on how long an answer took.
pub struct Deferred {
    stages: Vec<Stage>,
}

struct Stage {
    after: u64,
    ask: Mutex<Option<Ask>>,
    answer: OnceLock<Option<Arc<Guide>>>,
}

impl Deferred {
    /// After so many samples the built-in networks cannot cost much: on the machine that it was measured on (`docs/guidance.md`),
    /// encoding and networks take a quarter of the time of so many samples. Most searches on maps like the paper's have found
    /// their best plan long before.
    pub const WORTH_IT: u64 = 100;

    /// Samples of a guided search before StateNet's and before PathNet's answer, which are on their way since it began. On the
    /// machines that it was measured on, the search takes about as long for them as the networks take for their answers
    /// (`docs/guidance.md`).
    pub const HEAD_START: [u64; 2] = [8, 24];

    /// Asks after so many samples, once: searches that run side by side share the answer.
    #[must_use]
    pub fn new(after: u64, ask: impl FnOnce() -> Option<Guide> + Send + 'static) -> Arc<Self> {
        Self::in_stages([(after, Box::new(ask) as Ask)])
    }

    /// Asks several questions, each after so many samples, which count up; each answer replaces the one before.
    #[must_use]
    pub fn in_stages(questions: impl IntoIterator<Item = (u64, Ask)>) -> Arc<Self> {
        let stage = |(after, ask)| Stage {
            after,
            ask: Mutex::new(Some(ask)),
            answer: OnceLock::new(),
        };
        let stages = questions.into_iter().map(stage).collect();
        Arc::new(Self { stages })
    }
}

impl Stage {
    /// Waits for the answer.
    fn sampler(&self) -> Sampler {
        let answer = self.answer.get_or_init(|| {
            let ask = self
                .ask
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            ask.and_then(|ask| ask()).map(Arc::new)
        });
        match answer {
            Some(guide) => Sampler::Guided(Arc::clone(guide)),
            None => Sampler::Directed,
        }
    }
}

/// The stages of a [`Deferred`] sampler that a search has before it.
#[derive(Debug)]
pub(in crate::planner) struct Ahead {
    deferred: Arc<Deferred>,
    next: usize,
}

impl Ahead {
    /// Those of this sampler, if it has any.
    pub(in crate::planner) fn of(sampler: &Sampler) -> Option<Self> {
        match sampler {
            Sampler::Deferred(deferred) => Some(Self {
                deferred: Arc::clone(deferred),
                next: 0,
            }),
            _ => None,
        }
    }

    /// The sampler of all samples from this one on, counted from 1, if the time of another stage has come.
    pub(in crate::planner) fn successor(&mut self, sample: u64) -> Option<Sampler> {
        let mut due = None;
        while let Some(stage) = self.deferred.stages.get(self.next)
            && sample > stage.after
        {
            due = Some(stage);
            self.next += 1;
        }
        due.map(Stage::sampler)
    }
}

impl std::fmt::Debug for Deferred {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let stages = self
            .stages
            .iter()
            .map(|s| (s.after, s.answer.get().is_some()));
        f.debug_list().entries(stages).finish()
    }
}
