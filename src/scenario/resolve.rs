//! From what a scenario file says to plain polygons: reads the map file that it names, and grows
//! obstacles by the robot's radius.

use std::path::Path;

use nalgebra::Point2;

use super::error::{ScenarioError, ScenarioErrorKind as Kind};
use super::locate::Step;
use super::read::Source;
use super::spec::{RegionSpecs, ScenarioFile, ScenarioSpec, WorkspaceSpec};
use crate::maps::{self, ImportedMap, inflate::inflate, split::split};
use crate::system::GridError;
use crate::workspace::Polygon;

/// A scenario in plain polygons, and what to call its obstacles (nothing: by their numbers).
pub(super) type Resolved = (ScenarioSpec, Vec<String>);

/// Polygons as a file lists them.
type Shapes = Vec<Vec<[f64; 2]>>;

/// Resolves a scenario that stands in the file at `path`.
pub(super) fn resolve(
    file: ScenarioFile,
    path: &Path,
    source: &Source,
) -> Result<Resolved, ScenarioError> {
    let fail = |kind: Kind, steps: &[Step<'_>]| ScenarioError::new(kind).at(source.place(steps));
    let radius = file.robot_radius;
    if !(radius.is_finite() && radius >= 0.0) {
        return Err(fail(
            Kind::RobotRadius(radius),
            &[Step::Key("robot_radius")],
        ));
    }
    let workspace = file.workspace.unwrap_or_default();
    let map = match &file.map {
        Some(map) => {
            let format = maps::Format::of(Path::new(&map.file));
            if let Some(name) = format.and_then(|format| map.foreign(format)) {
                let ending = Path::new(&map.file).extension().unwrap_or_default();
                let kind = Kind::Syntax(format!(
                    "`{name}` means nothing in maps that end in `.{}`: leave it out",
                    ending.to_string_lossy()
                ));
                return Err(fail(kind, &[Step::Key("map"), Step::Key(name)]));
            }
            let folder = path.parent().unwrap_or(Path::new(""));
            let read = maps::load(folder.join(&map.file), &map.options(radius));
            let steps = [Step::Key("map"), Step::Key("file")];
            Some(read.map_err(|e| fail(Kind::Map(e), &steps))?)
        }
        None => None,
    };
    let missing = |what: &str| Kind::Syntax(format!("missing field `{what}`"));
    let grid = workspace
        .grid
        .filter(|g| g.cell > 0.0 && !g.cells.contains(&0));
    let bounds = match (workspace.bounds, &map, grid) {
        (Some([min, max]), ..) => [min.map(|c| c + radius), max.map(|c| c - radius)],
        (None, Some(map), _) => [map.bounds.min.into(), map.bounds.max.into()],
        (None, None, Some(grid)) => [[0.0; 2], grid.cells.map(|n| f64::from(n) * grid.cell)],
        (None, None, None) => {
            let workspace_key = Step::Key("workspace");
            return Err(match workspace.grid {
                // The grid would say how large the map is, if it were one.
                Some(grid) => {
                    let [columns, rows] = grid.cells;
                    let why = match grid.cells.contains(&0) {
                        true => GridError::Cells { columns, rows },
                        false => GridError::Side { cell: grid.cell },
                    };
                    fail(Kind::Grid(why), &[workspace_key, Step::Key("grid")])
                }
                None => fail(missing("bounds` in `workspace"), &[workspace_key]),
            });
        }
    };
    if radius > 0.0 && !(bounds[0][0] < bounds[1][0] && bounds[0][1] < bounds[1][1]) {
        return Err(fail(
            Kind::RobotRadius(radius),
            &[Step::Key("robot_radius")],
        ));
    }
    let of_map = map.as_ref().and_then(|m| m.start).map(Into::into);
    let Some(start) = file.start.or(of_map) else {
        return Err(fail(missing("start"), &[Step::Key("name")]));
    };
    let mut names = Vec::new();
    let mut obstacles = workspace.obstacles;
    if radius > 0.0 {
        (obstacles, names) = grown(&obstacles, radius).map_err(|(i, kind)| {
            fail(
                kind,
                &[
                    Step::Key("workspace"),
                    Step::Key("obstacles"),
                    Step::Index(i),
                ],
            )
        })?;
    }
    names.resize(obstacles.len(), String::new());
    let mut regions = workspace.regions.0;
    if let Some(map) = map {
        add_map(map, &mut obstacles, &mut names, &mut regions);
    }
    let spec = ScenarioSpec {
        name: file.name,
        start,
        task: file.task,
        weight: file.weight,
        workspace: WorkspaceSpec {
            bounds,
            obstacles,
            regions: RegionSpecs(regions),
            grid: workspace.grid,
        },
    };
    Ok((spec, names))
}

fn plain(polygon: &[Point2<f64>]) -> Vec<[f64; 2]> {
    polygon.iter().map(|p| [p.x, p.y]).collect()
}

fn add_map(
    map: ImportedMap,
    obstacles: &mut Vec<Vec<[f64; 2]>>,
    names: &mut Vec<String>,
    regions: &mut Vec<(String, Vec<[f64; 2]>)>,
) {
    if let Some([free, occupied, unknown]) = map.cells {
        log::info!("the map has {free} free, {occupied} occupied and {unknown} unknown cells");
    }
    obstacles.extend(map.obstacles.iter().map(|o| plain(o.vertices())));
    names.extend(map.obstacle_names);
    for (name, polygon) in map.regions {
        regions.push((name, plain(polygon.vertices())));
    }
}

/// Obstacles grown by the robot's radius, each on its own, and what to call the parts.
fn grown(obstacles: &[Vec<[f64; 2]>], radius: f64) -> Result<(Shapes, Vec<String>), (usize, Kind)> {
    let (mut all, mut names) = (Vec::new(), Vec::new());
    for (i, obstacle) in obstacles.iter().enumerate() {
        let points = obstacle.iter().map(|&[x, y]| Point2::new(x, y)).collect();
        let polygon = Polygon::new(points).map_err(|source| {
            let what = format!("obstacle {}", i + 1);
            (i, Kind::Polygon { what, source })
        })?;
        for rings in inflate(&[vec![polygon.vertices().to_vec()]], radius) {
            for part in split(rings) {
                all.push(plain(&part));
                names.push(format!("obstacle {}", i + 1));
            }
        }
    }
    Ok((all, names))
}
