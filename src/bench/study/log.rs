//! The file that keeps what a study has done: one JSON object a line, first the settings, then one line for each
//! mission as soon as it is measured. A kill loses the mission at hand and nothing else.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::{Record, Study};
use crate::plan::write_atomically;

/// The file's name in a study's folder.
pub(super) const LOG: &str = "missions.jsonl";

/// The version of the file.
const FORMAT: u32 = 1;

/// Why a study's folder cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder holds the results of another study.
    #[error(
        "{path}: holds results of other settings, networks or another version ({}): choose another folder, or remove it first", differences.join("; ")
    )]
    Other {
        /// The log.
        path: PathBuf,
        /// What differs: the setting, its value there and the one wanted.
        differences: Vec<String>,
    },
    /// The folder holds a report, and not what it was made from.
    #[error(
        "{path}: is of no run that could be continued here: choose another folder, or remove it first"
    )]
    Foreign {
        /// A file of the report.
        path: PathBuf,
    },
    /// A line is no record.
    #[error("{path}, line {line}: {source}: this is no result of this program, remove the line")]
    Damaged {
        /// The log.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What was expected.
        source: serde_json::Error,
    },
    /// Another program writes to the folder.
    #[error("{path}: another run is writing here: wait for it, or choose another folder")]
    Busy {
        /// The log.
        path: PathBuf,
    },
}

/// The folder of a study that is being made.
#[derive(Debug)]
pub struct StudyFolder {
    pub(super) path: PathBuf,
    log: File,
    kept: HashMap<(String, String), Record>,
}

impl StudyFolder {
    /// Opens the folder for this study, made if missing; what a run with the same settings left is kept.
    ///
    /// # Errors
    /// A folder of another study, a file that is no log, or one that cannot be read or written.
    pub fn open(path: &Path, study: &Study) -> Result<Self, LogError> {
        fs::create_dir_all(path).map_err(io_error(path))?;
        let file = path.join(LOG);
        let open = || OpenOptions::new().append(true).create(true).open(&file);
        // Held for as long as the file is open, wherever the system has such locks.
        let guard = open().map_err(io_error(&file))?;
        lock(&guard, &file)?;
        let text = fs::read(&file).map_err(io_error(&file))?;
        let header = header(study);
        let (kept, sound) = read(&file, &text, &header)?;
        if sound == 0 {
            let report = super::folder::REPORT_FILES.map(|name| path.join(name));
            if let Some(path) = report.into_iter().find(|file| file.exists()) {
                return Err(LogError::Foreign { path });
            }
            let mut line = header.to_string();
            line.push('\n');
            write_atomically(&file, line.as_bytes()).map_err(io_error(&file))?;
        } else if sound < text.len() {
            write_atomically(&file, &text[..sound]).map_err(io_error(&file))?;
        }
        // The file may be a new one.
        let log = open().map_err(io_error(&file))?;
        drop(guard);
        lock(&log, &file)?;
        Ok(Self {
            path: path.to_owned(),
            log,
            kept,
        })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many missions are kept from earlier runs.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.kept.len()
    }

    /// The record of a mission, if it was measured before and is still the same.
    pub(super) fn take(&mut self, case: &str, digest: &str) -> Option<Record> {
        self.kept.remove(&(case.to_owned(), digest.to_owned()))
    }

    /// Adds a mission's record.
    pub(super) fn append(&mut self, record: &Record) -> Result<(), LogError> {
        let mut line = serde_json::to_vec(record).map_err(|e| self.error(e.into()))?;
        line.push(b'\n');
        self.log.write_all(&line).map_err(|e| self.error(e))
    }

    fn error(&self, source: io::Error) -> LogError {
        io_error(&self.path.join(LOG))(source)
    }
}

fn lock(file: &File, path: &Path) -> Result<(), LogError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(LogError::Busy {
            path: path.to_owned(),
        }),
        // Some file systems have no locks.
        Err(TryLockError::Error(_)) | Ok(()) => Ok(()),
    }
}

/// What decides the results; the division into classes is made afterwards.
fn header(study: &Study) -> Value {
    json!({
        "format": FORMAT,
        "program": env!("CARGO_PKG_VERSION"),
        "comparison": study.comparison,
        "costs": study.costs,
        "model": study.model,
    })
}

/// Records by mission and digest.
type Kept = HashMap<(String, String), Record>;

/// The records of a log, and the length of its sound part: a last line without an end was cut by a kill.
fn read(path: &Path, text: &[u8], header: &Value) -> Result<(Kept, usize), LogError> {
    let mut kept = HashMap::new();
    let mut sound = 0;
    for (k, line) in text.split_inclusive(|&b| b == b'\n').enumerate() {
        if !line.ends_with(b"\n") {
            break;
        }
        let damaged = |source| LogError::Damaged {
            path: path.to_owned(),
            line: k + 1,
            source,
        };
        if k == 0 {
            let found: Value = serde_json::from_slice(line).map_err(damaged)?;
            if found != *header {
                return Err(LogError::Other {
                    path: path.to_owned(),
                    differences: differences(&found, header),
                });
            }
        } else {
            let record: Record = serde_json::from_slice(line).map_err(damaged)?;
            kept.insert((record.case.clone(), record.digest.clone()), record);
        }
        sound += line.len();
    }
    Ok((kept, sound))
}

/// What tells two headers apart, each setting once: `settings.iterations 5000, now 2000`.
fn differences(there: &Value, here: &Value) -> Vec<String> {
    let mut found = Vec::new();
    compare("", there, here, &mut found);
    let mut told: Vec<String> = Vec::new();
    for (name, values) in found {
        // The searches that go on share most settings with the others, and their marks follow from the settings.
        let name = name
            .strip_prefix("comparison.")
            .or(name.strip_prefix("costs."))
            .unwrap_or(&name);
        let known = format!("{name} ");
        if name != "marks" && !told.iter().any(|t| t.starts_with(&known)) {
            told.push(known + &values);
        }
    }
    told
}

/// A value as a user would write it.
fn text(value: &Value) -> String {
    match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(items) => items.iter().map(text).collect::<Vec<_>>().join(","),
        Value::Object(members) => members.values().map(text).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}

/// Adds where two values differ, member by member: the name and both values.
fn compare(name: &str, there: &Value, here: &Value, found: &mut Vec<(String, String)>) {
    let (Some(a), Some(b)) = (there.as_object(), here.as_object()) else {
        if there != here {
            let values = format!("{}, now {}", text(there), text(here));
            found.push((name.to_owned(), values));
        }
        return;
    };
    let only_here = b.keys().filter(|&key| !a.contains_key(key));
    for key in a.keys().chain(only_here) {
        let name = match name {
            "" => key.clone(),
            outer => format!("{outer}.{key}"),
        };
        let value = |object: &serde_json::Map<String, Value>| object.get(key).cloned();
        let [there, here] = [a, b].map(|object| value(object).unwrap_or_default());
        compare(&name, &there, &here, found);
    }
}

pub(super) fn io_error(path: &Path) -> impl Fn(io::Error) -> LogError + use<> {
    let path = path.to_owned();
    move |source| LogError::Io {
        path: path.clone(),
        source,
    }
}
