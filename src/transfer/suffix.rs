//! Cycles through a goal q_P^F, and where a plan enters them.
//!
//! A suffix tree finds the shortest cycle through its goal; the cheapest plan may use a longer one that passes
//! closer to the start. So each suffix tree that is grown by sampling has a second tree, of ways from the goal back to it
//! on which the prefix has joined: its nodes are reached from an entry m, which any node of both
//! the suffix tree and the prefix tree can be, at the cost
//!
//! ```text
//! β / (1 − β) · prefix(m) + d(goal, m)
//! ```
//!
//! plus the way from m on; a way back to the goal costs J / (1 − β) in all (`transfer-planning.md`, (1)). Both trees
//! grow by the same samples, so their costs converge to the least ones like those of any RRT*.

use super::budget::Budget;
use super::reuse::{Continuation, Kit, Reuser};
use crate::automaton::Nba;
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::{Near, NodeId, Problem, SiteId, SuffixTree, Tree};
use crate::system::{Spot, TransitionSystem};

/// A cycle through an accepting state: its last waypoint is its first.
#[derive(Clone)]
pub(super) struct Cycle {
    pub(super) points: Vec<Waypoint>,
    pub(super) length: f64,
}

/// A suffix tree with the skills that it has used.
pub(super) struct Suffix<'a> {
    pub(super) tree: SuffixTree<'a>,
    pub(super) reuser: Reuser,
    /// The cheapest plan found through this goal.
    pub(super) total: f64,
    entries: Option<Entries<'a>>,
}

impl<'a> Suffix<'a> {
    pub(super) fn new(kit: &Kit<'a>, prefix: &Tree<'a>, goal: NodeId) -> Self {
        Self {
            tree: SuffixTree::of(prefix, goal),
            reuser: Reuser::new(kit, false),
            total: f64::INFINITY,
            entries: None,
        }
    }

    /// The shortest cycle through the goal.
    pub(super) fn cycle(&self) -> Option<Cycle> {
        let (length, points) = (self.tree.length()?, self.tree.path()?);
        Some(Cycle { points, length })
    }

    /// Adds skills to a new suffix tree, until what is left cannot close a cycle that is shorter than the
    /// shortest, or than `limit`. `resumed` are the skills on whose way the goal lies.
    pub(super) fn seed<'c>(
        &mut self,
        kit: &Kit<'_>,
        nba: &Nba,
        resumed: impl Iterator<Item = &'c Continuation>,
        limit: f64,
        budget: &Budget,
    ) {
        let root = SiteId(0);
        let tree = &mut self.tree.tree;
        for i in 0..tree.at_site(root).len() {
            let (_, node) = tree.at_site(root)[i];
            self.reuser.offer(kit, tree, node);
        }
        let node = tree.in_state(self.tree.state)[0];
        for continuation in resumed {
            self.reuser.resume(kit, tree, node, continuation);
        }
        self.reuser.connect_states(kit, tree, root);
        self.tree.close(kit.system, nba);
        let mut steps = 0_u64;
        while let Some(cost) = self.reuser.next_cost() {
            steps += 1;
            let late = budget.is_over_after(steps);
            if late || cost >= self.tree.length().unwrap_or(f64::INFINITY).min(limit) {
                break;
            }
            self.reuser.step(kit, &mut self.tree.tree);
            self.tree.close(kit.system, nba);
        }
    }

    /// Takes note of a place that was sampled for the suffix tree: the plan that closes at the goal more
    /// cheaply than before, if there is one.
    pub(super) fn enter(
        &mut self,
        problem: &Problem,
        nba: &'a Nba,
        prefix: &Tree<'_>,
        system: &'a dyn TransitionSystem,
        sample: (Spot, Near),
    ) -> Option<(Path, Cost)> {
        let ratio = problem.weight / (1.0 - problem.weight);
        if !ratio.is_finite() || problem.weight == 0.0 {
            // Only one of the lengths counts: the entry does not matter, or not to the suffix.
            return None;
        }
        let tree = &self.tree;
        let entries = match &mut self.entries {
            Some(entries) => {
                for &node in tree.touched() {
                    entries.offer(tree, prefix, node);
                }
                entries
            }
            none => none.insert(Entries::new(system, nba, tree, prefix, ratio)),
        };
        let (spot, near) = sample;
        let anchor = entries.tree.nearest(spot.at);
        entries.tree.extend(spot, near, &[anchor]);
        let last = entries.close(system, nba, tree)?;
        entries.plan(system, tree, prefix, last, problem.weight)
    }

    /// Takes note of a node of the prefix tree that is new or cheaper.
    pub(super) fn prefix_changed(&mut self, prefix: &Tree<'_>, node: NodeId) {
        if let Some(entries) = &mut self.entries {
            let there = (prefix.spot(node).at, prefix.state(node));
            if let Some(own) = self.tree.tree.find(there.0, there.1) {
                entries.offer(&self.tree, prefix, own);
            }
        }
    }
}

/// Ways back to the goal on which the prefix has joined.
struct Entries<'a> {
    tree: Tree<'a>,
    /// β / (1 − β).
    ratio: f64,
    /// The cost of the cheapest way back.
    best: f64,
    touched: Vec<NodeId>,
}

impl<'a> Entries<'a> {
    /// Everything that the suffix tree holds, each entered where it can be.
    fn new(
        system: &'a dyn TransitionSystem,
        nba: &'a Nba,
        suffix: &SuffixTree<'_>,
        prefix: &Tree<'_>,
        ratio: f64,
    ) -> Self {
        let mut entries = Self {
            tree: Tree::new(system, nba, suffix.tree.root(), &[]),
            ratio,
            best: f64::INFINITY,
            touched: Vec::new(),
        };
        let mut nodes: Vec<NodeId> = nba
            .states()
            .flat_map(|q| suffix.tree.in_state(q).iter().copied())
            .collect();
        let cost = |n: &NodeId| suffix.tree.cost(*n);
        nodes.sort_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.cmp(b)));
        for &node in &nodes {
            entries.offer(suffix, prefix, node);
        }
        entries
    }

    /// Offers a node of the suffix tree as an entry; or, if the prefix has joined before it, goes there.
    fn offer(&mut self, suffix: &SuffixTree<'_>, prefix: &Tree<'_>, node: NodeId) {
        let tree = &suffix.tree;
        let (spot, state) = (tree.spot(node), tree.state(node));
        if let Some(joined) = prefix.find(spot.at, state) {
            let cost = self.ratio * prefix.cost(joined) + tree.cost(node);
            self.tree.add_root(spot, state, cost);
        }
        let Some(parent) = tree.parent(node) else {
            return;
        };
        if let Some(before) = self.tree.find(tree.spot(parent).at, tree.state(parent)) {
            let site = self.tree.site_for(spot);
            let length = tree.cost(node) - tree.cost(parent);
            self.tree.hop(before, site, state, length);
        }
    }

    /// The node that closes at the goal more cheaply than any before, if there is one.
    fn close(
        &mut self,
        system: &dyn TransitionSystem,
        nba: &Nba,
        suffix: &SuffixTree<'_>,
    ) -> Option<NodeId> {
        let root = suffix.tree.root();
        let mut touched = std::mem::take(&mut self.touched);
        self.tree.take_touched(&mut touched);
        let mut found = None;
        for &node in &touched {
            let spot = self.tree.spot(node);
            let cost = self.tree.cost(node) + system.distance(spot.at, root.at);
            // Staying at the goal is judged elsewhere.
            if cost >= self.best || self.stayed(node, root) {
                continue;
            }
            let guard = nba.guard(self.tree.state(node), suffix.state);
            if guard.is_some_and(|g| g.contains(spot.letter)) && system.step(&spot, &root) {
                (self.best, found) = (cost, Some(node));
            }
        }
        self.touched = touched;
        found
    }

    /// Whether the way to a node never left the goal's place.
    fn stayed(&self, node: NodeId, root: Spot) -> bool {
        let mut way = std::iter::successors(Some(node), |&n| self.tree.parent(n));
        way.all(|n| self.tree.spot(n).at == root.at)
    }

    /// The plan that goes back to the goal from node `last`: its suffix begins at the entry.
    fn plan(
        &self,
        system: &dyn TransitionSystem,
        suffix: &SuffixTree<'_>,
        prefix: &Tree<'_>,
        last: NodeId,
        weight: f64,
    ) -> Option<(Path, Cost)> {
        let mut points = self.tree.path(last);
        let entry = points[0];
        let joined = prefix.find(entry.at, entry.state)?;
        let out = suffix.tree.path(suffix.tree.find(entry.at, entry.state)?);
        points.extend(out);
        let legs = points.windows(2);
        let length = legs.map(|w| system.distance(w[0].at, w[1].at)).sum();
        let path = Path {
            prefix: prefix.path(joined),
            suffix: points,
        };
        Some((path, Cost::new(prefix.cost(joined), length, weight)))
    }
}
