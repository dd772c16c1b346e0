//! Extend and Rewire: how a place joins the tree.

use nalgebra::Point2;

use super::index::Rank;
use super::near::Near;
use super::ways::{Way, Ways};
use super::{NONE, NodeId, SiteId, Tree, bit, improves};
use crate::automaton::StateId;
use crate::system::Spot;

/// So many neighbours are found by looking for the cheapest way in; if more are needed, the rest is
/// sorted. Mostly the first one does.
const PICKS: usize = 6;

/// Trees of fewer nodes, half a megabyte, stay in the caches of a core.
const CACHED: usize = 1 << 14;

/// A place near the one that is being added.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    pub(super) site: SiteId,
    pub(super) distance: f64,
    /// The least cost of any node there, plus the distance: what an edge from there costs at least.
    pub(super) bound: f64,
    /// What was known of its nodes when it was found: the greatest cost, and the states that can follow.
    most: f64,
    targets: u64,
    /// Its node, if it has one and no more.
    only: u32,
    /// Its letter and the state of one of its nodes.
    row: u32,
    at: Point2<f64>,
    /// Whether a move is possible, once that was asked.
    pub(super) visible: Option<bool>,
}

impl Neighbour {
    fn new(distance: f64, at: Point2<f64>, rank: &Rank) -> Self {
        Self {
            site: rank.site,
            distance,
            bound: rank.least + distance,
            most: rank.most(),
            targets: rank.targets,
            only: rank.only,
            row: rank.row,
            at,
            visible: None,
        }
    }

    /// Whether a step of a node there may lead to a state; false only if none does.
    pub(super) fn leads_to(&self, state: StateId) -> bool {
        self.targets & bit(state) != 0
    }
}

impl Tree<'_> {
    /// Extend and Rewire (`nngtl.md`, III-A, steps 3 to 6): connects `spot` in every automaton
    /// state that it can be reached in, each at least cost from the sites `near` it and from
    /// `also`; then reroutes those sites through it where that is cheaper. A place that is in the tree
    /// already is not added again, but what reaches it more cheaply, or in another state, is kept.
    /// Whether a move between two places is possible is asked once at most.
    /// States that nothing follows on the place's letter are left out (ours): no path and no suffix goes on from there.
    ///
    /// Where none of the near sites leads to the place, `near.more` sites are tried. What can be on no way shorter than the limit is left
    /// out, as far as the tree is [informed](super::Tree::inform).
    ///
    /// Returns the site if anything was connected to it.
    pub(crate) fn extend(&mut self, spot: Spot, near: Near, also: &[SiteId]) -> Option<SiteId> {
        if !self.may_lead_over(spot.at) {
            return None;
        }
        let mut neighbours = std::mem::take(&mut self.neighbours);
        let mut moves = std::mem::take(&mut self.moves);
        let mut ways = std::mem::replace(&mut self.ways, Ways::new(0));
        let began = self.clock.start();
        let finite = self.system.neighbours(&spot, &mut moves);
        let mut known = if finite {
            self.take_neighbours(spot, &moves, &mut neighbours)
        } else {
            self.find_neighbours(spot, near, also, &mut neighbours)
        };
        self.clock.stop(began, |s| &mut s.near);
        let began = self.clock.start();
        self.reachable_states(&spot, &mut neighbours, &mut ways);
        self.clock.stop(began, |s| &mut s.extend);
        // Where a cost limit ruled some out, others further away are no help.
        let limit = self.reach_limit();
        let limited = |n: &Neighbour| n.bound >= limit;
        if ways.found.is_empty()
            && !finite
            && near.more > neighbours.len()
            && !neighbours.iter().any(limited)
        {
            let began = self.clock.start();
            known = self.find_more(spot, near, &mut neighbours);
            self.clock.stop(began, |s| &mut s.near);
            let began = self.clock.start();
            self.reachable_states(&spot, &mut neighbours, &mut ways);
            self.clock.stop(began, |s| &mut s.extend);
        }
        let began = self.clock.start();
        let site = (!ways.found.is_empty()).then(|| self.join(spot, known, &ways));
        self.clock.stop(began, |s| &mut s.extend);
        if let Some(site) = site {
            let began = self.clock.start();
            self.rewire(site, &mut neighbours, &mut ways);
            self.pass_on();
            self.clock.stop(began, |s| &mut s.rewire);
        }
        ways.clear();
        (self.neighbours, self.moves, self.ways) = (neighbours, moves, ways);
        site
    }

    /// Adds a place with the states that lead to it; `known` is its site if the tree holds it.
    fn join(&mut self, spot: Spot, known: Option<SiteId>, ways: &Ways) -> SiteId {
        let site = known.unwrap_or_else(|| self.add_site(spot));
        for &state in &ways.found {
            // Of a known place the parent can have become cheaper by what was connected before.
            let Way { from, length, .. } = ways.into[state.index()];
            self.connect(site, state, self.cost(from) + length, from.0);
        }
        self.settle(site);
        site
    }

    /// Step 3 where places are finitely many: all sites one move away, however far. Returns the site
    /// of the place itself.
    pub(super) fn take_neighbours(
        &self,
        spot: Spot,
        moves: &[Spot],
        neighbours: &mut Vec<Neighbour>,
    ) -> Option<SiteId> {
        neighbours.clear();
        for there in moves {
            let Some(site) = self.index.at(there.at) else {
                continue;
            };
            let distance = self.system.distance(there.at, spot.at);
            neighbours.push(Neighbour {
                visible: Some(true),
                ..self.neighbour(distance, site)
            });
        }
        self.index.at(spot.at)
    }

    /// Step 3: the sites `near` the place, and `also`. Returns the site of the place itself.
    pub(super) fn find_neighbours(
        &mut self,
        spot: Spot,
        near: Near,
        also: &[SiteId],
        neighbours: &mut Vec<Neighbour>,
    ) -> Option<SiteId> {
        neighbours.clear();
        self.ask(spot.at, near);
        let known = self.add_hits(spot.at, neighbours);
        for &site in also {
            if known != Some(site) && !neighbours.iter().any(|n| n.site == site) {
                let at = self.sites[site.0 as usize].at;
                let distance = self.system.distance(at, spot.at);
                neighbours.push(self.neighbour(distance, site));
            }
        }
        known
    }

    fn neighbour(&self, distance: f64, site: SiteId) -> Neighbour {
        let slot = self.index.slot(site);
        Neighbour::new(
            distance,
            self.index.place_at(slot),
            self.index.rank_at(slot),
        )
    }

    /// More of the nearest sites, without those that are in `neighbours`, which lead nowhere.
    fn find_more(
        &mut self,
        spot: Spot,
        near: Near,
        neighbours: &mut Vec<Neighbour>,
    ) -> Option<SiteId> {
        let mut tried = std::mem::take(&mut self.tried);
        tried.clear();
        tried.extend(neighbours.iter().map(|n| n.site));
        tried.sort_unstable();
        let near = Near {
            count: near.more,
            ..near
        };
        self.ask(spot.at, near);
        neighbours.clear();
        let known = self.add_hits(spot.at, neighbours);
        neighbours.retain(|n| tried.binary_search(&n.site).is_err());
        self.tried = tried;
        known
    }

    /// Appends the hits, but not the place itself, which is returned. Where the index is asked, lengths are
    /// Euclidean ([`neighbours`](crate::system::TransitionSystem::neighbours)).
    fn add_hits(&self, at: Point2<f64>, neighbours: &mut Vec<Neighbour>) -> Option<SiteId> {
        // Nothing but reads, so that the processor waits for all of them at once.
        let ranks = self.hits.iter().map(|h| self.index.rank_at(h.slot));
        std::hint::black_box(ranks.fold(0, |sum, rank| sum ^ rank.targets));
        let mut known = None;
        for hit in &self.hits {
            let distance = hit.square().sqrt();
            let (rank, place) = (self.index.rank_at(hit.slot), self.index.place_at(hit.slot));
            if distance > 0.0 || place != at {
                neighbours.push(Neighbour::new(distance, place, rank));
            } else {
                known = Some(rank.site);
            }
        }
        known
    }

    /// Steps 4 and 5: the automaton states in which `spot` can be reached, each with its least
    /// cost and the node that gives it. Neighbours are asked in the order of their bounds, and moves are
    /// checked only where they would be the cheapest so far.
    fn reachable_states(&mut self, spot: &Spot, neighbours: &mut [Neighbour], ways: &mut Ways) {
        let mut reach = Reach {
            states: 0,
            most: 0.0,
            limit: self.reach_limit(),
            few: self.by_state.len() <= 64,
        };
        self.fetch(neighbours);
        for i in 0..neighbours.len() {
            let rest = &mut neighbours[i..];
            if i < PICKS {
                // The cheapest of those that have something to give comes next.
                let useful = |n: &&(usize, &Neighbour)| reach.wants(n.1);
                let next = rest.iter().enumerate();
                let next = next.filter(|n| useful(&n)).min_by(|a, b| order(a.1, b.1));
                let Some(j) = next.map(|(j, _)| j) else { break };
                rest.swap(0, j);
            } else if i == PICKS {
                rest.sort_unstable_by(order);
            }
            let neighbour = &mut neighbours[i];
            if reach.wants(neighbour) {
                self.enter(spot, neighbour, ways, &mut reach);
            }
        }
        ways.sort();
    }

    /// What a way to the place that is being added must stay below.
    fn reach_limit(&self) -> f64 {
        self.limit - self.outlook.least()
    }

    /// Reads what [`Self::enter`] will ask of sites with several nodes: one kind of memory after the other, and nothing but reads, so that
    /// the processor waits for all sites at once. In a tree that no cache holds it would else wait three times for each.
    fn fetch(&self, neighbours: &[Neighbour]) {
        if self.swept || self.nodes.len() < CACHED {
            return;
        }
        let several = || {
            let wanted = neighbours.iter();
            wanted.filter(|n| n.only == NONE && n.bound < self.reach_limit())
        };
        let mut sum = 0;
        for n in several() {
            sum ^= self.sites[n.site.0 as usize].len;
        }
        for n in several() {
            sum ^= self.at_site(n.site).first().map_or(0, |(_, node)| node.0);
        }
        for n in several() {
            let ends = [self.at_site(n.site).first(), self.at_site(n.site).last()];
            let nodes = ends.into_iter().flatten();
            sum ^= nodes.fold(0, |sum, (_, node)| sum ^ self.nodes[node.index()].state.0);
        }
        std::hint::black_box(sum);
    }

    /// The states of `spot` that the nodes of one neighbour lead to.
    fn enter(
        &mut self,
        spot: &Spot,
        neighbour: &mut Neighbour,
        ways: &mut Ways,
        reach: &mut Reach,
    ) {
        if neighbour.only != NONE {
            // Most sites have one node alone; what counts of it is known without reading it.
            let way = (NodeId(neighbour.only), neighbour.row, neighbour.bound);
            self.enter_from(way, spot, neighbour, ways, reach);
            return;
        }
        let letter = self.site_spot(neighbour.site).letter;
        for i in 0..self.at_site(neighbour.site).len() {
            let (state, node) = self.at_site(neighbour.site)[i];
            let cost = self.cost(node) + neighbour.distance;
            let row = self.steps.row(letter, state);
            let mut targets = self.steps.range_of(row).map(|k| self.steps.target(k));
            // Most of many nodes have nothing to give.
            if cost < reach.limit
                && targets.any(|target| cost < ways.cost(target))
                && !self.enter_from((node, row, cost), spot, neighbour, ways, reach)
            {
                return;
            }
        }
    }

    /// The states of `spot` that one node leads to, whose row and cost there are known. False if no move is possible.
    #[inline]
    fn enter_from(
        &mut self,
        (node, row, cost): (NodeId, u32, f64),
        spot: &Spot,
        neighbour: &mut Neighbour,
        ways: &mut Ways,
        reach: &mut Reach,
    ) -> bool {
        for k in self.steps.range_of(row) {
            let target = self.steps.target(k);
            if ways.cost(target) <= cost
                || self.steps.is_end(spot.letter, target)
                || cost + self.outlook.left(target) >= self.limit
            {
                continue;
            }
            let visible = neighbour.visible.unwrap_or_else(|| {
                // The index has just been read there, the site not.
                let from = Spot {
                    at: neighbour.at,
                    letter: self.steps.letter(row),
                };
                self.look(neighbour, &from, spot)
            });
            if !visible {
                return false;
            }
            ways.set(target, cost, node, neighbour.distance);
            reach.states |= bit(target);
            reach.most = f64::max(reach.most, cost);
        }
        true
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
        let least = self.index.rank(site).least;
        for neighbour in neighbours {
            let way = least + neighbour.distance;
            if neighbour.visible == Some(false) || !improves(way, neighbour.most) {
                continue;
            }
            self.reroute(&spot, neighbour, ways);
        }
    }

    /// Reroutes the nodes of one neighbour.
    fn reroute(&mut self, spot: &Spot, neighbour: &mut Neighbour, ways: &Ways) {
        let mut improved = false;
        for i in 0..self.count_at(neighbour) {
            let (state, old) = self.nth_at(neighbour, i);
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
            if !self.is_visible(neighbour, spot) {
                break;
            }
            self.reparent(old, from, cost);
            improved = true;
        }
        if neighbour.only != NONE && self.steps.stays(neighbour.row) {
            return; // no other node hangs on it here, and what is known of it is right
        }
        if improved {
            self.settle(neighbour.site);
        }
        if neighbour.only != NONE {
            return;
        }
        let costs = self.at_site(neighbour.site).iter();
        let most = costs.map(|&(_, n)| self.cost(n)).fold(0.0, f64::max);
        self.index.rank_mut(neighbour.site).set_most(most);
    }

    /// How many nodes there are at a neighbour.
    #[inline]
    fn count_at(&self, neighbour: &Neighbour) -> usize {
        match neighbour.only {
            NONE => self.at_site(neighbour.site).len(),
            _ => 1,
        }
    }

    /// One of them; of a site with one node, found without reading the site's list.
    #[inline]
    fn nth_at(&self, neighbour: &Neighbour, i: usize) -> (StateId, NodeId) {
        match neighbour.only {
            NONE => self.at_site(neighbour.site)[i],
            only => (self.nodes[only as usize].state, NodeId(only)),
        }
    }

    pub(super) fn is_visible(&mut self, neighbour: &mut Neighbour, spot: &Spot) -> bool {
        neighbour.visible.unwrap_or_else(|| {
            let from = Spot {
                at: neighbour.at,
                letter: self.steps.letter(neighbour.row),
            };
            self.look(neighbour, &from, spot)
        })
    }

    /// Asks whether a move is possible, and keeps the answer.
    fn look(&mut self, neighbour: &mut Neighbour, from: &Spot, spot: &Spot) -> bool {
        let began = self.clock.start();
        let visible = self.system.step(from, spot);
        self.clock.stop(began, |s| &mut s.collision);
        neighbour.visible = Some(visible);
        visible
    }
}

/// The states of a place that ways were found into so far.
struct Reach {
    /// Each as bit number `state mod 64`.
    states: u64,
    /// No way costs more.
    most: f64,
    /// Nothing that costs so much is wanted.
    limit: f64,
    /// Whether each state has a bit of its own.
    few: bool,
}

impl Reach {
    /// Whether a neighbour can lead to a new state or be a cheaper way: one that leads only to states
    /// that are reached more cheaply has nothing to give, now or later.
    fn wants(&self, neighbour: &Neighbour) -> bool {
        if neighbour.bound >= self.limit {
            return false;
        }
        let cheaper = neighbour.bound < self.most;
        cheaper || !self.few || neighbour.targets & !self.states != 0
    }
}

/// The cheapest way in first.
fn order(a: &Neighbour, b: &Neighbour) -> std::cmp::Ordering {
    a.bound.total_cmp(&b.bound).then(a.site.cmp(&b.site))
}
