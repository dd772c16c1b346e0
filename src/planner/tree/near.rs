//! Which sites lie near a point: a kd-tree with buckets that grows by insertion.
//!
//! A leaf holds up to [`BUCKET`] sites; a full one is split at the median of its wider extent. Drawn
//! points arrive in random order, so the depth stays logarithmic without any rebalancing (J. L.
//! Bentley, "Multidimensional binary search trees used for associative searching", CACM 1975, for
//! the structure; J. H. Friedman, J. L. Bentley, R. A. Finkel, "An algorithm for finding best
//! matches in logarithmic expected time", TOMS 1977, for buckets and nearest neighbours).
//! Queries allocate nothing; ties are broken by the sites' numbers.

use nalgebra::Point2;

use super::SiteId;

/// Sites of a leaf. Scanning this many costs about as much as two steps down the tree.
const BUCKET: usize = 16;

/// The axis number of a leaf.
const LEAF: u32 = 2;

/// A site in the answer to a query, ordered by distance, then by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Hit {
    /// The bits of the squared distance: those of numbers that are not negative are ordered as the
    /// numbers are, and compare faster.
    bits: u64,
    pub(super) site: SiteId,
}

impl Hit {
    fn new(square: f64, site: SiteId) -> Self {
        let bits = square.to_bits();
        Self { bits, site }
    }

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

/// A node of the tree: a split, or a leaf.
#[derive(Clone, Copy, Debug)]
struct Branch {
    /// 0 or 1 for x or y; [`LEAF`] for a leaf.
    axis: u32,
    /// Of a split the branch on the side of lower coordinates, of a leaf its bucket. The other
    /// side's branch has the next number.
    next: u32,
    /// Coordinates from here on are on the higher side.
    at: f64,
}

/// The sites of a leaf.
#[derive(Clone, Debug)]
struct Bucket {
    /// The coordinates, each axis for itself: distances are found several at a time.
    places: [[f64; BUCKET]; 2],
    sites: [SiteId; BUCKET],
    len: usize,
}

/// A dynamic spatial index of sites.
#[derive(Clone, Debug)]
pub(super) struct SiteIndex {
    branches: Vec<Branch>,
    buckets: Vec<Bucket>,
}

impl Default for SiteIndex {
    fn default() -> Self {
        let leaf = Branch {
            axis: LEAF,
            next: 0,
            at: 0.0,
        };
        Self {
            branches: vec![leaf],
            buckets: vec![Bucket::EMPTY],
        }
    }
}

impl Bucket {
    const EMPTY: Self = Self {
        places: [[0.0; BUCKET]; 2],
        sites: [SiteId(0); BUCKET],
        len: 0,
    };

    fn push(&mut self, place: [f64; 2], site: SiteId) {
        for (axis, value) in self.places.iter_mut().zip(place) {
            axis[self.len] = value;
        }
        self.sites[self.len] = site;
        self.len += 1;
    }

    /// The sites with their squared distances from `p`.
    fn squares(&self, p: [f64; 2]) -> impl Iterator<Item = (f64, SiteId)> + '_ {
        let mut squares = [0.0; BUCKET];
        let places = self.places[0].iter().zip(&self.places[1]);
        for (square, (x, y)) in squares.iter_mut().zip(places) {
            let (x, y) = (x - p[0], y - p[1]);
            *square = x * x + y * y;
        }
        squares.into_iter().zip(self.sites).take(self.len)
    }

    fn place(&self, i: usize) -> [f64; 2] {
        self.places.map(|axis| axis[i])
    }

    /// The wider axis and a coordinate that leaves places on both of its sides; `None` if all
    /// places are the same.
    fn split(&self) -> Option<(usize, f64)> {
        let extent = |axis: usize| {
            let values = || self.places[axis][..self.len].iter().copied();
            values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
        };
        let axis = usize::from(extent(1) > extent(0));
        let mut values = self.places[axis];
        let values = &mut values[..self.len];
        values.sort_unstable_by(f64::total_cmp);
        let middle = values[values.len() / 2];
        let above = |v: &&f64| **v > values[0];
        let at = if middle > values[0] {
            middle
        } else {
            *values.iter().find(above)?
        };
        Some((axis, at))
    }
}

impl SiteIndex {
    pub(super) fn insert(&mut self, at: Point2<f64>, site: SiteId) {
        // Adding 0 makes the two zeros one.
        let place = [at.x + 0.0, at.y + 0.0];
        let mut leaf = self.leaf(place);
        while self.buckets[self.branches[leaf].next as usize].len == BUCKET {
            if !self.split(leaf) {
                return; // the same place so many times: it is found already
            }
            leaf = self.leaf_below(leaf, place);
        }
        let bucket = self.branches[leaf].next as usize;
        self.buckets[bucket].push(place, site);
    }

    /// Turns a leaf into a split of two leaves.
    fn split(&mut self, leaf: usize) -> bool {
        let bucket = self.branches[leaf].next as usize;
        let Some((axis, at)) = self.buckets[bucket].split() else {
            return false;
        };
        let full = std::mem::replace(&mut self.buckets[bucket], Bucket::EMPTY);
        let other = self.buckets.len();
        self.buckets.push(Bucket::EMPTY);
        for i in 0..full.len {
            let place = full.place(i);
            let side = if place[axis] < at { bucket } else { other };
            self.buckets[side].push(place, full.sites[i]);
        }
        let next = self.branches.len() as u32;
        for bucket in [bucket, other] {
            self.branches.push(Branch {
                axis: LEAF,
                next: bucket as u32,
                at: 0.0,
            });
        }
        self.branches[leaf] = Branch {
            axis: axis as u32,
            next,
            at,
        };
        true
    }

    fn leaf(&self, place: [f64; 2]) -> usize {
        self.leaf_below(0, place)
    }

    fn leaf_below(&self, mut i: usize, place: [f64; 2]) -> usize {
        loop {
            let branch = self.branches[i];
            if branch.axis == LEAF {
                return i;
            }
            i = branch.next as usize + usize::from(place[branch.axis as usize] >= branch.at);
        }
    }

    /// Puts the sites that are near `p` into `hits`, in no particular order.
    pub(super) fn near(&self, p: Point2<f64>, near: Near, hits: &mut Vec<Hit>) {
        hits.clear();
        if near.count > 0 {
            let (count, limit) = (near.count, near.radius * near.radius);
            let mut found = Found { hits, count, limit };
            self.collect(0, [p.x, p.y], [0.0; 2], &mut found);
            found.cut();
        }
    }

    /// Visits what lies below branch `i`, whose box is `off` away from `p` along each axis.
    fn collect(&self, i: usize, p: [f64; 2], off: [f64; 2], found: &mut Found<'_>) {
        let branch = self.branches[i];
        if branch.axis == LEAF {
            for (square, site) in self.buckets[branch.next as usize].squares(p) {
                found.offer(square, site);
            }
            return;
        }
        let axis = branch.axis as usize;
        let ahead = p[axis] - branch.at;
        let side = usize::from(ahead >= 0.0);
        let next = branch.next as usize;
        self.collect(next + side, p, off, found);
        let mut beyond = off;
        beyond[axis] = ahead;
        if beyond[0] * beyond[0] + beyond[1] * beyond[1] <= found.limit {
            self.collect(next + 1 - side, p, beyond, found);
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
        if branch.axis == LEAF {
            for hit in self.buckets[branch.next as usize].squares(p) {
                if hit < *best {
                    *best = hit;
                }
            }
            return;
        }
        let axis = branch.axis as usize;
        let ahead = p[axis] - branch.at;
        let side = usize::from(ahead >= 0.0);
        let next = branch.next as usize;
        self.closest(next + side, p, off, best);
        let mut beyond = off;
        beyond[axis] = ahead;
        if beyond[0] * beyond[0] + beyond[1] * beyond[1] <= best.0 {
            self.closest(next + 1 - side, p, beyond, best);
        }
    }

    /// The site at exactly `p`.
    pub(super) fn at(&self, p: Point2<f64>) -> Option<SiteId> {
        let place = [p.x + 0.0, p.y + 0.0];
        let bucket = &self.buckets[self.branches[self.leaf(place)].next as usize];
        let i = (0..bucket.len).find(|&i| bucket.place(i) == place)?;
        Some(bucket.sites[i])
    }
}

/// The nearest sites so far, and up to as many again that are not yet told from them.
struct Found<'h> {
    hits: &'h mut Vec<Hit>,
    count: usize,
    /// The squared distance beyond which nothing is wanted any more.
    limit: f64,
}

impl Found<'_> {
    fn offer(&mut self, square: f64, site: SiteId) {
        if square <= self.limit {
            self.hits.push(Hit::new(square, site));
            if self.hits.len() >= self.count.saturating_mul(2) {
                self.cut();
            }
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
        let all = places(3_000, 1);
        let mut index = SiteIndex::default();
        for (i, &p) in all.iter().enumerate() {
            index.insert(p, SiteId(i as u32));
        }
        let mut hits = Vec::new();
        for (k, q) in places(200, 2).into_iter().enumerate() {
            let mut scan: Vec<Hit> = all
                .iter()
                .enumerate()
                .map(|(i, p)| Hit::new((p - q).norm_squared(), SiteId(i as u32)))
                .collect();
            scan.sort_unstable();
            assert_eq!(index.nearest(q), Some(scan[0].site));
            let near = Near {
                radius: 0.3 * (k % 5) as f64,
                count: 1 + k % 60,
                more: 0,
            };
            index.near(q, near, &mut hits);
            hits.sort_unstable();
            scan.retain(|h| h.square() <= near.radius * near.radius);
            scan.truncate(near.count);
            assert_eq!(hits, scan);
        }
        for (i, &p) in all.iter().enumerate() {
            assert_eq!(index.at(p), Some(SiteId(i as u32)));
        }
        assert_eq!(index.at(Point2::new(0.3, 0.3)), None);
    }

    #[test]
    fn a_place_repeated_for_ever_does_no_harm() {
        let mut index = SiteIndex::default();
        for i in 0..100 {
            index.insert(Point2::new(0.5, -0.0), SiteId(i));
        }
        assert_eq!(index.at(Point2::new(0.5, 0.0)), Some(SiteId(0)));
    }
}
