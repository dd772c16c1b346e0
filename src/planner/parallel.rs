//! Several independent searches on several cores; the best plan wins.

use std::sync::atomic::{AtomicU64, Ordering};

use super::sampler::Sampler;
use super::search::{Ground, Search};
use super::settings::{Settings, Stop};
use super::{PlanError, Progress, Solution, Stats};

/// How many searches run side by side at most.
pub(super) const MAX_THREADS: usize = 256;

/// The iteration at which the first plan of any search was found: with `first` no search goes on
/// beyond it, since it could not win any more. What it reads while others run may differ between
/// runs; what wins does not.
#[derive(Debug)]
pub(super) struct Race(AtomicU64);

impl Race {
    fn new() -> Self {
        Self(AtomicU64::new(u64::MAX))
    }

    /// Whether a search that has done so many iterations without a plan has lost.
    pub(super) fn is_lost(&self, iterations: u64) -> bool {
        self.0.load(Ordering::Relaxed) < iterations
    }

    fn won(&self, iterations: u64) {
        self.0.fetch_min(iterations, Ordering::Relaxed);
    }
}

/// Runs `settings.threads` searches with the same settings and streams of randomness of their own,
/// each with the whole budget. The cheapest plan wins, with `first` the one found in the fewest
/// iterations, of equal ones that of the lowest number; so the result depends on the seed and the
/// number of threads, not on the machine. Only the first search is observed.
pub(super) fn search(
    ground: &Ground<'_>,
    sampler: &Sampler,
    settings: &Settings,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<Solution, PlanError> {
    let race = Race::new();
    let run = |stream: u64, observe: &mut dyn FnMut(Progress)| {
        let found = Search::new(ground, sampler, settings, stream)
            .racing(settings.first.then_some(&race))
            .finish_after(stop, observe);
        if let Ok(solution) = &found {
            race.won(solution.stats.iterations);
        }
        found
    };
    let all = std::thread::scope(|scope| {
        let others: Vec<_> = (1..settings.threads as u64)
            .map(|stream| scope.spawn(move || run(stream, &mut |_| {})))
            .collect();
        let mut all = vec![run(0, observe)];
        for other in others {
            match other.join() {
                Ok(found) => all.push(found),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    });
    merge(all, settings.first)
}

fn merge(all: Vec<Result<Solution, PlanError>>, first: bool) -> Result<Solution, PlanError> {
    let key = |s: &Solution| {
        if first {
            s.stats.iterations as f64
        } else {
            s.cost.total
        }
    };
    let mut total = Stats::default();
    let mut best: Option<Result<Solution, PlanError>> = None;
    for found in all {
        match &found {
            Ok(solution) => total.add(&solution.stats),
            Err(PlanError::NotFound(why)) => total.add(&why.stats),
            Err(_) => return found,
        }
        let better = match (&best, &found) {
            (None, _) | (Some(Err(_)), Ok(_)) => true,
            (Some(Ok(old)), Ok(new)) => key(new) < key(old),
            (Some(Err(PlanError::NotFound(old))), Err(PlanError::NotFound(new))) => {
                new.steps_left < old.steps_left
            }
            _ => false,
        };
        if better {
            best = Some(found);
        }
    }
    let mut best = best.unwrap_or(Err(PlanError::Unreachable("no search was run".to_owned())));
    match &mut best {
        Ok(solution) => solution.stats.take_totals(&total),
        Err(PlanError::NotFound(why)) => why.stats.take_totals(&total),
        Err(_) => {}
    }
    best
}

impl Stats {
    /// Adds what another search did.
    fn add(&mut self, other: &Self) {
        self.threads += other.threads;
        self.iterations += other.iterations;
        self.failed_samples += other.failed_samples;
        self.nodes += other.nodes;
        self.sites += other.sites;
        self.goals += other.goals;
        self.suffix_trees += other.suffix_trees;
        self.seconds = self.seconds.max(other.seconds);
    }

    /// Counts the work of all searches; firsts and improvements stay those of the winner.
    fn take_totals(&mut self, total: &Self) {
        let (first_prefix, first_plan) = (self.first_prefix, self.first_plan);
        let improvements = std::mem::take(&mut self.improvements);
        *self = Self {
            first_prefix,
            first_plan,
            improvements,
            ..total.clone()
        };
    }
}
