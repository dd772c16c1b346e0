//! Transition systems: what a planner asks of the world that the robot moves in.
//!
//! The continuous workspace ([`Continuous`]) is one, the transfer paper's grid ([`Grid`]) another;
//! planners are written against the trait and know no geometry beyond points and lengths.

mod continuous;
mod grid;
mod ways;

use std::sync::Arc;

use nalgebra::Point2;

use crate::alphabet::{Alphabet, Letter, LetterSet};
use crate::number::hex;
use crate::random::Random;
use crate::workspace::{Bounds, Workspace};

pub use continuous::{Continuous, StartError};
pub use grid::{Grid, GridError, MAX_CELLS};
pub use ways::{MapLayout, Ways};

/// A place where the robot can be, with what it sees there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The place, in map units.
    pub at: Point2<f64>,
    /// The letter there.
    pub letter: Letter,
}

/// A fixed point inside one connected part of the space that carries a letter: a destination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// The place, in map units.
    pub at: Point2<f64>,
    /// The area of the part it stands for, in squared map units.
    pub area: f64,
}

/// The beginning of a shortest path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Where the path bends first; its end if it does not bend.
    pub to: Point2<f64>,
    /// The length of the whole path, in map units.
    pub length: f64,
}

/// A weighted transition system (`nngtl.md`, II-A): places, letters, moves and their costs.
///
/// Moves are reversible: `step(a, b)` equals `step(b, a)`, and so does their cost.
pub trait TransitionSystem: Send + Sync {
    /// The letters of the map.
    fn alphabet(&self) -> &Arc<Alphabet>;

    /// The extent of the map; radii and deviations of samplers are relative to its side.
    fn bounds(&self) -> Bounds;

    /// The place nearest to a drawn point where a waypoint can be put; `None` in an obstacle,
    /// out of bounds, or on a border where the letter is a matter of rounding.
    fn settle(&self, p: Point2<f64>) -> Option<Spot>;

    /// The cost of a move from `a` to `b`, were it possible.
    fn distance(&self, a: Point2<f64>, b: Point2<f64>) -> f64;

    /// Whether the robot can move straight from `a` to `b`.
    fn step(&self, a: &Spot, b: &Spot) -> bool;

    /// A point uniform over the free space.
    fn sample_free(&self, random: &mut Random) -> Point2<f64>;

    /// A point uniform over the part of the free space that carries `letter`.
    fn sample_letter(&self, letter: Letter, random: &mut Random) -> Point2<f64>;

    /// The letters of the places that can be reached from the start.
    fn reachable(&self) -> &LetterSet;

    /// The destinations for `letter` that can be reached from the start.
    fn landmarks(&self, letter: Letter) -> &[Landmark];

    /// How the shortest path to `to` that meets no obstacle begins; `None` if there is no path. With
    /// `keep`, what was found out about `to` is kept for later calls.
    fn first_leg(&self, from: Point2<f64>, to: Point2<f64>, keep: bool) -> Option<Leg>;

    /// How the shortest path to `to` begins that meets neither obstacles nor regions without a letter in `through`; `None`
    /// if there is no such path, or if one of its ends lies in such a region. What was found out about `to` is kept. Systems that
    /// cannot tell look for obstacles alone.
    fn first_leg_through(
        &self,
        from: Point2<f64>,
        to: Point2<f64>,
        through: &LetterSet,
    ) -> Option<Leg> {
        let _ = through;
        self.first_leg(from, to, true)
    }

    /// Calls `visit` with every point at which the shortest path from `from` to `to` that meets no obstacle
    /// bends, in order, and with `to`; not at all if there is no path. What is found out about `to` is
    /// kept for later calls. Systems that know the [first leg](Self::first_leg) only tell that.
    fn walk(&self, from: Point2<f64>, to: Point2<f64>, visit: &mut dyn FnMut(Point2<f64>)) {
        if let Some(next) = self.first_leg(from, to, true) {
            visit(next.to);
        }
    }

    /// Forgets what was found out about shortest ways. It would be found again; searches whose times are compared should
    /// not profit from each other.
    fn forget(&self) {}

    /// In a system of finitely many places: puts every place that one move from `from` leads to
    /// (staying left out) into `into` and returns `true`. `false` where places are infinitely many; then
    /// the cost of a move is its Euclidean length.
    fn neighbours(&self, _from: &Spot, _into: &mut Vec<Spot>) -> bool {
        false
    }

    /// Which of the [landmarks](Self::landmarks) of the spot's letter stands for the connected part
    /// that holds the spot; `None` if that part cannot be reached from the start.
    fn part(&self, spot: &Spot) -> Option<u32>;

    /// Whether a plan's word has one letter for each waypoint, waits included, so that formulas with
    /// next have a meaning. Otherwise the word is what is seen along continuous motion.
    fn reads_waypoints(&self) -> bool {
        false
    }

    /// The map, if every point of it is a place, moves are straight and their costs Euclidean: then
    /// plans can be [shortened](crate::shorten) on it.
    fn plane(&self) -> Option<&Workspace> {
        None
    }

    /// A hash of everything that decides which moves are possible and what is seen (hexadecimal
    /// SHA-256): bounds, obstacles, regions and their names, and the grid if there is one.
    fn fingerprint(&self) -> String;
}

/// Hashes a map's geometry, and the numbers of a grid over it.
fn fingerprint(map: &Workspace, grid: &[f64]) -> String {
    use sha2::Digest as _;
    let mut hash = sha2::Sha256::new();
    let mut number = |x: f64| hash.update(x.to_le_bytes());
    let bounds = map.bounds();
    for x in [bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y] {
        number(x);
    }
    number(grid.len() as f64);
    grid.iter().for_each(|&x| number(x));
    let polygons = map
        .obstacles()
        .iter()
        .map(|o| ("", o))
        .chain(map.regions().iter().map(|r| (r.name.as_str(), &r.polygon)));
    for (name, polygon) in polygons {
        hash.update((name.len() as u64).to_le_bytes());
        hash.update(name.as_bytes());
        hash.update((polygon.vertices().len() as u64).to_le_bytes());
        for v in polygon.vertices() {
            hash.update(v.x.to_le_bytes());
            hash.update(v.y.to_le_bytes());
        }
    }
    hex(&hash.finalize())
}
