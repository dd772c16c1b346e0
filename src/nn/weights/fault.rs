//! What can be wrong with a weight file.

use std::fmt;

/// So many faults of a file are printed; the error holds all of them.
const TOLD: usize = 100;

/// One thing that is wrong with a weight file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The file's structure is broken.
    #[error("not a safetensors file: {0}")]
    Structure(String),
    /// The header has a name twice.
    #[error("`{}` stands twice in the header", .0.escape_debug())]
    Twice(String),
    /// An entry of `__metadata__` is missing.
    #[error("`__metadata__` lacks `{0}`: export the weights again with the project's own script")]
    NoMetadata(&'static str),
    /// An entry of `__metadata__` cannot be read.
    #[error("`{entry}` in `__metadata__` cannot be read: {reason}")]
    BadMetadata {
        /// Which entry.
        entry: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// A version that this program does not read.
    #[error(
        "{what} version {found}, this program reads versions up to {expected}: use weights made for it"
    )]
    Version {
        /// `format` or `encoding`.
        what: &'static str,
        /// The file's.
        found: u64,
        /// Ours.
        expected: u32,
    },
    /// A number of the configuration is out of its range.
    #[error("config: `{field}` is {found}, expected {expected}")]
    Config {
        /// The field's name.
        field: &'static str,
        /// Its value.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// The digest does not match the tensors.
    #[error("the tensors' sha256 is {found}, the header says {expected}: the file is damaged")]
    Digest {
        /// Computed from the buffer.
        found: String,
        /// Stated in the header.
        expected: String,
    },
    /// A tensor is missing.
    #[error("tensor `{}` of shape {shape:?} is missing", name.escape_debug())]
    Missing {
        /// Its name.
        name: String,
        /// The shape it should have.
        shape: Vec<usize>,
    },
    /// A tensor that the model has no use for.
    #[error("tensor `{}` is not part of this model", .0.escape_debug())]
    Unused(String),
    /// A tensor of another shape.
    #[error("tensor `{}` has shape {found:?}, expected {expected:?}", name.escape_debug())]
    Shape {
        /// Its name.
        name: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape it should have.
        expected: Vec<usize>,
    },
    /// A tensor of another type of number.
    #[error("tensor `{}` is of type {found}, expected F32 or F16", name.escape_debug())]
    Type {
        /// Its name.
        name: String,
        /// Its type.
        found: String,
    },
    /// A tensor with NaN or infinite values.
    #[error("tensor `{}` has {count} values that are not finite, the first at index {first}", name.escape_debug())]
    NotFinite {
        /// Its name.
        name: String,
        /// How many.
        count: usize,
        /// Index of the first, in memory order.
        first: usize,
    },
    /// A variance that is negative.
    #[error("tensor `{0}` holds a negative variance")]
    Variance(String),
    /// A norm whose factor or addend no `f32` can hold.
    #[error(
        "the norm `{0}` overflows: its weights over its standard deviations, or its means by these, are not finite"
    )]
    Norm(String),
}

/// Everything that is wrong with a weight file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WeightError {
    /// The file's name, or what stands for it.
    pub file: String,
    /// At least one fault.
    pub faults: Vec<Fault>,
}

impl fmt::Display for WeightError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.faults.as_slice() {
            [only] => write!(f, "{}: {only}", self.file),
            all => {
                write!(f, "{}: {} faults", self.file, all.len())?;
                let mut told = all.iter().take(TOLD);
                told.try_for_each(|fault| write!(f, "\n  {fault}"))?;
                match all.len().saturating_sub(TOLD) {
                    0 => Ok(()),
                    more => write!(f, "\n  and {more} more"),
                }
            }
        }
    }
}

impl std::error::Error for WeightError {}
