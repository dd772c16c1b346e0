//! Reading a data set back.

use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use flate2::read::GzDecoder;
use nalgebra::{Point2, Vector2};
use sha2::{Digest, Sha256};

use super::maps::Family;
use super::record::{FORMAT, Manifest, MapRecord, MissionRecord, RecordError, ShardEntry, point};
use super::sample::{Barren, NoSample, draw_sample, translate};
use super::{GenerateConfig, MANIFEST};
use crate::automaton::{Task, TaskError};
use crate::guidance::{Guidance, Heatmap};
use crate::ltl::{Formula, ParseError};
use crate::number::hex;
use crate::system::MapLayout;
use crate::workspace::Workspace;

/// Cells per side of the heatmap that labels make, as in training.
const LABEL_SIDE: usize = 200;

/// How far from a place its mark falls to e^(−1/2), in sides of the frame, as in training.
const LABEL_SPREAD: f64 = 0.015;

/// Why a data set could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// What was asked for allows too few missions.
    #[error(transparent)]
    Barren(#[from] Barren),
    /// A file is missing or unreadable.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder holds no data set.
    #[error(
        "{path}: there is no {MANIFEST} here, so this is no data set; scenario files are named one by one, as in {path}/*.toml"
    )]
    NoSet {
        /// The folder.
        path: PathBuf,
    },
    /// A file does not say what the format asks for.
    #[error("{path}, line {line}: {source}")]
    Json {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What was expected.
        source: serde_json::Error,
    },
    /// The format's version is not ours.
    #[error(
        "{path}: the data set has format {found}, this program reads {FORMAT}: generate it again"
    )]
    Format {
        /// The manifest.
        path: PathBuf,
        /// Its version.
        found: u64,
    },
    /// A shard is not what the manifest says.
    #[error(
        "{path}: the file's sha256 is {found}, the manifest says {expected}: run the generator again to repair it"
    )]
    Damaged {
        /// The shard.
        path: PathBuf,
        /// The digest in the manifest.
        expected: String,
        /// The digest of the file.
        found: String,
    },
    /// A map's shapes are unsound.
    #[error("{path}: {source}")]
    Record {
        /// The shard.
        path: PathBuf,
        /// What is wrong.
        source: RecordError,
    },
    /// A formula cannot be read.
    #[error("{path}, map {index}: {source}")]
    Formula {
        /// The shard.
        path: PathBuf,
        /// The map's number.
        index: u64,
        /// What is wrong.
        source: Box<ParseError>,
    },
    /// A formula cannot be translated.
    #[error("{path}, map {index}: {source}")]
    Task {
        /// The shard.
        path: PathBuf,
        /// The map's number.
        index: u64,
        /// What is wrong.
        source: Box<TaskError>,
    },
}

/// Reads a data set's manifest.
///
/// # Errors
/// A missing file, another format, or text that is no manifest.
pub fn read_manifest(folder: &Path) -> Result<Manifest, ReadError> {
    let path = folder.join(MANIFEST);
    let text = fs::read(&path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound if folder.is_dir() => ReadError::NoSet {
            path: folder.to_owned(),
        },
        _ => ReadError::Io {
            path: path.clone(),
            source,
        },
    })?;
    let fault = |source: serde_json::Error| ReadError::Json {
        path: path.clone(),
        line: source.line(),
        source,
    };
    let value: serde_json::Value = serde_json::from_slice(&text).map_err(fault)?;
    let found = value["format"].as_u64().unwrap_or(0);
    if found != u64::from(FORMAT) {
        return Err(ReadError::Format { path, found });
    }
    serde_json::from_value(value).map_err(fault)
}

/// Reads a shard's maps, after checking its digest.
///
/// # Errors
/// A missing or damaged file, or a line that is no map.
pub fn read_shard(folder: &Path, shard: &ShardEntry) -> Result<Vec<MapRecord>, ReadError> {
    let path = folder.join(&shard.file);
    let io_error = |source| ReadError::Io {
        path: path.clone(),
        source,
    };
    let bytes = fs::read(&path).map_err(io_error)?;
    let found = digest(&bytes);
    if found != shard.sha256 {
        return Err(ReadError::Damaged {
            path,
            expected: shard.sha256.clone(),
            found,
        });
    }
    let lines = BufReader::new(GzDecoder::new(bytes.as_slice())).lines();
    let mut maps = Vec::new();
    for (i, line) in lines.enumerate() {
        let line = line.map_err(io_error)?;
        let map = serde_json::from_str(&line).map_err(|source| ReadError::Json {
            path: path.clone(),
            line: i + 1,
            source,
        })?;
        maps.push(map);
    }
    Ok(maps)
}

/// The hex digest that manifests hold.
pub(super) fn digest(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// A mission of a data set, ready for planning.
#[derive(Clone, Debug)]
pub struct LabelledMission {
    /// The index of its map.
    pub map: u64,
    /// The kind of map.
    pub family: Family,
    /// The map, shared by its missions.
    pub workspace: Arc<Workspace>,
    /// Where the robot starts.
    pub start: Point2<f64>,
    /// The task's formula.
    pub formula: Formula,
    /// The task.
    pub task: Task,
    /// Seconds from the formula to the task.
    pub translate_seconds: f64,
    /// What the data set says about it.
    pub record: MissionRecord,
}

impl LabelledMission {
    /// What perfect networks would predict: the places where the expert's path bends or meets regions, and the
    /// automaton states that it passes. The same target as in training (`docs/dataset.md`).
    #[must_use]
    pub fn guidance(&self) -> Guidance {
        let mut states = vec![0.0; self.task.nba.len()];
        for &q in &self.record.visited {
            if let Some(state) = states.get_mut(q as usize) {
                *state = 1.0;
            }
        }
        let mut heatmap = Heatmap {
            side: LABEL_SIDE,
            values: vec![0.0; LABEL_SIDE * LABEL_SIDE],
        };
        let bounds = self.workspace.bounds();
        let points = self.record.prefix.iter().chain(&self.record.suffix).skip(1);
        for &at in points {
            mark(&mut heatmap, (point(at) - bounds.min) / bounds.side());
        }
        Guidance { heatmap, states }
    }
}

/// Marks a place, given in the frame of side 1.
fn mark(heatmap: &mut Heatmap, at: Vector2<f64>) {
    let side = heatmap.side;
    let fall = |centre: f64| {
        let weight = move |i: usize| {
            let off = ((i as f64 + 0.5) / side as f64 - centre) / LABEL_SPREAD;
            libm::exp(-0.5 * off * off)
        };
        (0..side).map(weight).collect::<Vec<f64>>()
    };
    let (along, across) = (fall(at.x), fall(at.y));
    for (row, x) in heatmap.values.chunks_exact_mut(side).zip(along) {
        for (value, y) in row.iter_mut().zip(&across) {
            *value = value.max((x * y) as f32);
        }
    }
}

/// All missions of a data set, in order; shards are read one at a time.
///
/// # Errors
/// An unreadable manifest. The iterator's items are errors where a shard cannot be read (its
/// missions are then left out) or a record makes no mission.
pub fn missions(
    folder: &Path,
) -> Result<impl Iterator<Item = Result<LabelledMission, ReadError>> + use<>, ReadError> {
    let manifest = read_manifest(folder)?;
    let folder = folder.to_owned();
    Ok(manifest.shards.into_iter().flat_map(move |shard| {
        let path = folder.join(&shard.file);
        match read_shard(&folder, &shard) {
            Ok(maps) => maps
                .into_iter()
                .flat_map(|map| map_missions(&path, map))
                .collect(),
            Err(error) => vec![Err(error)],
        }
    }))
}

/// The missions of a set that is not written anywhere, in order, drawn as they are asked for; they end where
/// `stop` is set.
///
/// # Errors
/// Where what is asked for allows too few missions; no other is expected of maps that were just drawn.
pub fn drawn_missions<'a>(
    config: &'a GenerateConfig,
    stop: &'a AtomicBool,
) -> impl Iterator<Item = Result<LabelledMission, ReadError>> + 'a {
    let mut barren = false;
    let samples = (config.from..config.to).map_while(move |index| {
        if barren {
            return None;
        }
        match draw_sample(config, index, stop) {
            Ok(sample) => Some(Ok(sample)),
            Err(NoSample::Stopped) => None,
            Err(NoSample::Barren(e)) => {
                barren = true;
                Some(Err(e))
            }
        }
    });
    samples.flat_map(|sample| match sample {
        Ok(sample) => map_missions(Path::new("drawn maps"), sample.record),
        Err(e) => vec![Err(e.into())],
    })
}

fn map_missions(path: &Path, map: MapRecord) -> Vec<Result<LabelledMission, ReadError>> {
    let path = path.to_owned();
    let workspace = match map.workspace() {
        Ok(workspace) => workspace,
        Err(source) => return vec![Err(ReadError::Record { path, source })],
    };
    let (index, family) = (map.index, map.family);
    let mission = |record: MissionRecord| {
        let formula: Formula = record
            .formula
            .parse()
            .map_err(|source| ReadError::Formula {
                path: path.clone(),
                index,
                source: Box::new(source),
            })?;
        let begin = Instant::now();
        let places = MapLayout::new(workspace.clone(), point(record.start));
        let task = translate(&formula, &workspace, &places).map_err(|source| ReadError::Task {
            path: path.clone(),
            index,
            source: Box::new(source),
        })?;
        Ok(LabelledMission {
            map: index,
            family,
            workspace: workspace.clone(),
            start: point(record.start),
            formula,
            task,
            translate_seconds: begin.elapsed().as_secs_f64(),
            record,
        })
    };
    map.missions.into_iter().map(mission).collect()
}
