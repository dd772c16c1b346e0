//! Scenario files: a map, a start and a mission, in TOML, JSON or JSONL.
//!
//! ```toml
//! name = "two-rooms"
//! start = [0.1, 0.1]
//! task = "[]<> a && []<> b"
//! weight = 0.2                       # λ, the weight of the prefix; this is the default
//!
//! [workspace]
//! bounds = [[0, 0], [1, 1]]          # lower-left and upper-right corner
//! obstacles = [[[0.4, 0], [0.6, 0], [0.6, 0.7], [0.4, 0.7]]]
//!
//! [workspace.regions]
//! a = [[0.1, 0.8], [0.3, 0.8], [0.2, 0.95]]
//! b = [[0.7, 0.1], [0.9, 0.1], [0.8, 0.3]]
//! ```
//!
//! A `grid = { cells = [20, 20], cell = 0.05 }` in `[workspace]` lets the robot move between centres of
//! cells only, along rows and columns; missions may then speak of the next waypoint (`X`).
//!
//! A map file may stand for bounds and obstacles, with regions and further obstacles beside it, and a
//! robot that is no point has a radius, by which obstacles grow and bounds shrink:
//!
//! ```toml
//! start = [1.5, 2.0]
//! task = "<> desk"
//! robot_radius = 0.2                 # metres
//!
//! [map]
//! file = "office.yaml"               # .yaml (ROS), .map (MovingAI) or .geojson, beside this file
//! tolerance = 0.45                   # how far outlines of cells may move, in cells; the default
//! unknown = "obstacle"               # or "free"; MovingAI: also `water`, `swamp` and `cell` (metres)
//!
//! [workspace.regions]
//! desk = [[4, 2], [5, 2], [5, 3], [4, 3]]
//! ```
//!
//! JSON says the same with the same names; a `.jsonl` file holds one such object a line. Unknown
//! fields are errors, and every error names file, line and column.

mod error;
mod locate;
mod pair;
mod read;
mod resolve;
pub(crate) mod snippet;
mod spec;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Point2;
use sha2::{Digest, Sha256};

use crate::ltl::{self, Formula, ParseOptions};
use crate::number::hex;
use crate::system::{Grid, GridError};
use crate::workspace::{Bounds, Place as Whereabouts, Polygon, Region, Workspace};

pub use error::{ScenarioError, ScenarioErrorKind};
pub use read::{MAX_BYTES, read_specs};
pub use spec::{DEFAULT_WEIGHT, GridSpec, RegionSpecs, ScenarioSpec, WorkspaceSpec};

use locate::Step;
use read::Source;

/// Obstacles no wider than so many tolerances of the map may not be in the way.
const THIN: f64 = 2.0;

/// A mission that is ready to be planned: checked map, start, formula and weight.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What it is called.
    pub name: String,
    /// The map.
    pub workspace: Arc<Workspace>,
    /// The grid over the map, if the robot moves between centres of cells.
    pub grid: Option<GridSpec>,
    /// Where the robot stands at first, in map units; in free space.
    pub start: Point2<f64>,
    /// The mission as it was written.
    pub task: String,
    /// The mission; it names only regions of the map.
    pub formula: Formula,
    /// λ in `[0, 1]`: the weight of the prefix in the cost.
    pub weight: f64,
    /// By how much the map was changed for a round robot, in map units: obstacles were grown and the bounds shrunk. 0 for a point.
    pub robot_radius: f64,
    /// SHA-256, in hex, of map, start, task and weight, the same for every file format. The name
    /// does not count.
    pub hash: String,
}

/// What a caller may put in the place of what a scenario file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Another mission.
    pub task: Option<String>,
    /// What errors call the other mission; "the given task" if nothing is said.
    pub task_of: Option<PathBuf>,
    /// Another λ, in `[0, 1]`.
    pub weight: Option<f64>,
}

/// What stands in a file, read once for several missions: standard input has no second time.
#[derive(Debug)]
pub struct ScenarioText {
    path: PathBuf,
    spec: ScenarioSpec,
    source: Source,
}

impl ScenarioText {
    /// Reads a file as [`Scenario::load_with`] does.
    ///
    /// # Errors
    /// A file that cannot be read, or is no scenario.
    pub fn read(path: impl AsRef<Path>, pick: Option<&str>) -> Result<Self, ScenarioError> {
        let path = path.as_ref().to_owned();
        let (spec, source) = read::read_one(&path, pick)?;
        Ok(Self { path, spec, source })
    }

    /// The scenario with parts replaced.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn scenario(&self, overrides: &Overrides) -> Result<Scenario, ScenarioError> {
        let checked = Scenario::check(&self.spec, Some(&self.source), overrides);
        checked.map_err(|e| e.in_file(&self.path))
    }
}

impl Scenario {
    /// Reads the scenario of a `.toml` or `.json` file, or of a `.jsonl` file that holds just one.
    ///
    /// # Errors
    /// Everything that can be wrong with a scenario, see [`ScenarioErrorKind`].
    ///
    /// ```
    /// use nngtl::scenario::Scenario;
    /// let scenario = Scenario::load("scenarios/case-study.toml")?;
    /// assert_eq!(scenario.name, "case-study");
    /// assert_eq!(scenario.workspace.regions().len(), 3);
    /// # Ok::<(), nngtl::scenario::ScenarioError>(())
    /// ```
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ScenarioError> {
        Self::load_with(path, None, &Overrides::default())
    }

    /// As [`load`](Self::load), with parts replaced, and from a `.jsonl` file of many the one
    /// that `pick` names (by its `name`, or by the number of its line, from 1).
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_with(
        path: impl AsRef<Path>,
        pick: Option<&str>,
        overrides: &Overrides,
    ) -> Result<Self, ScenarioError> {
        ScenarioText::read(path, pick)?.scenario(overrides)
    }

    /// Reads every scenario of a file, in order; each is fine or says what is wrong with it.
    ///
    /// # Errors
    /// If the file as a whole cannot be read. Errors of single scenarios are in the list.
    pub fn load_all(
        path: impl AsRef<Path>,
    ) -> Result<Vec<Result<Self, ScenarioError>>, ScenarioError> {
        let path = path.as_ref();
        let all = read::read_many(path)?;
        Ok(all
            .into_iter()
            .map(|one| Self::checked(path, one))
            .collect())
    }

    /// As [`load_all`](Self::load_all), for text that stands in no file (yet): `path` says by its
    /// ending what the text is, and where the map files lie that it names.
    ///
    /// # Errors
    /// As [`load_all`](Self::load_all).
    ///
    /// ```
    /// use nngtl::scenario::Scenario;
    /// let text = r#"{"start": [1, 1], "task": "true", "workspace": {"bounds": [[0, 0], [2, 2]]}}"#;
    /// let scenarios = Scenario::parse_all("memory.json", text)?;
    /// assert!(scenarios[0].is_ok());
    /// # Ok::<(), nngtl::scenario::ScenarioError>(())
    /// ```
    pub fn parse_all(
        path: impl AsRef<Path>,
        text: &str,
    ) -> Result<Vec<Result<Self, ScenarioError>>, ScenarioError> {
        let path = path.as_ref();
        let all = read::read_text_of(path, Ok(text.to_owned()))?;
        Ok(all
            .into_iter()
            .map(|one| Self::checked(path, one))
            .collect())
    }

    fn checked(
        path: &Path,
        one: Result<(ScenarioSpec, Source), ScenarioError>,
    ) -> Result<Self, ScenarioError> {
        let (spec, source) = one?;
        Self::check(&spec, Some(&source), &Overrides::default()).map_err(|e| e.in_file(path))
    }

    /// Checks a scenario that was made in memory.
    ///
    /// # Errors
    /// As [`load`](Self::load), without file and place.
    pub fn from_spec(spec: &ScenarioSpec) -> Result<Self, ScenarioError> {
        Self::check(spec, None, &Overrides::default())
    }

    /// Things that are allowed but probably not meant, each one sentence.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let workspace = &self.workspace;
        let hidden = |name: &str| {
            let region = workspace.regions().iter().find(|r| r.name == name);
            let meets = |bounds: Bounds| {
                region.is_some_and(|r| bounds.meet(r.polygon.min(), r.polygon.max()))
            };
            let inside = meets(workspace.bounds());
            let covered = workspace.obstacles().iter().any(|o| {
                let (min, max) = (o.min(), o.max());
                meets(Bounds { min, max })
            });
            let why = match (inside, covered) {
                (true, true) => "is covered by obstacles entirely",
                (true, false) => "is too small for a map of this size",
                (false, _) => "lies outside the bounds",
            };
            format!("region `{name}` {why}: no point of it can be visited")
        };
        let thin = |(i, obstacle): (usize, &Polygon)| {
            let width = obstacle.area() / (obstacle.max() - obstacle.min()).norm();
            let i = i + 1;
            (width <= THIN * workspace.tolerance()).then(|| {
                format!(
                    "obstacle {i} is too thin for a map of this size: the robot may pass through it"
                )
            })
        };
        let regions = workspace.hidden_regions().into_iter().map(hidden);
        let obstacles = workspace.obstacles().iter().enumerate();
        regions
            .chain(self.obstacles_outside())
            .chain(obstacles.filter_map(thin))
            .collect()
    }

    /// That obstacles lie outside the bounds, where they are in nobody's way: mostly their unit is another.
    fn obstacles_outside(&self) -> Option<String> {
        let (workspace, bounds) = (&self.workspace, self.workspace.bounds());
        let outside = |(i, o): (usize, &Polygon)| {
            (!bounds.meet(o.min(), o.max())).then(|| workspace.obstacle_name(i))
        };
        let obstacles = workspace.obstacles().iter().enumerate();
        let mut names = obstacles.filter_map(outside);
        let first = names.next()?;
        let are = match names.count() {
            0 => "lies".to_owned(),
            1 => "and another one lie".to_owned(),
            more => format!("and {more} others lie"),
        };
        Some(format!(
            "{first} {are} outside the bounds: the robot cannot meet what is there"
        ))
    }

    fn check(
        spec: &ScenarioSpec,
        source: Option<&Source>,
        overrides: &Overrides,
    ) -> Result<Self, ScenarioError> {
        let fail = |kind: ScenarioErrorKind, path: &[Step<'_>]| {
            ScenarioError::new(kind).at(source.and_then(|s| s.place(path)))
        };
        let map = Step::Key("workspace");
        let names = source.map(|s| s.obstacle_names.clone());
        let workspace = build_workspace(&spec.workspace, &fail)?;
        let workspace = Arc::new(workspace.with_obstacle_names(names.unwrap_or_default()));
        let radius = source.map_or(0.0, |s| s.robot_radius);
        let mut start = check_start(spec.start, &workspace)
            .map_err(|kind| fail(kind, &[Step::Key("start")]).on_map_for(radius))?;
        if let Some(grid) = spec.workspace.grid {
            start = start_on_grid(grid, &workspace, start).map_err(|e| {
                fail(ScenarioErrorKind::Grid(e), &[map, Step::Key("grid")]).on_map_for(radius)
            })?;
        }
        let weight = overrides.weight.unwrap_or(spec.weight);
        if !(0.0..=1.0).contains(&weight) {
            let kind = ScenarioErrorKind::Weight(weight);
            return Err(match overrides.weight {
                Some(_) => ScenarioError::new(kind).in_file("the given weight"),
                None => fail(kind, &[Step::Key("weight")]),
            });
        }
        let (task, written) = match (&overrides.task, &spec.task) {
            (Some(task), _) => (task, None),
            (None, Some(task)) => (task, source),
            (None, None) => return Err(ScenarioErrorKind::NoTask.into()),
        };
        let given = || match &overrides.task_of {
            Some(file) => file.clone(),
            None => "the given task".into(),
        };
        let formula = check_task(task, &workspace, written).map_err(|e| match written {
            Some(_) => e,
            None => e.in_file(given()),
        })?;
        Ok(Self {
            name: spec.name.clone(),
            hash: hash(spec, start, task, weight),
            workspace,
            grid: spec.workspace.grid,
            start,
            task: task.clone(),
            formula,
            weight,
            robot_radius: radius,
        })
    }
}

fn build_workspace(
    spec: &WorkspaceSpec,
    fail: &impl Fn(ScenarioErrorKind, &[Step<'_>]) -> ScenarioError,
) -> Result<Workspace, ScenarioError> {
    let map = Step::Key("workspace");
    let [min, max] = spec.bounds;
    let bad = |kind| fail(kind, &[map, Step::Key("bounds")]);
    for value in [min[0], min[1], max[0], max[1]] {
        finite("a coordinate of the bounds", value).map_err(bad)?;
    }
    if min[0] >= max[0] || min[1] >= max[1] {
        return Err(bad(ScenarioErrorKind::Bounds { min, max }));
    }
    let bounds = Bounds {
        min: point(min),
        max: point(max),
    };

    let mut obstacles = Vec::with_capacity(spec.obstacles.len());
    for (i, vertices) in spec.obstacles.iter().enumerate() {
        let path = [map, Step::Key("obstacles"), Step::Index(i)];
        let what = || format!("obstacle {}", i + 1);
        obstacles.push(polygon(vertices, what).map_err(|kind| fail(kind, &path))?);
    }
    let mut regions: Vec<Region> = Vec::with_capacity(spec.regions.0.len());
    for (name, vertices) in &spec.regions.0 {
        let path = [map, Step::Key("regions"), Step::Key(name)];
        let checked = check_region_name(name, &regions)
            .and_then(|()| polygon(vertices, || format!("region `{name}`")));
        regions.push(Region {
            name: name.clone(),
            polygon: checked.map_err(|kind| fail(kind, &path))?,
        });
    }
    Workspace::new(bounds, obstacles, regions)
        .map_err(|e| fail(ScenarioErrorKind::Workspace(e), &[map]))
}

fn check_region_name(name: &str, so_far: &[Region]) -> Result<(), ScenarioErrorKind> {
    if so_far.iter().any(|r| r.name == name) {
        return Err(ScenarioErrorKind::DuplicateRegion(name.to_owned()));
    }
    match ltl::bad_name(name) {
        None => Ok(()),
        Some(reason) => Err(ScenarioErrorKind::RegionName {
            name: name.to_owned(),
            reason,
        }),
    }
}

fn polygon(vertices: &[[f64; 2]], what: impl Fn() -> String) -> Result<Polygon, ScenarioErrorKind> {
    let points = vertices.iter().copied().map(point).collect();
    Polygon::new(points).map_err(|source| ScenarioErrorKind::Polygon {
        what: what(),
        source,
    })
}

fn check_start([x, y]: [f64; 2], workspace: &Workspace) -> Result<Point2<f64>, ScenarioErrorKind> {
    finite("a coordinate of the start", x)?;
    finite("a coordinate of the start", y)?;
    let start = point([x, y]);
    match workspace.locate(start) {
        Whereabouts::Free { .. } => Ok(start),
        Whereabouts::Outside => Err(ScenarioErrorKind::StartOutside { x, y }),
        Whereabouts::Obstacle(i) => Err(ScenarioErrorKind::StartInObstacle {
            x,
            y,
            obstacle: i + 1,
            name: workspace.obstacle_name(i),
        }),
    }
}

/// The centre of the start's cell, which no decimal fraction may be; the grid must fit the map.
fn start_on_grid(
    grid: GridSpec,
    workspace: &Arc<Workspace>,
    start: Point2<f64>,
) -> Result<Point2<f64>, GridError> {
    let grid = Grid::new(Arc::clone(workspace), grid.cells, grid.cell, start)?;
    Ok(grid.start().at)
}

/// Parses the task; `written` is the file it stands in, if it stands in one.
fn check_task(
    task: &str,
    workspace: &Workspace,
    written: Option<&Source>,
) -> Result<Formula, ScenarioError> {
    let place = |span: std::ops::Range<usize>| match written {
        Some(source) => source.place_within(&[Step::Key("task")], task, &span),
        None => Some(error::Place {
            text: task.to_owned(),
            first_line: 1,
            span,
        }),
    };
    let names = workspace.alphabet().propositions();
    let options = ParseOptions {
        known: names.to_vec(),
        ..ParseOptions::default()
    };
    let checked = ltl::parse(task, &options)
        .and_then(|parsed| ltl::check_propositions(&parsed, names).map(|()| parsed.formula));
    checked.map_err(|e| {
        let place = place(e.span.clone());
        ScenarioError::new(ScenarioErrorKind::Formula(e)).at(place)
    })
}

fn finite(what: &'static str, value: f64) -> Result<(), ScenarioErrorKind> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(ScenarioErrorKind::NotFinite { what, value })
    }
}

fn point([x, y]: [f64; 2]) -> Point2<f64> {
    // Adding zero turns −0 into 0, so that equal maps are equal bit by bit.
    Point2::new(x + 0.0, y + 0.0)
}

/// The digest of what decides a plan, over compact JSON with shortest round-trip numbers.
fn hash(spec: &ScenarioSpec, start: Point2<f64>, task: &str, weight: f64) -> String {
    let canonical = ScenarioSpec {
        name: String::new(),
        start: [start.x, start.y],
        task: Some(task.trim().to_owned()),
        weight,
        workspace: canonical_map(&spec.workspace),
    };
    let text = serde_json::to_string(&canonical).unwrap_or_default();
    hex(&Sha256::digest(text))
}

fn canonical_map(map: &WorkspaceSpec) -> WorkspaceSpec {
    let zeroed = |p: &[f64; 2]| [p[0] + 0.0, p[1] + 0.0];
    let ring = |ring: &Vec<[f64; 2]>| ring.iter().map(zeroed).collect::<Vec<_>>();
    WorkspaceSpec {
        bounds: [zeroed(&map.bounds[0]), zeroed(&map.bounds[1])],
        obstacles: map.obstacles.iter().map(ring).collect(),
        regions: RegionSpecs(
            map.regions
                .0
                .iter()
                .map(|(name, vertices)| (name.clone(), ring(vertices)))
                .collect(),
        ),
        grid: map.grid,
    }
}

#[cfg(test)]
mod tests;
