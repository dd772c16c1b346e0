//! What can be typed after `nngtl dataset`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::count;
use crate::dataset::maps::{Family, UnknownFamily};
use crate::dataset::{MAX_STATES, MISSIONS_PER_MAP, RANDOM_SHARE};

/// A family of maps, with its weight if that is not 1.
pub(super) fn family_weight(text: &str) -> Result<(Family, f64), String> {
    let (name, weight) = text.split_once('=').unwrap_or((text, "1"));
    let family: Family = name
        .trim()
        .parse()
        .map_err(|e: UnknownFamily| e.to_string())?;
    let expected = || format!("expected a weight from 0 up after `{name}=`, found `{weight}`");
    let number: f64 = weight.trim().parse().map_err(|_| expected())?;
    let usable = number.is_finite() && number >= 0.0;
    usable.then_some((family, number)).ok_or_else(expected)
}

/// A share of a whole.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.trim().parse().ok();
    let usable = number.filter(|n| (0.0..=1.0).contains(n));
    usable.ok_or_else(|| "expected a share from 0 to 1".to_owned())
}

/// Make training data
#[derive(Debug, Subcommand)]
pub(in crate::cli) enum DatasetCommand {
    Generate(GenerateArgs),
    Merge(MergeArgs),
}

/// Generate random scenarios with expert plans
///
/// Writes shards that depend on the seed alone. The same command goes on after an interruption, and with more
/// --missions it extends a set that is there.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl dataset generate --out data --missions 6000 --seed 1\n  nngtl dataset generate --out mazes --missions 600 --families mazes=2,blobs"
)]
pub(in crate::cli) struct GenerateArgs {
    /// The folder to write to; what is already there is kept, completed and extended
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) out: PathBuf,
    /// How many missions to draw, rounded up to whole maps
    #[arg(long, value_name = "N", default_value_t = 6000, value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) missions: u64,
    /// Missions on each map
    #[arg(long, value_name = "N", default_value_t = MISSIONS_PER_MAP as u64, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(in crate::cli) per_map: u64,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) seed: u64,
    /// Families of maps and how often each is drawn: paper, clutter, rooms, floors, mazes, blobs, large, small, published
    /// [default: paper=0.55,clutter=0.25,rooms=0.2]
    #[arg(long, value_delimiter = ',', value_parser = family_weight, value_name = "NAME=WEIGHT,…")]
    pub(in crate::cli) families: Vec<(Family, f64)>,
    /// The share of missions whose formula is a random syntax tree, like the paper's, or one of --formulas; the others follow
    /// patterns that robots use [default: 0.2, with --formulas 1]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    random_formulas: Option<f64>,
    /// Draw from the formulas in this file, one a line over l1 to l7 or a to g, instead of random syntax trees
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) formulas: Option<PathBuf>,
    /// Leave out missions whose automaton accepts after fewer steps
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) min_steps: u32,
    /// Leave out missions whose automaton has more states
    #[arg(long, value_name = "N", default_value_t = MAX_STATES, value_parser = count)]
    pub(in crate::cli) most_states: usize,
    /// Who plans the missions
    #[arg(long, value_enum, value_name = "NAME", default_value_t = ExpertName::Exact)]
    pub(in crate::cli) expert: ExpertName,
    /// Make one part of several alone, counted from 1, each in a folder of its own (a cluster's job array);
    /// `nngtl dataset merge` puts them together. A part is at least one shard of 100 maps (fewer in the last)
    #[arg(long, value_name = "K/N", value_parser = part_of)]
    pub(in crate::cli) part: Option<(u64, u64)>,
    /// Threads to use, 0 for one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) threads: usize,
}

impl GenerateArgs {
    /// The share of formulas that follow no pattern.
    pub(in crate::cli) fn random_share(&self) -> f64 {
        let usual = if self.formulas.is_some() {
            1.0
        } else {
            RANDOM_SHARE
        };
        self.random_formulas.unwrap_or(usual)
    }
}

/// Who plans the missions of a data set.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(in crate::cli) enum ExpertName {
    /// The exact planner: milliseconds a mission
    Exact,
    /// The paper's expert: 10,000 iterations of biased TL-RRT*, some tenths of a second a mission
    TlRrtStar,
}

/// Put parts of a data set together
///
/// Copies the shards of all parts into one folder, with one manifest: the same files as if the set had been
/// made in one place.
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  nngtl dataset generate --missions 100000 --part 1/8 --out part-1   # … to 8/8\n  nngtl dataset merge part-* --out data"
)]
pub(in crate::cli) struct MergeArgs {
    /// The folders of the parts
    #[arg(value_name = "PARTS", required = true)]
    pub(in crate::cli) parts: Vec<PathBuf>,
    /// The folder to write to
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) out: PathBuf,
}

fn part_of(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/');
    numbers
        .and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)))
        .ok_or_else(|| "expected a part and how many there are, as in 3/8".to_owned())
}
