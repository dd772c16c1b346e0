//! How far the expert's plans are from the optimum at most, as the manifest tells it.

use std::sync::Arc;

use super::record::{Gap, MapRecord, MissionRecord, point, to_millionth};
use super::sample::translate;
use crate::exact::quick_bound;
use crate::system::MapLayout;
use crate::workspace::Workspace;

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
}

/// How much more than its lower bound a plan costs, as a share of the bound.
fn share(mission: &MissionRecord, workspace: &Arc<Workspace>, weight: f64) -> Option<f64> {
    let (start, cost) = (point(mission.start), mission.cost);
    let places = MapLayout::new(Arc::clone(workspace), start);
    let task = translate(&mission.formula.parse().ok()?, workspace, &places).ok()?;
    let bound = quick_bound(workspace, start, &task, weight, cost);
    (bound > 0.0).then(|| (cost - bound) / bound)
}
