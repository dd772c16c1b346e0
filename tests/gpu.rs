//! Everything that needs an adapter: one binary, one device, one test at a time.
//!
//! Without an adapter the tests print that they are skipped; with `NNGTL_REQUIRE_GPU_TESTS=1` in
//! the environment they fail instead. A hardware GPU is taken if there is one, else a software
//! adapter (Mesa's lavapipe).
#![cfg(feature = "gpu")]
#![allow(clippy::print_stdout)] // tells which adapter was tested, and what was skipped

mod common;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock};

use nalgebra::Point2;
use nngtl::bench::inference::SampleMission;
use nngtl::encoding::{AutomatonGraph, MapInput, MapTensor};
use nngtl::nn::Predictor;
use nngtl::nn::device::{AdapterSummary, DeviceChoice, DeviceKind, Fallback};
use nngtl::nn::gpu::kernels::Tile;
use nngtl::nn::gpu::{Gpu, GpuSettings, Use};
use nngtl::nn::inputs::Inputs;
use nngtl::nn::models::Model;
use nngtl::nn::program::{Activation, Extent, Op, Program, Source};
use nngtl::nn::weights::WeightFile;

/// How far an adapter's probabilities may be from PyTorch's: its order of summation and its
/// exponential are its own.
const MODEL_TOLERANCE: f32 = 5e-5;

type Shared = Option<(DeviceChoice, Mutex<Gpu>)>;

/// The device that all tests share, or a printed line.
fn device(test: &str) -> Option<(DeviceChoice, MutexGuard<'static, Gpu>)> {
    static DEVICE: OnceLock<Shared> = OnceLock::new();
    let shared = DEVICE.get_or_init(|| {
        let found = [DeviceChoice::Gpu, DeviceChoice::Software]
            .into_iter()
            .find_map(|choice| {
                let gpu = Gpu::open(choice, &[]).ok()?;
                println!("testing on {} ({:?})", gpu.name(), gpu.kind());
                Some((choice, Mutex::new(gpu)))
            });
        let required = std::env::var("NNGTL_REQUIRE_GPU_TESTS").is_ok_and(|v| v == "1");
        assert!(
            found.is_some() || !required,
            "NNGTL_REQUIRE_GPU_TESTS=1, and there is no adapter"
        );
        found
    });
    match shared {
        Some((choice, gpu)) => Some((
            *choice,
            gpu.lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner),
        )),
        None => {
            println!("skipped: {test} (no adapter)");
            None
        }
    }
}

fn run(gpu: &Gpu, program: &Program, inputs: &Inputs<'_>) -> Vec<f32> {
    gpu.reload(&[program]).unwrap();
    gpu.run(&[program], &[*inputs]).unwrap().remove(0)
}

#[test]
fn every_operation_agrees_with_pytorch() {
    let Some((_, gpu)) = device("every_operation_agrees_with_pytorch") else {
        return;
    };
    for case in common::ops::cases() {
        case.check(&mut |program, inputs| run(&gpu, program, inputs));
    }
}

#[test]
fn every_tile_agrees_with_pytorch() {
    let Some((choice, gpu)) = device("every_tile_agrees_with_pytorch") else {
        return;
    };
    // What a software adapter never picks by itself, and a hardware GPU hardly for small shapes.
    gpu.use_tiles(Tile::for_hardware);
    for case in common::ops::cases() {
        case.check(&mut |program, inputs| run(&gpu, program, inputs));
    }
    gpu.use_tiles(|_, _| Tile {
        rows: 16,
        columns: 16,
    });
    for case in common::ops::cases() {
        case.check(&mut |program, inputs| run(&gpu, program, inputs));
    }
    if choice == DeviceChoice::Software {
        gpu.use_tiles(Tile::for_software);
    }
}

#[test]
fn guidance_is_that_of_the_cpu_and_survives_the_loss_of_the_device() {
    let test = "guidance_is_that_of_the_cpu_and_survives_the_loss_of_the_device";
    let Some((choice, _turn)) = device(test) else {
        return;
    };
    let file = |name: &str| {
        std::fs::read(common::goldens().join(format!("models/{name}.safetensors"))).unwrap()
    };
    let (path, state) = (file("pathnet-paint-200"), file("statenet-lookup"));
    let files = [("path", path.as_slice()), ("state", state.as_slice())];
    let mut device = Predictor::from_bytes(files, choice).unwrap();
    let mut cpu = Predictor::from_bytes(files, DeviceChoice::Cpu).unwrap();
    assert_ne!(device.device(), "cpu");
    let region = [(0.6, 0.6), (0.8, 0.6), (0.7, 0.8)].map(|(x, y)| Point2::new(x, y));
    let map = MapInput {
        bounds: [Point2::origin(), Point2::new(1.0, 1.0)],
        obstacles: vec![],
        regions: vec![&region],
        start: Point2::new(0.1, 0.1),
        ways: Vec::new(),
    };
    // A small automaton, then a large one, then the small one again: buffers grow and stay.
    for count in [2u32, 300, 2] {
        let graph = AutomatonGraph {
            regions: 1,
            states: (0..count)
                .map(|q| [f32::from(u8::from(q == 0)), 0.0, 0.5])
                .collect(),
            literals: (0..3 * count).map(|t| (t % 3) as i8 - 1).collect(),
            ends: (0..3 * count).map(|t| (t % count, t * 7 % count)).collect(),
        };
        let ours = device.predict(&map, &graph).unwrap().0;
        let expected = cpu.predict(&map, &graph).unwrap().0;
        let error = common::difference(&ours.heatmap.values, &expected.heatmap.values);
        assert!(error < MODEL_TOLERANCE, "heatmap off by {error}");
        let error = common::difference(&ours.states, &expected.states);
        assert!(error < MODEL_TOLERANCE, "states off by {error}");
        assert_eq!(device.take_notice(), None);
    }
    // Many at once: as one by one.
    let graphs: Vec<AutomatonGraph> = (1..6u32)
        .map(|count| AutomatonGraph {
            regions: 1,
            states: (0..count).map(|q| [0.0, 1.0, q as f32 / 6.0]).collect(),
            literals: (0..2 * count).map(|t| (t % 2) as i8).collect(),
            ends: (0..2 * count).map(|t| (t % count, t * 3 % count)).collect(),
        })
        .collect();
    let missions: Vec<_> = graphs.iter().map(|g| [(&map, g), (&map, g)]).collect();
    for (found, graph) in device.predict_many(&missions).into_iter().zip(&graphs) {
        assert_eq!(found.unwrap().0, device.predict(&map, graph).unwrap().0);
    }
    device.lose_device();
    let graph = AutomatonGraph {
        regions: 1,
        states: vec![[1.0; 3]],
        literals: vec![1],
        ends: vec![(0, 0)],
    };
    let ours = device.predict(&map, &graph).unwrap().0;
    assert_eq!(
        ours,
        cpu.predict(&map, &graph).unwrap().0,
        "the CPU takes over"
    );
    assert_eq!(device.device(), "cpu");
    assert!(matches!(device.take_notice(), Some(Fallback::Lost { .. })));
    assert_eq!(device.take_notice(), None, "told once");
}

#[test]
fn adapters_can_be_listed() {
    let Some((choice, _turn)) = device("adapters_can_be_listed") else {
        return;
    };
    let adapters = nngtl::nn::device::adapters();
    for adapter in &adapters {
        println!("{adapter:?}");
    }
    let software = |kind| kind == DeviceKind::Software;
    assert!(
        adapters
            .iter()
            .any(|a| software(a.kind) == (choice == DeviceChoice::Software))
    );
}

#[test]
fn a_device_that_is_not_there_is_told_and_replaced() {
    // In another process, where no Vulkan driver can be found (other interfaces may have some).
    let exe = std::env::current_exe().unwrap();
    let child = std::process::Command::new(exe)
        .args(["--exact", "child_without_a_driver", "--include-ignored"])
        .env("VK_ICD_FILENAMES", "none.json")
        .env("VK_DRIVER_FILES", "none.json")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success(), "{text}");
    assert!(text.contains("1 passed"), "{text}");
}

#[test]
#[ignore = "run by a_device_that_is_not_there_is_told_and_replaced in a process of its own"]
fn child_without_a_driver() {
    if !nngtl::nn::device::adapters().is_empty() {
        return;
    }
    for choice in [DeviceChoice::Gpu, DeviceChoice::Software] {
        let reason = Gpu::open(choice, &[])
            .map(|gpu| gpu.name().to_owned())
            .unwrap_err();
        assert_eq!(reason, Fallback::NoAdapter { wanted: choice });
    }
}

#[test]
fn every_network_agrees_with_pytorch() {
    let Some((_, gpu)) = device("every_network_agrees_with_pytorch") else {
        return;
    };
    for golden in common::model_goldens() {
        let inputs = Inputs {
            map: &golden.map,
            graph: &golden.graph,
            given: &[],
        };
        let program = &golden.model.program;
        let first = run(&gpu, program, &inputs);
        let error = common::difference(&first, &golden.output);
        println!("{}: {error:.1e}", golden.name);
        assert!(error < MODEL_TOLERANCE, "{}: off by {error}", golden.name);
        // A second run finds all buffers full and must not see what the first left there.
        assert_eq!(
            gpu.run(&[program], &[inputs]).unwrap().remove(0),
            first,
            "{}",
            golden.name
        );
    }
}

#[test]
fn weights_of_half_precision_stay_so_on_the_device() {
    let Some((_, gpu)) = device("weights_of_half_precision_stay_so_on_the_device") else {
        return;
    };
    // Rounding each weight to eleven bits moves probabilities by this much at most here.
    const HALF_TOLERANCE: f32 = 4e-3;
    for golden in common::model_goldens().into_iter().take(4) {
        let inputs = Inputs {
            map: &golden.map,
            graph: &golden.graph,
            given: &[],
        };
        let whole = run(&gpu, &golden.model.program, &inputs);
        let mut program = golden.model.program.clone();
        program.half = true;
        let halved = run(&gpu, &program, &inputs);
        let error = common::difference(&halved, &golden.output);
        println!("{} with 16-bit weights: {error:.1e}", golden.name);
        assert!(error < HALF_TOLERANCE, "{}: off by {error}", golden.name);
        assert_ne!(halved, whole, "{}: nothing was rounded", golden.name);
    }
}

/// An adapter with an ability switched on, or a printed line where it lacks that.
fn with_ability(
    choice: DeviceChoice,
    settings: &GpuSettings,
    has: impl Fn(&AdapterSummary) -> bool,
) -> Option<Gpu> {
    let gpu = Gpu::open_with(choice, &[], settings).unwrap();
    let adapters = nngtl::nn::device::adapters();
    if adapters.iter().any(|a| a.name == gpu.name() && has(a)) {
        return Some(gpu);
    }
    println!("skipped: {} lacks the ability for {settings:?}", gpu.name());
    None
}

#[test]
fn products_in_16_bit_floats_are_near_pytorch() {
    // Eleven bits for factors, products and sums of sixteen: 2⁻¹¹ in each layer, some twenty of
    // them, on probabilities.
    const NARROW_TOLERANCE: f32 = 1e-2;
    let Some((choice, _turn)) = device("products_in_16_bit_floats_are_near_pytorch") else {
        return;
    };
    let settings = GpuSettings {
        narrow: Use::On,
        ..GpuSettings::default()
    };
    let Some(gpu) = with_ability(choice, &settings, |a| a.f16) else {
        return;
    };
    for golden in common::model_goldens() {
        let inputs = Inputs {
            map: &golden.map,
            graph: &golden.graph,
            given: &[],
        };
        for half in [false, true] {
            let mut program = golden.model.program.clone();
            program.half = half;
            let narrow = run(&gpu, &program, &inputs);
            let error = common::difference(&narrow, &golden.output);
            println!(
                "{}, 16-bit products, weights halved {half}: {error:.1e}",
                golden.name
            );
            assert!(error < NARROW_TOLERANCE, "{}: off by {error}", golden.name);
            assert_ne!(
                narrow, golden.output,
                "{}: nothing was rounded",
                golden.name
            );
        }
    }
}

#[test]
fn values_beyond_16_bit_floats_are_computed_in_32() {
    let Some((choice, _turn)) = device("values_beyond_16_bit_floats_are_computed_in_32") else {
        return;
    };
    let settings = GpuSettings {
        narrow: Use::On,
        ..GpuSettings::default()
    };
    let Some(gpu) = with_ability(choice, &settings, |a| a.f16) else {
        return;
    };
    let mut program = Program::default();
    let x = program.matrix(Extent::Fixed(1), 2);
    program.input(Source::Constant(3e4), x);
    let y = program.matrix(Extent::Fixed(1), 1);
    let weight = program.constant(nngtl::nn::weights::linear_weights(&[2.0, 3.0], 1));
    let bias = program.constant(vec![1.0]);
    program.push(Op::Linear {
        x,
        second: None,
        weight,
        bias,
        activation: Activation::None,
        y,
    });
    program.output = Some(y);
    let map = MapTensor::default();
    let graph = AutomatonGraph {
        regions: 0,
        states: vec![[0.0; 3]],
        literals: Vec::new(),
        ends: Vec::new(),
    };
    let inputs = Inputs {
        map: &map,
        graph: &graph,
        given: &[],
    };
    assert_eq!(run(&gpu, &program, &inputs), [150_001.0]);
}

#[test]
fn sums_by_subgroups_agree_with_pytorch() {
    let Some((choice, _turn)) = device("sums_by_subgroups_agree_with_pytorch") else {
        return;
    };
    let settings = GpuSettings {
        subgroups: Use::On,
        ..GpuSettings::default()
    };
    let Some(gpu) = with_ability(choice, &settings, |a| a.subgroups) else {
        return;
    };
    for case in common::ops::cases() {
        case.check(&mut |program, inputs| run(&gpu, program, inputs));
    }
}

#[test]
fn compiled_kernels_are_kept_and_what_is_wrong_with_them_is_no_error() {
    let test = "compiled_kernels_are_kept_and_what_is_wrong_with_them_is_no_error";
    let Some((choice, _turn)) = device(test) else {
        return;
    };
    let golden = common::model_goldens().remove(0);
    let inputs = Inputs {
        map: &golden.map,
        graph: &golden.graph,
        given: &[],
    };
    let programs = [&golden.model.program];
    let start = |folder: &Path| {
        let settings = GpuSettings {
            kernel_cache: Some(folder.to_owned()),
            ..GpuSettings::default()
        };
        let begin = std::time::Instant::now();
        let gpu = Gpu::open_with(choice, &programs, &settings).unwrap();
        let output = gpu.run(&programs, &[inputs]).unwrap().remove(0);
        println!("start with {}: {:?}", folder.display(), begin.elapsed());
        let error = common::difference(&output, &golden.output);
        assert!(error < MODEL_TOLERANCE, "off by {error}");
    };
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("kernels");
    start(&folder);
    let has = |a: &AdapterSummary| a.pipeline_cache;
    if with_ability(choice, &GpuSettings::default(), has).is_none() {
        assert!(!folder.exists(), "nothing is kept without a cache");
        return;
    }
    let files = || -> Vec<PathBuf> {
        let entries = std::fs::read_dir(&folder).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    };
    let [file] = files()
        .try_into()
        .expect("one file, nothing left beside it");
    let kept = std::fs::read(&file).unwrap();
    // Warm: there is nothing new to be kept.
    let written = || std::fs::metadata(&file).unwrap().modified().unwrap();
    let before = written();
    start(&folder);
    assert_eq!(written(), before);
    // Damaged and cut short: compiled anew, and mended.
    for damaged in [
        [&kept[..kept.len() - 1], &[kept[kept.len() - 1] ^ 1]].concat(),
        kept[..kept.len() / 2].to_vec(),
        Vec::new(),
    ] {
        std::fs::write(&file, &damaged).unwrap();
        start(&folder);
        assert_ne!(std::fs::read(&file).unwrap(), damaged);
        assert_eq!(files(), std::slice::from_ref(&file));
    }
    // A folder that cannot be: the file stands where it would have to.
    start(&file.join("kernels"));
}

#[test]
fn what_both_networks_see_is_sent_once() {
    let Some((_, gpu)) = device("what_both_networks_see_is_sent_once") else {
        return;
    };
    let built_in = nngtl::nn::embedded()
        .unwrap()
        .map(|bytes| Model::new(&WeightFile::parse("built-in", bytes).unwrap()).unwrap());
    let mission = SampleMission::default();
    let map = mission.raster(built_in[0].program.resolution);
    let inputs = mission.inputs(&map);
    let programs = built_in.each_ref().map(|m| &m.program);
    let sent = |work: &mut dyn FnMut() -> Vec<Vec<f32>>| {
        let before = gpu.uploaded();
        (work(), gpu.uploaded() - before)
    };
    let (alone, apart) = sent(&mut || programs.map(|p| run(&gpu, p, &inputs)).to_vec());
    gpu.reload(&programs).unwrap();
    for _ in 0..2 {
        let (both, together) = sent(&mut || gpu.run(&programs, &[inputs, inputs]).unwrap());
        assert_eq!(both, alone);
        println!("sent {together} bytes together, {apart} apart");
        assert!(together < apart, "{together} bytes together, {apart} apart");
    }
    // Networks that are shown different missions get what is theirs.
    let other = AutomatonGraph {
        regions: 1,
        states: vec![[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]],
        literals: vec![1, -1, 0],
        ends: vec![(0, 1), (0, 0), (1, 1)],
    };
    let second = Inputs {
        graph: &other,
        ..inputs
    };
    let expected = [
        run(&gpu, programs[0], &inputs),
        run(&gpu, programs[1], &second),
    ];
    gpu.reload(&programs).unwrap();
    assert_eq!(gpu.run(&programs, &[inputs, second]).unwrap(), expected);
    assert_eq!(gpu.run(&programs, &[inputs, inputs]).unwrap(), alone);
}

#[test]
fn a_device_that_is_lost_says_so() {
    // Waits its turn: devices of one process share a driver.
    let Some((choice, _turn)) = device("a_device_that_is_lost_says_so") else {
        return;
    };
    let golden = common::model_goldens().remove(0);
    let inputs = Inputs {
        map: &golden.map,
        graph: &golden.graph,
        given: &[],
    };
    let programs = [&golden.model.program];
    let gpu = Gpu::open(choice, &programs).unwrap();
    assert!(gpu.run(&programs, &[inputs]).is_ok());
    gpu.lose();
    let reason = gpu.run(&programs, &[inputs]).unwrap_err();
    assert!(matches!(reason, Fallback::Lost { .. }), "{reason}");
}

#[test]
fn memory_that_is_not_there_is_told() {
    let test = "memory_that_is_not_there_is_told";
    let Some((choice, gpu)) = device(test) else {
        return;
    };
    // A terabyte of fixed size is refused at once.
    let mut program = Program::default();
    program.map(1, 1 << 19, 1 << 19);
    let refused = Gpu::open(choice, &[&program]).unwrap_err();
    assert!(matches!(refused, Fallback::Unfit { .. }), "{refused}");
    // So is, in the middle of the work, what grows with the automaton: 80 GB for this one.
    let mut program = Program::default();
    let x = program.matrix(Extent::States, 200_000);
    program.input(Source::Constant(0.5), x.columns(0, 1));
    let y = program.matrix(Extent::Fixed(1), 1);
    program.push(Op::MeanRows {
        x: x.columns(0, 1),
        y,
    });
    program.output = Some(y);
    let graph = |states: usize| AutomatonGraph {
        regions: 0,
        states: vec![[0.0; 3]; states],
        literals: Vec::new(),
        ends: Vec::new(),
    };
    let map = MapTensor::default();
    let run = |states: usize| {
        let graph = graph(states);
        let inputs = Inputs {
            map: &map,
            graph: &graph,
            given: &[],
        };
        gpu.run(&[&program], &[inputs])
    };
    gpu.reload(&[&program]).unwrap();
    assert_eq!(run(2).unwrap(), [[0.5]]);
    let lost = run(400).unwrap_err();
    assert!(matches!(lost, Fallback::Lost { .. }), "{lost}");
}
