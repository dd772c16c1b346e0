//! `plan.json`: a plan with what made it.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path as FilePath, PathBuf};

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use super::{Cost, Path, Waypoint};
use crate::automaton::StateId;

/// The version of `plan.json` that this crate writes, and the only one it reads.
pub const PLAN_VERSION: u32 = 1;

/// The largest `plan.json` that is read, in bytes (64 MiB).
pub const MAX_PLAN_BYTES: u64 = 64 << 20;

/// A plan file. To check a path, `version`, `prefix` and `suffix` are enough; everything else
/// says where the plan came from. Fields that are not known are passed over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanFile {
    /// [`PLAN_VERSION`].
    pub version: u32,
    /// The name of the scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// The [hash](crate::scenario::Scenario::hash) of the scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario_hash: Option<String>,
    /// The mission that was planned, if it was a formula.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// λ in `[0, 1]`, the weight of the prefix in the cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// The sampler that found it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampler: Option<String>,
    /// The device that the networks ran on, if they ran.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// The seed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The digest of the networks' weights, if they ran.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_hash: Option<String>,
    /// From the start to where the suffix begins.
    pub prefix: Vec<PlanPoint>,
    /// From there back to there, for ever; one point if the robot stays.
    pub suffix: Vec<PlanPoint>,
    /// Lengths and their weighted sum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
    /// What every plan costs at least, and the seconds that it took to find that out; from the exact planner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bound: Option<Bound>,
    /// What the first plan took and cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<First>,
    /// What the first prefix took; its cost is its length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_prefix: Option<First>,
    /// What the whole search took.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stats: Option<PlanStats>,
}

/// A point of a plan file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanPoint {
    /// The place, in map units.
    pub at: [f64; 2],
    /// The automaton state on arrival; the checker does not look at it.
    #[serde(default)]
    pub state: u32,
}

/// A lower bound on what plans cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bound {
    /// No plan costs less, in map units.
    pub cost: f64,
    /// By how much the file's plan costs more than the cheapest at most: 0.05 is 5 %. Absent beside a bound of 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<f64>,
    /// No plan costs less whose suffix comes back to its automaton state, as planners' do. Absent where the file's plan costs less than that:
    /// its loop begins sooner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub product: Option<f64>,
    /// Seconds that it took.
    pub seconds: f64,
}

/// When something was found, and what it cost then.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct First {
    /// Calls of the sampler until then.
    pub iterations: u64,
    /// Product states in the trees then.
    pub nodes: u64,
    /// Seconds of search until then.
    pub seconds: f64,
    /// Its cost, in map units.
    pub cost: f64,
}

/// Effort of a whole run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanStats {
    /// Searches that ran side by side; the other counts are over all of them.
    #[serde(default)]
    pub threads: u64,
    /// Calls of the sampler.
    pub iterations: u64,
    /// Product states in the trees.
    pub nodes: u64,
    /// Different places in the trees.
    pub sites: u64,
    /// Where the time went.
    pub seconds: StageSeconds,
}

/// Wall-clock seconds of each stage; 0 for a stage that was not run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageSeconds {
    /// Formula to automaton.
    pub translate: f64,
    /// Map and automaton to tensors.
    pub encode: f64,
    /// The networks.
    pub infer: f64,
    /// The tree search.
    pub search: f64,
    /// Everything, reading files included.
    pub total: f64,
}

/// Why a plan file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanFileError {
    /// The file cannot be read.
    #[error("{}: cannot read the plan: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The file is too large.
    #[error("{}: larger than {MAX_PLAN_BYTES} bytes: is this a plan?", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// The text is not a plan.
    #[error("{}:{line}:{column}: not a plan: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The column in bytes, from 1.
        column: usize,
        /// What was expected.
        message: String,
    },
    /// The plan was written by another version.
    #[error(
        "{}: the plan has version {found}, this program reads version {PLAN_VERSION}: plan again",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The version found.
        found: u32,
    },
    /// The weight is not a share.
    #[error("{}: the plan's weight is {weight}: expected a number from 0 to 1", path.display())]
    Weight {
        /// The file.
        path: PathBuf,
        /// The weight found.
        weight: f64,
    },
    /// The file cannot be written.
    #[error("{}: cannot write the plan: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
}

impl PlanFile {
    /// A plan file that holds a path and nothing else.
    #[must_use]
    pub fn new(path: &Path) -> Self {
        let points = |part: &[Waypoint]| part.iter().copied().map(PlanPoint::from).collect();
        Self {
            version: PLAN_VERSION,
            scenario: None,
            scenario_hash: None,
            task: None,
            weight: None,
            sampler: None,
            device: None,
            seed: None,
            model_hash: None,
            prefix: points(&path.prefix),
            suffix: points(&path.suffix),
            cost: None,
            bound: None,
            first: None,
            first_prefix: None,
            stats: None,
        }
    }

    /// The path.
    #[must_use]
    pub fn path(&self) -> Path {
        let waypoints = |part: &[PlanPoint]| part.iter().copied().map(Waypoint::from).collect();
        Path {
            prefix: waypoints(&self.prefix),
            suffix: waypoints(&self.suffix),
        }
    }

    /// Reads a plan file, or standard input if the path is `-`. What `nngtl plan --json` prints holds a plan, too.
    ///
    /// # Errors
    /// A file that cannot be read, is too large, is not a plan, or is of another version.
    pub fn read(path: impl AsRef<FilePath>) -> Result<Self, PlanFileError> {
        let path = path.as_ref();
        let failed = |source| PlanFileError::Read {
            path: path.to_owned(),
            source,
        };
        let mut text = Vec::new();
        let read = match path == FilePath::new("-") {
            true => std::io::stdin()
                .lock()
                .take(MAX_PLAN_BYTES + 1)
                .read_to_end(&mut text),
            false => File::open(path)
                .and_then(|file| file.take(MAX_PLAN_BYTES + 1).read_to_end(&mut text)),
        };
        read.map_err(failed)?;
        if text.len() as u64 > MAX_PLAN_BYTES {
            let path = path.to_owned();
            return Err(PlanFileError::TooLarge { path });
        }
        Self::parse(&text, path)
    }

    fn parse(text: &[u8], path: &FilePath) -> Result<Self, PlanFileError> {
        // The version first: a plan of another version may differ in everything else.
        #[derive(Deserialize)]
        struct Version {
            version: u32,
            /// The plan of a result.
            plan: Option<serde_json::Value>,
        }
        let syntax = |e: serde_json::Error| {
            let message = e.to_string();
            let message = message.split(" at line ").next().unwrap_or_default();
            PlanFileError::Syntax {
                path: path.to_owned(),
                line: e.line(),
                column: e.column(),
                message: message.to_owned(),
            }
        };
        let Version { version, plan } = serde_json::from_slice(text).map_err(syntax)?;
        if let Some(plan) = plan.filter(serde_json::Value::is_object) {
            return Self::parse(plan.to_string().as_bytes(), path);
        }
        if version != PLAN_VERSION {
            let path = path.to_owned();
            let found = version;
            return Err(PlanFileError::Version { path, found });
        }
        let plan: Self = serde_json::from_slice(text).map_err(syntax)?;
        match plan.weight {
            Some(weight) if !(0.0..=1.0).contains(&weight) => {
                let path = path.to_owned();
                Err(PlanFileError::Weight { path, weight })
            }
            _ => Ok(plan),
        }
    }

    /// Writes the plan file, whole or not at all.
    ///
    /// # Errors
    /// If the folder cannot be written to.
    pub fn write(&self, path: impl AsRef<FilePath>) -> Result<(), PlanFileError> {
        let path = path.as_ref();
        let failed = |source| PlanFileError::Write {
            path: path.to_owned(),
            source,
        };
        write_atomically(path, self.to_json().as_bytes()).map_err(failed)
    }

    /// The text of the plan file: JSON, one point a line.
    #[must_use]
    pub fn to_json(&self) -> String {
        let value = serde_json::to_value(self).unwrap_or_default();
        let Some(fields) = value.as_object() else {
            return String::new();
        };
        let lines: Vec<String> = fields
            .iter()
            .map(|(key, value)| match value.as_array() {
                Some(points) if !points.is_empty() => {
                    let points: Vec<String> = points.iter().map(|p| format!("    {p}")).collect();
                    format!("  \"{key}\": [\n{}\n  ]", points.join(",\n"))
                }
                _ => format!("  \"{key}\": {value}"),
            })
            .collect();
        format!("{{\n{}\n}}\n", lines.join(",\n"))
    }
}

impl From<Waypoint> for PlanPoint {
    fn from(w: Waypoint) -> Self {
        Self {
            at: [w.at.x, w.at.y],
            state: w.state.0,
        }
    }
}

impl From<PlanPoint> for Waypoint {
    fn from(p: PlanPoint) -> Self {
        Self {
            at: Point2::new(p.at[0], p.at[1]),
            state: StateId(p.state),
        }
    }
}

/// Writes `bytes` to `path` so that a reader sees the old file or the new one, never a part: a
/// temporary file beside it is filled, flushed to disk and renamed. A link stays a link: what it leads to is
/// replaced. What is no ordinary file (a pipe, `/dev/stdout`) is written to as it is.
///
/// # Errors
/// If the folder cannot be written to, or `path` is a folder.
pub fn write_atomically(path: &FilePath, bytes: &[u8]) -> std::io::Result<()> {
    if let Ok(there) = std::fs::metadata(path) {
        if there.is_dir() {
            return Err(std::io::ErrorKind::IsADirectory.into());
        }
        if !there.is_file() {
            let mut there = std::fs::OpenOptions::new().write(true).open(path)?;
            return there.write_all(bytes);
        }
    }
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    replace(&target, bytes)
}

fn replace(path: &FilePath, bytes: &[u8]) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => FilePath::new("."),
    };
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        // As an ordinary new file would have it; the umask still applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let written = (|| {
        let mut file = builder.prefix(".nngtl-").tempfile_in(folder)?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)
    })();
    // The kind of failure, without the name of the temporary file.
    written
        .map(drop)
        .map_err(|e: std::io::Error| match e.raw_os_error() {
            Some(code) => std::io::Error::from_raw_os_error(code),
            None => e.kind().into(),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> PlanFile {
        let w = |x: f64, y, q| Waypoint {
            at: Point2::new(x, y),
            state: StateId(q),
        };
        let path = Path {
            prefix: vec![w(0.1, 1.0 / 3.0, 0), w(0.5, 0.25, 2)],
            suffix: vec![w(0.5, 0.25, 2)],
        };
        PlanFile {
            scenario: Some("s \"quoted\"".into()),
            seed: Some(u64::MAX),
            cost: Some(Cost::new(1.5, 0.0, 0.2)),
            ..PlanFile::new(&path)
        }
    }

    #[test]
    fn a_written_plan_reads_back_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plan.json");
        let plan = sample();
        plan.write(&file).unwrap();
        plan.write(&file).unwrap(); // over an old one
        assert_eq!(PlanFile::read(&file).unwrap(), plan);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn three_fields_are_a_plan() {
        let text = br#"{"version":1,"prefix":[{"at":[0,1]}],"suffix":[{"at":[0,1]}]}"#;
        let plan = PlanFile::parse(text, FilePath::new("p.json")).unwrap();
        assert_eq!(plan.path().prefix[0].at, Point2::new(0.0, 1.0));
    }

    #[test]
    fn errors_name_file_line_and_column() {
        let parse = |text: &str| {
            PlanFile::parse(text.as_bytes(), FilePath::new("p.json"))
                .unwrap_err()
                .to_string()
        };
        let missing = parse("{\"version\": 1,\n \"prefix\": []}");
        assert!(
            missing.starts_with("p.json:2:") && missing.contains("`suffix`"),
            "{missing}"
        );
        let newer = parse(r#"{"version": 7}"#);
        assert!(
            newer.contains("version 7") && newer.contains("version 1"),
            "{newer}"
        );
        let nothing = PlanFile::read("no/such/plan.json").unwrap_err().to_string();
        assert!(
            nothing.starts_with("no/such/plan.json: cannot read"),
            "{nothing}"
        );
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        assert!(matches!(
            sample().write("no/such/folder/plan.json"),
            Err(PlanFileError::Write { .. })
        ));
    }
}
