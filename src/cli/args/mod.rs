//! What can be typed.

mod bench;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::automaton::Limits;
use crate::dataset::maps::{Family, UnknownFamily};
use crate::nn::DeviceChoice;
use crate::planner::Settings;
use crate::transfer::BuildSettings;

pub(super) use bench::{
    BenchArgs, BenchCommand, BenchInferenceArgs, BenchMissionArgs, BenchTransferArgs, StrategyName,
    TransferTable,
};

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
    #[arg(long, value_name = "FILE.svg", help_heading = "Files")]
    pub(super) svg: Option<PathBuf>,
    /// Draw map and plan as PNG
    #[arg(long, value_name = "FILE.png", help_heading = "Files")]
    pub(super) png: Option<PathBuf>,
    /// Write the heatmap, as PNG or as NumPy array (.npy)
    #[arg(long, value_name = "FILE", help_heading = "Files")]
    pub(super) heatmap: Option<PathBuf>,
    /// Draw the search trees, too
    #[arg(long, help_heading = "Files")]
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
    /// Probability to extend from the nodes closest to acceptance
    #[arg(long, value_name = "P", default_value_t = Settings::default().p_closest)]
    pub(super) p_closest: f64,
    /// Probability to draw towards the target instead of uniformly
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
    /// Probability that a choice follows the predicted states
    #[arg(long, value_name = "P", default_value_t = Settings::default().alpha)]
    pub(super) alpha: f64,
    #[command(flatten)]
    pub(super) guided: GuidedArgs,
}

/// Where to look next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum SamplerName {
    /// Guided if the networks fit the mission and the search is long enough for them to pay, else directed
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
}

/// Translate a formula to a Büchi automaton
///
/// Without a map, the letters are all combinations of the formula's propositions; with one, only
/// those that occur on it.
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
    /// Use the letters of this scenario's map
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
        default_value_t = 10,
        help_heading = "Translation"
    )]
    pub(super) max_translation: u32,
}

impl From<&LimitArgs> for Limits {
    fn from(args: &LimitArgs) -> Self {
        Self {
            states: args.max_states,
            transitions: args.max_transitions,
            time: Some(Duration::from_secs(args.max_translation.into())),
        }
    }
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
    #[command(after_help = "Example:\n  nngtl model show models/pathnet.safetensors")]
    Show {
        /// The weight file, or a folder of two
        #[arg(value_name = "FILE")]
        file: PathBuf,
    },
}

/// A family of maps, with its weight if that is not 1.
fn family_weight(text: &str) -> Result<(Family, f64), String> {
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

/// Make training data
#[derive(Debug, Subcommand)]
pub(super) enum DatasetCommand {
    Generate(GenerateArgs),
    Merge(MergeArgs),
}

/// Generate random scenarios with expert plans
///
/// Writes shards that can be resumed after an interruption and depend on the seed alone.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl dataset generate --out data --missions 6000 --seed 1\n  nngtl dataset generate --out mazes --missions 600 --families mazes=2,blobs"
)]
pub(super) struct GenerateArgs {
    /// The folder to write to; what is already there is kept and completed
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// How many missions to draw, six on each map
    #[arg(long, value_name = "N", default_value_t = 6000)]
    pub(super) missions: u64,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Families of maps and how often each is drawn: paper, clutter, rooms, mazes, blobs, large, small
    /// [default: paper=0.55,clutter=0.25,rooms=0.2]
    #[arg(long, value_delimiter = ',', value_parser = family_weight, value_name = "NAME=WEIGHT,…")]
    pub(super) families: Vec<(Family, f64)>,
    /// Who plans the missions
    #[arg(long, value_enum, value_name = "NAME", default_value_t = ExpertName::Exact)]
    pub(super) expert: ExpertName,
    /// Make one part of several alone, counted from 1, each in a folder of its own (a cluster's job array);
    /// `nngtl dataset merge` puts them together
    #[arg(long, value_name = "K/N", value_parser = part_of)]
    pub(super) part: Option<(u64, u64)>,
    /// Threads to use, 0 for one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) threads: usize,
}

/// Who plans the missions of a data set.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum ExpertName {
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
pub(super) struct MergeArgs {
    /// The folders of the parts
    #[arg(value_name = "PARTS", required = true)]
    pub(super) parts: Vec<PathBuf>,
    /// The folder to write to
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

fn part_of(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/');
    numbers
        .and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)))
        .ok_or_else(|| "expected a part and how many there are, as in 3/8".to_owned())
}

/// How guided sampling goes beyond the paper; 0 is the paper's rule.
#[derive(Args, Clone, Debug)]
pub(super) struct GuidedArgs {
    /// Guided: probability to extend the node with the least way left, not one drawn uniformly
    #[arg(long, value_name = "P", default_value_t = Settings::default().lead)]
    pub(super) lead: f64,
    /// Guided: probability to draw from the target's region, or one on the way, once a straight leg leads there
    #[arg(long, value_name = "P", default_value_t = Settings::default().p_region)]
    pub(super) p_region: f64,
    /// Guided: half side of the square around the next corner of the shortest way, relative to the map's side
    #[arg(long, value_name = "R", default_value_t = Settings::default().corner)]
    pub(super) corner: f64,
}

/// Build and look at libraries of skills
#[derive(Debug, Subcommand)]
pub(super) enum LibraryCommand {
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
pub(super) struct LibraryBuildArgs {
    #[command(flatten)]
    pub(super) mission: MissionArgs,
    #[command(flatten)]
    pub(super) network: NetworkArgs,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,
    /// Add to the library that is in the file already
    #[arg(long)]
    pub(super) extend: bool,
    /// Where to look next: uniform or guided
    #[arg(long, value_enum, default_value_t = SamplerName::Uniform, value_name = "NAME")]
    pub(super) sampler: SamplerName,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Places to sample at most; each is offered to every subtree
    #[arg(long, value_name = "N", default_value_t = BuildSettings::default().samples)]
    pub(super) samples: u64,
    /// End once all subtrees together hold so many product states
    #[arg(long, value_name = "N", default_value_t = BuildSettings::default().nodes)]
    pub(super) nodes: u64,
    /// Draw map and skills as SVG
    #[arg(long, value_name = "FILE.svg")]
    pub(super) svg: Option<PathBuf>,
    /// Draw map and skills as PNG
    #[arg(long, value_name = "FILE.png")]
    pub(super) png: Option<PathBuf>,
}

/// Show what is in a library
///
/// With a scenario, every skill is checked on its map, and those that do not hold there are told.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl library show skills.library\n  nngtl library show skills.library --scenario scenarios/transfer-grid.toml --svg skills.svg"
)]
pub(super) struct LibraryShowArgs {
    /// The library
    #[arg(value_name = "FILE")]
    pub(super) library: PathBuf,
    /// Check the skills on this scenario's map
    #[arg(long, value_name = "SCENARIO")]
    pub(super) scenario: Option<PathBuf>,
    /// Which scenario of a .jsonl file: its name, or the number of its line
    #[arg(long, value_name = "NAME|LINE", requires = "scenario")]
    pub(super) pick: Option<String>,
    /// Draw map and skills as SVG
    #[arg(long, value_name = "FILE.svg", requires = "scenario")]
    pub(super) svg: Option<PathBuf>,
    /// Draw map and skills as PNG
    #[arg(long, value_name = "FILE.png", requires = "scenario")]
    pub(super) png: Option<PathBuf>,
}

/// Put libraries of one map together
#[derive(Args, Debug)]
#[command(
    after_help = "Example:\n  nngtl library merge monday.library tuesday.library --out week.library"
)]
pub(super) struct LibraryMergeArgs {
    /// The libraries
    #[arg(value_name = "FILES", required = true, num_args = 2..)]
    pub(super) libraries: Vec<PathBuf>,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,
}

/// Plan a mission with a library of skills
///
/// Matches the mission's subtasks with skills, joins them to a first plan, and keeps improving until
/// the budget ends. A library of another map is checked skill by skill and never trusted.
///
/// `--sampler auto` is `uniform` here: the first plan is made of skills and needs no sample.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  nngtl transfer scenarios/transfer-grid.jsonl --pick transfer-phi4 --library skills.library --first\n  nngtl transfer scenarios/tl-rrt-star.toml --library skills.library --learn --svg plan.svg"
)]
pub(super) struct TransferArgs {
    #[command(flatten)]
    pub(super) plan: PlanArgs,
    /// The library
    #[arg(long, value_name = "FILE")]
    pub(super) library: PathBuf,
    /// Add what the plan learned to the library, which must be one of this very map
    #[arg(long)]
    pub(super) learn: bool,
}

/// Repair a plan for a changed scenario
///
/// Only the segments that new obstacles broke are planned again. Where that is not possible, the
/// mission is planned anew, with the library if one is given: that is quicker, and often cheaper. The whole plan
/// is checked. The mission is that of the plan, unless `--task` names another.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  nngtl replan changed.toml plan.json --out repaired.json")]
pub(super) struct ReplanArgs {
    #[command(flatten)]
    pub(super) plan: PlanArgs,
    /// The plan that was made before the change
    #[arg(value_name = "PLAN.json")]
    pub(super) old: PathBuf,
    /// A library for planning anew
    #[arg(long, value_name = "FILE")]
    pub(super) library: Option<PathBuf>,
}
