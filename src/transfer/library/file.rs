//! Library files.
//!
//! A first line `nngtl-library 1 sha256:<64 hex digits> <bytes>`, then that many bytes of JSON. The
//! checksum is that of the JSON's bytes. A file is written beside its place and then moved there, so
//! that there is never half a file.

use std::path::{Path, PathBuf};

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::super::skill::{Skill, SkillError};
use super::Library;
use crate::number::hex;
use crate::plan::write_atomically;
use crate::system::TransitionSystem;

/// The word that library files begin with.
const MAGIC: &str = "nngtl-library";

/// The version of the format that this crate writes and reads.
const VERSION: u32 = 1;

/// Why a library could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LibraryError {
    /// The file cannot be read or written.
    #[error("{path}: cannot read or write the library: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Another kind of file.
    #[error("{path}: not a skill library: expected a first line `{MAGIC} {VERSION} sha256:… bytes`", path = path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Written by another version of the format.
    #[error("{path}: a skill library of version {found}, this program reads version {VERSION}: build it anew", path = path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: String,
    },
    /// Bytes are missing or too many.
    #[error("{path}: damaged: {found} bytes follow the first line, which announces {expected}", path = path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes announced.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// The checksum does not agree.
    #[error("{path}: damaged: the contents have SHA-256 {found}, the first line says {expected}", path = path.display())]
    Checksum {
        /// The file.
        path: PathBuf,
        /// What the first line says.
        expected: String,
        /// What the contents have.
        found: String,
    },
    /// The contents are not a library, although the checksum agrees.
    #[error("{path}: not a skill library inside: {reason}", path = path.display())]
    Contents {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Two libraries to be merged are of different maps.
    #[error("{path}: a library of another map ({found}…, expected {expected}…): only libraries of one map can be put together", path = path.display())]
    OtherMap {
        /// The file.
        path: PathBuf,
        /// The beginning of the expected hash.
        expected: String,
        /// The beginning of the hash found.
        found: String,
    },
}

/// A library as it stands in its file, before it is bound to a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LibraryFile {
    /// The hash of the geometry of the map that the skills were learned on.
    pub map: String,
    /// The names of that map's regions.
    pub regions: Vec<String>,
    /// The skills.
    pub skills: Vec<StoredSkill>,
}

/// A skill as it stands in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredSkill {
    /// The waypoints, in map units, both endpoints included.
    pub path: Vec<[f64; 2]>,
    /// For each waypoint, the regions that contain it.
    pub letters: Vec<Vec<String>>,
    /// The length, in map units.
    pub cost: f64,
}

/// A skill of a file that does not hold on the map it was loaded for.
#[derive(Clone, Debug, PartialEq)]
pub struct Dropped {
    /// Its number in the file, from 0.
    pub skill: usize,
    /// Why.
    pub reason: SkillError,
}

/// A library that was read for a map.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The skills that hold.
    pub library: Library,
    /// Whether the file was made for this very geometry.
    pub same_map: bool,
    /// The skills that do not hold.
    pub dropped: Vec<Dropped>,
}

impl LibraryFile {
    /// Reads a file and checks everything that can be checked without its map.
    ///
    /// # Errors
    /// A file that cannot be read, is of another kind or version, or is damaged.
    pub fn read(path: &Path) -> Result<Self, LibraryError> {
        let here = || path.to_owned();
        let bytes = std::fs::read(path).map_err(|source| LibraryError::Io {
            path: here(),
            source,
        })?;
        let foreign = || LibraryError::Foreign { path: here() };
        // A first line of ours is short; do not look for its end in all of a foreign file.
        let head = &bytes[..bytes.len().min(256)];
        let end = head.iter().position(|&b| b == b'\n').ok_or_else(foreign)?;
        let line = std::str::from_utf8(&head[..end]).map_err(|_| foreign())?;
        let words: Vec<&str> = line.split(' ').collect();
        let &[MAGIC, version, checksum, length] = words.as_slice() else {
            return Err(foreign());
        };
        if version != VERSION.to_string() {
            return Err(LibraryError::Version {
                path: here(),
                found: version.to_owned(),
            });
        }
        let expected = checksum.strip_prefix("sha256:").ok_or_else(foreign)?;
        let announced: u64 = length.parse().map_err(|_| foreign())?;
        let body = &bytes[end + 1..];
        if body.len() as u64 != announced {
            return Err(LibraryError::Truncated {
                path: here(),
                expected: announced,
                found: body.len() as u64,
            });
        }
        let found = hex(&Sha256::digest(body));
        if found != expected {
            return Err(LibraryError::Checksum {
                path: here(),
                expected: expected.to_owned(),
                found,
            });
        }
        let contents = |reason| LibraryError::Contents {
            path: here(),
            reason,
        };
        let file: Self = serde_json::from_slice(body).map_err(|e| contents(e.to_string()))?;
        for (i, skill) in file.skills.iter().enumerate() {
            if skill.path.len() != skill.letters.len() {
                let (points, letters) = (skill.path.len(), skill.letters.len());
                return Err(contents(format!(
                    "skill {} has {points} points and letters for {letters}",
                    i + 1
                )));
            }
        }
        Ok(file)
    }

    /// Writes the file: beside its place first, then moved there.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&self, path: &Path) -> Result<(), LibraryError> {
        let fail = |source| LibraryError::Io {
            path: path.to_owned(),
            source,
        };
        let body = serde_json::to_vec_pretty(self).map_err(|e| fail(e.into()))?;
        let checksum = hex(&Sha256::digest(&body));
        let first = format!("{MAGIC} {VERSION} sha256:{checksum} {}\n", body.len());
        write_atomically(path, &[first.as_bytes(), &body].concat()).map_err(fail)
    }

    /// Adds the skills of another file of the same map; those that are there already, in either
    /// direction, are left out. Which of them dominate others is decided when the library is bound.
    ///
    /// # Errors
    /// A file of another map; `path` names it in the message.
    pub fn merge(&mut self, other: Self, path: &Path) -> Result<usize, LibraryError> {
        if self.map != other.map || self.regions != other.regions {
            let short = |hash: &str| hash.chars().take(12).collect();
            return Err(LibraryError::OtherMap {
                path: path.to_owned(),
                expected: short(&self.map),
                found: short(&other.map),
            });
        }
        let before = self.skills.len();
        for skill in other.skills {
            let same = |known: &StoredSkill| {
                known.path == skill.path || known.path.iter().eq(skill.path.iter().rev())
            };
            if !self.skills.iter().any(same) {
                self.skills.push(skill);
            }
        }
        Ok(self.skills.len() - before)
    }

    /// Binds the skills to a map. Each is checked point by point and leg by leg on this map,
    /// whatever the file says; those that do not hold are dropped, and told.
    #[must_use]
    pub fn bind(&self, system: &dyn TransitionSystem) -> Loaded {
        let mut library = Library::new(system);
        let mut dropped = Vec::new();
        for (i, stored) in self.skills.iter().enumerate() {
            match stored.bind(system) {
                Ok(skill) => {
                    library.offer(system, skill);
                }
                Err(reason) => dropped.push(Dropped { skill: i, reason }),
            }
        }
        Loaded {
            same_map: library.fingerprint == self.map,
            library,
            dropped,
        }
    }
}

impl StoredSkill {
    fn bind(&self, system: &dyn TransitionSystem) -> Result<Skill, SkillError> {
        let points = self.path.iter().map(|&[x, y]| Point2::new(x, y));
        let alphabet = system.alphabet();
        for (index, (p, names)) in points.clone().zip(&self.letters).enumerate() {
            let (x, y) = (p.x, p.y);
            let spot = system.settle(p);
            let spot = spot.ok_or(SkillError::NotFree { index, x, y })?;
            let mut expected: Vec<&str> = names.iter().map(String::as_str).collect();
            expected.sort_unstable();
            let name = |i: usize| alphabet.propositions()[i].as_str();
            let mut found: Vec<&str> = alphabet.props(spot.letter).iter().map(name).collect();
            found.sort_unstable();
            if expected != found {
                return Err(SkillError::Letter {
                    index,
                    x,
                    y,
                    expected: format!("{{{}}}", expected.join(",")),
                    found: format!("{{{}}}", found.join(",")),
                });
            }
        }
        Skill::new(system, points)
    }
}

impl Library {
    /// The library as it will stand in its file.
    #[must_use]
    pub fn to_file(&self, system: &dyn TransitionSystem) -> LibraryFile {
        let alphabet = system.alphabet();
        let stored = |skill: &Skill| StoredSkill {
            path: skill.path().iter().map(|s| [s.at.x, s.at.y]).collect(),
            letters: skill.names(alphabet),
            cost: skill.cost(),
        };
        LibraryFile {
            map: self.fingerprint.clone(),
            regions: alphabet.propositions().to_vec(),
            skills: self.skills.iter().map(stored).collect(),
        }
    }
}
