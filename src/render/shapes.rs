//! Lines, arrowheads and tick marks.

use std::fmt::Write as _;

use super::labels::Px;

/// Arrowheads keep at least this distance along a path, in pixels.
const ARROW_SPACING: f64 = 80.0;

/// SVG path data of a polyline.
pub(super) fn polyline(points: &[Px]) -> String {
    let mut data = String::new();
    for (i, [x, y]) in points.iter().enumerate() {
        let _ = write!(data, "{}{x:.2} {y:.2}", if i == 0 { "M" } else { "L" });
    }
    data
}

/// Where arrowheads go on a polyline, and which way they point (radians, clockwise from right).
pub(super) fn arrow_places(points: &[Px]) -> Vec<(Px, f64)> {
    let mut places = Vec::new();
    let mut since_last = ARROW_SPACING / 2.0;
    let mut longest: Option<(f64, (Px, f64))> = None;
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let leg = dx.hypot(dy);
        let place = |t: f64| ([a[0] + dx * t, a[1] + dy * t], dy.atan2(dx));
        if longest.is_none_or(|(l, _)| leg > l) && leg > 0.0 {
            longest = Some((leg, place(0.5)));
        }
        if leg < 16.0 || since_last + leg / 2.0 < ARROW_SPACING {
            since_last += leg;
            continue;
        }
        // One in the middle of a short leg, several evenly spread over a long one.
        let count = (leg / (2.0 * ARROW_SPACING)).round().max(1.0) as usize;
        for k in 0..count {
            places.push(place((k as f64 + 0.5) / count as f64));
        }
        since_last = leg / (2.0 * count as f64);
    }
    if places.is_empty() {
        places.extend(longest.map(|(_, place)| place));
    }
    places
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
        assert_eq!(arrow_places(&straight).len(), 5);
        let short = [[0.0, 0.0], [10.0, 0.0], [10.0, 0.0]];
        assert_eq!(arrow_places(&short), [([5.0, 0.0], 0.0)]);
        assert!(arrow_places(&[[1.0, 1.0], [1.0, 1.0]]).is_empty());
        let many: Vec<Px> = (0..500).map(|i| [f64::from(i), 0.0]).collect();
        assert!(arrow_places(&many).len() < 10);
    }
}
