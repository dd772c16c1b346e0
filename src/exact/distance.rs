//! How far pieces of borders and whole polygons are from each other.

use crate::workspace::{Polygon, Side, segment_distance};

/// What borders are resolved to lets a path cut corners by about so much, as a share of the map's
/// longer side; the bound is lowered by it.
pub(super) const RESOLUTION: f64 = 1e-6;

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
