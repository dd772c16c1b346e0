//! Networks that answer while the search takes its first steps.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::MissionError;
use super::guide::{Prediction, Question, predict_telling};
use crate::nn::{PredictError, Predictor};
use crate::planner::{Ask, Deferred, Guide, Problem};
use crate::workspace::Workspace;

/// Both networks at work on a mission: on a thread of their own, or, where the machine has no core to spare, on the caller's when
/// it waits for them.
///
/// A search that goes by [`Self::sampler`] begins at once, and waits for StateNet and for PathNet only before the samples that
/// follow their answers. What it draws depends on those moments, which are counted in samples, and not on how long the networks
/// take.
#[derive(Clone)]
pub struct Thinking(Arc<Mutex<Listener>>);

struct Listener {
    /// What is to be done when somebody waits, if nobody does it already.
    work: Option<Box<dyn FnOnce() + Send>>,
    news: Receiver<News>,
    states: Option<Vec<f32>>,
    all: Option<Result<Prediction, MissionError>>,
    is_taken: bool,
    is_asked: bool,
    waited: f64,
}

enum News {
    States(Vec<f32>),
    All(Result<Prediction, MissionError>),
}

impl Thinking {
    /// Asks the networks about a mission; `aside` on a thread of their own.
    #[must_use]
    pub fn begin(
        networks: Arc<Mutex<Predictor>>,
        map: Arc<Workspace>,
        problem: Problem,
        aside: bool,
    ) -> Self {
        let (tell, news) = channel();
        let work = move || answer(&networks, &map, &problem, &tell);
        let listener = |work| Listener {
            work,
            news,
            states: None,
            all: None,
            is_taken: false,
            is_asked: false,
            waited: 0.0,
        };
        // Without a thread of their own they begin when somebody waits for them.
        let later = if aside {
            let name = std::thread::Builder::new().name("networks".to_owned());
            let work = Arc::new(Mutex::new(Some(work)));
            let taken = Arc::clone(&work);
            let run = move || {
                let work = taken.lock().unwrap_or_else(PoisonError::into_inner).take();
                work.map(|work| work())
            };
            match name.spawn(run) {
                Ok(_) => None,
                Err(_) => work.lock().unwrap_or_else(PoisonError::into_inner).take(),
            }
        } else {
            Some(work)
        };
        let later = later.map(|work| Box::new(work) as Box<dyn FnOnce() + Send>);
        Self(Arc::new(Mutex::new(listener(later))))
    }

    /// Directed sampling until so many samples are drawn, then by the states alone, and after so many by the heatmap, too.
    #[must_use]
    pub fn sampler(&self, [states, heatmap]: [u64; 2], problem: &Problem) -> Arc<Deferred> {
        let count = problem.task.nba.len();
        let (first, second) = (self.clone(), self.clone());
        let by_states: Ask = Box::new(move || first.by_states(count));
        let by_all: Ask = Box::new(move || second.by_all(count));
        Deferred::in_stages([(states, by_states), (heatmap, by_all)])
    }

    /// What they say, once they have said it; `None` if that was taken already.
    pub fn finish(&self) -> Option<Result<Prediction, MissionError>> {
        let mut listener = self.lock();
        listener.listen(|l| l.all.is_some());
        listener.is_taken = true;
        listener.all.take()
    }

    /// Whether a search has waited for them.
    pub(super) fn is_asked(&self) -> bool {
        self.lock().is_asked
    }

    /// Seconds that searches have waited for them.
    pub(super) fn waited(&self) -> f64 {
        self.lock().waited
    }

    fn by_states(&self, count: usize) -> Option<Guide> {
        let mut listener = self.lock();
        listener.wait(|l| l.states.is_some() || l.all.is_some());
        let states = listener.states.as_deref()?;
        Guide::of_states(states, count).ok()
    }

    fn by_all(&self, count: usize) -> Option<Guide> {
        let mut listener = self.lock();
        listener.wait(|l| l.all.is_some());
        let prediction = listener.all.as_ref()?.as_ref().ok()?;
        Guide::new(&prediction.guidance, count).ok()
    }

    fn lock(&self) -> MutexGuard<'_, Listener> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for Thinking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Thinking").finish_non_exhaustive()
    }
}

impl Listener {
    /// Waits for a search.
    fn wait(&mut self, enough: impl Fn(&Self) -> bool) {
        let began = Instant::now();
        self.is_asked = true;
        self.listen(enough);
        self.waited += began.elapsed().as_secs_f64();
    }

    fn listen(&mut self, enough: impl Fn(&Self) -> bool) {
        if let Some(work) = self.work.take() {
            work();
        }
        while !enough(self) && self.all.is_none() && !self.is_taken {
            match self.news.recv() {
                Ok(News::States(states)) => self.states = Some(states),
                Ok(News::All(all)) => self.all = Some(all),
                Err(_) => {
                    self.all = Some(Err(
                        PredictError::Inconsistent("the networks gave up").into()
                    ))
                }
            }
        }
    }
}

fn answer(networks: &Mutex<Predictor>, map: &Workspace, problem: &Problem, tell: &Sender<News>) {
    let question = Question {
        map,
        system: &*problem.system,
        start: problem.start,
        task: &problem.task,
    };
    // Nobody may listen any more: the search is over then, and it does not matter.
    let found = {
        let mut networks = networks.lock().unwrap_or_else(PoisonError::into_inner);
        predict_telling(&mut networks, &question, &mut |states| {
            let _ = tell.send(News::States(states.to_vec()));
        })
    };
    let _ = tell.send(News::All(found));
}
