//! A skill: a path that was learned once, from one place to another.

use nalgebra::Point2;

use crate::alphabet::{Alphabet, LetterSet};
use crate::system::{Spot, TransitionSystem};

/// Costs that differ by less than this share are rounding.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Why a path is no skill on a map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkillError {
    /// A path of fewer than two points.
    #[error("a path of {0} points: expected at least two")]
    Short(usize),
    /// A point where the robot cannot be.
    #[error("point {index} ({x}, {y}) is not free on this map")]
    NotFree {
        /// Its number, from 0.
        index: usize,
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
    },
    /// A point where another letter holds than when the path was learned.
    #[error(
        "at point {index} ({x}, {y}) the robot now sees {found}, the skill was learned with {expected}"
    )]
    Letter {
        /// Its number, from 0.
        index: usize,
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
        /// What the skill says.
        expected: String,
        /// What the map says.
        found: String,
    },
    /// A leg that cannot be moved along.
    #[error("the leg from point {index} ({x}, {y}) to the next is not possible on this map")]
    Blocked {
        /// The number of the point where it begins, from 0.
        index: usize,
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
    },
}

/// A path between two places, with what is asked of it when it is reused.
#[derive(Clone, Debug, PartialEq)]
pub struct Skill {
    /// The waypoints, both endpoints included; at least two.
    path: Vec<Spot>,
    /// The lengths of the legs.
    legs: Vec<f64>,
    cost: f64,
    letters: LetterSet,
}

impl Skill {
    /// Makes a skill of waypoints, and checks every one of them and every leg on the map.
    ///
    /// # Errors
    /// The first point that is not free or leg that is not possible.
    pub fn new(
        system: &dyn TransitionSystem,
        points: impl IntoIterator<Item = Point2<f64>>,
    ) -> Result<Self, SkillError> {
        let mut path: Vec<Spot> = Vec::new();
        for (index, p) in points.into_iter().enumerate() {
            let (x, y) = (p.x, p.y);
            let spot = system.settle(p);
            path.push(spot.ok_or(SkillError::NotFree { index, x, y })?);
        }
        path.dedup_by(|b, a| a.at == b.at);
        if path.len() < 2 {
            return Err(SkillError::Short(path.len()));
        }
        for (index, leg) in path.windows(2).enumerate() {
            if !system.step(&leg[0], &leg[1]) {
                let (x, y) = (leg[0].at.x, leg[0].at.y);
                return Err(SkillError::Blocked { index, x, y });
            }
        }
        Ok(Self::from_spots(system, path))
    }

    /// Makes a skill of waypoints and legs that are known to be possible.
    pub(crate) fn from_spots(system: &dyn TransitionSystem, path: Vec<Spot>) -> Self {
        let legs: Vec<f64> = path
            .windows(2)
            .map(|w| system.distance(w[0].at, w[1].at))
            .collect();
        let mut letters = system.alphabet().none();
        for spot in &path[1..path.len() - 1] {
            letters.insert(spot.letter);
        }
        Self {
            cost: legs.iter().sum(),
            path,
            legs,
            letters,
        }
    }

    /// The waypoints, both endpoints included.
    #[must_use]
    pub fn path(&self) -> &[Spot] {
        &self.path
    }

    /// The length of the path, in map units.
    #[must_use]
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// The letters of the waypoints between the endpoints: a self-loop that holds on all of them
    /// allows the skill.
    #[must_use]
    pub fn letters(&self) -> &LetterSet {
        &self.letters
    }

    /// Where it begins.
    #[must_use]
    pub fn first(&self) -> Spot {
        self.path[0]
    }

    /// Where it ends.
    #[must_use]
    pub fn last(&self) -> Spot {
        self.path[self.path.len() - 1]
    }

    /// The same path, walked from its end.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let mut skill = self.clone();
        skill.path.reverse();
        skill.legs.reverse();
        skill
    }

    /// The waypoint number `i` from the beginning, or from the end if `backward`.
    pub(crate) fn spot(&self, i: usize, backward: bool) -> Spot {
        match backward {
            false => self.path[i],
            true => self.path[self.path.len() - 1 - i],
        }
    }

    /// The length of leg number `i` from the beginning, or from the end if `backward`.
    pub(crate) fn leg(&self, i: usize, backward: bool) -> f64 {
        match backward {
            false => self.legs[i],
            true => self.legs[self.legs.len() - 1 - i],
        }
    }

    /// What is seen along the path, as the names of propositions.
    pub(crate) fn names(&self, alphabet: &Alphabet) -> Vec<Vec<String>> {
        let names = |spot: &Spot| {
            let held = alphabet.props(spot.letter);
            let name = |i: usize| alphabet.propositions()[i].clone();
            held.iter().map(name).collect()
        };
        self.path.iter().map(names).collect()
    }
}
