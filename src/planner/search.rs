//! The search: what it holds, and when it ends.

mod ground;
mod growth;
mod limits;
mod plans;
mod turns;

use std::time::{Duration, Instant};

use rustc_hash::FxHashMap;

use super::parallel::{self, Race};
use super::polish::Polish;
use super::sampler::{Ahead, Aim, Sampler};
use super::settings::{Settings, Stop};
use super::split::Split;
use super::suffix::SuffixTree;
use super::tree::{NodeId, Tree};
use super::{
    EndReason, First, NotFound, PlanError, Problem, Progress, Solution, Stats, staying_accepts,
};
use crate::plan::{Cost, Path, Waypoint};
use crate::random::{Random, generator};
pub(super) use ground::Ground;
use growth::{grow, grow_to};
use turns::Turn;

/// Iterations between two looks at the clock, the stop flag and the observer, a power of two; fewer where they take long.
const HEARTBEAT: u64 = 32;

/// What may pass between two looks: half of it makes them more frequent.
const PULSE: Duration = Duration::from_millis(20);

/// About so many nodes below those that are rerouted get cheaper in one iteration at most, for each doubling of the tree, and more on large
/// automata: enough in nearly all iterations, and no more than log n.
const ALLOWANCE: usize = 10;

/// Searches of so many iterations get the memory for their prefix tree at once.
const LONG: u64 = 8_192;

/// Searches for a plan of least cost (`nngtl.md`, Problem 1).
///
/// `observe` is called every few iterations. The result depends on problem, sampler and settings
/// alone, except where a time limit or the stop flag ends the search.
///
/// # Errors
/// Settings out of range, a task for another map, or no plan within the budget.
pub fn plan(
    problem: &Problem,
    sampler: &Sampler,
    settings: &Settings,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<Solution, PlanError> {
    settings.validate()?;
    if !(0.0..=1.0).contains(&problem.weight) {
        return Err(PlanError::Weight(problem.weight));
    }
    if *problem.task.nba.alphabet != **problem.system.alphabet() {
        return Err(PlanError::Alphabet);
    }
    let ground = Ground::of(problem);
    if settings.threads > 1 {
        return parallel::search(&ground, sampler, settings, stop, observe);
    }
    Search::new(&ground, sampler, settings, 0).finish_after(stop, observe)
}

/// Searches as [`plan`] does and tells where the time went, whether or not a plan is found.
///
/// # Errors
/// Settings out of range.
pub fn profile(
    problem: &Problem,
    sampler: &Sampler,
    settings: &Settings,
) -> Result<Split, PlanError> {
    settings.validate()?;
    let ground = Ground::of(problem);
    let mut search = Search::new(&ground, sampler, settings, 0);
    search.prefix.measure();
    let stop = Stop::new();
    search.run(&search.deadline(&stop), &mut |_| {});
    let mut split = Split::default();
    search.trees().for_each(|tree| split.add(&tree.split()));
    let known: f64 = split.parts().iter().map(|&(_, seconds)| seconds).sum();
    split.other = search.began.elapsed().as_secs_f64() - known;
    Ok(split)
}

/// The best plan's suffix is entered anew after so many iterations, since ways to it get shorter, and that
/// of one other goal; and other ways and orders of visits are tried.
const ENTRY_PERIOD: u64 = 128;

/// The first such time; from then on also whenever the number of iterations has doubled.
const FIRST_ENTRY: u64 = 8;

/// Whether suffixes are entered anew and other ways are tried now.
fn is_entry_due(iterations: u64) -> bool {
    let doubled = iterations >= FIRST_ENTRY && iterations.is_power_of_two();
    doubled || iterations.is_multiple_of(ENTRY_PERIOD)
}

/// When a search must end, for what takes long between two looks at the clock.
pub(super) struct Deadline<'s> {
    stop: &'s Stop,
    began: Instant,
    budget: Option<Duration>,
}

impl Deadline<'_> {
    fn is_out_of_time(&self) -> bool {
        self.budget.is_some_and(|b| self.began.elapsed() >= b)
    }

    /// Whether it has come.
    pub(super) fn has_come(&self) -> bool {
        self.stop.is_raised() || self.is_out_of_time()
    }
}

/// The best plan so far.
struct Best {
    /// The goal of the trees that it was found at.
    goal: NodeId,
    /// The number of the suffix's point there.
    pivot: usize,
    path: Path,
    cost: Cost,
}

pub(super) struct Search<'a> {
    ground: &'a Ground<'a>,
    problem: &'a Problem,
    /// Who proposes points now.
    sampler: Sampler,
    /// Who does so later, if that is decided later.
    ahead: Option<Ahead>,
    settings: &'a Settings,
    random: Random,
    began: Instant,
    prefix: Tree<'a>,
    /// By automaton state: whether it is a goal of the prefix.
    accepting: Vec<bool>,
    /// By letter and automaton state: whether staying is a suffix.
    staying: Vec<Vec<bool>>,
    /// Goals at which staying is not enough, in the order they were found.
    open_goals: Vec<NodeId>,
    suffixes: Vec<SuffixTree<'a>>,
    suffix_of: FxHashMap<NodeId, usize>,
    suffix_iterations: u64,
    /// No suffix tree is opened before so many of them.
    next_opening: u64,
    turn: u64,
    /// For each node of the prefix tree, whether it is known as a goal.
    known: Vec<bool>,
    best: Option<Best>,
    polish: Option<Polish<'a>>,
    race: Option<&'a Race>,
    stats: Stats,
    // Buffers that are kept between iterations.
    touched: Vec<NodeId>,
    cycle: Vec<Waypoint>,
    order: Vec<(f64, usize)>,
}

impl<'a> Search<'a> {
    /// A search that draws from the seed's stream of this number.
    pub(super) fn new(
        ground: &'a Ground<'a>,
        sampler: &Sampler,
        settings: &'a Settings,
        stream: u64,
    ) -> Self {
        let problem = ground.problem();
        let nba = &problem.task.nba;
        let grown = &ground.advised().nba;
        let mut prefix = Tree::new(&*problem.system, grown, problem.start, &grown.initial);
        prefix.pass_on_at_most(ALLOWANCE + nba.len() / 4);
        if (LONG..u64::MAX).contains(&settings.iterations) {
            prefix.expect(settings.iterations);
        }
        if matches!(sampler, Sampler::Uniform) {
            prefix.expect_sweeps();
        }
        Self {
            ground,
            problem,
            sampler: ground.sampler(sampler),
            ahead: Ahead::of(sampler),
            settings,
            random: generator(settings.seed, stream),
            began: Instant::now(),
            prefix,
            accepting: nba
                .states()
                .map(|q| problem.task.feasible.binary_search(&q).is_ok())
                .collect(),
            staying: staying_accepts(&problem.task),
            open_goals: Vec::new(),
            suffixes: Vec::new(),
            suffix_of: FxHashMap::default(),
            suffix_iterations: 0,
            next_opening: 0,
            turn: 0,
            known: Vec::new(),
            best: None,
            polish: None,
            race: None,
            stats: Stats {
                threads: 1,
                ..Stats::default()
            },
            touched: Vec::new(),
            cycle: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Ends early once another search of the race has won.
    pub(super) fn racing(mut self, race: Option<&'a Race>) -> Self {
        self.race = race;
        self
    }

    pub(super) fn finish_after(
        mut self,
        stop: &Stop,
        observe: &mut dyn FnMut(Progress),
    ) -> Result<Solution, PlanError> {
        let deadline = self.deadline(stop);
        let reason = self.run(&deadline, observe);
        if !self.settings.first {
            self.improve_last(&deadline);
        }
        self.finish(reason)
    }

    fn deadline<'s>(&self, stop: &'s Stop) -> Deadline<'s> {
        Deadline {
            stop,
            began: self.began,
            budget: self.settings.time_budget(),
        }
    }

    fn run(&mut self, deadline: &Deadline<'_>, observe: &mut dyn FnMut(Progress)) -> EndReason {
        let (mut pace, mut looked) = (1, Instant::now());
        self.look_at_prefix(); // the start may be a goal already
        loop {
            if self.settings.first && self.best.is_some() {
                return EndReason::First;
            }
            if self.stats.iterations >= self.settings.iterations {
                return EndReason::Iterations;
            }
            if self.stats.iterations.is_multiple_of(pace) {
                let passed = looked.elapsed();
                looked += passed;
                pace = match passed {
                    p if p > PULSE / 2 => (pace / 2).max(1),
                    p if p < PULSE / 8 => (pace * 2).min(HEARTBEAT),
                    _ => pace,
                };
                observe(Progress {
                    iterations: self.stats.iterations,
                    nodes: self.node_count(),
                    cost: self.best.as_ref().map(|b| b.cost.total),
                });
                if deadline.stop.is_raised() {
                    return EndReason::Stopped;
                }
                if self.race.is_some_and(|r| r.is_lost(self.stats.iterations)) {
                    return EndReason::First;
                }
                if deadline.is_out_of_time() {
                    return EndReason::Time;
                }
            }
            self.stats.iterations += 1;
            if let Some(ahead) = &mut self.ahead
                && let Some(next) = ahead.successor(self.stats.iterations)
            {
                self.sampler = self.ground.sampler(&next);
            }
            match self.choose_turn() {
                Turn::Prefix => self.grow_prefix(),
                Turn::Suffix(i) => self.grow_suffix(i),
            }
            self.shorten();
            if is_entry_due(self.stats.iterations) {
                self.enter_again(deadline);
            }
        }
    }

    fn grow_prefix(&mut self) {
        let reached = self.stats.first_prefix.is_some();
        let aim = Aim::Prefix { reached };
        let limit = self.prefix_limit();
        self.inform_prefix();
        self.prefix.limit(limit);
        let beacon = self.polish.as_mut().and_then(|p| p.beacons.pop_front());
        let grown = match beacon {
            Some(at) => grow_to(self.problem, self.settings, &mut self.prefix, at),
            None => grow(
                (self.problem, self.ground.advised()),
                &self.sampler,
                self.settings,
                &mut self.prefix,
                aim,
                limit,
                &mut self.random,
            ),
        };
        self.stats.failed_samples += u64::from(!grown);
        self.look_at_prefix();
    }

    fn grow_suffix(&mut self, i: usize) {
        let limit = self.suffix_limit(self.prefix.cost(self.suffixes[i].goal));
        self.inform_suffix(i);
        let suffix = &mut self.suffixes[i];
        suffix.tree.limit(limit);
        suffix.renew(&self.prefix);
        let aim = suffix.aim(&mut self.random);
        suffix.iterations += 1;
        self.suffix_iterations += 1;
        let grown = grow(
            (self.problem, self.ground.advised()),
            &self.sampler,
            self.settings,
            &mut suffix.tree,
            aim,
            // There and back again.
            limit / 2.0,
            &mut self.random,
        );
        self.stats.failed_samples += u64::from(!grown);
        if suffix.close(&*self.problem.system, &self.problem.task.nba) && self.is_worth_entering(i)
        {
            self.consider_suffix(i);
        }
    }

    fn first(&self, cost: f64) -> First {
        First {
            iterations: self.stats.iterations,
            nodes: self.node_count(),
            seconds: self.began.elapsed().as_secs_f64(),
            cost,
        }
    }

    fn trees(&self) -> impl Iterator<Item = &Tree<'a>> {
        std::iter::once(&self.prefix).chain(self.suffixes.iter().map(|s| &s.tree))
    }

    fn node_count(&self) -> u64 {
        self.trees().map(|t| t.len() as u64).sum()
    }

    fn finish(mut self, reason: EndReason) -> Result<Solution, PlanError> {
        self.stats.nodes = self.node_count();
        self.stats.sites = self.trees().map(|t| t.site_count() as u64).sum();
        self.stats.suffix_trees = self.suffixes.len() as u64;
        self.stats.seconds = self.began.elapsed().as_secs_f64();
        let edges = self.trees().flat_map(Tree::edges).map(|(a, b)| [a, b]);
        let edges = edges.collect();
        let Some(mut best) = self.best.take() else {
            let task = &self.problem.task;
            let own = |q| self.ground.own(q);
            let found = NotFound::after(task, own, &self.prefix, self.stats, reason, edges);
            return Err(PlanError::NotFound(Box::new(found)));
        };
        self.ground.restore(&mut best.path);
        Ok(Solution {
            path: best.path,
            cost: best.cost,
            stats: self.stats,
            edges,
        })
    }
}
