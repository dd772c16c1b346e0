//! What a single mission waits for before its first inference.

use std::time::Instant;

use serde::Serialize;

use super::{BenchDevice, SampleMission, milliseconds};
use crate::bench::stats::Summary;
use crate::nn::{DeviceChoice, LoadError, Predictor};

/// The start of both networks of a model on a device.
#[derive(Clone, Debug, Serialize)]
pub struct StartRow {
    /// The model.
    pub model: String,
    /// The device.
    pub device: String,
    /// Milliseconds to read, check and pack the weights of both networks, and to open the device.
    pub load_ms: Summary,
    /// Milliseconds of the first prediction after it: the map is drawn, memory is taken, kernels
    /// are compiled, both networks run.
    pub first_ms: Summary,
}

impl StartRow {
    /// Starts `runs` times; `None` if the device cannot be had.
    ///
    /// # Errors
    /// Weights that cannot be loaded.
    pub fn measure(
        model: &str,
        device: &BenchDevice,
        runs: usize,
        load: impl Fn(DeviceChoice) -> Result<Predictor, LoadError>,
    ) -> Result<Option<Self>, LoadError> {
        let mission = SampleMission::default();
        let map = mission.map();
        let (mut loads, mut firsts) = (Vec::new(), Vec::new());
        for _ in 0..runs {
            let begin = Instant::now();
            let mut predictor = load(device.choice())?;
            loads.push(milliseconds(begin.elapsed()));
            let begin = Instant::now();
            let predicted = predictor.predict(&map, &mission.graph);
            if predicted.is_err() || predictor.device() != device.name() {
                return Ok(None);
            }
            firsts.push(milliseconds(begin.elapsed()));
        }
        Ok(Summary::of(&loads)
            .zip(Summary::of(&firsts))
            .map(|(load_ms, first_ms)| Self {
                model: model.to_owned(),
                device: device.name(),
                load_ms,
                first_ms,
            }))
    }
}
