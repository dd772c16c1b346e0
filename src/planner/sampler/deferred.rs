//! Guidance that a search asks for once it has lasted for some time.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{Guide, Sampler};

/// A question that is asked once; `None` if nobody knows.
pub type Ask = Box<dyn FnOnce() -> Option<Guide> + Send>;

/// What is done once, as soon as it is clear that a question will be asked.
pub type Begin = Box<dyn FnOnce() + Send>;

/// How many samples a guided search draws before it turns to the networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeadStart {
    /// Before the networks begin: many a search is over sooner, and never disturbs them.
    pub begin: u64,
    /// Before StateNet's answer counts.
    pub states: u64,
    /// Before PathNet's answer counts, too.
    pub heatmap: u64,
}

impl HeadStart {
    /// Three of four searches come within 1 % of the exact plan's cost in sixteen samples. From there to the answers those that go on take about
    /// as long as the networks (`docs/guidance.md`).
    pub const USUAL: Self = Self {
        begin: 16,
        states: 24,
        heatmap: 64,
    };

    /// The networks first.
    pub const NONE: Self = Self {
        begin: 0,
        states: 0,
        heatmap: 0,
    };
}

/// Directed sampling for so many samples, guided from then on by what is answered then, if anything is; in stages, where one answer
/// comes sooner than the next.
///
/// The networks take a fixed time whatever the mission, and many a search is over sooner. As the moments are counted in samples,
/// they do not depend on the machine, nor on how long an answer took.
pub struct Deferred {
    /// What is done after so many samples, once.
    begin: Option<(u64, Mutex<Option<Begin>>)>,
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

    /// Asks after so many samples, once: searches that run side by side share the answer.
    #[must_use]
    pub fn new(after: u64, ask: impl FnOnce() -> Option<Guide> + Send + 'static) -> Self {
        Self::in_stages([(after, Box::new(ask) as Ask)])
    }

    /// Asks several questions, each after so many samples, which count up; each answer replaces the one before.
    #[must_use]
    pub fn in_stages(questions: impl IntoIterator<Item = (u64, Ask)>) -> Self {
        let stage = |(after, ask)| Stage {
            after,
            ask: Mutex::new(Some(ask)),
            answer: OnceLock::new(),
        };
        Self {
            begin: None,
            stages: questions.into_iter().map(stage).collect(),
        }
    }

    /// Lets those begin after so many samples who are to have an answer later.
    #[must_use]
    pub fn beginning(mut self, after: u64, begin: Begin) -> Self {
        self.begin = Some((after, Mutex::new(Some(begin))));
        self
    }

    /// Begins, if that has not been done.
    fn begin(&self) {
        let begin = self.begin.as_ref().and_then(|(_, begin)| take(begin));
        if let Some(begin) = begin {
            begin();
        }
    }
}

fn take<T>(from: &Mutex<Option<T>>) -> Option<T> {
    from.lock().unwrap_or_else(PoisonError::into_inner).take()
}

impl Stage {
    /// Waits for the answer.
    fn sampler(&self) -> Sampler {
        let answer = self.answer.get_or_init(|| {
            let ask = take(&self.ask);
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
    /// The sample after which the networks are to begin, if they still are.
    begin: Option<u64>,
    next: usize,
}

impl Ahead {
    /// Those of this sampler, if it has any.
    pub(in crate::planner) fn of(sampler: &Sampler) -> Option<Self> {
        match sampler {
            Sampler::Deferred(deferred) => Some(Self {
                deferred: Arc::clone(deferred),
                begin: deferred.begin.as_ref().map(|b| b.0),
                next: 0,
            }),
            _ => None,
        }
    }

    /// The sampler of all samples from this one on, counted from 1, if the time of another stage has come.
    pub(in crate::planner) fn successor(&mut self, sample: u64) -> Option<Sampler> {
        if self.begin.is_some_and(|after| sample > after) {
            self.begin = None;
            self.deferred.begin();
        }
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
