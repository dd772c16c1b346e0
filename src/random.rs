//! Randomness as a value: one named generator and the distributions that planning draws from.
//!
//! The generator is ChaCha8 and transcendental functions come from `libm`, so that a seed means
//! the same on every platform and for ever.

use rand::{RngExt, SeedableRng};

/// The generator that every random choice in this crate draws from.
pub type Random = rand_chacha::ChaCha8Rng;

/// The generator for `seed` and a `stream` number (a tree, a thread, a sample).
#[must_use]
pub fn generator(seed: u64, stream: u64) -> Random {
    let mut random = Random::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

/// A number uniform in `[0, 1)`.
pub fn unit(random: &mut Random) -> f64 {
    random.random::<f64>()
}

/// A number from the standard normal distribution (Box–Muller).
pub fn normal(random: &mut Random) -> f64 {
    let radius = (-2.0 * libm::log(1.0 - unit(random))).sqrt();
    radius * libm::cos(2.0 * std::f64::consts::PI * unit(random))
}

/// Whether an event of probability `p` happens.
pub fn chance(random: &mut Random, p: f64) -> bool {
    unit(random) < p
}

/// An element drawn uniformly; `None` from an empty slice.
pub fn choose<'a, T>(random: &mut Random, items: &'a [T]) -> Option<&'a T> {
    (!items.is_empty()).then(|| &items[random.random_range(0..items.len())])
}

/// An index drawn in proportion to `weights` (negative and non-finite ones count as 0);
/// uniform if all are 0, `None` if there is none.
pub fn weighted(random: &mut Random, weights: impl Iterator<Item = f64> + Clone) -> Option<usize> {
    let usable = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
    let (count, total) = weights
        .clone()
        .fold((0, 0.0), |(n, sum), w| (n + 1, sum + usable(w)));
    if count == 0 {
        return None;
    }
    if total <= 0.0 {
        return Some(random.random_range(0..count));
    }
    let mut left = unit(random) * total;
    let mut last = 0;
    for (i, w) in weights.enumerate() {
        let w = usable(w);
        if w > 0.0 {
            last = i;
            if left < w {
                return Some(i);
            }
            left -= w;
        }
    }
    Some(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_has_zero_mean_and_unit_variance() {
        let mut random = generator(1, 0);
        let draws: Vec<f64> = (0..20_000).map(|_| normal(&mut random)).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / draws.len() as f64;
        assert!(mean.abs() < 0.03, "{mean}");
        assert!((variance - 1.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn weighted_draws_follow_the_weights() {
        let mut random = generator(2, 0);
        let weights = [1.0, 0.0, 3.0, f64::NAN];
        let mut counts = [0; 4];
        for _ in 0..8_000 {
            counts[weighted(&mut random, weights.iter().copied()).unwrap()] += 1;
        }
        assert_eq!((counts[1], counts[3]), (0, 0));
        let share = f64::from(counts[2]) / 8_000.0;
        assert!((share - 0.75).abs() < 0.03, "{share}");
        assert_eq!(weighted(&mut random, [].iter().copied()), None);
        assert!(weighted(&mut random, [0.0, 0.0].iter().copied()).unwrap() < 2);
    }

    #[test]
    fn streams_of_one_seed_differ() {
        assert_ne!(unit(&mut generator(1, 0)), unit(&mut generator(1, 1)));
        assert_eq!(unit(&mut generator(1, 1)), unit(&mut generator(1, 1)));
    }
}
