//! Which sites lie near a point.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use nalgebra::Point2;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::SiteId;

/// A dynamic spatial index of sites (an R*-tree).
#[derive(Clone, Debug, Default)]
pub(super) struct SiteIndex {
    tree: RTree<GeomWithData<[f64; 2], u32>>,
    /// Sites by the bits of their coordinates.
    exact: HashMap<(u64, u64), SiteId, BuildHasherDefault<BitsHasher>>,
}

/// Mixes the bits of coordinates: a multiplicative hash, since keys come from geometry, not from
/// an adversary.
#[derive(Clone, Debug, Default)]
struct BitsHasher(u64);

impl Hasher for BitsHasher {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }

    fn write_u64(&mut self, bits: u64) {
        // The odd constant nearest to 2^64 divided by the golden ratio.
        self.0 = (self.0.rotate_left(29) ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

fn key(p: Point2<f64>) -> (u64, u64) {
    // Adding 0 makes the two zeros one.
    ((p.x + 0.0).to_bits(), (p.y + 0.0).to_bits())
}

impl SiteIndex {
    pub(super) fn insert(&mut self, at: Point2<f64>, site: SiteId) {
        self.tree.insert(GeomWithData::new([at.x, at.y], site.0));
        self.exact.insert(key(at), site);
    }

    /// The sites within `radius` (Euclidean) of `p`.
    pub(super) fn within(&self, p: Point2<f64>, radius: f64) -> impl Iterator<Item = SiteId> + '_ {
        self.tree
            .locate_within_distance([p.x, p.y], radius * radius)
            .map(|entry| SiteId(entry.data))
    }

    /// The site nearest to `p`.
    pub(super) fn nearest(&self, p: Point2<f64>) -> Option<SiteId> {
        self.tree
            .nearest_neighbor([p.x, p.y])
            .map(|entry| SiteId(entry.data))
    }

    /// The site at exactly `p`.
    pub(super) fn at(&self, p: Point2<f64>) -> Option<SiteId> {
        self.exact.get(&key(p)).copied()
    }
}
