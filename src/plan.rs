//! The result of planning, as it stands in `plan.json`.

mod file;

use std::collections::BTreeSet;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use crate::automaton::StateId;

pub use file::{
    Bound, First, MAX_PLAN_BYTES, PLAN_VERSION, PlanFile, PlanFileError, PlanPoint, PlanStats,
    StageSeconds, write_atomically,
};

/// A point of a plan and the automaton state the robot is in when it gets there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// The place, in map units.
    pub at: Point2<f64>,
    /// The automaton state on arrival.
    pub state: StateId,
}

/// Lengths of the parts of a plan, and their weighted sum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Length of the prefix, in map units.
    pub prefix: f64,
    /// Length of the suffix, in map units; 0 when the robot stays where the prefix ends.
    pub suffix: f64,
    /// `weight · prefix + (1 − weight) · suffix` (`nngtl.md`, II-C).
    pub total: f64,
}

impl Cost {
    /// Combines the lengths with the weight λ in `[0, 1]`.
    #[must_use]
    pub fn new(prefix: f64, suffix: f64, weight: f64) -> Self {
        Self {
            prefix,
            suffix,
            total: weight * prefix + (1.0 - weight) * suffix,
        }
    }
}

/// A prefix-suffix path: the prefix is walked once, the suffix for ever.
///
/// The prefix begins at the start; the suffix begins and ends at the prefix's last point, or is
/// that single point (the robot stays).
///
/// States are those of a run of the automaton. Where the loop begins before its state comes back
/// ([`mission::plan`](crate::mission::plan)), the suffix has those of the rounds in which it does.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// From the start to the point where the suffix begins; never empty.
    pub prefix: Vec<Waypoint>,
    /// From the prefix's last point back to it; one point if the robot stays; never empty.
    pub suffix: Vec<Waypoint>,
}

impl Path {
    /// The automaton states on it, prefix and suffix, ascending.
    #[must_use]
    pub fn states(&self) -> Vec<StateId> {
        let all = self.prefix.iter().chain(&self.suffix);
        let states: BTreeSet<StateId> = all.map(|w| w.state).collect();
        states.into_iter().collect()
    }
}

/// The length of a polyline through `points`, in map units.
#[must_use]
pub fn length(points: &[Waypoint]) -> f64 {
    // Summed from 0.0: the empty sum of floats is −0.0.
    points
        .windows(2)
        .map(|w| (w[1].at - w[0].at).norm())
        .fold(0.0, |sum, leg| sum + leg)
}
