//! Visits that only touch a region: waypoints on either side of its border that move along it together.
//!
//! A robot that has to enter a region, or to leave it, and may stop there needs one step across the border; one that has to
//! enter and leave, or to leave and come back, needs two. None of the waypoints could slide alone: those next to it hold it.

use nalgebra::Point2;
use smallvec::SmallVec;

use super::Shortener;
use super::chain::{Chain, PARTS};
use super::pull::least;

/// Waypoints in a row that are no further apart than so many insets are a group.
const APART: f64 = 8.0;

/// So many waypoints at most move together: two steps across a border.
const GROUP: usize = 3;

/// A waypoint of the group, the point at the other end of one of its legs, and the leg's share of the cost.
type Pull = (usize, Point2<f64>, f64);

impl Shortener<'_> {
    /// Moves point `i` and those next to it along a border between them to where the legs to others are shortest.
    pub(super) fn shift(&self, chain: &mut Chain, i: usize) -> bool {
        let legs = chain.points[i..].windows(2).take(GROUP - 1);
        let near = legs.take_while(|w| (w[1] - w[0]).norm() <= APART * self.inset);
        let near = near.count();
        (1..=near)
            .rev()
            .any(|legs| self.shift_group(chain, i, legs + 1))
    }

    /// Moves so many points from `i` on.
    fn shift_group(&self, chain: &mut Chain, i: usize, count: usize) -> bool {
        let group: SmallVec<[Point2<f64>; GROUP]> = chain.points[i..i + count].into();
        let pulls: SmallVec<[Pull; 4]> = (0..count)
            .flat_map(|k| {
                let others = self.neighbours(chain, i + k).into_iter();
                let others = others.filter(|(at, _)| !group.contains(at));
                others.map(move |(at, weight)| (k, at, weight))
            })
            .collect();
        let first = group[0];
        let moved = |p: Point2<f64>| -> SmallVec<[Point2<f64>; GROUP]> {
            group.iter().map(|at| p + (at - first)).collect()
        };
        let cost = |p: Point2<f64>| -> f64 {
            let legs = pulls.iter();
            legs.map(|&(k, at, w)| w * (p + (group[k] - first) - at).norm())
                .sum()
        };
        let now = cost(first);
        let mut places: Vec<(f64, Point2<f64>)> = self
            .borders_at(&group)
            .map(|reach| least(reach[0], reach[1], &cost))
            .filter(|&(length, _)| length < now - self.min_gain)
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let words = |p: Point2<f64>| {
            let group = moved(p);
            let legs = pulls.iter().map(|&(k, at, _)| [at, group[k]]);
            let between = group.windows(2).map(|w| [w[0], w[1]]);
            let words = legs.chain(between).map(|leg| self.word(&leg));
            words.collect::<Option<SmallVec<[_; 4]>>>()
        };
        for (part, (_, place)) in PARTS
            .iter()
            .flat_map(|p| places.iter().map(move |q| (p, q)))
        {
            let p = first + (place - first) * *part;
            if cost(p) < now - self.min_gain && words(p).is_some_and(|w| Some(w) == words(first)) {
                chain.points[i..i + count].copy_from_slice(&moved(p));
                return true;
            }
        }
        false
    }

    /// For each border that runs between two waypoints of a group: how far the first one may go along it either way.
    fn borders_at(&self, group: &[Point2<f64>]) -> impl Iterator<Item = [Point2<f64>; 2]> {
        let edges = self.regions.iter().flat_map(|region| region.edges());
        edges.filter_map(move |(a, b)| {
            let length = (b - a).norm();
            let along = (b - a) / length;
            let off = |p: Point2<f64>| along.perp(&(p - a));
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for p in group {
                let s = along.dot(&(p - a));
                (low, high) = (low.min(s), high.max(s));
            }
            let crossed = group.windows(2).any(|w| off(w[0]) * off(w[1]) < 0.0);
            if !crossed || low < 0.0 || high > length {
                return None;
            }
            // All stay beside the edge, no nearer to its ends than they are.
            let margin = 1.5 * self.inset;
            let back = (margin - low).min(0.0);
            let on = (length - margin - high).max(0.0);
            Some([group[0] + along * back, group[0] + along * on])
        })
    }
}
