//! Reuse and ConnectReusedPath (`transfer-planning.md`, Alg. 5 and 6): skills that can be connected to
//! a node, directly or through other skills, are added to its tree.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet};

use smallvec::SmallVec;

use super::budget::Budget;
use super::library::{Library, Shelf};
use super::matching::{Matching, Reuse};
use super::places::{PlaceId, Places};
use super::subtasks::{Equivalence, SubtaskGraph, loops};
use crate::alphabet::LetterSet;
use crate::automaton::{Nba, StateId};
use crate::planner::{NodeId, Problem, SiteId, Tree};
use crate::queue::Entry;
use crate::system::{Spot, TransitionSystem};

/// A library laid out for one mission: its subtasks, and which skills serve them.
pub(crate) struct Kit<'a> {
    pub(crate) system: &'a dyn TransitionSystem,
    pub(crate) nba: &'a Nba,
    pub(crate) places: Places,
    pub(crate) shelf: Shelf<'a>,
    pub(crate) matching: Matching,
    /// #T of the paper's Table I.
    pub(crate) subtasks: usize,
    labels: Vec<LetterSet>,
    /// Endpoints of subtasks without a skill (𝒮_r).
    unmatched: HashSet<(PlaceId, StateId)>,
    /// Points from which skills begin, and points of places in 𝒮_r, with their places.
    anchors: Vec<(PlaceId, Spot)>,
}

/// A library laid out for one map and start, before the mission is known.
#[derive(Debug)]
pub(crate) struct Layout<'a> {
    places: Places,
    shelf: Shelf<'a>,
}

impl<'a> Layout<'a> {
    pub(crate) fn new(library: &'a Library, system: &dyn TransitionSystem, start: Spot) -> Self {
        let places = Places::new(system, start);
        let shelf = Shelf::new(library, system, &places);
        Self { places, shelf }
    }

    /// Builds the new formula's graph of subtasks and matches it with the library (IV-A).
    pub(crate) fn fit(self, problem: &'a Problem) -> Kit<'a> {
        let (system, nba) = (&*problem.system, &problem.task.nba);
        let Self { places, shelf } = self;
        let home = places.home(system);
        let graph = SubtaskGraph::new(nba, &places, home, Equivalence::None);
        let matching = Matching::new(nba, &places, &graph, &shelf);
        let endpoints = matching.unmatched.iter();
        let unmatched: HashSet<_> = endpoints.map(|e| (e.position.place, e.state)).collect();
        let mut anchors: Vec<(PlaceId, Spot)> = Vec::new();
        let ends = shelf
            .library
            .skills()
            .iter()
            .flat_map(|s| [s.first(), s.last()])
            .filter_map(|s| Some((places.of(system, &s)?, s)));
        let mut listed = HashSet::new();
        let idle = matching.unmatched.iter().map(|e| e.position.place);
        let idle = idle.filter(|&place| listed.insert(place));
        for (place, spot) in ends.chain(idle.map(|p| (p, places.spot(p)))) {
            if !anchors.iter().any(|(_, s)| s.at == spot.at) {
                anchors.push((place, spot));
            }
        }
        Kit {
            subtasks: graph.len(),
            labels: loops(nba),
            unmatched,
            system,
            nba,
            places,
            shelf,
            matching,
            anchors,
        }
    }
}

impl Kit<'_> {
    /// Whether a place in an automaton state is worth connecting to: a skill begins there, or a
    /// subtask that has none (𝒦₁ ∪ 𝒮_r).
    fn is_endpoint(&self, place: PlaceId, state: StateId) -> bool {
        self.matching.begins(place, state) || self.unmatched.contains(&(place, state))
    }

    fn place_of(&self, spot: &Spot) -> Option<PlaceId> {
        self.places.of(self.system, spot)
    }
}

/// A point of a reused path at which the automaton accepts: the path goes on from there.
#[derive(Clone, Debug)]
pub(crate) struct Continuation {
    pub(crate) node: NodeId,
    reuse: Reuse,
    /// The number of the waypoint.
    at: usize,
}

/// What of the kit one tree has used.
#[derive(Default)]
pub(crate) struct Reuser {
    open: BinaryHeap<Reverse<Entry<NodeId>>>,
    /// For each node, the cost at which its skills were added (`Used` of Alg. 5).
    used: Vec<f64>,
    /// For each node, the least cost at which it was opened.
    opened: Vec<f64>,
    /// Nodes that a path passes, and that were not looked at as places where skills begin: a path that ends beside them does that. On
    /// automata of thousands of states there are as many nodes at a site, and few of them are new.
    passed: HashMap<SiteId, Vec<NodeId>>,
    /// A buffer: nodes to look at.
    arrived: Vec<NodeId>,
    /// For each skill, the sites of its waypoints, once it was used.
    sites: Vec<Vec<SiteId>>,
    /// Whether accepting points of paths are to be remembered.
    remember: bool,
    pub(crate) continuations: Vec<Continuation>,
}

impl Reuser {
    pub(crate) fn new(kit: &Kit<'_>, remember: bool) -> Self {
        Self {
            sites: vec![Vec::new(); kit.shelf.library.skills().len()],
            remember,
            ..Self::default()
        }
    }

    /// Offers a node as the starting endpoint of skills. It is taken if skills begin there and were
    /// not added yet, or only at a higher cost.
    pub(crate) fn offer(&mut self, kit: &Kit<'_>, tree: &Tree<'_>, node: NodeId) {
        if let Some(place) = kit.place_of(&tree.spot(node)) {
            self.offer_at(kit, tree, node, place);
        }
    }

    fn offer_at(&mut self, kit: &Kit<'_>, tree: &Tree<'_>, node: NodeId, place: PlaceId) {
        let (cost, i) = (tree.cost(node), node.index());
        if self.used.get(i).is_some_and(|&used| cost >= used)
            || !kit.matching.begins(place, tree.state(node))
        {
            return;
        }
        if self.opened.len() <= i {
            self.opened.resize(tree.len(), f64::INFINITY);
        }
        if cost < self.opened[i] {
            self.opened[i] = cost;
            self.open.push(Reverse(Entry(cost, node)));
        }
    }

    /// ConnectStates (Alg. 4, line 13) and the one-hop condition of Alg. 5, line 3: connects the nodes
    /// of a site to the endpoints that they reach in one move.
    pub(crate) fn connect_states(&mut self, kit: &Kit<'_>, tree: &mut Tree<'_>, site: SiteId) {
        let spot = tree.site_spot(site);
        for &(place, end) in &kit.anchors {
            if end.at == spot.at || !kit.system.step(&spot, &end) {
                continue;
            }
            let length = kit.system.distance(spot.at, end.at);
            let nodes: SmallVec<[(StateId, NodeId); 16]> = tree.at_site(site).into();
            for (state, node) in nodes {
                for next in kit.nba.successors(state, spot.letter) {
                    if kit.is_endpoint(place, next) {
                        let there = tree.site_for(end);
                        let (reached, changed) = tree.hop(node, there, next, length);
                        if changed {
                            self.passed.entry(there).or_default().push(reached);
                            self.offer_at(kit, tree, reached, place);
                        }
                    }
                }
            }
        }
    }

    /// The cost of the cheapest node whose skills are still to be added.
    pub(crate) fn next_cost(&self) -> Option<f64> {
        self.open.peek().map(|Reverse(Entry(cost, _))| *cost)
    }

    /// Adds the skills that begin at the cheapest open node, and opens the nodes that they reach.
    /// Cheapest first, so that each endpoint's skills are added once, at their final cost: the
    /// recursion of Alg. 5, line 9, in an order that leaves nothing to repair.
    pub(crate) fn step(&mut self, kit: &Kit<'_>, tree: &mut Tree<'_>) {
        let Some(Reverse(Entry(cost, node))) = self.open.pop() else {
            return;
        };
        if self.used.len() < tree.len() {
            self.used.resize(tree.len(), f64::INFINITY);
        }
        let now = tree.cost(node);
        if cost > now {
            // It got cheaper since, and what is cheaper than it is now goes first.
            if now < self.used[node.index()] && now < self.opened[node.index()] {
                self.opened[node.index()] = now;
                self.open.push(Reverse(Entry(now, node)));
            }
            return;
        }
        if self.used[node.index()] <= cost {
            return;
        }
        self.used[node.index()] = cost;
        let Some(place) = kit.place_of(&tree.spot(node)) else {
            return;
        };
        for reuse in kit.matching.starting(place, tree.state(node)) {
            self.follow(kit, tree, node, reuse);
        }
    }

    /// Adds all skills that can be reached at a cost below a limit (greedy use), the cheapest first, unless the time is over.
    pub(crate) fn spread(
        &mut self,
        kit: &Kit<'_>,
        tree: &mut Tree<'_>,
        limit: f64,
        budget: &Budget,
    ) {
        let mut steps = 0_u64;
        while self.next_cost().is_some_and(|cost| cost < limit) {
            steps += 1;
            if budget.is_over_after(steps) {
                return;
            }
            self.step(kit, tree);
        }
    }

    /// ConnectReusedPath (Alg. 6) for one path, from a node at its starting endpoint.
    fn follow(&mut self, kit: &Kit<'_>, tree: &mut Tree<'_>, node: NodeId, reuse: &Reuse) {
        let Some((parent, first)) = enter(kit, tree, node, reuse) else {
            return;
        };
        self.advance(kit, tree, parent, first, reuse);
    }

    /// Continues a reused path from one of its points, now the root of another tree.
    pub(crate) fn resume(
        &mut self,
        kit: &Kit<'_>,
        tree: &mut Tree<'_>,
        node: NodeId,
        from: &Continuation,
    ) {
        self.advance(kit, tree, node, from.at + 1, &from.reuse);
    }

    /// Adds the waypoints of a path from number `first` on, and offers its end.
    fn advance(
        &mut self,
        kit: &Kit<'_>,
        tree: &mut Tree<'_>,
        mut parent: NodeId,
        first: usize,
        reuse: &Reuse,
    ) {
        let skill = kit.shelf.skill(reuse.used);
        let count = skill.path().len();
        let sites = &mut self.sites[reuse.used.skill as usize];
        if sites.is_empty() {
            sites.extend(skill.path().iter().map(|&s| tree.site_for(s)));
        }
        for i in first..count {
            let number = if reuse.used.backward {
                count - 1 - i
            } else {
                i
            };
            let site = self.sites[reuse.used.skill as usize][number];
            let state = reuse.run.state(i);
            let length = skill.leg(i - 1, reuse.used.backward);
            let (node, changed) = tree.hop(parent, site, state, length);
            parent = node;
            if changed {
                self.passed.entry(site).or_default().push(node);
            }
            if self.remember && i + 1 < count && kit.nba.is_accepting(state) {
                self.continuations.push(Continuation {
                    node: parent,
                    reuse: reuse.clone(),
                    at: i,
                });
            }
        }
        let site = tree.site_of(parent);
        let mut arrived = std::mem::take(&mut self.arrived);
        arrived.push(parent);
        if let Some(passed) = self.passed.get_mut(&site) {
            arrived.append(passed);
        }
        tree.settle_nodes(site, &mut arrived);
        for node in arrived.drain(..) {
            self.offer_at(kit, tree, node, reuse.to);
        }
        self.arrived = arrived;
    }
}

/// From a node in the region where a path begins to the path: at its first point already, straight
/// to its second point, or by a move within the region to its first. Returns the node reached and
/// the number of the waypoint that comes next.
fn enter(
    kit: &Kit<'_>,
    tree: &mut Tree<'_>,
    node: NodeId,
    reuse: &Reuse,
) -> Option<(NodeId, usize)> {
    let skill = kit.shelf.skill(reuse.used);
    let (here, state) = (tree.spot(node), tree.state(node));
    let first = skill.spot(0, reuse.used.backward);
    if first.at == here.at {
        return Some((node, 1));
    }
    let second = skill.spot(1, reuse.used.backward);
    let target = reuse.run.state(1);
    if kit.system.step(&here, &second) {
        let length = kit.system.distance(here.at, second.at);
        let site = tree.site_for(second);
        let (reached, _) = tree.hop(node, site, target, length);
        return Some((reached, 2));
    }
    if !kit.system.step(&here, &first) {
        return None;
    }
    // The letter of the region is read twice: in the state before the step, or in the one after.
    let waits = |q: StateId| kit.labels[q.index()].contains(here.letter);
    let through = match (waits(state), waits(target)) {
        (true, _) => state,
        (false, true) => target,
        (false, false) => return None,
    };
    let length = kit.system.distance(here.at, first.at);
    let site = tree.site_for(first);
    let (reached, _) = tree.hop(node, site, through, length);
    Some((reached, 1))
}
