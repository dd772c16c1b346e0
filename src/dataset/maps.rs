//! Random maps, in families.
//!
//! Every map is the unit square; coordinates are rounded to [`GRID`], so that what a data set
//! writes down is exactly the map that its labels were made on.

use std::f64::consts::TAU;
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use nalgebra::{Point2, Vector2};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::mazes::Maze;
use super::{blobs, rooms, shapes};
use crate::random::{Random, chance, choose};
use crate::workspace::{Bounds, Place, Polygon, Region, Workspace, WorkspaceError};

/// Steps to which coordinates are rounded, per map unit.
pub const GRID: f64 = 1e4;

/// The largest number of regions on a map: the networks' channels (`nngtl.md`, IV-B).
pub const MAX_REGIONS: usize = 7;

/// The distance that regions keep from obstacles and from each other, in map units.
const MARGIN: f64 = 0.01;

/// Shapes with a smaller area than this are drawn again, in squared map units.
const LEAST_AREA: f64 = 2e-4;

/// How often a place is drawn for one shape before the map is drawn anew.
const PLACES: usize = 60;

/// A kind of map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Two large rectangles as obstacles and seven small regions, drawn on a 200 × 200 grid
    /// (`nngtl.md`, IV-D, which leaves sizes open).
    Paper,
    /// As the paper's authors draw them in their published code: a rectangle that lies, one that stands, and
    /// as regions seven squares of three cells on that grid.
    Published,
    /// Many small obstacles of all shapes.
    Clutter,
    /// Rooms with doors and corridors.
    Rooms,
    /// Floors of large buildings: 6 × 6 to 9 × 9 rooms with doors, and furniture.
    Floors,
    /// One-lane corridors where most turns are wrong.
    Mazes,
    /// Shapes as on occupancy maps: caves, and rooms as a range finder sees them.
    Blobs,
    /// Few obstacles and large regions.
    Large,
    /// Many obstacles and small regions.
    Small,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 9] = [
        Self::Paper,
        Self::Clutter,
        Self::Rooms,
        Self::Mazes,
        Self::Blobs,
        Self::Large,
        Self::Small,
        Self::Published,
        Self::Floors,
    ];

    /// The family's name in data sets.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Published => "published",
            Self::Clutter => "clutter",
            Self::Rooms => "rooms",
            Self::Floors => "floors",
            Self::Mazes => "mazes",
            Self::Blobs => "blobs",
            Self::Large => "large",
            Self::Small => "small",
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Family {
    type Err = UnknownFamily;

    fn from_str(name: &str) -> Result<Self, UnknownFamily> {
        let named = |family: &Self| family.name() == name;
        let found = Self::ALL.into_iter().find(named);
        found.ok_or_else(|| UnknownFamily(name.to_owned()))
    }
}

/// No family has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no family of maps called `{0}`: expected one of {all}", all = Family::ALL.map(Family::name).join(", "))]
pub struct UnknownFamily(pub String);

/// Obstacles and regions of a random map; region `k` is called `l<k+1>`.
#[derive(Clone, Debug, PartialEq)]
pub struct MapShapes {
    /// The family that it was drawn from.
    pub family: Family,
    /// The obstacles; they may overlap.
    pub obstacles: Vec<Polygon>,
    /// The regions, disjoint from each other and from the obstacles.
    pub regions: Vec<Polygon>,
}

impl MapShapes {
    /// The map as a workspace.
    ///
    /// # Errors
    /// As [`Workspace::new`].
    pub fn workspace(&self) -> Result<Workspace, WorkspaceError> {
        let regions = self.regions.iter().enumerate().map(|(k, polygon)| Region {
            name: region_name(k),
            polygon: polygon.clone(),
        });
        Workspace::new(Bounds::unit(), self.obstacles.clone(), regions.collect())
    }
}

/// The name of region `k`, counted from 0.
#[must_use]
pub fn region_name(k: usize) -> String {
    format!("l{}", k + 1)
}

/// Draws a map.
///
/// ```
/// use nngtl::dataset::maps::{Family, draw_map};
/// use nngtl::random::generator;
/// let map = draw_map(Family::Paper, &mut generator(1, 0));
/// assert_eq!((map.obstacles.len(), map.regions.len()), (2, 7));
/// assert_eq!(map, draw_map(Family::Paper, &mut generator(1, 0)));
/// ```
#[must_use]
pub fn draw_map(family: Family, random: &mut Random) -> MapShapes {
    loop {
        let drawn = match family {
            Family::Paper => paper(random),
            Family::Published => published(random),
            Family::Clutter => clutter(random),
            Family::Rooms => with_rooms(random),
            Family::Floors => floor(random),
            Family::Mazes => maze(random),
            Family::Blobs => blobs(random),
            Family::Large => sized(2..=7, (0.09, 0.2), random),
            Family::Small => sized(6..=20, (0.008, 0.022), random),
        };
        if let Some((obstacles, regions)) = drawn {
            return MapShapes {
                family,
                obstacles,
                regions,
            };
        }
    }
}

/// Draws a start: uniform over the free space, rounded to the grid.
#[must_use]
pub fn draw_start(workspace: &Workspace, random: &mut Random) -> Point2<f64> {
    loop {
        let p = round(workspace.sample_free(random));
        if let Place::Free {
            on_boundary: false, ..
        } = workspace.locate(p)
        {
            return p;
        }
    }
}

/// The grid point nearest to `p`.
#[must_use]
pub fn round(p: Point2<f64>) -> Point2<f64> {
    p.map(|c| (c * GRID).round() / GRID)
}

type Drawn = Option<(Vec<Polygon>, Vec<Polygon>)>;

/// Cells along a side of the paper's maps (`nngtl.md`, IV-D).
const CELLS: u32 = 200;

/// A rectangle of whole cells, so many wide and high, somewhere at least `edge` cells away from the map's end.
fn cells(
    wide: RangeInclusive<u32>,
    high: RangeInclusive<u32>,
    edge: u32,
    random: &mut Random,
) -> Option<Polygon> {
    let (w, h) = (random.random_range(wide), random.random_range(high));
    let x = random.random_range(edge..=CELLS - edge - w);
    let y = random.random_range(edge..=CELLS - edge - h);
    let corner = |x: u32, y: u32| {
        Point2::new(
            f64::from(x) / f64::from(CELLS),
            f64::from(y) / f64::from(CELLS),
        )
    };
    Polygon::rectangle(corner(x, y), corner(x + w, y + h)).ok()
}

/// Obstacles with as many regions as there may be, each drawn by `region`.
fn with_cells(
    obstacles: Vec<Polygon>,
    random: &mut Random,
    region: impl Fn(&mut Random) -> Option<Polygon>,
) -> Drawn {
    let mut regions: Vec<Polygon> = Vec::new();
    for _ in 0..MAX_REGIONS {
        let place = (0..PLACES).find_map(|_| {
            let polygon = region(random)?;
            is_clear(&polygon, obstacles.iter().chain(&regions)).then_some(polygon)
        });
        regions.push(place?);
    }
    Some((obstacles, regions))
}

fn paper(random: &mut Random) -> Drawn {
    let mut large = || cells(24..=90, 24..=90, 6, random);
    let obstacles = vec![large()?, large()?];
    with_cells(obstacles, random, |random| {
        cells(10..=26, 10..=26, 1, random)
    })
}

fn published(random: &mut Random) -> Drawn {
    let obstacles = vec![
        cells(60..=80, 20..=40, 0, random)?,
        cells(20..=40, 60..=80, 0, random)?,
    ];
    with_cells(obstacles, random, |random| cells(3..=3, 3..=3, 0, random))
}

fn clutter(random: &mut Random) -> Drawn {
    let obstacles = some_clutter(random.random_range(8..=26), random);
    let regions = draw_regions(&obstacles, random)?;
    Some((obstacles, regions))
}

fn some_clutter(count: u32, random: &mut Random) -> Vec<Polygon> {
    // Fewer obstacles are larger ones: the covered share stays alike.
    let size = 0.25 / f64::from(count).sqrt();
    (0..count)
        .filter_map(|_| {
            let centre = anywhere(random);
            obstacle_shape(centre, size * random.random_range(0.5..1.5), random)
        })
        .collect()
}

/// A uniform point of the unit square.
fn anywhere(random: &mut Random) -> Point2<f64> {
    Point2::new(random.random(), random.random())
}

fn with_rooms(random: &mut Random) -> Drawn {
    let mut obstacles = rooms::draw(random);
    if chance(random, 0.4) {
        for _ in 0..random.random_range(1..=5) {
            let centre = Point2::new(random.random(), random.random());
            obstacles.extend(obstacle_shape(
                centre,
                random.random_range(0.02..0.06),
                random,
            ));
        }
    }
    let regions = draw_regions(&obstacles, random)?;
    Some((obstacles, regions))
}

fn floor(random: &mut Random) -> Drawn {
    let thick = random.random_range(0.004..0.008);
    let mut obstacles = rooms::walls(6..=9, thick, random);
    let furniture = random.random_range(40..=120);
    obstacles.extend((0..furniture).filter_map(|_| {
        let centre = anywhere(random);
        let radius = random.random_range(0.005..0.015);
        clipped(shapes::turned_rectangle(centre, radius, random), 1e-5)
    }));
    let regions = place_regions(&obstacles, (0.012, 0.025), random, anywhere)?;
    Some((obstacles, regions))
}

fn maze(random: &mut Random) -> Drawn {
    let maze = Maze::draw(random);
    let reach = maze.reach - MARGIN;
    let sizes = (0.6 * reach, 1.3 * reach);
    let regions = place_regions(&maze.walls, sizes, random, |random| {
        let aside = |random: &mut Random| random.random_range(-0.3..0.3) * reach;
        let at = maze.place(random);
        Point2::new(at.x + aside(random), at.y + aside(random))
    })?;
    Some((maze.walls, regions))
}

fn blobs(random: &mut Random) -> Drawn {
    let obstacles = blobs::obstacles(random)?;
    let regions = draw_regions(&obstacles, random)?;
    Some((obstacles, regions))
}

/// Clutter with this many obstacles, and regions of these sizes.
fn sized(count: RangeInclusive<u32>, sizes: (f64, f64), random: &mut Random) -> Drawn {
    let obstacles = some_clutter(random.random_range(count), random);
    let regions = place_regions(&obstacles, sizes, random, anywhere)?;
    Some((obstacles, regions))
}

fn obstacle_shape(centre: Point2<f64>, radius: f64, random: &mut Random) -> Option<Polygon> {
    let points = match random.random_range(0..6) {
        0 | 1 => shapes::turned_rectangle(centre, radius, random),
        2 | 3 => shapes::convex(centre, radius, random),
        4 => shapes::jagged(centre, radius, random),
        _ => shapes::angle(centre, radius, random),
    };
    clipped(points, LEAST_AREA)
}

/// Regions of one map are alike small, alike large, or mixed.
fn draw_regions(obstacles: &[Polygon], random: &mut Random) -> Option<Vec<Polygon>> {
    let sizes = *choose(
        random,
        &[(0.025, 0.05), (0.03, 0.08), (0.03, 0.16), (0.08, 0.16)],
    )?;
    place_regions(obstacles, sizes, random, anywhere)
}

/// Four to seven regions with radii between these, where `place` says.
fn place_regions(
    obstacles: &[Polygon],
    sizes: (f64, f64),
    random: &mut Random,
    place: impl Fn(&mut Random) -> Point2<f64>,
) -> Option<Vec<Polygon>> {
    let count = random.random_range(4..=MAX_REGIONS);
    let mut regions: Vec<Polygon> = Vec::new();
    for _ in 0..count {
        let found = (0..PLACES).find_map(|_| {
            let centre = place(random);
            let polygon = region_shape(centre, random.random_range(sizes.0..sizes.1), random)?;
            is_clear(&polygon, obstacles.iter().chain(&regions)).then_some(polygon)
        });
        regions.push(found?);
    }
    Some(regions)
}

fn region_shape(centre: Point2<f64>, radius: f64, random: &mut Random) -> Option<Polygon> {
    let points = match random.random_range(0..8) {
        0..=2 => shapes::rectangle(centre, radius, random),
        3 => shapes::turned_rectangle(centre, radius, random),
        4 | 5 => shapes::convex(centre, radius, random),
        6 => shapes::jagged(centre, radius, random),
        _ => shapes::angle(centre, radius, random),
    };
    let inside = points.iter().all(|p| Bounds::unit().contains(*p));
    // No larger than what is asked of obstacles; small regions may be smaller.
    let least = LEAST_AREA.min(0.5 * radius * radius);
    inside.then(|| clipped(points, least)).flatten()
}

/// Rounds a shape to the grid, pulled into the unit square; `None` if nothing sound is left.
fn clipped(points: Vec<Point2<f64>>, least: f64) -> Option<Polygon> {
    let points = points.into_iter().map(|p| round(Bounds::unit().clip(p)));
    let polygon = Polygon::new(points.collect()).ok()?;
    (polygon.area() > least).then_some(polygon)
}

fn is_clear<'a>(polygon: &Polygon, mut others: impl Iterator<Item = &'a Polygon>) -> bool {
    others.all(|other| shapes::are_apart(polygon, other, MARGIN))
}

/// The unit vector in a direction, the same bits on every platform.
pub(super) fn direction(angle: f64) -> Vector2<f64> {
    Vector2::new(libm::cos(angle), libm::sin(angle))
}

/// A uniform angle.
pub(super) fn any_angle(random: &mut Random) -> f64 {
    random.random_range(0.0..TAU)
}
