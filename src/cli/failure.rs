//! How a command ends badly.

use std::path::Path;

use serde_json::{Value, json};

use crate::automaton::{HoaError, HoaErrorKind, TaskError, TranslateError};
use crate::exact::Infeasible;
use crate::mission::MissionError;
use crate::plan::PlanFileError;
use crate::planner::PlanError;
use crate::scenario::{ScenarioError, ScenarioErrorKind, snippet};

/// The version of everything that `--json` prints.
pub(super) const JSON_VERSION: u32 = 1;

/// Why a command ends with another code than 0.
#[derive(Debug)]
pub(super) struct Failure {
    /// 1: no plan found or a plan refused. 2: bad input.
    pub(super) code: u8,
    /// What the JSON object calls it.
    pub(super) outcome: &'static str,
    /// One sentence.
    pub(super) message: String,
    /// Lines of the input with a caret.
    pub(super) snippet: Option<String>,
    /// Whether the JSON object was printed already.
    pub(super) told: bool,
    /// More fields of the JSON object.
    pub(super) details: Box<Value>,
}

impl Failure {
    /// Bad input: code 2.
    pub(super) fn input(message: impl Into<String>) -> Self {
        Self {
            code: 2,
            outcome: "bad-input",
            message: message.into(),
            snippet: None,
            told: false,
            details: Box::default(),
        }
    }

    /// Nothing found, or something refused: code 1.
    pub(super) fn negative(outcome: &'static str, message: impl Into<String>) -> Self {
        Self {
            code: 1,
            outcome,
            message: message.into(),
            snippet: None,
            told: false,
            details: Box::default(),
        }
    }

    /// Puts what it is about, as a file's name, before the message.
    pub(super) fn of(mut self, what: &str) -> Self {
        self.message = format!("{what}: {}", self.message);
        self
    }

    /// Leaves the JSON object out: the result was printed already.
    pub(super) fn already_told(mut self) -> Self {
        self.told = true;
        self
    }

    pub(super) fn with_details(mut self, details: Value) -> Self {
        self.details = Box::new(details);
        self
    }

    pub(super) fn with_snippet(mut self, snippet: Option<String>) -> Self {
        self.snippet = snippet;
        self
    }

    /// A file that could not be written.
    pub(super) fn write(path: &Path, error: &std::io::Error) -> Self {
        Self::input(format!("{}: cannot write: {error}", path.display()))
    }

    /// The JSON object that tells it.
    pub(super) fn to_json(&self) -> Value {
        let mut object = json!({
            "version": JSON_VERSION,
            "outcome": self.outcome,
            "message": self.message,
        });
        if let (Some(object), Some(details)) = (object.as_object_mut(), self.details.as_object()) {
            object.extend(details.clone());
        }
        object
    }
}

impl From<ScenarioError> for Failure {
    fn from(e: ScenarioError) -> Self {
        let details = match e.position() {
            Some((line, column)) => json!({ "line": line, "column": column }),
            None => json!({}),
        };
        let option = match e.kind() {
            ScenarioErrorKind::NotOne { .. } => " (--pick)",
            _ => "",
        };
        Self::input(format!("{e}{option}"))
            .with_snippet(e.snippet())
            .with_details(details)
    }
}

/// The outcome of a translation, or of reading an automaton, that hit a limit which is a setting.
const LIMIT: &str = "translation-limit";

impl From<TranslateError> for Failure {
    fn from(e: TranslateError) -> Self {
        let option = match &e {
            TranslateError::States { .. } => "--max-states",
            TranslateError::Transitions { .. } => "--max-transitions",
            TranslateError::Time { .. } => "--max-translation",
            _ => return Self::input(e.to_string()),
        };
        Self::negative(LIMIT, format!("{e} ({option})"))
    }
}

impl From<&HoaError> for Failure {
    fn from(e: &HoaError) -> Self {
        let failure = match &e.kind {
            HoaErrorKind::States { .. } => Self::negative(LIMIT, format!("{e} (--max-states)")),
            HoaErrorKind::Transitions { .. } => {
                Self::negative(LIMIT, format!("{e} (--max-transitions)"))
            }
            _ => Self::input(e.to_string()),
        };
        failure.with_snippet(Some(snippet::show(&e.source, e.line, &e.place())))
    }
}

impl From<PlanFileError> for Failure {
    fn from(e: PlanFileError) -> Self {
        Self::input(e.to_string())
    }
}

impl From<std::io::Error> for Failure {
    fn from(e: std::io::Error) -> Self {
        Self::input(format!("cannot write the result: {e}"))
    }
}

impl From<MissionError> for Failure {
    fn from(e: MissionError) -> Self {
        let message = e.to_string();
        match e {
            MissionError::Unreachable(why) => {
                let details = json!({
                    "places": why.places,
                    "through": why.through,
                    "beyond": why.beyond,
                    "at_start": why.at_start,
                });
                Self::negative("unreachable", message).with_details(details)
            }
            MissionError::NotOnThisMap(why) => Self::negative("not-on-this-map", message)
                .with_details(json!({ "facts": why.facts })),
            MissionError::Plan(PlanError::Unreachable(_)) => Self::negative("unreachable", message),
            MissionError::Exact(Infeasible::Unsatisfiable) => {
                Self::negative("not-on-this-map", message)
            }
            // Where it were certain, walls or regions would have been named.
            MissionError::Exact(
                Infeasible::NoPrefix | Infeasible::NoSuffix | Infeasible::Halted,
            ) => Self::negative("not-found", message),
            MissionError::Plan(PlanError::NotFound(_)) => Self::negative("not-found", message),
            MissionError::Task(TaskError::Unsatisfiable) => {
                Self::negative("unsatisfiable", message)
            }
            MissionError::Task(TaskError::Translate(e)) => e.into(),
            MissionError::Task(_) => Self::negative("not-on-this-map", message),
            MissionError::Refused(_) => Self::negative("refused", message),
            _ => Self::input(message),
        }
    }
}
