//! What the networks tell the sampler.

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
        for value in self.heatmap.values.iter_mut().chain(&mut self.states) {
            *value = quantise(*value);
        }
        self
    }
}

fn quantise(value: f32) -> f32 {
    // The cast cuts off, saturates, and takes NaN to 0. (Rounding is a call where the target has no instruction for it.)
    f32::from((value * 65535.0 + 0.5) as u16) / 65535.0
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
    fn flat_guidance_is_uniform() {
        let flat = Guidance::flat(3);
        assert_eq!(flat.states, [1.0; 3]);
        assert_eq!(flat.heatmap.at(199, 0), 1.0);
    }
}
