//! Whole networks on the CPU against PyTorch (`training/nngtl_training/goldens.py` makes the files).
#![allow(clippy::print_stdout)] // tells how far off each network is

mod common;

use nngtl::nn::cpu::Session;
use nngtl::nn::inputs::Inputs;

#[test]
fn every_network_agrees_with_pytorch() {
    for golden in common::model_goldens() {
        let inputs = Inputs {
            map: &golden.map,
            graph: &golden.graph,
            given: &[],
        };
        let mut session = Session::new(1);
        let first = session.run(&golden.model.program, &inputs).to_vec();
        let error = common::difference(&first, &golden.output);
        println!("{}: {error:.1e}", golden.name);
        assert!(
            error < common::MODEL_TOLERANCE,
            "{}: off by {error}",
            golden.name
        );
        // The second run reuses all memory and must not see what the first left there.
        assert_eq!(
            session.run(&golden.model.program, &inputs),
            first,
            "{}",
            golden.name
        );
    }
}
