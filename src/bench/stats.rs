//! Summaries that can be compared: quantiles, and ratios of means with their uncertainty.

use rand::RngExt;
use serde::Serialize;

use crate::random::generator;

/// Resamples of a bootstrap interval.
const RESAMPLES: usize = 2_000;

/// Where a set of measurements lies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// How many there are.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// The least.
    pub min: f64,
    /// A quarter lies below.
    pub quarter: f64,
    /// Half lies below.
    pub median: f64,
    /// Three quarters lie below.
    pub three_quarters: f64,
    /// 95 % lie below.
    pub p95: f64,
    /// The greatest.
    pub max: f64,
}

impl Summary {
    /// Summarises measurements; `None` if there are none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        Some(Self {
            count: sorted.len(),
            mean: mean(&sorted),
            min,
            quarter: quantile(&sorted, 0.25),
            median: quantile(&sorted, 0.5),
            three_quarters: quantile(&sorted, 0.75),
            p95: quantile(&sorted, 0.95),
            max,
        })
    }
}

/// A ratio with a 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    /// Mean of the numerators over mean of the denominators.
    pub value: f64,
    /// Lower end of the 95 % bootstrap interval.
    pub low: f64,
    /// Upper end of the 95 % bootstrap interval.
    pub high: f64,
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3} [{:.3}, {:.3}]", self.value, self.low, self.high)
    }
}

impl Ratio {
    /// The ratio of the means of pairs (numerator, denominator), with a percentile bootstrap over
    /// pairs: what belongs to one scenario is drawn together. `None` without pairs or if the
    /// denominators are all 0.
    #[must_use]
    pub fn of_means(pairs: &[(f64, f64)]) -> Option<Self> {
        let ratio = |sum: (f64, f64)| sum.0 / sum.1;
        let total = pairs.iter().fold((0.0, 0.0), add);
        if pairs.is_empty() || total.1 == 0.0 {
            return None;
        }
        // A fixed seed: the same measurements give the same interval.
        let mut random = generator(0x5eed, pairs.len() as u64);
        let mut ratios: Vec<f64> = (0..RESAMPLES)
            .map(|_| {
                let drawn = (0..pairs.len()).map(|_| &pairs[random.random_range(0..pairs.len())]);
                ratio(drawn.fold((0.0, 0.0), add))
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        Some(Self {
            value: ratio(total),
            low: quantile(&ratios, 0.025),
            high: quantile(&ratios, 0.975),
        })
    }
}

fn add(sum: (f64, f64), pair: &(f64, f64)) -> (f64, f64) {
    (sum.0 + pair.0, sum.1 + pair.1)
}

/// The mean; 0 of nothing.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.iter().sum::<f64>() / values.len() as f64
}

/// The quantile `q` in `[0, 1]` of sorted values, interpolated.
pub(super) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let position = q * (sorted.len() - 1) as f64;
    let (low, share) = (position.floor() as usize, position.fract());
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + (sorted[high] - sorted[low]) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summaries_of_a_known_set() {
        let s = Summary::of(&[4.0, 1.0, 3.0, 2.0, 5.0]).unwrap();
        assert_eq!(
            (s.min, s.quarter, s.median, s.three_quarters, s.max),
            (1.0, 2.0, 3.0, 4.0, 5.0)
        );
        assert_eq!(s.mean, 3.0);
        assert_eq!(Summary::of(&[]), None);
    }

    #[test]
    fn intervals_hold_the_ratio_and_shrink_with_the_sample() {
        let pairs = |n: usize| -> Vec<(f64, f64)> {
            (0..n)
                .map(|i| (10.0 + (i % 7) as f64, 20.0 + (i % 5) as f64))
                .collect()
        };
        let (few, many) = (
            Ratio::of_means(&pairs(35)).unwrap(),
            Ratio::of_means(&pairs(1_400)).unwrap(),
        );
        assert!(few.low < few.value && few.value < few.high);
        assert!((few.value - 13.0 / 22.0).abs() < 1e-12);
        assert!(many.high - many.low < few.high - few.low);
        assert_eq!(Ratio::of_means(&[]), None);
        assert_eq!(Ratio::of_means(&[(1.0, 0.0)]), None);
    }
}
