//! The path as a chain of points, and its local refinement.

use nalgebra::{Point2, Vector2};
use smallvec::{SmallVec, smallvec};

use super::pull::{Line, least, mirror, star_point, taut};
use super::{Shortener, inward_normal, word_of};
use crate::plan::Path;
use crate::workspace::Side;

/// Weights of prefix and suffix below this count as this much in refinement, so that a part of no
/// weight is tidy too.
pub(super) const MIN_WEIGHT: f64 = 1e-3;

/// How much of the way to the best place is tried where the whole of it is blocked.
pub(super) const PARTS: [f64; 4] = [1.0, 0.5, 0.25, 0.0625];

/// How many places are tried for a waypoint, best first.
const TRIES: usize = 6;

/// How far beyond a region's box its borders are still at hand, as a share of the map's longer side.
const REACH: f64 = 0.02;

/// How often another place to enter the suffix is looked for.
const ENTRIES: usize = 4;

/// A prefix-suffix path by its points alone.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    /// The prefix, then the suffix without its ends.
    pub(crate) points: Vec<Point2<f64>>,
    /// The index of the prefix's last point.
    pub(crate) split: usize,
    /// Whether the robot stays there.
    pub(crate) stays: bool,
}

/// A path's classes of letters in a row, neighbours different.
pub(super) type Word = SmallVec<[u16; 16]>;

/// The point at the other end of a leg, with the leg's share of the cost.
type Neighbour = (Point2<f64>, f64);
pub(super) type Neighbours = SmallVec<[Neighbour; 3]>;

/// The legs to a point, from its neighbours.
type Legs = SmallVec<[Line; 3]>;
/// Where a point might go, with its length there.
type Places = SmallVec<[(f64, Point2<f64>); 16]>;

impl Chain {
    /// The points of a plan, without waits.
    pub(super) fn of_path(path: &Path) -> Self {
        let mut points: Vec<Point2<f64>> = path.prefix.iter().map(|w| w.at).collect();
        points.dedup();
        let split = points.len() - 1;
        let turn = points[split];
        let mut round: Vec<Point2<f64>> = path.suffix.iter().map(|w| w.at).collect();
        round.dedup();
        while round.last() == Some(&turn) {
            round.pop();
        }
        points.extend(round.into_iter().skip_while(|p| *p == turn));
        let stays = points.len() == split + 1;
        Self {
            points,
            split,
            stays,
        }
    }

    /// Whether a point is neither the start nor where the suffix begins.
    fn is_inner(&self, i: usize) -> bool {
        i > 0 && i != self.split
    }
}

impl Shortener<'_> {
    /// Tightens the chain until nothing improves, in at most `sweeps` passes for each place where the suffix
    /// is entered.
    pub(crate) fn improve(&self, chain: &mut Chain, sweeps: usize) {
        self.refine(chain, sweeps);
        for _ in 0..ENTRIES {
            if sweeps == 0 || !self.enter(chain) {
                break;
            }
            self.refine(chain, sweeps);
        }
    }

    /// Tightens the chain until nothing improves, in at most `sweeps` passes, without another order of its
    /// points.
    fn refine(&self, chain: &mut Chain, sweeps: usize) {
        if chain.split == 0 && !chain.stays {
            // The suffix need not pass the start: it may be entered beside it.
            chain.points.insert(1, chain.points[0]);
            chain.split = 1;
        }
        self.sweep(chain, sweeps);
        if chain.split == 1 && chain.points[1] == chain.points[0] {
            chain.points.remove(1);
            chain.split = 0;
        }
    }

    fn sweep(&self, chain: &mut Chain, sweeps: usize) {
        if sweeps == 0 {
            return;
        }
        // Far off these would draw the visits before them to the wrong sides of their regions.
        for i in (1..chain.points.len()).rev() {
            if self.is_way_out(chain.points[i], &self.neighbours(chain, i)) {
                self.slide(chain, i);
            }
        }
        let mut still = self.still.borrow_mut();
        still.clear();
        for _ in 0..sweeps {
            let mut moved = false;
            let mut i = 1;
            while i < chain.points.len() {
                moved |= self.shift(chain, i);
                let here = (chain.points[i], self.neighbours(chain, i));
                if still.contains(&here) {
                    i += 1;
                    continue;
                }
                match self.pull(chain, i) {
                    Some(0) => {
                        moved = true;
                        continue;
                    }
                    Some(points) => {
                        moved = true;
                        i += points;
                        continue;
                    }
                    None => {}
                }
                let before = chain.points.len();
                if self.slide(chain, i) {
                    moved = true;
                } else {
                    still.push(here);
                }
                i += 1 + chain.points.len() - before;
            }
            if !moved {
                break;
            }
        }
    }

    /// The points of a plan without those between two visits where it goes straight on. In a region they stay: what is visited
    /// on the way is to be visited on another way, too.
    pub(super) fn stops_and_bends(&self, path: &Path) -> Chain {
        let mut chain = Chain::of_path(path);
        for i in (1..chain.points.len().saturating_sub(1)).rev() {
            let [before, at, after] = [i - 1, i, i + 1].map(|i| chain.points[i]);
            let detour = (at - before).norm() + (after - at).norm() - (after - before).norm();
            let is_straight = i != chain.split && detour < 1e-3 * self.min_gain;
            if is_straight
                && !self.is_in_region(at)
                && self.word(&[before, at, after]) == self.word(&[before, after])
            {
                chain.points.remove(i);
                chain.split -= usize::from(i < chain.split);
            }
        }
        chain
    }

    /// The points before and after `i`, with the weights of the segments to them. The prefix's last
    /// point has three neighbours where the suffix moves.
    pub(super) fn neighbours(&self, chain: &Chain, i: usize) -> Neighbours {
        let prefix = self.weight.max(MIN_WEIGHT);
        let suffix = (1.0 - self.weight).max(MIN_WEIGHT);
        let points = &chain.points;
        let (split, last) = (chain.split, points.len() - 1);
        let mut found = Neighbours::new();
        if i > 0 {
            let weight = if i <= split { prefix } else { suffix };
            found.push((points[i - 1], weight));
        }
        if i < last {
            let weight = if i < split { prefix } else { suffix };
            found.push((points[i + 1], weight));
        } else if i > split {
            found.push((points[split], suffix));
        }
        if i == split && !chain.stays && last > split {
            found.push((points[last], suffix));
        }
        found
    }

    /// Replaces point `i` by the taut string past it where that carries the same word: around
    /// obstacles, or else around regions, too. Returns how many points took its place.
    fn pull(&self, chain: &mut Chain, i: usize) -> Option<usize> {
        let only_one = i > chain.split && chain.points.len() == chain.split + 2;
        if !chain.is_inner(i) || only_one {
            return None;
        }
        let [(before, _), (after, _)] = self.neighbours(chain, i)[..] else {
            return None;
        };
        let at = chain.points[i];
        let now = (at - before).norm() + (after - at).norm();
        let mut known = None;
        for corners in [&self.corners, &self.all_corners] {
            let mut string: Line = smallvec![before];
            string.extend(taut(before, at, after, corners));
            string.push(after);
            let inner = string.len() - 2;
            if string[1..=inner] == [at] {
                return None;
            }
            let gain = now - length(&string);
            let good = gain > self.min_gain || inner == 0 && gain > -1e-3 * self.min_gain;
            if !good {
                continue;
            }
            // Letters are looked at only where there is something to gain.
            if known.is_none() {
                known = Some(self.word(&[before, at, after])?);
            }
            if self.word(&string) == known {
                chain
                    .points
                    .splice(i..=i, string[1..=inner].iter().copied());
                if i < chain.split {
                    chain.split = chain.split + inner - 1;
                }
                return Some(inner);
            }
        }
        None
    }

    /// Moves point `i` to where the weighted length is least, as far as the word allows; legs to the
    /// new place are pulled taut around what is in their way.
    fn slide(&self, chain: &mut Chain, i: usize) -> bool {
        let neighbours = self.neighbours(chain, i);
        let at = chain.points[i];
        let star =
            |p: Point2<f64>| -> f64 { neighbours.iter().map(|&(n, w)| (p - n).norm() * w).sum() };
        let now = star(at);
        let best = |a: Point2<f64>, b: Point2<f64>| match neighbours[..] {
            [(from, v), (to, w)] if v == w => match mirror(a, b, from, to) {
                Some(p) => (star(p), p),
                None => least(a, b, &star),
            },
            _ => least(a, b, &star),
        };
        let mut places = self.places(at, &best);
        if self.is_way_out(at, &neighbours) {
            // It is best beside the border that was crossed, however far it went.
            for &(from, _) in &neighbours {
                places.extend(self.places(from, &best));
            }
        }
        if let [(a, v), (b, w), (c, x)] = neighbours[..] {
            // Where the suffix is entered nothing may hold the point but its three legs.
            let free = star_point([a, b, c], [v, w, x]);
            places.push((star(free), free));
        }
        places.retain(|&mut (l, _)| l < now - self.min_gain);
        if places.is_empty() {
            return false;
        }
        let straight: Legs = neighbours.iter().map(|&(n, _)| smallvec![n, at]).collect();
        let Some(words) = self.star_words(&straight) else {
            return false;
        };
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        for part in PARTS {
            for &(_, place) in places.iter().take(TRIES) {
                let p = at + (place - at) * part;
                if star(p) >= now - self.min_gain || !self.is_firm(p) {
                    continue;
                }
                let legs: Legs = neighbours
                    .iter()
                    .map(|&(n, _)| self.leg(n, at, p))
                    .collect();
                let bent = legs.iter().any(|l| l.len() > 2);
                if bent && !self.map.is_free_segment(at, p) {
                    continue;
                }
                let cost: f64 = legs
                    .iter()
                    .zip(&neighbours)
                    .map(|(l, &(_, w))| length(l) * w)
                    .sum();
                if cost < now - self.min_gain && self.star_words(&legs).as_ref() == Some(&words) {
                    place_legs(chain, i, p, &legs);
                    return true;
                }
            }
        }
        false
    }

    /// Whether a point is outside regions because one has to be left: where the robot stays, or comes back from to where it was.
    fn is_way_out(&self, at: Point2<f64>, neighbours: &[Neighbour]) -> bool {
        let class = |p| self.map.letter_at(p).map(|l| self.classes[l.index()]);
        match *neighbours {
            [(from, _)] => !self.is_in_region(at) && self.is_in_region(from),
            [(from, _), (to, _)] => {
                let is_left = !self.is_in_region(at) && self.is_in_region(from);
                is_left && class(from) == class(to)
            }
            _ => false,
        }
    }

    /// Whether a point is in a region that the task speaks of.
    fn is_in_region(&self, p: Point2<f64>) -> bool {
        let mut regions = self.regions.iter();
        regions.any(|r| r.side_of(p, 0.0) != Side::Outside)
    }

    /// From a neighbour to the new place of a point, which is free: straight if the way is, else taut.
    fn leg(&self, from: Point2<f64>, at: Point2<f64>, to: Point2<f64>) -> Line {
        let mut leg: Line = smallvec![from];
        if !self.map.is_free_between(from, to) {
            leg.extend(taut(from, at, to, &self.corners));
        }
        leg.push(to);
        leg
    }

    /// The classes of letters along a polyline, neighbours different.
    pub(super) fn word(&self, points: &[Point2<f64>]) -> Option<Word> {
        let mut word = Word::new();
        let mut known = self.words.borrow_mut();
        for ends in points.windows(2) {
            let ends = [ends[0], ends[1]];
            let letters = known.of(ends, || {
                let letters = word_of(self.map, ends[0], ends[1])?;
                Some(
                    letters
                        .into_iter()
                        .map(|l| self.classes[l.index()])
                        .collect(),
                )
            });
            word.extend_from_slice(letters?);
        }
        word.dedup();
        Some(word)
    }

    /// What must stay the same when a point moves: for an inner point the word past it, for
    /// others the word on each of its legs. Legs lead from the neighbours to the point.
    fn star_words(&self, legs: &[Line]) -> Option<SmallVec<[Word; 3]>> {
        if let [before, after] = legs {
            let through: Line = before
                .iter()
                .chain(after.iter().rev().skip(1))
                .copied()
                .collect();
            return Some(smallvec![self.word(&through)?]);
        }
        legs.iter().map(|leg| self.word(leg)).collect()
    }

    /// Whether no region's border runs much closer to `p` than the inset: on the way to a place on
    /// the other side of a border a waypoint must not creep up to it.
    pub(super) fn is_firm(&self, p: Point2<f64>) -> bool {
        let letter = self.map.letter_at(p);
        let reach = 0.9 * self.inset;
        let around = [(reach, 0.0), (-reach, 0.0), (0.0, reach), (0.0, -reach)];
        letter.is_some()
            && around.into_iter().all(|(x, y)| {
                let near = self.map.letter_at(p + Vector2::new(x, y));
                near.is_none() || near == letter
            })
    }

    /// For every border near `at`, the best place beside it, with its length, by a function that finds it on a segment.
    fn places(
        &self,
        at: Point2<f64>,
        best: &impl Fn(Point2<f64>, Point2<f64>) -> (f64, Point2<f64>),
    ) -> Places {
        let reach = Vector2::repeat(REACH * self.map.bounds().side());
        let mut places = Places::new();
        for polygon in &self.regions {
            let (min, max) = (polygon.min() - reach, polygon.max() + reach);
            if at.x < min.x || at.y < min.y || at.x > max.x || at.y > max.y {
                continue;
            }
            for (a, b) in polygon.edges() {
                let along = (b - a).normalize() * self.inset;
                let inward = inward_normal(a, b) * self.inset;
                if (b - a).norm() > 4.0 * self.inset {
                    let along = along * 1.5;
                    places.push(best(a + along + inward, b - along + inward));
                }
                places.push(best(a - inward, b - inward));
            }
        }
        places
    }
}

/// Puts point `i` at `p`, with the inner points of the legs from its neighbours.
fn place_legs(chain: &mut Chain, i: usize, p: Point2<f64>, legs: &[Line]) {
    let inner = |leg: &Line| Line::from_slice(&leg[1..leg.len() - 1]);
    // The leg from the last point back to the split ends the chain.
    if let Some(closing) = legs.get(2) {
        chain.points.extend(inner(closing));
    }
    let mut new = inner(&legs[0]);
    let ahead = new.len();
    new.push(p);
    if let Some(after) = legs.get(1) {
        new.extend(inner(after).into_iter().rev());
    }
    let more = new.len() - 1;
    chain.points.splice(i..=i, new);
    if i < chain.split {
        chain.split += more;
    } else if i == chain.split {
        chain.split += ahead;
    }
}

pub(super) fn length(points: &[Point2<f64>]) -> f64 {
    let legs = points.windows(2).map(|w| (w[1] - w[0]).norm());
    legs.fold(0.0, |sum, leg| sum + leg)
}
