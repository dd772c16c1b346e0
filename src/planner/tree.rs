//! A random tree over the product of workspace and automaton (`nngtl.md`, III-A).
//!
//! Product states that share a place share one *site*: its letter, its entry in the spatial index
//! and the collision check of a move between two places are found once for all automaton states.

mod grow;
mod index;
mod links;
mod near;
mod reach;
mod steps;
mod ways;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::Point2;

use super::informed::{Informed, Outlook};
use super::sampler::leads::Leads;
use super::split::{Began, Clock, Split};
use crate::alphabet::Letter;
use crate::automaton::{Nba, StateId};
use crate::plan::Waypoint;
use crate::system::{Spot, TransitionSystem};
use grow::Neighbour;
use index::SiteIndex;
use near::Hit;
pub(crate) use near::Near;
use steps::Steps;
use ways::Ways;

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

/// From so many places on the sites near a drawn point are asked for at once: the nearest is one of them, and the
/// tree will hardly be grown to another point than this.
const LARGE: usize = 256;

/// No tree gets room for more places than this before it has them.
const EXPECTED: u64 = 1 << 17;

/// Improvements below this share of a cost are rounding, not progress.
const IMPROVEMENT: f64 = 1e-12;

#[derive(Clone, Debug)]
#[repr(align(32))] // never in two cache lines
struct Node {
    /// The length of the path to it.
    cost: f64,
    site: SiteId,
    state: StateId,
    parent: u32,
    first_child: u32,
    next_sibling: u32,
    previous_sibling: u32,
}

/// A place.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))] // never in two cache lines
struct Site {
    at: Point2<f64>,
    letter: Letter,
    /// Where its nodes stand in [`Tree::here`], how many they are, and how many fit there.
    first: u32,
    len: u32,
    room: u32,
}

impl Site {
    fn spot(&self) -> Spot {
        Spot {
            at: self.at,
            letter: self.letter,
        }
    }
}

/// A tree of product states with least-cost paths from its root.
#[derive(Clone)]
pub struct Tree<'a> {
    system: &'a dyn TransitionSystem,
    /// Whether it has finitely many places.
    finite: bool,
    nba: &'a Nba,
    /// What `nba` does on each letter.
    steps: Arc<Steps>,
    sites: Vec<Site>,
    nodes: Vec<Node>,
    /// For each node by how much the paths to its children got shorter that they do not know of yet.
    owed: Vec<f64>,
    /// For each site its nodes by ascending automaton state, with room to grow. A site that needs
    /// more moves to the end; what it leaves behind is lost, but never more than is in use.
    here: Vec<(StateId, NodeId)>,
    /// Where the sites are, and what is asked of those that are near.
    index: SiteIndex,
    /// For each automaton state, the nodes in it.
    by_state: Vec<Vec<NodeId>>,
    /// Nodes that were added or became cheaper since this was last taken.
    touched: Vec<NodeId>,
    /// No node of this cost or more is added.
    limit: f64,
    /// What is left at least from the place that is being added.
    outlook: Outlook,
    /// Whether points come in an order in which what one has read serves the next.
    swept: bool,
    clock: Clock,
    /// What samplers remember of the nodes; nothing here depends on it.
    leads: RefCell<Leads>,
    // Buffers that are kept between calls, so that growing allocates nothing.
    hits: Vec<Hit>,
    /// What `hits` answers, until a site is added.
    asked: Option<(Point2<f64>, Near)>,
    neighbours: Vec<Neighbour>,
    tried: Vec<SiteId>,
    /// Places one move away, in systems of finitely many places.
    moves: Vec<Spot>,
    ways: Ways,
    /// Nodes that owe their children something.
    owing: VecDeque<NodeId>,
    /// How many nodes get cheaper in one step at most, but for those that are rerouted themselves, for each doubling of the tree.
    allowance: usize,
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
        tree.allowance = self.allowance;
        tree.swept = self.swept;
        tree
    }

    fn with_steps(
        system: &'a dyn TransitionSystem,
        nba: &'a Nba,
        steps: Arc<Steps>,
        root: Spot,
        states: &[StateId],
    ) -> Self {
        let mut moves = Vec::new();
        let mut tree = Self {
            system,
            finite: system.neighbours(&root, &mut moves),
            nba,
            steps,
            sites: Vec::new(),
            nodes: Vec::new(),
            owed: Vec::new(),
            here: Vec::new(),
            index: SiteIndex::default(),
            by_state: vec![Vec::new(); nba.len()],
            touched: Vec::new(),
            limit: f64::INFINITY,
            outlook: Outlook::new(nba.len()),
            swept: false,
            clock: Clock::default(),
            leads: RefCell::default(),
            hits: Vec::new(),
            asked: None,
            neighbours: Vec::new(),
            tried: Vec::new(),
            moves,
            ways: Ways::new(nba.len()),
            owing: VecDeque::new(),
            allowance: usize::MAX,
            open: Vec::new(),
        };
        let site = tree.add_site(root);
        for &state in states {
            tree.add_node(site, state, 0.0, NONE);
        }
        tree.settle_states(site);
        tree
    }

    /// Makes room for so many places with a node each, [`EXPECTED`] at most, in one piece: what grows by and by is copied each time.
    /// Room that is not used yet is no memory yet.
    pub(crate) fn expect(&mut self, places: u64) {
        let places = places.min(EXPECTED) as usize;
        let more = |len: usize| places.saturating_sub(len);
        self.sites.reserve_exact(more(self.sites.len()));
        self.nodes.reserve_exact(more(self.nodes.len()));
        self.owed.reserve_exact(more(self.owed.len()));
        self.here.reserve_exact(more(self.here.len()));
        self.index.expect(places);
    }

    /// Says that points come in an order in which what one has read serves the next: then nothing is gained by reading it ahead.
    pub(crate) fn expect_sweeps(&mut self) {
        self.swept = true;
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
        self.sites[0].spot()
    }

    /// The nodes in automaton state `state`, in the order they were added.
    #[must_use]
    pub fn in_state(&self, state: StateId) -> &[NodeId] {
        &self.by_state[state.index()]
    }

    /// The place of a node.
    #[must_use]
    pub fn spot(&self, node: NodeId) -> Spot {
        self.site_spot(self.nodes[node.index()].site)
    }

    /// The automaton state of a node.
    #[must_use]
    pub fn state(&self, node: NodeId) -> StateId {
        self.nodes[node.index()].state
    }

    /// The length of the path from the root to a node, in map units; more than that while savings have not
    /// come down to it yet.
    #[must_use]
    pub fn cost(&self, node: NodeId) -> f64 {
        self.nodes[node.index()].cost
    }

    /// The length of the path from the root to a node, whatever has not come down to it yet.
    pub(crate) fn length_to(&self, node: NodeId) -> f64 {
        let mut length = self.cost(node);
        let mut next = self.nodes[node.index()].parent;
        while next != NONE {
            length -= self.owed[next as usize];
            next = self.nodes[next as usize].parent;
        }
        length
    }

    /// Lets no more than so many nodes below those that are rerouted get cheaper in one step, times the binary logarithm of the tree's size;
    /// others wait for the next. Near the root a step can concern most of the tree.
    pub(crate) fn pass_on_at_most(&mut self, allowance: usize) {
        self.allowance = allowance;
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
            let at = |site: SiteId| self.sites[site.0 as usize].at;
            (parent.site != n.site).then(|| (at(parent.site), at(n.site)))
        })
    }

    /// The path from the root to `node`, both included.
    #[must_use]
    pub fn path(&self, node: NodeId) -> Vec<Waypoint> {
        let mut path = Vec::new();
        self.path_into(node, &mut path);
        path
    }

    /// As [`Self::path`], written over what `path` holds.
    pub(crate) fn path_into(&self, node: NodeId, path: &mut Vec<Waypoint>) {
        path.clear();
        let mut next = node.0;
        while next != NONE {
            path.push(Waypoint {
                at: self.spot(NodeId(next)).at,
                state: self.nodes[next as usize].state,
            });
            next = self.nodes[next as usize].parent;
        }
        path.reverse();
    }

    /// A hash of the letters and states along the path to `node`, waits left out: paths of the same visits in the same
    /// order share it.
    pub(crate) fn word_to(&self, node: NodeId) -> u64 {
        let nodes = std::iter::successors(Some(node), |&n| self.parent(n));
        let steps = nodes.map(|n| (self.spot(n).letter.index(), self.state(n).index()));
        let mut last = None;
        steps.fold(0, |hash: u64, step| {
            if last.replace(step) == Some(step) {
                return hash;
            }
            let number = (step.0 as u64) << 32 | step.1 as u64;
            (hash.rotate_left(5) ^ number).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        })
    }

    /// Takes the list of nodes that were added or became cheaper since the last call.
    pub(crate) fn take_touched(&mut self, into: &mut Vec<NodeId>) {
        into.clear();
        std::mem::swap(into, &mut self.touched);
    }

    /// Puts all nodes on that list.
    pub(crate) fn touch_all(&mut self) {
        self.touched.clear();
        self.touched
            .extend((0..self.nodes.len() as u32).map(NodeId));
    }

    /// The place in the tree nearest to `p`.
    pub(crate) fn nearest(&self, p: Point2<f64>) -> SiteId {
        self.index.nearest(p).unwrap_or(SiteId(0))
    }

    /// As [`Self::nearest`], and its place; what is `near` is likely to be asked for by [`Self::extend`] next.
    pub(crate) fn nearest_of(&mut self, p: Point2<f64>, near: Near) -> (SiteId, Point2<f64>) {
        if self.finite || self.sites.len() < LARGE {
            let site = self.nearest(p);
            return (site, self.site_spot(site).at);
        }
        let began = self.clock.start();
        self.ask(p, near);
        self.clock.stop(began, |s| &mut s.near);
        let Some(first) = self.hits.iter().min() else {
            let site = self.nearest(p);
            return (site, self.site_spot(site).at);
        };
        let ties = self.hits.iter().filter(|h| h.square() == first.square());
        let ties = ties.map(|h| (self.index.rank_at(h.slot).site, self.index.place_at(h.slot)));
        ties.min_by_key(|t| t.0).unwrap_or((SiteId(0), p))
    }

    /// Looks for the sites `near` a place, unless that is what was asked last.
    fn ask(&mut self, at: Point2<f64>, near: Near) {
        if self.asked != Some((at, near)) {
            self.index.near(at, near, &mut self.hits);
            self.asked = Some((at, near));
        }
    }

    /// The place of a site.
    pub(crate) fn site_spot(&self, site: SiteId) -> Spot {
        self.sites[site.0 as usize].spot()
    }

    /// The site of a node.
    pub(crate) fn site_of(&self, node: NodeId) -> SiteId {
        self.nodes[node.index()].site
    }

    /// The nodes at a site, by ascending automaton state.
    pub(crate) fn at_site(&self, site: SiteId) -> &[(StateId, NodeId)] {
        let place = &self.sites[site.0 as usize];
        &self.here[place.first as usize..][..place.len as usize]
    }

    /// Adds no nodes from now on that cost as much as `limit` or more.
    pub(crate) fn limit(&mut self, limit: f64) {
        self.limit = limit;
    }

    /// Lets the tree know what ways come to at least: from now on nothing is added that can be on none shorter than the limit.
    pub(super) fn inform(&mut self, informed: Informed) {
        self.outlook.inform(informed);
    }

    pub(super) fn is_informed(&self) -> bool {
        self.outlook.is_informed()
    }

    /// Whether a way that is shorter than the limit can lead over a place, as far as that is known.
    pub(super) fn may_lead_over(&mut self, at: Point2<f64>) -> bool {
        self.outlook.look(at, self.limit)
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

    /// A point was drawn.
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
                self.pass_on();
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
                self.pass_on();
            }
            Some(_) => {}
        }
    }

    /// The node of a place in an automaton state, if the tree holds it.
    pub(crate) fn find(&self, at: Point2<f64>, state: StateId) -> Option<NodeId> {
        self.node_at(self.index.at(at)?, state)
    }

    /// Staying at `site`: from each of its nodes the automaton may read the letter there without the
    /// robot moving. Runs until nothing gets cheaper.
    pub(crate) fn settle_states(&mut self, site: SiteId) {
        self.settle(site);
        self.pass_on();
    }

    /// As [`Self::settle_states`], from some of its nodes alone. Those that are new or got cheaper are added to them.
    pub(crate) fn settle_nodes(&mut self, site: SiteId, nodes: &mut Vec<NodeId>) {
        let mut open = std::mem::take(&mut self.open);
        open.extend_from_slice(nodes);
        self.settle_from(site, &mut open, |changed| nodes.push(changed));
        self.open = open;
        self.pass_on();
    }

    /// As [`Self::settle_states`], and what follows further on is still owed.
    fn settle(&mut self, site: SiteId) {
        let mut open = std::mem::take(&mut self.open);
        open.extend(self.at_site(site).iter().map(|&(_, n)| n));
        self.settle_from(site, &mut open, |_| {});
        self.open = open;
    }

    /// Reads the letter of a place from each of the open nodes, which are its own, until nothing gets cheaper.
    fn settle_from(
        &mut self,
        site: SiteId,
        open: &mut Vec<NodeId>,
        mut changed_there: impl FnMut(NodeId),
    ) {
        let Spot { at, letter } = self.site_spot(site);
        while let Some(node) = open.pop() {
            let (state, cost) = (self.state(node), self.cost(node));
            for k in self.steps.range(letter, state) {
                let target = self.steps.target(k);
                if target == state || self.steps.is_end(letter, target) {
                    continue;
                }
                let known = self.node_at(site, target).is_some();
                if !known && cost + self.outlook.left_from(at, target) >= self.limit {
                    continue;
                }
                if let Some(changed) = self.connect(site, target, cost, node.0) {
                    open.push(changed);
                    changed_there(changed);
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
        let nodes = self.at_site(site);
        let i = nodes.binary_search_by_key(&state, |&(q, _)| q).ok()?;
        Some(nodes[i].1)
    }

    /// Adds a place that the tree does not hold.
    fn add_site(&mut self, spot: Spot) -> SiteId {
        self.asked = None;
        index::push(
            &mut self.sites,
            Site {
                at: spot.at,
                letter: spot.letter,
                first: self.here.len() as u32,
                len: 0,
                room: 0,
            },
        );
        self.index.insert(spot.at)
    }

    fn add_node(&mut self, site: SiteId, state: StateId, cost: f64, parent: u32) -> NodeId {
        let id = NodeId(self.nodes.len() as u32);
        index::push(
            &mut self.nodes,
            Node {
                cost,
                site,
                state,
                parent: NONE,
                first_child: NONE,
                next_sibling: NONE,
                previous_sibling: NONE,
            },
        );
        self.owed.push(0.0);
        self.list_node(site, state, id);
        let letter = self.site_spot(site).letter;
        let row = self.steps.row(letter, state);
        let targets = self
            .steps
            .range_of(row)
            .fold(0, |set, k| set | bit(self.steps.target(k)));
        let alone = self.sites[site.0 as usize].len == 1;
        let rank = self.index.rank_mut(site);
        if !alone {
            rank.set_most(rank.most().max(cost));
        }
        rank.only = if alone { id.0 } else { NONE };
        rank.row = row;
        rank.least = rank.least.min(cost);
        rank.targets |= targets;
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
        let place = &mut self.sites[site.0 as usize];
        let (first, len) = (place.first as usize, place.len as usize);
        place.len += 1;
        if len < place.room as usize {
            self.here.copy_within(first + i..first + len, first + i + 1);
            self.here[first + i] = (state, id);
            return;
        }
        // Most sites have nodes in few states. The last site grows where it stands.
        let room = (2 * len).max(2);
        place.room = room as u32;
        if first + len != self.here.len() {
            place.first = self.here.len() as u32;
            self.here.extend_from_within(first..first + len);
        }
        let first = place.first as usize;
        self.here.resize(first + room, (state, id));
        self.here.copy_within(first + i..first + len, first + i + 1);
        self.here[first + i] = (state, id);
    }
}

/// The bit of a state in [`index::Rank::targets`].
fn bit(state: StateId) -> u64 {
    1 << (state.0 % 64)
}

fn improves(new: f64, old: f64) -> bool {
    new < old * (1.0 - IMPROVEMENT)
}

#[cfg(test)]
mod tests;
