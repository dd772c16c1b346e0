//! Taut strings, and points where legs meet.

use nalgebra::Point2;
use smallvec::SmallVec;

/// Points in a row; mostly few, so that they need no memory of their own.
pub(super) type Line = SmallVec<[Point2<f64>; 8]>;

/// Rounds of [`star_point`]: it is flat around the best place.
const ROUNDS: usize = 60;

/// The points between `a` and `b` of the string from `a` by `at` to `b` once it is pulled taut around
/// `corners`: the shortest path that can be reached by moving the string within the triangle. `a at`
/// and `at b` must be free; then whatever stands in the way of `ab` reaches into the triangle across
/// `ab` or lies in it, so that the hull of the corners in the triangle clears it.
pub(super) fn taut(
    a: Point2<f64>,
    at: Point2<f64>,
    b: Point2<f64>,
    corners: &[Point2<f64>],
) -> Line {
    let area = (b - a).perp(&(at - a));
    if area == 0.0 {
        return Line::new();
    }
    let side = area.signum();
    // How far to the side of `at` a point lies from the line `pq`, times the length of `pq`.
    let above = |p: Point2<f64>, q: Point2<f64>, c: Point2<f64>| side * (q - p).perp(&(c - p));
    let (low, high) = (a.inf(&b).inf(&at), a.sup(&b).sup(&at));
    let slack = 1e-12 * area.abs();
    let inside = |c: &&Point2<f64>| {
        c.x >= low.x
            && c.y >= low.y
            && c.x <= high.x
            && c.y <= high.y
            && above(a, b, **c) > slack
            && above(a, at, **c) <= slack
            && above(at, b, **c) <= slack
    };
    let mut left: Line = corners.iter().filter(inside).copied().collect();
    left.retain(|&mut c| c != a && c != b);
    // Gift wrapping on the side of `at`.
    let mut found = Line::new();
    let mut p = a;
    while !left.is_empty() {
        let mut next = b;
        for &c in &left {
            let turn = above(p, next, c);
            if turn > 0.0 || turn == 0.0 && (c - p).norm_squared() > (next - p).norm_squared() {
                next = c;
            }
        }
        if next == b {
            break;
        }
        found.push(next);
        left.retain(|&mut c| c != next);
        p = next;
    }
    found
}

/// The point of the segment `ab` where the way from `from` to `to` by it is shortest: where a straight way crosses the
/// segment once `to` is folded over to the other side (Hero of Alexandria, *Catoptrica*). `None` if both lie on
/// the segment's line.
pub(super) fn mirror(
    a: Point2<f64>,
    b: Point2<f64>,
    from: Point2<f64>,
    to: Point2<f64>,
) -> Option<Point2<f64>> {
    let along = b - a;
    let off = |p: Point2<f64>| along.perp(&(p - a)).abs();
    let t = |p: Point2<f64>| along.dot(&(p - a)) / along.norm_squared();
    let (here, there) = (off(from), off(to));
    let sum = here + there;
    if sum <= 1e-12 * along.norm_squared() {
        return None;
    }
    let t = (t(from) * there + t(to) * here) / sum;
    Some(a + along * t.clamp(0.0, 1.0))
}

/// The point of the segment `ab` where a convex function is least, by golden-section search, and
/// its value.
pub(super) fn least(
    mut a: Point2<f64>,
    mut b: Point2<f64>,
    f: &impl Fn(Point2<f64>) -> f64,
) -> (f64, Point2<f64>) {
    const RATIO: f64 = 0.618_033_988_749_894_8;
    let (ends, at) = ([a, b], |p: Point2<f64>, q: Point2<f64>, t: f64| {
        p + (q - p) * t
    });
    let (mut c, mut d) = (at(b, a, RATIO), at(a, b, RATIO));
    let (mut fc, mut fd) = (f(c), f(d));
    for _ in 0..32 {
        if fc <= fd {
            (b, d, fd) = (d, c, fc);
            c = at(b, a, RATIO);
            fc = f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = at(a, b, RATIO);
            fd = f(d);
        }
    }
    [
        (fc, c),
        (fd, d),
        (f(ends[0]), ends[0]),
        (f(ends[1]), ends[1]),
    ]
    .into_iter()
    .min_by(|x, y| x.0.total_cmp(&y.0))
    .unwrap_or((fc, c))
}

/// The point whose distances to three others, weighted, sum to the least (the problem of Fermat and
/// Torricelli): one of them, if it pulls harder than the others together, else by E. Weiszfeld's iteration
/// ("Sur le point pour lequel la somme des distances de n points donnés est minimum", 1937).
pub(crate) fn star_point(ends: [Point2<f64>; 3], weights: [f64; 3]) -> Point2<f64> {
    for k in 0..3 {
        let mut pull = nalgebra::Vector2::zeros();
        let mut own = 0.0;
        for (p, w) in ends.iter().zip(weights) {
            let off = p - ends[k];
            if off.norm() > 0.0 {
                pull += off * (w / off.norm());
            } else {
                own += w;
            }
        }
        if pull.norm() <= own {
            return ends[k];
        }
    }
    let whole: f64 = weights.iter().sum();
    let mut at = nalgebra::Vector2::zeros();
    for (p, w) in ends.iter().zip(weights) {
        at += p.coords * (w / whole);
    }
    let mut at = Point2::from(at);
    for _ in 0..ROUNDS {
        let (mut sum, mut share) = (nalgebra::Vector2::zeros(), 0.0);
        for (p, w) in ends.iter().zip(weights) {
            let near = w / (p - at).norm().max(1e-12);
            sum += p.coords * near;
            share += near;
        }
        let next = Point2::from(sum / share);
        let step = (next - at).norm();
        at = next;
        if step < 1e-9 * ((ends[1] - ends[0]).norm() + (ends[2] - ends[0]).norm()) {
            break;
        }
    }
    at
}
