//! What the time of a search goes to.

use std::time::{Duration, Instant};

use serde::Serialize;

/// Where the time of a search went, in seconds; measured by [`profile`](super::profile) only, since
/// reading the clock takes time itself (its own share is in `other`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Split {
    /// Drawing points.
    pub sample: f64,
    /// Finding near sites.
    pub near: f64,
    /// Asking whether moves are possible.
    pub collision: f64,
    /// Choosing parents and adding nodes, without collision queries.
    pub extend: f64,
    /// Rerouting neighbours, without collision queries.
    pub rewire: f64,
    /// The rest: which tree grows next, plans, bookkeeping.
    pub other: f64,
}

impl Split {
    /// The parts with their names, in the order of an iteration.
    #[must_use]
    pub fn parts(&self) -> [(&'static str, f64); 6] {
        [
            ("sample", self.sample),
            ("near", self.near),
            ("collision", self.collision),
            ("extend", self.extend),
            ("rewire", self.rewire),
            ("other", self.other),
        ]
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.sample += other.sample;
        self.near += other.near;
        self.collision += other.collision;
        self.extend += other.extend;
        self.rewire += other.rewire;
        self.other += other.other;
    }
}

/// When a part began, and the time of all collision queries until then; `None` if nothing is measured.
pub(super) type Began = Option<(Instant, f64)>;

/// A stop watch that costs nothing while it does not run.
#[derive(Clone, Debug, Default)]
pub(super) struct Clock {
    on: bool,
    pub(super) split: Split,
}

impl Clock {
    pub(super) fn running() -> Self {
        Self {
            on: true,
            ..Self::default()
        }
    }

    /// A clock that runs if this one does, from zero.
    pub(super) fn same(&self) -> Self {
        Self {
            on: self.on,
            ..Self::default()
        }
    }

    /// The beginning of a part, with the collision queries so far.
    pub(super) fn start(&self) -> Began {
        self.on.then(|| (Instant::now(), self.split.collision))
    }

    /// Books the time since `began`, without the collision queries in it.
    pub(super) fn stop(&mut self, began: Began, part: impl Fn(&mut Split) -> &mut f64) {
        if let Some((began, collision)) = began {
            let inner = self.split.collision - collision;
            *part(&mut self.split) += Duration::as_secs_f64(&began.elapsed()) - inner;
        }
    }
}
