//! Why a map file could not be used.

use std::path::{Path, PathBuf};

use crate::workspace::PolygonError;

/// Why a map file could not be used: what is wrong, in which file, on which line.
#[derive(Debug)]
pub struct MapError {
    file: PathBuf,
    line: Option<usize>,
    kind: MapErrorKind,
}

/// The reasons behind a [`MapError`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapErrorKind {
    /// The file cannot be opened or read.
    #[error("cannot read the map: {0}")]
    Read(#[source] std::io::Error),
    /// The file is larger than [`MAX_BYTES`](super::MAX_BYTES).
    #[error("the file is larger than {limit} bytes: is this a map?")]
    TooLarge {
        /// The limit, in bytes.
        limit: u64,
    },
    /// The ending tells no format.
    #[error(
        "a map ends in .yaml (ROS), .map (MovingAI) or .geojson, {}: rename it",
        ending(found)
    )]
    UnknownEnding {
        /// The ending found, without the dot.
        found: String,
    },
    /// The file is not UTF-8 text.
    #[error("the file is not UTF-8 text, but its format is")]
    NotText,
    /// The text breaks the rules of its format.
    #[error("{0}")]
    Syntax(String),
    /// A field is missing or has a value that it must not have.
    #[error("`{field}` {problem}")]
    Field {
        /// Its name.
        field: String,
        /// What is wrong with it and what was expected.
        problem: String,
    },
    /// A setting does not fit the map.
    #[error("the setting `{setting}` {problem}")]
    Setting {
        /// Its name in the scenario's `[map]`.
        setting: &'static str,
        /// What is wrong with it and what was expected.
        problem: String,
    },
    /// The picture is too large.
    #[error("{width} × {height} cells are too many: at most {limit} are read")]
    TooManyCells {
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
        /// The limit.
        limit: u64,
    },
    /// The outlines are too long.
    #[error(
        "the outlines have more than {limit} corners: clean the map of single cells, or raise the `tolerance`"
    )]
    TooManyCorners {
        /// The limit.
        limit: usize,
    },
    /// A polygon is not simple.
    #[error("{what}: {source}")]
    Polygon {
        /// Which polygon.
        what: String,
        /// What is wrong with it.
        source: PolygonError,
    },
}

impl MapError {
    pub(super) fn new(file: &Path, kind: MapErrorKind) -> Self {
        Self {
            file: file.to_owned(),
            line: None,
            kind,
        }
    }

    pub(super) fn on_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }

    /// The file.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The line, from 1.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        self.line
    }

    /// The reason.
    #[must_use]
    pub fn kind(&self) -> &MapErrorKind {
        &self.kind
    }
}

impl std::fmt::Display for MapError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, "{line}:")?;
        }
        write!(f, " {}", self.kind)
    }
}

impl std::error::Error for MapError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        std::error::Error::source(&self.kind)
    }
}

fn ending(found: &str) -> String {
    match found {
        "" => "this one has no ending".to_owned(),
        found => format!("this one in `{found}`"),
    }
}
