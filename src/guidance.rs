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

/// The two predictions for one mission (`nngtl.md`, IV-A).
#[derive(Clone, Debug, PartialEq)]
pub struct Guidance {
    /// PathNet's output 𝒫.
    pub heatmap: Heatmap,
    /// StateNet's output p: for each state of the task's automaton, the probability in `[0, 1]`
    /// that the optimal path visits it. Not normalised over states.
    pub states: Vec<f32>,
}
