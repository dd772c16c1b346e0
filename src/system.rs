//! Transition systems: what a planner asks of the world that the robot moves in.
//!
//! The continuous workspace ([`Continuous`]) is one; planners are written against the trait and
//! know no geometry beyond points and lengths.

mod continuous;

use std::sync::Arc;

use nalgebra::Point2;

use crate::alphabet::{Alphabet, Letter};
use crate::random::Random;
use crate::workspace::Bounds;

pub use continuous::{Continuous, StartError};

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

    /// The destinations for `letter` that can be reached from the start.
    fn landmarks(&self, letter: Letter) -> &[Landmark];

    /// The first point after `from` on the shortest path to `to` that meets no obstacle; `None`
    /// if there is no path. With `keep`, what was found out about `to` is kept for later calls.
    fn first_leg(&self, from: Point2<f64>, to: Point2<f64>, keep: bool) -> Option<Point2<f64>>;
}
