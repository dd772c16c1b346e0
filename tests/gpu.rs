//! Everything that needs an adapter: one binary, one device, one test at a time.
//!
//! Without an adapter the tests print that they are skipped; with `NNGTL_REQUIRE_GPU_TESTS=1` in
//! the environment they fail instead. A hardware GPU is taken if there is one, else a software
//! adapter (Mesa's lavapipe).
#![cfg(feature = "gpu")]
#![allow(clippy::print_stdout)] // tells which adapter was tested, and what was skipped

mod common;

use std::sync::{Mutex, MutexGuard, OnceLock};

use nngtl::nn::device::{DeviceChoice, Fallback};
use nngtl::nn::gpu::Gpu;
use nngtl::nn::inputs::Inputs;
use nngtl::nn::program::Program;

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
