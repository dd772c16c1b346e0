//! Simple polygons, and where a point lies with respect to one.

use nalgebra::Point2;

use super::MAX_COORDINATE;
use crate::number::Brief;

/// Where a point lies with respect to an open polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In the interior, further than the tolerance from the border.
    Inside,
    /// Within the tolerance of the border.
    Boundary,
    /// Outside, further than the tolerance from the border.
    Outside,
}

/// Why a list of points is not a simple polygon.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PolygonError {
    /// A coordinate is too large.
    #[error(
        "vertex {index} is ({}, {}): coordinates must lie within ±{max:e}", Brief(*x), Brief(*y),
        max = super::MAX_COORDINATE
    )]
    TooFar {
        /// The vertex, counted from 0.
        index: usize,
        /// Its x coordinate.
        x: f64,
        /// Its y coordinate.
        y: f64,
    },
    /// Fewer than three different vertices.
    #[error("a polygon needs at least 3 different vertices, found {0}")]
    TooFewVertices(usize),
    /// A coordinate is NaN or infinite.
    #[error("vertex {index} is ({x}, {y}): coordinates must be finite numbers")]
    NotFinite {
        /// The vertex, counted from 0.
        index: usize,
        /// Its x coordinate.
        x: f64,
        /// Its y coordinate.
        y: f64,
    },
    /// Two edges that are not neighbours meet.
    #[error(
        "the polygon crosses or touches itself: edge {first} (from vertex {first}) meets edge {second} near ({x}, {y}); list the vertices in order along the border"
    )]
    SelfIntersecting {
        /// The lower-numbered edge.
        first: usize,
        /// The other edge.
        second: usize,
        /// Where they meet, x.
        x: f64,
        /// Where they meet, y.
        y: f64,
    },
    /// All vertices lie on a line.
    #[error("the polygon has no area: its vertices lie on one line")]
    NoArea,
}

/// A simple polygon, convex or not, with its vertices in counter-clockwise order.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    vertices: Vec<Point2<f64>>,
    min: Point2<f64>,
    max: Point2<f64>,
}

impl Polygon {
    /// Makes a polygon from its vertices in order along the border, either way round. A closing
    /// vertex that repeats the first, and immediate repetitions, are dropped.
    ///
    /// # Errors
    /// Non-finite coordinates, fewer than three different vertices, no area, or a border that
    /// meets itself.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use nngtl::workspace::Polygon;
    /// let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)];
    /// let triangle = Polygon::new(corners.map(|(x, y)| Point2::new(x, y)).to_vec())?;
    /// assert_eq!(triangle.area(), 0.5);
    /// # Ok::<(), nngtl::workspace::PolygonError>(())
    /// ```
    pub fn new(mut vertices: Vec<Point2<f64>>) -> Result<Self, PolygonError> {
        for (index, v) in vertices.iter().enumerate() {
            if !(v.x.is_finite() && v.y.is_finite()) {
                let (x, y) = (v.x, v.y);
                return Err(PolygonError::NotFinite { index, x, y });
            }
            if v.x.abs().max(v.y.abs()) > MAX_COORDINATE {
                let (x, y) = (v.x, v.y);
                return Err(PolygonError::TooFar { index, x, y });
            }
        }
        vertices.dedup();
        while vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        if vertices.len() < 3 {
            return Err(PolygonError::TooFewVertices(vertices.len()));
        }
        check_simple(&vertices)?;
        let area = signed_area(&vertices);
        let (min, max) = extent(&vertices);
        if area.abs() <= f64::EPSILON * (max - min).norm_squared() {
            return Err(PolygonError::NoArea);
        }
        if area < 0.0 {
            vertices.reverse();
        }
        Ok(Self { vertices, min, max })
    }

    /// The axis-parallel rectangle between two corners.
    ///
    /// # Errors
    /// As [`Polygon::new`], for corners that share a coordinate or are not finite.
    pub fn rectangle(a: Point2<f64>, b: Point2<f64>) -> Result<Self, PolygonError> {
        Self::new(vec![a, Point2::new(b.x, a.y), b, Point2::new(a.x, b.y)])
    }

    /// The vertices, counter-clockwise.
    #[must_use]
    pub fn vertices(&self) -> &[Point2<f64>] {
        &self.vertices
    }

    /// The area, in squared map units; positive.
    #[must_use]
    pub fn area(&self) -> f64 {
        signed_area(&self.vertices)
    }

    /// The edges, counter-clockwise, the last one closing.
    pub fn edges(&self) -> impl Iterator<Item = (Point2<f64>, Point2<f64>)> + '_ {
        let n = self.vertices.len();
        (0..n).map(move |i| (self.vertices[i], self.vertices[(i + 1) % n]))
    }

    /// The corner of the bounding box with the lowest coordinates.
    #[must_use]
    pub fn min(&self) -> Point2<f64> {
        self.min
    }

    /// The corner of the bounding box with the highest coordinates.
    #[must_use]
    pub fn max(&self) -> Point2<f64> {
        self.max
    }

    /// Where `p` lies, with everything within `tolerance` (map units) of the border on it.
    #[must_use]
    pub fn side_of(&self, p: Point2<f64>, tolerance: f64) -> Side {
        if self.is_beyond(p, tolerance) {
            return Side::Outside;
        }
        let n = self.vertices.len();
        let before = |i: usize| self.vertices[if i == 0 { n - 1 } else { i - 1 }];
        let edges = (0..n).map(|i| (before(i), self.vertices[i]));
        side_of_edges(edges, p, tolerance)
    }

    /// Whether `p` lies further than the tolerance outside the bounding box.
    pub(super) fn is_beyond(&self, p: Point2<f64>, tolerance: f64) -> bool {
        p.x < self.min.x - tolerance
            || p.y < self.min.y - tolerance
            || p.x > self.max.x + tolerance
            || p.y > self.max.y + tolerance
    }
}

/// Where `p` lies by the edges that a ray from it towards larger x may meet, and those near it.
pub(super) fn side_of_edges(
    edges: impl Iterator<Item = (Point2<f64>, Point2<f64>)>,
    p: Point2<f64>,
    tolerance: f64,
) -> Side {
    let mut inside = false;
    for (a, b) in edges {
        if near_edge(p, a, b, tolerance) {
            return Side::Boundary;
        }
        // Half-open rule on y, so that a ray through a vertex counts it once.
        if (a.y > p.y) != (b.y > p.y) {
            let x = a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x);
            inside ^= p.x < x;
        }
    }
    if inside { Side::Inside } else { Side::Outside }
}

/// Whether `p` lies within `tolerance` of the segment `ab`.
fn near_edge(p: Point2<f64>, a: Point2<f64>, b: Point2<f64>, tolerance: f64) -> bool {
    let (edge, to_p) = (b - a, p - a);
    let t = (to_p.dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
    (to_p - edge * t).norm_squared() <= tolerance * tolerance
}

/// Twice-counted shoelace area ÷ 2, positive when counter-clockwise; relative to the first vertex,
/// so that large offsets do not cancel.
fn signed_area(vertices: &[Point2<f64>]) -> f64 {
    let origin = vertices[0];
    let cross = |w: &[Point2<f64>]| (w[0] - origin).perp(&(w[1] - origin));
    vertices.windows(2).map(cross).sum::<f64>() / 2.0
}

fn extent(vertices: &[Point2<f64>]) -> (Point2<f64>, Point2<f64>) {
    let start = (vertices[0], vertices[0]);
    vertices
        .iter()
        .fold(start, |(min, max), v| (min.inf(v), max.sup(v)))
}

/// Refuses borders whose non-neighbouring edges meet. A sweep over x keeps it near n·log n for
/// the long borders of real maps.
fn check_simple(vertices: &[Point2<f64>]) -> Result<(), PolygonError> {
    let n = vertices.len();
    let edge = |i: usize| (vertices[i], vertices[(i + 1) % n]);
    let low = |i: usize| edge(i).0.x.min(edge(i).1.x);
    let high = |i: usize| edge(i).0.x.max(edge(i).1.x);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| low(i).total_cmp(&low(j)));
    let mut active: Vec<usize> = Vec::new();
    for &i in &order {
        active.retain(|&j| high(j) >= low(i));
        for &j in &active {
            let (first, second) = (i.min(j), i.max(j));
            let neighbours = second == first + 1 || (first == 0 && second == n - 1);
            let at = if neighbours {
                folds_back(vertices, if second == first + 1 { second } else { first })
            } else {
                meeting_point(edge(first), edge(second))
            };
            if let Some(p) = at {
                return Err(PolygonError::SelfIntersecting {
                    first,
                    second,
                    x: p.x,
                    y: p.y,
                });
            }
        }
        active.push(i);
    }
    Ok(())
}

/// Whether the border turns back on itself by 180° at vertex `i`.
fn folds_back(vertices: &[Point2<f64>], i: usize) -> Option<Point2<f64>> {
    let n = vertices.len();
    let v = vertices[i];
    let (into, out) = (v - vertices[(i + n - 1) % n], vertices[(i + 1) % n] - v);
    (into.perp(&out) == 0.0 && into.dot(&out) < 0.0).then_some(v)
}

/// Whether two closed segments share a point.
pub(crate) fn segments_meet(a: [Point2<f64>; 2], b: [Point2<f64>; 2]) -> bool {
    meeting_point((a[0], a[1]), (b[0], b[1])).is_some()
}

/// A point that two closed segments share, if any.
fn meeting_point(
    (a, b): (Point2<f64>, Point2<f64>),
    (c, d): (Point2<f64>, Point2<f64>),
) -> Option<Point2<f64>> {
    let orient = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q - p).perp(&(r - p));
    let on = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| {
        orient(p, q, r) == 0.0 && (r - p).dot(&(r - q)) <= 0.0
    };
    for (p, q, r) in [(a, b, c), (a, b, d), (c, d, a), (c, d, b)] {
        if on(p, q, r) {
            return Some(r);
        }
    }
    let (s, t) = (orient(a, b, c), orient(a, b, d));
    let (u, v) = (orient(c, d, a), orient(c, d, b));
    let crosses = (s > 0.0) != (t > 0.0) && (u > 0.0) != (v > 0.0) && s != t;
    crosses.then(|| c + (d - c) * (s / (s - t)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[(f64, f64)]) -> Result<Polygon, PolygonError> {
        Polygon::new(points.iter().map(|&(x, y)| Point2::new(x, y)).collect())
    }

    #[test]
    fn orientation_and_repeats_are_normalised() {
        let p = polygon(&[(0., 0.), (0., 1.), (1., 1.), (1., 1.), (1., 0.), (0., 0.)]).unwrap();
        assert_eq!(p.vertices().len(), 4);
        assert!((p.area() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn sides_of_a_concave_polygon() {
        let p = polygon(&[(0., 0.), (2., 0.), (2., 2.), (1., 1.), (0., 2.)]).unwrap();
        let side = |x, y| p.side_of(Point2::new(x, y), 1e-9);
        assert_eq!(side(0.5, 0.5), Side::Inside);
        assert_eq!(side(1.0, 1.5), Side::Outside);
        assert_eq!(side(1.0, 1.0), Side::Boundary);
        assert_eq!(side(1.0, 0.5), Side::Inside);
        assert_eq!(side(-1.0, 1.0), Side::Outside);
        assert_eq!(side(1.0, 0.0), Side::Boundary);
    }

    #[test]
    fn bad_polygons_are_refused_with_the_reason() {
        assert!(matches!(
            polygon(&[(0., 0.), (1., 1.), (1., 0.), (0., 1.)]),
            Err(PolygonError::SelfIntersecting {
                first: 0,
                second: 2,
                ..
            })
        ));
        assert!(matches!(
            polygon(&[(0., 0.), (1., 0.), (2., 0.)]),
            Err(PolygonError::SelfIntersecting { .. } | PolygonError::NoArea)
        ));
        assert!(matches!(
            polygon(&[(0., 0.), (f64::NAN, 0.), (2., 0.)]),
            Err(PolygonError::NotFinite { index: 1, .. })
        ));
        assert!(matches!(
            polygon(&[(0., 0.), (1., 0.), (0., 0.)]),
            Err(PolygonError::TooFewVertices(2))
        ));
        // A spike, and a border that touches itself at a vertex.
        assert!(polygon(&[(0., 0.), (2., 0.), (1., 0.), (1., 1.)]).is_err());
        assert!(polygon(&[(0., 0.), (2., 0.), (2., 2.), (1., 0.), (0., 2.)]).is_err());
    }
}
