//! How the cost falls along a search: quartiles of the gap to the exact planner's plan.

use super::{Convergence, Descent, gap};
use crate::bench::Contender;
use crate::bench::stats::quantile;

/// What a search is followed along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::bench) enum Along {
    /// Iterations.
    Iterations,
    /// Seconds, with encoding and networks where they are asked.
    Seconds,
}

/// Places on an axis that quartiles are computed at.
const PLACES: usize = 160;

impl Along {
    /// Where the improvements of a search lie, with their costs.
    fn places(self, descent: &Descent) -> impl Iterator<Item = (f64, f64)> {
        descent.improvements.iter().map(move |i| match self {
            Self::Iterations => (i.iterations as f64, i.cost),
            Self::Seconds => (descent.whole(i.iterations, i.seconds), i.cost),
        })
    }

    fn end(self, descent: &Descent) -> f64 {
        match self {
            Self::Iterations => descent.iterations as f64,
            Self::Seconds => descent.whole(descent.iterations, descent.seconds),
        }
    }
}

/// The quartiles of a contender's gaps, in percent, as (place, quarter, median, three quarters). A search without
/// a plan yet has an infinite gap, so a quartile is finite only once enough searches have one; the curve begins with
/// the first finite quarter.
pub(in crate::bench) fn curve(
    all: &Convergence,
    contender: &Contender,
    along: Along,
) -> Vec<[f64; 4]> {
    // Falling gaps by place, for each search.
    let searches: Vec<Vec<(f64, f64)>> = all
        .descents
        .iter()
        .filter(|d| d.contender == *contender)
        .filter_map(|d| {
            let upper = all.reference(&d.case)?.upper;
            let gaps = along
                .places(d)
                .map(|(at, cost)| (at, 100.0 * gap(cost, upper)));
            Some(gaps.collect())
        })
        .collect();
    let first = searches.iter().filter_map(|s| s.first()).map(|s| s.0);
    let low = first.fold(f64::INFINITY, f64::min);
    let mine = all.descents.iter().filter(|d| d.contender == *contender);
    let high = mine.map(|d| along.end(d)).fold(0.0, f64::max);
    if !(low.is_finite() && low > 0.0 && high > low) {
        return Vec::new();
    }
    let place = |k: usize| low * (high / low).powf(k as f64 / (PLACES - 1) as f64);
    (0..PLACES)
        .map(|k| {
            let at = place(k) * (1.0 + 1e-12);
            let mut gaps: Vec<f64> = searches
                .iter()
                .map(|s| {
                    let done = s.partition_point(|(place, _)| *place <= at);
                    done.checked_sub(1).map_or(f64::INFINITY, |last| s[last].1)
                })
                .collect();
            gaps.sort_by(f64::total_cmp);
            // Between a finite and an infinite value lies no number.
            let at_quantile = |q: f64| match quantile(&gaps, q) {
                value if value.is_nan() => f64::INFINITY,
                value => value,
            };
            [
                place(k),
                at_quantile(0.25),
                at_quantile(0.5),
                at_quantile(0.75),
            ]
        })
        .filter(|point| point[1].is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{CostSettings, Reference, Strategy};
    use crate::planner::{Improvement, Settings};

    fn search(case: &str, steps: &[(u64, f64)]) -> Descent {
        Descent {
            case: case.to_owned(),
            contender: Strategy::Biased.into(),
            seed: 0,
            improvements: steps
                .iter()
                .map(|&(iterations, cost)| Improvement {
                    iterations,
                    seconds: 1e-3 * iterations as f64,
                    cost,
                })
                .collect(),
            iterations: 1_000,
            seconds: 1.0,
            network_seconds: 0.5,
            networks_after: Some(0),
            verified: None,
        }
    }

    fn reference(case: &str) -> Reference {
        Reference {
            weight: 0.2,
            case: case.to_owned(),
            family: None,
            upper: 2.0,
            lower: None,
            seconds: 0.0,
            bound_seconds: 0.0,
            quick: 1.0,
            quick_seconds: 0.0,
        }
    }

    fn all() -> Convergence {
        let names = ["a", "b", "c", "d"];
        let costs = CostSettings {
            settings: Settings::default(),
            trials: 1,
            marks: Vec::new(),
            bounds: false,
        };
        Convergence {
            references: names.map(reference).to_vec(),
            descents: vec![
                search("a", &[(10, 4.0), (100, 2.0)]),
                search("b", &[(10, 3.0), (1_000, 1.9)]),
                search("c", &[(500, 2.2)]),
                search("d", &[]),
            ],
            ..Convergence::new(&[Strategy::Biased.into()], &costs)
        }
    }

    #[test]
    fn searches_without_a_plan_are_infinitely_far_and_quartiles_fall() {
        let curve = curve(&all(), &Strategy::Biased.into(), Along::Iterations);
        let first = curve[0];
        assert!((first[0] - 10.0).abs() < 1e-9);
        // Gaps of 50 %, 100 %, infinite, infinite.
        assert!((first[1] - 87.5).abs() < 1e-9 && first[2].is_infinite());
        let last = *curve.last().unwrap();
        // -5 %, 0 %, 10 %, infinite.
        assert!((last[0] - 1_000.0).abs() < 1e-6);
        assert!(
            (last[1] + 1.25).abs() < 1e-9 && (last[2] - 5.0).abs() < 1e-9,
            "{last:?}"
        );
        for pair in curve.windows(2) {
            assert!((1..4).all(|k| pair[1][k] <= pair[0][k]));
        }
    }

    #[test]
    fn time_begins_with_the_networks() {
        let curve = curve(&all(), &Strategy::Biased.into(), Along::Seconds);
        assert!((curve[0][0] - 0.51).abs() < 1e-9);
        assert!((curve.last().unwrap()[0] - 1.5).abs() < 1e-9);
        let nobody = super::curve(&all(), &Strategy::Guided.into(), Along::Seconds);
        assert!(nobody.is_empty());
    }
}
