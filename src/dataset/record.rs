//! What a data set's files say, as serde types (`docs/dataset.md`).

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use super::maps::{Family, MapShapes, region_name};
use super::missions::Pattern;
use crate::automaton::{StateId, Task};
use crate::encoding::{AutomatonGraph, GraphError};
use crate::workspace::{Bounds, Polygon, PolygonError, Region, Workspace, WorkspaceError};

/// The version of the format that this program writes and reads.
pub const FORMAT: u32 = 1;

/// A pair of coordinates.
pub type Pair = [f64; 2];

/// Counts by name, in alphabetical order.
pub type Counts = BTreeMap<String, u64>;

/// How much more than certified lower bounds expert plans cost, as shares of the bounds. A bound takes more than half as long as
/// its mission does: it is computed for the first mission of each map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Missions with a bound.
    pub missions: u64,
    /// Missions whose bound is 0, of which no share can be told; they count nowhere else.
    pub unbounded: u64,
    /// The mean, to a millionth.
    pub mean: f64,
    /// The largest one, to a millionth.
    pub worst: f64,
}

impl Gap {
    /// The gap of several parts together.
    pub(super) fn of_parts<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        let mut sum = 0.0;
        for part in parts {
            all.missions += part.missions;
            all.unbounded += part.unbounded;
            all.worst = all.worst.max(part.worst);
            sum += part.mean * part.missions as f64;
        }
        if all.missions > 0 {
            all.mean = to_millionth(sum / all.missions as f64);
        }
        all
    }
}

/// `manifest.json`: what the data set holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: u32,
    /// The version of the program that wrote it.
    pub generator: String,
    /// The seed of the whole set.
    pub seed: u64,
    /// The first map index.
    pub from: u64,
    /// The map index after the last.
    pub to: u64,
    /// How many maps the listed shards hold.
    pub maps: u64,
    /// How many missions the listed shards hold.
    pub missions: u64,
    /// Missions drawn and dropped, by reason.
    pub filtered: Counts,
    /// Maps by family.
    pub families: Counts,
    /// Missions by pattern.
    pub patterns: Counts,
    /// How far the expert's plans are from the optimum at most; nothing in sets of earlier programs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<Gap>,
    /// The shards that are complete, in order.
    pub shards: Vec<ShardEntry>,
    /// What else the generator was told; shards of different settings never mix.
    pub settings: serde_json::Value,
}

impl Manifest {
    /// The manifest of a set of which no shard is there yet.
    pub(super) fn empty(
        generator: &str,
        seed: u64,
        maps: std::ops::Range<u64>,
        settings: serde_json::Value,
    ) -> Self {
        Self {
            format: FORMAT,
            generator: generator.to_owned(),
            seed,
            from: maps.start,
            to: maps.end,
            maps: 0,
            missions: 0,
            filtered: Counts::new(),
            families: Counts::new(),
            patterns: Counts::new(),
            gap: None,
            shards: Vec::new(),
            settings,
        }
    }
}

/// A shard in the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShardEntry {
    /// The file's name in the data set's directory.
    pub file: String,
    /// Hex digest of the file as it lies on disk.
    pub sha256: String,
    /// The first map index.
    pub from: u64,
    /// The map index after the last.
    pub to: u64,
    /// How many maps it holds.
    pub maps: u64,
    /// How many missions it holds.
    pub missions: u64,
    /// Missions drawn and dropped for this shard, by reason.
    pub filtered: Counts,
    /// Its maps by family.
    pub families: Counts,
    /// Its missions by pattern.
    pub patterns: Counts,
    /// How far its plans are from the optimum at most; nothing in sets of earlier programs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<Gap>,
}

/// A line of a shard: a map and its missions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapRecord {
    /// The map's number in the set.
    pub index: u64,
    /// The kind of map.
    pub family: Family,
    /// Lower-left and upper-right corner.
    pub bounds: [Pair; 2],
    /// The obstacles' vertices.
    pub obstacles: Vec<Vec<Pair>>,
    /// The regions' vertices; region `k` is called `l<k+1>`.
    pub regions: Vec<Vec<Pair>>,
    /// Lengths of shortest ways from each region to those before it, and then the radius of a disc of its own area; see
    /// [`Ways`](crate::system::Ways).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ways: Vec<Vec<f64>>,
    /// The missions on this map.
    pub missions: Vec<MissionRecord>,
}

/// A mission with its expert's labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissionRecord {
    /// Where the robot starts.
    pub start: Pair,
    /// Lengths of shortest ways from the start to each region of the map.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ways: Vec<f64>,
    /// The task, in the syntax of [`crate::ltl`].
    pub formula: String,
    /// The kind of formula.
    pub pattern: Pattern,
    /// Indices of the regions that the formula names, in order of first use.
    pub order: Vec<usize>,
    /// The automaton as the networks see it.
    pub automaton: AutomatonRecord,
    /// The expert's prefix.
    pub prefix: Vec<Pair>,
    /// The expert's suffix, back to its first point; that point alone if the robot stays.
    pub suffix: Vec<Pair>,
    /// The automaton states on the expert's path, ascending.
    pub visited: Vec<u32>,
    /// The weighted length of prefix and suffix as written here, to a millionth.
    pub cost: f64,
}

/// An automaton as the networks see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AutomatonRecord {
    /// How many states there are.
    pub states: u32,
    /// The initial states.
    pub initial: Vec<u32>,
    /// The feasible accepting states.
    pub accepting: Vec<u32>,
    /// For each state the third feature: ρ to the nearest feasible accepting state, divided by the
    /// largest finite ρ between two different states; −1 if there is none. To a millionth.
    pub distance: Vec<f64>,
    /// Source, target and literals by channel, one for each cube of each guard.
    pub transitions: Vec<(u32, u32, Vec<i8>)>,
}

impl AutomatonRecord {
    /// Describes a task's automaton; `order` lists the channels' propositions by number in the
    /// task's alphabet.
    ///
    /// # Errors
    /// As [`AutomatonGraph::new`].
    pub fn new(task: &Task, order: &[usize]) -> Result<Self, GraphError> {
        let names = task.nba.alphabet.propositions();
        let channels: Vec<&str> = order.iter().map(|&p| names[p].as_str()).collect();
        let graph = AutomatonGraph::new(task, &channels)?;
        let ids = |states: &[StateId]| states.iter().map(|q| q.0).collect();
        let literals = |t: usize| graph.literals[t * graph.regions..][..graph.regions].to_vec();
        let ends = graph.ends.iter().enumerate();
        Ok(Self {
            states: task.nba.len() as u32,
            initial: ids(&task.nba.initial),
            accepting: ids(&task.feasible),
            distance: graph
                .states
                .iter()
                .map(|s| to_millionth(f64::from(s[2])))
                .collect(),
            transitions: ends
                .map(|(t, &(from, to))| (from, to, literals(t)))
                .collect(),
        })
    }
}

/// Why a record describes no map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A polygon is unsound.
    #[error("map {index}: {source}")]
    Polygon {
        /// The map's number.
        index: u64,
        /// What is wrong.
        source: PolygonError,
    },
    /// The parts make no workspace.
    #[error("map {index}: {source}")]
    Workspace {
        /// The map's number.
        index: u64,
        /// What is wrong.
        source: WorkspaceError,
    },
}

impl MapRecord {
    /// Describes a map without missions.
    #[must_use]
    pub fn new(index: u64, map: &MapShapes) -> Self {
        let vertices = |p: &Polygon| p.vertices().iter().map(|v| [v.x, v.y]).collect();
        let bounds = Bounds::unit();
        Self {
            index,
            family: map.family,
            bounds: [bounds.min, bounds.max].map(pair),
            obstacles: map.obstacles.iter().map(vertices).collect(),
            regions: map.regions.iter().map(vertices).collect(),
            ways: Vec::new(),
            missions: Vec::new(),
        }
    }

    /// The map as a workspace.
    ///
    /// # Errors
    /// An unsound polygon or unsound bounds.
    pub fn workspace(&self) -> Result<Arc<Workspace>, RecordError> {
        let index = self.index;
        let polygon = |vertices: &Vec<Pair>| {
            Polygon::new(vertices.iter().copied().map(point).collect())
                .map_err(|source| RecordError::Polygon { index, source })
        };
        let obstacles: Vec<Polygon> = self
            .obstacles
            .iter()
            .map(polygon)
            .collect::<Result<_, _>>()?;
        let regions: Vec<Region> = self
            .regions
            .iter()
            .enumerate()
            .map(|(k, vertices)| {
                Ok(Region {
                    name: region_name(k),
                    polygon: polygon(vertices)?,
                })
            })
            .collect::<Result<_, _>>()?;
        let [min, max] = self.bounds.map(point);
        Workspace::new(Bounds { min, max }, obstacles, regions)
            .map(Arc::new)
            .map_err(|source| RecordError::Workspace { index, source })
    }
}

/// The coordinates of a point.
#[must_use]
pub fn pair(p: Point2<f64>) -> Pair {
    [p.x, p.y]
}

/// The point with these coordinates.
#[must_use]
pub fn point([x, y]: Pair) -> Point2<f64> {
    Point2::new(x, y)
}

/// Lengths to a ten-thousandth, as coordinates are.
pub(super) fn rounded(lengths: &[f64]) -> Vec<f64> {
    let round = |x: &f64| (x * 1e4).round() / 1e4;
    lengths.iter().map(round).collect()
}

/// Rounds a number that no one needs more exactly.
pub(super) fn to_millionth(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

/// Adds counts to counts.
pub(super) fn add_counts(sum: &mut Counts, more: &Counts) {
    for (name, n) in more {
        *sum.entry(name.clone()).or_default() += n;
    }
}
