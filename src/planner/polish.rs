//! Shortening of the plans that a search finds, while it goes on.
//!
//! Trees find which order of visits and which way around obstacles is good long before they find its
//! shortest path. So each candidate, the cheapest prefix of each word that leads to a goal and each suffix tree's loop, is
//! shortened now and then ([`Shortener`]), and the best plan is the cheapest of all that were found
//! and shortened. Its prefix is then handed back as points to draw (the "beacons" of J. Nasir et al.,
//! "RRT*-SMART: a rapid convergence implementation of RRT*", IJARS 2013), so that the tree holds it,
//! too. Nothing here looks at any other plan than the search's own.

use std::cell::Cell;
use std::collections::VecDeque;

use nalgebra::Point2;

use super::tree::NodeId;
use crate::shorten::{SWEEPS, Shortener};

/// A candidate is shortened again once it is cheaper by this share than when it was before.
const AGAIN: f64 = 0.01;

/// A candidate is not worth shortening if it costs this much more than the best plan: few paths of
/// trees can be shortened by more.
pub(super) const PROMISING: f64 = 1.4;

/// So many plans are shortened at once; after that one for so many iterations, so that shortening
/// takes no more than about the share of the time that growing takes.
const ALLOWANCE: u64 = 4;
const PERIOD: u64 = 16;

/// The corners of obstacles that ways around obstacles may meet: to find a way takes about the time of all that the map has, some two
/// microseconds each. At first so many, and then so many for each iteration: on small maps about as many as are ever asked for, on large
/// ones less than the time of growing.
const CORNERS_AT_FIRST: u64 = 200_000;
const CORNERS_EACH: u64 = 5;

/// Words that are known at once, at most: so many orders of visits compete.
const MOST: usize = 64;

/// What makes candidates alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind {
    /// The suffix tree, if the plan does not stay.
    pub(super) suffix: Option<usize>,
    /// A hash of the letters and states on the way to the goal.
    pub(super) word: u64,
}

/// A plan that could be shortened.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) kind: Kind,
    pub(super) goal: NodeId,
}

/// Candidates of one kind.
#[derive(Clone, Copy, Debug)]
struct Known {
    kind: Kind,
    /// The goal of the cheapest.
    goal: NodeId,
    /// Its cost when it was last seen.
    cost: f64,
    /// The cost at which one was last shortened.
    shortened: f64,
}

/// What to shorten next.
#[derive(Debug)]
pub(super) struct Polish<'a> {
    pub(super) shortener: Shortener<'a>,
    known: Vec<Known>,
    done: u64,
    /// Points of the best plan that the tree should hold.
    pub(super) beacons: VecDeque<Point2<f64>>,
    /// The cost of the plan for which other entries were last looked for.
    pub(super) looked_around: f64,
    /// The corners that ways around obstacles may have met so far.
    walked: Cell<u64>,
}

impl<'a> Polish<'a> {
    pub(super) fn new(shortener: Shortener<'a>) -> Self {
        Self {
            shortener,
            known: Vec::new(),
            done: 0,
            beacons: VecDeque::new(),
            looked_around: f64::INFINITY,
            walked: Cell::new(0),
        }
    }

    /// Whether another way around obstacles may be looked for.
    pub(super) fn may_walk(&self, iterations: u64) -> bool {
        self.walked.get()
            <= CORNERS_AT_FIRST.saturating_add(CORNERS_EACH.saturating_mul(iterations))
    }

    /// Takes note of a way around obstacles that was looked for.
    pub(super) fn has_walked(&self) {
        let corners = self.shortener.corner_count() as u64;
        self.walked.set(self.walked.get() + corners);
    }

    /// Takes note of a plan that was found.
    pub(super) fn offer(&mut self, kind: Kind, goal: NodeId, cost: f64) {
        let Some(known) = self.known.iter_mut().find(|k| k.kind == kind) else {
            let new = Known {
                kind,
                goal,
                cost,
                shortened: f64::INFINITY,
            };
            if self.known.len() < MOST {
                self.known.push(new);
            } else if let Some(costliest) = self
                .known
                .iter_mut()
                .max_by(|a, b| a.cost.total_cmp(&b.cost))
                .filter(|k| cost < k.cost)
            {
                *costliest = new;
            }
            return;
        };
        if cost < known.cost {
            (known.goal, known.cost) = (goal, cost);
        }
    }

    /// The candidate to shorten now, if any is due: the cheapest of those that are worth it.
    pub(super) fn next(&mut self, iterations: u64, best: f64) -> Option<Candidate> {
        if self.done >= ALLOWANCE + iterations / PERIOD {
            return None;
        }
        let due =
            |k: &&mut Known| k.cost < k.shortened * (1.0 - AGAIN) && k.cost <= PROMISING * best;
        let next = self.known.iter_mut().filter(due);
        let next = next.min_by(|a, b| a.cost.total_cmp(&b.cost).then(a.kind.cmp(&b.kind)))?;
        next.shortened = next.cost;
        self.done += 1;
        Some(Candidate {
            kind: next.kind,
            goal: next.goal,
        })
    }

    /// The plan made shorter.
    pub(super) fn shorten(
        &self,
        path: &crate::plan::Path,
    ) -> Option<(crate::plan::Path, crate::plan::Cost)> {
        self.shortener.shorten(path, SWEEPS)
    }
}
