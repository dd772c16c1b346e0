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

/// A summary of runs of which some ended at their cap without finding what was looked for; they count with
/// what they spent, so that the truth lies above.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// All runs.
    #[serde(flatten)]
    pub summary: Summary,
    /// How many of them ended at the cap.
    pub capped: usize,
}

impl Measured {
    /// Summarises pairs of a measurement and whether it ended at the cap; `None` if there are none.
    #[must_use]
    pub fn of(runs: &[(f64, bool)]) -> Option<Self> {
        let values: Vec<f64> = runs.iter().map(|r| r.0).collect();
        Some(Self {
            summary: Summary::of(&values)?,
            capped: runs.iter().filter(|r| r.1).count(),
        })
    }

    /// Whether the quantile `q` is only a lower bound: with all capped runs above everything else, it is one of
    /// them or lies beside one.
    #[must_use]
    pub fn is_bound(&self, q: f64) -> bool {
        let last = (self.summary.count - 1) as f64;
        (q * last).ceil() > last - self.capped as f64
    }

    /// Mean, median and quartiles for people to read; bounds with a sign.
    #[must_use]
    pub fn cell(&self, digits: usize) -> String {
        let s = &self.summary;
        let sign = |bound: bool| if bound { "≥ " } else { "" };
        let at = |q: f64, value: f64| format!("{}{value:.digits$}", sign(self.is_bound(q)));
        format!(
            "{}{:.digits$} · {} [{}, {}]",
            sign(self.capped > 0),
            s.mean,
            at(0.5, s.median),
            at(0.25, s.quarter),
            at(0.75, s.three_quarters)
        )
    }
}

/// A share of runs with a 95 % interval (E. B. Wilson, "Probable inference, the law of succession, and
/// statistical inference", 1927), which keeps its meaning at 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// How many.
    pub hits: usize,
    /// Of how many.
    pub of: usize,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Share {
    /// `hits` of `of` runs; the interval of none is everything.
    #[must_use]
    pub fn new(hits: usize, of: usize) -> Self {
        // The normal distribution's quantile 0.975.
        const Z: f64 = 1.959_964;
        if of == 0 {
            let (low, high) = (0.0, 1.0);
            return Self {
                hits,
                of,
                low,
                high,
            };
        }
        let (n, p) = (of as f64, hits as f64 / of as f64);
        let scale = 1.0 + Z * Z / n;
        let middle = (p + Z * Z / (2.0 * n)) / scale;
        let half = Z / scale * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        Self {
            hits,
            of,
            // Rounding must not push the share itself out of its interval.
            low: (middle - half).clamp(0.0, p),
            high: (middle + half).clamp(p, 1.0),
        }
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [low, high] = [self.low, self.high].map(|x| 100.0 * x);
        write!(f, "{}/{} [{low:.1}, {high:.1}] %", self.hits, self.of)
    }
}

/// On which side of a ratio the truth lies, where runs that ended at their cap count with what they spent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Truth {
    /// No run of either ended at its cap.
    #[default]
    Measured,
    /// Some in the numerator did.
    Above,
    /// Some in the denominator did.
    Below,
    /// Some of both did.
    Unknown,
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
    /// Where the truth lies.
    pub truth: Truth,
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = match self.truth {
            Truth::Measured => "",
            Truth::Above => "≥ ",
            Truth::Below => "≤ ",
            Truth::Unknown => "≈ ",
        };
        let Self {
            value, low, high, ..
        } = self;
        write!(f, "{sign}{value:.3} [{low:.3}, {high:.3}]")
    }
}

impl Ratio {
    /// Says whether runs in the numerator and in the denominator ended at their cap.
    #[must_use]
    pub fn with_capped(self, [above, below]: [bool; 2]) -> Self {
        let truth = match (above, below) {
            (false, false) => Truth::Measured,
            (true, false) => Truth::Above,
            (false, true) => Truth::Below,
            (true, true) => Truth::Unknown,
        };
        Self { truth, ..self }
    }

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
            truth: Truth::Measured,
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
    if share == 0.0 {
        return sorted[low]; // the next one may be infinite
    }
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

    /// Quartiles in order, each with its share of the values on both sides.
    fn splits(values: &[f64]) {
        let s = Summary::of(values).unwrap();
        let line = [s.min, s.quarter, s.median, s.three_quarters, s.p95, s.max];
        assert!(line.windows(2).all(|w| w[0] <= w[1]), "{line:?}");
        assert!(s.min <= s.mean + 1e-9 && s.mean <= s.max + 1e-9);
        for (q, at) in [(0.25, s.quarter), (0.5, s.median), (0.75, s.three_quarters)] {
            let below = values.iter().filter(|v| **v < at).count() as f64;
            let above = values.iter().filter(|v| **v > at).count() as f64;
            let steps = (values.len() - 1) as f64;
            assert!(below <= q * steps + 1.0 && above <= (1.0 - q) * steps + 1.0);
        }
    }

    #[test]
    fn quartiles_between_many_equal_values_and_a_few_others() {
        let mut values = [0.0; 18];
        for (k, v) in [
            (10, 785.4),
            (11, 524.9),
            (12, 31.3),
            (15, 558.9),
            (16, 616.3),
        ] {
            values[k] = v;
        }
        splits(&values);
    }

    proptest::proptest! {
        #[test]
        fn quartiles_are_ordered_and_split_the_set(values in proptest::collection::vec(-1e3..1e3_f64, 1..60)) {
            splits(&values);
        }

        #[test]
        fn what_lies_beyond_the_cap_changes_only_what_is_marked(
            found in proptest::collection::vec(1.0..100.0_f64, 0..20),
            lost in 0..20_usize,
            truth in 100.0..1e4_f64,
        ) {
            proptest::prop_assume!(found.len() + lost > 0);
            let runs = |at: f64| -> Measured {
                let lost = std::iter::repeat_n((at, true), lost);
                let runs: Vec<_> = found.iter().map(|v| (*v, false)).chain(lost).collect();
                Measured::of(&runs).unwrap()
            };
            let (capped, true_ones) = (runs(100.0), runs(truth));
            let quantiles = |m: &Measured| [m.summary.quarter, m.summary.median, m.summary.three_quarters];
            for (k, q) in [0.25, 0.5, 0.75].into_iter().enumerate() {
                let (seen, real) = (quantiles(&capped)[k], quantiles(&true_ones)[k]);
                proptest::prop_assert!(seen <= real + 1e-9);
                proptest::prop_assert!(capped.is_bound(q) || (seen - real).abs() < 1e-9);
            }
            proptest::prop_assert_eq!(capped.cell(1).starts_with('≥'), lost > 0);
        }

        #[test]
        fn intervals_of_shares_hold_the_share(of in 1..500_usize, part in 0.0..=1.0_f64) {
            let hits = (part * of as f64) as usize;
            let share = Share::new(hits, of);
            let p = hits as f64 / of as f64;
            proptest::prop_assert!(0.0 <= share.low && share.low <= p && p <= share.high && share.high <= 1.0);
            proptest::prop_assert!(hits < of || share.low < 1.0);
            let more = Share::new(10 * hits, 10 * of);
            proptest::prop_assert!(more.high - more.low < share.high - share.low);
        }
    }

    #[test]
    fn the_interval_of_a_known_share() {
        // Wilson's interval of 8 of 10, from tables.
        let share = Share::new(8, 10);
        assert!((share.low - 0.4902).abs() < 1e-4 && (share.high - 0.9433).abs() < 1e-4);
        assert_eq!(share.to_string(), "8/10 [49.0, 94.3] %");
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
