//! Which sites lie near a point.

use nalgebra::Point2;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::SiteId;

/// A dynamic spatial index of sites (an R*-tree).
#[derive(Clone, Debug, Default)]
pub(super) struct SiteIndex {
    tree: RTree<GeomWithData<[f64; 2], u32>>,
}

impl SiteIndex {
    pub(super) fn insert(&mut self, at: Point2<f64>, site: SiteId) {
        self.tree.insert(GeomWithData::new([at.x, at.y], site.0));
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
        let entry = self.tree.nearest_neighbor([p.x, p.y])?;
        (*entry.geom() == [p.x, p.y]).then_some(SiteId(entry.data))
    }
}
