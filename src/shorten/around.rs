//! Another way around obstacles between two visits.

use nalgebra::Point2;

use super::chain::{Chain, length};
use super::enter::Walk;
use super::{SWEEPS, Shortener};
use crate::plan::{Cost, Path};

/// The points between two stops, by the numbers of the stops; that of the point where the suffix closes is the
/// number of points.
type Leg = (usize, usize);

impl Shortener<'_> {
    /// Makes a plan of shorter ways around obstacles, where there are any: strings that are pulled taut stay on the side of each
    /// obstacle that they were found on. The letters met on the new ways may be others; the automaton must have a run
    /// along them.
    pub(crate) fn go_around(&self, path: &Path, walk: Walk<'_>) -> Option<(Path, Cost)> {
        let chain = self.stops_and_bends(path);
        let shorter = |leg: Leg| Some((leg, self.shorter_way(&chain, leg, walk)?));
        let found: Vec<(Leg, Vec<Point2<f64>>)> =
            self.legs(&chain).into_iter().filter_map(shorter).collect();
        let finish = |found: &[(Leg, Vec<Point2<f64>>)]| {
            let mut new = chain.clone();
            for (leg, bends) in found.iter().rev() {
                replace(&mut new, *leg, bends);
            }
            self.realise(&new)?;
            self.improve(&mut new, SWEEPS);
            self.realise(&new)
                .filter(|(path, _)| self.is_firm_path(path))
        };
        match found.len() {
            0 => None,
            1 => finish(&found),
            // One that the automaton does not allow must not stand in the way of the others.
            _ => finish(&found).or_else(|| found.chunks(1).find_map(finish)),
        }
    }

    /// The stretches of a plan that bend at corners of obstacles alone.
    fn legs(&self, chain: &Chain) -> Vec<Leg> {
        let count = chain.points.len();
        let end = if chain.stays { count - 1 } else { count };
        let is_stop = |i: &usize| {
            let place = chain.points.get(*i);
            let bends = place.is_some_and(|p| self.corners.contains(p));
            [0, chain.split, end].contains(i) || !bends
        };
        let stops: Vec<usize> = (0..=end).filter(is_stop).collect();
        let legs = stops.windows(2).map(|w| (w[0], w[1]));
        legs.filter(|(from, to)| to - from > 1).collect()
    }

    /// The bends of the shortest way along a leg, if it is shorter than the leg.
    fn shorter_way(
        &self,
        chain: &Chain,
        (from, to): Leg,
        walk: Walk<'_>,
    ) -> Option<Vec<Point2<f64>>> {
        let end = chain.points.get(to).unwrap_or(&chain.points[chain.split]);
        let mut old = chain.points[from..to].to_vec();
        old.push(*end);
        let mut way = vec![old[0]];
        way.extend(walk(old[0], *end));
        let better = way.len() > 1 && length(&way) < length(&old) - self.min_gain;
        better.then(|| way[1..way.len() - 1].to_vec())
    }
}

/// Puts other bends between two stops.
fn replace(chain: &mut Chain, (from, to): Leg, bends: &[Point2<f64>]) {
    chain.points.splice(from + 1..to, bends.iter().copied());
    if to <= chain.split {
        chain.split = chain.split + bends.len() + 1 - (to - from);
    }
}
