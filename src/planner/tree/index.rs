//! Where the sites are: a kd-tree with buckets that grows by insertion.
//!
//! A leaf holds up to [`BUCKET`] sites; a full one is split at the median of its wider extent. Drawn
//! points arrive in random order, those of large trees in batches from all over the map, so the depth stays logarithmic
//! without any rebalancing (J. L.
//! Bentley, "Multidimensional binary search trees used for associative searching", CACM 1975, for
//! the structure; J. H. Friedman, J. L. Bentley, R. A. Finkel, "An algorithm for finding best
//! matches in logarithmic expected time", TOMS 1977, for buckets and nearest neighbours).
//!
//! Large trees wait for memory, so what is asked of every site that is near stands in its bucket.

use nalgebra::Point2;

use super::near::Descent;
use super::{NONE, SiteId};

/// Sites of a leaf. Scanning this many costs about as much as two steps down the tree.
pub(super) const BUCKET: usize = 16;

/// What is asked of every site that is near.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))] // never in two cache lines
pub(super) struct Rank {
    /// The least cost of its nodes.
    pub(super) least: f64,
    /// The states that can follow its nodes, each as bit number `state mod 64`.
    pub(super) targets: u64,
    pub(super) site: SiteId,
    /// Its node, if it has one and no more.
    pub(super) only: u32,
    /// Its letter and the state of one of its nodes, as [`super::Steps`] counts them.
    pub(super) row: u32,
    /// Of a site with several nodes: none costs more.
    most: f32,
}

impl Rank {
    /// Of a site without nodes.
    const fn none(site: SiteId) -> Self {
        Self {
            least: f64::INFINITY,
            targets: 0,
            site,
            only: NONE,
            row: 0,
            most: 0.0,
        }
    }

    /// No node of the site costs more.
    #[inline]
    pub(super) fn most(&self) -> f64 {
        if self.only == NONE {
            f64::from(self.most)
        } else {
            self.least
        }
    }

    /// As [`Self::most`], for a site with several nodes.
    pub(super) fn set_most(&mut self, cost: f64) {
        let most = cost as f32;
        self.most = if f64::from(most) < cost {
            most.next_up()
        } else {
            most
        };
    }

    /// One of its nodes costs less than before.
    #[inline]
    pub(super) fn lower(&mut self, cost: f64) {
        self.least = if self.only == NONE {
            self.least.min(cost)
        } else {
            cost
        };
    }
}

/// Where a site stands: the number of its bucket times [`BUCKET`], and its place there. The next
/// insertion changes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Slot(u32);

impl Slot {
    pub(super) const FIRST: Self = Self(0);

    pub(super) fn new(bucket: usize, place: usize) -> Self {
        Self((bucket * BUCKET + place) as u32)
    }

    fn split(self) -> (usize, usize) {
        (self.0 as usize / BUCKET, self.0 as usize % BUCKET)
    }
}

/// A node of the kd-tree: a split, or a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct Branch {
    /// Coordinates from here on are on the higher side; of a leaf not a number.
    at: f64,
    /// Twice the number of the branch on the side of lower coordinates, or of a leaf's bucket, plus 1 if
    /// the split is by y. The higher side's branch has the next number.
    next: u32,
    /// How many sites lie below.
    pub(super) len: u32,
}

impl Branch {
    fn leaf(bucket: usize, len: usize) -> Self {
        Self {
            at: f64::NAN,
            next: 2 * bucket as u32,
            len: len as u32,
        }
    }

    /// Of a leaf its bucket.
    #[inline]
    pub(super) fn bucket(self) -> Option<usize> {
        self.at.is_nan().then_some(self.next as usize / 2)
    }

    /// The axis of a split, 0 or 1 for x or y.
    #[inline]
    pub(super) fn axis(self) -> usize {
        self.next as usize % 2
    }

    /// Of a split the branch on the lower side.
    #[inline]
    pub(super) fn next(self) -> usize {
        self.next as usize / 2
    }

    #[inline]
    pub(super) fn at(self) -> f64 {
        self.at
    }
}

/// The sites of a leaf, which knows how many they are.
#[derive(Clone, Debug)]
#[repr(align(64))] // whole cache lines
pub(super) struct Bucket {
    /// The coordinates, each axis for itself: distances are found several at a time.
    places: [[f64; BUCKET]; 2],
    pub(super) ranks: [Rank; BUCKET],
}

impl Bucket {
    const EMPTY: Self = Self {
        places: [[0.0; BUCKET]; 2],
        ranks: [Rank::none(SiteId(0)); BUCKET],
    };

    fn set(&mut self, i: usize, place: [f64; 2], rank: Rank) {
        for (axis, value) in self.places.iter_mut().zip(place) {
            axis[i] = value;
        }
        self.ranks[i] = rank;
    }

    /// The squared distances of the first places from `p`; what follows them means nothing.
    #[inline]
    pub(super) fn squares(&self, p: [f64; 2]) -> [f64; BUCKET] {
        let mut squares = [0.0; BUCKET];
        let places = self.places[0].iter().zip(&self.places[1]);
        for (square, (x, y)) in squares.iter_mut().zip(places) {
            let (x, y) = (x - p[0], y - p[1]);
            *square = x * x + y * y;
        }
        squares
    }

    /// A number that takes reading all cache lines of the places.
    #[inline]
    pub(super) fn touch(&self) -> u64 {
        let lines = self.places.iter().flat_map(|axis| axis.iter().step_by(8));
        lines.fold(0, |sum, x| sum ^ x.to_bits())
    }

    pub(super) fn place(&self, i: usize) -> [f64; 2] {
        self.places.map(|axis| axis[i])
    }

    /// The wider axis and a coordinate that leaves places on both of its sides, as they are not all the same.
    /// The bucket is full.
    fn split(&self) -> (usize, f64) {
        let extent = |axis: usize| {
            let values = || self.places[axis].iter().copied();
            values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
        };
        let axis = usize::from(extent(1) > extent(0));
        let mut values = self.places[axis];
        values.sort_unstable_by(f64::total_cmp);
        let middle = values[BUCKET / 2];
        let above = values.iter().find(|v| **v > values[0]);
        let at = if middle > values[0] {
            middle
        } else {
            above.copied().unwrap_or(middle)
        };
        (axis, at)
    }
}

/// A dynamic spatial index of sites.
#[derive(Clone, Debug)]
pub(super) struct SiteIndex {
    pub(super) branches: Vec<Branch>,
    pub(super) buckets: Vec<Bucket>,
    /// For each site where it stands.
    slots: Vec<Slot>,
    /// The least and the greatest coordinates.
    pub(super) corners: [[f64; 2]; 2],
    /// The way to the point that was asked for last.
    pub(super) descent: Descent,
}

impl Default for SiteIndex {
    fn default() -> Self {
        Self {
            branches: vec![Branch::leaf(0, 0)],
            buckets: vec![Bucket::EMPTY],
            slots: Vec::new(),
            corners: [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]],
            descent: Descent::default(),
        }
    }
}

impl SiteIndex {
    /// Makes room for so many sites.
    pub(super) fn expect(&mut self, sites: usize) {
        // Buckets are more than half full in the mean.
        let buckets = 2 * sites / BUCKET + 1;
        self.buckets
            .reserve_exact(buckets.saturating_sub(self.buckets.len()));
        self.slots
            .reserve_exact(sites.saturating_sub(self.slots.len()));
    }

    /// Enters the next site, whose number is that of the sites before it. No other may be at its place.
    pub(super) fn insert(&mut self, at: Point2<f64>) -> SiteId {
        let site = SiteId(self.slots.len() as u32);
        // Adding 0 makes the two zeros one.
        let place = [at.x + 0.0, at.y + 0.0];
        for (axis, x) in place.into_iter().enumerate() {
            self.corners[0][axis] = self.corners[0][axis].min(x);
            self.corners[1][axis] = self.corners[1][axis].max(x);
        }
        let mut leaf = 0;
        if self.descent.to.take() == Some([at.x, at.y]) {
            for step in &self.descent.steps {
                self.branches[step.branch as usize].len += 1;
            }
            leaf = self.descent.leaf;
        }
        let bucket = loop {
            self.branches[leaf].len += 1;
            let branch = self.branches[leaf];
            match branch.bucket() {
                Some(bucket) if branch.len as usize <= BUCKET => break bucket,
                Some(_) => self.split(leaf),
                None => leaf = Self::side_of(branch, place),
            }
        };
        let i = self.branches[leaf].len as usize - 1;
        self.buckets[bucket].set(i, place, Rank::none(site));
        self.slots.push(Slot::new(bucket, i));
        site
    }

    /// Turns a full leaf into a split of two leaves.
    fn split(&mut self, leaf: usize) {
        let Some(bucket) = self.branches[leaf].bucket() else {
            return;
        };
        let (axis, at) = self.buckets[bucket].split();
        let full = std::mem::replace(&mut self.buckets[bucket], Bucket::EMPTY);
        let sides = [bucket, self.buckets.len()];
        push(&mut self.buckets, Bucket::EMPTY);
        let mut lens = [0; 2];
        for i in 0..BUCKET {
            let place = full.place(i);
            let side = usize::from(place[axis] >= at);
            let (bucket, to) = (sides[side], lens[side]);
            self.buckets[bucket].set(to, place, full.ranks[i]);
            self.slots[full.ranks[i].site.0 as usize] = Slot::new(bucket, to);
            lens[side] += 1;
        }
        // The site that comes next is counted on its way down.
        self.branches[leaf] = Branch {
            at,
            next: (2 * self.branches.len() + axis) as u32,
            len: BUCKET as u32,
        };
        for (bucket, len) in sides.into_iter().zip(lens) {
            self.branches.push(Branch::leaf(bucket, len));
        }
    }

    #[inline]
    fn side_of(branch: Branch, place: [f64; 2]) -> usize {
        branch.next() + usize::from(place[branch.axis()] >= branch.at)
    }

    /// The site at exactly `p`.
    pub(super) fn at(&self, p: Point2<f64>) -> Option<SiteId> {
        let place = [p.x + 0.0, p.y + 0.0];
        let mut branch = self.branches[0];
        let bucket = loop {
            match branch.bucket() {
                Some(bucket) => break &self.buckets[bucket],
                None => branch = self.branches[Self::side_of(branch, place)],
            }
        };
        let i = (0..branch.len as usize).find(|&i| bucket.place(i) == place)?;
        Some(bucket.ranks[i].site)
    }

    /// What is asked of every site that is near, by where it stands.
    #[inline]
    pub(super) fn rank_at(&self, slot: Slot) -> &Rank {
        let (bucket, i) = slot.split();
        &self.buckets[bucket].ranks[i]
    }

    /// The place of the site that stands there.
    #[inline]
    pub(super) fn place_at(&self, slot: Slot) -> Point2<f64> {
        let (bucket, i) = slot.split();
        Point2::from(self.buckets[bucket].place(i))
    }

    /// Where a site stands.
    #[inline]
    pub(super) fn slot(&self, site: SiteId) -> Slot {
        self.slots[site.0 as usize]
    }

    #[inline]
    pub(super) fn rank(&self, site: SiteId) -> &Rank {
        self.rank_at(self.slot(site))
    }

    #[inline]
    pub(super) fn rank_mut(&mut self, site: SiteId) -> &mut Rank {
        let (bucket, i) = self.slots[site.0 as usize].split();
        &mut self.buckets[bucket].ranks[i]
    }
}

/// Appends to a list that grows fourfold: what is aligned to cache lines cannot grow where it stands and is copied
/// each time, while room that is not used yet is no memory yet.
pub(super) fn push<T>(all: &mut Vec<T>, item: T) {
    if all.len() == all.capacity() {
        all.reserve_exact(3 * all.len());
    }
    all.push(item);
}
