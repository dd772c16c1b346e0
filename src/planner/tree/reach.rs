//! Ways into product states that a tree need not hold.

use super::{Near, NodeId, Tree};
use crate::automaton::StateId;
use crate::system::Spot;

impl Tree<'_> {
    /// The cheapest way into a product state that is shorter than `limit`: the node itself if the tree
    /// holds it, or one at a site `near` it from which one move leads there; and the length of the way.
    pub(crate) fn way_into(
        &mut self,
        spot: Spot,
        state: StateId,
        near: Near,
        limit: f64,
    ) -> Option<(NodeId, f64)> {
        let mut neighbours = std::mem::take(&mut self.neighbours);
        let mut moves = std::mem::take(&mut self.moves);
        if self.system.neighbours(&spot, &mut moves) {
            self.take_neighbours(spot, &moves, &mut neighbours);
        } else {
            let near = Near {
                count: near.more,
                ..near
            };
            self.find_neighbours(spot, near, &[], &mut neighbours);
        }
        neighbours.retain(|n| n.bound < limit && n.leads_to(state));
        neighbours.sort_unstable_by(|a, b| a.bound.total_cmp(&b.bound).then(a.site.cmp(&b.site)));
        let held = self.find(spot.at, state).map(|n| (n, self.cost(n)));
        let mut best = held.filter(|&(_, length)| length < limit);
        for neighbour in &mut neighbours {
            if neighbour.bound >= best.map_or(limit, |(_, length)| length) {
                break;
            }
            let letter = self.site_spot(neighbour.site).letter;
            for i in 0..self.at_site(neighbour.site).len() {
                let (from, node) = self.at_site(neighbour.site)[i];
                let length = self.cost(node) + neighbour.distance;
                let leads = |k: usize| self.steps.target(k) == state;
                if length < best.map_or(limit, |(_, length)| length)
                    && self.steps.range(letter, from).any(leads)
                {
                    if !self.is_visible(neighbour, &spot) {
                        break;
                    }
                    best = Some((node, length));
                }
            }
        }
        (self.neighbours, self.moves) = (neighbours, moves);
        best
    }
}
