//! Networks that answer while the search goes on.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::MissionError;
use super::guide::{Prediction, Question, predict_telling};
use crate::nn::{PredictError, Predictor};
use crate::planner::{Ask, Deferred, Guide, HeadStart, Problem};
use crate::workspace::Workspace;

/// Both networks, to be asked about a mission: on a thread of their own, or, where the machine has no core to spare or that thread is
/// still busy with another mission, on the caller's when it waits for them.
///
/// A search that goes by [`Self::sampler`] draws its first samples without them, lets them begin then, and waits for StateNet and for
/// PathNet only before the samples that follow their answers. What it draws depends on those moments, which are counted in samples,
/// and not on how long the networks take.
#[derive(Clone)]
pub struct Thinking(Arc<Mutex<Listener>>);

struct Listener {
    work: Arc<Work>,
    aside: bool,
    news: Receiver<News>,
    states: Option<Vec<f32>>,
    all: Option<Result<Answer, MissionError>>,
    is_taken: bool,
    is_asked: bool,
    waited: [f64; 2],
}

/// What is to be done, until somebody begins to do it.
struct Work(Mutex<Option<Box<dyn FnOnce() + Send>>>);

impl Work {
    fn take(&self) -> Option<Box<dyn FnOnce() + Send>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Does it, if nobody else has begun.
    fn run(&self) {
        if let Some(work) = self.take() {
            // Who waits for what a panic keeps from him is told that nobody is left to say it.
            let _ = catch_unwind(AssertUnwindSafe(work));
        }
    }
}

/// The thread of the networks, if there can be one. It lasts as long as the program: to start one for each mission takes longer than
/// many a mission's first samples.
static THREAD: LazyLock<Option<Sender<Arc<Work>>>> = LazyLock::new(|| {
    let (give, given) = channel::<Arc<Work>>();
    let work = move || given.iter().for_each(|work| work.run());
    let name = std::thread::Builder::new().name("networks".to_owned());
    name.spawn(work).ok().map(|_| give)
});

/// What both networks say, and what a search makes of it: sums over the heatmap, which are found where the search does not wait.
struct Answer {
    prediction: Prediction,
    guide: Option<Guide>,
}

enum News {
    States(Vec<f32>),
    All(Result<Answer, MissionError>),
}

impl Thinking {
    /// The networks and a mission; what they are asked they answer `aside`, on a thread of their own.
    #[must_use]
    pub fn new(
        networks: Arc<Mutex<Predictor>>,
        map: Arc<Workspace>,
        problem: Problem,
        aside: bool,
    ) -> Self {
        let (tell, news) = channel();
        let answer = move || answer(&networks, &map, &problem, &tell);
        let work = Arc::new(Work(Mutex::new(Some(Box::new(answer)))));
        Self(Arc::new(Mutex::new(Listener {
            work,
            aside,
            news,
            states: None,
            all: None,
            is_taken: false,
            is_asked: false,
            waited: [0.0; 2],
        })))
    }

    /// Lets them begin, where that can be beside what the caller does next.
    pub fn begin(&self) {
        let listener = self.lock();
        if let Some(thread) = THREAD.as_ref().filter(|_| listener.aside) {
            // Where nobody does it meanwhile, it is done by who waits for it.
            let _ = thread.send(Arc::clone(&listener.work));
        }
    }

    /// Directed sampling at first; when the head start is over, by the states alone, and then by the heatmap, too.
    #[must_use]
    pub fn sampler(&self, head_start: HeadStart, problem: &Problem) -> Arc<Deferred> {
        let count = problem.task.nba.len();
        let [beginning, first, second] = std::array::from_fn(|_| self.clone());
        let by_states: Ask = Box::new(move || first.by_states(count));
        let by_all: Ask = Box::new(move || second.by_all());
        let questions = [(head_start.states, by_states), (head_start.heatmap, by_all)];
        let begin = Box::new(move || beginning.begin());
        Arc::new(Deferred::in_stages(questions).beginning(head_start.begin, begin))
    }

    /// Waits until they are through, if they have begun; they will not begin any more.
    pub fn settle(&self) {
        let mut listener = self.lock();
        if listener.work.take().is_none() {
            listener.listen(|l| l.all.is_some());
        }
    }

    /// What they say, once they have said it; `None` if that was taken already.
    pub fn finish(&self) -> Option<Result<Prediction, MissionError>> {
        let mut listener = self.lock();
        listener.listen(|l| l.all.is_some());
        listener.is_taken = true;
        let answer = listener.all.take()?;
        Some(answer.map(|answer| answer.prediction))
    }

    /// Whether a search has waited for them.
    pub(super) fn is_asked(&self) -> bool {
        self.lock().is_asked
    }

    /// Seconds that searches have waited for StateNet's and then for PathNet's answer.
    #[must_use]
    pub fn waited(&self) -> [f64; 2] {
        self.lock().waited
    }

    fn by_states(&self, count: usize) -> Option<Guide> {
        let mut listener = self.lock();
        listener.wait(0, |l| l.states.is_some() || l.all.is_some());
        let states = listener.states.as_deref()?;
        Guide::of_states(states, count).ok()
    }

    fn by_all(&self) -> Option<Guide> {
        let mut listener = self.lock();
        listener.wait(1, |l| l.all.is_some());
        listener.all.as_mut()?.as_mut().ok()?.guide.take()
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

impl Drop for Listener {
    fn drop(&mut self) {
        self.work.take(); // nobody wants to know any more
    }
}

impl Listener {
    /// Waits for a search that needs the answer of this number.
    fn wait(&mut self, answer: usize, enough: impl Fn(&Self) -> bool) {
        let began = Instant::now();
        self.is_asked = true;
        self.listen(enough);
        self.waited[answer] += began.elapsed().as_secs_f64();
    }

    fn listen(&mut self, enough: impl Fn(&Self) -> bool) {
        self.work.run();
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
    let answer = found.map(|prediction| Answer {
        guide: Guide::new(&prediction.guidance, problem.task.nba.len()).ok(),
        prediction,
    });
    let _ = tell.send(News::All(answer));
}
