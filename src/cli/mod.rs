//! The command line: what was typed becomes calls of the library, and their results become text,
//! JSON and files.
//!
//! Exit codes are a contract: 0 done; 1 no plan found, or a plan refused; 2 bad input. Results go to
//! stdout, everything else to stderr.

mod args;
mod bench;
mod bench_inference;
mod bench_transfer;
mod console;
mod devices;
mod failure;
mod files;
mod generate;
mod heatmap;
mod interrupt;
mod library;
mod model;
mod plan;
mod replan;
mod transfer;
mod translate;
mod verify;

use std::io::Write as _;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{ColorChoice, CommandFactory, FromArgMatches};

use args::{BenchCommand, Cli, Command, DatasetCommand, LibraryCommand, ModelCommand};
use console::Console;
use failure::Failure;

/// Runs the program with the arguments of the process; returns its exit code.
#[must_use]
pub fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    let cli = match parse(&arguments) {
        Ok(cli) => cli,
        Err(e) => {
            // Help and version come this way too, with code 0; a closed pipe is no error.
            let is_help = e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
            if e.use_stderr() && !is_help {
                let _ = write!(std::io::stderr(), "nngtl: ");
            }
            let _ = e.print();
            if e.use_stderr() && arguments.iter().any(|a| a == "--json") {
                let text = e.render().to_string();
                let first = text.split("\n\n").next().unwrap_or_default();
                let message = first.trim_start_matches("error: ").replace("\n", " ");
                let _ = writeln!(std::io::stdout(), "{}", Failure::input(message).to_json());
            }
            return ExitCode::from(u8::try_from(e.exit_code()).unwrap_or(2));
        }
    };
    start_logging(cli.global.quiet);
    let console = Console::new(&cli.global);
    match run(&cli.command, &console) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if console.json() && !failure.told {
                let _ = console.result(&format!("{}\n", failure.to_json()));
            }
            console.error(&failure.message);
            if let Some(snippet) = &failure.snippet {
                console.snippet(snippet);
            }
            ExitCode::from(failure.code)
        }
    }
}

fn run(command: &Command, console: &Console) -> Result<(), Failure> {
    match command {
        Command::Plan(args) => plan::run(args, console),
        Command::Verify(args) => verify::run(args, console),
        Command::Translate(args) => translate::run(args, console),
        Command::Heatmap(args) => heatmap::run(args, console),
        Command::Devices(_) => devices::run(console),
        Command::Model(ModelCommand::Show { file }) => model::show(file, console),
        Command::Library(LibraryCommand::Build(args)) => library::build(args, console),
        Command::Library(LibraryCommand::Show(args)) => library::show(args, console),
        Command::Library(LibraryCommand::Merge(args)) => library::merge(args, console),
        Command::Transfer(args) => transfer::run(args, console),
        Command::Replan(args) => replan::run(args, console),
        Command::Bench(args) => match &args.table {
            Some(BenchCommand::Transfer(args)) => bench_transfer::run(args, console),
            Some(BenchCommand::Inference(args)) => bench_inference::run(args, console),
            None => bench::run(args, console),
        },
        Command::Dataset(DatasetCommand::Generate(args)) => generate::run(args, console),
        Command::Dataset(DatasetCommand::Merge(args)) => generate::merge_parts(args, console),
    }
}

/// Parses the arguments. Errors of parsing are coloured as `--color` asks, which therefore has to
/// be looked up first.
fn parse(arguments: &[std::ffi::OsString]) -> Result<Cli, clap::Error> {
    let matches = with_negative_numbers(Cli::command())
        .color(wanted_colour(arguments))
        .try_get_matches_from(arguments)?;
    Cli::from_arg_matches(&matches)
}

/// Lets `-1` be a value, so that what is wrong with it is told by the option that it was given to.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    command
        .mut_args(|arg| {
            let takes = arg.get_action().takes_values();
            arg.allow_negative_numbers(takes)
        })
        .mut_subcommands(with_negative_numbers)
}

fn wanted_colour(arguments: &[std::ffi::OsString]) -> ColorChoice {
    let words: Vec<&str> = arguments.iter().filter_map(|a| a.to_str()).collect();
    let split = words.windows(2).filter(|w| w[0] == "--color").map(|w| w[1]);
    let joined = words.iter().filter_map(|w| w.strip_prefix("--color="));
    match split.chain(joined).next_back() {
        Some("always") => ColorChoice::Always,
        Some("never") => ColorChoice::Never,
        _ => ColorChoice::Auto,
    }
}

/// Sends the library's log to stderr, as `RUST_LOG` asks; without it, warnings of this program.
fn start_logging(quiet: bool) {
    // What drivers and their loader complain of reaches users as the reason why the CPU took over.
    let default = if quiet {
        "error,wgpu_hal=off"
    } else {
        "error,wgpu_hal=off,nngtl=warn"
    };
    let environment = env_logger::Env::default().default_filter_or(default);
    let mut builder = env_logger::Builder::from_env(environment);
    if std::env::var_os("RUST_LOG").is_none() {
        builder.format(|out, record| {
            // As in the program's own messages.
            let level = match record.level() {
                log::Level::Warn => "warning".to_owned(),
                other => other.as_str().to_lowercase(),
            };
            writeln!(out, "nngtl: {level}: {}", record.args())
        });
    }
    // A second call, as tests of the library may make, keeps the first logger.
    let _ = builder.try_init();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definitions_are_consistent() {
        with_negative_numbers(Cli::command()).debug_assert();
    }

    #[test]
    fn every_command_shows_an_example() {
        fn check(command: &clap::Command) {
            let mut leaves = command.get_subcommands().peekable();
            if leaves.peek().is_none() {
                let help = command.get_after_help().map(ToString::to_string);
                assert!(
                    help.is_some_and(|h| h.contains("Example") && h.contains("nngtl ")),
                    "`{}` has no example",
                    command.get_name()
                );
            }
            leaves.for_each(check);
        }
        check(&Cli::command());
    }

    #[test]
    fn the_last_colour_wins() {
        let colour =
            |words: &[&str]| wanted_colour(&words.iter().map(Into::into).collect::<Vec<_>>());
        assert_eq!(colour(&["nngtl", "--color", "never"]), ColorChoice::Never);
        assert_eq!(colour(&["nngtl", "--color=always"]), ColorChoice::Always);
        assert_eq!(colour(&["nngtl"]), ColorChoice::Auto);
    }
}
