//! Samplers side by side on the same missions: what guidance costs and what it saves.
//!
//! Every mission is searched by every contender with the same seeds, until its first plan ([`compare`]), or on
//! to the end of a budget beside the exact planner's plan ([`converge`]). One iteration is one drawn sample;
//! runs that spend their budget count at the cap and are told. [`Study`] does both, keeps what is done in a
//! folder, and writes a report with plots there.

mod convergence;
mod entrant;
mod groups;
pub mod inference;
mod report;
mod stats;
mod study;
pub mod transfer;
mod trials;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::guidance::Guidance;
use crate::planner::{GuidanceError, PlanError, Problem};

pub use convergence::{Convergence, CostSettings, Descent, Mark, Reference, converge};
pub use entrant::{Asked, Live};
pub use groups::{COMPLEX_FROM, Classes, Group};
pub use report::{RatioRow, Report, Row};
pub use stats::{Measured, Ratio, Share, Summary, Truth, mean};
pub use study::{
    Findings, LogError, Machine, REPORT_FILES, Record, Study, StudyError, StudyFolder,
};
pub use trials::{Comparison, Times, Trial, compare};

/// A strategy of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Uniform sampling.
    Uniform,
    /// Biased sampling.
    Biased,
    /// The rules of guided sampling without predictions.
    Directed,
    /// The guided rule with a flat heatmap and flat state probabilities: what the rule gains
    /// without any network. What a network adds is what lies below it.
    Flat,
    /// Guided by the networks.
    Guided,
    /// As `plan` does it of itself: directed, and guided once the search has lasted so long that networks pay.
    Auto,
    /// The guided rule with the labels of the data set in place of the networks: what perfect networks
    /// would gain. A control that reads the answer, not a planner.
    Oracle,
}

impl Strategy {
    /// Its name, as on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Biased => "biased",
            Self::Directed => "directed",
            Self::Flat => "flat",
            Self::Guided => "guided",
            Self::Auto => "auto",
            Self::Oracle => "oracle",
        }
    }
}

/// A strategy, and for the guided one what ran its networks.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Contender {
    /// The strategy.
    pub strategy: Strategy,
    /// The device whose predictions guide it, where several are compared; the mission's first predictions
    /// otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
}

impl From<Strategy> for Contender {
    fn from(strategy: Strategy) -> Self {
        Self {
            strategy,
            device: None,
        }
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.strategy.name())?;
        match &self.device {
            Some(device) => write!(f, " ({device})"),
            None => Ok(()),
        }
    }
}

/// What the networks say about a mission.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// What ran them: `cpu`, or an adapter's name.
    pub device: String,
    /// Heatmap and state probabilities.
    pub guidance: Guidance,
    /// Seconds from map and automaton to tensors.
    pub encode_seconds: f64,
    /// Seconds of the networks.
    pub infer_seconds: f64,
    /// The networks themselves, if guided searches are to ask them anew and to begin meanwhile, as `plan` does.
    pub live: Option<Live>,
}

impl Prediction {
    /// Seconds of encoding and networks.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.encode_seconds + self.infer_seconds
    }
}

/// One mission of a comparison.
#[derive(Clone, Debug)]
pub struct Case {
    /// The mission's name, unique in the comparison.
    pub name: String,
    /// The kind of map, where that is known.
    pub family: Option<String>,
    /// The mission.
    pub problem: Problem,
    /// Seconds from the formula to the task; 0 if nobody measured them.
    pub translate_seconds: f64,
    /// The networks' predictions, one for each device; none if they do not fit the mission.
    pub predictions: Vec<Prediction>,
    /// What perfect networks would predict, if the mission came with labels.
    pub labels: Option<Guidance>,
}

impl Case {
    /// The order in which so many contenders search this mission. Each is first on some missions: whoever comes first finds caches
    /// cold, and would seem slower than it is.
    fn turns(&self, contenders: usize) -> impl Iterator<Item = usize> + use<> {
        let hash = |hash: usize, byte: u8| hash.wrapping_mul(31).wrapping_add(usize::from(byte));
        let first = self.name.bytes().fold(0, hash);
        (0..contenders).map(move |k| (first % contenders + k) % contenders)
    }

    /// The predictions that guide a contender.
    fn prediction(&self, contender: &Contender) -> Option<&Prediction> {
        match &contender.device {
            None => self.predictions.first(),
            Some(device) => self.predictions.iter().find(|p| p.device == *device),
        }
    }

    /// Seconds that encoding and networks take in this contender's search, if it asks them.
    fn network_seconds(&self, contender: &Contender) -> [f64; 2] {
        match contender.strategy {
            Strategy::Guided | Strategy::Auto => self
                .prediction(contender)
                .map_or([0.0; 2], |p| [p.encode_seconds, p.infer_seconds]),
            _ => [0.0; 2],
        }
    }
}

/// Why a comparison could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// Predictions that do not fit their mission.
    #[error("mission `{case}`: {source}")]
    Guidance {
        /// The mission.
        case: String,
        /// What is wrong with them.
        source: GuidanceError,
    },
    /// A search that could not begin.
    #[error("mission `{case}`: {source}")]
    Plan {
        /// The mission.
        case: String,
        /// Why not.
        source: Box<PlanError>,
    },
}
