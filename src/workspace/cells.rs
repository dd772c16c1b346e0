//! The free space cut into cells of one letter each, by polygon booleans.

use geo::{
    Area, BooleanOps, BoundingRect, Centroid, Coord, Euclidean, InteriorPoint, Length, LineString,
};
use geo::{MultiPolygon, TriangulateEarcut};
use nalgebra::{Point2, Vector2};

use super::mesh::cut;
use super::{Bounds, Polygon, Region};
use crate::alphabet::Props;
use crate::random::{Random, unit};

/// Parts of less area than this share of the map's side times their outline's length, half their width if they are long, are rounding of
/// the booleans, which work to some 1e-9 of the side, and not space.
const MIN_WIDTH: f64 = 1e-8;

/// No more corners of a cell than this are singled out.
const MAX_CORNERS: usize = 16;

/// How far inside the cell the places at its corners lie: this share of the way to the centre of a triangle there.
const INWARD: f64 = 0.02;

/// Cells with more holes are cut by Delaunay's triangulation, as clipping ears takes time that grows with the square of their number:
/// seconds for ten thousand.
const MANY_HOLES: usize = 64;

/// A connected part of the free space that carries one letter.
#[derive(Clone, Debug)]
pub struct Cell {
    outline: Vec<Vec<Point2<f64>>>,
    triangles: Vec<[Point2<f64>; 3]>,
    /// Running sums of the triangles' areas.
    areas: Vec<f64>,
    inner: Point2<f64>,
}

impl Cell {
    pub(super) fn new(part: geo::Polygon<f64>, inner: Point2<f64>) -> Self {
        let ring = |r: &LineString<f64>| -> Vec<Point2<f64>> {
            r.0[..r.0.len().saturating_sub(1)]
                .iter()
                .map(point)
                .collect()
        };
        let outline: Vec<Vec<Point2<f64>>> = std::iter::once(part.exterior())
            .chain(part.interiors())
            .map(ring)
            .collect();
        let triangles = triangles(&part, &outline);
        let mut sum = 0.0;
        let areas = triangles
            .iter()
            .map(|[a, b, c]| {
                sum += (b - a).perp(&(c - a)).abs() / 2.0;
                sum
            })
            .collect();
        Self {
            outline,
            triangles,
            areas,
            inner,
        }
    }

    /// The area, in squared map units.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.areas.last().copied().unwrap_or(0.0)
    }

    /// A fixed point inside: the centroid where that lies inside.
    #[must_use]
    pub fn inner_point(&self) -> Point2<f64> {
        self.inner
    }

    /// How many of the outer corners are singled out: all where there are few.
    pub(crate) fn corner_count(&self) -> usize {
        let corners = self.outline.first().map_or(0, Vec::len);
        corners.div_ceil(Self::corners_apart(corners))
    }

    /// A place in the cell close to one of these corners.
    pub(crate) fn corner(&self, k: usize) -> Option<Point2<f64>> {
        let ring = self.outline.first()?;
        let corner = *ring.get(k * Self::corners_apart(ring.len()))?;
        let around = self.triangles.iter().find(|t| t.contains(&corner))?;
        let centre = around
            .iter()
            .fold(Vector2::zeros(), |sum, v| sum + v.coords)
            / 3.0;
        Some(corner + (centre - corner.coords) * INWARD)
    }

    fn corners_apart(corners: usize) -> usize {
        corners.div_ceil(MAX_CORNERS).max(1)
    }

    /// The border: first the outer ring, then holes; without closing repetitions.
    #[must_use]
    pub fn outline(&self) -> &[Vec<Point2<f64>>] {
        &self.outline
    }

    /// Whether `p` lies in the cell, up to the rounding of its triangulation.
    #[must_use]
    pub fn contains(&self, p: Point2<f64>) -> bool {
        self.triangles.iter().any(|[a, b, c]| {
            let slack = 1e-9 * (b - a).perp(&(c - a)).abs();
            let sides = [
                (b - a).perp(&(p - a)),
                (c - b).perp(&(p - b)),
                (a - c).perp(&(p - c)),
            ];
            sides.iter().all(|&s| s >= -slack) || sides.iter().all(|&s| s <= slack)
        })
    }

    /// A point uniform over the cell.
    pub(super) fn sample(&self, random: &mut Random) -> Point2<f64> {
        let goal = unit(random) * self.area();
        let i = self.areas.partition_point(|&a| a <= goal);
        let Some([a, b, c]) = self.triangles.get(i) else {
            return self.inner;
        };
        // Uniform over a triangle: fold the unit square along its diagonal.
        let (mut u, mut v) = (unit(random), unit(random));
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        a + (b - a) * u + (c - a) * v
    }
}

fn point(c: &Coord<f64>) -> Point2<f64> {
    Point2::new(c.x, c.y)
}

/// Cuts a cell with these rings into triangles.
fn triangles(part: &geo::Polygon<f64>, rings: &[Vec<Point2<f64>>]) -> Vec<[Point2<f64>; 3]> {
    if part.interiors().len() > MANY_HOLES {
        let found = cut(rings);
        let area = |[a, b, c]: &[Point2<f64>; 3]| (b - a).perp(&(c - a)).abs() / 2.0;
        let (sum, whole) = (found.iter().map(area).sum::<f64>(), part.unsigned_area());
        // Holes that touch in ways that leave inside and outside open are for the other method.
        if (sum - whole).abs() <= 1e-6 * whole {
            return found;
        }
    }
    let triangles = part.earcut_triangles();
    triangles
        .iter()
        .map(|t| t.to_array().map(|c| point(&c)))
        .collect()
}

/// Cuts the free space into connected parts by the set of regions that contain them.
pub(super) fn decompose(
    bounds: &Bounds,
    obstacles: &[Polygon],
    regions: &[Region],
) -> Vec<(Props, geo::Polygon<f64>)> {
    let frame = geo::Rect::new(
        Coord {
            x: bounds.min.x,
            y: bounds.min.y,
        },
        Coord {
            x: bounds.max.x,
            y: bounds.max.y,
        },
    )
    .to_polygon();
    let solid: Vec<geo::Polygon<f64>> = obstacles.iter().map(to_geo).collect();
    let free = if solid.is_empty() {
        MultiPolygon::new(vec![frame])
    } else {
        frame.difference(&geo::unary_union(&solid))
    };
    let least = MIN_WIDTH * bounds.side();
    let is_space = |part: &geo::Polygon<f64>| {
        let rings = std::iter::once(part.exterior()).chain(part.interiors());
        let outline: f64 = rings.map(|ring| Euclidean.length(ring)).sum();
        part.unsigned_area() > least * outline
    };
    let mut parts = vec![(Props::EMPTY, free)];
    for (i, region) in regions.iter().enumerate() {
        let polygon = to_geo(&region.polygon);
        let mut next = Vec::with_capacity(parts.len() + 1);
        for (props, part) in parts {
            if apart(&part, &polygon) {
                next.push((props, part));
                continue;
            }
            next.push((props.with(i), part.intersection(&polygon)));
            next.push((props, part.difference(&polygon)));
        }
        for (_, part) in &mut next {
            part.0.retain(is_space);
        }
        next.retain(|(_, part)| !part.0.is_empty());
        parts = next;
    }
    parts
        .into_iter()
        .flat_map(|(props, part)| part.0.into_iter().map(move |p| (props, p)))
        .filter(|(_, p)| is_space(p))
        .collect()
}

/// Where exactly the regions of `wanted` sets hold, whether or not obstacles are there: polygons without holes that share
/// borders at most.
pub(super) fn area_of(
    bounds: &Bounds,
    regions: &[Region],
    wanted: impl Fn(Props) -> bool,
) -> Vec<Polygon> {
    let parts = decompose(bounds, &[], regions).into_iter();
    let parts: Vec<_> = parts.filter(|p| wanted(p.0)).map(|p| p.1).collect();
    // As one area: no hairline is left between parts that border on each other.
    let whole = match parts.len() {
        0 | 1 => MultiPolygon::new(parts),
        _ => geo::unary_union(&parts),
    };
    let mut polygons = Vec::new();
    for part in &whole {
        let mut add = |ring: &[Coord<f64>]| {
            let ring = ring.iter().map(|c| Point2::new(c.x, c.y)).collect();
            polygons.extend(Polygon::new(ring)); // slivers without area are none
        };
        if part.interiors().is_empty() {
            add(&part.exterior().0);
        } else {
            let triangles = part.earcut_triangles();
            triangles.iter().for_each(|t| add(&t.to_array()));
        }
    }
    polygons
}

/// Points that are likely to lie inside `part`, the best first.
pub(super) fn inner_points(part: &geo::Polygon<f64>) -> Vec<Point2<f64>> {
    [part.centroid(), part.interior_point()]
        .into_iter()
        .flatten()
        .map(|p| Point2::new(p.x(), p.y()))
        .collect()
}

fn apart(part: &MultiPolygon<f64>, polygon: &geo::Polygon<f64>) -> bool {
    match (part.bounding_rect(), polygon.bounding_rect()) {
        (Some(a), Some(b)) => {
            a.min().x > b.max().x
                || a.max().x < b.min().x
                || a.min().y > b.max().y
                || a.max().y < b.min().y
        }
        _ => true,
    }
}

fn to_geo(polygon: &Polygon) -> geo::Polygon<f64> {
    let coords = polygon.vertices().iter().map(|p| Coord { x: p.x, y: p.y });
    geo::Polygon::new(LineString::new(coords.collect()), vec![])
}
