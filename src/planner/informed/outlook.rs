//! What is known of the place that a tree is growing to.

use std::sync::Arc;

use nalgebra::Point2;

use super::Informed;
use crate::automaton::StateId;

/// What is left from a place at least, in each automaton state. Uninformed, nothing.
#[derive(Clone, Debug)]
pub(in crate::planner) struct Outlook {
    informed: Option<Arc<Informed>>,
    /// The place that was looked at last, and the length from which on ways were not wanted.
    seen: Option<(Point2<f64>, f64)>,
    /// For each state what is left from there; infinite where no way that is short enough can lead.
    left: Vec<f64>,
    /// The least of it.
    least: f64,
    // Buffers: how far the letters are, and the lengths of ways to the place; the letters from another place.
    far: Vec<f64>,
    coming: Vec<f64>,
    elsewhere: (Option<Point2<f64>>, Vec<f64>),
}

impl Outlook {
    /// Of an automaton of so many states.
    pub(in crate::planner) fn new(states: usize) -> Self {
        Self {
            informed: None,
            seen: None,
            left: vec![0.0; states],
            least: 0.0,
            far: Vec::new(),
            coming: vec![0.0; states],
            elsewhere: (None, Vec::new()),
        }
    }

    pub(in crate::planner) fn inform(&mut self, informed: Informed) {
        self.informed = Some(Arc::new(informed));
    }

    pub(in crate::planner) fn is_informed(&self) -> bool {
        self.informed.is_some()
    }

    /// Looks at a place: whether a way that is shorter than `limit` can lead over it, in any state.
    pub(in crate::planner) fn look(&mut self, p: Point2<f64>, limit: f64) -> bool {
        let Some(informed) = &self.informed else {
            return true;
        };
        if self.seen != Some((p, limit)) {
            self.seen = Some((p, limit));
            informed.relaxed.far(p, &mut self.far);
            informed.going.from(p, &self.far, &mut self.left);
            informed.coming.from(p, &self.far, &mut self.coming);
            self.least = f64::INFINITY;
            for (left, coming) in self.left.iter_mut().zip(&self.coming) {
                if *left + coming >= limit {
                    *left = f64::INFINITY;
                }
                self.least = self.least.min(*left);
            }
        }
        self.least < f64::INFINITY
    }

    /// What is left from the place that was looked at last, in whichever state it is least.
    pub(in crate::planner) fn least(&self) -> f64 {
        self.least
    }

    /// What is left from the place that was looked at last.
    #[inline]
    pub(in crate::planner) fn left(&self, state: StateId) -> f64 {
        self.left[state.index()]
    }

    /// What is left from any place.
    pub(in crate::planner) fn left_from(&mut self, p: Point2<f64>, state: StateId) -> f64 {
        let Some(informed) = &self.informed else {
            return 0.0;
        };
        if self.seen.is_some_and(|(seen, _)| seen == p) {
            return self.left(state);
        }
        let (at, far) = &mut self.elsewhere;
        if *at != Some(p) {
            *at = Some(p);
            informed.relaxed.far(p, far);
        }
        informed.going.of_state(state, p, far)
    }
}
