//! What can be typed after `nngtl library`, `nngtl transfer` and `nngtl replan`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{LimitArgs, MissionArgs, NetworkArgs, PlanArgs, SamplerName, picture, seconds};
use crate::transfer::BuildSettings;

/// Build and look at libraries of skills
#[derive(Debug, Subcommand)]
pub(in crate::cli) enum LibraryCommand {
    Build(LibraryBuildArgs),
    Show(LibraryShowArgs),
    Merge(LibraryMergeArgs),
}

/// Build a library of skills from a mission
///
/// Decomposes the mission into subtasks and learns a path for each. The library belongs to the
/// scenario's map; other missions on the same map reuse it.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl library build scenarios/transfer-grid.toml --out skills.library\n  nngtl library build scenarios/tl-rrt-star.toml --task '<> l1 && <> l2 && <> l3' --sampler guided --out skills.library --svg skills.svg"
)]
pub(in crate::cli) struct LibraryBuildArgs {
    #[command(flatten)]
    pub(in crate::cli) mission: MissionArgs,
    #[command(flatten)]
    pub(in crate::cli) limits: LimitArgs,
    #[command(flatten)]
    pub(in crate::cli) network: NetworkArgs,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) out: PathBuf,
    /// Add to the library that is in the file already
    #[arg(long)]
    pub(in crate::cli) extend: bool,
    /// Where to look next: uniform or guided
    #[arg(long, value_enum, default_value_t = SamplerName::Uniform, value_name = "NAME")]
    pub(in crate::cli) sampler: SamplerName,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) seed: u64,
    /// Places to sample at most; each is offered to every subtree
    #[arg(long, value_name = "N", default_value_t = BuildSettings::default().samples, value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) samples: u64,
    /// End once all subtrees together hold so many product states
    #[arg(long, value_name = "N", default_value_t = BuildSettings::default().nodes, value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) nodes: u64,
    /// End after so many seconds with what was learned by then, which depends on the machine
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(in crate::cli) time_limit: Option<f64>,
    /// Draw map and skills as SVG
    #[arg(long, value_name = "FILE.svg", value_parser = picture("svg"))]
    pub(in crate::cli) svg: Option<PathBuf>,
    /// Draw map and skills as PNG
    #[arg(long, value_name = "FILE.png", value_parser = picture("png"))]
    pub(in crate::cli) png: Option<PathBuf>,
}

/// Show what is in a library
///
/// With a scenario, every skill is checked on its map, and those that do not hold there are told.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl library show skills.library\n  nngtl library show skills.library --scenario scenarios/transfer-grid.toml --svg skills.svg"
)]
pub(in crate::cli) struct LibraryShowArgs {
    /// The library
    #[arg(value_name = "FILE")]
    pub(in crate::cli) library: PathBuf,
    /// Check the skills on this scenario's map
    #[arg(long, value_name = "SCENARIO")]
    pub(in crate::cli) scenario: Option<PathBuf>,
    /// Which scenario of a .jsonl file: its name, or the number of its line
    #[arg(long, value_name = "NAME|LINE", requires = "scenario")]
    pub(in crate::cli) pick: Option<String>,
    /// Draw map and skills as SVG
    #[arg(long, value_name = "FILE.svg", value_parser = picture("svg"), requires = "scenario")]
    pub(in crate::cli) svg: Option<PathBuf>,
    /// Draw map and skills as PNG
    #[arg(long, value_name = "FILE.png", value_parser = picture("png"), requires = "scenario")]
    pub(in crate::cli) png: Option<PathBuf>,
}

/// Put libraries of one map together
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  nngtl library merge monday.library tuesday.library --out week.library"
)]
pub(in crate::cli) struct LibraryMergeArgs {
    /// The libraries
    #[arg(value_name = "FILES", required = true, num_args = 2..)]
    pub(in crate::cli) libraries: Vec<PathBuf>,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) out: PathBuf,
}

/// Plan a mission with a library of skills
///
/// Matches the mission's subtasks with skills, joins them to a first plan, and keeps improving until
/// the budget ends. A library of another map is checked skill by skill and never trusted.
///
/// `--sampler auto` is `directed` here: where skills join to a plan the first one needs no sample, and where one is
/// missing, directed samples fill the gap (the paper's are `uniform`).
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl transfer scenarios/transfer-grid.jsonl --pick transfer-phi4 --library skills.library --first\n  nngtl transfer scenarios/tl-rrt-star.toml --library skills.library --learn --svg plan.svg"
)]
pub(in crate::cli) struct TransferArgs {
    #[command(flatten)]
    pub(in crate::cli) plan: PlanArgs,
    /// The library
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) library: PathBuf,
    /// Add what the plan learned to the library, which must be one of this very map
    #[arg(long)]
    pub(in crate::cli) learn: bool,
}

/// Repair a plan for a changed scenario
///
/// Only the segments that new obstacles broke are planned again. Where that is not possible, the
/// mission is planned anew, with the library if one is given: that is quicker, and often cheaper. The whole plan
/// is checked. The mission and the prefix's weight are those of the plan, whatever the scenario says, unless `--task` or `--weight` name others.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  nngtl replan changed.toml plan.json --out repaired.json")]
pub(in crate::cli) struct ReplanArgs {
    #[command(flatten)]
    pub(in crate::cli) plan: PlanArgs,
    /// The plan that was made before the change
    #[arg(value_name = "PLAN.json")]
    pub(in crate::cli) old: PathBuf,
    /// A library for planning anew
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) library: Option<PathBuf>,
}
