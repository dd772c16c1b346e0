//! What is measured: networks, and the mission that they are run on.

use nalgebra::Point2;
use serde_json::{Value, json};

use crate::encoding::{AutomatonGraph, MapInput, MapTensor};
use crate::nn::inputs::Inputs;
use crate::nn::models::Model;
use crate::nn::weights::{WeightError, WeightFile};

/// Region channels of the networks that are built here.
const LABELS: usize = 7;

/// Widths of the paper's PathNet that are measured.
pub const WIDTHS: [usize; 4] = [8, 16, 32, 64];

/// A network to measure.
#[derive(Clone, Debug)]
pub struct Network {
    /// Its name in the table.
    pub name: String,
    /// The bytes of its weight file, or the file that stands for one.
    pub weights: Weights,
}

/// Where a network's weights come from.
#[derive(Clone, Debug)]
pub enum Weights {
    /// A weight file's contents: reading and checking them is part of the start.
    File(Vec<u8>),
    /// Random weights, which exist in memory alone.
    Random(Box<WeightFile<'static>>),
}

impl Network {
    /// Reads, checks and builds the network.
    ///
    /// # Errors
    /// A file at fault.
    pub fn build(&self) -> Result<Model, WeightError> {
        match &self.weights {
            Weights::File(bytes) => Model::new(&WeightFile::parse(&self.name, bytes)?),
            Weights::Random(file) => Model::new(file),
        }
    }

    /// A network of the paper's architecture with random weights.
    fn random(name: String, mut config: Value) -> Result<Self, WeightError> {
        config["format"] = 1.into();
        config["encoding"] = 1.into();
        config["variant"] = "paper".into();
        config["labels"] = LABELS.into();
        config["resolution"] = 200.into();
        let file = WeightFile::random(config, 1)?;
        Ok(Self {
            name,
            weights: Weights::Random(Box::new(file)),
        })
    }
}

/// The paper's networks with random weights: PathNet in [`WIDTHS`] as its code has it, and StateNet
/// with ResNet-50. Speed does not hang on what weights say.
///
/// # Errors
/// None in fact: the configurations are sound.
pub fn paper_networks() -> Result<Vec<Network>, WeightError> {
    let path = |n1: usize| {
        let config = json!({"kind": "pathnet", "n1": n1, "graph": [64, 128, 128, 128, 64],
            "fusion": "dense", "skip": "none"});
        Network::random(format!("PathNet n1 = {n1}"), config)
    };
    let resnet = json!({"kind": "statenet", "trunk": "bottleneck",
        "trunk_widths": [64, 128, 256, 512], "trunk_blocks": [3, 4, 6, 3], "map_feature": 256,
        "first": 64, "first_relu": false, "graph": [128, 256, 512, 256, 128]});
    let state = Network::random("StateNet ResNet-50".to_owned(), resnet);
    WIDTHS.into_iter().map(path).chain([state]).collect()
}

/// A mission of ordinary size: a map with ten obstacles and seven regions, an automaton of 12
/// states and 60 transitions.
#[derive(Clone, Debug)]
pub struct SampleMission {
    outlines: Vec<Vec<Point2<f64>>>,
    /// The automaton.
    pub graph: AutomatonGraph,
}

impl Default for SampleMission {
    fn default() -> Self {
        let rectangle = |k: usize, size: f64| {
            let (x, y) = ((k * 37 % 83) as f64 / 90.0, (k * 53 % 79) as f64 / 90.0);
            [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)]
                .map(|(a, b)| Point2::new(x + a, y + b))
                .to_vec()
        };
        let (states, transitions) = (12u32, 60u32);
        let graph = AutomatonGraph {
            regions: LABELS,
            states: (0..states)
                .map(|q| [f32::from(u8::from(q == 0)), 0.0, q as f32 / 12.0])
                .collect(),
            literals: (0..transitions as usize * LABELS)
                .map(|i| (i * 7 % 11 % 3) as i8 - 1)
                .collect(),
            ends: (0..transitions)
                .map(|t| (t % states, t * 5 % states))
                .collect(),
        };
        Self {
            outlines: (0..LABELS + 10).map(|k| rectangle(k, 0.09)).collect(),
            graph,
        }
    }
}

impl SampleMission {
    /// The map.
    #[must_use]
    pub fn map(&self) -> MapInput<'_> {
        let outlines: Vec<&[Point2<f64>]> = self.outlines.iter().map(Vec::as_slice).collect();
        MapInput {
            bounds: [Point2::origin(), Point2::new(1.0, 1.0)],
            regions: outlines[..LABELS].to_vec(),
            obstacles: outlines[LABELS..].to_vec(),
            start: Point2::new(0.02, 0.02),
            ways: (0..(LABELS + 1) * (LABELS + 1))
                .map(|k| k as f64 / 64.0)
                .collect(),
        }
    }

    /// The map as a raster.
    #[must_use]
    pub fn raster(&self, resolution: usize) -> MapTensor {
        MapTensor::new(&self.map(), resolution)
    }

    /// What a network reads.
    #[must_use]
    pub fn inputs<'a>(&'a self, raster: &'a MapTensor) -> Inputs<'a> {
        Inputs {
            map: raster,
            graph: &self.graph,
            given: &[],
        }
    }
}
