//! A random tree over the product of workspace and automaton (`nngtl.md`, III-A).
//!
//! Product states that share a place share one *site*: its letter, its entry in the spatial index
//! and the collision check of a move between two places are found once for all automaton states.

mod near;

use nalgebra::Point2;
use smallvec::SmallVec;

use crate::automaton::{Nba, StateId};
use crate::plan::Waypoint;
use crate::system::{Spot, TransitionSystem};
use near::SiteIndex;

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
    cost: f64,
    parent: u32,
    first_child: u32,
    next_sibling: u32,
    previous_sibling: u32,
}

#[derive(Clone, Debug)]
struct Site {
    spot: Spot,
    /// The nodes at this place, by ascending automaton state.
    nodes: SmallVec<[(StateId, NodeId); 4]>,
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
    sites: Vec<Site>,
    nodes: Vec<Node>,
    index: SiteIndex,
    /// For each automaton state, the nodes in it.
    by_state: Vec<Vec<NodeId>>,
    /// Nodes that were added or became cheaper since this was last taken.
    touched: Vec<NodeId>,
    neighbours: Vec<Neighbour>,
    /// Places one move away, in systems of finitely many places.
    moves: Vec<Spot>,
    /// For each automaton state, the cheapest way into it so far (see `reachable_states`).
    ways: Vec<(f64, NodeId, f64)>,
    stack: Vec<(NodeId, f64)>,
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
        let mut tree = Self {
            system,
            nba,
            sites: Vec::new(),
            nodes: Vec::new(),
            index: SiteIndex::default(),
            by_state: vec![Vec::new(); nba.len()],
            touched: Vec::new(),
            neighbours: Vec::new(),
            moves: Vec::new(),
            ways: Vec::new(),
            stack: Vec::new(),
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
        self.nodes[node.index()].cost
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
        &self.sites[site.0 as usize].nodes
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
    /// state that it can be reached in, each at least cost from the sites within `radius` and
    /// from `also`; then reroutes those sites through it where that is cheaper. A place that is in the tree already is not
    /// added again, but what reaches it more cheaply, or in another state, is kept.
    ///
    /// Returns the site if anything was connected to it.
    pub(crate) fn extend(&mut self, spot: Spot, radius: f64, also: &[SiteId]) -> Option<SiteId> {
        let mut neighbours = std::mem::take(&mut self.neighbours);
        let mut moves = std::mem::take(&mut self.moves);
        if self.system.neighbours(&spot, &mut moves) {
            self.take_neighbours(spot, &moves, &mut neighbours);
        } else {
            self.find_neighbours(spot, radius, also, &mut neighbours);
        }
        self.moves = moves;
        let reached = self.reachable_states(&spot, &mut neighbours);
        let site = (!reached.is_empty()).then(|| {
            let site = self
                .index
                .at(spot.at)
                .unwrap_or_else(|| self.add_site(spot));
            for (state, parent, distance) in reached {
                // A place that was in the tree already: connecting it in one state may have made the
                // parent of the next cheaper, so costs are read here.
                let cost = self.cost(parent) + distance;
                self.connect(site, state, cost, parent.0);
            }
            self.settle_states(site);
            self.rewire(site, &mut neighbours);
            site
        });
        self.neighbours = neighbours;
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
                bound: self.least_cost(site) + distance,
                visible: Some(true),
            });
        }
        neighbours.sort_by(|a, b| a.bound.total_cmp(&b.bound).then(a.site.cmp(&b.site)));
    }

    /// The cost of the cheapest node at a site.
    fn least_cost(&self, site: SiteId) -> f64 {
        let nodes = &self.sites[site.0 as usize].nodes;
        let costs = nodes.iter().map(|&(_, n)| self.cost(n));
        costs.fold(f64::INFINITY, f64::min)
    }

    /// Step 3: the sites within `radius`, and `also`, the cheapest way in first.
    fn find_neighbours(
        &self,
        spot: Spot,
        radius: f64,
        also: &[SiteId],
        neighbours: &mut Vec<Neighbour>,
    ) {
        neighbours.clear();
        let mut add = |site: SiteId| {
            let distance = self.system.distance(self.site_spot(site).at, spot.at);
            neighbours.push(Neighbour {
                site,
                distance,
                bound: self.least_cost(site) + distance,
                visible: None,
            });
        };
        self.index.within(spot.at, radius).for_each(&mut add);
        for &site in also {
            if (self.site_spot(site).at - spot.at).norm_squared() > radius * radius {
                add(site);
            }
        }
        neighbours.retain(|n| self.site_spot(n.site).at != spot.at);
        neighbours.sort_by(|a, b| a.bound.total_cmp(&b.bound).then(a.site.cmp(&b.site)));
        neighbours.dedup_by_key(|n| n.site);
    }

    /// Steps 4 and 5: the automaton states in which `spot` can be reached, each with its least
    /// cost: from which node, and how far from it; cheapest first. Moves are checked only where they
    /// would be the cheapest so far: neighbours come in the order of their bounds.
    fn reachable_states(
        &mut self,
        spot: &Spot,
        neighbours: &mut [Neighbour],
    ) -> SmallVec<[(StateId, NodeId, f64); 8]> {
        let mut ways = std::mem::take(&mut self.ways);
        ways.clear();
        ways.resize(self.nba.len(), (f64::INFINITY, NodeId(NONE), 0.0));
        for neighbour in neighbours {
            let site = &self.sites[neighbour.site.0 as usize];
            for &(state, node) in &site.nodes {
                let cost = self.cost(node) + neighbour.distance;
                for target in self.nba.successors(state, site.spot.letter) {
                    if ways[target.index()].0 > cost && self.is_visible(neighbour, spot) {
                        ways[target.index()] = (cost, node, neighbour.distance);
                    }
                }
            }
        }
        let way = |q: StateId| ways[q.index()];
        let mut best: SmallVec<[(StateId, NodeId, f64); 8]> = self
            .nba
            .states()
            .filter(|&q| way(q).0.is_finite())
            .map(|q| (q, way(q).1, way(q).2))
            .collect();
        best.sort_by(|a, b| way(a.0).0.total_cmp(&way(b.0).0).then(a.0.cmp(&b.0)));
        self.ways = ways;
        best
    }

    /// Step 6: reroutes neighbours through `site` where that is cheaper.
    fn rewire(&mut self, site: SiteId, neighbours: &mut [Neighbour]) {
        let spot = self.site_spot(site);
        let here = self.sites[site.0 as usize].nodes.clone();
        for neighbour in neighbours {
            let mut improved = false;
            for &(state, node) in &here {
                let cost = self.cost(node) + neighbour.distance;
                for target in self.nba.successors(state, spot.letter) {
                    let Some(old) = self.node_at(neighbour.site, target) else {
                        continue;
                    };
                    if !improves(cost, self.cost(old)) || !self.is_visible(neighbour, &spot) {
                        continue;
                    }
                    self.reparent(old, node, cost);
                    improved = true;
                }
            }
            if improved {
                self.settle_states(neighbour.site);
            }
        }
    }

    fn is_visible(&self, neighbour: &mut Neighbour, spot: &Spot) -> bool {
        *neighbour
            .visible
            .get_or_insert_with(|| self.system.step(&self.site_spot(neighbour.site), spot))
    }

    /// Staying at `site`: from each of its nodes the automaton may read the letter there without the
    /// robot moving. Runs until nothing gets cheaper.
    pub(crate) fn settle_states(&mut self, site: SiteId) {
        let letter = self.site_spot(site).letter;
        let mut open: SmallVec<[NodeId; 8]> = self.sites[site.0 as usize]
            .nodes
            .iter()
            .map(|&(_, n)| n)
            .collect();
        while let Some(node) = open.pop() {
            let (state, cost) = (self.state(node), self.cost(node));
            let targets: SmallVec<[StateId; 8]> = self.nba.successors(state, letter).collect();
            for target in targets {
                if let Some(changed) = self.connect(site, target, cost, node.0) {
                    open.push(changed);
                }
            }
        }
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
        let nodes = &self.sites[site.0 as usize].nodes;
        let i = nodes.binary_search_by_key(&state, |&(q, _)| q).ok()?;
        Some(nodes[i].1)
    }

    fn add_site(&mut self, spot: Spot) -> SiteId {
        let site = SiteId(self.sites.len() as u32);
        self.sites.push(Site {
            spot,
            nodes: SmallVec::new(),
        });
        self.index.insert(spot.at, site);
        site
    }

    fn add_node(&mut self, site: SiteId, state: StateId, cost: f64, parent: u32) -> NodeId {
        let id = NodeId(self.nodes.len() as u32);
        self.nodes.push(Node {
            site,
            state,
            cost,
            parent: NONE,
            first_child: NONE,
            next_sibling: NONE,
            previous_sibling: NONE,
        });
        let here = &mut self.sites[site.0 as usize].nodes;
        let i = here.partition_point(|&(q, _)| q < state);
        here.insert(i, (state, id));
        self.by_state[state.index()].push(id);
        self.touched.push(id);
        if parent != NONE {
            self.link(id, parent);
        }
        id
    }

    /// Gives `node` a new parent and passes the saving on to everything below it.
    fn reparent(&mut self, node: NodeId, parent: NodeId, cost: f64) {
        self.unlink(node);
        if parent.0 == NONE {
            self.nodes[node.index()].parent = NONE;
        } else {
            self.link(node, parent.0);
        }
        let mut stack = std::mem::take(&mut self.stack);
        stack.push((node, cost));
        while let Some((node, cost)) = stack.pop() {
            let saving = self.nodes[node.index()].cost - cost;
            self.nodes[node.index()].cost = cost;
            self.touched.push(node);
            let mut child = self.nodes[node.index()].first_child;
            while child != NONE {
                stack.push((NodeId(child), self.nodes[child as usize].cost - saving));
                child = self.nodes[child as usize].next_sibling;
            }
        }
        self.stack = stack;
    }

    fn link(&mut self, node: NodeId, parent: u32) {
        let first = self.nodes[parent as usize].first_child;
        let n = &mut self.nodes[node.index()];
        n.parent = parent;
        n.previous_sibling = NONE;
        n.next_sibling = first;
        if first != NONE {
            self.nodes[first as usize].previous_sibling = node.0;
        }
        self.nodes[parent as usize].first_child = node.0;
    }

    fn unlink(&mut self, node: NodeId) {
        let Node {
            parent,
            next_sibling,
            previous_sibling,
            ..
        } = self.nodes[node.index()];
        if parent == NONE {
            return;
        }
        if previous_sibling == NONE {
            self.nodes[parent as usize].first_child = next_sibling;
        } else {
            self.nodes[previous_sibling as usize].next_sibling = next_sibling;
        }
        if next_sibling != NONE {
            self.nodes[next_sibling as usize].previous_sibling = previous_sibling;
        }
    }
}

fn improves(new: f64, old: f64) -> bool {
    new < old * (1.0 - IMPROVEMENT)
}

#[cfg(test)]
mod tests;
