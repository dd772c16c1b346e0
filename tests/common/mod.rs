//! What several test binaries share: goldens and comparison.
#![allow(dead_code)] // each binary uses its part

pub(crate) mod ops;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nngtl::encoding::{AutomatonGraph, MapTensor};
use nngtl::nn::models::Model;
use nngtl::nn::weights::WeightFile;
use safetensors::{Dtype, SafeTensors};

/// How far a probability at a network's end may be from PyTorch's (the issue asks for 1e-4).
pub(crate) const MODEL_TOLERANCE: f32 = 2e-5;

/// A tensor of a golden file, its values as `f32` whatever they are stored as.
#[derive(Clone, Debug)]
pub(crate) struct Golden {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f32>,
}

pub(crate) fn goldens() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/goldens")
}

pub(crate) fn read(path: &Path) -> BTreeMap<String, Golden> {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    tensors
        .iter()
        .map(|(name, t)| {
            let words = || t.data().as_chunks::<4>().0.iter().copied();
            let values = match t.dtype() {
                Dtype::F32 => words().map(f32::from_le_bytes).collect(),
                Dtype::I32 => words().map(|b| i32::from_le_bytes(b) as f32).collect(),
                Dtype::I8 => t.data().iter().map(|&b| f32::from(b as i8)).collect(),
                other => panic!("{name}: {other:?}"),
            };
            (
                name.to_owned(),
                Golden {
                    shape: t.shape().to_vec(),
                    values,
                },
            )
        })
        .collect()
}

/// A network of `training`'s, an encoded mission, and PyTorch's output for it.
pub(crate) struct ModelGolden {
    pub(crate) name: String,
    pub(crate) model: Model,
    pub(crate) map: MapTensor,
    pub(crate) graph: AutomatonGraph,
    pub(crate) output: Vec<f32>,
}

pub(crate) fn model_goldens() -> Vec<ModelGolden> {
    let folder = goldens().join("models");
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .filter_map(|entry| {
            let name = entry.unwrap().file_name().into_string().unwrap();
            name.strip_suffix(".io.safetensors").map(str::to_owned)
        })
        .collect();
    names.sort();
    assert!(
        names.len() >= 10,
        "goldens are missing in {}",
        folder.display()
    );
    names
        .into_iter()
        .map(|name| model_golden(&folder, name))
        .collect()
}

fn model_golden(folder: &Path, name: String) -> ModelGolden {
    // The shipped weights have an example here and stand in their own folder.
    let weights = match name.strip_prefix("shipped-") {
        Some(network) => Path::new(env!("CARGO_MANIFEST_DIR"))
            .join(format!("models/compact/{network}.safetensors")),
        None => folder.join(format!("{name}.safetensors")),
    };
    let bytes = std::fs::read(weights).unwrap();
    let file = WeightFile::parse(&name, &bytes).unwrap_or_else(|e| panic!("{e}"));
    let model = Model::new(&file).unwrap_or_else(|e| panic!("{e}"));
    let io = read(&folder.join(format!("{name}.io.safetensors")));
    let raster = &io["raster"];
    let map = MapTensor {
        resolution: raster.shape[1],
        regions: raster.shape[0] - 1,
        values: raster.values.clone(),
        ways: io.get("ways").map_or(Vec::new(), |w| w.values.clone()),
    };
    let ends = io["source"].values.iter().zip(&io["target"].values);
    let graph = AutomatonGraph {
        regions: io["transitions"].shape[1],
        states: io["states"].values.as_chunks::<3>().0.to_vec(),
        literals: io["transitions"].values.iter().map(|&v| v as i8).collect(),
        ends: ends.map(|(&a, &b)| (a as u32, b as u32)).collect(),
    };
    ModelGolden {
        name,
        model,
        map,
        graph,
        output: io["output"].values.clone(),
    }
}

/// The largest difference.
pub(crate) fn difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len(), "other numbers of values");
    a.iter()
        .zip(b)
        .map(|(x, y)| {
            if (x - y).is_nan() {
                f32::INFINITY
            } else {
                (x - y).abs()
            }
        })
        .fold(0.0, f32::max)
}
