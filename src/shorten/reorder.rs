//! Another order of visits.

use std::ops::RangeInclusive;

use nalgebra::Point2;
use rustc_hash::{FxHashMap, FxHashSet};

use super::chain::{Chain, length};
use super::enter::Walk;
use super::{SWEEPS, Shortener};
use crate::plan::{self, Cost, Path};

/// Parts of plans with more visits are left as they are: the number of orders that are looked at grows with its square.
const MAX_STOPS: usize = 12;

/// So many visits in a row are moved together at most.
const TOGETHER: usize = 3;

/// How many orders that the automaton has a run along are made taut, the shortest first.
const TRIES: usize = 5;

/// How many orders the automaton is asked about. Of a plan that ends where it has to stay, most of the shortest orders end
/// elsewhere.
const ASKED: usize = 48;

/// Of so many stops every order is looked at: 720 of seven, of which the first is where it is. Of fewer the neighbours are most of them.
const ALL_ORDERS: RangeInclusive<usize> = 6..=7;

/// Stops, and the shortest ways between them as far as they were asked for.
struct Stops<'w> {
    at: Vec<Point2<f64>>,
    walk: Walk<'w>,
    /// By two stops the way from one to the other: its points but the first, and its length.
    ways: FxHashMap<[usize; 2], (Vec<Point2<f64>>, f64)>,
}

impl Stops<'_> {
    fn straight(&self, order: &[usize]) -> f64 {
        let legs = order.windows(2);
        legs.map(|w| (self.at[w[1]] - self.at[w[0]]).norm()).sum()
    }

    /// The shortest way from stop to stop: its points but the first, none where there is no way, and its length.
    fn way(&mut self, from: usize, to: usize) -> &(Vec<Point2<f64>>, f64) {
        let (at, walk) = (&self.at, self.walk);
        self.ways.entry([from, to]).or_insert_with(|| {
            let way = walk(at[from], at[to]);
            let first = way.first().map_or(0.0, |p| (p - at[from]).norm());
            let whole = first + length(&way);
            (way, whole)
        })
    }

    /// The length of the shortest ways from stop to stop; `None` where there is no way.
    fn length(&mut self, order: &[usize]) -> Option<f64> {
        let legs = order.windows(2);
        legs.map(|ends| {
            let (way, length) = self.way(ends[0], ends[1]);
            way.last().map(|_| *length)
        })
        .sum()
    }

    /// The points of the shortest ways from stop to stop.
    fn points(&mut self, order: &[usize]) -> Vec<Point2<f64>> {
        let mut points = vec![self.at[order[0]]];
        for ends in order.windows(2) {
            points.extend_from_slice(&self.way(ends[0], ends[1]).0);
        }
        points
    }

    /// The ways of the shortest orders that are shorter than `limit`, the shortest first. `closed`: the way leads back to
    /// the first stop; else `to_last`: it ends at the last one.
    fn shorter(&mut self, closed: bool, to_last: bool, limit: f64) -> Vec<Vec<Point2<f64>>> {
        let count = self.at.len();
        let mut found = self.shortest(orders(count, to_last), closed, limit);
        if ALL_ORDERS.contains(&count) {
            // A better order may be none of the neighbours; where the task rules most orders out, only these may be allowed.
            let all = self.shortest(permutations(count, to_last), closed, limit);
            found.extend(all);
            found.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
            found.dedup_by(|a, b| a.1 == b.1);
        }
        let points = found.iter().map(|(_, order)| self.points(order));
        points.collect()
    }

    /// The shortest of these orders, with their lengths, that are shorter than `limit`.
    fn shortest(
        &mut self,
        orders: Vec<Vec<usize>>,
        closed: bool,
        limit: f64,
    ) -> Vec<(f64, Vec<usize>)> {
        let mut found: Vec<(f64, Vec<usize>)> = Vec::new();
        for mut order in orders {
            if closed {
                order.push(0);
            }
            if self.straight(&order) < limit
                && let Some(length) = self.length(&order)
                && length < limit
            {
                found.push((length, order));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(ASKED);
        found
    }
}

/// Orders of `count` stops that begin with the first one, in which up to [`TOGETHER`] in a row stand elsewhere, or the other
/// way around, each once (S. Lin, "Computer solutions of the traveling salesman problem", 1965; I. Or's moves of short segments, 1976).
pub(crate) fn orders(count: usize, to_last: bool) -> Vec<Vec<usize>> {
    let end = if to_last {
        count.saturating_sub(1)
    } else {
        count
    };
    let mut all = Vec::new();
    // The same order can be reached in several ways, and the old one, too.
    let mut known = FxHashSet::from_iter([(0..count).collect::<Vec<usize>>()]);
    for from in 1..end {
        for to in from + 1..=end {
            let reversed = (from..to).rev();
            let rest: Vec<usize> = (0..count).filter(|i| !(from..to).contains(i)).collect();
            let mut put = |at: usize, part: &mut dyn Iterator<Item = usize>| {
                let mut order = rest[..at].to_vec();
                order.extend(part);
                order.extend_from_slice(&rest[at..]);
                if known.insert(order.clone()) {
                    all.push(order);
                }
            };
            put(from, &mut reversed.clone());
            if to - from <= TOGETHER {
                let last = if to_last { rest.len() - 1 } else { rest.len() };
                for at in (1..=last).filter(|&at| at != from) {
                    put(at, &mut (from..to));
                    put(at, &mut reversed.clone());
                }
            }
        }
    }
    all
}

/// All orders of `count` stops that begin with the first one, and end with the last one if that is to stay there.
fn permutations(count: usize, to_last: bool) -> Vec<Vec<usize>> {
    let end = if to_last {
        count.saturating_sub(1)
    } else {
        count
    };
    let mut all = vec![vec![0]];
    for _ in 1..end {
        let longer = |order: Vec<usize>| {
            let left = (1..end).filter(|i| !order.contains(i));
            let longer = left.map(|i| [&order[..], &[i]].concat());
            longer.collect::<Vec<_>>()
        };
        all = all.into_iter().flat_map(longer).collect();
    }
    if to_last {
        all.iter_mut().for_each(|order| order.push(count - 1));
    }
    all
}

impl Shortener<'_> {
    /// Makes a cheaper plan that visits in another order, if the automaton has a run along one: of what the suffix visits, or of
    /// what the prefix does. Orders are tried that are longer by `slack` times while their visits are where the plan has them.
    pub(crate) fn reorder(&self, path: &Path, walk: Walk<'_>, slack: f64) -> Option<(Path, Cost)> {
        let chain = self.stops_and_bends(path);
        let known = Cost::new(
            plan::length(&path.prefix),
            plan::length(&path.suffix),
            self.weight,
        );
        let finish = |mut new: Chain| {
            self.improve(&mut new, SWEEPS);
            self.realise(&new)
                .filter(|(path, cost)| cost.total < known.total && self.is_firm_path(path))
        };
        let suffixes = self.other_suffixes(&chain, walk, slack);
        let prefixes = self.other_prefixes(&chain, walk, slack);
        let found = [suffixes, prefixes].map(|chains| {
            let with_a_run = chains.into_iter().filter(|new| self.realise(new).is_some());
            with_a_run.take(TRIES).find_map(finish)
        });
        let found = found.into_iter().flatten();
        found.min_by(|a, b| a.1.total.total_cmp(&b.1.total))
    }

    /// The plan with other suffixes.
    fn other_suffixes(&self, chain: &Chain, walk: Walk<'_>, slack: f64) -> Vec<Chain> {
        if chain.stays {
            return Vec::new();
        }
        let round = self.round(chain);
        let passes = round[0] == chain.points[chain.split];
        let Some(mut stops) = self.stops(&round, false, walk) else {
            return Vec::new();
        };
        let whole = length(&round) + (round[0] - round[round.len() - 1]).norm();
        let limit = whole * slack - self.min_gain;
        let kept = match chain.split {
            0 => 1,
            split => split + usize::from(passes),
        };
        let kept = &chain.points[..kept];
        let first = stops.at[0];
        let begin = |ring: Vec<Point2<f64>>| {
            let mut points = kept.to_vec();
            let here = points[points.len() - 1];
            if here != first {
                points.extend(walk(here, first));
            }
            let split = points.len() - 1;
            points.extend_from_slice(&ring[1..ring.len() - 1]);
            Chain {
                points,
                split,
                stays: false,
            }
        };
        let rings = stops.shorter(true, false, limit);
        rings.into_iter().map(begin).collect()
    }

    /// The plan with other prefixes.
    fn other_prefixes(&self, chain: &Chain, walk: Walk<'_>, slack: f64) -> Vec<Chain> {
        let prefix = &chain.points[..=chain.split];
        let Some(mut stops) = self.stops(prefix, true, walk) else {
            return Vec::new();
        };
        let begin = |mut points: Vec<Point2<f64>>| {
            let split = points.len() - 1;
            points.extend_from_slice(&chain.points[chain.split + 1..]);
            Chain {
                points,
                split,
                stays: chain.stays,
            }
        };
        let limit = length(prefix) * slack - self.min_gain;
        let found = stops.shorter(false, !chain.stays, limit);
        found.into_iter().map(begin).collect()
    }

    /// The points that are no corners of obstacles, the first one, and if it is to be kept the last one; `None` if they have only
    /// one order, or too many.
    fn stops<'w>(
        &self,
        points: &[Point2<f64>],
        keep_last: bool,
        walk: Walk<'w>,
    ) -> Option<Stops<'w>> {
        let last = points.len().checked_sub(1)?;
        let kept = |i: usize| i == 0 || keep_last && i == last;
        let stops = points.iter().enumerate();
        let stops = stops.filter(|(i, p)| kept(*i) || !self.corners.contains(p));
        let at: Vec<Point2<f64>> = stops.map(|(_, p)| *p).collect();
        (3..=MAX_STOPS).contains(&at.len()).then(|| Stops {
            at,
            walk,
            ways: FxHashMap::default(),
        })
    }
}
