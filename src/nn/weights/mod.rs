//! Weight files: safetensors, read strictly.
//!
//! Nothing in a file is trusted: sizes, names, shapes, values and the digest are checked, and
//! every fault that can be told apart is reported at once, by name.

mod fault;
mod file;
mod random;
mod source;

pub use fault::{Fault, WeightError};
pub(in crate::nn) use file::Examined;
pub use file::{Tensor, WeightFile};
pub use source::{
    EdgeWeights, Norm, TensorSource, conv_weights, linear_weights, transposed_weights,
};

/// The version of the file layout that this code reads.
pub const FORMAT_VERSION: u32 = 1;
