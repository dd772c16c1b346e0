//! `nngtl devices`.
use super::console::Console;
use super::failure::Failure;
pub(super) fn run(console: &Console) -> Result<(), Failure> {
    Ok(console.result("cpu\n")?)
}
