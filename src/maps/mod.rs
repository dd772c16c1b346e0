//! Map files: occupancy maps of ROS, MovingAI grids, GeoJSON.
//!
//! [`load`] turns a file into bounds and obstacles, and for GeoJSON regions and a start. Cells become
//! polygons by [`outline`], which says what is guaranteed; polygons with holes are [split]; the robot's radius is
//! added by [`inflate()`](inflate::inflate).
//!
//! ```
//! use nngtl::maps::{self, MapOptions};
//! let map = maps::load("scenarios/office.yaml", &MapOptions::default())?;
//! assert!(!map.obstacles.is_empty());
//! # Ok::<(), nngtl::maps::MapError>(())
//! ```

mod error;
mod geojson;
pub mod inflate;
mod movingai;
pub mod outline;
mod picture;
mod ros;
pub mod split;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use crate::number::Brief;
use crate::workspace::{Bounds, MAX_COORDINATE, Polygon};

pub use error::{MapError, MapErrorKind};

use outline::{Cells, Rings};

/// The largest map file that is read, in bytes (64 MiB).
pub const MAX_BYTES: u64 = 64 << 20;

/// The most cells of a map (a square of 4096).
pub const MAX_CELLS: u64 = 1 << 24;

/// How far outlines of cells may be moved, in cells, if nothing else is said.
pub const DEFAULT_TOLERANCE: f64 = 0.45;

/// The unit of a GeoJSON file's coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Units {
    /// Longitude and latitude in degrees, as the standard says.
    #[serde(rename = "deg")]
    Degrees,
    /// Metres.
    #[serde(rename = "m")]
    Metres,
}

/// How a map file is read. Settings that do not concern its format are ignored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapOptions {
    /// The robot's radius, metres: obstacles grow and bounds shrink by it. 0 by default.
    pub robot_radius: f64,
    /// How far outlines of cells may be moved, in cells, in `[0, 0.5)`; 0.45 by default.
    pub tolerance: Option<f64>,
    /// ROS: whether unknown cells are free; they are obstacles by default.
    pub unknown_is_free: bool,
    /// MovingAI: whether swamp is an obstacle; it is free by default.
    pub swamp_is_obstacle: bool,
    /// MovingAI: whether water is free; it is an obstacle by default.
    pub water_is_free: bool,
    /// MovingAI: the side of a cell, metres; 1 by default.
    pub cell: Option<f64>,
    /// GeoJSON: the unit of its coordinates, whatever the file says.
    pub units: Option<Units>,
    /// GeoJSON: longitude and latitude of the point (0, 0), degrees; the middle of the map by
    /// default.
    pub reference: Option<[f64; 2]>,
}

/// A map file as polygons, in metres.
#[derive(Clone, Debug)]
pub struct ImportedMap {
    /// The extent.
    pub bounds: Bounds,
    /// What the robot must not enter; polygons with holes in several parts that share borders.
    pub obstacles: Vec<Polygon>,
    /// What to call each obstacle in messages.
    pub obstacle_names: Vec<String>,
    /// Regions that the file names.
    pub regions: Vec<(String, Polygon)>,
    /// The start that the file names.
    pub start: Option<Point2<f64>>,
    /// How many cells are free, occupied and unknown; `None` for formats without cells.
    pub cells: Option<[usize; 3]>,
}

/// Cells as a format gives them.
#[derive(Debug)]
struct Import {
    cells: Cells,
    /// Metres per cell.
    scale: f64,
    /// Where the lower left corner lies (metres), and the rotation (radians).
    origin: [f64; 3],
    unknown: usize,
}

/// A format of map files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// YAML beside a picture.
    Ros,
    /// MovingAI's `.map`.
    MovingAi,
    /// GeoJSON.
    GeoJson,
}

impl Format {
    /// The format that a file's ending tells.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_string_lossy().to_ascii_lowercase();
        match ending.as_str() {
            "yaml" | "yml" => Some(Self::Ros),
            "map" => Some(Self::MovingAi),
            "geojson" | "json" => Some(Self::GeoJson),
            _ => None,
        }
    }
}

/// Reads a map file.
///
/// # Errors
/// See [`MapErrorKind`].
pub fn load(path: impl AsRef<Path>, options: &MapOptions) -> Result<ImportedMap, MapError> {
    let path = path.as_ref();
    let format = Format::of(path).ok_or_else(|| {
        let ending = path.extension().unwrap_or_default();
        let found = ending.to_string_lossy().into_owned();
        MapError::new(path, MapErrorKind::UnknownEnding { found })
    })?;
    let bytes = read_file(path)?;
    read(path, format, &bytes, options, &mut |picture| {
        let folder = path.parent().unwrap_or(Path::new(""));
        read_file(&folder.join(picture))
    })
}

/// Reads a map from bytes; `open` reads the picture that a ROS map names. `path` is for messages.
///
/// # Errors
/// See [`MapErrorKind`].
pub fn read(
    path: &Path,
    format: Format,
    bytes: &[u8],
    options: &MapOptions,
    open: &mut dyn FnMut(&str) -> Result<Vec<u8>, MapError>,
) -> Result<ImportedMap, MapError> {
    check_options(options).map_err(|kind| MapError::new(path, kind))?;
    let text = |bytes| {
        let text = std::str::from_utf8(bytes);
        let text = text.map_err(|_| MapError::new(path, MapErrorKind::NotText))?;
        Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
    };
    let on_line = |(line, kind): (Option<usize>, MapErrorKind)| {
        let error = MapError::new(path, kind);
        match line {
            Some(line) => error.on_line(line),
            None => error,
        }
    };
    match format {
        Format::Ros => {
            let file = ros::read(text(bytes)?).map_err(on_line)?;
            let picture_path = path.with_file_name(&file.image);
            let picture = picture::read(&open(&file.image)?)
                .map_err(|kind| MapError::new(&picture_path, kind))?;
            of_cells(&file.cells(&picture, options), options)
                .map_err(|kind| MapError::new(path, kind))
        }
        Format::MovingAi => {
            let import = movingai::read(text(bytes)?, options);
            let import = import.map_err(|(line, kind)| MapError::new(path, kind).on_line(line))?;
            of_cells(&import, options).map_err(|kind| MapError::new(path, kind))
        }
        Format::GeoJson => {
            let features = geojson::read(text(bytes)?, options).map_err(on_line)?;
            of_features(features, options).map_err(|kind| MapError::new(path, kind))
        }
    }
}

fn check_options(options: &MapOptions) -> Result<(), MapErrorKind> {
    let setting = |setting, problem: &str| MapErrorKind::Setting {
        setting,
        problem: problem.to_owned(),
    };
    let tolerance = options.tolerance.unwrap_or(DEFAULT_TOLERANCE);
    if !(0.0..0.5).contains(&tolerance) {
        return Err(setting("tolerance", "should be from 0 to below 0.5 cells"));
    }
    if !(options.robot_radius.is_finite() && options.robot_radius >= 0.0) {
        return Err(setting("robot_radius", "should be 0 or above, in metres"));
    }
    if options.cell.is_some_and(|c| !(c.is_finite() && c > 0.0)) {
        return Err(setting("cell", "should be above 0, in metres"));
    }
    Ok(())
}

fn read_file(path: &Path) -> Result<Vec<u8>, MapError> {
    let fail = |e| MapError::new(path, MapErrorKind::Read(e));
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(fail)?;
    file.take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(fail)?;
    if bytes.len() as u64 > MAX_BYTES {
        let limit = MAX_BYTES;
        return Err(MapError::new(path, MapErrorKind::TooLarge { limit }));
    }
    Ok(bytes)
}

/// Outlines of cells, in the world.
fn of_cells(import: &Import, options: &MapOptions) -> Result<ImportedMap, MapErrorKind> {
    let cells = &import.cells;
    let tolerance = options.tolerance.unwrap_or(DEFAULT_TOLERANCE);
    let [x, y, yaw] = import.origin;
    let (sin, cos) = (libm::sin(yaw), libm::cos(yaw));
    let place = |p: Point2<f64>| {
        let (px, py) = (p.x * import.scale, p.y * import.scale);
        Point2::new(x + cos * px - sin * py, y + sin * px + cos * py)
    };
    let rings = |rings: Rings| -> Rings {
        let ring = |ring: Vec<Point2<f64>>| ring.into_iter().map(place).collect();
        rings.into_iter().map(ring).collect()
    };
    let walls: Vec<Rings> = cells.outlines(tolerance)?.into_iter().map(rings).collect();
    let (w, h) = (cells.width as f64, cells.height as f64);
    let frame = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| place(Point2::new(x, y)));
    let occupied = cells.occupied.iter().filter(|&&o| o).count();
    let unknown = import.unknown;
    let (mut free, mut solid) = (cells.occupied.len() - occupied, occupied);
    if options.unknown_is_free {
        free -= unknown;
    } else {
        solid -= unknown;
    }
    let named = walls.into_iter().map(|rings| (String::new(), rings));
    let mut map = assemble(named.collect(), frame.to_vec(), yaw != 0.0, options)?;
    map.cells = Some([free, solid, unknown]);
    Ok(map)
}

fn of_features(
    features: geojson::Features,
    options: &MapOptions,
) -> Result<ImportedMap, MapErrorKind> {
    let Some(extent) = geojson::extent(&features) else {
        let message = "no feature says by `properties.kind` that it is a region, an obstacle, the bounds or the start";
        return Err(MapErrorKind::Syntax(message.to_owned()));
    };
    let (min, max) = (extent.min, extent.max);
    let all = vec![
        min,
        Point2::new(max.x, min.y),
        max,
        Point2::new(min.x, max.y),
    ];
    let frame = features.bounds.and_then(|rings| rings.into_iter().next());
    let slanted = frame.is_some();
    let frame = frame.unwrap_or(all);
    let mut map = assemble(features.obstacles, frame, slanted, options)?;
    for (name, ring) in features.regions {
        let what = || format!("region `{name}`");
        let polygon = polygon(ring, what)?;
        map.regions.push((name, polygon));
    }
    map.start = features.start;
    Ok(map)
}

/// Puts named walls into a frame. What of the frame's bounding box lies outside a `slanted` frame
/// becomes an obstacle.
fn assemble(
    mut walls: Vec<(String, Rings)>,
    frame: Vec<Point2<f64>>,
    slanted: bool,
    options: &MapOptions,
) -> Result<ImportedMap, MapErrorKind> {
    let first = frame.first().copied().unwrap_or_else(Point2::origin);
    let (min, max) = frame
        .iter()
        .fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)));
    let far = |p: &Point2<f64>| !(p.x.abs() <= MAX_COORDINATE && p.y.abs() <= MAX_COORDINATE);
    let rings = walls.iter().flat_map(|(_, rings)| rings.iter().flatten());
    if let Some(p) = frame.iter().chain(rings).find(|p| far(p)) {
        let message = format!(
            "the map reaches to ({}, {}): coordinates must lie within ±{MAX_COORDINATE:e} metres",
            Brief(p.x),
            Brief(p.y)
        );
        return Err(MapErrorKind::Syntax(message));
    }
    let radius = options.robot_radius;
    let bounds = Bounds {
        min: min.map(|c| c + radius),
        max: max.map(|c| c - radius),
    };
    if bounds.width() <= 0.0 || bounds.height() <= 0.0 {
        let problem = format!("is {radius}: the map is not wide enough for this robot");
        let setting = "robot_radius";
        return Err(MapErrorKind::Setting { setting, problem });
    }
    let margin = (max - min).norm() * 0.01;
    if slanted && !is_box(&frame, min, max) {
        let (low, high) = (min.map(|c| c - margin), max.map(|c| c + margin));
        let outer = vec![
            low,
            Point2::new(high.x, low.y),
            high,
            Point2::new(low.x, high.y),
        ];
        walls.push(("the edge of the map".to_owned(), vec![outer, frame]));
    }
    if radius > 0.0 {
        let rings: Vec<Rings> = walls.iter().map(|(_, rings)| rings.clone()).collect();
        // What grows may grow together; a name is kept where its wall stays alone.
        let grown = inflate::inflate(&rings, radius);
        walls = grown
            .into_iter()
            .map(|rings| (String::new(), rings))
            .collect();
    }
    let mut map = ImportedMap {
        bounds,
        obstacles: Vec::new(),
        obstacle_names: Vec::new(),
        regions: Vec::new(),
        start: None,
        cells: None,
    };
    for (name, rings) in walls {
        let Some(at) = rings.first().and_then(|r| r.first()).copied() else {
            continue;
        };
        let name = match name.as_str() {
            "" => format!("the wall at ({:.2}, {:.2})", at.x, at.y),
            name => name.to_owned(),
        };
        for part in split::split(rings) {
            map.obstacles.push(polygon(part, || name.clone())?);
            map.obstacle_names.push(name.clone());
        }
    }
    Ok(map)
}

fn polygon(ring: Vec<Point2<f64>>, what: impl Fn() -> String) -> Result<Polygon, MapErrorKind> {
    Polygon::new(ring).map_err(|source| MapErrorKind::Polygon {
        what: what(),
        source,
    })
}

/// Whether a ring is the axis-parallel rectangle between two corners.
fn is_box(ring: &[Point2<f64>], min: Point2<f64>, max: Point2<f64>) -> bool {
    let on = |p: &Point2<f64>| p.x == min.x || p.x == max.x || p.y == min.y || p.y == max.y;
    let area = (max.x - min.x) * (max.y - min.y);
    ring.iter().all(on) && (split::signed_area(ring).abs() - area).abs() <= 1e-12 * area
}

/// Two rings whose borders meet, if any do.
fn meeting_rings(rings: &Rings) -> Option<(usize, usize)> {
    struct Side {
        ring: usize,
        ends: [Point2<f64>; 2],
    }
    let mut sides: Vec<Side> = Vec::new();
    for (ring, points) in rings.iter().enumerate() {
        for (i, &a) in points.iter().enumerate() {
            let b = points[(i + 1) % points.len()];
            let ends = if a.x <= b.x { [a, b] } else { [b, a] };
            sides.push(Side { ring, ends });
        }
    }
    sides.sort_by(|s, t| s.ends[0].x.total_cmp(&t.ends[0].x));
    let mut active: Vec<usize> = Vec::new();
    for i in 0..sides.len() {
        let low = sides[i].ends[0].x;
        active.retain(|&j| sides[j].ends[1].x >= low);
        for &j in &active {
            let (s, t) = (&sides[i], &sides[j]);
            if s.ring != t.ring && crate::workspace::segments_meet(s.ends, t.ends) {
                return Some((s.ring.min(t.ring), s.ring.max(t.ring)));
            }
        }
        active.push(i);
    }
    None
}
