//! Random shapes, and whether two of them keep a distance.

use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};
use rand::RngExt;

use super::maps::{any_angle, direction};
use crate::random::Random;
use crate::workspace::{Polygon, Side};

type Points = Vec<Point2<f64>>;

/// An axis-parallel rectangle whose half diagonal is about `radius`.
pub(super) fn rectangle(centre: Point2<f64>, radius: f64, random: &mut Random) -> Points {
    let (w, h) = half_extents(radius, random);
    framed(centre, Vector2::new(w, 0.0), Vector2::new(0.0, h))
}

/// A rectangle at any angle.
pub(super) fn turned_rectangle(centre: Point2<f64>, radius: f64, random: &mut Random) -> Points {
    let (w, h) = half_extents(radius, random);
    let along = direction(any_angle(random));
    framed(centre, along * w, Vector2::new(-along.y, along.x) * h)
}

/// A convex polygon of 3 to 8 vertices on a stretched circle.
pub(super) fn convex(centre: Point2<f64>, radius: f64, random: &mut Random) -> Points {
    let count = random.random_range(3..=8);
    let (turn, tilt) = (any_angle(random), any_angle(random));
    let (long, across) = (direction(tilt), direction(tilt + TAU / 4.0));
    let flat = random.random_range(0.6..1.0);
    (0..count)
        .map(|k| {
            let jitter: f64 = random.random_range(-0.3..0.3);
            let p = direction(turn + (f64::from(k) + jitter) / f64::from(count) * TAU);
            centre + long * (p.x * radius) + across * (p.y * radius * flat)
        })
        .collect()
}

/// A star-shaped polygon of 5 to 9 vertices, as a rule not convex.
pub(super) fn jagged(centre: Point2<f64>, radius: f64, random: &mut Random) -> Points {
    let count = random.random_range(5..=9);
    let turn = any_angle(random);
    (0..count)
        .map(|k| {
            let reach = radius * random.random_range(0.45..1.1);
            let jitter: f64 = random.random_range(-0.25..0.25);
            centre + direction(turn + (f64::from(k) + jitter) / f64::from(count) * TAU) * reach
        })
        .collect()
}

/// An L of two arms at any right-angled orientation.
pub(super) fn angle(centre: Point2<f64>, radius: f64, random: &mut Random) -> Points {
    let (w, h) = half_extents(radius * 1.2, random);
    let (thick_w, thick_h) = (
        2.0 * w * random.random_range(0.3..0.6),
        2.0 * h * random.random_range(0.3..0.6),
    );
    let quarter = f64::from(random.random_range(0..4)) * TAU / 4.0;
    let (along, across) = (direction(quarter), direction(quarter + TAU / 4.0));
    [
        (-w, -h),
        (w, -h),
        (w, -h + thick_h),
        (-w + thick_w, -h + thick_h),
        (-w + thick_w, h),
        (-w, h),
    ]
    .map(|(x, y)| centre + along * x + across * y)
    .to_vec()
}

/// Whether two polygons are at least `margin` apart and neither is inside the other.
pub(super) fn are_apart(a: &Polygon, b: &Polygon, margin: f64) -> bool {
    let boxes_apart = a.max().x + margin < b.min().x
        || a.max().y + margin < b.min().y
        || b.max().x + margin < a.min().x
        || b.max().y + margin < a.min().y;
    if boxes_apart {
        return true;
    }
    let holds =
        |outer: &Polygon, inner: &Polygon| outer.side_of(inner.vertices()[0], 0.0) != Side::Outside;
    if holds(a, b) || holds(b, a) {
        return false;
    }
    a.edges().all(|e| {
        b.edges()
            .all(|f| !cross(e, f) && edge_distance(e, f) >= margin)
    })
}

type Segment = (Point2<f64>, Point2<f64>);

fn cross((a, b): Segment, (c, d): Segment) -> bool {
    let side = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q - p).perp(&(r - p)) > 0.0;
    side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b)
}

/// The distance of two segments that do not cross: from an end of one to the other.
fn edge_distance(e: Segment, f: Segment) -> f64 {
    let to = |p: Point2<f64>, (a, b): Segment| {
        let d = b - a;
        let t = ((p - a).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
        (p - (a + d * t)).norm()
    };
    to(e.0, f).min(to(e.1, f)).min(to(f.0, e)).min(to(f.1, e))
}

fn half_extents(radius: f64, random: &mut Random) -> (f64, f64) {
    (
        radius * random.random_range(0.45..1.0),
        radius * random.random_range(0.45..1.0),
    )
}

fn framed(centre: Point2<f64>, u: Vector2<f64>, v: Vector2<f64>) -> Points {
    vec![
        centre - u - v,
        centre + u - v,
        centre + u + v,
        centre - u + v,
    ]
}
