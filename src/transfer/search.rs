//! TransferPlanning (`transfer-planning.md`, IV-B, Alg. 4): a tree over the new formula's product that
//! takes whole skills into it, and keeps improving by sampling.
//!
//! As printed the algorithm finds cycles onto tree ancestors alone, and since the tree keeps shortest
//! paths from the root, the best suffix may never be among them. Here every accepting node can have
//! a suffix tree, which takes skills in the same way. A cycle, wherever it was found, is entered
//! at whichever of its points is reached most cheaply, and the suffix begins there: the paper's goal triplet
//! (q_P, q_P^mid, q_P^F) with q_P^mid chosen best, and without walking to q_P^F as part of the prefix.

use std::collections::HashMap;
use std::time::Instant;

use super::budget::Budget;
use super::build::one_move_away;
use super::goals::{Closure, Goals};
use super::reuse::{Kit, Reuser};
use super::suffix::{Cycle, Suffix};
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::{
    Aim, Draw, EndReason, First, Improvement, NodeId, NotFound, PlanError, Problem, Progress,
    Sampler, Settings, SiteId, Solution, Stats, Stop, Tree, View, staying_accepts,
};
use crate::random::{Random, generator};
use crate::system::{Spot, TransitionSystem};

/// Iterations between two reports to the observer, and between two looks at the cycles that are kept.
const HEARTBEAT: u64 = 16;

/// Goals that get a suffix tree of skills before any sampling, at most; the first that closes a cycle
/// ends this.
const EAGER_GOALS: usize = 8;

/// Suffix trees that are grown by sampling, at most; others are grown by skills alone.
const GROWN: usize = 8;

/// Every so many iterations another goal gets a suffix tree: one at which an accepting state is entered.
const GOAL_INTERVAL: u64 = 4;

/// Every so many iterations any other goal gets one; most cycles through it pass an entered one, too.
const OTHER_INTERVAL: u64 = 64;

/// Cycles that are kept to be entered more cheaply once the tree has improved.
const CYCLES: usize = 32;

/// A plan, with its cost.
struct Best {
    path: Path,
    cost: Cost,
}

/// TransferPlanning on one problem.
pub(super) struct Search<'a> {
    problem: &'a Problem,
    kit: &'a Kit<'a>,
    sampler: &'a Sampler,
    settings: &'a Settings,
    random: Random,
    began: Instant,
    budget: Budget,
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
    pub(super) fn new(
        problem: &'a Problem,
        kit: &'a Kit<'a>,
        sampler: &'a Sampler,
        settings: &'a Settings,
        stop: &Stop,
    ) -> Self {
        let began = Instant::now();
        let nba = &problem.task.nba;
        Self {
            problem,
            kit,
            sampler,
            settings,
            random: generator(settings.seed, 0),
            began,
            budget: Budget::new(stop, began, settings.time_limit),
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

    /// Runs until the budget ends.
    pub(super) fn run(&mut self, observe: &mut dyn FnMut(Progress)) -> EndReason {
        self.reuse_from_root();
        for _ in 0..EAGER_GOALS {
            if self.suffixes.iter().any(|s| s.tree.length().is_some()) {
                break;
            }
            self.open_goal(true);
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
                self.enter_cycles_again();
            }
            // On large automata one iteration takes a tenth of a second.
            if let Some(reason) = self.budget.over() {
                return reason;
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
        self.reuser
            .spread(self.kit, &mut self.prefix, f64::INFINITY, &self.budget);
        self.look_at_prefix();
    }

    /// Lines 3 to 14, on the prefix tree or on a suffix tree.
    fn iterate(&mut self) {
        self.stats.iterations += 1;
        if self.stats.iterations.is_multiple_of(GOAL_INTERVAL) || self.best.is_none() {
            self.open_goal(self.stats.iterations.is_multiple_of(OTHER_INTERVAL));
        }
        let turn = self.stats.iterations;
        if self.suffixes.is_empty() || turn.is_multiple_of(2) {
            self.grow_prefix();
            return;
        }
        // The tree of the cheapest plan gets every second turn, the others share the rest.
        let total = |i: &usize| self.suffixes[*i].total;
        let cheapest =
            (0..self.suffixes.len()).min_by(|a, b| total(a).total_cmp(&total(b)).then(a.cmp(b)));
        let idle = (0..self.suffixes.len()).min_by_key(|&i| self.suffixes[i].tree.iterations);
        let chosen = if turn % 4 == 1 { cheapest } else { idle };
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
            &self.budget,
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
        let spot = suffix.tree.tree.site_spot(site);
        let limit = suffix.tree.length().unwrap_or(f64::INFINITY);
        take_skills(
            self.kit,
            &mut suffix.reuser,
            &mut suffix.tree.tree,
            site,
            limit,
            &self.budget,
        );
        let nba = &self.problem.task.nba;
        let closed = suffix.tree.close(&*self.problem.system, nba);
        let side = self.problem.system.bounds().side();
        let near = self.settings.near(suffix.tree.tree.site_count(), side);
        let system = &*self.problem.system;
        let entered = suffix.enter(self.problem, nba, &self.prefix, system, (spot, near));
        if let Some((path, cost)) = entered {
            suffix.total = suffix.total.min(cost.total);
            self.consider(cost, |_| path);
        }
        if closed {
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
            for suffix in &mut self.suffixes {
                suffix.prefix_changed(&self.prefix, node);
            }
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
        if let Some(cycle) = self.suffixes[i].cycle() {
            let total = self.take_cycle(cycle);
            self.suffixes[i].total = self.suffixes[i].total.min(total);
        }
    }

    /// Enters a cycle, and keeps it if it is among the shortest. Returns what the plan costs.
    fn take_cycle(&mut self, cycle: Cycle) -> f64 {
        if cycle.length >= self.cycle_limit() {
            return f64::INFINITY;
        }
        let total = self.enter_cycle(&cycle);
        let i = self.cycles.partition_point(|c| c.length <= cycle.length);
        if i < CYCLES {
            self.cycles.insert(i, cycle);
            self.cycles.truncate(CYCLES);
        }
        total
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

    /// The cheapest plan that ends in this cycle: its suffix begins at whichever of its points q_P^mid
    /// is reached most cheaply. (The paper follows the cycle to q_P^F first; the robot then walks the same way,
    /// but part of the first round counts as prefix.)
    fn enter_cycle(&mut self, cycle: &Cycle) -> f64 {
        let points = &cycle.points[..cycle.points.len() - 1];
        let count = points.len();
        let entry = (0..count)
            .filter_map(|i| Some((self.prefix.find(points[i].at, points[i].state)?, i)))
            .min_by(|(a, i), (b, j)| {
                let cost = |n: &NodeId| self.prefix.cost(*n);
                cost(a).total_cmp(&cost(b)).then(i.cmp(j))
            });
        let Some((node, entry)) = entry else {
            return f64::INFINITY;
        };
        let prefix = self.prefix.cost(node);
        let cost = Cost::new(prefix, cycle.length, self.problem.weight);
        self.consider(cost, |search| Path {
            prefix: search.prefix.path(node),
            suffix: (entry..=entry + count).map(|i| points[i % count]).collect(),
        });
        cost.total
    }

    /// Gives the most promising goal a suffix tree of skills.
    fn open_goal(&mut self, any: bool) {
        let Some(goal) = self.most_promising_goal(any) else {
            if any && self.best.is_some() {
                // All had a tree: those that had to give way may have another.
                let open: Vec<NodeId> = self.suffixes.iter().map(|s| s.tree.goal).collect();
                self.opened.retain(|goal, _| open.contains(goal));
            }
            return;
        };
        self.opened.insert(goal, self.prefix.cost(goal));
        let nba = &self.problem.task.nba;
        let mut suffix = Suffix::new(self.kit, &self.prefix, goal);
        let resumed = self.reuser.continuations.iter();
        let resumed = resumed.filter(|c| c.node == goal);
        suffix.seed(self.kit, nba, resumed, self.cycle_limit(), &self.budget);
        self.stats.suffix_trees += 1;
        self.suffixes.push(suffix);
        let last = self.suffixes.len() - 1;
        self.take_cycle_of(last);
        if self.suffixes.len() > GROWN {
            self.drop_worst_suffix();
        }
    }

    /// The goal with the cheapest prefix that has no suffix tree yet and could still be part of a
    /// better plan; goals at which an accepting state is entered come first, and alone unless
    /// `any` is wanted.
    fn most_promising_goal(&self, any: bool) -> Option<NodeId> {
        let cost = |g: &NodeId| self.prefix.cost(*g);
        // The way to a goal is part of the prefix, as far as the entry of its cycle, and of the cycle.
        let share = self.problem.weight.min(1.0 - self.problem.weight);
        let could_help = |g: &&NodeId| {
            self.best
                .as_ref()
                .is_none_or(|b| share * cost(g) < b.cost.total)
        };
        self.goals
            .accepting()
            .iter()
            .filter(|g| !self.opened.contains_key(*g))
            .filter(could_help)
            .filter(|g| any || self.is_entered(**g))
            .min_by(|a, b| {
                let entered = |g: &NodeId| self.is_entered(*g);
                let order = entered(b).cmp(&entered(a));
                order.then(cost(a).total_cmp(&cost(b))).then(a.cmp(b))
            })
            .copied()
    }

    /// Whether the automaton changes its state on the move to a goal.
    fn is_entered(&self, goal: NodeId) -> bool {
        let state = |n| self.prefix.state(n);
        let parent = self.prefix.parent(goal);
        parent.is_none_or(|p| state(p) != state(goal))
    }

    /// Of the trees other than that of the cheapest plan, one whose goal is not entered gives way first, then
    /// the one that was grown most.
    fn drop_worst_suffix(&mut self) {
        let total = |i: &usize| self.suffixes[*i].total;
        let all = 0..self.suffixes.len();
        let cheapest = all.clone().min_by(|a, b| total(a).total_cmp(&total(b)));
        let rank = |i: &usize| {
            let tree = &self.suffixes[*i].tree;
            (!self.is_entered(tree.goal), tree.iterations)
        };
        let worst = all.filter(|i| Some(*i) != cheapest).max_by_key(rank);
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
    pub(super) fn finish(mut self, reason: EndReason) -> Result<Solution, PlanError> {
        self.enter_cycles_again();
        self.stats.nodes = self.trees().map(|t| t.len() as u64).sum();
        self.stats.sites = self.trees().map(|t| t.site_count() as u64).sum();
        self.stats.seconds = self.began.elapsed().as_secs_f64();
        let edges = self.trees().flat_map(Tree::edges).map(|(a, b)| [a, b]);
        let edges = edges.collect();
        let Some(Best { path, cost }) = self.best.take() else {
            let task = &self.problem.task;
            let found = NotFound::after(task, |q| q, &self.prefix, self.stats, reason, edges);
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
fn take_skills(
    kit: &Kit<'_>,
    reuser: &mut Reuser,
    tree: &mut Tree<'_>,
    site: SiteId,
    limit: f64,
    budget: &Budget,
) {
    for i in 0..tree.at_site(site).len() {
        let (_, node) = tree.at_site(site)[i];
        reuser.offer(kit, tree, node);
    }
    reuser.connect_states(kit, tree, site);
    reuser.spread(kit, tree, limit, budget);
}
