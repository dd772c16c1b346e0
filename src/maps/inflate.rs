//! Obstacles grown by the robot's radius, so that the robot can be planned for as a point.

use geo::buffer::{BufferStyle, LineJoin};
use geo::{Buffer, Coord, LineString, MultiPolygon};
use nalgebra::Point2;

use super::outline::Rings;

/// The angle that one straight piece of a rounded corner spans at most half of: on maps of few corners, so that a robot fits through
/// doors that are hardly wider than it is, and on others.
const ARCS: [f64; 2] = [std::f64::consts::PI / 48.0, std::f64::consts::PI / 12.0];

/// Maps have few corners up to so many.
const FEW: usize = 2_000;

/// Polygons with holes grown by `radius`, united. Corners become round, in straight pieces that
/// run outside the circle: nothing closer than `radius` to an obstacle is free, and everything
/// further than 1.0022 times that is (on maps of more than 2,000 corners 1.036 times).
#[must_use]
pub fn inflate(polygons: &[Rings], radius: f64) -> Vec<Rings> {
    let corners: usize = polygons.iter().flatten().map(Vec::len).sum();
    let arc = ARCS[usize::from(corners > FEW)];
    // Pieces between points of a circle dip into it by up to cos(arc); rounding by far less.
    let reach = radius / libm::cos(arc) * (1.0 + 1e-9);
    let style = BufferStyle::new(reach).line_join(LineJoin::Round(arc));
    let line = |ring: &Vec<Point2<f64>>| {
        LineString::new(ring.iter().map(|p| Coord { x: p.x, y: p.y }).collect())
    };
    let polygons = polygons.iter().filter(|rings| !rings.is_empty());
    let grown: Vec<geo::Polygon<f64>> = polygons
        .flat_map(|rings| {
            let holes = rings[1..].iter().map(line).collect();
            let polygon = geo::Polygon::new(line(&rings[0]), holes);
            polygon.buffer_with_style(style.clone()).0
        })
        .collect();
    let united: MultiPolygon<f64> = geo::unary_union(&grown);
    let ring = |line: &LineString<f64>| -> Vec<Point2<f64>> {
        let open = line.0.len().saturating_sub(1);
        line.0[..open]
            .iter()
            .map(|c| Point2::new(c.x, c.y))
            .collect()
    };
    united
        .iter()
        .map(|p| {
            let rings = std::iter::once(p.exterior()).chain(p.interiors());
            rings.map(ring).collect()
        })
        .collect()
}
