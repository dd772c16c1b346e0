//! An exact-search planner: a roadmap of the map's own corners, and Dijkstra's algorithm over its
//! product with the automaton.
//!
//! Shortest prefix-suffix paths bend at corners of obstacles, at corners of regions that they must
//! avoid, and where they touch the border of a region that they visit. The [`Roadmap`] holds such
//! points (the border points are sampled), joined by every free straight segment together with
//! the letters along it. A suffix may be entered anywhere on it, not only where the automaton accepts. The
//! search is optimal on the roadmap; [local refinement](crate::shorten) then slides the waypoints, the
//! entry among them, which removes most of what sampling the borders costs.
//!
//! The planner is deterministic and knows nothing of sampling-based planners, which never ask it:
//! it stands on its own, as the expert that labels training data and as a reference for costs.

mod around;
mod bound;
mod cycles;
mod halt;
mod mission;
mod roadmap;
mod search;
mod visits;
mod words;

use nalgebra::Point2;

use crate::automaton::{StateId, Task};
use crate::plan::{Cost, Path};
use crate::shorten::used_regions;
use crate::workspace::Workspace;

pub use bound::{Bounds, bounds_until, lower_bound, quick_bound};
pub use halt::Halt;
pub use roadmap::Roadmap;
pub use visits::least_cost;

/// What borders are resolved to lets a path cut corners by about so much, as a share of the map's
/// longer side; lower bounds are lowered by it.
const RESOLUTION: f64 = 1e-6;

/// Settings of the exact planner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactConfig {
    /// How far inside (or outside) a region its border points lie, as a share of the map's
    /// longer side, in (0, 0.01]. Before refinement every visit costs up to twice this much more than
    /// the infimum.
    pub inset: f64,
    /// The same after refinement; what is below a millionth counts as that.
    pub refined_inset: f64,
    /// The largest distance between neighbouring border points before refinement, as a share of
    /// the map's longer side.
    pub spacing: f64,
    /// How many accepting product states are tried as beginnings of a suffix that moves.
    pub suffix_searches: usize,
    /// How often refinement passes over all waypoints; 0 leaves the roadmap's path as it is.
    pub sweeps: usize,
}

impl Default for ExactConfig {
    fn default() -> Self {
        Self {
            inset: 5e-4,
            refined_inset: 0.0,
            spacing: 0.06,
            suffix_searches: 200,
            sweeps: 8,
        }
    }
}

/// A plan of the exact planner.
#[derive(Clone, Debug, PartialEq)]
pub struct ExactPlan {
    /// The prefix-suffix path.
    pub path: Path,
    /// Its cost.
    pub cost: Cost,
    /// The automaton states on the path, prefix and suffix, ascending.
    pub visited: Vec<StateId>,
}

impl ExactPlan {
    fn new(path: Path, cost: Cost) -> Self {
        let visited = path.states();
        Self {
            path,
            cost,
            visited,
        }
    }
}

/// Why the exact planner found no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Infeasible {
    /// The start is not free.
    #[error(
        "the start ({x}, {y}) is not in free space: move it out of obstacles and into the bounds"
    )]
    Start {
        /// The start's x coordinate.
        x: f64,
        /// The start's y coordinate.
        y: f64,
    },
    /// The automaton accepts no word over the map's letters.
    #[error("no sequence of the letters that occur on the map satisfies the task")]
    Unsatisfiable,
    /// No accepting state of the product can be reached.
    #[error(
        "the roadmap of the map's corners has no path from the start to an accepting state: another --sampler may find one"
    )]
    NoPrefix,
    /// Accepting states can be reached, but none again from itself.
    #[error(
        "no accepting state that the roadmap of the map's corners leads to lies on a loop there: another --sampler may find one"
    )]
    NoSuffix,
    /// A path was found, but no run of the automaton follows it waypoint by waypoint.
    #[error(
        "the automaton distinguishes words that differ by stuttering only, which a continuous path cannot follow: write the task without X"
    )]
    Stutter,
    /// The search was ended before it found a plan.
    #[error(
        "the exact search was ended before it found a plan: give it more time, or try another --sampler"
    )]
    Halted,
}

/// Plans with default settings, for one mission.
///
/// Missions that share a map should share a [`Roadmap`].
///
/// # Errors
/// See [`Infeasible`].
pub fn plan(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
) -> Result<ExactPlan, Infeasible> {
    plan_until(workspace, start, task, weight, Halt::NEVER)
}

/// Plans until the search is over or ended; then with the best plan so far.
///
/// # Errors
/// See [`Infeasible`].
pub fn plan_until(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    halt: Halt<'_>,
) -> Result<ExactPlan, Infeasible> {
    let used = used_regions(workspace, task);
    Roadmap::until(workspace, ExactConfig::default(), used, halt)?.plan(start, task, weight)
}
