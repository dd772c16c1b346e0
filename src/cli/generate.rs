//! `nngtl dataset generate`.
use super::args::GenerateArgs;
use super::console::Console;
use super::failure::Failure;
pub(super) fn run(_: &GenerateArgs, _: &Console) -> Result<(), Failure> { Ok(()) }
