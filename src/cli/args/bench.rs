//! What can be typed after `nngtl bench`.

use std::path::PathBuf;

use clap::{ArgGroup, Args, Subcommand, ValueEnum};

use super::dataset::{family_weight, share};
use super::{DeviceName, GuidedArgs, LimitArgs, NetworkArgs, count, seconds};
use crate::bench::COMPLEX_FROM;
use crate::dataset::maps::Family;
use crate::dataset::{MAX_STATES, RANDOM_SHARE};
use crate::planner::Settings;

/// Compare samplers on the same missions
///
/// Every mission is searched by every sampler with the same seeds until its first plan. `directed` and `flat`
/// are the guided rule without networks: what the networks add is what lies below them. Ratios come with 95 %
/// bootstrap intervals. Without SCENARIOS, missions like the paper's are drawn.
///
/// With --out, a folder gets a report with plots, every run as CSV and JSON, and costs over time beside the
/// exact planner's plan; with --gaps, too, those costs alone. Ctrl-C ends with the report of what is done; the same
/// command goes on from there.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl bench scenarios/*.toml\n  nngtl bench --out table-one\n  nngtl bench --gaps --iterations 2000 --out gaps\n  nngtl bench --families mazes,blobs --missions 200 --samplers biased,directed,guided\n  nngtl bench data --limit 200 --trials 5 --report bench.md --csv bench.csv"
)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(group = ArgGroup::new("follows").multiple(true))]
pub(in crate::cli) struct BenchArgs {
    #[command(subcommand)]
    pub(in crate::cli) table: Option<BenchCommand>,
    /// Scenario files, or folders of generated data sets [default: drawn, see --missions]
    #[arg(value_name = "SCENARIOS")]
    pub(in crate::cli) scenarios: Vec<PathBuf>,
    /// What to compare
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "NAMES",
        default_value = "uniform,biased,directed,flat,guided,auto"
    )]
    pub(in crate::cli) samplers: Vec<StrategyName>,
    /// What runs the networks; with several, guided sampling is run with each
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAMES", default_values_t = [DeviceName::Auto])]
    pub(in crate::cli) device: Vec<DeviceName>,
    /// The folder of the weights (pathnet.safetensors, statenet.safetensors) instead of the
    /// built-in ones
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) model: Option<PathBuf>,
    /// Runs of each sampler on each mission [default: 5, with --gaps 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) trials: Option<u64>,
    /// Samples to draw at most; runs that end there count as that many
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    pub(in crate::cli) iterations: u64,
    /// Seed of the first run
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) seed: u64,
    /// Iterations of uniform sampling to the first prefix (median) from which on a mission is complex
    #[arg(long, value_name = "N", default_value_t = COMPLEX_FROM)]
    pub(in crate::cli) complex_from: u64,
    #[command(flatten)]
    pub(in crate::cli) missions: BenchMissionArgs,
    /// Probability to draw towards the target instead of uniformly
    #[arg(long, value_name = "P", default_value_t = Settings::default().y_rand)]
    pub(in crate::cli) y_rand: f64,
    /// Probability to draw on the shortest way itself: in the target's region if that is in sight, else at the next bend (ours, 0 in the paper)
    #[arg(long, value_name = "P", default_value_t = Settings::default().p_target)]
    pub(in crate::cli) p_target: f64,
    /// Probability that a choice follows the predicted states
    #[arg(long, value_name = "P", default_value_t = Settings::default().alpha)]
    pub(in crate::cli) alpha: f64,
    /// Guided sampling exactly as in the paper (C-1 and C-2, y_rand and α 0.8), without what nngtl adds
    #[arg(long)]
    pub(in crate::cli) paper_rule: bool,
    #[command(flatten)]
    pub(in crate::cli) guided: GuidedArgs,
    #[command(flatten)]
    pub(in crate::cli) costs: BenchCostArgs,
    /// Write report.md with plots, and every run as CSV and JSON, to this folder; continue what is there
    #[arg(long, value_name = "DIR", group = "follows", help_heading = "Files")]
    pub(in crate::cli) out: Option<PathBuf>,
    /// Write the tables as Markdown
    #[arg(
        long,
        value_name = "FILE.md",
        conflicts_with = "out",
        help_heading = "Files"
    )]
    pub(in crate::cli) report: Option<PathBuf>,
    /// Write every run as a line of comma-separated values
    #[arg(
        long,
        value_name = "FILE.csv",
        conflicts_with = "out",
        help_heading = "Files"
    )]
    pub(in crate::cli) csv: Option<PathBuf>,
}

/// Which missions of a comparison.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Missions")]
pub(in crate::cli) struct BenchMissionArgs {
    /// Missions at most, from the front
    #[arg(long, value_name = "N")]
    pub(in crate::cli) limit: Option<usize>,
    /// Missions to draw if no SCENARIOS are named, each on a map of its own
    #[arg(
        long,
        value_name = "N",
        default_value_t = 240,
        value_parser = clap::value_parser!(u64).range(1..),
        conflicts_with = "scenarios"
    )]
    pub(in crate::cli) missions: u64,
    /// Families of the drawn maps and how often each is drawn: paper, clutter, rooms, floors, mazes, blobs, large, small, published
    /// [default: published, which are those of the paper's Table I]
    #[arg(long, value_delimiter = ',', value_parser = family_weight, value_name = "NAME=WEIGHT,…", conflicts_with = "scenarios")]
    families: Vec<(Family, f64)>,
    /// The share of drawn missions whose formula is a random syntax tree, like all of the paper's, or one of --formulas; the others
    /// follow patterns that robots use [default: 1 for the published family alone and with --formulas, else 0.2]
    #[arg(
        long,
        value_name = "SHARE",
        value_parser = share,
        conflicts_with = "scenarios"
    )]
    random_formulas: Option<f64>,
    /// Draw from the formulas in this file, one a line over l1 to l7 or a to g, instead of random syntax trees
    #[arg(long, value_name = "FILE", conflicts_with = "scenarios")]
    pub(in crate::cli) formulas: Option<PathBuf>,
    /// Leave out drawn missions whose automaton accepts after fewer steps [default: 2 for the published family alone, as its authors
    /// did, else 0]
    #[arg(long, value_name = "N", conflicts_with = "scenarios")]
    min_steps: Option<u32>,
    /// Leave out drawn missions whose automaton has more states
    #[arg(long, value_name = "N", default_value_t = MAX_STATES, value_parser = count, conflicts_with = "scenarios")]
    pub(in crate::cli) most_states: usize,
    /// Seed of the drawn missions, apart from the seeds that the networks were trained on
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1_000,
        conflicts_with = "scenarios"
    )]
    pub(in crate::cli) mission_seed: u64,
    #[command(flatten)]
    pub(in crate::cli) limits: LimitArgs,
}

impl BenchMissionArgs {
    /// The families to draw from, with their weights.
    pub(in crate::cli) fn families(&self) -> Vec<(Family, f64)> {
        match self.families.as_slice() {
            [] => vec![(Family::Published, 1.0)],
            some => some.to_vec(),
        }
    }

    /// Whether the missions are drawn as the paper's authors drew theirs, but for what the arguments say.
    fn is_published(&self) -> bool {
        let families = self.families();
        families
            .iter()
            .all(|&(family, _)| family == Family::Published)
    }

    /// The share of formulas that follow no pattern.
    pub(in crate::cli) fn random_share(&self) -> f64 {
        let all = self.is_published() || self.formulas.is_some();
        let usual = if all { 1.0 } else { RANDOM_SHARE };
        self.random_formulas.unwrap_or(usual)
    }

    /// Missions whose automaton accepts after fewer steps are left out.
    pub(in crate::cli) fn min_steps(&self) -> u32 {
        let usual = if self.is_published() { 2 } else { 0 };
        self.min_steps.unwrap_or(usual)
    }
}

/// How costs are followed over time.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Costs over time")]
pub(in crate::cli) struct BenchCostArgs {
    /// Search on to the last iteration (or second, see --time-limit) and report how near the cost comes
    /// to the exact planner's plan, and when
    #[arg(long, group = "follows")]
    pub(in crate::cli) gaps: bool,
    /// With --out: iterations of the searches that go on; 0 leaves them out. With --gaps, --iterations says it
    #[arg(
        long,
        value_name = "N",
        default_value_t = 2_000,
        requires = "out",
        conflicts_with = "gaps"
    )]
    pub(in crate::cli) cost_iterations: u64,
    /// With --out: searches of each sampler on each mission that go on. With --gaps, --trials says it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..), requires = "out", conflicts_with = "gaps")]
    pub(in crate::cli) cost_trials: u64,
    /// With --gaps or --out: seconds of each search that goes on, at most
    #[arg(long, value_name = "S", value_parser = seconds, requires = "follows")]
    pub(in crate::cli) time_limit: Option<f64>,
    /// With --gaps or --out: certified lower bounds too, which take seconds a mission
    #[arg(long, requires = "follows")]
    pub(in crate::cli) bounds: bool,
}

/// A sampler of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum StrategyName {
    /// Uniform sampling
    Uniform,
    /// Biased sampling
    Biased,
    /// The rules of guided sampling without networks, as plan has them
    Directed,
    /// The guided rule with a flat heatmap and flat state probabilities
    Flat,
    /// Guided by the networks
    Guided,
    /// What plan does of itself: directed, guided once the search has lasted so long that networks pay
    Auto,
    /// The guided rule with a data set's labels in place of the networks: the most they could gain
    Oracle,
}

/// A benchmark of its own.
#[derive(Debug, Subcommand)]
pub(in crate::cli) enum BenchCommand {
    Transfer(BenchTransferArgs),
    Inference(BenchInferenceArgs),
}

/// Measure transfer planning as its paper does
///
/// Table I and II on the paper's grid with the paper's figures beside ours, and the same in the
/// continuous workspace of the TL-RRT* reference case.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl bench transfer\n  nngtl bench transfer --table 1 --hoa automata --report table.md"
)]
pub(in crate::cli) struct BenchTransferArgs {
    /// Which tables
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "NAMES",
        default_value = "1,2,continuous"
    )]
    pub(in crate::cli) table: Vec<TransferTable>,
    /// Runs of each formula, and in each changed environment
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) trials: u64,
    /// Changed environments for each formula and number of obstacles
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) environments: u64,
    /// Seed of the first run
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) seed: u64,
    /// Seconds of each anytime phase, at most
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "1")]
    pub(in crate::cli) anytime: f64,
    /// Count subtasks on these automata, too: a folder of phi1.hoa to phi6.hoa
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) hoa: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) network: NetworkArgs,
    /// Write the tables as Markdown
    #[arg(long, value_name = "FILE.md")]
    pub(in crate::cli) report: Option<PathBuf>,
}

/// Measure the networks on this machine's devices
///
/// Every model given or found in `models/`, and the paper's networks with random weights, on every
/// device: start-up, first run and steady state, beside the device's measured peak. Then guided
/// against biased search with inference included: from when on guidance pays.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl bench inference\n  nngtl bench inference --device cpu --report inference.md --csv inference.csv --plot inference.svg\n  nngtl bench inference --model models/mine --no-paper scenarios/*.toml"
)]
pub(in crate::cli) struct BenchInferenceArgs {
    /// Missions to compare samplers on: scenario files or folders of data sets [default: generated]
    #[arg(value_name = "SCENARIOS")]
    pub(in crate::cli) scenarios: Vec<PathBuf>,
    /// Weight files or folders of two to measure [default: those in models/, else the built-in ones]
    #[arg(long, value_name = "FILE|DIR")]
    pub(in crate::cli) model: Vec<PathBuf>,
    /// Leave out the paper's networks with random weights
    #[arg(long)]
    pub(in crate::cli) no_paper: bool,
    /// Measure on this device alone
    #[arg(long, value_enum, value_name = "NAME")]
    pub(in crate::cli) device: Option<DeviceName>,
    /// Threads of the CPU path
    #[arg(long, value_name = "N", value_parser = count, default_value = "1")]
    pub(in crate::cli) threads: usize,
    /// Runs of each network on each device, at least
    #[arg(long, value_name = "N", value_parser = count, default_value = "30")]
    pub(in crate::cli) runs: usize,
    /// Seconds for each network on each device, about
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "2")]
    pub(in crate::cli) seconds: f64,
    /// Missions to compare samplers on, at most; 0 leaves the comparison out
    #[arg(long, value_name = "N", default_value_t = 60)]
    pub(in crate::cli) missions: usize,
    /// Runs of each sampler on each mission
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    pub(in crate::cli) trials: u64,
    /// Seed of the missions and of the first run
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) seed: u64,
    /// Write the tables as Markdown
    #[arg(long, value_name = "FILE.md")]
    pub(in crate::cli) report: Option<PathBuf>,
    /// Write one line of comma-separated values for each network and device
    #[arg(long, value_name = "FILE.csv")]
    pub(in crate::cli) csv: Option<PathBuf>,
    /// Draw the latencies
    #[arg(long, value_name = "FILE.svg|png")]
    pub(in crate::cli) plot: Option<PathBuf>,
}

/// A table of the transfer benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum TransferTable {
    /// Table I: new formulas
    #[value(name = "1")]
    One,
    /// Table II: changed environments
    #[value(name = "2")]
    Two,
    /// The continuous workspace
    Continuous,
}
