//! Weight files of untrained networks.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Fault, Tensor, WeightError, WeightFile};
use crate::nn::models::Model;

impl WeightFile<'static> {
    /// A file with random weights for a configuration: to measure how fast a network is, where
    /// it does not matter what it says. Values keep their size from layer to layer.
    ///
    /// # Errors
    /// A configuration that is not one.
    pub fn random(config: serde_json::Value, seed: u64) -> Result<Self, WeightError> {
        let mut file = Self {
            name: "random weights".to_owned(),
            config,
            training: serde_json::Value::Null,
            sha256: String::new(),
            tensors: BTreeMap::new(),
        };
        // A file without tensors is refused by naming all that it should have.
        let Err(error) = Model::new(&file) else {
            return Ok(file);
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for fault in &error.faults {
            let Fault::Missing { name, shape } = fault else {
                return Err(error);
            };
            let values = random_values(name, shape, &mut rng);
            file.tensors.insert(
                name.clone(),
                Tensor {
                    shape: shape.clone(),
                    stored: "F32",
                    values: values.into(),
                },
            );
        }
        Ok(file)
    }
}

fn random_values(name: &str, shape: &[usize], rng: &mut ChaCha8Rng) -> Vec<f32> {
    let count = shape.iter().product();
    if shape.len() == 1 && (name.ends_with("running_var") || name.ends_with("norm.weight")) {
        return vec![1.0; count];
    }
    let inputs: usize = shape.iter().skip(1).product();
    // Uniform in ±√(3/n) has variance 1/n.
    let bound = (3.0 / inputs.max(1) as f32).sqrt() * if shape.len() == 1 { 0.1 } else { 1.0 };
    (0..count)
        .map(|_| rng.random_range(-bound..bound))
        .collect()
}
