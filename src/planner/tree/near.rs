//! Which sites lie near a point.
//!
//! Queries allocate nothing. Which buckets a query concerns is found from the branches alone where that can
//! be; then they are all read, and the processor waits for many of them at a time.

use nalgebra::Point2;

use super::SiteId;
use super::index::{BUCKET, SiteIndex, Slot};

/// The circle in which the nearest sites are looked for first holds this many times their number, by the
/// density of sites around its centre: mostly enough, and far fewer than without.
const SLACK: f64 = 1.4;

/// The density is that of a part of the index with at least so many times the number.
const PART: usize = 2;

/// So many buckets are read together at most.
const TOGETHER: usize = 64;

/// A site in the answer to a query, ordered by distance, then by where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Hit {
    /// The bits of the squared distance: those of numbers that are not negative are ordered as the
    /// numbers are, and compare faster.
    bits: u64,
    /// Where the site stands in the index.
    pub(super) slot: Slot,
}

impl Hit {
    const NONE: Self = Self {
        bits: 0,
        slot: Slot::FIRST,
    };

    pub(super) fn square(self) -> f64 {
        f64::from_bits(self.bits)
    }
}

/// Which sites count as near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Near {
    /// Those within this distance, in map units.
    pub(crate) radius: f64,
    /// Of those the nearest, at most so many.
    pub(crate) count: usize,
    /// As many instead where the first ones lead nowhere.
    pub(crate) more: usize,
}

impl Near {
    /// All sites within `radius`.
    #[cfg(test)]
    pub(crate) fn ball(radius: f64) -> Self {
        Self {
            radius,
            count: usize::MAX,
            more: 0,
        }
    }
}

/// How a point was looked up: the branches on the way down to its leaf.
#[derive(Clone, Debug, Default)]
pub(super) struct Descent {
    /// The point, until an insertion changes what lies below.
    pub(super) to: Option<[f64; 2]>,
    pub(super) steps: Vec<Step>,
    pub(super) leaf: usize,
}

/// A split on the way down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) branch: u32,
    /// The branch on the other side.
    beyond: u32,
    /// How far that side is away along each axis.
    off: [f64; 2],
}

impl SiteIndex {
    /// Puts the sites that are near `p` into `hits`, in no particular order.
    pub(super) fn near(&mut self, p: Point2<f64>, near: Near, hits: &mut Vec<Hit>) {
        hits.clear();
        if near.count == 0 {
            return;
        }
        let (p, whole) = ([p.x, p.y], near.radius * near.radius);
        let mut descent = std::mem::take(&mut self.descent);
        let guess = self.descend(p, near.count, &mut descent);
        // Where all in the circle are wanted, the circle stays as it is.
        let all = near.count >= self.branches[0].len as usize;
        for limit in [guess.min(whole), whole] {
            hits.clear();
            let mut found = Found {
                index: self,
                p,
                hits,
                count: near.count,
                limit,
                waiting: [(0, 0); TOGETHER],
                waits: 0,
                together: if all || limit < whole { TOGETHER } else { 1 },
            };
            self.collect(descent.leaf, [0.0; 2], &mut found);
            for step in descent.steps.iter().rev() {
                if square(step.off) <= found.limit {
                    self.collect(step.beyond as usize, step.off, &mut found);
                }
            }
            found.read();
            found.cut();
            if hits.len() == near.count || limit == whole {
                break;
            }
        }
        self.descent = descent;
    }

    /// Looks `p` up. Returns the squared radius of a circle around it that should hold a few more than `count`
    /// sites: as many as are spread over it at the density of the least part of the index around `p` that holds
    /// more.
    fn descend(&self, p: [f64; 2], count: usize, descent: &mut Descent) -> f64 {
        let few = count.saturating_mul(PART);
        let [mut low, mut high] = self.corners;
        let mut branch = self.branches[0];
        let known = (branch.len as usize) >= few.max(BUCKET).saturating_mul(2);
        let (mut part, mut within) = (branch.len, true);
        descent.to = Some(p);
        descent.steps.clear();
        let mut at = 0;
        while branch.bucket().is_none() {
            let axis = branch.axis();
            let ahead = p[axis] - branch.at();
            let side = usize::from(ahead >= 0.0);
            let mut off = [0.0; 2];
            off[axis] = ahead;
            descent.steps.push(Step {
                branch: at as u32,
                beyond: (branch.next() + 1 - side) as u32,
                off,
            });
            at = branch.next() + side;
            let next = self.branches[at];
            within = within && next.len as usize >= few;
            if within {
                let corner = if side == 0 { &mut high } else { &mut low };
                corner[axis] = branch.at();
                part = next.len;
            }
            branch = next;
        }
        descent.leaf = at;
        if !known {
            return f64::INFINITY;
        }
        let area = (high[0] - low[0]) * (high[1] - low[1]);
        let square = SLACK * count as f64 * area / (std::f64::consts::PI * f64::from(part));
        // Near the border of all sites much of the circle is empty.
        let radius = square.sqrt();
        let share = |axis: usize| {
            let low = (p[axis] - radius).max(self.corners[0][axis]);
            let high = (p[axis] + radius).min(self.corners[1][axis]);
            ((high - low) / (2.0 * radius)).clamp(0.1, 1.0)
        };
        square / (share(0) * share(1))
    }

    /// Visits what lies below branch `i`, whose box is `off` away from the point along each axis.
    fn collect(&self, i: usize, off: [f64; 2], found: &mut Found<'_>) {
        let branch = self.branches[i];
        if let Some(bucket) = branch.bucket() {
            found.visit(bucket as u32, branch.len);
            return;
        }
        let axis = branch.axis();
        let ahead = found.p[axis] - branch.at();
        let side = usize::from(ahead >= 0.0);
        let next = branch.next();
        self.collect(next + side, off, found);
        let mut beyond = off;
        beyond[axis] = ahead;
        if square(beyond) <= found.limit {
            self.collect(next + 1 - side, beyond, found);
        }
    }

    /// The site nearest to `p`.
    pub(super) fn nearest(&self, p: Point2<f64>) -> Option<SiteId> {
        let mut best = (f64::INFINITY, SiteId(u32::MAX));
        self.closest(0, [p.x, p.y], [0.0; 2], &mut best);
        best.0.is_finite().then_some(best.1)
    }

    fn closest(&self, i: usize, p: [f64; 2], off: [f64; 2], best: &mut (f64, SiteId)) {
        let branch = self.branches[i];
        if let Some(bucket) = branch.bucket() {
            let bucket = &self.buckets[bucket];
            let squares = bucket.squares(p).into_iter().take(branch.len as usize);
            for (i, square) in squares.enumerate() {
                if square <= best.0 && (square, bucket.ranks[i].site) < *best {
                    *best = (square, bucket.ranks[i].site);
                }
            }
            return;
        }
        let axis = branch.axis();
        let ahead = p[axis] - branch.at();
        let side = usize::from(ahead >= 0.0);
        let next = branch.next();
        self.closest(next + side, p, off, best);
        let mut beyond = off;
        beyond[axis] = ahead;
        if square(beyond) <= best.0 {
            self.closest(next + 1 - side, p, beyond, best);
        }
    }
}

#[inline]
fn square(off: [f64; 2]) -> f64 {
    off[0] * off[0] + off[1] * off[1]
}

/// The nearest sites so far, and up to as many again that are not yet told from them.
struct Found<'h> {
    index: &'h SiteIndex,
    p: [f64; 2],
    hits: &'h mut Vec<Hit>,
    count: usize,
    /// The squared distance beyond which nothing is wanted any more.
    limit: f64,
    /// Buckets that are still to be read, and how many sites each has.
    waiting: [(u32, u32); TOGETHER],
    waits: usize,
    /// So many are read together: one, where what is found makes the circle smaller.
    together: usize,
}

impl Found<'_> {
    #[inline]
    fn visit(&mut self, bucket: u32, len: u32) {
        self.waiting[self.waits] = (bucket, len);
        self.waits += 1;
        if self.waits == self.together {
            self.read();
        }
    }

    /// Takes the sites of the waiting buckets that are near enough.
    fn read(&mut self) {
        // Nothing but reads, so that the processor waits for all of them at once.
        let waiting = self.waiting[..self.waits].iter();
        let buckets = waiting.map(|w| &self.index.buckets[w.0 as usize]);
        std::hint::black_box(buckets.fold(0, |sum, bucket| sum ^ bucket.touch()));
        for &(bucket, len) in &self.waiting[..self.waits] {
            let squares = self.index.buckets[bucket as usize].squares(self.p);
            // Whether a site is near enough cannot be foreseen: no branch depends on it.
            let mut near = [Hit::NONE; BUCKET];
            let mut kept = 0;
            for (i, square) in squares.into_iter().take(len as usize).enumerate() {
                near[kept % BUCKET] = Hit {
                    bits: square.to_bits(),
                    slot: Slot::new(bucket as usize, i),
                };
                kept += usize::from(square <= self.limit);
            }
            // Copying all of them is faster than copying some.
            self.hits.extend_from_slice(&near);
            self.hits.truncate(self.hits.len() - BUCKET + kept);
        }
        self.waits = 0;
        if self.hits.len() >= self.count.saturating_mul(2) {
            self.cut();
        }
    }

    /// Keeps the nearest sites only.
    fn cut(&mut self) {
        if self.hits.len() > self.count {
            let (_, last, _) = self.hits.select_nth_unstable(self.count - 1);
            self.limit = last.square();
            self.hits.truncate(self.count);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{generator, unit};

    /// Clustered places, some of them on common lines.
    fn places(n: usize, seed: u64) -> Vec<Point2<f64>> {
        let mut random = generator(seed, 0);
        (0..n)
            .map(|i| match i % 4 {
                0 => Point2::new(unit(&mut random), unit(&mut random)),
                1 => Point2::new(0.5, unit(&mut random)),
                2 => Point2::new(unit(&mut random) * 1e-3, unit(&mut random) * 1e-6),
                _ => Point2::new(unit(&mut random), 0.25),
            })
            .collect()
    }

    #[test]
    fn queries_agree_with_a_scan() {
        let all = places(6_000, 1);
        let mut index = SiteIndex::default();
        let mut hits = Vec::new();
        let few = Near {
            radius: 0.1,
            count: 5,
            more: 0,
        };
        for (i, &p) in all.iter().enumerate() {
            // What was asked last is now the place itself, now another.
            match i % 3 {
                0 => index.near(p, few, &mut hits),
                1 => index.near(all[i / 2], few, &mut hits),
                _ => {}
            }
            assert_eq!(index.insert(p), SiteId(i as u32));
            index.rank_mut(SiteId(i as u32)).least = i as f64;
        }
        for (k, q) in places(300, 2).into_iter().enumerate() {
            let mut scan: Vec<(f64, SiteId)> = all
                .iter()
                .enumerate()
                .map(|(i, p)| ((p - q).norm_squared(), SiteId(i as u32)))
                .collect();
            scan.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            assert_eq!(index.nearest(q), Some(scan[0].1));
            let near = Near {
                radius: 0.3 * (k % 5) as f64,
                count: 1 + k % 60,
                more: 0,
            };
            index.near(q, near, &mut hits);
            hits.sort_unstable();
            scan.retain(|h| h.0 <= near.radius * near.radius);
            scan.truncate(near.count);
            let squares = |all: &[(f64, SiteId)]| all.iter().map(|h| h.0).collect::<Vec<_>>();
            let found = |h: &Hit| (h.square(), index.rank_at(h.slot).site);
            let found: Vec<_> = hits.iter().map(found).collect();
            assert_eq!(squares(&found), squares(&scan));
            for (square, site) in found {
                assert_eq!((all[site.0 as usize] - q).norm_squared(), square);
                assert_eq!(index.rank(site).least, f64::from(site.0));
            }
        }
        for (i, &p) in all.iter().enumerate() {
            assert_eq!(index.at(p), Some(SiteId(i as u32)));
            assert_eq!(index.rank(SiteId(i as u32)).least, i as f64);
        }
        assert_eq!(index.at(Point2::new(0.3, 0.3)), None);
    }

    #[test]
    fn places_in_a_line_and_both_zeros_are_told_apart() {
        let mut index = SiteIndex::default();
        for i in 0..5_000 {
            index.insert(Point2::new(0.5, f64::from(i)));
        }
        assert_eq!(index.at(Point2::new(0.5, -0.0)), Some(SiteId(0)));
        let mut hits = Vec::new();
        let near = Near {
            radius: f64::INFINITY,
            count: 3,
            more: 0,
        };
        index.near(Point2::new(0.5, 4_000.2), near, &mut hits);
        let mut found: Vec<u32> = hits.iter().map(|h| index.rank_at(h.slot).site.0).collect();
        found.sort_unstable();
        assert_eq!(found, [3_999, 4_000, 4_001]);
    }
}
