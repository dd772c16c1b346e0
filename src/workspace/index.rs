//! Acceleration structures: the only place that speaks to `parry`.
//!
//! Exact tests stay with us (`parry`'s shapes have no notion of an open polygon with a tolerance);
//! its bounding-volume hierarchy tells which edges and polygons are worth testing.

use nalgebra::Point2;
use parry2d_f64::bounding_volume::Aabb;
use parry2d_f64::math::Vector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

use super::bands::Bands;
use super::{Polygon, Side};

/// One edge of one polygon of the map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// The polygon's number among those indexed.
    pub(super) polygon: u32,
    /// Its ends.
    pub(super) from: Point2<f64>,
    pub(super) to: Point2<f64>,
}

/// Bounding-volume hierarchies over polygons and over their edges.
#[derive(Clone)]
pub(super) struct PolygonIndex {
    edges: Vec<Edge>,
    edge_tree: Bvh,
    polygon_tree: Bvh,
    bands: Vec<Option<Bands>>,
}

impl PolygonIndex {
    /// Indexes polygons; every box is widened by `tolerance`.
    pub(super) fn new<'a>(
        polygons: impl Iterator<Item = &'a Polygon> + Clone,
        tolerance: f64,
    ) -> Self {
        let polygons_again = polygons.clone();
        let edges: Vec<Edge> = polygons
            .clone()
            .enumerate()
            .flat_map(|(i, p)| {
                p.edges().map(move |(from, to)| Edge {
                    polygon: i as u32,
                    from,
                    to,
                })
            })
            .collect();
        let edge_boxes: Vec<Aabb> = edges
            .iter()
            .map(|e| boxed(e.from.inf(&e.to), e.from.sup(&e.to), tolerance))
            .collect();
        let boxes: Vec<Aabb> = polygons
            .map(|p| boxed(p.min(), p.max(), tolerance))
            .collect();
        let bands = polygons_again.map(|p| Bands::new(p, tolerance)).collect();
        Self {
            bands,
            edges,
            edge_tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &edge_boxes),
            polygon_tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
        }
    }

    /// Where `p` lies with respect to a polygon, as [`Polygon::side_of`] says, for a tolerance no
    /// larger than that of the index. Long borders are searched in bands.
    pub(super) fn side_of(
        &self,
        i: usize,
        polygon: &Polygon,
        p: Point2<f64>,
        tolerance: f64,
    ) -> Side {
        match &self.bands[i] {
            Some(bands) => bands.side_of(polygon, p, tolerance),
            None => polygon.side_of(p, tolerance),
        }
    }

    /// The edges whose boxes the segment `ab` meets.
    pub(super) fn edges_near(
        &self,
        a: Point2<f64>,
        b: Point2<f64>,
    ) -> impl Iterator<Item = &Edge> + '_ {
        self.edge_tree
            .leaves(move |node| segment_meets(node, a, b))
            .map(|i| &self.edges[i as usize])
    }

    /// The polygons whose boxes contain `p`.
    pub(super) fn polygons_near(&self, p: Point2<f64>) -> impl Iterator<Item = usize> + '_ {
        self.polygon_tree
            .leaves(move |node| segment_meets(node, p, p))
            .map(|i| i as usize)
    }
}

impl std::fmt::Debug for PolygonIndex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PolygonIndex")
            .field("edges", &self.edges.len())
            .finish_non_exhaustive()
    }
}

/// A bounding-volume hierarchy over boxes.
#[derive(Clone)]
pub(super) struct BoxIndex(Bvh);

impl BoxIndex {
    /// Indexes boxes, given by their lowest and highest corners and widened by `margin`.
    pub(super) fn new(
        boxes: impl Iterator<Item = (Point2<f64>, Point2<f64>)>,
        margin: f64,
    ) -> Self {
        let boxes: Vec<Aabb> = boxes.map(|(min, max)| boxed(min, max, margin)).collect();
        Self(Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes))
    }

    /// The boxes that contain `p`.
    pub(super) fn at(&self, p: Point2<f64>) -> impl Iterator<Item = usize> + '_ {
        self.near(p, p)
    }

    /// The boxes that the segment `ab` meets.
    pub(super) fn near(&self, a: Point2<f64>, b: Point2<f64>) -> impl Iterator<Item = usize> + '_ {
        self.0
            .leaves(move |node| segment_meets(node, a, b))
            .map(|i| i as usize)
    }
}

impl std::fmt::Debug for BoxIndex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BoxIndex").finish_non_exhaustive()
    }
}

fn boxed(min: Point2<f64>, max: Point2<f64>, margin: f64) -> Aabb {
    Aabb::new(
        Vector::new(min.x - margin, min.y - margin),
        Vector::new(max.x + margin, max.y + margin),
    )
}

/// Separating-axis test of a segment and an axis-parallel box: the two box axes and the
/// segment's normal.
#[inline]
fn segment_meets(node: &BvhNode, a: Point2<f64>, b: Point2<f64>) -> bool {
    let (min, max) = (node.mins(), node.maxs());
    if a.x.min(b.x) > max.x || a.x.max(b.x) < min.x || a.y.min(b.y) > max.y || a.y.max(b.y) < min.y
    {
        return false;
    }
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let (cx, cy) = ((min.x + max.x) / 2.0 - a.x, (min.y + max.y) / 2.0 - a.y);
    let reach = (dy.abs() * (max.x - min.x) + dx.abs() * (max.y - min.y)) / 2.0;
    (dx * cy - dy * cx).abs() <= reach
}
