//! What can be typed.

mod bench;
mod dataset;
mod skills;

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};

use crate::automaton::Limits;
use crate::nn::DeviceChoice;
use crate::planner::Settings;

pub(super) use bench::{
    BenchArgs, BenchCommand, BenchInferenceArgs, BenchMissionArgs, BenchTransferArgs, StrategyName,
    TransferTable,
};

pub(super) use dataset::{DatasetCommand, ExpertName, GenerateArgs, MergeArgs};
pub(super) use skills::{
    LibraryBuildArgs, LibraryCommand, LibraryMergeArgs, LibraryShowArgs, ReplanArgs, TransferArgs,
};

/// Endings that promise a picture in another format than ours.
const FOREIGN: [&str; 10] = [
    "jpg", "jpeg", "gif", "webp", "avif", "bmp", "tif", "tiff", "pdf", "eps",
];

/// The file of a picture in a format, svg or png, whose name does not promise another one.
fn picture(format: &'static str) -> impl TypedValueParser<Value = PathBuf> {
    let other = if format == "svg" { "png" } else { "svg" };
    PathBufValueParser::new().try_map(move |path| {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let why = match ending.as_deref() {
            Some(ending) if ending == other => format!("that is a name for `--{other}`"),
            Some(ending) if FOREIGN.contains(&ending) => format!("no `.{ending}` can be written"),
            _ => return Ok(path),
        };
        Err(format!("{why}; here {} is written", format.to_uppercase()))
    })
}

/// Plans robot missions given in temporal logic, guided by neural networks.
///
/// A mission is a formula over the named regions of a map, as in "[]<> dock && (!dock U load)". The
/// plan is a path that is walked once and a loop that is walked for ever, checked leg by leg
/// against the map and the formula before it is returned.
#[derive(Debug, Parser)]
#[command(
    name = "nngtl",
    version,
    max_term_width = 100,
    subcommand_required = true,
    arg_required_else_help = true,
    args_override_self = true,
    after_help = "Exit codes: 0 done; 1 no plan found, or a plan refused; 2 bad input.\n\nExample:\n  nngtl plan scenarios/case-study.toml --svg plan.svg"
)]
pub(super) struct Cli {
    #[command(flatten)]
    pub(super) global: Global,
    #[command(subcommand)]
    pub(super) command: Command,
}

/// Options of every command.
#[derive(Args, Clone, Debug)]
pub(super) struct Global {
    /// Say nothing but results and errors
    #[arg(long, short, global = true, help_heading = "Output")]
    pub(super) quiet: bool,
    /// When to use colours
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        value_name = "WHEN",
        help_heading = "Output"
    )]
    pub(super) color: Color,
    /// Print the result as one JSON object with a `version` field
    #[arg(long, global = true, help_heading = "Output")]
    pub(super) json: bool,
}

/// When to use colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Color {
    /// On a terminal, unless NO_COLOR is set
    #[default]
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Plan(Box<PlanArgs>),
    Verify(VerifyArgs),
    Translate(TranslateArgs),
    Heatmap(HeatmapArgs),
    Devices(DevicesArgs),
    #[command(subcommand)]
    Model(ModelCommand),
    #[command(subcommand)]
    Dataset(DatasetCommand),
    #[command(subcommand)]
    Library(LibraryCommand),
    Transfer(TransferArgs),
    Replan(ReplanArgs),
    Bench(BenchArgs),
}

/// Plan a mission
///
/// Reads a scenario, searches for a plan of least cost until the budget ends, checks the plan, and
/// writes it and pictures of it where asked. Ctrl-C ends the search with the best plan so far.
#[derive(Args, Clone, Debug)]
#[command(
    group = ArgGroup::new("picture").args(["svg", "png"]).multiple(true),
    after_help = "Examples:\n  nngtl plan scenarios/case-study.toml --out plan.json --svg plan.svg\n  nngtl plan scenarios/patrol.toml --sampler biased --first --seed 7\n  nngtl plan scenarios/many.jsonl --pick shuttle --time-limit 2 --json"
)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    pub(super) mission: MissionArgs,
    #[command(flatten)]
    pub(super) network: NetworkArgs,
    /// Where to look next
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub(super) sampler: SamplerName,
    /// Plan for this automaton (HOA) instead of the scenario's formula
    #[arg(long, value_name = "FILE.hoa", conflicts_with = "task")]
    pub(super) automaton: Option<PathBuf>,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
    #[command(flatten)]
    pub(super) search: SearchArgs,
    /// Write the plan to this file
    #[arg(long, value_name = "FILE.json", help_heading = "Files")]
    pub(super) out: Option<PathBuf>,
    /// Draw map and plan as SVG
    #[arg(long, value_name = "FILE.svg", value_parser = picture("svg"), help_heading = "Files")]
    pub(super) svg: Option<PathBuf>,
    /// Draw map and plan as PNG
    #[arg(long, value_name = "FILE.png", value_parser = picture("png"), help_heading = "Files")]
    pub(super) png: Option<PathBuf>,
    /// Write the heatmap, as PNG or as NumPy array (.npy)
    #[arg(long, value_name = "FILE", help_heading = "Files")]
    pub(super) heatmap: Option<PathBuf>,
    /// Draw the search trees, too
    #[arg(long, requires = "picture", help_heading = "Files")]
    pub(super) tree: bool,
}

/// Which mission.
#[derive(Args, Clone, Debug)]
pub(super) struct MissionArgs {
    /// The scenario: .toml, .json, or .jsonl (see --pick)
    #[arg(value_name = "SCENARIO")]
    pub(super) scenario: PathBuf,
    /// Which scenario of a .jsonl file: its name, or the number of its line
    #[arg(long, value_name = "NAME|LINE")]
    pub(super) pick: Option<String>,
    /// Another mission for this map
    #[arg(long, value_name = "FORMULA")]
    pub(super) task: Option<String>,
    /// What errors call the other mission
    #[arg(skip)]
    pub(super) task_of: Option<PathBuf>,
    /// Another weight of the prefix in the cost, from 0 to 1
    #[arg(long, value_name = "LAMBDA")]
    pub(super) weight: Option<f64>,
}

/// Which networks, where.
#[derive(Args, Clone, Debug)]
pub(super) struct NetworkArgs {
    /// What runs the networks
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub(super) device: DeviceName,
    /// The folder of the weights (pathnet.safetensors, statenet.safetensors) instead of the
    /// built-in ones
    #[arg(long, value_name = "DIR")]
    pub(super) model: Option<PathBuf>,
}

/// Budget and parameters of the search; the defaults are the papers' values.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Search")]
pub(super) struct SearchArgs {
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = Settings::default().seed)]
    pub(super) seed: u64,
    /// Samples to draw at most
    #[arg(long, value_name = "N", default_value_t = Settings::default().iterations)]
    pub(super) iterations: u64,
    /// Seconds to search at most; the result then depends on the machine
    #[arg(long, value_name = "S")]
    pub(super) time_limit: Option<f64>,
    /// Searches to run side by side, each with the whole budget; the best plan wins
    #[arg(long, value_name = "N", default_value_t = Settings::default().threads)]
    pub(super) threads: usize,
    /// Stop at the first feasible plan
    #[arg(long)]
    pub(super) first: bool,
    /// Factor of the near radius, relative to the map's side
    #[arg(long, value_name = "R", default_value_t = Settings::default().radius)]
    pub(super) radius: f64,
    /// Largest near radius, relative to the map's side
    #[arg(long, value_name = "R", default_value_t = Settings::default().max_radius)]
    pub(super) max_radius: f64,
    /// Shorten the plans that are found (never with --first)
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    pub(super) shorten: bool,
    /// Pass over points that no cheaper plan can visit
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    pub(super) informed: bool,
    /// At most this times ln(n+1) near sites of a tree of n are connected, the nearest
    #[arg(long, value_name = "K", default_value_t = Settings::default().neighbours)]
    pub(super) neighbours: f64,
    /// Longest new edge, relative to the map's side [default: as drawn]
    #[arg(long, value_name = "R")]
    pub(super) range: Option<f64>,
    /// Probability to extend from the nodes closest to acceptance [directed, guided: from a tree's 33rd sample on]
    #[arg(long, value_name = "P", default_value_t = Settings::default().p_closest)]
    pub(super) p_closest: f64,
    /// Probability to draw towards the target instead of uniformly [directed, guided: from a tree's 33rd sample on]
    #[arg(long, value_name = "P", default_value_t = Settings::default().y_rand)]
    pub(super) y_rand: f64,
    /// Probability to draw on the shortest way: from the target's region in sight, else the next bend
    #[arg(long, value_name = "P", default_value_t = Settings::default().p_target)]
    pub(super) p_target: f64,
    /// Standard deviation of the drawn distance, relative to the map's side
    #[arg(long, value_name = "R", default_value_t = Settings::default().distance_deviation)]
    pub(super) distance_deviation: f64,
    /// Standard deviation of the drawn angle, in radians
    #[arg(long, value_name = "RAD", default_value_t = Settings::default().angle_deviation)]
    pub(super) angle_deviation: f64,
    /// Probability that a choice follows the predicted states [from a tree's 33rd sample on]
    #[arg(long, value_name = "P", default_value_t = Settings::default().alpha)]
    pub(super) alpha: f64,
    #[command(flatten)]
    pub(super) guided: GuidedArgs,
}

/// Where to look next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum SamplerName {
    /// Directed for 100 samples; the networks, if they fit the mission, guide what comes after
    #[default]
    Auto,
    /// Uniformly over the free space
    Uniform,
    /// Towards what the automaton needs next
    Biased,
    /// By the rules of guided sampling, without networks
    Directed,
    /// As the networks predict
    Guided,
    /// No sampling: an exact search over the map's corners
    Exact,
}

/// What runs the networks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum DeviceName {
    /// GPU or CPU, whichever is done sooner
    #[default]
    Auto,
    /// A hardware GPU
    Gpu,
    /// A software adapter (for tests)
    Software,
    /// The CPU
    Cpu,
}

impl From<DeviceName> for DeviceChoice {
    fn from(name: DeviceName) -> Self {
        match name {
            DeviceName::Auto => Self::Auto,
            DeviceName::Gpu => Self::Gpu,
            DeviceName::Software => Self::Software,
            DeviceName::Cpu => Self::Cpu,
        }
    }
}

/// Check a plan
///
/// Follows every leg, collects what the robot sees, and evaluates the mission on it, independently
/// of any planner. Exit code 0 if the plan is good, 1 with the reason if not.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  nngtl verify scenarios/case-study.toml plan.json")]
pub(super) struct VerifyArgs {
    #[command(flatten)]
    pub(super) mission: MissionArgs,
    /// The plan; `version`, `prefix` and `suffix` are enough
    #[arg(value_name = "PLAN.json")]
    pub(super) plan: PathBuf,
    /// Check against this automaton (HOA) instead of the scenario's formula
    #[arg(long, value_name = "FILE.hoa", conflicts_with = "task")]
    pub(super) automaton: Option<PathBuf>,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

/// Translate a formula to a Büchi automaton
///
/// Without a map, the letters are all combinations of the formula's propositions; with one, only
/// those that occur on it, and what a patrol visits is waited for in the order of a short tour: this
/// is the automaton whose states plans on that map name.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl translate '[]<> a && (!a U b)'\n  nngtl translate 'G(load -> F unload)' --format dot | dot -Tsvg > automaton.svg"
)]
pub(super) struct TranslateArgs {
    /// The formula, in the syntax of Spot or SPIN
    #[arg(value_name = "FORMULA")]
    pub(super) formula: String,
    /// How to print the automaton
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    pub(super) format: AutomatonFormat,
    /// Use the letters of this scenario's map, and the tours of its patrols
    #[arg(long, value_name = "FILE")]
    pub(super) scenario: Option<PathBuf>,
    /// Which scenario of a .jsonl file: its name, or the number of its line
    #[arg(long, value_name = "NAME|LINE", requires = "scenario")]
    pub(super) pick: Option<String>,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

/// How large a translation may grow.
#[derive(Args, Clone, Debug)]
pub(super) struct LimitArgs {
    /// The most states that any automaton on the way from the formula may have
    #[arg(long, value_name = "N", default_value_t = Limits::default().states, help_heading = "Translation")]
    pub(super) max_states: usize,
    /// The most transitions that any automaton on the way from the formula may have
    #[arg(long, value_name = "N", default_value_t = Limits::default().transitions, help_heading = "Translation")]
    pub(super) max_transitions: usize,
    /// The most seconds to translate for
    #[arg(
        long,
        value_name = "S",
        default_value = "10",
        value_parser = duration,
        help_heading = "Translation"
    )]
    pub(super) max_translation: Duration,
}

impl From<&LimitArgs> for Limits {
    fn from(args: &LimitArgs) -> Self {
        Self {
            states: args.max_states,
            transitions: args.max_transitions,
            time: Some(args.max_translation),
        }
    }
}

/// Seconds, with or without a fraction.
fn duration(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok();
    let found = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    found.ok_or_else(|| "expected seconds from 0 up, as in 0.5".to_owned())
}

/// As [`duration`], as a number.
fn seconds(text: &str) -> Result<f64, String> {
    duration(text).map(|seconds| seconds.as_secs_f64())
}

/// A number of things, at least one.
fn count(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|&n: &usize| n > 0);
    number.ok_or_else(|| "expected a whole number from 1 up".to_owned())
}

/// How to print an automaton.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum AutomatonFormat {
    /// A table to read
    #[default]
    Text,
    /// The Hanoi omega-automata format
    Hoa,
    /// Graphviz
    Dot,
}

/// Run the networks alone
///
/// Writes the heatmap and prints the state probabilities and where the time went.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl heatmap scenarios/case-study.toml --out heat.png\n  nngtl heatmap scenarios/case-study.toml --out heat.npy --device software"
)]
pub(super) struct HeatmapArgs {
    #[command(flatten)]
    pub(super) mission: MissionArgs,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
    #[command(flatten)]
    pub(super) network: NetworkArgs,
    /// Where to write the heatmap: .png for a picture, .npy for the numbers
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,
}

/// List the devices that can run the networks
#[derive(Args, Debug)]
#[command(after_help = "\
Environment:
  NNGTL_GPU_F16=on|off        Products in 16-bit floats wherever the adapter can, or nowhere
  NNGTL_GPU_SUBGROUPS=on|off  Subgroup operations wherever the adapter can, or nowhere
  NNGTL_KERNEL_CACHE=DIR|off  Where compiled kernels are kept

Example:
  nngtl devices")]
pub(super) struct DevicesArgs {}

/// Look at weight files
#[derive(Debug, Subcommand)]
pub(super) enum ModelCommand {
    /// Show a weight file: configuration, tensors, size, training record
    #[command(after_help = "Example:\n  nngtl model show models/compact")]
    Show {
        /// The weight file, or a folder of two
        #[arg(value_name = "FILE")]
        file: PathBuf,
    },
}

/// How guided sampling goes beyond the paper; 0 is the paper's rule.
#[derive(Args, Clone, Debug)]
pub(super) struct GuidedArgs {
    /// Directed and guided: probability to extend the node with the least way left, to the nearest of some targets, not
    /// nodes and targets drawn uniformly
    #[arg(long, value_name = "P", default_value_t = Settings::default().lead)]
    pub(super) lead: f64,
    /// Directed and guided: probability to draw from the target's region, or from or beside one on the way, once a straight leg leads there
    #[arg(long, value_name = "P", default_value_t = Settings::default().p_region)]
    pub(super) p_region: f64,
    /// Directed and guided: half side of the square around the next corner of the shortest way, relative to the map's side
    #[arg(long, value_name = "R", default_value_t = Settings::default().corner)]
    pub(super) corner: f64,
    /// Guided: wait for the networks before the first sample, and not only before the 25th (StateNet) and the 65th (PathNet)
    #[arg(long)]
    pub(super) networks_first: bool,
}
