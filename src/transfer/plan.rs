//! TransferPlanning (`transfer-planning.md`, IV-B, Alg. 4): a tree over the new formula's product that
//! takes whole skills into it, and keeps improving by sampling.
//!
//! As printed the algorithm finds cycles onto tree ancestors alone, and since the tree keeps shortest
//! paths from the root, the best suffix may never be among them. Here every accepting node can have
//! a suffix tree, which takes skills in the same way. A cycle, wherever it was found, is entered
//! at whichever of its points gives the cheapest plan; that is the paper's goal triplet
//! (q_P, q_P^mid, q_P^F) with q_P^mid chosen best.

use std::collections::HashMap;
use std::time::Instant;

use serde::Serialize;

use super::build::one_move_away;
use super::goals::{Closure, Goals};
use super::library::Library;
use super::reuse::{Kit, Layout, Reuser};
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::{
    Aim, Draw, EndReason, First, Improvement, NodeId, NotFound, PlanError, Problem, Progress,
    Sampler, Settings, SiteId, Solution, Stats, Stop, SuffixTree, Tree, View, staying_accepts,
};
use crate::random::{Random, generator};
use crate::system::{Spot, TransitionSystem};

/// Iterations between two looks at the clock, the stop flag and the observer.
const HEARTBEAT: u64 = 16;

/// Goals that get a suffix tree of skills before any sampling, at most; the first that closes a cycle
/// ends this.
const EAGER_GOALS: usize = 8;

/// Suffix trees that are grown by sampling, at most; others are grown by skills alone.
const GROWN: usize = 8;

/// Every so many iterations another goal gets a suffix tree of skills.
const GOAL_INTERVAL: u64 = 4;

/// Cycles that are kept to be entered more cheaply once the tree has improved.
const CYCLES: usize = 32;

/// What reuse did for a plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reused {
    /// The new formula's subtasks.
    pub counts: SubtaskCounts,
    /// Seconds to build the graph of subtasks and to match it with the library (t_Ω of Table I).
    pub graph_seconds: f64,
    /// Seconds to lay the library out for this start: once for each map and start, whatever the
    /// mission.
    pub layout_seconds: f64,
    /// For each leg of prefix and suffix, whether it is part of a skill.
    pub prefix_legs: Vec<bool>,
    /// As `prefix_legs`, for the suffix.
    pub suffix_legs: Vec<bool>,
}

/// A plan that was made with a library.
#[derive(Clone, Debug)]
pub struct Transferred {
    /// The plan, and what the search did. `seconds` of its stats leave out the graph of subtasks.
    pub solution: Solution,
    /// What was reused.
    pub reused: Reused,
}

/// How many subtasks a mission has, and how many of them a library serves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SubtaskCounts {
    /// Subtasks (#T of Table I).
    pub subtasks: usize,
    /// Those with a reusable path, or that need none.
    pub matched: usize,
}

impl SubtaskCounts {
    /// The share of subtasks that have a reusable path (%T of Table I), in `[0, 100]`.
    #[must_use]
    pub fn percent(&self) -> f64 {
        100.0 * self.matched as f64 / self.subtasks.max(1) as f64
    }
}

/// Counts a mission's subtasks, without planning it.
#[must_use]
pub fn count_subtasks(problem: &Problem, library: &Library) -> SubtaskCounts {
    let layout = Layout::new(library, &*problem.system, problem.start);
    let kit = layout.fit(problem);
    SubtaskCounts {
        subtasks: kit.subtasks,
        matched: kit.matching.matched,
    }
}

/// Plans a mission with a library of skills (Alg. 4).
///
/// # Errors
/// Settings out of range, a task for another map, or no plan within the budget.
pub fn transfer(
    problem: &Problem,
    library: &Library,
    sampler: &Sampler,
    settings: &Settings,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<Transferred, PlanError> {
    settings.validate()?;
    if !(0.0..=1.0).contains(&problem.weight) {
        return Err(PlanError::Weight(problem.weight));
    }
    if *problem.task.nba.alphabet != **problem.system.alphabet() {
        return Err(PlanError::Alphabet);
    }
    let began = Instant::now();
    let layout = Layout::new(library, &*problem.system, problem.start);
    let laid_out = Instant::now();
    let kit = layout.fit(problem);
    let mut reused = Reused {
        counts: SubtaskCounts {
            subtasks: kit.subtasks,
            matched: kit.matching.matched,
        },
        graph_seconds: laid_out.elapsed().as_secs_f64(),
        layout_seconds: (laid_out - began).as_secs_f64(),
        ..Reused::default()
    };
    let mut search = Search::new(problem, &kit, sampler, settings);
    let reason = search.run(stop, observe);
    let solution = search.finish(reason)?;
    let legs = SkillLegs::new(library);
    reused.prefix_legs = legs.mark(&solution.path.prefix);
    reused.suffix_legs = legs.mark(&solution.path.suffix);
    Ok(Transferred { solution, reused })
}

/// A plan, with its cost.
struct Best {
    path: Path,
    cost: Cost,
}

/// A cycle through an accepting state: its last waypoint is its first.
#[derive(Clone)]
struct Cycle {
    points: Vec<Waypoint>,
    length: f64,
}

/// A suffix tree with the skills that it has used.
struct Suffix<'a> {
    tree: SuffixTree<'a>,
    reuser: Reuser,
}

struct Search<'a> {
    problem: &'a Problem,
    kit: &'a Kit<'a>,
    sampler: &'a Sampler,
    settings: &'a Settings,
    random: Random,
    began: Instant,
    prefix: Tree<'a>,
    reuser: Reuser,
    goals: Goals,
    /// By letter and automaton state: whether staying is a suffix.
    staying: Vec<Vec<bool>>,
    /// Goals that had a suffix tree, with the cost of their prefix then.
    opened: HashMap<NodeId, f64>,
    suffixes: Vec<Suffix<'a>>,
    cycles: Vec<Cycle>,
    best: Option<Best>,
    /// Whether the prefix tree has improved since the kept cycles were last entered.
    improved: bool,
    stats: Stats,
    touched: Vec<NodeId>,
}

impl<'a> Search<'a> {
    fn new(
        problem: &'a Problem,
        kit: &'a Kit<'a>,
        sampler: &'a Sampler,
        settings: &'a Settings,
    ) -> Self {
        let nba = &problem.task.nba;
        Self {
            problem,
            kit,
            sampler,
            settings,
            random: generator(settings.seed, 0),
            began: Instant::now(),
            prefix: Tree::new(&*problem.system, nba, problem.start, &nba.initial),
            reuser: Reuser::new(kit, true),
            goals: Goals::default(),
            staying: staying_accepts(&problem.task),
            opened: HashMap::new(),
            suffixes: Vec::new(),
            cycles: Vec::new(),
            best: None,
            improved: false,
            stats: Stats::default(),
            touched: Vec::new(),
        }
    }

    fn system(&self) -> &'a dyn TransitionSystem {
        &*self.problem.system
    }

    fn run(&mut self, stop: &Stop, observe: &mut dyn FnMut(Progress)) -> EndReason {
        let budget = self.settings.time_budget();
        self.reuse_from_root();
        for _ in 0..EAGER_GOALS {
            if self.suffixes.iter().any(|s| s.tree.length().is_some()) {
                break;
            }
            self.open_goal();
        }
        self.note_first_plan();
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
                    nodes: self.trees().map(|t| t.len() as u64).sum(),
                    cost: self.best.as_ref().map(|b| b.cost.total),
                });
                if stop.is_raised() {
                    return EndReason::Stopped;
                }
                if budget.is_some_and(|b| self.began.elapsed() >= b) {
                    return EndReason::Time;
                }
                self.enter_cycles_again();
            }
            self.iterate();
            self.note_first_plan();
        }
    }

    /// Line 2: everything that skills reach from the root.
    fn reuse_from_root(&mut self) {
        let root = SiteId(0);
        for i in 0..self.prefix.at_site(root).len() {
            let (_, node) = self.prefix.at_site(root)[i];
            self.reuser.offer(self.kit, &self.prefix, node);
        }
        self.reuser.connect_states(self.kit, &mut self.prefix, root);
        self.reuser.spread(self.kit, &mut self.prefix);
        self.look_at_prefix();
    }

    /// Lines 3 to 14, on the prefix tree or on a suffix tree.
    fn iterate(&mut self) {
        self.stats.iterations += 1;
        if self.stats.iterations.is_multiple_of(GOAL_INTERVAL) || self.best.is_none() {
            self.open_goal();
        }
        let turn = self.stats.iterations;
        if self.suffixes.is_empty() || turn.is_multiple_of(2) {
            self.grow_prefix();
            return;
        }
        // The tree of the shortest cycle gets every second turn, the others share the rest.
        let length = |s: &Suffix<'_>| s.tree.length().unwrap_or(f64::INFINITY);
        let shortest = (0..self.suffixes.len())
            .min_by(|&a, &b| length(&self.suffixes[a]).total_cmp(&length(&self.suffixes[b])));
        let idle = (0..self.suffixes.len()).min_by_key(|&i| self.suffixes[i].tree.iterations);
        let chosen = if turn % 4 == 1 { shortest } else { idle };
        if let Some(i) = chosen {
            self.grow_suffix(i);
        }
    }

    fn grow_prefix(&mut self) {
        let aim = Aim::Prefix {
            reached: self.stats.first_prefix.is_some(),
        };
        let drawn = draw(
            self.problem,
            self.sampler,
            self.settings,
            &self.prefix,
            aim,
            &mut self.random,
        );
        let site = drawn.and_then(|d| grow(self.settings, self.system(), &mut self.prefix, d));
        let Some(site) = site else {
            self.stats.failed_samples += 1;
            return;
        };
        take_skills(
            self.kit,
            &mut self.reuser,
            &mut self.prefix,
            site,
            f64::INFINITY,
        );
        self.look_at_prefix();
    }

    fn grow_suffix(&mut self, i: usize) {
        let suffix = &mut self.suffixes[i];
        suffix.tree.iterations += 1;
        let aim = Aim::Suffix {
            state: suffix.tree.state,
            closed: suffix.tree.length().is_some(),
        };
        let tree = &mut suffix.tree.tree;
        let drawn = draw(
            self.problem,
            self.sampler,
            self.settings,
            tree,
            aim,
            &mut self.random,
        );
        let site = drawn.and_then(|d| grow(self.settings, &*self.problem.system, tree, d));
        let Some(site) = site else {
            self.stats.failed_samples += 1;
            return;
        };
        let limit = suffix.tree.length().unwrap_or(f64::INFINITY);
        take_skills(
            self.kit,
            &mut suffix.reuser,
            &mut suffix.tree.tree,
            site,
            limit,
        );
        if suffix
            .tree
            .close(&*self.problem.system, &self.problem.task.nba)
        {
            self.take_cycle_of(i);
        }
    }

    /// Takes note of new goals and of cycles that close onto ancestors (FindGoal, line 11).
    fn look_at_prefix(&mut self) {
        let mut touched = std::mem::take(&mut self.touched);
        self.prefix.take_touched(&mut touched);
        self.improved |= !touched.is_empty();
        let before = self.goals.accepting().len();
        self.goals
            .update(&self.problem.task, &self.prefix, &touched);
        let found = self.goals.accepting().len();
        self.stats.goals += (found - before) as u64;
        if before == 0 && found > 0 {
            let goal = self.goals.accepting()[0];
            self.stats.first_prefix = Some(self.first(self.prefix.cost(goal)));
        }
        for &node in &touched {
            self.stay_at(node);
            let limit = self.cycle_limit();
            let task = &self.problem.task;
            let closure = self
                .goals
                .close(self.system(), task, &self.prefix, node, limit);
            if let Some(closure) = closure {
                self.take_closure(closure);
            }
        }
        self.touched = touched;
    }

    /// A trivial suffix: staying at an accepting node, if that goes on accepting.
    fn stay_at(&mut self, node: NodeId) {
        let (spot, state) = (self.prefix.spot(node), self.prefix.state(node));
        if self.staying[spot.letter.index()][state.index()] {
            let cost = Cost::new(self.prefix.cost(node), 0.0, self.problem.weight);
            let at = spot.at;
            self.consider(cost, |search| Path {
                prefix: search.prefix.path(node),
                suffix: vec![Waypoint { at, state }],
            });
        }
    }

    /// No cycle of this length or more can be part of a better plan.
    fn cycle_limit(&self) -> f64 {
        let after = 1.0 - self.problem.weight;
        match &self.best {
            Some(best) if after > 0.0 => best.cost.total / after,
            _ => f64::INFINITY,
        }
    }

    fn take_closure(&mut self, closure: Closure) {
        let mut points = Vec::new();
        let mut at = closure.last;
        let waypoint = |tree: &Tree<'_>, node| Waypoint {
            at: tree.spot(node).at,
            state: tree.state(node),
        };
        points.push(waypoint(&self.prefix, closure.mid));
        while at != closure.mid {
            points.push(waypoint(&self.prefix, at));
            match self.prefix.parent(at) {
                Some(parent) => at = parent,
                None => break,
            }
        }
        points.push(waypoint(&self.prefix, closure.mid));
        points.reverse();
        self.take_cycle(Cycle {
            points,
            length: closure.length,
        });
    }

    fn take_cycle_of(&mut self, i: usize) {
        let tree = &self.suffixes[i].tree;
        if let (Some(length), Some(points)) = (tree.length(), tree.path()) {
            self.take_cycle(Cycle { points, length });
        }
    }

    /// Enters a cycle, and keeps it if it is among the shortest.
    fn take_cycle(&mut self, cycle: Cycle) {
        if cycle.length >= self.cycle_limit() {
            return;
        }
        self.enter_cycle(&cycle);
        let i = self.cycles.partition_point(|c| c.length <= cycle.length);
        if i < CYCLES {
            self.cycles.insert(i, cycle);
            self.cycles.truncate(CYCLES);
        }
    }

    fn enter_cycles_again(&mut self) {
        if !std::mem::take(&mut self.improved) {
            return;
        }
        let cycles = std::mem::take(&mut self.cycles);
        for cycle in &cycles {
            self.enter_cycle(cycle);
        }
        self.cycles = cycles;
    }

    /// The cheapest plan that ends in this cycle: reach one of its points q_P^mid, follow it to an
    /// accepting point q_P^F, and go round from there.
    fn enter_cycle(&mut self, cycle: &Cycle) {
        let points = &cycle.points[..cycle.points.len() - 1];
        let count = points.len();
        let accepts = |i: usize| {
            let feasible = &self.problem.task.feasible;
            feasible.binary_search(&points[i % count].state).is_ok()
        };
        let leg = |i: usize| {
            let (a, b) = (points[i % count], points[(i + 1) % count]);
            self.system().distance(a.at, b.at)
        };
        // Walk the cycle twice, backwards, with the next accepting point and the way to it.
        let mut next: Option<(usize, f64)> = None;
        let mut best: Option<(f64, NodeId, usize, usize)> = None;
        for i in (0..2 * count).rev() {
            next = match next {
                _ if accepts(i) => Some((i, 0.0)),
                Some((goal, way)) => Some((goal, way + leg(i))),
                None => None,
            };
            let Some((goal, way)) = next.filter(|_| i < count) else {
                continue;
            };
            let Some(node) = self.node_of(&points[i]) else {
                continue;
            };
            let prefix = self.prefix.cost(node) + way;
            if best.is_none_or(|b| prefix < b.0) {
                best = Some((prefix, node, i, goal));
            }
        }
        let Some((prefix, node, entry, goal)) = best else {
            return;
        };
        let cost = Cost::new(prefix, cycle.length, self.problem.weight);
        self.consider(cost, |search| {
            let mut prefix = search.prefix.path(node);
            prefix.extend((entry + 1..=goal).map(|i| points[i % count]));
            let suffix = (goal..=goal + count).map(|i| points[i % count]).collect();
            Path { prefix, suffix }
        });
    }

    fn node_of(&self, point: &Waypoint) -> Option<NodeId> {
        let site = self.prefix.site_at(point.at)?;
        let nodes = self.prefix.at_site(site);
        let i = nodes.binary_search_by_key(&point.state, |&(q, _)| q).ok()?;
        Some(nodes[i].1)
    }

    /// Gives the most promising goal a suffix tree of skills.
    fn open_goal(&mut self) {
        let Some(goal) = self.most_promising_goal() else {
            return;
        };
        self.opened.insert(goal, self.prefix.cost(goal));
        let mut suffix = Suffix {
            tree: SuffixTree::of(&self.prefix, goal),
            reuser: Reuser::new(self.kit, false),
        };
        self.seed_suffix(&mut suffix, goal);
        self.stats.suffix_trees += 1;
        self.suffixes.push(suffix);
        let last = self.suffixes.len() - 1;
        self.take_cycle_of(last);
        if self.suffixes.len() > GROWN {
            self.drop_worst_suffix();
        }
    }

    /// Adds skills to a new suffix tree, until what is left cannot close a shorter cycle.
    fn seed_suffix(&self, suffix: &mut Suffix<'a>, goal: NodeId) {
        let (system, nba) = (self.system(), &self.problem.task.nba);
        let root = SiteId(0);
        let tree = &mut suffix.tree.tree;
        for i in 0..tree.at_site(root).len() {
            let (_, node) = tree.at_site(root)[i];
            suffix.reuser.offer(self.kit, tree, node);
        }
        let node = tree.in_state(suffix.tree.state)[0];
        let here = self.reuser.continuations.iter();
        for continuation in here.filter(|c| c.node == goal) {
            suffix.reuser.resume(self.kit, tree, node, continuation);
        }
        suffix.reuser.connect_states(self.kit, tree, root);
        suffix.tree.close(system, nba);
        while let Some(cost) = suffix.reuser.next_cost() {
            let limit = suffix.tree.length().unwrap_or(f64::INFINITY);
            if cost >= limit.min(self.cycle_limit()) {
                break;
            }
            suffix.reuser.step(self.kit, &mut suffix.tree.tree);
            suffix.tree.close(system, nba);
        }
    }

    /// The goal with the cheapest prefix that has no suffix tree yet and could still be part of a
    /// better plan.
    fn most_promising_goal(&self) -> Option<NodeId> {
        let cost = |g: &NodeId| self.prefix.cost(*g);
        let could_help = |g: &&NodeId| {
            let bound = self.problem.weight * cost(g);
            self.best.as_ref().is_none_or(|b| bound < b.cost.total)
        };
        self.goals
            .accepting()
            .iter()
            .filter(|g| !self.opened.contains_key(*g))
            .filter(could_help)
            .min_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.cmp(b)))
            .copied()
    }

    fn drop_worst_suffix(&mut self) {
        let length = |s: &Suffix<'_>| s.tree.length().unwrap_or(f64::INFINITY);
        let worst = (0..self.suffixes.len())
            .max_by(|&a, &b| length(&self.suffixes[a]).total_cmp(&length(&self.suffixes[b])));
        if let Some(i) = worst {
            self.suffixes.swap_remove(i);
        }
    }

    /// Keeps a plan if it is the best so far.
    fn consider(&mut self, cost: Cost, path: impl FnOnce(&Self) -> Path) {
        let better = |b: &Best| cost.total < b.cost.total * (1.0 - 1e-12);
        if !self.best.as_ref().is_none_or(better) {
            return;
        }
        let path = path(self);
        self.best = Some(Best { path, cost });
        self.stats.improvements.push(Improvement {
            iterations: self.stats.iterations,
            seconds: self.began.elapsed().as_secs_f64(),
            cost: cost.total,
        });
    }

    /// What skills alone give is one step of the algorithm: the first plan is the best of it.
    fn note_first_plan(&mut self) {
        if let (None, Some(best)) = (&self.stats.first_plan, &self.best) {
            self.stats.first_plan = Some(self.first(best.cost.total));
        }
    }

    fn first(&self, cost: f64) -> First {
        First {
            iterations: self.stats.iterations,
            nodes: self.trees().map(|t| t.len() as u64).sum(),
            seconds: self.began.elapsed().as_secs_f64(),
            cost,
        }
    }

    fn trees(&self) -> impl Iterator<Item = &Tree<'a>> {
        std::iter::once(&self.prefix).chain(self.suffixes.iter().map(|s| &s.tree.tree))
    }

    /// FeasiblePath (line 15): the best plan, or how far the search got.
    fn finish(mut self, reason: EndReason) -> Result<Solution, PlanError> {
        self.enter_cycles_again();
        self.stats.nodes = self.trees().map(|t| t.len() as u64).sum();
        self.stats.sites = self.trees().map(|t| t.site_count() as u64).sum();
        self.stats.seconds = self.began.elapsed().as_secs_f64();
        let edges = self.trees().flat_map(Tree::edges).map(|(a, b)| [a, b]);
        let edges = edges.collect();
        let Some(Best { path, cost }) = self.best.take() else {
            let task = &self.problem.task;
            let found = NotFound::after(task, &self.prefix, self.stats, reason, edges);
            return Err(PlanError::NotFound(Box::new(found)));
        };
        Ok(Solution {
            path,
            cost,
            stats: self.stats,
            edges,
        })
    }
}

/// Sample (line 4): uniform means a place one move away from a random node, as in the paper; the
/// other strategies are the planner's.
fn draw(
    problem: &Problem,
    sampler: &Sampler,
    settings: &Settings,
    tree: &Tree<'_>,
    aim: Aim,
    random: &mut Random,
) -> Option<Spot> {
    let system = &*problem.system;
    if let Sampler::Uniform = sampler {
        return one_move_away(system, tree, random);
    }
    let view = View {
        system,
        task: &problem.task,
        settings,
        tree,
        aim,
    };
    let Draw { at, .. } = sampler.draw(&view, random)?;
    system.settle(at)
}

/// Extend and Rewire for a place (lines 5 to 10).
fn grow(
    settings: &Settings,
    system: &dyn TransitionSystem,
    tree: &mut Tree<'_>,
    spot: Spot,
) -> Option<SiteId> {
    let anchor = tree.nearest(spot.at);
    let near = settings.near(tree.site_count(), system.bounds().side());
    tree.extend(spot, near, &[anchor])
}

/// Lines 12 to 14: skills and endpoints that the new place leads to.
fn take_skills(kit: &Kit<'_>, reuser: &mut Reuser, tree: &mut Tree<'_>, site: SiteId, limit: f64) {
    for i in 0..tree.at_site(site).len() {
        let (_, node) = tree.at_site(site)[i];
        reuser.offer(kit, tree, node);
    }
    reuser.connect_states(kit, tree, site);
    while reuser.next_cost().is_some_and(|cost| cost < limit) {
        reuser.step(kit, tree);
    }
}

/// The legs of all skills, to tell which legs of a plan were reused.
struct SkillLegs(std::collections::HashSet<[[u64; 2]; 2]>);

impl SkillLegs {
    fn new(library: &Library) -> Self {
        let legs = library
            .skills()
            .iter()
            .flat_map(|s| s.path().windows(2).map(|w| Self::key(w[0].at, w[1].at)));
        Self(legs.collect())
    }

    /// A leg, the same in both directions.
    fn key(a: nalgebra::Point2<f64>, b: nalgebra::Point2<f64>) -> [[u64; 2]; 2] {
        let bits = |p: nalgebra::Point2<f64>| [p.x.to_bits(), p.y.to_bits()];
        let (a, b) = (bits(a), bits(b));
        [a.min(b), a.max(b)]
    }

    fn mark(&self, points: &[Waypoint]) -> Vec<bool> {
        points
            .windows(2)
            .map(|w| self.0.contains(&Self::key(w[0].at, w[1].at)))
            .collect()
    }
}
