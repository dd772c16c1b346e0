//! The architectures, as programs (`docs/networks.md`).

mod automaton;
mod pathnet;
mod resnet;
mod statenet;
mod unet;

use super::config::Config;
use super::program::Program;
use super::weights::{TensorSource, WeightError, WeightFile};
use crate::encoding::Encoding;

/// A network: its configuration and the program that computes it.
#[derive(Clone, Debug)]
pub struct Model {
    /// The configuration.
    pub config: Config,
    /// How its inputs are encoded.
    pub encoding: Encoding,
    /// The operations and their weights.
    pub program: Program,
}

impl Model {
    /// Builds the network of a weight file's bytes; `name` stands for the file in messages.
    ///
    /// # Errors
    /// All that is wrong with the file at once: its structure and values, its configuration, and its tensors beside what the configuration
    /// asks for. Only what cannot be read hides what lies in it.
    pub fn read(name: &str, bytes: &[u8]) -> Result<Self, WeightError> {
        Ok(WeightFile::examine(name, bytes)?.build(Self::new)?.1)
    }

    /// Builds the network that a weight file describes.
    ///
    /// # Errors
    /// A false configuration; tensors that are missing, mis-shaped or left over.
    pub fn new(file: &WeightFile<'_>) -> Result<Self, WeightError> {
        let config = Config::parse(&file.config).map_err(|faults| WeightError {
            file: file.name.clone(),
            faults,
        })?;
        let (mut program, ()) = TensorSource::build(file, |source, program| match &config {
            Config::PathPaper(c) => pathnet::paper(source, program, c),
            Config::PathPaint(c) => pathnet::paint(source, program, c),
            Config::StatePaper(c) => statenet::paper(source, program, c),
            Config::StateLookup(c) => statenet::lookup(source, program, c),
            Config::StateWays(c) => statenet::ways(source, program, c),
        })?;
        program.resolution = config.resolution();
        program.labels = config.labels();
        program.half = !file.tensors.is_empty() && file.tensors.values().all(|t| t.stored == "F16");
        let version = file
            .config
            .get("encoding")
            .and_then(serde_json::Value::as_u64);
        Ok(Self {
            encoding: version.and_then(Encoding::of_version).unwrap_or_default(),
            config,
            program,
        })
    }
}
