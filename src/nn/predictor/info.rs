//! What stands in a weight file.

use std::path::Path;

use super::LoadError;
use super::load::TYPICAL;
use crate::nn::models::Model;
use crate::nn::weights::WeightFile;

/// What a weight file holds: for people to read.
#[derive(Clone, Debug, serde::Serialize)]
pub struct ModelInfo {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: usize,
    /// The configuration.
    pub config: serde_json::Value,
    /// The training record.
    pub training: serde_json::Value,
    /// The digest of the tensors.
    pub sha256: String,
    /// Name, shape and stored type of each tensor, by name.
    pub tensors: Vec<(String, Vec<usize>, &'static str)>,
    /// How many numbers the tensors hold.
    pub parameters: usize,
    /// Multiply-adds of one run, for an automaton of 12 states and 60 transitions.
    pub multiply_adds: u64,
}

impl ModelInfo {
    /// Reads a weight file and checks it as loading does.
    ///
    /// # Errors
    /// As [`Predictor::load`](super::Predictor::load).
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        let file = path.display().to_string();
        match std::fs::read(path) {
            Ok(bytes) => Self::parse(&file, &bytes),
            Err(source) => Err(LoadError::Read { file, source }),
        }
    }

    /// As [`Self::read`], from a file's contents.
    ///
    /// # Errors
    /// Files that are at fault.
    pub fn parse(name: &str, bytes: &[u8]) -> Result<Self, LoadError> {
        let file = WeightFile::parse(name, bytes)?;
        let model = Model::new(&file)?;
        Ok(Self {
            parameters: file.parameters(),
            multiply_adds: model.program.multiply_adds(TYPICAL),
            bytes: bytes.len(),
            tensors: file
                .tensors
                .into_iter()
                .map(|(name, t)| (name, t.shape, t.stored))
                .collect(),
            file: file.name,
            config: file.config,
            training: file.training,
            sha256: file.sha256,
        })
    }
}
