//! The search: which tree grows next, what counts as a plan, when to end.

use std::collections::HashMap;
use std::time::Instant;

use super::parallel::{self, Race};
use super::polish::Polish;
use super::sampler::{Aim, Draw, Sampler, View};
use super::settings::{Settings, Stop};
use super::split::Split;
use super::suffix::{Entry, SuffixTree};
use super::tree::{NodeId, Tree};
use super::{
    EndReason, First, Improvement, NotFound, PlanError, Problem, Progress, Solution, Stats,
    staying_accepts,
};
use crate::plan::{Cost, Path, Waypoint};
use crate::random::{Random, generator};
use crate::shorten::Shortener;

/// Iterations between two looks at the clock, the stop flag and the observer.
const HEARTBEAT: u64 = 32;

/// Another suffix tree is opened once the open ones have had this many iterations each, times
/// their number: none of them can block the others, and few are grown deep.
const SUFFIX_QUANTUM: u64 = 40;

/// So many nodes below those that are rerouted get cheaper in one iteration at most: more than in
/// nearly all iterations on automata of a few states.
const ALLOWANCE: usize = 2_000;

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
    if settings.threads > 1 {
        return parallel::search(problem, sampler, settings, stop, observe);
    }
    Search::new(problem, sampler, settings, 0).finish_after(stop, observe)
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
    let mut search = Search::new(problem, sampler, settings, 0);
    search.prefix.measure();
    search.run(&Stop::new(), &mut |_| {});
    let mut split = Split::default();
    search.trees().for_each(|tree| split.add(&tree.split()));
    let known: f64 = split.parts().iter().map(|&(_, seconds)| seconds).sum();
    split.other = search.began.elapsed().as_secs_f64() - known;
    Ok(split)
}

/// The best plan's suffix is entered anew after so many iterations, since ways to it get shorter; and that
/// of one other goal.
const ENTRY_PERIOD: u64 = 128;

/// The best plan so far.
struct Best {
    /// The goal of the trees that it was found at.
    goal: NodeId,
    /// The number of the suffix's point there.
    pivot: usize,
    path: Path,
    cost: Cost,
}

/// Which tree an iteration goes to.
#[derive(Clone, Copy)]
enum Turn {
    Prefix,
    Suffix(usize),
}

pub(super) struct Search<'a> {
    problem: &'a Problem,
    sampler: &'a Sampler,
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
    suffix_of: HashMap<NodeId, usize>,
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
    touched: Vec<NodeId>,
}

impl<'a> Search<'a> {
    /// A search that draws from the seed's stream of this number.
    pub(super) fn new(
        problem: &'a Problem,
        sampler: &'a Sampler,
        settings: &'a Settings,
        stream: u64,
    ) -> Self {
        let nba = &problem.task.nba;
        let mut prefix = Tree::new(&*problem.system, nba, problem.start, &nba.initial);
        prefix.pass_on_at_most(ALLOWANCE);
        Self {
            problem,
            sampler,
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
            suffix_of: HashMap::new(),
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
        let reason = self.run(stop, observe);
        self.finish(reason)
    }

    fn run(&mut self, stop: &Stop, observe: &mut dyn FnMut(Progress)) -> EndReason {
        let budget = self.settings.time_budget();
        self.look_at_prefix(); // the start may be a goal already
        loop {
            if self.settings.first && self.best.is_some() {
                return EndReason::First;
            }
            if self.stats.iterations >= self.settings.iterations {
                return EndReason::Iterations;
            }
            if self.stats.iterations.is_multiple_of(HEARTBEAT) {
                observe(Progress {
                    iterations: self.stats.iterations,
                    nodes: self.node_count(),
                    cost: self.best.as_ref().map(|b| b.cost.total),
                });
                if stop.is_raised() {
                    return EndReason::Stopped;
                }
                if self.race.is_some_and(|r| r.is_lost(self.stats.iterations)) {
                    return EndReason::First;
                }
                if budget.is_some_and(|b| self.began.elapsed() >= b) {
                    return EndReason::Time;
                }
            }
            self.stats.iterations += 1;
            match self.choose_turn() {
                Turn::Prefix => self.grow_prefix(),
                Turn::Suffix(i) => self.grow_suffix(i),
            }
            self.shorten();
            if self.stats.iterations.is_multiple_of(ENTRY_PERIOD) {
                self.enter_again();
            }
        }
    }

    /// Without a goal the prefix tree grows. With goals but no plan, three of four iterations
    /// look for ways back from the cheapest goals, in turn. With a plan, every second iteration goes to
    /// the prefix, the others to suffix trees that can still lead to a cheaper plan.
    fn choose_turn(&mut self) -> Turn {
        if self.open_goals.is_empty() {
            return Turn::Prefix;
        }
        self.turn += 1;
        let prefix_turn = match self.best {
            None => self.turn.is_multiple_of(4),
            Some(_) => self.turn.is_multiple_of(2),
        };
        if prefix_turn {
            return Turn::Prefix;
        }
        self.choose_suffix().map_or(Turn::Prefix, Turn::Suffix)
    }

    fn choose_suffix(&mut self) -> Option<usize> {
        let trees = self.suffixes.len() as u64;
        let due = (SUFFIX_QUANTUM * trees * trees).max(self.next_opening);
        if self.suffix_iterations >= due {
            if let Some(goal) = self.most_promising_goal() {
                self.open_suffix(goal);
                return Some(self.suffixes.len() - 1);
            }
            // Looking through all goals takes time: not again at once.
            self.next_opening =
                self.suffix_iterations + SUFFIX_QUANTUM.max(self.open_goals.len() as u64);
        }
        // The tree of the best plan gets every second turn, the others share the rest.
        let best = self.best.as_ref().and_then(|b| self.suffix_of.get(&b.goal));
        if let Some(&i) = best
            && self.turn % 4 == 1
        {
            return Some(i);
        }
        let promising = |s: &SuffixTree<'_>| self.can_improve(self.prefix.cost(s.goal));
        (0..self.suffixes.len())
            .filter(|&i| promising(&self.suffixes[i]))
            .min_by_key(|&i| self.suffixes[i].iterations)
    }

    /// The goal without a suffix tree whose plan could be cheapest, if any could be better than
    /// the best plan. Every second one is of a kind that has the fewest trees: cycles through one accepting state, or one
    /// region, may be long or impossible whatever the goal, and through another one short.
    fn most_promising_goal(&self) -> Option<NodeId> {
        let kind = |g: NodeId| (self.prefix.state(g), self.prefix.spot(g).letter);
        let mut trees: HashMap<_, usize> = HashMap::new();
        if !self.suffixes.len().is_multiple_of(2) {
            for suffix in &self.suffixes {
                *trees.entry(kind(suffix.goal)).or_default() += 1;
            }
        }
        let trees = |g: NodeId| trees.get(&kind(g)).copied().unwrap_or(0);
        let cost = |g: NodeId| self.prefix.cost(g) + self.detour(g);
        let unopened = |g: &NodeId| !self.suffix_of.contains_key(g);
        let goals = self.open_goals.iter().copied().filter(unopened);
        goals
            .filter(|&g| self.can_improve(self.prefix.cost(g)))
            .map(|g| (trees(g), cost(g), g))
            .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)))
            .map(|(_, _, g)| g)
    }

    /// By how much the best suffix would get longer (or, negative, shorter) if it passed the given
    /// goal instead of its own, weighted against the prefix. 0 while there is no suffix.
    fn detour(&self, goal: NodeId) -> f64 {
        let moves = |b: &&Best| b.path.suffix.len() > 2;
        let Some(Best { path, pivot, .. }) = self.best.as_ref().filter(moves) else {
            return 0.0;
        };
        let distance = |a, b| self.problem.system.distance(a, b);
        let count = path.suffix.len() - 1;
        let point = |i: usize| path.suffix[i % count].at;
        let (before, root, after) = (point(pivot + count - 1), point(*pivot), point(pivot + 1));
        let at = self.prefix.spot(goal).at;
        let change = distance(before, at) + distance(at, after)
            - distance(before, root)
            - distance(root, after);
        let weight = self.problem.weight.max(1e-9);
        change * (1.0 - self.problem.weight) / weight
    }

    /// Whether a plan by a goal with a way of this length can be cheaper than the best. The way is part of the
    /// prefix as far as the suffix's entry, and of the suffix from there.
    fn can_improve(&self, way: f64) -> bool {
        let bound = self.least_share() * way;
        self.best.as_ref().is_none_or(|b| bound < b.cost.total)
    }

    /// The least that a unit of length costs.
    fn least_share(&self) -> f64 {
        self.problem.weight.min(1.0 - self.problem.weight)
    }

    fn open_suffix(&mut self, goal: NodeId) {
        let tree = SuffixTree::of(&self.prefix, goal);
        self.suffix_of.insert(goal, self.suffixes.len());
        self.suffixes.push(tree);
    }

    fn grow_prefix(&mut self) {
        let reached = self.stats.first_prefix.is_some();
        let aim = Aim::Prefix { reached };
        let limit = self.limit(0.0, self.least_share());
        self.prefix.limit(limit);
        let beacon = self.polish.as_mut().and_then(|p| p.beacons.pop_front());
        let grown = match beacon {
            Some(at) => grow_to(self.problem, self.settings, &mut self.prefix, at),
            None => grow(
                self.problem,
                self.sampler,
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
        let suffix = &mut self.suffixes[i];
        suffix.tree.limit(limit);
        let aim = Aim::Suffix {
            state: suffix.state,
            closed: suffix.is_closed(),
        };
        suffix.iterations += 1;
        self.suffix_iterations += 1;
        let grown = grow(
            self.problem,
            self.sampler,
            self.settings,
            &mut suffix.tree,
            aim,
            // There and back again.
            limit / 2.0,
            &mut self.random,
        );
        self.stats.failed_samples += u64::from(!grown);
        if suffix.close(&*self.problem.system, &self.problem.task.nba) {
            self.consider_suffix(i);
        }
    }

    /// Takes note of goals that are new or cheaper.
    fn look_at_prefix(&mut self) {
        let mut touched = std::mem::take(&mut self.touched);
        self.prefix.take_touched(&mut touched);
        self.known.resize(self.prefix.len(), false);
        for &node in &touched {
            let state = self.prefix.state(node);
            if !self.accepting[state.index()] {
                continue;
            }
            let letter = self.prefix.spot(node).letter;
            let stays = self.staying[letter.index()][state.index()];
            if !std::mem::replace(&mut self.known[node.index()], true) {
                self.stats.goals += 1;
                if !stays {
                    self.open_goals.push(node);
                }
                if self.stats.first_prefix.is_none() {
                    self.stats.first_prefix = Some(self.first(self.prefix.cost(node)));
                }
            }
            if stays {
                let at = self.prefix.spot(node).at;
                self.consider_staying(node, Waypoint { at, state });
            } else if let Some(&i) = self.suffix_of.get(&node) {
                self.consider_suffix(i);
            }
        }
        self.touched = touched;
    }

    /// The plan that stays at a goal.
    fn consider_staying(&mut self, goal: NodeId, here: Waypoint) {
        let cost = Cost::new(self.prefix.length_to(goal), 0.0, self.problem.weight);
        self.offer(goal, None, cost);
        if self.is_better(cost) {
            let (prefix, suffix) = (self.prefix.path(goal), vec![here]);
            self.keep(goal, Path { prefix, suffix }, cost);
        }
    }

    /// The plan whose suffix is the shortest way back that a suffix tree knows, entered where that is
    /// cheapest.
    fn consider_suffix(&mut self, i: usize) {
        let suffix = &self.suffixes[i];
        let (Some(length), Some(cycle)) = (suffix.length(), suffix.path()) else {
            return;
        };
        let goal = suffix.goal;
        let Some((entry, cost)) = self.enter(&cycle, length) else {
            return;
        };
        self.offer(goal, Some(i), cost);
        if self.is_better(cost) {
            self.keep(goal, entry.path(&self.prefix, &cycle), cost);
        }
    }

    /// Where a cycle is entered most cheaply, and what that costs.
    fn enter(&mut self, cycle: &[Waypoint], length: f64) -> Option<(Entry, Cost)> {
        let system = &*self.problem.system;
        let side = system.bounds().side();
        let near = self.settings.near(self.prefix.site_count(), side);
        let entry = Entry::cheapest(&mut self.prefix, system, cycle, near, f64::INFINITY)?;
        Some((entry, Cost::new(entry.length, length, self.problem.weight)))
    }

    /// Looks for better entries to the best plan's suffix and, in turn, to those of other goals.
    fn enter_again(&mut self) {
        let Some(best) = &mut self.best else { return };
        if best.path.suffix.len() > 1 {
            let (goal, length) = (best.goal, best.cost.suffix);
            let cycle = std::mem::take(&mut best.path.suffix);
            let found = self.enter(&cycle, length);
            match found {
                Some((entry, cost)) if self.is_better(cost) => {
                    self.keep(goal, entry.path(&self.prefix, &cycle), cost);
                }
                _ => {
                    if let Some(best) = &mut self.best {
                        best.path.suffix = cycle;
                    }
                }
            }
        }
        if !self.suffixes.is_empty() {
            let turn = self.stats.iterations / ENTRY_PERIOD;
            self.consider_suffix((turn % self.suffixes.len() as u64) as usize);
        }
    }

    /// Takes note of a plan as one that could be shortened.
    fn offer(&mut self, goal: NodeId, tree: Option<usize>, cost: Cost) {
        // Not before there is something to shorten: a first plan should not wait for it.
        if self.polish.is_none() && self.settings.shortens() {
            let map = self.problem.system.plane();
            let shortener = |map| Shortener::new(map, &self.problem.task, self.problem.weight);
            self.polish = map.map(|map| Polish::new(shortener(map)));
        }
        if let Some(polish) = &mut self.polish {
            let kind = (self.prefix.state(goal), self.prefix.spot(goal).letter, tree);
            polish.offer(kind, goal, cost.total);
        }
    }

    fn is_better(&self, cost: Cost) -> bool {
        self.best.as_ref().is_none_or(|b| cost.total < b.cost.total)
    }

    fn keep(&mut self, goal: NodeId, path: Path, cost: Cost) {
        let pivot = self.pivot(goal, &path.suffix);
        self.best = Some(Best {
            goal,
            pivot,
            path,
            cost,
        });
        if self.stats.first_plan.is_none() {
            self.stats.first_plan = Some(self.first(cost.total));
        }
        self.stats.improvements.push(Improvement {
            iterations: self.stats.iterations,
            seconds: self.began.elapsed().as_secs_f64(),
            cost: cost.total,
        });
    }

    /// The point of a suffix that stands for the goal it was found at: of those in its state the nearest.
    fn pivot(&self, goal: NodeId, suffix: &[Waypoint]) -> usize {
        let (at, state) = (self.prefix.spot(goal).at, self.prefix.state(goal));
        let distance = |i: &usize| self.problem.system.distance(suffix[*i].at, at);
        let count = suffix.len().saturating_sub(1).max(1);
        (0..count)
            .filter(|&i| suffix[i].state == state)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap_or(0)
    }

    /// Shortens a candidate, if one is due.
    fn shorten(&mut self) {
        let (Some(polish), Some(best)) = (&mut self.polish, &self.best) else {
            return;
        };
        let Some(next) = polish.next(self.stats.iterations, best.cost.total) else {
            return;
        };
        let path = match next.kind.2 {
            None => {
                let prefix = self.prefix.path(next.goal);
                let suffix = prefix.last().map(|&end| vec![end]);
                suffix.map(|suffix| Path { prefix, suffix })
            }
            Some(i) => self.suffixes[i].path().and_then(|cycle| {
                let (entry, _) = self.enter(&cycle, 0.0)?;
                Some(entry.path(&self.prefix, &cycle))
            }),
        };
        let shorten = |path| self.polish.as_ref().and_then(|p| p.shorten(&path));
        let Some((path, cost)) = path.and_then(shorten) else {
            return;
        };
        if self.is_better(cost) {
            let points = path.prefix.iter().skip(1).map(|w| w.at);
            if let Some(polish) = &mut self.polish {
                polish.beacons.clear();
                polish.beacons.extend(points);
            }
            self.keep(next.goal, path, cost);
        }
    }

    /// The length that a part of weight `share` must stay below for a plan to beat the best, where
    /// `known` is the cost of the rest at least.
    fn limit(&self, known: f64, share: f64) -> f64 {
        match &self.best {
            Some(best) if self.settings.informed && share > 1e-9 => {
                (best.cost.total - known) / share
            }
            _ => f64::INFINITY,
        }
    }

    /// The length that a suffix by a goal with a way of this length must stay below for its plan to beat the
    /// best: the way is part of the prefix, but for as much of it as the suffix may hold.
    fn suffix_limit(&self, way: f64) -> f64 {
        let (before, after) = (self.problem.weight, 1.0 - self.problem.weight);
        let whole = self.limit(0.0, after);
        if !whole.is_finite() || whole >= way {
            return whole;
        }
        // Shorter than the way: so the prefix is what is left of it at least.
        if before < after {
            self.limit(before * way, after - before)
        } else {
            0.0
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
        let Some(best) = self.best.take() else {
            let task = &self.problem.task;
            let found = NotFound::after(task, &self.prefix, self.stats, reason, edges);
            return Err(PlanError::NotFound(Box::new(found)));
        };
        Ok(Solution {
            path: best.path,
            cost: best.cost,
            stats: self.stats,
            edges,
        })
    }
}

/// One iteration on one tree: sample, steer, extend, rewire. Whether anything was connected.
fn grow(
    problem: &Problem,
    sampler: &Sampler,
    settings: &Settings,
    tree: &mut Tree<'_>,
    aim: Aim,
    limit: f64,
    random: &mut Random,
) -> bool {
    let began = tree.began();
    let view = View {
        system: &*problem.system,
        task: &problem.task,
        settings,
        tree,
        aim,
    };
    let Some(Draw { at, closest }) = sampler.draw(&view, random) else {
        return false;
    };
    let anchor = match closest {
        Some(node) => tree.site_of(node),
        None => tree.nearest(at),
    };
    let side = problem.system.bounds().side();
    let at = match settings.range {
        Some(range) => steer(tree.site_spot(anchor).at, at, range * side),
        None => at,
    };
    if problem.system.distance(tree.root().at, at) >= limit {
        return false;
    }
    let Some(spot) = problem.system.settle(at) else {
        return false;
    };
    let near = settings.near(tree.site_count(), side);
    tree.sampled(began);
    tree.extend(spot, near, &[anchor]).is_some()
}

/// As [`grow`], towards a point of the best plan.
fn grow_to(
    problem: &Problem,
    settings: &Settings,
    tree: &mut Tree<'_>,
    at: nalgebra::Point2<f64>,
) -> bool {
    let Some(spot) = problem.system.settle(at) else {
        return false;
    };
    let anchor = tree.nearest(at);
    let near = settings.near(tree.site_count(), problem.system.bounds().side());
    tree.extend(spot, near, &[anchor]).is_some()
}

/// The point at most `range` away from `from` in the direction of `to`.
fn steer(
    from: nalgebra::Point2<f64>,
    to: nalgebra::Point2<f64>,
    range: f64,
) -> nalgebra::Point2<f64> {
    let length = (to - from).norm();
    if length <= range {
        return to;
    }
    from + (to - from) * (range / length)
}
