//! How long the networks take: each model on the CPU and on the adapters that are there.
//!
//! The paper's networks have random weights; the input is a map with seven regions and an automaton
//! of 12 states and 60 transitions. Timed is one run of one network with its inputs encoded: filling buffers,
//! computing, reading back. Opening a device, compiling kernels and the first run are not.
//! `cargo bench --bench inference -- cpu/PathNet` runs some of them.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nngtl::bench::inference::{Network, SampleMission, Weights, paper_networks};
use nngtl::encoding::MapTensor;
use nngtl::nn::Predictor;
use nngtl::nn::cpu::Session;
use nngtl::nn::embedded;
use nngtl::nn::inputs::Inputs;
use nngtl::nn::models::Model;

/// The built-in networks and the paper's in its widths.
fn models() -> Vec<(String, Model)> {
    let built_in = embedded().into_iter().flatten();
    let named = ["built-in PathNet", "built-in StateNet"]
        .into_iter()
        .zip(built_in);
    let files = named.map(|(name, bytes)| Network {
        name: name.to_owned(),
        weights: Weights::File(bytes.to_vec()),
    });
    let paper = paper_networks().expect("the configurations are sound");
    files
        .chain(paper)
        .map(|n| (n.name.clone(), n.build().expect("the weights are sound")))
        .collect()
}

fn raster(c: &mut Criterion) {
    let mission = SampleMission::default();
    for resolution in [100, 200] {
        c.bench_function(&format!("raster/{resolution}"), |b| {
            b.iter(|| MapTensor::new(&mission.map(), resolution))
        });
    }
}

fn inference(c: &mut Criterion) {
    let mission = SampleMission::default();
    for (name, model) in models() {
        let map = mission.raster(model.program.resolution);
        let inputs = mission.inputs(&map);
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

/// What a mission waits for: loading the built-in weights, and encoding with both networks.
fn mission(c: &mut Criterion) {
    let mission = SampleMission::default();
    let load = || Predictor::embedded(nngtl::nn::DeviceChoice::Cpu).expect("weights are built in");
    c.bench_function("mission/load", |b| b.iter(load));
    let mut predictor = load();
    let map = mission.map();
    c.bench_function("mission/predict", |b| {
        b.iter(|| predictor.predict(&map, &mission.graph).expect("it fits").1)
    });
}

criterion_group!(benches, raster, mission, inference);
criterion_main!(benches);
