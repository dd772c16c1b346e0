//! Visits that only touch a region: two waypoints, one on either side of its border, that move along it together.
//!
//! A robot that has to enter a region, or to leave it, and may stop there needs one step across the border. Neither of
//! its two waypoints could slide alone: the other one, next to it, holds it.

use nalgebra::Point2;
use smallvec::SmallVec;

use super::Shortener;
use super::chain::{Chain, PARTS};
use super::pull::least;

/// Waypoints that are no further apart than so many insets are a pair.
const APART: f64 = 8.0;

/// A waypoint of the pair, the point at the other end of one of its legs, and the leg's share of the cost.
type Pull = (usize, Point2<f64>, f64);

impl Shortener<'_> {
    /// Moves point `i` and the one after it along a border between them to where the legs to others are shortest.
    pub(super) fn shift(&self, chain: &mut Chain, i: usize) -> bool {
        let Some(&[first, second]) = chain.points.get(i..i + 2).and_then(|p| p.first_chunk())
        else {
            return false;
        };
        let between = second - first;
        if between.norm() > APART * self.inset {
            return false;
        }
        let pair = [first, second];
        let pulls: SmallVec<[Pull; 4]> = (0..2)
            .flat_map(|k| {
                let others = self.neighbours(chain, i + k).into_iter();
                let others = others.filter(move |(at, _)| *at != pair[1 - k]);
                others.map(move |(at, weight)| (k, at, weight))
            })
            .collect();
        let ends = |p: Point2<f64>| [p, p + between];
        let cost = |p: Point2<f64>| -> f64 {
            let ends = ends(p);
            pulls
                .iter()
                .map(|&(k, at, w)| w * (ends[k] - at).norm())
                .sum()
        };
        let now = cost(first);
        let mut places: Vec<(f64, Point2<f64>)> = self
            .borders_at(pair)
            .map(|reach| least(reach[0], reach[1], &cost))
            .filter(|&(length, _)| length < now - self.min_gain)
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        let words = |p: Point2<f64>| {
            let ends = ends(p);
            let legs = pulls.iter().map(|&(k, at, _)| [at, ends[k]]);
            let legs = legs.chain([ends]).map(|leg| self.word(&leg));
            legs.collect::<Option<SmallVec<[_; 4]>>>()
        };
        for (part, (_, place)) in PARTS
            .iter()
            .flat_map(|p| places.iter().map(move |q| (p, q)))
        {
            let p = first + (place - first) * *part;
            if cost(p) < now - self.min_gain && words(p).is_some_and(|w| Some(w) == words(first)) {
                chain.points[i..i + 2].copy_from_slice(&ends(p));
                return true;
            }
        }
        false
    }

    /// For each border that runs between two waypoints: how far the first one may go along it either way.
    fn borders_at(
        &self,
        [first, second]: [Point2<f64>; 2],
    ) -> impl Iterator<Item = [Point2<f64>; 2]> {
        let edges = self.regions.iter().flat_map(|region| region.edges());
        edges.filter_map(move |(a, b)| {
            let length = (b - a).norm();
            let along = (b - a) / length;
            let off = |p: Point2<f64>| along.perp(&(p - a));
            let [s, t] = [first, second].map(|p| along.dot(&(p - a)));
            // Both stay beside the edge, no nearer to its ends than they are.
            let margin = 1.5 * self.inset;
            let (low, high) = (
                (margin - s.min(t)).min(0.0),
                (length - margin - s.max(t)).max(0.0),
            );
            let is_beside = |s: f64| (0.0..=length).contains(&s);
            let crossed = off(first) * off(second) < 0.0 && is_beside(s) && is_beside(t);
            crossed.then(|| [first + along * low, first + along * high])
        })
    }
}
