//! Each operation alone, on the CPU, against PyTorch.

mod common;

use nngtl::nn::cpu::Session;

#[test]
fn every_operation_agrees_with_pytorch() {
    let cases = common::ops::cases();
    assert!(cases.len() > 80);
    for case in cases {
        case.check(&mut |program, inputs| Session::new(1).run(program, inputs).to_vec());
    }
}

#[test]
fn several_threads_give_the_same() {
    for case in common::ops::cases() {
        case.check(&mut |program, inputs| Session::new(4).run(program, inputs).to_vec());
    }
}
