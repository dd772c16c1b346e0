//! TL-RRT*: random trees over the product of a transition system and an automaton
//! (`nngtl.md`, III; X. Luo, Y. Kantaros, M. M. Zavlanos, "An abstraction-free method for
//! multirobot temporal logic optimal control synthesis").
//!
//! [`plan`] grows a prefix tree from the start and suffix trees from the goals it finds, and keeps
//! improving until its budget ends. It asks a [`Sampler`] where to look and knows neither networks
//! nor devices.

mod advice;
mod early;
mod informed;
mod parallel;
mod polish;
mod sampler;
mod search;
mod settings;
mod split;
mod suffix;
mod tree;

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::alphabet::{Letter, LetterSet};
use crate::automaton::{Distances, StateId, Task};
use crate::plan::{Cost, Path};
use crate::system::{Spot, TransitionSystem};

pub(crate) use sampler::{Aim, Draw, View};
pub use sampler::{Ask, Begin, Deferred, GuidanceError, Guide, HeadStart, HeatmapSums, Sampler};
pub use search::{plan, profile};
pub use settings::{Settings, SettingsError, Stop};
pub use split::Split;
pub(crate) use suffix::SuffixTree;
pub(crate) use tree::Near;
pub use tree::{NodeId, SiteId, Tree};

/// A mission ready for search.
#[derive(Clone)]
pub struct Problem {
    /// The world.
    pub system: Arc<dyn TransitionSystem>,
    /// The automaton and what samplers ask of it.
    pub task: Arc<Task>,
    /// Where the robot starts.
    pub start: Spot,
    /// λ in `[0, 1]`: the weight of the prefix in the cost (`nngtl.md`, II-C).
    pub weight: f64,
}

impl std::fmt::Debug for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Problem")
            .field("states", &self.task.nba.len())
            .field("start", &self.start)
            .field("weight", &self.weight)
            .finish_non_exhaustive()
    }
}

/// When something was first found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct First {
    /// Sampler calls until then, over all trees.
    pub iterations: u64,
    /// Product states in all trees at that moment.
    pub nodes: u64,
    /// Seconds since the search began.
    pub seconds: f64,
    /// Of a prefix its length, of a plan its total cost, in map units.
    pub cost: f64,
}

/// A cheaper plan was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Improvement {
    /// Sampler calls until then.
    pub iterations: u64,
    /// Seconds since the search began.
    pub seconds: f64,
    /// Total cost of the plan.
    pub cost: f64,
}

/// What a search did, whether or not it found a plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stats {
    /// Searches that ran side by side; all counts are over all of them together.
    #[serde(default = "one")]
    pub threads: u64,
    /// Sampler calls, over prefix and suffix trees together; failed samples count.
    pub iterations: u64,
    /// Samples that failed: no progress possible from the drawn node, nothing connects, only
    /// obstacles were drawn, or what no cheaper plan can visit.
    pub failed_samples: u64,
    /// Product states in all trees.
    pub nodes: u64,
    /// Places in all trees.
    pub sites: u64,
    /// Accepting product states in the prefix tree.
    pub goals: u64,
    /// Suffix trees that were grown.
    pub suffix_trees: u64,
    /// Seconds.
    pub seconds: f64,
    /// The first prefix (a path to an accepting state): what Table I of the paper counts.
    pub first_prefix: Option<First>,
    /// The first plan (prefix and suffix).
    pub first_plan: Option<First>,
    /// Each cheaper plan, in order.
    pub improvements: Vec<Improvement>,
}

fn one() -> u64 {
    1
}

impl Stats {
    /// Counts time from so many seconds before the search began.
    pub(crate) fn delay(&mut self, seconds: f64) {
        let firsts = [&mut self.first_prefix, &mut self.first_plan];
        firsts
            .into_iter()
            .flatten()
            .for_each(|first| first.seconds += seconds);
        self.improvements
            .iter_mut()
            .for_each(|i| i.seconds += seconds);
        self.seconds += seconds;
    }
}

/// A plan found by search.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The prefix-suffix path.
    pub path: Path,
    /// Its cost.
    pub cost: Cost,
    /// What the search did.
    pub stats: Stats,
    /// The edges of all trees, for pictures.
    pub edges: Vec<[nalgebra::Point2<f64>; 2]>,
}

/// The budget ended without a plan.
#[derive(Clone, Debug)]
pub struct NotFound {
    /// What the search did.
    pub stats: Stats,
    /// The least number of automaton steps that were left to an accepting state.
    pub steps_left: u32,
    /// How many states of the automaton the search was in, and how many there are.
    pub states: [usize; 2],
    /// The letters that would have brought it one step further, from the states it reached.
    pub missing: LetterSet,
    /// Why the search ended.
    pub reason: EndReason,
    /// The edges of all trees, for pictures.
    pub edges: Vec<[nalgebra::Point2<f64>; 2]>,
    /// What a user should know of devices and networks; whoever chose them for the search says it.
    pub notices: Vec<String>,
}

impl NotFound {
    /// How far the automaton got in a prefix tree, and which letters would have helped.
    pub(crate) fn after(
        task: &Task,
        own: impl Fn(StateId) -> StateId,
        prefix: &Tree<'_>,
        stats: Stats,
        reason: EndReason,
        edges: Vec<[nalgebra::Point2<f64>; 2]>,
    ) -> Self {
        let to_go = |q| {
            let steps = task.feasible.iter().map(|&f| task.distances.to_go(q, f));
            steps.min().unwrap_or(Distances::INFINITE)
        };
        let reached = |q: &StateId| !prefix.in_state(*q).is_empty();
        let steps_left = task.nba.states().filter(reached).map(to_go).min();
        let steps_left = steps_left.unwrap_or(Distances::INFINITE);
        let mut missing = task.nba.alphabet.none();
        for q in task.nba.states().filter(reached) {
            for t in task.nba.outgoing(q) {
                if to_go(q) == steps_left && to_go(t.target) < steps_left {
                    missing.union_with(&t.guard);
                }
            }
        }
        let count = |states: &mut dyn Iterator<Item = StateId>| {
            let own: BTreeSet<StateId> = states.map(&own).collect();
            own.len()
        };
        Self {
            stats,
            steps_left,
            states: [
                count(&mut task.nba.states().filter(reached)),
                count(&mut task.nba.states()),
            ],
            missing,
            reason,
            edges,
            notices: Vec::new(),
        }
    }
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndReason {
    /// The first plan was found and that was all that was asked.
    First,
    /// The iterations are used up.
    Iterations,
    /// The time is used up.
    Time,
    /// [`Stop`] was raised.
    Stopped,
}

/// Why a search could not begin or found nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A setting is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// λ is not in `[0, 1]`.
    #[error("the weight is {0}: expected a number in [0, 1]")]
    Weight(f64),
    /// The automaton speaks of other letters than the map.
    #[error(
        "the automaton was made for other letters than this map's: translate the formula for this map"
    )]
    Alphabet,
    /// The mission cannot be fulfilled from this start.
    #[error("no plan exists: {0}")]
    Unreachable(String),
    /// The budget ended first.
    #[error("no plan found")]
    NotFound(Box<NotFound>),
}

/// How far a running search is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Sampler calls so far.
    pub iterations: u64,
    /// Product states so far.
    pub nodes: u64,
    /// The cost of the best plan so far.
    pub cost: Option<f64>,
}

/// For each letter and automaton state: whether a robot that stays where it sees the letter
/// keeps the automaton accepting for ever (a trivial suffix, `semantics`: staying).
pub(crate) fn staying_accepts(task: &Task) -> Vec<Vec<bool>> {
    let nba = &task.nba;
    let accepts = |letter: Letter, state| {
        let mut seen = vec![false; nba.len()];
        let mut open = vec![state];
        while let Some(q) = open.pop() {
            for next in nba.successors(q, letter) {
                if next == state {
                    return true;
                }
                if !std::mem::replace(&mut seen[next.index()], true) {
                    open.push(next);
                }
            }
        }
        false
    };
    let row = |letter| {
        nba.states()
            .map(|q| nba.is_accepting(q) && accepts(letter, q))
            .collect()
    };
    nba.alphabet.letters().map(row).collect()
}

#[cfg(test)]
mod tests;
