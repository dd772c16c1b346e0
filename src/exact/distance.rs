//! How far pieces of borders and whole polygons are from each other.

use nalgebra::Point2;

use crate::workspace::{Polygon, Side};

/// What borders are resolved to lets a path cut corners by about so much, as a share of the map's
/// longer side; the bound is lowered by it.
pub(super) const RESOLUTION: f64 = 1e-6;

pub(super) type Segment = (Point2<f64>, Point2<f64>);

/// The distance between two segments, each of which may be a point.
pub(super) fn segment_distance((a, b): Segment, (c, d): Segment) -> f64 {
    let orient = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q - p).perp(&(r - p));
    let crosses =
        orient(a, b, c) * orient(a, b, d) < 0.0 && orient(c, d, a) * orient(c, d, b) < 0.0;
    if crosses {
        return 0.0;
    }
    let to = |p: Point2<f64>, (a, b): Segment| {
        let (along, off) = (b - a, p - a);
        let square = along.norm_squared();
        let t = if square > 0.0 {
            (off.dot(&along) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (off - along * t).norm()
    };
    to(a, (c, d))
        .min(to(b, (c, d)))
        .min(to(c, (a, b)))
        .min(to(d, (a, b)))
}

/// Whether two polygons are further apart than `margin`.
pub(super) fn are_apart(p: &Polygon, q: &Polygon, margin: f64) -> bool {
    let gap = |a: &Polygon, b: &Polygon| (b.min().x - a.max().x).max(b.min().y - a.max().y);
    if gap(p, q).max(gap(q, p)) > margin {
        return true;
    }
    let inside = |a: &Polygon, b: &Polygon| b.side_of(a.vertices()[0], margin) != Side::Outside;
    !inside(p, q)
        && !inside(q, p)
        && p.edges()
            .all(|e| q.edges().all(|f| segment_distance(e, f) > margin))
}
