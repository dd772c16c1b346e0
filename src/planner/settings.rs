//! What can be set about a search.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::parallel::MAX_THREADS;
use super::sampler::HeadStart;
use super::tree::Near;
use crate::number::Brief;

/// So many sites are connected where RRT*'s rules name fewer and none of those leads to the point, and
/// in small trees from the beginning: a point that is drawn far ahead is often in sight of few of those
/// near it.
const MORE_NEIGHBOURS: usize = 250;

/// Parameters of TL-RRT* and its samplers; the defaults are the papers' values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The seed of every random choice.
    pub seed: u64,
    /// Sampler calls over all trees together, at most.
    pub iterations: u64,
    /// Wall-clock budget in seconds; results then depend on the machine. `None`: no limit.
    pub time_limit: Option<f64>,
    /// Searches that run side by side, each with the whole budget and its own randomness; the best
    /// plan wins. Results depend on this number as they depend on the seed.
    pub threads: usize,
    /// Stop at the first feasible plan.
    pub first: bool,
    /// Factor of the near radius `radius · √(ln(n+1)/n)`, relative to the map's side.
    pub radius: f64,
    /// The largest near radius, relative to the map's side.
    pub max_radius: f64,
    /// Shorten the plans that are found, where the map allows it (see [`crate::shorten`]); never with
    /// `first`.
    pub shorten: bool,
    /// Pass over points and product states that no cheaper plan than the best can visit (J. D. Gammell,
    /// S. S. Srinivasa, T. D. Barfoot, "Informed RRT*", IROS 2014): by the length of the way there, in large trees also by what the mission asks for from
    /// there on. Paths that cost up to 5 % more are kept where they can be [shortened](Self::shorten).
    pub informed: bool,
    /// At most `neighbours · ln(n+1)` sites within the near radius, the nearest, are connected: RRT*'s
    /// k-nearest rule, by which an iteration's cost grows with log n however sites cluster. Above
    /// e·(1 + 1/2) ≈ 4.08 it keeps asymptotic optimality in the plane (S. Karaman, E. Frazzoli,
    /// "Sampling-based algorithms for optimal motion planning", IJRR 2011, III-C).
    pub neighbours: f64,
    /// The longest new edge relative to the map's side (steering); `None`: points are taken as
    /// drawn, as the published planner does.
    pub range: Option<f64>,
    /// Probability that the node to extend from is drawn from the closest set (S-2).
    pub p_closest: f64,
    /// Probability that a point is drawn towards the target and not uniformly (S-6, C-2).
    pub y_rand: f64,
    /// Probability that a point drawn towards a target lies on the shortest way there: uniform in the
    /// target's region if that is in sight, else at the first bend that the tree has not reached (ours: the
    /// papers' distribution hardly ever meets a small region or a narrow door).
    pub p_target: f64,
    /// Standard deviation of the distance from the closest node, relative to the map's side (S-6).
    pub distance_deviation: f64,
    /// Standard deviation of the angle around the direction to the target, in radians (S-6).
    pub angle_deviation: f64,
    /// Probability that a choice follows the predictions: each choice of states (C-1), and the
    /// point (C-2); otherwise it is made as in the biased strategy.
    pub alpha: f64,
    /// Probability that a guided sample extends the node with the least way left to the target instead of one
    /// drawn uniformly, until a plan is known to the nearest of up to four targets that are drawn (ours; 0 is the paper's rule). Unless
    /// it is 0, the first 32 guided samples of a tree count this, `p_closest`, `y_rand`, `alpha` and `p_region` as 1.
    pub lead: f64,
    /// Probability that a guided point is drawn from the target's region once a straight leg leads there, or from
    /// the region that such a leg crosses, or beside it if that saves a move to the first plan, and not from the rectangle of C-2 (ours; 0
    /// is the paper's rule).
    pub p_region: f64,
    /// Whether a guided search waits for the networks before its first sample (the papers' way), and not only before the samples of
    /// [`HeadStart::USUAL`], so that it begins while they run (ours).
    pub networks_first: bool,
    /// Where a wall hides the target, guided points come from squares of all sizes around the corner at which the shortest way
    /// bends; the largest one's half side, relative to the map's side. In sight, C-2's rectangle is grown by as much (ours; 0 is
    /// the paper's rule).
    pub corner: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 0,
            iterations: 10_000,
            time_limit: None,
            threads: 1,
            first: false,
            radius: 3.0,
            max_radius: 0.8,
            shorten: true,
            informed: true,
            neighbours: 4.5,
            range: None,
            p_closest: 0.9,
            y_rand: 0.95,
            p_target: 0.05,
            distance_deviation: 1.0 / 3.0,
            angle_deviation: std::f64::consts::PI / 108.0,
            alpha: 0.95,
            lead: 0.95,
            p_region: 0.98,
            corner: 0.04,
            networks_first: false,
        }
    }
}

/// A setting out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("setting `{name}` is {}: expected {expected}", Brief(*value))]
pub struct SettingsError {
    /// The field's name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// The range it must lie in.
    pub expected: &'static str,
}

impl Settings {
    /// These settings with C-1 and C-2 exactly as in `nngtl.md`, IV-A, and with the paper's y_rand and α (V-B).
    #[must_use]
    pub fn paper_rule(self) -> Self {
        Self {
            y_rand: 0.8,
            alpha: 0.8,
            lead: 0.0,
            p_region: 0.0,
            corner: 0.0,
            networks_first: true,
            ..self
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first setting that is out of its range. Shares must stay below 1 where completeness
    /// needs the uniform share.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let check = |name, value: f64, good: bool, expected| {
            if good {
                return Ok(());
            }
            Err(SettingsError {
                name,
                value,
                expected,
            })
        };
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let unit = |v: f64| (0.0..=1.0).contains(&v);
        let below_one = |v: f64| (0.0..1.0).contains(&v);
        let more = "a number above 0";
        check("radius", self.radius, positive(self.radius), more)?;
        check(
            "max_radius",
            self.max_radius,
            positive(self.max_radius),
            more,
        )?;
        check(
            "neighbours",
            self.neighbours,
            positive(self.neighbours),
            more,
        )?;
        let range = self.range.unwrap_or(1.0);
        check("range", range, positive(range), more)?;
        let deviation = self.distance_deviation;
        check("distance_deviation", deviation, positive(deviation), more)?;
        let angle = self.angle_deviation;
        check(
            "angle_deviation",
            angle,
            angle.is_finite() && angle >= 0.0,
            "0 or more radians",
        )?;
        check(
            "p_closest",
            self.p_closest,
            unit(self.p_closest),
            "a share in [0, 1]",
        )?;
        check(
            "y_rand",
            self.y_rand,
            below_one(self.y_rand),
            "a share in [0, 1): without a uniform share the search is not complete",
        )?;
        check(
            "p_target",
            self.p_target,
            unit(self.p_target),
            "a share in [0, 1]",
        )?;
        check(
            "alpha",
            self.alpha,
            below_one(self.alpha),
            "a share in [0, 1): without the original strategy's share the search is not complete",
        )?;
        check("lead", self.lead, unit(self.lead), "a share in [0, 1]")?;
        check(
            "p_region",
            self.p_region,
            unit(self.p_region),
            "a share in [0, 1]",
        )?;
        check(
            "corner",
            self.corner,
            unit(self.corner),
            "a share of the map's side, 0 to 1",
        )?;
        let limit = self.time_limit.unwrap_or(1.0);
        check(
            "time_limit",
            limit,
            limit.is_finite() && limit >= 0.0,
            "0 or more seconds",
        )?;
        check(
            "threads",
            self.threads as f64,
            (1..=MAX_THREADS).contains(&self.threads),
            "from 1 to 256",
        )?;
        check(
            "iterations",
            self.iterations as f64,
            self.iterations > 0,
            "at least 1",
        )
    }

    /// Which sites count as near in RRT* for a tree of so many places on a map of this side.
    #[must_use]
    pub(crate) fn near(&self, sites: usize, side: f64) -> Near {
        let n = sites as f64;
        let log = libm::log(n + 1.0);
        let shrinking = self.radius * (log / n).sqrt();
        // All of a small tree, and a quarter as many of one twice that size.
        let most = MORE_NEIGHBOURS as f64;
        let wide = most * (most / n).powi(2).min(1.0);
        Near {
            radius: shrinking.min(self.max_radius) * side,
            count: (self.neighbours * log).max(wide).ceil() as usize,
            more: MORE_NEIGHBOURS,
        }
    }

    /// How many samples a guided search draws before it turns to the networks.
    #[must_use]
    pub fn head_start(&self) -> HeadStart {
        match self.networks_first {
            true => HeadStart::NONE,
            false => HeadStart::USUAL,
        }
    }

    /// Whether plans are shortened.
    pub(crate) fn shortens(&self) -> bool {
        self.shorten && !self.first
    }

    /// The time limit as a duration.
    #[must_use]
    pub(crate) fn time_budget(&self) -> Option<Duration> {
        self.time_limit
            .map(|s| Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX))
    }
}

/// A flag by which another thread (or Ctrl-C) ends a search, which then returns its best so far.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// A flag that is not raised.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks the search to end.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// The flag itself, for work that is not a search.
    #[must_use]
    pub fn flag(&self) -> &AtomicBool {
        &self.0
    }

    /// Whether the search should end.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
