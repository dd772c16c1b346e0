//! First plans and costs over time in one go, with a folder that keeps what is done.

mod folder;
mod log;
mod machine;
mod plots;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{
    BenchError, Case, Comparison, Convergence, CostSettings, Descent, Reference, Report, Trial,
    convergence, trials,
};
use crate::number::hex;
use crate::planner::Stop;
use crate::workspace::Polygon;

pub use folder::REPORT_FILES;
pub use log::{LogError, StudyFolder};
pub use machine::Machine;

/// What to measure on every mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// Runs until the first plan.
    pub comparison: Comparison,
    /// From how many iterations of uniform sampling on a mission is complex.
    pub complex_from: u64,
    /// Searches that go on, beside the exact planner; none if nobody asked.
    pub costs: Option<CostSettings>,
    /// The digest of the networks' weights, if they run.
    pub model: Option<String>,
}

/// All that was measured on one mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The mission's name.
    pub case: String,
    /// The digest of the mission itself: map, start and task.
    pub digest: String,
    /// Runs until the first plan.
    pub trials: Vec<Trial>,
    /// What the exact planner says, if it solves the mission.
    pub reference: Option<Reference>,
    /// Searches that went on.
    pub descents: Vec<Descent>,
}

/// What a study found.
#[derive(Clone, Debug, Serialize)]
pub struct Findings {
    /// The format's version.
    pub version: u32,
    /// Missions that were run.
    pub done: usize,
    /// Missions that were wanted; fewer were run if the study was interrupted.
    pub wanted: usize,
    /// Whether networks' predictions were asked for and missing on some missions.
    pub without_predictions: usize,
    /// Until the first plan.
    #[serde(skip_serializing_if = "Report::is_unwanted")]
    pub first: Report,
    /// Costs over time.
    pub costs: Option<Convergence>,
}

impl Findings {
    /// Whether some missions were not run.
    #[must_use]
    pub fn is_partial(&self) -> bool {
        self.done < self.wanted
    }
}

/// Why a study could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A mission at fault.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// The folder at fault.
    #[error(transparent)]
    Log(#[from] LogError),
}

impl Study {
    /// Measures every mission; those that the folder holds already are taken from there, and every new one is
    /// written to it as soon as it is done. `progress` is called with the number of missions done.
    ///
    /// # Errors
    /// Predictions that do not fit, settings that no search accepts, or a folder that cannot be written.
    pub fn run(
        &self,
        cases: &[Case],
        mut folder: Option<&mut StudyFolder>,
        stop: &Stop,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Findings, StudyError> {
        let mut records = Vec::new();
        for case in cases {
            let digest = digest(case);
            let kept = folder.as_mut().and_then(|f| f.take(&case.name, &digest));
            let record = match kept {
                Some(record) => record,
                None => {
                    // What is kept after this one still belongs to the report.
                    if stop.is_raised() {
                        continue;
                    }
                    let Some(record) = self.measure(case, digest, stop)? else {
                        continue;
                    };
                    if let Some(folder) = &mut folder {
                        folder.append(&record)?;
                    }
                    record
                }
            };
            records.push(record);
            progress(records.len());
        }
        Ok(self.findings(cases, records))
    }

    /// Measures one mission; `None` if the stop was raised before that was done.
    fn measure(
        &self,
        case: &Case,
        digest: String,
        stop: &Stop,
    ) -> Result<Option<Record>, BenchError> {
        let Some(trials) = trials::of_case(case, &self.comparison, stop)? else {
            return Ok(None);
        };
        let mut searched = convergence::Searched::default();
        if let Some(costs) = &self.costs {
            let contenders = &self.comparison.contenders;
            let Some(found) = convergence::of_case(case, contenders, costs, stop)? else {
                return Ok(None);
            };
            searched = found;
        }
        Ok(Some(Record {
            case: case.name.clone(),
            digest,
            trials,
            reference: searched.reference,
            descents: searched.descents,
        }))
    }

    fn findings(&self, cases: &[Case], records: Vec<Record>) -> Findings {
        let contenders = &self.comparison.contenders;
        let done = records.len();
        let mut trials = Vec::new();
        let mut costs = self
            .costs
            .as_ref()
            .map(|costs| Convergence::new(contenders, costs));
        for record in records {
            trials.extend(record.trials);
            if let Some(costs) = &mut costs {
                costs.references.extend(record.reference);
                costs.descents.extend(record.descents);
            }
        }
        let asked = contenders
            .iter()
            .any(|c| matches!(c.strategy, super::Strategy::Guided | super::Strategy::Auto));
        let lacking = cases.iter().filter(|c| asked && c.predictions.is_empty());
        Findings {
            version: 2,
            done,
            wanted: cases.len(),
            without_predictions: lacking.count(),
            first: Report::new(self.comparison.clone(), self.complex_from, trials),
            costs,
        }
    }
}

/// The digest of what a mission is, bit by bit.
fn digest(case: &Case) -> String {
    let mut hash = Sha256::new();
    let problem = &case.problem;
    let mut number = |x: f64| hash.update(x.to_bits().to_le_bytes());
    number(problem.weight);
    problem.start.at.iter().copied().for_each(&mut number);
    if let Some(map) = problem.system.plane() {
        let bounds = map.bounds();
        let corners = [bounds.min, bounds.max];
        corners
            .iter()
            .flat_map(|p| p.iter().copied())
            .for_each(&mut number);
        let regions = map.regions().iter().map(|r| &r.polygon);
        let polygons: Vec<&Polygon> = map.obstacles().iter().chain(regions).collect();
        for polygon in polygons {
            number(polygon.vertices().len() as f64);
            let vertices = polygon.vertices().iter();
            vertices
                .flat_map(|p| p.iter().copied())
                .for_each(&mut number);
        }
    }
    let task = match &problem.task.formula {
        Some(formula) => formula.to_string(),
        None => format!("{:?}", problem.task.nba),
    };
    hash.update(case.name.as_bytes());
    hash.update([0]);
    hash.update(task.as_bytes());
    hex(&hash.finalize())
}

#[cfg(test)]
mod tests;
