//! How far the expert's plans are from the optimum at most, as the manifest tells it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::record::{MapRecord, MissionRecord, point, to_millionth};
use super::sample::translate;
use crate::exact::quick_bound;
use crate::system::MapLayout;
use crate::workspace::Workspace;

/// How much more than certified lower bounds expert plans cost, as shares of the bounds. A bound takes more than half as long as
/// its mission does: it is computed for the first mission of each map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Missions with a bound.
    pub missions: u64,
    /// Missions whose bound is 0, of which no share can be told; they count nowhere else.
    pub unbounded: u64,
    /// The mean, to a millionth.
    pub mean: f64,
    /// The largest one, to a millionth.
    pub worst: f64,
}

impl Gap {
    /// The gap on a map as it is written; `weight` is the prefix's share of the cost.
    pub(super) fn of_map(map: &MapRecord, weight: f64) -> Self {
        let found = map.missions.first().zip(map.workspace().ok());
        match found.and_then(|(mission, workspace)| share(mission, &workspace, weight)) {
            Some(share) => Self {
                missions: 1,
                mean: to_millionth(share),
                worst: to_millionth(share),
                ..Self::default()
            },
            None => Self {
                unbounded: map.missions.len().min(1) as u64,
                ..Self::default()
            },
        }
    }

    /// The gap of several parts together.
    pub(super) fn of_parts<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut all = Self::default();
        let mut sum = 0.0;
        for part in parts {
            all.missions += part.missions;
            all.unbounded += part.unbounded;
            all.worst = all.worst.max(part.worst);
            sum += part.mean * part.missions as f64;
        }
        if all.missions > 0 {
            all.mean = to_millionth(sum / all.missions as f64);
        }
        all
    }
}

/// How much more than its lower bound a plan costs, as a share of the bound.
fn share(mission: &MissionRecord, workspace: &Arc<Workspace>, weight: f64) -> Option<f64> {
    let (start, cost) = (point(mission.start), mission.cost);
    let places = MapLayout::new(Arc::clone(workspace), start);
    let task = translate(&mission.formula.parse().ok()?, workspace, &places).ok()?;
    let bound = quick_bound(workspace, start, &task, weight, cost);
    (bound > 0.0).then(|| (cost - bound) / bound)
}
