//! What the networks tell the sampler.

use crate::simd::vectorised;

/// A square grid of non-negative weights over the workspace: where good paths run.
///
/// Cell `(i, j)` counts from the lower-left corner of the (square) frame that the map encoding
/// uses; memory order is `i * side + j`, `i` along x and `j` along y.
#[derive(Clone, Debug, PartialEq)]
pub struct Heatmap {
    /// Cells per side (200 in the paper).
    pub side: usize,
    /// `side * side` weights in `[0, 1]`.
    pub values: Vec<f32>,
}

impl Heatmap {
    /// The same weight everywhere.
    #[must_use]
    pub fn flat(side: usize) -> Self {
        Self {
            side,
            values: vec![1.0; side * side],
        }
    }

    /// The weight of cell `(i, j)`, `i` along x and `j` along y.
    ///
    /// # Panics
    /// If there is no such cell.
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> f32 {
        assert!(
            i < self.side && j < self.side,
            "cell ({i}, {j}) of a grid of side {}",
            self.side
        );
        self.values[i * self.side + j]
    }
}

/// The two predictions for one mission (`nngtl.md`, IV-A).
#[derive(Clone, Debug, PartialEq)]
pub struct Guidance {
    /// PathNet's output 𝒫.
    pub heatmap: Heatmap,
    /// StateNet's output p: for each state of the task's automaton, the probability in `[0, 1]`
    /// that the optimal path visits it. Not normalised over states.
    pub states: Vec<f32>,
}

impl Guidance {
    /// Guidance that tells nothing: the same weight for every cell and every one of `states`
    /// states. A guided sampler with it is the control for one with trained networks.
    #[must_use]
    pub fn flat(states: usize) -> Self {
        Self {
            heatmap: Heatmap::flat(200),
            states: vec![1.0; states],
        }
    }

    /// Rounds every value to a multiple of 1/65535 in `[0, 1]` (NaN to 0), so that plans do not
    /// hang on the last bits, which differ between processors.
    #[must_use]
    pub fn quantised(mut self) -> Self {
        vectorised!({
            for values in [&mut self.heatmap.values, &mut self.states] {
                values
                    .iter_mut()
                    .for_each(|v| *v = steps_of(*v) / f32::from(u16::MAX));
            }
        });
        self
    }
}

/// Numbers from here on are integers, and the bits of the next ones count them: casts are slower than the rest of a
/// heatmap's way to the sampler.
const INTEGERS: f32 = 8_388_608.0;

/// How many 65535ths a value in `[0, 1]` is, rounded; what lies outside counts as the nearer end, NaN as 0.
#[inline(always)]
pub(crate) fn steps_of(value: f32) -> f32 {
    let wanted = value * f32::from(u16::MAX) + 0.5;
    let wanted = if wanted > 0.0 { wanted } else { 0.0 }.min(f32::from(u16::MAX));
    let nearest = (wanted + INTEGERS) - INTEGERS;
    nearest - if nearest > wanted { 1.0 } else { 0.0 }
}

/// The integer nearest to a value between 0 and 65535.
#[inline(always)]
pub(crate) fn nearest(value: f32) -> u32 {
    (value + INTEGERS).to_bits() - INTEGERS.to_bits()
}

/// Whether all values are finite: looks at all of them, which is faster than stopping at the first that is not.
pub(crate) fn are_finite(values: &[f32]) -> bool {
    let magnitudes = || values.iter().map(|v| v.to_bits() & 0x7FFF_FFFF);
    let largest = vectorised!(magnitudes().fold(0, u32::max));
    largest < f32::INFINITY.to_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantised_values_are_multiples_and_stay() {
        let heatmap = Heatmap {
            side: 2,
            values: vec![0.0, 1.0, 0.333_333, f32::NAN],
        };
        let once = Guidance {
            heatmap,
            states: vec![-0.5, 2.0, 0.5],
        }
        .quantised();
        assert_eq!(once.heatmap.values, [0.0, 1.0, 21845.0 / 65535.0, 0.0]);
        assert_eq!(once.states, [0.0, 1.0, 32768.0 / 65535.0]);
        assert_eq!(once.clone().quantised(), once);
    }

    #[test]
    fn steps_are_rounded_as_casts_round() {
        for k in 0..1_000_000 {
            let value = k as f32 / 990_000.0 - 0.005;
            let cast = (value * 65535.0 + 0.5) as u16;
            assert_eq!(steps_of(value), f32::from(cast), "{value}");
            assert_eq!(nearest(steps_of(value)), u32::from(cast));
        }
        for (value, steps) in [(f32::NAN, 0.0), (f32::INFINITY, 65535.0), (-1e30, 0.0)] {
            assert_eq!(steps_of(value), steps);
        }
    }

    #[test]
    fn flat_guidance_is_uniform() {
        let flat = Guidance::flat(3);
        assert_eq!(flat.states, [1.0; 3]);
        assert_eq!(flat.heatmap.at(199, 0), 1.0);
    }
}
