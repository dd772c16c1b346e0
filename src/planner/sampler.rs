//! Where to look next: the strategies that propose points for a tree to grow to.

mod biased;
mod choices;
mod closing;
mod crossing;
mod deferred;
mod entrance;
mod guided;
mod heat;
pub(crate) mod leads;
mod nearest;
mod passage;
mod sweep;

use std::sync::Arc;

use nalgebra::Point2;

use super::settings::Settings;
use super::tree::{NodeId, Tree};
use crate::automaton::{StateId, Task};
use crate::guidance::Guidance;
use crate::random::Random;
use crate::system::TransitionSystem;

use closing::Closing;
pub(super) use deferred::Ahead;
pub use deferred::{Ask, Begin, Deferred, HeadStart};
pub use heat::{GuidanceError, HeatmapSums};

/// Which strategy proposes points.
#[derive(Clone, Debug)]
pub enum Sampler {
    /// Uniform over the free space (`nngtl.md`, III-B).
    Uniform,
    /// Towards what the automaton needs next (S-1 to S-6).
    Biased,
    /// By the rules of guided sampling alone, without predictions (ours).
    Directed,
    /// As the networks predict (C-1, C-2).
    Guided(Arc<Guide>),
    /// [`Directed`](Self::Directed) until the networks have answered, then [`Guided`](Self::Guided).
    Deferred(Arc<Deferred>),
}

/// Predictions prepared for fast drawing.
#[derive(Clone, Debug)]
pub struct Guide {
    /// None where only the states are predicted.
    sums: Option<Arc<HeatmapSums>>,
    states: Vec<f64>,
}

impl Guide {
    /// Prepares predictions for an automaton of `states` states.
    ///
    /// # Errors
    /// Predictions of the wrong size, or values that are not finite.
    pub fn new(guidance: &Guidance, states: usize) -> Result<Self, GuidanceError> {
        let mut guide = Self::of_states(&guidance.states, states)?;
        guide.sums = Some(Arc::new(HeatmapSums::new(&guidance.heatmap)?));
        Ok(guide)
    }

    /// As [`Self::new`] without a heatmap: points are drawn as [`Sampler::Directed`] draws them.
    ///
    /// # Errors
    /// Not one probability for each state.
    pub fn of_states(probabilities: &[f32], states: usize) -> Result<Self, GuidanceError> {
        if probabilities.len() != states {
            return Err(GuidanceError::States {
                expected: states,
                found: probabilities.len(),
            });
        }
        // 16 bits: what differs between devices in the last bits must not change a plan.
        let quantise = |p: &f32| f64::from((p.clamp(0.0, 1.0) * 65_535.0).round()) / 65_535.0;
        Ok(Self {
            sums: None,
            states: probabilities.iter().map(quantise).collect(),
        })
    }

    /// For an automaton whose states stand for these.
    fn for_states(&self, origin: &[StateId]) -> Self {
        Self {
            sums: self.sums.clone(),
            states: origin.iter().map(|q| self.states[q.index()]).collect(),
        }
    }
}

impl Sampler {
    /// The strategy's name, as on the command line.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Biased => "biased",
            Self::Directed => "directed",
            Self::Guided(_) => "guided",
            Self::Deferred(_) => "deferred",
        }
    }

    /// The same strategy for an automaton whose states stand for these.
    pub(super) fn for_states(&self, origin: &[StateId]) -> Self {
        match self {
            Self::Guided(guide) => Self::Guided(Arc::new(guide.for_states(origin))),
            other => other.clone(),
        }
    }

    /// Proposes a point; `None` is a failed sample, which counts as an iteration.
    pub(crate) fn draw(&self, view: &View<'_>, random: &mut Random) -> Option<Draw> {
        match self {
            Self::Uniform => Some(uniform(view, random)),
            Self::Biased => biased::draw(view, random),
            Self::Directed | Self::Deferred(_) => guided::draw(None, view, random),
            Self::Guided(guide) => guided::draw(Some(guide), view, random),
        }
    }
}

/// A proposed point, and the node that it was proposed from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draw {
    pub(crate) at: Point2<f64>,
    pub(crate) closest: Option<NodeId>,
}

/// What a sampler may know of the search.
pub(crate) struct View<'a> {
    pub(crate) system: &'a dyn TransitionSystem,
    pub(crate) task: &'a Task,
    pub(crate) settings: &'a Settings,
    pub(crate) tree: &'a Tree<'a>,
    pub(crate) aim: Aim,
}

/// What the tree is grown for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aim {
    /// Reach accepting states; once some are known, improve the ways there.
    Prefix {
        /// Whether any goal is known.
        reached: bool,
    },
    /// Return to the root in this state.
    Suffix {
        /// The root's automaton state.
        state: StateId,
        /// Whether any way back is known.
        closed: bool,
    },
    /// Reach a place in this state: a segment of a plan that is repaired.
    Reach {
        /// The place.
        at: Point2<f64>,
        /// The automaton state there.
        state: StateId,
    },
}

impl View<'_> {
    /// The steps that the automaton is from the accepting state `goal`: ρ, but in a suffix those of a cycle from its
    /// root, and the last one beside it where the automaton cannot wait for the robot.
    fn to_go(&self, node: NodeId, goal: StateId) -> u32 {
        let state = self.tree.state(node);
        if self.tree.is_at_root(node) && matches!(self.aim, Aim::Suffix { .. }) {
            self.around(state, goal)
        } else {
            self.left(state, goal)
        }
    }

    /// As [`Self::to_go`] for places other than the root.
    fn left(&self, state: StateId, goal: StateId) -> u32 {
        if state == goal && self.waits(goal) {
            0
        } else {
            self.around(state, goal)
        }
    }

    /// As [`Self::left`], but those of a whole cycle from the goal itself.
    fn around(&self, state: StateId, goal: StateId) -> u32 {
        match self.closing() {
            Some(closing) => closing.steps(state),
            None => self.task.distances.get(state, goal),
        }
    }

    /// The probability of a rule whose share is that, 0 where it is not wanted: 1 as long as the tree follows the rules alone.
    fn share(&self, share: f64) -> f64 {
        if share > 0.0 && self.tree.leads().borrow().is_alone() {
            1.0
        } else {
            share
        }
    }

    /// Whether some way is known, and cheaper ones are looked for.
    fn is_improving(&self) -> bool {
        match self.aim {
            Aim::Prefix { reached } => reached,
            Aim::Suffix { closed, .. } => closed,
            Aim::Reach { .. } => false,
        }
    }

    /// What closes the cycle, if that takes more than ρ tells.
    fn closing(&self) -> Option<Arc<Closing>> {
        match self.aim {
            Aim::Suffix { state, .. } => self.tree.leads().borrow_mut().closing(self, state),
            _ => None,
        }
    }

    /// Whether the automaton's part is done at the accepting state `goal`, wherever the robot is: it looks for no way
    /// to an end, or the automaton can wait there on some letter.
    fn waits(&self, goal: StateId) -> bool {
        matches!(self.aim, Aim::Prefix { .. }) || self.task.nba.guard(goal, goal).is_some()
    }
}

/// A uniform point, with the nearest node's site as an additional neighbour left to the tree.
fn uniform(view: &View<'_>, random: &mut Random) -> Draw {
    let mut kept = view.tree.leads().borrow_mut();
    Draw {
        at: kept.sweep.next(view, random),
        closest: None,
    }
}

#[cfg(test)]
mod tests;
