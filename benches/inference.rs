//! How long the networks take: each model on the CPU and on the adapters that are there.
//!
//! The weights are random; the input is a map with seven regions and an automaton of 12 states
//! and 60 transitions. Timed is one run of one network with its inputs encoded: filling buffers,
//! computing, reading back. Opening a device, compiling kernels and the first run are not.
//! `cargo bench --bench inference -- cpu/pathnet` runs some of them.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Point2;
use nngtl::encoding::{AutomatonGraph, MapInput, MapTensor};
use nngtl::nn::cpu::Session;
use nngtl::nn::inputs::Inputs;
use nngtl::nn::models::Model;
use nngtl::nn::weights::WeightFile;
use serde_json::{Value, json};

const LABELS: usize = 7;

/// The networks by name: the shipped ones' configurations, and the paper's in its widths.
fn models() -> Vec<(String, Model)> {
    let compact_path = json!({"kind": "pathnet", "variant": "paint", "resolution": 100, "graph": [48, 48, 48, 48],
        "reverse": true, "look": 50, "embedding": 8, "widths": [16, 32, 64, 96], "stem": 2, "middle": 2, "top": 8, "output": 200});
    let compact_state = json!({"kind": "statenet", "variant": "lookup", "resolution": 100, "widths": [12, 32, 48],
        "stem": 2, "middle": 2, "stop": 1, "graph": [48, 48, 48, 48, 48, 48], "reverse": true, "head": 64});
    let resnet50 = json!({"kind": "statenet", "variant": "paper", "resolution": 200, "trunk": "bottleneck",
        "trunk_widths": [64, 128, 256, 512], "trunk_blocks": [3, 4, 6, 3], "map_feature": 256, "first": 256,
        "graph": [128, 256, 512, 256, 128]});
    let mut configs = vec![
        ("pathnet-compact".to_owned(), compact_path),
        ("statenet-compact".to_owned(), compact_state),
        ("statenet-resnet50".to_owned(), resnet50),
    ];
    for n1 in [8, 16, 32, 64] {
        let config = json!({"kind": "pathnet", "variant": "paper", "resolution": 200, "n1": n1,
            "graph": [64, 128, 128, 128, 64], "fusion": "dense", "skip": "third"});
        configs.push((format!("pathnet-n1-{n1}"), config));
    }
    configs
        .into_iter()
        .map(|(name, config)| (name, model(config)))
        .collect()
}

fn model(mut config: Value) -> Model {
    config["format"] = 1.into();
    config["encoding"] = 1.into();
    config["labels"] = LABELS.into();
    Model::new(&WeightFile::random(config, 1).unwrap()).unwrap()
}

/// A map of scattered rectangles and an automaton that leads through its states in many ways.
struct Mission {
    outlines: Vec<Vec<Point2<f64>>>,
    graph: AutomatonGraph,
}

impl Mission {
    fn new() -> Self {
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

    fn map(&self) -> MapInput<'_> {
        let outlines: Vec<&[Point2<f64>]> = self.outlines.iter().map(Vec::as_slice).collect();
        MapInput {
            bounds: [Point2::origin(), Point2::new(1.0, 1.0)],
            regions: outlines[..LABELS].to_vec(),
            obstacles: outlines[LABELS..].to_vec(),
            start: Point2::new(0.02, 0.02),
        }
    }
}

fn raster(c: &mut Criterion) {
    let mission = Mission::new();
    for resolution in [100, 200] {
        c.bench_function(&format!("raster/{resolution}"), |b| {
            b.iter(|| MapTensor::new(&mission.map(), resolution))
        });
    }
}

fn inference(c: &mut Criterion) {
    let mission = Mission::new();
    for (name, model) in models() {
        let map = MapTensor::new(&mission.map(), model.program.resolution);
        let inputs = Inputs {
            map: &map,
            graph: &mission.graph,
            given: &[],
        };
        let mut group = c.benchmark_group("cpu");
        group.sample_size(10);
        group.throughput(Throughput::Elements(
            2 * model.program.multiply_adds(inputs.size()),
        ));
        let mut session = Session::new(1);
        group.bench_function(&name, |b| {
            b.iter(|| session.run(&model.program, &inputs)[0])
        });
        group.finish();
        #[cfg(feature = "gpu")]
        on_adapters(c, &name, &model, &inputs);
    }
}

#[cfg(feature = "gpu")]
fn on_adapters(c: &mut Criterion, name: &str, model: &Model, inputs: &Inputs<'_>) {
    use nngtl::nn::DeviceChoice::{Gpu as Hardware, Software};
    use nngtl::nn::gpu::Gpu;
    let programs = [&model.program];
    for choice in [Hardware, Software] {
        // Billions of multiply-adds take minutes in software and tell nothing.
        let heavy = model.program.multiply_adds(inputs.size()) > 200_000_000;
        let Ok(gpu) = (if heavy && choice == Software {
            continue;
        } else {
            Gpu::open(choice, &programs)
        }) else {
            continue;
        };
        let mut group = c.benchmark_group(choice.to_string());
        group.sample_size(10);
        group.throughput(Throughput::Elements(
            2 * model.program.multiply_adds(inputs.size()),
        ));
        group.bench_function(name, |b| b.iter(|| gpu.run(&programs, &[*inputs]).unwrap()));
        group.finish();
    }
}

criterion_group!(benches, raster, inference);
criterion_main!(benches);
