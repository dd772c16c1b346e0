//! Why a scenario could not be used, and where it says so.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

use crate::ltl::ParseError;
use crate::maps::MapError;
use crate::number::Brief;

use crate::system::GridError;
use crate::workspace::{PolygonError, WorkspaceError};

use super::locate::line_column;

/// Why a scenario could not be read or used: what is wrong, in which file, at which line and column.
///
/// The [`Display`](fmt::Display) form is one line, `file:line:column: reason`;
/// [`snippet`](Self::snippet) shows the lines of the file with a caret below the place.
#[derive(Debug)]
pub struct ScenarioError {
    pub(super) kind: Box<ScenarioErrorKind>,
    file: Option<PathBuf>,
    place: Option<Place>,
    /// The robot's radius, if the map was changed for its sake and the reason may lie in that.
    radius: f64,
}

/// A place in a text: the text that is shown, where it begins in the file, and the bytes meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) text: String,
    /// Line number of the text's first line in its file, from 1.
    pub(super) first_line: usize,
    pub(super) span: Range<usize>,
}

/// The reasons behind a [`ScenarioError`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioErrorKind {
    /// The file cannot be opened or read.
    #[error("cannot read the scenario: {0}")]
    Read(#[source] std::io::Error),
    /// The file (or a line of a `.jsonl` file) is larger than [`MAX_BYTES`](super::MAX_BYTES).
    #[error("the scenario is larger than {limit} bytes: is this a scenario file?")]
    TooLarge {
        /// The limit, in bytes.
        limit: u64,
    },
    /// The file is not UTF-8 text.
    #[error("the scenario is not UTF-8 text: save it as UTF-8")]
    NotText,
    /// The ending tells no format.
    #[error(
        "a scenario file ends in .toml, .json or .jsonl, this one in `{found}`: {}",
        advice(found)
    )]
    UnknownEnding {
        /// The ending found, without the dot.
        found: String,
    },
    /// The text breaks the rules of its format, or a field is missing, unknown or of a wrong type.
    #[error("{0}")]
    Syntax(String),
    /// A file for one scenario holds none or several.
    #[error("the file holds {found} scenarios: name the one you mean by its `name` or line number")]
    NotOne {
        /// How many there are.
        found: usize,
    },
    /// A file for scenarios holds none.
    #[error("there is no scenario in it: it is empty")]
    Empty,
    /// No scenario of a `.jsonl` file has this name or line number.
    #[error("no scenario is called `{pick}`, and none stands on a line of that number")]
    NotFound {
        /// What was asked for.
        pick: String,
    },
    /// Several scenarios of a `.jsonl` file have this name.
    #[error(
        "several scenarios are called `{pick}`: name the one you mean by its line, {}",
        listed(lines)
    )]
    SeveralNamed {
        /// What was asked for.
        pick: String,
        /// Where they stand.
        lines: Vec<usize>,
    },
    /// A number is NaN or infinite.
    #[error("{what} is {value}: expected a finite number")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// The bounds enclose nothing.
    #[error(
        "the bounds go from ({}, {}) to ({}, {}): expected the lower-left corner first, then the upper-right one", Brief(min[0]), Brief(min[1]), Brief(max[0]), Brief(max[1])
    )]
    Bounds {
        /// The first corner.
        min: [f64; 2],
        /// The second corner.
        max: [f64; 2],
    },
    /// An obstacle or a region is not a simple polygon.
    #[error("{what}: {source}")]
    Polygon {
        /// Which polygon: `obstacle 3` (counted from 1) or ``region `l1` ``.
        what: String,
        /// What is wrong with it.
        source: PolygonError,
    },
    /// A region's name cannot be written in a formula.
    #[error("`{name}` cannot name a region: {reason}")]
    RegionName {
        /// The name.
        name: String,
        /// The rule it breaks.
        reason: &'static str,
    },
    /// Two regions share a name.
    #[error("region `{0}` is there twice: give each region a name of its own")]
    DuplicateRegion(String),
    /// The map as a whole is refused.
    #[error("{0}")]
    Workspace(#[source] WorkspaceError),
    /// The start lies outside the bounds.
    #[error("the start ({}, {}) lies outside the bounds: move it inside", Brief(*x), Brief(*y))]
    StartOutside {
        /// Its x coordinate, map units.
        x: f64,
        /// Its y coordinate, map units.
        y: f64,
    },
    /// The start lies in an obstacle.
    #[error("the start ({x}, {y}) lies inside {name}: move one of them")]
    StartInObstacle {
        /// Its x coordinate, map units.
        x: f64,
        /// Its y coordinate, map units.
        y: f64,
        /// The obstacle, counted from 1.
        obstacle: usize,
        /// What it is called.
        name: String,
    },
    /// The robot's radius is no length, or the map is too narrow for it.
    #[error(
        "the robot's radius is {}: expected a number from 0 to less than half the map's width", Brief(*.0)
    )]
    RobotRadius(f64),
    /// The map file cannot be used.
    #[error("the map: {0}")]
    Map(#[source] MapError),
    /// The weight is not a share.
    #[error(
        "the weight is {}: expected a number from 0 (only the suffix counts) to 1 (only the prefix)", Brief(*.0)
    )]
    Weight(f64),
    /// There is no formula.
    #[error("the scenario has no `task`: add one, or name a formula on the command line")]
    NoTask,
    /// The task is not a formula, or names a region that the map does not have.
    #[error("the task: {}", without_place(.0))]
    Formula(#[source] ParseError),
    /// The grid does not fit the map, or the start not the grid.
    #[error("the grid: {0}")]
    Grid(#[source] GridError),
}

impl ScenarioError {
    pub(super) fn new(kind: ScenarioErrorKind) -> Self {
        Self {
            kind: Box::new(kind),
            file: None,
            place: None,
            radius: 0.0,
        }
    }

    pub(super) fn at(mut self, place: Option<Place>) -> Self {
        if self.place.is_none() {
            self.place = place;
        }
        self
    }

    /// Says that obstacles were grown and the bounds shrunk by a radius, if they were.
    pub(super) fn on_map_for(mut self, radius: f64) -> Self {
        self.radius = radius;
        self
    }

    pub(super) fn in_file(mut self, file: impl Into<PathBuf>) -> Self {
        // The first name stays: a task that was given instead of the file's is not in the file.
        self.file.get_or_insert_with(|| file.into());
        self
    }

    /// The reason.
    #[must_use]
    pub fn kind(&self) -> &ScenarioErrorKind {
        &self.kind
    }

    /// Line and column in the file, both from 1, where the reason stands in the text.
    #[must_use]
    pub fn position(&self) -> Option<(usize, usize)> {
        let place = self.place.as_ref()?;
        let (line, column) = line_column(&place.text, place.span.start);
        Some((line + place.first_line - 1, column))
    }

    /// The lines of the text that are meant, with a caret; `None` where there is no text.
    #[must_use]
    pub fn snippet(&self) -> Option<String> {
        let place = self.place.as_ref()?;
        Some(super::snippet::show(
            &place.text,
            place.first_line,
            &place.span,
        ))
    }
}

/// What to do with a file of such an ending.
fn advice(ending: &str) -> &'static str {
    match ending {
        "yaml" | "yml" | "pgm" | "png" | "map" | "geojson" => {
            "a map is named in a scenario, by `file` in its table `[map]`, beside start, task and regions"
        }
        _ => "rename it, or let it have no ending",
    }
}

/// The sentence without its place in the formula: the place in the file is told already.
fn without_place(e: &ParseError) -> String {
    let (line, column) = e.line_column();
    e.to_string()
        .replacen(&format!(" at line {line}, column {column}"), "", 1)
}

impl From<ScenarioErrorKind> for ScenarioError {
    fn from(kind: ScenarioErrorKind) -> Self {
        Self::new(kind)
    }
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.file, self.position()) {
            (Some(file), Some((line, column))) => {
                write!(f, "{}:{line}:{column}: ", file.display())?;
            }
            (Some(file), None) => write!(f, "{}: ", file.display())?,
            (None, Some((line, column))) => write!(f, "line {line}, column {column}: ")?,
            (None, None) => {}
        }
        self.kind.fmt(f)?;
        if self.radius > 0.0 {
            let radius = Brief(self.radius);
            write!(
                f,
                " (for a robot_radius of {radius}, obstacles were grown and the bounds shrunk)"
            )?;
        }
        Ok(())
    }
}

impl std::error::Error for ScenarioError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.kind.source()
    }
}

/// `2, 5 or 7`.
fn listed(lines: &[usize]) -> String {
    let all: Vec<String> = lines.iter().map(ToString::to_string).collect();
    match all.as_slice() {
        [most @ .., last] if !most.is_empty() => format!("{} or {last}", most.join(", ")),
        _ => all.concat(),
    }
}
