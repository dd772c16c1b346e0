//! Weights as operations read them.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

/// Values of a constant, and what the CPU makes of them when it first runs an operation that
/// reads them otherwise. Shared by clones.
#[derive(Clone, Debug, Default)]
pub struct Constant {
    /// The values, in the layout that operations ask for. (Slices in `Arc` would be one more copy
    /// of them all.)
    values: Arc<Vec<f32>>,
    transformed: Arc<OnceLock<Transformed>>,
}

/// Values in another layout, and which one that is.
type Transformed = ([usize; 3], Vec<f32>);

impl Constant {
    /// The values in another layout, told by `key`, which `make` makes of them once. The values stay, for devices that
    /// want them as they are.
    ///
    /// # Panics
    /// If another layout was asked for before: a constant is one operation's.
    pub(crate) fn transformed(
        &self,
        key: [usize; 3],
        make: impl FnOnce(&[f32]) -> Vec<f32>,
    ) -> &[f32] {
        let make = || (key, make(&self.values));
        let (known, values) = self.transformed.get_or_init(make);
        assert_eq!(*known, key, "one constant in two layouts");
        values
    }
}

impl From<Vec<f32>> for Constant {
    fn from(values: Vec<f32>) -> Self {
        Self {
            values: Arc::new(values),
            transformed: Arc::default(),
        }
    }
}

impl Deref for Constant {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.values
    }
}

impl PartialEq for Constant {
    fn eq(&self, other: &Self) -> bool {
        self.values == other.values
    }
}
