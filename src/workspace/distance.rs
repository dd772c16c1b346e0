//! How far points, segments and polygons are from each other.

use nalgebra::Point2;

use super::{Polygon, Side};

/// So many pairs of edges are looked at, at most: beyond that bounding boxes stand for polygons.
const PAIRS: usize = 4_096;

/// Of a polygon with more edges than this the bounding box stands for it where a point asks.
const EDGES: usize = 48;

/// Two ends.
pub(crate) type Segment = (Point2<f64>, Point2<f64>);

/// The distance between two segments, each of which may be a point.
pub(crate) fn segment_distance((a, b): Segment, (c, d): Segment) -> f64 {
    let orient = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q - p).perp(&(r - p));
    let crosses =
        orient(a, b, c) * orient(a, b, d) < 0.0 && orient(c, d, a) * orient(c, d, b) < 0.0;
    if crosses {
        return 0.0;
    }
    to_segment(a, (c, d))
        .min(to_segment(b, (c, d)))
        .min(to_segment(c, (a, b)))
        .min(to_segment(d, (a, b)))
}

fn to_segment(p: Point2<f64>, (a, b): Segment) -> f64 {
    let (along, off) = (b - a, p - a);
    let square = along.norm_squared();
    let t = if square > 0.0 {
        (off.dot(&along) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (off - along * t).norm()
}

impl Polygon {
    /// At most the distance of a point, which is 0 inside; of a polygon of few edges the distance itself.
    pub(crate) fn least_distance(&self, p: Point2<f64>) -> f64 {
        let gap = |axis: usize| (self.min()[axis] - p[axis]).max(p[axis] - self.max()[axis]);
        let gaps = [gap(0).max(0.0), gap(1).max(0.0)];
        let to_box = gaps[0].hypot(gaps[1]);
        if self.vertices().len() > EDGES || self.side_of(p, 0.0) != Side::Outside {
            return to_box;
        }
        let to_edges = self.edges().map(|edge| to_segment(p, edge));
        to_edges.fold(f64::INFINITY, f64::min)
    }

    /// At most the distance of another polygon, which is 0 where they meet; of polygons of few edges the distance itself.
    pub(crate) fn least_distance_to(&self, other: &Self) -> f64 {
        let gaps = self.gaps(other);
        let many = self.vertices().len() * other.vertices().len() > PAIRS;
        let overlap = gaps[0].max(gaps[1]) <= 0.0;
        if many || overlap && self.holds_or_is_held(other, 0.0) {
            return gaps[0].max(0.0).hypot(gaps[1].max(0.0));
        }
        let pairs = self
            .edges()
            .flat_map(|e| other.edges().map(move |f| segment_distance(e, f)));
        pairs.fold(f64::INFINITY, f64::min)
    }

    /// Whether another polygon is further away than `margin`.
    pub(crate) fn is_apart_from(&self, other: &Self, margin: f64) -> bool {
        let [x, y] = self.gaps(other);
        let mut edges = self.edges();
        x.max(y) > margin
            || !self.holds_or_is_held(other, margin)
                && edges.all(|e| other.edges().all(|f| segment_distance(e, f) > margin))
    }

    /// How far the bounding boxes are apart along each axis; negative where they overlap.
    fn gaps(&self, other: &Self) -> [f64; 2] {
        let gap = |a: &Self, b: &Self, axis: usize| b.min()[axis] - a.max()[axis];
        [0, 1].map(|axis| gap(self, other, axis).max(gap(other, self, axis)))
    }

    /// Whether one of two polygons whose borders do not cross holds the other, up to a tolerance.
    fn holds_or_is_held(&self, other: &Self, tolerance: f64) -> bool {
        let holds = |a: &Self, b: &Self| a.side_of(b.vertices()[0], tolerance) != Side::Outside;
        holds(self, other) || holds(other, self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{generator, unit};

    /// Distances by dense points on borders agree, and never fall below.
    #[test]
    fn distances_agree_with_points_along_borders() {
        let mut random = generator(5, 0);
        for case in 0..200 {
            let corners = 3 + case % 6;
            let mut star = |x: f64, y: f64| {
                let vertices = (0..corners).map(|i| {
                    let angle = (i as f64 + 0.8 * unit(&mut random)) / corners as f64
                        * std::f64::consts::TAU;
                    let radius = 0.3 + unit(&mut random);
                    Point2::new(x + radius * angle.cos(), y + radius * angle.sin())
                });
                Polygon::new(vertices.collect()).expect("a star is simple")
            };
            let (a, b) = (star(0.0, 0.0), star(f64::from(case as u8) / 50.0, 0.5));
            let p = Point2::new(3.0 * unit(&mut random) - 1.0, 3.0 * unit(&mut random) - 1.0);
            let along = |polygon: &Polygon| {
                let edges: Vec<_> = polygon.edges().collect();
                let points = edges
                    .into_iter()
                    .flat_map(|(a, b)| (0..400).map(move |t| a + (b - a) * (f64::from(t) / 400.0)));
                points.collect::<Vec<_>>()
            };
            let least = |from: &[Point2<f64>], to: &[Point2<f64>]| {
                let pairs = from
                    .iter()
                    .flat_map(|a| to.iter().map(move |b| (a - b).norm()));
                pairs.fold(f64::INFINITY, f64::min)
            };
            let inside = |q: &Polygon, p: Point2<f64>| q.side_of(p, 0.0) != Side::Outside;
            let scan = if inside(&a, p) {
                0.0
            } else {
                least(&[p], &along(&a))
            };
            let found = a.least_distance(p);
            assert!(
                found <= scan + 1e-12 && scan <= found + 0.01,
                "{found} {scan}"
            );
            let (of_a, of_b) = (along(&a), along(&b));
            let meet = of_a.iter().any(|&p| inside(&b, p)) || of_b.iter().any(|&p| inside(&a, p));
            let scan = if meet { 0.0 } else { least(&of_a, &of_b) };
            let found = a.least_distance_to(&b);
            assert!(
                found <= scan + 1e-12 && scan <= found + 0.02,
                "{found} {scan}"
            );
            if found > 0.0 {
                assert!(a.is_apart_from(&b, 0.999 * found));
            }
            assert!(!a.is_apart_from(&b, 1.001 * found));
        }
    }
}
