//! Acceleration structures: the only place that speaks to `parry`.
//!
//! Exact tests stay with us (`parry`'s shapes have no notion of an open polygon with a tolerance);
//! its bounding-volume hierarchy tells which edges and polygons are worth testing.

use nalgebra::Point2;
use parry2d_f64::bounding_volume::Aabb;
use parry2d_f64::math::Vector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use smallvec::SmallVec;

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

/// So many boxes are looked at one after another; more in a hierarchy.
const FEW: usize = 24;

/// Polygons of more edges than this are not few boxes.
const SHORT: usize = 16;

/// Bounding-volume hierarchies over polygons and over their edges; of few polygons with few edges, lists.
#[derive(Clone)]
pub(super) struct PolygonIndex {
    edges: Vec<Edge>,
    boxes: Boxes,
    bands: Vec<Option<Bands>>,
}

#[derive(Clone)]
enum Boxes {
    Few {
        polygons: Vec<Extent>,
        /// For each polygon where its edges begin and end.
        spans: Vec<[u32; 2]>,
        edges: Vec<Extent>,
    },
    Many {
        polygons: Bvh,
        edges: Bvh,
    },
}

impl PolygonIndex {
    /// Indexes polygons; every box is widened by `tolerance`.
    pub(super) fn new<'a>(
        polygons: impl Iterator<Item = &'a Polygon> + Clone,
        tolerance: f64,
    ) -> Self {
        let of_polygon = |i: usize, p: &'a Polygon| {
            p.edges().map(move |(from, to)| Edge {
                polygon: i as u32,
                from,
                to,
            })
        };
        let numbered = polygons.clone().enumerate();
        let edges: Vec<Edge> = numbered.flat_map(|(i, p)| of_polygon(i, p)).collect();
        let edge_boxes = edges
            .iter()
            .map(|e| boxed(e.from.inf(&e.to), e.from.sup(&e.to), tolerance));
        let boxes = polygons.clone().map(|p| boxed(p.min(), p.max(), tolerance));
        let lens = polygons.clone().map(|p| p.vertices().len());
        let is_few = lens.clone().count() <= FEW && lens.clone().all(|len| len <= SHORT);
        let boxes = if is_few {
            let spans = lens.scan(0, |begin, len| {
                let end = *begin + len as u32;
                Some([std::mem::replace(begin, end), end])
            });
            Boxes::Few {
                spans: spans.collect(),
                polygons: boxes.map(|b| Extent::of(&b)).collect(),
                edges: edge_boxes.map(|b| Extent::of(&b)).collect(),
            }
        } else {
            let tree = |boxes: &[Aabb]| Bvh::from_leaves(BvhBuildStrategy::Binned, boxes);
            Boxes::Many {
                polygons: tree(&boxes.collect::<Vec<_>>()),
                edges: tree(&edge_boxes.collect::<Vec<_>>()),
            }
        };
        Self {
            bands: polygons.map(|p| Bands::new(p, tolerance)).collect(),
            edges,
            boxes,
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

    /// Visits the edges whose boxes the segment `ab` meets, until `visit` has found what it looks for.
    #[inline]
    pub(super) fn edges_near<T>(
        &self,
        a: Point2<f64>,
        b: Point2<f64>,
        mut visit: impl FnMut(&Edge) -> Option<T>,
    ) -> Option<T> {
        let mut visit = |i: u32| visit(&self.edges[i as usize]);
        match &self.boxes {
            Boxes::Few {
                polygons,
                spans,
                edges,
            } => {
                let probe = Probe::new(a, b);
                let met = polygons.iter().zip(spans).filter(|p| probe.meets(p.0));
                let numbers = met.flat_map(|(_, &[begin, end])| begin..end);
                let mut near = numbers.filter(|&i| probe.meets(&edges[i as usize]));
                near.find_map(visit)
            }
            Boxes::Many { edges, .. } => {
                let mut near = edges.leaves(|node| segment_meets(node, a, b));
                near.find_map(&mut visit)
            }
        }
    }

    /// The polygons whose boxes contain `p`.
    #[inline]
    pub(super) fn polygons_near(&self, p: Point2<f64>) -> SmallVec<[usize; 8]> {
        match &self.boxes {
            Boxes::Few { polygons, .. } => {
                let numbers = polygons.iter().enumerate();
                numbers.filter(|n| n.1.contains(p)).map(|n| n.0).collect()
            }
            Boxes::Many { polygons, .. } => {
                let near = polygons.leaves(|node| segment_meets(node, p, p));
                near.map(|i| i as usize).collect()
            }
        }
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

/// A box by its centre and half its sides.
#[derive(Clone, Copy)]
struct Extent {
    centre: [f64; 2],
    half: [f64; 2],
}

impl Extent {
    fn of(b: &Aabb) -> Self {
        let (centre, half) = (b.center(), b.half_extents());
        Self {
            centre: [centre.x, centre.y],
            half: [half.x, half.y],
        }
    }

    #[inline]
    fn contains(&self, p: Point2<f64>) -> bool {
        (p.x - self.centre[0]).abs() <= self.half[0] && (p.y - self.centre[1]).abs() <= self.half[1]
    }
}

/// A segment that boxes are held against, as in [`segment_meets`].
#[derive(Clone, Copy)]
struct Probe {
    middle: [f64; 2],
    along: [f64; 2],
}

impl Probe {
    fn new(a: Point2<f64>, b: Point2<f64>) -> Self {
        Self {
            middle: [(a.x + b.x) / 2.0, (a.y + b.y) / 2.0],
            along: [b.x - a.x, b.y - a.y],
        }
    }

    #[inline]
    fn meets(&self, b: &Extent) -> bool {
        let [dx, dy] = self.along;
        let (x, y) = (b.centre[0] - self.middle[0], b.centre[1] - self.middle[1]);
        let (dx_size, dy_size) = (dx.abs(), dy.abs());
        // All three are found, and then asked for: none of them is likely enough to wait for.
        (x.abs() <= b.half[0] + dx_size / 2.0)
            & (y.abs() <= b.half[1] + dy_size / 2.0)
            & ((dx * y - dy * x).abs() <= dy_size * b.half[0] + dx_size * b.half[1])
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
