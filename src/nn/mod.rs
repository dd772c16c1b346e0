//! The networks: weight files, models as lists of operations, and what runs them.
//!
//! [`weights`] reads a file, [`models`] builds a [`program::Program`] from it, an executor
//! ([`cpu`], or `gpu` with the feature of that name) runs programs, and [`Predictor`] ties these
//! together. `docs/networks.md` is the contract with the code that trains the weights.

pub mod config;
pub mod cpu;
pub mod device;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod inputs;
pub mod models;
mod predictor;
pub mod program;
pub mod weights;

pub use device::{DeviceChoice, Estimate, Fallback};
pub use predictor::{
    EncodedMission, HEATMAP_SIDE, LoadError, LoadOptions, MODEL_FILES, ModelInfo, PredictError,
    Predictor, Timings, embedded,
};
