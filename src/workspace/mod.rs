//! The continuous workspace: bounds, obstacles, named regions, and what may be crossed.
//!
//! Obstacles and regions are *open* sets: touching a border is allowed, and a point within the
//! [tolerance](Workspace::tolerance) of a region's border is outside that region. The robot is a
//! point. Obstacles may overlap, regions too; where obstacles share a border with each other or with
//! the bounds there is no gap between them. Nor is there one between a region and what it shares a border with: who moves along
//! a wall that a region touches is in that region, and between two regions in one of them.

mod bands;
mod cells;
mod distance;
mod geodesics;
mod index;
mod lines;
mod mesh;
pub(crate) mod parts;
mod polygon;
mod trace;
pub mod visibility;
mod walls;

use std::sync::Arc;

use nalgebra::Point2;
use smallvec::SmallVec;

use crate::alphabet::{Alphabet, AlphabetError, Letter, Props};
use crate::number::Brief;
use crate::random::Random;
use index::PolygonIndex;

pub use cells::Cell;
pub(crate) use distance::{Segment, segment_distance};
pub(crate) use polygon::segments_meet;
pub use polygon::{Polygon, PolygonError, Side};
pub use trace::{Blocked, Stretch};
pub use walls::Enclosure;

/// Coordinates beyond this magnitude are refused: tolerances would lose their meaning.
pub const MAX_COORDINATE: f64 = 1e9;

/// The axis-parallel rectangle that the robot moves in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The corner with the lowest coordinates.
    pub min: Point2<f64>,
    /// The corner with the highest coordinates.
    pub max: Point2<f64>,
}

impl Bounds {
    /// The unit square, where the papers' maps live.
    #[must_use]
    pub fn unit() -> Self {
        Self {
            min: Point2::new(0.0, 0.0),
            max: Point2::new(1.0, 1.0),
        }
    }

    /// Whether they share more than border points with the rectangle that has these corners.
    #[must_use]
    pub fn meet(&self, min: Point2<f64>, max: Point2<f64>) -> bool {
        min.x < self.max.x && max.x > self.min.x && min.y < self.max.y && max.y > self.min.y
    }

    /// The extent along x, in map units.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// The extent along y, in map units.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// The longer of width and height: the "side" that radii and deviations are relative to.
    #[must_use]
    pub fn side(&self) -> f64 {
        self.width().max(self.height())
    }

    /// Whether `p` lies in the closed rectangle.
    #[must_use]
    pub fn contains(&self, p: Point2<f64>) -> bool {
        p.x >= self.min.x && p.y >= self.min.y && p.x <= self.max.x && p.y <= self.max.y
    }

    /// The point of the rectangle nearest to `p`.
    #[must_use]
    pub fn clip(&self, p: Point2<f64>) -> Point2<f64> {
        Point2::new(
            p.x.clamp(self.min.x, self.max.x),
            p.y.clamp(self.min.y, self.max.y),
        )
    }
}

/// A named part of the map; its name is a proposition of formulas.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The proposition that holds inside.
    pub name: String,
    /// Its extent.
    pub polygon: Polygon,
}

/// What is at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Beyond the bounds.
    Outside,
    /// In the interior of the obstacle with this number.
    Obstacle(usize),
    /// Where the robot may be.
    Free {
        /// The regions that contain the point.
        letter: Letter,
        /// Whether a region's border runs within the tolerance. Planners put no waypoint there,
        /// since the slightest deviation would change the letter.
        on_boundary: bool,
    },
}

impl Place {
    /// The letter there; `None` where the robot cannot be.
    #[must_use]
    pub fn letter(self) -> Option<Letter> {
        match self {
            Self::Free { letter, .. } => Some(letter),
            Self::Outside | Self::Obstacle(_) => None,
        }
    }
}

/// Why a workspace could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorkspaceError {
    /// The bounds are empty, inverted, not finite or beyond [`MAX_COORDINATE`].
    #[error(
        "bounds [{}, {}] to [{}, {}] are not a rectangle to plan in: give the lower-left corner first, finite, each side longer than 0 and than a millionth of the other, coordinates within ±{MAX_COORDINATE:e}", Brief(*min_x), Brief(*min_y), Brief(*max_x), Brief(*max_y)
    )]
    BadBounds {
        /// Lowest x.
        min_x: f64,
        /// Lowest y.
        min_y: f64,
        /// Highest x.
        max_x: f64,
        /// Highest y.
        max_y: f64,
    },
    /// Region names clash or there are too many.
    #[error(transparent)]
    Regions(#[from] AlphabetError),
    /// Obstacles cover everything.
    #[error("obstacles cover the whole workspace: there is nowhere to be")]
    NoFreeSpace,
}

/// A map: bounds, obstacles, regions, with what planning asks of them.
#[derive(Clone, Debug)]
pub struct Workspace {
    bounds: Bounds,
    obstacles: Vec<Polygon>,
    /// What obstacles are called; those beyond the end by their numbers.
    obstacle_names: Vec<String>,
    regions: Vec<Region>,
    alphabet: Arc<Alphabet>,
    tolerance: f64,
    obstacle_index: PolygonIndex,
    region_index: PolygonIndex,
    /// For each letter, the connected parts of the free space that carry it.
    cells: Vec<Vec<Cell>>,
    /// All of them with their letters, and the running sums of their areas.
    parts: Vec<(Letter, u32)>,
    areas: Vec<f64>,
}

impl Workspace {
    /// Makes a workspace. Parts of obstacles and regions beyond the bounds are ignored.
    ///
    /// # Errors
    /// Bad bounds, clashing region names, more than 64 regions, or no free space.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use nngtl::workspace::{Bounds, Place, Polygon, Region, Workspace};
    /// let dock = Polygon::rectangle(Point2::new(0.1, 0.1), Point2::new(0.3, 0.3))?;
    /// let regions = vec![Region { name: "dock".into(), polygon: dock }];
    /// let map = Workspace::new(Bounds::unit(), vec![], regions)?;
    /// let letter = map.letter_at(Point2::new(0.2, 0.2)).unwrap();
    /// assert_eq!(map.alphabet().show(letter), "{dock}");
    /// assert_eq!(map.locate(Point2::new(2.0, 0.2)), Place::Outside);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(
        bounds: Bounds,
        obstacles: Vec<Polygon>,
        regions: Vec<Region>,
    ) -> Result<Self, WorkspaceError> {
        check_bounds(&bounds)?;
        let names: Vec<String> = regions.iter().map(|r| r.name.clone()).collect();
        Alphabet::disjoint(names.clone())?; // names and their number, before any geometry
        let magnitude = [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y]
            .iter()
            .fold(0.0_f64, |m, c| m.max(c.abs()));
        // A billionth of the map, but never below what coordinates of this size can resolve.
        let tolerance = (1e-9 * bounds.side()).max(64.0 * f64::EPSILON * magnitude);
        let parts = cells::decompose(&bounds, &obstacles, &regions);
        if parts.is_empty() {
            return Err(WorkspaceError::NoFreeSpace);
        }
        let alphabet = Arc::new(Alphabet::new(names, parts.iter().map(|&(props, _)| props))?);
        let mut cells = vec![Vec::new(); alphabet.len()];
        let mut workspace = Self {
            // Walls are looked up by points that snapping may have moved a little.
            obstacle_index: PolygonIndex::new(obstacles.iter(), 4.0 * tolerance),
            region_index: PolygonIndex::new(regions.iter().map(|r| &r.polygon), tolerance),
            cells: Vec::new(),
            parts: Vec::new(),
            areas: Vec::new(),
            bounds,
            obstacles,
            obstacle_names: Vec::new(),
            regions,
            alphabet,
            tolerance,
        };
        for (props, part) in parts {
            if let Some(letter) = workspace.alphabet.letter(props) {
                let inner = workspace.inner_point(letter, &part);
                cells[letter.index()].push(Cell::new(part, inner));
            }
        }
        let mut sum = 0.0;
        for letter in workspace.alphabet.letters() {
            for (i, cell) in cells[letter.index()].iter().enumerate() {
                sum += cell.area();
                workspace.parts.push((letter, i as u32));
                workspace.areas.push(sum);
            }
        }
        workspace.cells = cells;
        Ok(workspace)
    }

    /// The same map with more obstacles and without regions, for shortest ways alone: it knows no cells, so that nothing can be
    /// drawn from it.
    #[must_use]
    pub(crate) fn barred(&self, more: impl IntoIterator<Item = Polygon>) -> Self {
        let mut obstacles = self.obstacles.clone();
        obstacles.extend(more);
        Self {
            obstacle_index: PolygonIndex::new(obstacles.iter(), 4.0 * self.tolerance),
            region_index: PolygonIndex::new(std::iter::empty(), self.tolerance),
            cells: vec![Vec::new(); self.alphabet.len()],
            parts: Vec::new(),
            areas: Vec::new(),
            bounds: self.bounds,
            obstacles,
            obstacle_names: Vec::new(),
            regions: Vec::new(),
            alphabet: Arc::clone(&self.alphabet),
            tolerance: self.tolerance,
        }
    }

    /// The rectangle that the robot moves in.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The obstacles, as given.
    #[must_use]
    pub fn obstacles(&self) -> &[Polygon] {
        &self.obstacles
    }

    /// Names obstacles, in their order, for messages; they need not differ. Those without a name
    /// go by their number.
    #[must_use]
    pub fn with_obstacle_names(mut self, names: Vec<String>) -> Self {
        self.obstacle_names = names;
        self
    }

    /// What messages call an obstacle: its name, or its number counted from 1.
    #[must_use]
    pub fn obstacle_name(&self, i: usize) -> String {
        match self.obstacle_names.get(i) {
            Some(name) if !name.is_empty() => name.clone(),
            _ => format!("obstacle {}", i + 1),
        }
    }

    /// The regions, as given.
    #[must_use]
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// The region names as propositions, and the sets of them that occur together.
    #[must_use]
    pub fn alphabet(&self) -> &Arc<Alphabet> {
        &self.alphabet
    }

    /// The width, in map units, to which borders are resolved.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// The connected parts of the free space that carry `letter`; never empty.
    #[must_use]
    pub fn cells(&self, letter: Letter) -> &[Cell] {
        &self.cells[letter.index()]
    }

    /// Where exactly the regions of `wanted` sets hold, whether or not obstacles are there: polygons that share borders
    /// at most.
    pub(crate) fn area_of(&self, wanted: impl Fn(Props) -> bool) -> Vec<Polygon> {
        cells::area_of(&self.bounds, &self.regions, wanted)
    }

    /// The names of regions of which no part is free: obstacles cover them, or they lie beyond
    /// the bounds. A robot can never be there.
    #[must_use]
    pub fn hidden_regions(&self) -> Vec<&str> {
        let visible = |i: usize| !self.alphabet.letters_with(i).is_empty();
        self.regions
            .iter()
            .enumerate()
            .filter(|&(i, _)| !visible(i))
            .map(|(_, r)| r.name.as_str())
            .collect()
    }

    /// The pairs of regions, by number, that hold together somewhere.
    #[must_use]
    pub fn overlapping_regions(&self) -> Vec<(usize, usize)> {
        let mut pairs: Vec<(usize, usize)> = self
            .alphabet
            .letters()
            .flat_map(|letter| {
                let props = self.alphabet.props(letter);
                props
                    .iter()
                    .flat_map(move |i| props.iter().filter(move |&j| j > i).map(move |j| (i, j)))
            })
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// What is at `p`.
    #[must_use]
    pub fn locate(&self, p: Point2<f64>) -> Place {
        if !(p.x.is_finite() && p.y.is_finite() && self.bounds.contains(p)) {
            return Place::Outside;
        }
        if let Some(obstacle) = self.obstacle_at(p) {
            return Place::Obstacle(obstacle);
        }
        let mut props = Props::EMPTY;
        let mut borders: SmallVec<[usize; 4]> = SmallVec::new();
        for i in self.region_index.polygons_near(p) {
            match self.region_side(i, p) {
                Side::Inside => props = props.with(i),
                Side::Boundary => borders.push(i),
                Side::Outside => {}
            }
        }
        let on_boundary = !borders.is_empty();
        // Alone, a border has space of the other side along it, unless that is solid.
        if borders.len() > 1 || on_boundary && self.is_beside_solid(p) {
            props = self.props_around(p, props);
        }
        match self.alphabet.letter(props) {
            Some(letter) => Place::Free {
                letter,
                on_boundary,
            },
            // A sliver between borders, too thin to be a cell: what it is part of does not
            // matter, nobody can stand there.
            None => Place::Free {
                letter: Letter(0),
                on_boundary: true,
            },
        }
    }

    /// The letter at `p`; `None` where the robot cannot be.
    #[must_use]
    pub fn letter_at(&self, p: Point2<f64>) -> Option<Letter> {
        self.locate(p).letter()
    }

    /// The lowest-numbered obstacle whose interior contains `p`, or, where several obstacles meet and
    /// leave nothing free around `p`, that touches it.
    fn obstacle_at(&self, p: Point2<f64>) -> Option<usize> {
        let (inside, touching) = self.obstacles_at(p);
        if inside.is_some() || touching.is_empty() {
            return inside;
        }
        // Alone, a border has free space along it, unless it is that of the map.
        if touching.len() == 1 && self.is_within(p, self.beside()) {
            return None;
        }
        let solid = |p: Point2<f64>| {
            if !self.bounds.contains(p) {
                return true;
            }
            let (inside, touching) = self.obstacles_at(p);
            inside.is_some() || touching.len() > 1
        };
        let mut around = self.around(p);
        around.all(solid).then(|| touching.iter().min().copied())?
    }

    /// How far from a border is beside it and no longer on it.
    fn beside(&self) -> f64 {
        8.0 * self.tolerance
    }

    /// Points around `p`, just off the borders that it lies on.
    fn around(&self, p: Point2<f64>) -> impl Iterator<Item = Point2<f64>> + use<> {
        let reach = self.beside();
        (0..48).map(move |k| {
            let angle = (f64::from(k) + 0.5) * std::f64::consts::TAU / 48.0;
            p + nalgebra::Vector2::new(libm::cos(angle), libm::sin(angle)) * reach
        })
    }

    /// Whether an obstacle or the end of the map touches `p`.
    fn is_beside_solid(&self, p: Point2<f64>) -> bool {
        !self.is_within(p, self.beside()) || self.is_on_obstacle(p, self.tolerance)
    }

    /// What the robot sees at a free place `p` on borders of regions: what it would see somewhere beside it, the least of that:
    /// `props`, which hold off the borders, if it may.
    fn props_around(&self, p: Point2<f64>, props: Props) -> Props {
        let mut least: Option<Props> = None;
        for at in self.around(p) {
            let Some(there) = self.props_off_borders(at) else {
                continue;
            };
            if there == props {
                return props;
            }
            let rank = |props: Props| (props.iter().count(), props.0);
            if least.is_none_or(|l| rank(there) < rank(l)) {
                least = Some(there);
            }
        }
        least.unwrap_or(props)
    }

    /// The regions that hold a place; `None` where it is not free, or on a border.
    fn props_off_borders(&self, p: Point2<f64>) -> Option<Props> {
        if !self.bounds.contains(p) {
            return None;
        }
        let (inside, touching) = self.obstacles_at(p);
        if inside.is_some() || !touching.is_empty() {
            return None;
        }
        let mut props = Props::EMPTY;
        for i in self.region_index.polygons_near(p) {
            match self.region_side(i, p) {
                Side::Inside => props = props.with(i),
                Side::Boundary => return None,
                Side::Outside => {}
            }
        }
        Some(props)
    }

    /// The first obstacle that holds `p`, and those whose borders run there.
    fn obstacles_at(&self, p: Point2<f64>) -> (Option<usize>, SmallVec<[usize; 4]>) {
        let (mut inside, mut touching) = (None, SmallVec::new());
        for i in self.obstacle_index.polygons_near(p) {
            match self.obstacle_side(i, p) {
                Side::Inside => inside = Some(inside.map_or(i, |j: usize| j.min(i))),
                Side::Boundary => touching.push(i),
                Side::Outside => {}
            }
        }
        (inside, touching)
    }

    /// Whether `p` lies within the bounds, further than `margin` from their edges.
    fn is_within(&self, p: Point2<f64>, margin: f64) -> bool {
        p.x > self.bounds.min.x + margin
            && p.y > self.bounds.min.y + margin
            && p.x < self.bounds.max.x - margin
            && p.y < self.bounds.max.y - margin
    }

    /// Where `p` lies with respect to an obstacle.
    fn obstacle_side(&self, i: usize, p: Point2<f64>) -> Side {
        let index = &self.obstacle_index;
        index.side_of(i, &self.obstacles[i], p, self.tolerance)
    }

    /// Where `p` lies with respect to a region.
    fn region_side(&self, i: usize, p: Point2<f64>) -> Side {
        let index = &self.region_index;
        index.side_of(i, &self.regions[i].polygon, p, self.tolerance)
    }

    /// Whether `p` lies in an obstacle or within `tolerance` (at most the map's) of one.
    fn is_on_obstacle(&self, p: Point2<f64>, tolerance: f64) -> bool {
        let index = &self.obstacle_index;
        index
            .polygons_near(p)
            .into_iter()
            .any(|i| index.side_of(i, &self.obstacles[i], p, tolerance) != Side::Outside)
    }

    /// A point uniform over the free space.
    pub fn sample_free(&self, random: &mut Random) -> Point2<f64> {
        let all = self.areas.last().copied().unwrap_or(0.0);
        let goal = crate::random::unit(random) * all;
        let pick = self.areas.partition_point(|&a| a <= goal);
        let (letter, i) = self.parts[pick.min(self.parts.len() - 1)];
        self.sample_cell(letter, &self.cells(letter)[i as usize], random)
    }

    /// A point uniform over the part of the free space that carries `letter`.
    pub fn sample_letter(&self, letter: Letter, random: &mut Random) -> Point2<f64> {
        let cells = self.cells(letter);
        let pick = crate::random::weighted(random, cells.iter().map(Cell::area)).unwrap_or(0);
        self.sample_cell(letter, &cells[pick], random)
    }

    fn sample_cell(&self, letter: Letter, cell: &Cell, random: &mut Random) -> Point2<f64> {
        // Triangulation rounds: points on a border are drawn again, and a cell thinner than the
        // rounding falls back to its inner point.
        for _ in 0..32 {
            let p = cell.sample(random);
            let there = Place::Free {
                letter,
                on_boundary: false,
            };
            if self.locate(p) == there {
                return p;
            }
        }
        cell.inner_point()
    }

    /// A point of `part` that carries `letter` away from borders: its centroid where that is
    /// inside, otherwise one that the geometry library picks.
    fn inner_point(&self, letter: Letter, part: &geo::Polygon<f64>) -> Point2<f64> {
        let there = Place::Free {
            letter,
            on_boundary: false,
        };
        let candidates = cells::inner_points(part);
        let good = candidates
            .iter()
            .copied()
            .find(|&p| self.locate(p) == there);
        good.or(candidates.first().copied())
            .unwrap_or_else(|| nalgebra::center(&self.bounds.min, &self.bounds.max))
    }
}

fn check_bounds(bounds: &Bounds) -> Result<(), WorkspaceError> {
    let corners = [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y];
    let fine = corners.iter().all(|c| c.abs() <= MAX_COORDINATE)
        && bounds.width() > 1e-6 * bounds.side()
        && bounds.height() > 1e-6 * bounds.side();
    if fine {
        return Ok(());
    }
    let [min_x, min_y, max_x, max_y] = corners;
    Err(WorkspaceError::BadBounds {
        min_x,
        min_y,
        max_x,
        max_y,
    })
}

#[cfg(test)]
mod tests;
