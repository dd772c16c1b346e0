//! Writing a data set: shards in parallel threads, resumable after a kill at any moment.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use flate2::Compression;
use flate2::write::GzEncoder;
use rayon::prelude::*;
use serde_json::json;

use super::differences::{Difference, differences, listed};
use super::formulas::FormulaList;
use super::maps::Family;
use super::read::{ReadError, digest, read_manifest};
use super::record::{Counts, Gap, Manifest, ShardEntry, add_counts};
use super::sample::{Barren, NoSample, Sample, draw_sample};
use crate::plan::write_atomically;

/// The manifest's name in a data set's directory.
pub const MANIFEST: &str = "manifest.json";

/// Who plans the missions of a data set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Expert {
    /// The exact planner: milliseconds a mission.
    #[default]
    Exact,
    /// Biased TL-RRT\* as in `nngtl.md`, IV-D (there 10,000 iterations): without shortening, y_rand 0.8.
    TlRrtStar {
        /// Samples of each search.
        iterations: u64,
    },
}

impl Expert {
    /// Iterations of the paper's expert.
    pub const PAPER_ITERATIONS: u64 = 10_000;
}

/// How many missions are drawn on each map, where nothing else is said.
pub const MISSIONS_PER_MAP: usize = 6;

/// The share of formulas that are random syntax trees, where nothing else is said.
pub const RANDOM_SHARE: f64 = 0.2;

/// The most states of a mission's automaton, if nothing else is said.
pub const MAX_STATES: usize = 60;

/// What to generate. Map `index` of a set depends on the fields `seed` to `formulas` and on
/// `index` alone.
#[derive(Clone, Debug, PartialEq)]
pub struct GenerateConfig {
    /// The directory to write to; made if missing. A set that was begun there with the same
    /// settings is continued, and extended if `to` has grown.
    pub out: PathBuf,
    /// The first map index; a multiple of `shard_maps`. Parts of one set can be made in
    /// different places and their files put together.
    pub from: u64,
    /// The map index after the last.
    pub to: u64,
    /// How many maps go into a shard; at least 1.
    pub shard_maps: u64,
    /// How many threads work; 0 for one per core.
    pub threads: usize,
    /// The seed of the whole set.
    pub seed: u64,
    /// Families of maps and their weights.
    pub families: Vec<(Family, f64)>,
    /// Missions on each map; at least 1.
    pub missions_per_map: usize,
    /// The share of missions whose formula is a random syntax tree, in `[0, 1]`.
    pub random_share: f64,
    /// Automata with more states are dropped.
    pub max_states: usize,
    /// The prefix's share λ of the cost, in `[0, 1]`.
    pub weight: f64,
    /// Who plans.
    pub expert: Expert,
    /// Plans shorter than this, prefix and suffix together, in map units, are dropped.
    pub min_length: f64,
    /// Missions whose automaton accepts after fewer steps are dropped.
    pub min_steps: u32,
    /// Formulas in the place of random syntax trees.
    pub formulas: Option<FormulaList>,
}

impl GenerateConfig {
    /// The settings of the shipped networks' training set, for `missions` missions: six on a map,
    /// 55 % of the maps the paper's, 25 % clutter, 20 % rooms, 20 % of the formulas random trees.
    #[must_use]
    pub fn new(out: impl Into<PathBuf>, seed: u64, missions: u64) -> Self {
        Self {
            out: out.into(),
            from: 0,
            to: missions.div_ceil(MISSIONS_PER_MAP as u64),
            shard_maps: 100,
            threads: 0,
            seed,
            families: vec![
                (Family::Paper, 0.55),
                (Family::Clutter, 0.25),
                (Family::Rooms, 0.2),
            ],
            missions_per_map: MISSIONS_PER_MAP,
            random_share: RANDOM_SHARE,
            max_states: MAX_STATES,
            weight: 0.2,
            expert: Expert::Exact,
            min_length: 0.01,
            min_steps: 0,
            formulas: None,
        }
    }

    /// The settings for part `part` of `of`, counted from 1: about as many whole shards as each other one.
    ///
    /// # Errors
    /// A part that is none, or more parts than shards.
    pub fn part(self, part: u64, of: u64) -> Result<Self, GenerateError> {
        let shards = (self.to - self.from).div_ceil(self.shard_maps.max(1));
        if part == 0 || part > of || of > shards {
            let missions = self.shard_maps.saturating_mul(self.missions_per_map as u64);
            return Err(GenerateError::Config(format!(
                "part {part} of {of}: parts count from 1, and a part is at least a shard of {} maps ({missions} missions), of which there are {shards}",
                self.shard_maps
            )));
        }
        let begin = |k: u64| self.from + k * shards / of * self.shard_maps;
        let (from, to) = (begin(part - 1), begin(part).min(self.to));
        Ok(Self { from, to, ..self })
    }

    fn check(&self) -> Result<(), GenerateError> {
        let bad = |what: &str| Err(GenerateError::Config(what.to_owned()));
        if self.shard_maps == 0 || self.missions_per_map == 0 {
            return bad("a shard needs at least one map and a map at least one mission");
        }
        if self.from >= self.to || !self.from.is_multiple_of(self.shard_maps) {
            return bad(
                "the range of maps must not be empty, and must begin at a multiple of the maps per shard",
            );
        }
        let share = |x: f64| (0.0..=1.0).contains(&x);
        if !share(self.random_share) || !share(self.weight) {
            return bad("the share of random trees and the prefix's weight must lie in [0, 1]");
        }
        let usable = |w: f64| w.is_finite() && w >= 0.0;
        let weights = || self.families.iter().map(|f| f.1);
        if !weights().all(usable) || weights().sum::<f64>() <= 0.0 {
            return bad("family weights must be at least 0, and one of them more");
        }
        if !self.min_length.is_finite() || self.max_states == 0 {
            return bad("the least length must be a number and the most states at least 1");
        }
        Ok(())
    }

    fn settings(&self) -> serde_json::Value {
        let families: serde_json::Map<String, serde_json::Value> = self
            .families
            .iter()
            .map(|&(family, weight)| (family.name().to_owned(), json!(weight)))
            .collect();
        let mut settings = json!({
            "families": families,
            "missions_per_map": self.missions_per_map,
            "random_share": self.random_share,
            "max_states": self.max_states,
            "weight": self.weight,
            "min_length": self.min_length,
            "shard_maps": self.shard_maps,
        });
        // Sets by usual settings are called as they were when there were no others.
        if self.min_steps > 0 {
            settings["min_steps"] = json!(self.min_steps);
        }
        if let Some(list) = &self.formulas {
            settings["formulas"] = json!(list.hash());
        }
        if let Expert::TlRrtStar { iterations } = self.expert {
            settings["expert"] = json!({ "name": "tl-rrt-star", "iterations": iterations });
        }
        settings
    }

    /// The manifest of a set that has these shards.
    fn manifest(&self, shards: &[ShardEntry]) -> Manifest {
        let (generator, maps) = (env!("CARGO_PKG_VERSION"), self.from..self.to);
        let mut manifest = Manifest::empty(generator, self.seed, maps, self.settings());
        for shard in shards {
            add_shard(&mut manifest, shard.clone());
        }
        manifest
    }

    /// The map index after the last of the shard that begins with map `from`.
    fn shard_end(&self, from: u64) -> u64 {
        self.to.min(from.saturating_add(self.shard_maps))
    }
}

/// How far a run is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Maps done, those of shards that were there already included.
    pub maps: u64,
    /// Maps wanted.
    pub of: u64,
    /// Missions on the maps done.
    pub missions: u64,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// All shards are there.
    Complete(Manifest),
    /// It was told to stop; the finished shards are kept and a further run continues from them.
    Stopped(Manifest),
}

impl Outcome {
    /// The manifest as it lies on disk.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        match self {
            Self::Complete(manifest) | Self::Stopped(manifest) => manifest,
        }
    }
}

/// Why a data set could not be generated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// A setting is out of range.
    #[error("{0}")]
    Config(String),
    /// A file could not be written or read.
    #[error("{path}: {source}")]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The directory holds a data set of other settings.
    #[error(
        "{path}: this data set was begun with other settings ({}): it can be given more missions, all else alike; choose another directory, or remove it first",
        listed(differences, "now")
    )]
    OtherSet {
        /// The manifest.
        path: PathBuf,
        /// What differs.
        differences: Vec<Difference>,
    },
    /// The manifest that is there cannot be read.
    #[error(transparent)]
    Manifest(Box<ReadError>),
    /// What was asked for allows too few missions.
    #[error(transparent)]
    Barren(#[from] Barren),
    /// The threads could not be started.
    #[error("worker threads could not be started: {0}")]
    Threads(String),
}

/// Generates a data set, finishes one that was begun, or extends one that was made for fewer maps.
///
/// Shards that are complete and whose digest is right are kept; a damaged one is made again, and so is the last one of
/// a set that is extended, unless it is full.
/// `progress` is called after every map; setting `stop` ends the run after the missions at hand, and
/// what was drawn of unfinished shards is drawn again by the next run.
///
/// # Errors
/// Settings out of range, a directory that holds another set, or files that cannot be written.
///
/// ```no_run
/// use std::sync::atomic::AtomicBool;
/// use nngtl::dataset::{GenerateConfig, generate};
/// let config = GenerateConfig::new("data/small", 1, 600);
/// let outcome = generate(&config, &|p| eprint!("\r{} of {} maps", p.maps, p.of), &AtomicBool::new(false))?;
/// println!("{} missions", outcome.manifest().missions);
/// # Ok::<(), nngtl::dataset::GenerateError>(())
/// ```
pub fn generate(
    config: &GenerateConfig,
    progress: &(dyn Fn(&Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Outcome, GenerateError> {
    config.check()?;
    fs::create_dir_all(&config.out).map_err(io_error(&config.out))?;
    let mut shards = kept_shards(config)?;
    let full = |shard: &&ShardEntry| shard.to == config.shard_end(shard.from);
    let done = Mutex::new(Progress {
        maps: shards.iter().filter(full).map(|s| s.maps).sum(),
        of: config.to - config.from,
        missions: shards.iter().filter(full).map(|s| s.missions).sum(),
    });
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(config.threads)
        .build()
        .map_err(|e| GenerateError::Threads(e.to_string()))?;
    let step = usize::try_from(config.shard_maps).unwrap_or(usize::MAX);
    for from in (config.from..config.to).step_by(step) {
        if shards.iter().filter(full).any(|s| s.from == from) {
            continue;
        }
        let to = config.shard_end(from);
        let samples: Result<Vec<(Sample, Gap)>, NoSample> = pool.install(|| {
            let draw = |index| {
                let sample = draw_sample(config, index, stop)?;
                let gap = Gap::of_map(&sample.record, config.weight);
                if let Ok(mut done) = done.lock() {
                    done.maps += 1;
                    done.missions += sample.record.missions.len() as u64;
                    progress(&done);
                }
                Ok((sample, gap))
            };
            (from..to).into_par_iter().map(draw).collect()
        });
        let samples = match samples {
            Ok(samples) => samples,
            Err(NoSample::Stopped) => return Ok(Outcome::Stopped(config.manifest(&shards))),
            Err(NoSample::Barren(barren)) => return Err(barren.into()),
        };
        if let Some(short) = shards.iter().position(|s| s.from == from) {
            // Its file is written over: a manifest that still lists it would then be wrong.
            shards.remove(short);
            write_manifest(config, &shards)?;
        }
        shards.push(write_shard(config, from, to, &samples)?);
        write_manifest(config, &shards)?;
    }
    Ok(Outcome::Complete(write_manifest(config, &shards)?))
}

/// The shards of an earlier run that are sound.
fn kept_shards(config: &GenerateConfig) -> Result<Vec<ShardEntry>, GenerateError> {
    let path = config.out.join(MANIFEST);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let found = read_manifest(&config.out).map_err(|e| GenerateError::Manifest(Box::new(e)))?;
    let mut differences = differences(&found, &config.manifest(&[]));
    if found.from != config.from || found.to > config.to {
        let each = config.missions_per_map as u64;
        let range = |from: u64, to: u64| match from {
            0 => (to * each).to_string(),
            _ => format!("{} to {}", from * each, to * each),
        };
        differences.push(Difference {
            setting: "missions".to_owned(),
            old: range(found.from, found.to),
            new: range(config.from, config.to),
        });
    }
    if !differences.is_empty() {
        return Err(GenerateError::OtherSet { path, differences });
    }
    let sound = |shard: &ShardEntry| {
        let path = config.out.join(&shard.file);
        let right = fs::read(&path).is_ok_and(|bytes| digest(&bytes) == shard.sha256);
        if !right {
            log::warn!("{}: missing or damaged, made again", path.display());
        }
        right
    };
    Ok(found.shards.into_iter().filter(sound).collect())
}

pub(super) fn add_shard(manifest: &mut Manifest, shard: ShardEntry) {
    manifest.maps += shard.maps;
    manifest.missions += shard.missions;
    add_counts(&mut manifest.filtered, &shard.filtered);
    add_counts(&mut manifest.families, &shard.families);
    add_counts(&mut manifest.patterns, &shard.patterns);
    manifest.shards.push(shard);
    manifest.shards.sort_by_key(|s| s.from);
    // Anew from all shards in order: a sum in another order may be another number.
    let mut gaps = manifest.shards.iter().filter_map(|s| s.gap.as_ref());
    manifest.gap = gaps
        .next()
        .map(|first| Gap::of_parts(std::iter::once(first).chain(gaps)));
}

fn write_shard(
    config: &GenerateConfig,
    from: u64,
    to: u64,
    samples: &[(Sample, Gap)],
) -> Result<ShardEntry, GenerateError> {
    let file = format!("shard-{:05}.jsonl.gz", from / config.shard_maps);
    let path = config.out.join(&file);
    let bytes = compress(samples).map_err(io_error(&path))?;
    write_whole(&path, &bytes)?;
    let mut shard = ShardEntry {
        file,
        sha256: digest(&bytes),
        from,
        to,
        maps: samples.len() as u64,
        missions: 0,
        filtered: Counts::new(),
        families: Counts::new(),
        patterns: Counts::new(),
        gap: Some(Gap::of_parts(samples.iter().map(|(_, gap)| gap))),
    };
    for (sample, _) in samples {
        add_counts(&mut shard.filtered, &sample.filtered);
        let family = sample.record.family.name().to_owned();
        *shard.families.entry(family).or_default() += 1;
        for mission in &sample.record.missions {
            shard.missions += 1;
            let pattern = mission.pattern.name().to_owned();
            *shard.patterns.entry(pattern).or_default() += 1;
        }
    }
    Ok(shard)
}

/// One JSON object a line. The header holds no time, so equal samples give equal bytes.
fn compress(samples: &[(Sample, Gap)]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    for (sample, _) in samples {
        serde_json::to_writer(&mut encoder, &sample.record)?;
        encoder.write_all(b"\n")?;
    }
    encoder.finish()
}

fn write_manifest(
    config: &GenerateConfig,
    shards: &[ShardEntry],
) -> Result<Manifest, GenerateError> {
    let manifest = config.manifest(shards);
    let path = config.out.join(MANIFEST);
    let mut text =
        serde_json::to_vec_pretty(&manifest).map_err(|e| io_error(&path)(io::Error::from(e)))?;
    text.push(b'\n');
    write_whole(&path, &text)?;
    Ok(manifest)
}

/// Writes a file so that it is there as a whole or not at all.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), GenerateError> {
    write_atomically(path, bytes).map_err(io_error(path))
}

fn io_error(path: &Path) -> impl Fn(io::Error) -> GenerateError + use<> {
    let path = path.to_owned();
    move |source| GenerateError::Io {
        path: path.clone(),
        source,
    }
}
