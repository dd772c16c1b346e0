//! `nngtl translate`.

use std::sync::Arc;

use serde_json::json;

use super::args::{AutomatonFormat, TranslateArgs};
use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use crate::alphabet::{Alphabet, MAX_POWERSET};
use crate::automaton::{Limits, Nba, Task, translate};
use crate::ltl::{self, ParseOptions, Parsed};
use crate::scenario::{Overrides, Scenario, snippet};

pub(super) fn run(args: &TranslateArgs, console: &Console) -> Result<(), Failure> {
    let (parsed, alphabet) = match &args.scenario {
        Some(_) => on_map(args)?,
        None => alone(&args.formula)?,
    };
    let nba = translate(&parsed.formula, alphabet, &Limits::from(&args.limits))
        .map_err(|e| Failure::input(e.to_string()))?;
    let task = Task::from_trimmed(nba, Some(parsed.formula.clone()));
    let written = show(&task.nba, args.format);
    let text = if console.json() {
        let object = json!({
            "version": JSON_VERSION,
            "outcome": "translated",
            "formula": parsed.formula.to_string(),
            "states": task.nba.len(),
            "transitions": task.nba.edge_count(),
            "letters": task.nba.alphabet.len(),
            "feasible_accepting": task.feasible.len(),
            "automaton": written,
        });
        format!("{object}\n")
    } else {
        format!("{}\n", written.trim_end())
    };
    Ok(console.result(&text)?)
}

fn show(nba: &Nba, format: AutomatonFormat) -> String {
    match format {
        AutomatonFormat::Text => nba.to_string(),
        AutomatonFormat::Hoa => nba.to_hoa(None),
        AutomatonFormat::Dot => nba.to_dot(None),
    }
}

fn parse(text: &str, known: &[String]) -> Result<Parsed, Failure> {
    let options = ParseOptions {
        known: known.to_vec(),
        ..ParseOptions::default()
    };
    let checked = ltl::parse(text, &options).and_then(|parsed| {
        if known.is_empty() {
            return Ok(parsed);
        }
        ltl::check_propositions(&parsed, known).map(|()| parsed)
    });
    checked.map_err(|e| {
        let (line, column) = e.line_column();
        Failure::input(format!("the formula: {e}"))
            .with_snippet(Some(snippet::show(text, 1, &e.span)))
            .with_details(json!({ "line": line, "column": column }))
    })
}

/// Every combination of the formula's propositions is a letter.
fn alone(text: &str) -> Result<(Parsed, Arc<Alphabet>), Failure> {
    let parsed = parse(text, &[])?;
    let names: Vec<String> = parsed
        .formula
        .propositions()
        .into_iter()
        .map(Into::into)
        .collect();
    if names.len() > MAX_POWERSET {
        return Err(Failure::input(format!(
            "the formula has {} propositions, at most {MAX_POWERSET} are supported without a map: name one with --scenario",
            names.len()
        )));
    }
    let alphabet = Alphabet::powerset(names).map_err(|e| Failure::input(e.to_string()))?;
    Ok((parsed, Arc::new(alphabet)))
}

/// The letters are those of a map.
fn on_map(args: &TranslateArgs) -> Result<(Parsed, Arc<Alphabet>), Failure> {
    let path = args
        .scenario
        .as_deref()
        .unwrap_or_else(|| std::path::Path::new(""));
    // The scenario's own task does not matter here.
    let overrides = Overrides {
        task: Some("true".to_owned()),
        weight: None,
    };
    let scenario = Scenario::load_with(path, args.pick.as_deref(), &overrides)?;
    let alphabet = Arc::clone(scenario.workspace.alphabet());
    Ok((parse(&args.formula, alphabet.propositions())?, alphabet))
}
