//! The command line; everything it does is done by the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    nngtl::cli::main()
}
