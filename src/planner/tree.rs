//! A random tree over the product of workspace and automaton (`nngtl.md`, III-A).
//!
//! Product states that share a place share one *site*: its letter, its entry in the spatial index
//! and the collision check of a move between two places are found once for all automaton states.

mod links;
mod near;
mod reach;
mod steps;
mod ways;

use std::cell::RefCell;
use std::sync::Arc;

use nalgebra::Point2;

use super::sampler::leads::Leads;
use super::split::{Began, Clock, Split};
use crate::automaton::{Nba, StateId};
use crate::plan::Waypoint;
use crate::system::{Spot, TransitionSystem};
pub(crate) use near::Near;
use near::{Hit, SiteIndex};
use steps::Steps;
use ways::{Way, Ways};

/// The number of a node (a product state) of a [`Tree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub(crate) u32);

impl NodeId {
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// The number of a site (a place) of a [`Tree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SiteId(pub(crate) u32);

/// Links of the intrusive child lists: no node.
const NONE: u32 = u32::MAX;

/// Improvements below this share of a cost are rounding, not progress.
const IMPROVEMENT: f64 = 1e-12;

#[derive(Clone, Debug)]
struct Node {
    site: SiteId,
    state: StateId,
    parent: u32,
    first_child: u32,
    next_sibling: u32,
    previous_sibling: u32,
}

/// A place, with where its nodes stand in [`Tree::here`].
#[derive(Clone, Copy, Debug)]
struct Site {
    spot: Spot,
    first: u32,
    len: u32,
    room: u32,
    /// The least cost of its nodes.
    least: f64,
    /// No node costs more.
    most: f64,
    /// The states that can follow its nodes, each as bit number `state mod 64`.
    targets: u64,
}

/// A place near the one that is being added.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    site: SiteId,
    distance: f64,
    /// The least cost of any node there, plus the distance: what an edge from there costs at least.
    bound: f64,
    /// Whether a move is possible, once that was asked.
    visible: Option<bool>,
}

/// A tree of product states with least-cost paths from its root.
#[derive(Clone)]
pub struct Tree<'a> {
    system: &'a dyn TransitionSystem,
    nba: &'a Nba,
    /// What `nba` does on each letter.
    steps: Arc<Steps>,
    sites: Vec<Site>,
    nodes: Vec<Node>,
    /// For each node the length of the path to it.
    costs: Vec<f64>,
    /// For each site its nodes by ascending automaton state, with room to grow. A site that needs
    /// more moves to the end; what it leaves behind is lost, but never more than is in use.
    here: Vec<(StateId, NodeId)>,
    index: SiteIndex,
    /// For each automaton state, the nodes in it.
    by_state: Vec<Vec<NodeId>>,
    /// Nodes that were added or became cheaper since this was last taken.
    touched: Vec<NodeId>,
    /// No node of this cost or more is added.
    limit: f64,
    clock: Clock,
    /// What samplers remember of the nodes; nothing here depends on it.
    leads: RefCell<Leads>,
    // Buffers that are kept between calls, so that growing allocates nothing.
    hits: Vec<Hit>,
    neighbours: Vec<Neighbour>,
    /// Places one move away, in systems of finitely many places.
    moves: Vec<Spot>,
    ways: Ways,
    stack: Vec<(NodeId, f64)>,
    open: Vec<NodeId>,
}

impl std::fmt::Debug for Tree<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tree")
            .field("sites", &self.sites.len())
            .field("nodes", &self.nodes.len())
            .finish_non_exhaustive()
    }
}

impl<'a> Tree<'a> {
    /// A tree that holds its roots alone: `root` in each of the given automaton states, and what
    /// follows from staying there.
    pub(crate) fn new(
        system: &'a dyn TransitionSystem,
        nba: &'a Nba,
        root: Spot,
        states: &[StateId],
    ) -> Self {
        Self::with_steps(system, nba, Arc::new(Steps::new(nba)), root, states)
    }

    /// As [`Tree::new`], for the world and the automaton of this tree.
    pub(crate) fn beside(&self, root: Spot, states: &[StateId]) -> Self {
        let mut tree =
            Self::with_steps(self.system, self.nba, Arc::clone(&self.steps), root, states);
        tree.clock = self.clock.same();
        tree
    }

    fn with_steps(
        system: &'a dyn TransitionSystem,
        nba: &'a Nba,
        steps: Arc<Steps>,
        root: Spot,
        states: &[StateId],
    ) -> Self {
        let mut tree = Self {
            system,
            nba,
            steps,
            sites: Vec::new(),
            nodes: Vec::new(),
            costs: Vec::new(),
            here: Vec::new(),
            index: SiteIndex::default(),
            by_state: vec![Vec::new(); nba.len()],
            touched: Vec::new(),
            limit: f64::INFINITY,
            clock: Clock::default(),
            leads: RefCell::default(),
            hits: Vec::new(),
            neighbours: Vec::new(),
            moves: Vec::new(),
            ways: Ways::new(nba.len()),
            stack: Vec::new(),
            open: Vec::new(),
        };
        let site = tree.add_site(root);
        for &state in states {
            tree.add_node(site, state, 0.0, NONE);
        }
        tree.settle_states(site);
        tree
    }

    /// How many product states the tree holds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether the tree holds nothing (it never does).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// How many places the tree holds.
    #[must_use]
    pub fn site_count(&self) -> usize {
        self.sites.len()
    }

    /// The root's place.
    #[must_use]
    pub fn root(&self) -> Spot {
        self.sites[0].spot
    }

    /// The nodes in automaton state `state`, in the order they were added.
    #[must_use]
    pub fn in_state(&self, state: StateId) -> &[NodeId] {
        &self.by_state[state.index()]
    }

    /// The place of a node.
    #[must_use]
    pub fn spot(&self, node: NodeId) -> Spot {
        self.sites[self.nodes[node.index()].site.0 as usize].spot
    }

    /// The automaton state of a node.
    #[must_use]
    pub fn state(&self, node: NodeId) -> StateId {
        self.nodes[node.index()].state
    }

    /// The length of the path from the root to a node, in map units.
    #[must_use]
    pub fn cost(&self, node: NodeId) -> f64 {
        self.costs[node.index()]
    }

    /// Whether a node is at the root's place.
    #[must_use]
    pub fn is_at_root(&self, node: NodeId) -> bool {
        self.nodes[node.index()].site.0 == 0
    }

    /// The edges between different places, for pictures.
    pub fn edges(&self) -> impl Iterator<Item = (Point2<f64>, Point2<f64>)> + '_ {
        self.nodes.iter().filter_map(|n| {
            let parent = self.nodes.get(n.parent as usize)?;
            let at = |site: SiteId| self.sites[site.0 as usize].spot.at;
            (parent.site != n.site).then(|| (at(parent.site), at(n.site)))
        })
    }

    /// The path from the root to `node`, both included.
    #[must_use]
    pub fn path(&self, node: NodeId) -> Vec<Waypoint> {
        let mut path = Vec::new();
        let mut next = node.0;
        while next != NONE {
            path.push(Waypoint {
                at: self.spot(NodeId(next)).at,
                state: self.nodes[next as usize].state,
            });
            next = self.nodes[next as usize].parent;
        }
        path.reverse();
        path
    }

    /// Takes the list of nodes that were added or became cheaper since the last call.
    pub(crate) fn take_touched(&mut self, into: &mut Vec<NodeId>) {
        into.clear();
        std::mem::swap(into, &mut self.touched);
    }

    /// The place in the tree nearest to `p`.
    pub(crate) fn nearest(&self, p: Point2<f64>) -> SiteId {
        self.index.nearest(p).unwrap_or(SiteId(0))
    }

    /// The place of a site.
    pub(crate) fn site_spot(&self, site: SiteId) -> Spot {
        self.sites[site.0 as usize].spot
    }

    /// The site of a node.
    pub(crate) fn site_of(&self, node: NodeId) -> SiteId {
        self.nodes[node.index()].site
    }

    /// The nodes at a site, by ascending automaton state.
    pub(crate) fn at_site(&self, site: SiteId) -> &[(StateId, NodeId)] {
        let site = &self.sites[site.0 as usize];
        &self.here[site.first as usize..][..site.len as usize]
    }

    /// Adds no nodes from now on that cost as much as `limit` or more.
    pub(crate) fn limit(&mut self, limit: f64) {
        self.limit = limit;
    }

    /// What samplers remember of the nodes.
    pub(crate) fn leads(&self) -> &RefCell<Leads> {
        &self.leads
    }

    /// Measures from now on what growing the tree spends its time on.
    pub(crate) fn measure(&mut self) {
        self.clock = Clock::running();
    }

    /// The moment at which the drawing of a point begins, if that is measured.
    pub(crate) fn began(&self) -> Began {
        self.clock.start()
    }

    /// A point was drawn and it was found where the tree grows towards it from.
    pub(crate) fn sampled(&mut self, began: Began) {
        self.clock.stop(began, |s| &mut s.sample);
    }

    /// What growing the tree has spent its time on, if that is measured.
    pub(crate) fn split(&self) -> Split {
        self.clock.split
    }

    /// The node that a node's path comes from.
    pub(crate) fn parent(&self, node: NodeId) -> Option<NodeId> {
        let parent = self.nodes[node.index()].parent;
        (parent != NONE).then_some(NodeId(parent))
    }

    /// The site of a place; a new one, without nodes yet, if the tree does not hold it.
    pub(crate) fn site_for(&mut self, spot: Spot) -> SiteId {
        match self.index.at(spot.at) {
            Some(site) => site,
            None => self.add_site(spot),
        }
    }

    /// The site of a place, if the tree holds it.
    pub(crate) fn site_at(&self, at: Point2<f64>) -> Option<SiteId> {
        self.index.at(at)
    }

    /// Reaches `(site, state)` from `parent` by one move of the given length, which the caller knows
    /// to be possible. Returns the node, and whether it is new or got cheaper.
    pub(crate) fn hop(
        &mut self,
        parent: NodeId,
        site: SiteId,
        state: StateId,
        length: f64,
    ) -> (NodeId, bool) {
        let cost = self.cost(parent) + length;
        match self.node_at(site, state) {
            None => (self.add_node(site, state, cost, parent.0), true),
            Some(old) if improves(cost, self.cost(old)) => {
                self.reparent(old, parent, cost);
                (old, true)
            }
            Some(old) => (old, false),
        }
    }

    /// Makes `(spot, state)` a root too, a place where the path may begin at the given cost, unless it is
    /// reached more cheaply already.
    pub(crate) fn add_root(&mut self, spot: Spot, state: StateId, cost: f64) {
        let site = self.site_for(spot);
        match self.node_at(site, state) {
            None => {
                self.add_node(site, state, cost, NONE);
            }
            Some(old) if improves(cost, self.cost(old)) => {
                self.reparent(old, NodeId(NONE), cost);
            }
            Some(_) => {}
        }
    }

    /// The node of a place in an automaton state, if the tree holds it.
    pub(crate) fn find(&self, at: Point2<f64>, state: StateId) -> Option<NodeId> {
        self.node_at(self.index.at(at)?, state)
    }

    /// Extend and Rewire (`nngtl.md`, III-A, steps 3 to 6): connects `spot` in every automaton
    /// state that it can be reached in, each at least cost from the sites `near` it and from
    /// `also`; then reroutes those sites through it where that is cheaper. A place that is in the tree
    /// already is not added again, but what reaches it more cheaply, or in another state, is kept.
    /// Whether a move between two places is possible is asked once at most.
    ///
    /// Returns the site if anything was connected to it.
    pub(crate) fn extend(&mut self, spot: Spot, near: Near, also: &[SiteId]) -> Option<SiteId> {
        let mut neighbours = std::mem::take(&mut self.neighbours);
        let mut moves = std::mem::take(&mut self.moves);
        let mut ways = std::mem::replace(&mut self.ways, Ways::new(0));
        let began = self.clock.start();
        if self.system.neighbours(&spot, &mut moves) {
            self.take_neighbours(spot, &moves, &mut neighbours);
        } else {
            self.find_neighbours(spot, near, also, &mut neighbours);
        }
        self.clock.stop(began, |s| &mut s.near);
        let began = self.clock.start();
        self.reachable_states(&spot, &mut neighbours, &mut ways);
        let site = (!ways.found.is_empty()).then(|| self.join(spot, &ways));
        self.clock.stop(began, |s| &mut s.extend);
        if let Some(site) = site {
            let began = self.clock.start();
            self.rewire(site, &mut neighbours, &mut ways);
            self.clock.stop(began, |s| &mut s.rewire);
        }
        ways.clear();
        (self.neighbours, self.moves, self.ways) = (neighbours, moves, ways);
        site
    }

    /// Adds a place with the states that lead to it.
    fn join(&mut self, spot: Spot, ways: &Ways) -> SiteId {
        let known = self.index.at(spot.at);
        let site = known.unwrap_or_else(|| self.add_site(spot));
        for &state in &ways.found {
            // Of a known place the parent can have become cheaper by what was connected before.
            let Way { from, length, .. } = ways.into[state.index()];
            self.connect(site, state, self.cost(from) + length, from.0);
        }
        self.settle_states(site);
        site
    }

    /// Step 3 where places are finitely many: all sites one move away, however far.
    fn take_neighbours(&self, spot: Spot, moves: &[Spot], neighbours: &mut Vec<Neighbour>) {
        neighbours.clear();
        for there in moves {
            let Some(site) = self.index.at(there.at) else {
                continue;
            };
            let distance = self.system.distance(there.at, spot.at);
            neighbours.push(Neighbour {
                site,
                distance,
                bound: self.sites[site.0 as usize].least + distance,
                visible: Some(true),
            });
        }
        sort_by_bound(neighbours);
    }

    /// Step 3: the sites `near` the place, and `also`, the cheapest way in first.
    fn find_neighbours(
        &mut self,
        spot: Spot,
        near: Near,
        also: &[SiteId],
        neighbours: &mut Vec<Neighbour>,
    ) {
        neighbours.clear();
        let mut hits = std::mem::take(&mut self.hits);
        self.index.near(spot.at, near, &mut hits);
        let mut add = |site: SiteId| {
            let at = self.site_spot(site).at;
            if at == spot.at {
                return;
            }
            let distance = self.system.distance(at, spot.at);
            neighbours.push(Neighbour {
                site,
                distance,
                bound: self.sites[site.0 as usize].least + distance,
                visible: None,
            });
        };
        hits.iter().for_each(|hit| add(hit.site));
        let missing = |site: &&SiteId| !hits.iter().any(|hit| hit.site == **site);
        also.iter().filter(missing).for_each(|&site| add(site));
        sort_by_bound(neighbours);
        neighbours.dedup_by_key(|n| n.site);
        self.hits = hits;
    }

    /// Steps 4 and 5: the automaton states in which `spot` can be reached, each with its least
    /// cost and the node that gives it. Moves are checked only where they would be the cheapest so
    /// far: neighbours come in the order of their bounds.
    fn reachable_states(&mut self, spot: &Spot, neighbours: &mut [Neighbour], ways: &mut Ways) {
        // A site that leads to states only that are reached more cheaply has nothing to give.
        let (mut reached, mut most) = (0, 0.0);
        let few = self.by_state.len() <= 64;
        for neighbour in neighbours {
            let site = &self.sites[neighbour.site.0 as usize];
            if few && neighbour.bound >= most && site.targets & !reached == 0 {
                continue;
            }
            let letter = site.spot.letter;
            for i in 0..self.at_site(neighbour.site).len() {
                let (state, node) = self.at_site(neighbour.site)[i];
                let cost = self.cost(node) + neighbour.distance;
                if cost >= self.limit {
                    continue;
                }
                for k in self.steps.range(letter, state) {
                    let target = self.steps.target(k);
                    if ways.cost(target) <= cost {
                        continue;
                    }
                    if !self.is_visible(neighbour, spot) {
                        break;
                    }
                    ways.set(target, cost, node, neighbour.distance);
                    reached |= bit(target);
                    most = f64::max(most, cost);
                }
                if neighbour.visible == Some(false) {
                    break;
                }
            }
        }
        ways.sort();
    }

    /// Step 6: reroutes neighbours through `site` where that is cheaper.
    fn rewire(&mut self, site: SiteId, neighbours: &mut [Neighbour], ways: &mut Ways) {
        let spot = self.site_spot(site);
        // The cheapest node to leave from, for each state that can follow.
        ways.clear();
        for &(state, node) in self.at_site(site) {
            let cost = self.cost(node);
            for k in self.steps.range(spot.letter, state) {
                let target = self.steps.target(k);
                if cost < ways.cost(target) {
                    ways.set(target, cost, node, 0.0);
                }
            }
        }
        let least = self.sites[site.0 as usize].least;
        for neighbour in neighbours {
            let most = self.sites[neighbour.site.0 as usize].most;
            if neighbour.visible == Some(false) || !improves(least + neighbour.distance, most) {
                continue;
            }
            let mut improved = false;
            for i in 0..self.at_site(neighbour.site).len() {
                let (state, old) = self.at_site(neighbour.site)[i];
                let way = ways.into[state.index()];
                if way.cost == f64::INFINITY {
                    continue;
                }
                // Rerouting one neighbour can have made a node here cheaper that hangs below it.
                let from = way.from;
                let cost = self.cost(from) + neighbour.distance;
                if !improves(cost, self.cost(old)) {
                    continue;
                }
                if !self.is_visible(neighbour, &spot) {
                    break;
                }
                self.reparent(old, from, cost);
                improved = true;
            }
            if improved {
                self.settle_states(neighbour.site);
            }
            let costs = self.at_site(neighbour.site).iter();
            let most = costs.map(|&(_, n)| self.cost(n)).fold(0.0, f64::max);
            self.sites[neighbour.site.0 as usize].most = most;
        }
    }

    fn is_visible(&mut self, neighbour: &mut Neighbour, spot: &Spot) -> bool {
        if let Some(known) = neighbour.visible {
            return known;
        }
        let began = self.clock.start();
        let visible = self.system.step(&self.site_spot(neighbour.site), spot);
        self.clock.stop(began, |s| &mut s.collision);
        neighbour.visible = Some(visible);
        visible
    }

    /// Staying at `site`: from each of its nodes the automaton may read the letter there without the
    /// robot moving. Runs until nothing gets cheaper.
    pub(crate) fn settle_states(&mut self, site: SiteId) {
        let letter = self.site_spot(site).letter;
        let mut open = std::mem::take(&mut self.open);
        open.extend(self.at_site(site).iter().map(|&(_, n)| n));
        while let Some(node) = open.pop() {
            let (state, cost) = (self.state(node), self.cost(node));
            for k in self.steps.range(letter, state) {
                if let Some(changed) = self.connect(site, self.steps.target(k), cost, node.0) {
                    open.push(changed);
                }
            }
        }
        self.open = open;
    }

    /// Makes `(site, state)` reachable at `cost` from `parent`, if that is new or cheaper.
    fn connect(&mut self, site: SiteId, state: StateId, cost: f64, parent: u32) -> Option<NodeId> {
        match self.node_at(site, state) {
            None => Some(self.add_node(site, state, cost, parent)),
            Some(old) if improves(cost, self.cost(old)) => {
                self.reparent(old, NodeId(parent), cost);
                Some(old)
            }
            Some(_) => None,
        }
    }

    fn node_at(&self, site: SiteId, state: StateId) -> Option<NodeId> {
        let nodes = self.at_site(site);
        let i = nodes.binary_search_by_key(&state, |&(q, _)| q).ok()?;
        Some(nodes[i].1)
    }

    fn add_site(&mut self, spot: Spot) -> SiteId {
        let id = SiteId(self.sites.len() as u32);
        self.sites.push(Site {
            spot,
            first: self.here.len() as u32,
            len: 0,
            room: 0,
            least: f64::INFINITY,
            most: 0.0,
            targets: 0,
        });
        self.index.insert(spot.at, id);
        id
    }

    fn add_node(&mut self, site: SiteId, state: StateId, cost: f64, parent: u32) -> NodeId {
        let id = NodeId(self.nodes.len() as u32);
        self.nodes.push(Node {
            site,
            state,
            parent: NONE,
            first_child: NONE,
            next_sibling: NONE,
            previous_sibling: NONE,
        });
        self.costs.push(cost);
        self.list_node(site, state, id);
        let letter = self.site_spot(site).letter;
        let targets = self
            .steps
            .range(letter, state)
            .fold(0, |set, k| set | bit(self.steps.target(k)));
        let site = &mut self.sites[site.0 as usize];
        site.least = site.least.min(cost);
        site.most = site.most.max(cost);
        site.targets |= targets;
        self.by_state[state.index()].push(id);
        self.touched.push(id);
        if parent != NONE {
            self.link(id, parent);
        }
        id
    }

    /// Enters a node into the list of its site, in the order of states.
    fn list_node(&mut self, site: SiteId, state: StateId, id: NodeId) {
        let i = self.at_site(site).partition_point(|&(q, _)| q < state);
        let site = &mut self.sites[site.0 as usize];
        let (first, len) = (site.first as usize, site.len as usize);
        site.len += 1;
        if len < site.room as usize {
            self.here.copy_within(first + i..first + len, first + i + 1);
            self.here[first + i] = (state, id);
            return;
        }
        // Most sites have nodes in few states. The last site grows where it stands.
        let room = (2 * len).max(2);
        site.room = room as u32;
        if first + len != self.here.len() {
            site.first = self.here.len() as u32;
            self.here.extend_from_within(first..first + len);
        }
        let first = site.first as usize;
        self.here.resize(first + room, (state, id));
        self.here.copy_within(first + i..first + len, first + i + 1);
        self.here[first + i] = (state, id);
    }
}

/// The cheapest way in first.
fn sort_by_bound(neighbours: &mut [Neighbour]) {
    neighbours.sort_unstable_by(|a, b| a.bound.total_cmp(&b.bound).then(a.site.cmp(&b.site)));
}

/// The bit of a state in [`Site::targets`].
fn bit(state: StateId) -> u64 {
    1 << (state.0 % 64)
}

fn improves(new: f64, old: f64) -> bool {
    new < old * (1.0 - IMPROVEMENT)
}

#[cfg(test)]
mod tests;
