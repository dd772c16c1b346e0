//! Lines, arrowheads and tick marks.

use std::fmt::Write as _;

use super::labels::{Px, Rect};

/// Arrowheads keep at least this distance along a path, in pixels.
const ARROW_SPACING: f64 = 80.0;

/// From tip to tail, with some room.
const ARROW_LENGTH: f64 = 18.0;

/// SVG path data of a polyline.
pub(super) fn polyline(points: &[Px]) -> String {
    let mut data = String::new();
    for (i, [x, y]) in points.iter().enumerate() {
        let _ = write!(data, "{}{x:.2} {y:.2}", if i == 0 { "M" } else { "L" });
    }
    data
}

/// SVG path data of a polyline without the parts that it has run along before: dashes that are drawn
/// twice fill each other's gaps.
pub(super) fn once(points: &[Px]) -> String {
    let mut data = String::new();
    let mut pen = None;
    for (k, leg) in points.windows(2).enumerate() {
        let mut parts = vec![(0.0, 1.0)];
        for before in points[..=k].windows(2) {
            if let Some((from, to)) = shared(leg, before) {
                let rest = |(a, b): (f64, f64)| [(a, b.min(from)), (a.max(to), b)];
                parts = parts.into_iter().flat_map(rest).collect();
                parts.retain(|(a, b)| a < b);
            }
        }
        for (from, to) in parts {
            let [start, end] = [from, to].map(|t| along(leg, t));
            if pen != Some(start) {
                let _ = write!(data, "M{:.2} {:.2}", start[0], start[1]);
            }
            let _ = write!(data, "L{:.2} {:.2}", end[0], end[1]);
            pen = Some(end);
        }
    }
    data
}

/// The point of a leg at `t` of its length.
fn along(leg: &[Px], t: f64) -> Px {
    // Exactly the ends at 0 and 1.
    [0, 1].map(|k| leg[0][k] * (1.0 - t) + leg[1][k] * t)
}

/// The part of a leg that runs along another one, in shares of its length.
fn shared(leg: &[Px], other: &[Px]) -> Option<(f64, f64)> {
    let d = [leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]];
    let length = d[0].hypot(d[1]);
    if length == 0.0 {
        return None;
    }
    let off = |p: Px| [p[0] - leg[0][0], p[1] - leg[0][1]];
    let beside = |p: Px| (off(p)[0] * d[1] - off(p)[1] * d[0]) / length;
    if beside(other[0]).abs() > 1.0 || beside(other[1]).abs() > 1.0 {
        return None;
    }
    let at = |p: Px| (off(p)[0] * d[0] + off(p)[1] * d[1]) / (length * length);
    let (a, b) = (at(other[0]), at(other[1]));
    let (from, to) = (a.min(b).max(0.0), a.max(b).min(1.0));
    (from < to).then_some((from, to))
}

/// Where arrowheads go on a polyline, and which way they point (radians, clockwise from right). They keep clear
/// of those that are `taken`, and are taken from then on.
pub(super) fn arrow_places(points: &[Px], taken: &mut Vec<Px>) -> Vec<(Px, f64)> {
    let mut places = Vec::new();
    let mut since_last = ARROW_SPACING / 2.0;
    let mut longest: Option<(f64, (Px, f64))> = None;
    for pair in points.windows(2) {
        let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let leg = dx.hypot(dy);
        let direction = dy.atan2(dx);
        if longest.is_none_or(|(l, _)| leg > l) && leg > 0.0 {
            longest = Some((leg, (along(pair, 0.5), direction)));
        }
        if leg < 16.0 || since_last + leg / 2.0 < ARROW_SPACING {
            since_last += leg;
            continue;
        }
        // One in the middle of a short leg, several evenly spread over a long one.
        let count = (leg / (2.0 * ARROW_SPACING)).round().max(1.0) as usize;
        for k in 0..count {
            let middle = (k as f64 + 0.5) / count as f64;
            // Where the path comes back the same way, arrows of both directions stand in turn.
            let shifts = [0.0, -1.0, 1.0, -2.0, 2.0].map(|n| middle + n * ARROW_LENGTH / leg);
            let mut free = shifts
                .into_iter()
                .filter(|t| (0.0..=1.0).contains(t))
                .map(|t| along(pair, t))
                .filter(|p| taken.iter().all(|q| distance(*p, *q) >= ARROW_LENGTH));
            if let Some(place) = free.next() {
                taken.push(place);
                places.push((place, direction));
            }
        }
        since_last = leg / (2.0 * count as f64);
    }
    if places.is_empty() {
        places.extend(longest.map(|(_, place)| place));
    }
    places
}

fn distance(a: Px, b: Px) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The centres of markers of this width that are wanted at `places`: one after the other, each where it is wanted or
/// as near to it as there is room within the frame.
pub(super) fn side_by_side(places: &[Px], width: f64, frame: &Rect) -> Vec<Px> {
    let mut done: Vec<Px> = Vec::new();
    for &[x, y] in places {
        let rings = (0..=places.len()).flat_map(|ring| {
            let turns = if ring == 0 { 1 } else { 8 };
            (0..turns).map(move |turn| {
                // To the right first.
                let (sin, cos) = (f64::from(turn) * std::f64::consts::FRAC_PI_4).sin_cos();
                let reach = width * ring as f64;
                [x + cos * reach, y + sin * reach]
            })
        });
        let mut free = rings.filter(|p| {
            let fits = *p == [x, y] || frame.contains(*p);
            fits && done.iter().all(|q| distance(*p, *q) >= 0.9 * width)
        });
        done.push(free.next().unwrap_or([x, y]));
    }
    done
}

/// The nearest of 1, 2, 5 times a power of ten, from above.
pub(super) fn nice_step(rough: f64) -> f64 {
    let power = 10_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|f| f * power >= rough * (1.0 - 1e-9))
        .unwrap_or(10.0);
    factor * power
}

/// The multiples of `step` between two values, both included.
pub(super) fn ticks(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let slack = 1e-9 * step;
    let first = ((from - slack) / step).ceil();
    let count = (((to + slack) / step).floor() - first).max(-1.0) as i64;
    (0..=count).map(move |i| (first + i as f64) * step)
}

/// A tick's value with the digits that its step needs.
pub(super) fn number(value: f64, step: f64) -> String {
    let digits = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{:.digits$}", value + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_within_the_bounds() {
        assert_eq!(nice_step(0.2), 0.2);
        assert_eq!(nice_step(2.4), 5.0);
        assert_eq!(nice_step(60.0), 100.0);
        let found: Vec<String> = ticks(-0.3, 0.41, 0.2).map(|t| number(t, 0.2)).collect();
        assert_eq!(found, ["-0.2", "0.0", "0.2", "0.4"]);
        assert_eq!(ticks(0.1, 0.15, 1.0).count(), 0);
    }

    #[test]
    fn every_path_has_an_arrow_and_none_too_many() {
        let straight = [[0.0, 0.0], [800.0, 0.0]];
        assert_eq!(arrow_places(&straight, &mut Vec::new()).len(), 5);
        let short = [[0.0, 0.0], [10.0, 0.0], [10.0, 0.0]];
        assert_eq!(arrow_places(&short, &mut Vec::new()), [([5.0, 0.0], 0.0)]);
        assert!(arrow_places(&[[1.0, 1.0], [1.0, 1.0]], &mut Vec::new()).is_empty());
        let many: Vec<Px> = (0..500).map(|i| [f64::from(i), 0.0]).collect();
        assert!(arrow_places(&many, &mut Vec::new()).len() < 10);
    }

    #[test]
    fn a_way_there_and_back_is_drawn_once() {
        let way = [
            [0.0, 0.0],
            [60.0, 80.0],
            [60.0, 200.0],
            [60.0, 80.0],
            [0.0, 0.0],
        ];
        assert_eq!(once(&way), polyline(&way[..3]));
        // Other places on the same lines, and further on.
        let way = [
            [0.0, 0.0],
            [100.0, 0.0],
            [50.0, 0.0],
            [50.0, 30.0],
            [50.0, 0.0],
            [150.0, 0.0],
        ];
        let parts = "M0.00 0.00L100.00 0.00M50.00 0.00L50.00 30.00M100.00 0.00L150.00 0.00";
        assert_eq!(once(&way), parts);
        let crossing = [[0.0, 0.0], [9.0, 9.0], [9.0, 0.0], [0.0, 9.0]];
        assert_eq!(once(&crossing), polyline(&crossing));
    }

    #[test]
    fn arrows_of_both_directions_stand_apart() {
        let mut taken = Vec::new();
        let way = [[0.0, 0.0], [300.0, 0.0], [0.0, 0.0]];
        let arrows = arrow_places(&way, &mut taken);
        assert_eq!(arrows.len(), 4);
        for (i, (a, _)) in arrows.iter().enumerate() {
            assert!(
                arrows[..i]
                    .iter()
                    .all(|(b, _)| distance(*a, *b) >= ARROW_LENGTH)
            );
        }
    }

    #[test]
    fn markers_at_one_place_stand_side_by_side() {
        let frame = Rect {
            min: [0.0, 0.0],
            max: [100.0, 100.0],
        };
        let places = side_by_side(&[[95.0, 50.0]; 12], 20.0, &frame);
        assert_eq!(places[0], [95.0, 50.0]);
        for (i, a) in places.iter().enumerate() {
            assert!(frame.contains(*a));
            assert!(places[..i].iter().all(|b| distance(*a, *b) >= 18.0));
        }
    }
}
