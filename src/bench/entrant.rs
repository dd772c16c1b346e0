//! What contenders search with, and what of the networks' time counts.

use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use super::{BenchError, Case, Contender, Strategy};
use crate::guidance::Guidance;
use crate::planner::{
    Ask, Deferred, Guide, HeadStart, PlanError, Sampler, Settings, Solution, Stop, plan,
};

/// Networks that a search asks about its mission.
#[derive(Clone)]
pub struct Live(Arc<dyn Fn(HeadStart) -> Asked + Send + Sync>);

/// Networks that a search will ask.
pub struct Asked {
    /// What searches as they will have answered.
    pub sampler: Arc<Deferred>,
    /// Waits until they are through, if they have begun: another search must not have them beside it. Returns the seconds that the
    /// search waited for StateNet and for PathNet.
    pub finish: Box<dyn FnOnce() -> [f64; 2]>,
}

impl Live {
    /// Asks in this way; told are the samples that a search draws before.
    pub fn new(ask: impl Fn(HeadStart) -> Asked + Send + Sync + 'static) -> Self {
        Self(Arc::new(ask))
    }
}

impl fmt::Debug for Live {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Live").finish_non_exhaustive()
    }
}

impl Case {
    /// Lets every contender that can search here do so that often, with seeds that count up from the settings'; contenders take turns as
    /// the mission has them, and the results stand in their order. `None` as soon as a search says so.
    pub(super) fn searches<T: Clone>(
        &self,
        contenders: &[Contender],
        settings: &Settings,
        trials: u64,
        mut search: impl FnMut(&Contender, &Entrant, &Settings) -> Result<Option<T>, BenchError>,
    ) -> Result<Option<Vec<T>>, BenchError> {
        let mut found: Vec<Vec<T>> = vec![Vec::new(); contenders.len()];
        for turn in self.turns(contenders.len()) {
            let contender = &contenders[turn];
            let Some(entrant) = self.entrant(contender, settings)? else {
                continue;
            };
            for k in 0..trials {
                let settings = Settings {
                    seed: settings.seed.wrapping_add(k),
                    ..settings.clone()
                };
                let Some(result) = search(contender, &entrant, &settings)? else {
                    return Ok(None);
                };
                found[turn].push(result);
            }
        }
        Ok(Some(found.concat()))
    }

    /// What a contender searches with; `None` if it needs predictions that this mission lacks.
    fn entrant(
        &self,
        contender: &Contender,
        settings: &Settings,
    ) -> Result<Option<Entrant>, BenchError> {
        let states = self.problem.task.nba.len();
        let fits = |source| BenchError::Guidance {
            case: self.name.clone(),
            source,
        };
        let guide = |guidance: &Guidance| Guide::new(guidance, states).map_err(fits);
        let guided = |guidance: &Guidance| Ok(Sampler::Guided(Arc::new(guide(guidance)?)));
        let sampler = match contender.strategy {
            Strategy::Uniform => Sampler::Uniform,
            Strategy::Biased => Sampler::Biased,
            Strategy::Directed => Sampler::Directed,
            Strategy::Flat => guided(&Guidance::flat(states))?,
            Strategy::Guided => {
                let Some(prediction) = self.prediction(contender) else {
                    return Ok(None);
                };
                let head_start = settings.head_start();
                let guide = guide(&prediction.guidance)?;
                if let Some(live) = &prediction.live {
                    return Ok(Some(Entrant::Live(live.clone(), head_start)));
                }
                let by_states = Guide::of_states(&prediction.guidance.states, states);
                let by_states = by_states.map_err(fits)?;
                let HeadStart {
                    states, heatmap, ..
                } = head_start;
                return Ok(Some(Entrant::Asks {
                    sampler: Sampler::Deferred(Arc::new(Deferred::in_stages([
                        (states, Box::new(|| Some(by_states)) as Ask),
                        (heatmap, Box::new(|| Some(guide)) as Ask),
                    ]))),
                    after: states,
                }));
            }
            Strategy::Auto => {
                let predicted = self.prediction(contender).map(|p| guide(&p.guidance));
                let found = predicted.transpose()?;
                let after = Deferred::WORTH_IT;
                return Ok(Some(Entrant::Asks {
                    sampler: Sampler::Deferred(Arc::new(Deferred::new(after, || found))),
                    after,
                }));
            }
            Strategy::Oracle => match &self.labels {
                Some(labels) => guided(labels)?,
                None => return Ok(None),
            },
        };
        Ok(Some(Entrant::Plain(sampler)))
    }
}

/// What a contender searches with.
pub(super) enum Entrant {
    /// A sampler that asks no networks.
    Plain(Sampler),
    /// One that knows what they said, and whose time counts as if it had asked them after so many samples.
    Asks { sampler: Sampler, after: u64 },
    /// The networks themselves.
    Live(Live, HeadStart),
}

/// What encoding and networks took of a search.
pub(super) enum Networks {
    /// Their seconds are to be added to the search's from this sample on.
    After(u64),
    /// They ran meanwhile; among the search's seconds are these, in which it waited for StateNet and for PathNet.
    Waited(HeadStart, [f64; 2]),
}

impl Networks {
    /// Takes what was waited out of the time that a search had taken after so many samples.
    pub(super) fn without(&self, samples: u64, seconds: f64) -> f64 {
        match self {
            Self::After(_) => seconds,
            Self::Waited(head_start, waited) => {
                let after = [head_start.states, head_start.heatmap];
                let waited = after.iter().zip(waited);
                seconds - waited.filter(|w| samples > *w.0).map(|w| w.1).sum::<f64>()
            }
        }
    }
}

impl Entrant {
    /// Searches; tells what the search did, and what the networks took of it.
    pub(super) fn search(
        &self,
        case: &Case,
        settings: &Settings,
        stop: &Stop,
    ) -> (Result<Solution, PlanError>, Networks) {
        // No search profits from what another one found out about the map.
        case.problem.system.forget();
        let run = |sampler: &Sampler| plan(&case.problem, sampler, settings, stop, &mut |_| {});
        match self {
            Self::Plain(sampler) => (run(sampler), Networks::After(0)),
            Self::Asks { sampler, after } => (run(sampler), Networks::After(*after)),
            Self::Live(live, head_start) => {
                let began = Instant::now();
                let Asked { sampler, finish } = (live.0)(*head_start);
                let asking = began.elapsed().as_secs_f64();
                let mut found = run(&Sampler::Deferred(sampler));
                let waited = finish();
                match &mut found {
                    Ok(solution) => solution.stats.delay(asking),
                    Err(PlanError::NotFound(why)) => why.stats.delay(asking),
                    Err(_) => {}
                }
                (found, Networks::Waited(*head_start, waited))
            }
        }
    }
}
