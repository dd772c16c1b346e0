//! `nngtl translate`.

use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::args::{AutomatonFormat, TranslateArgs};
use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use crate::alphabet::{Alphabet, MAX_POWERSET};
use crate::automaton::{Limits, Nba, Task, TranslateError, translate, translate_on};
use crate::ltl::{self, ParseOptions, Parsed};
use crate::scenario::{Overrides, Scenario, snippet};
use crate::system::MapLayout;

pub(super) fn run(args: &TranslateArgs, console: &Console) -> Result<(), Failure> {
    let limits = Limits::from(&args.limits);
    let (parsed, nba) = match &args.scenario {
        Some(path) => on_map(args, path, &limits)?,
        None => alone(&args.formula, &limits)?,
    };
    for (word, read) in parsed.run_together() {
        console.note(&format!(
            "`{word}` is read as `{read}`: for a proposition of that name, write \"{word}\" in quotes"
        ));
    }
    let nba = nba?;
    let task = Task::from_trimmed(nba, Some(parsed.formula.clone()));
    let written = show(&task.nba, args.format);
    if task.nba.is_empty() {
        let what = match args.scenario {
            Some(_) => "no walk over the letters of this map satisfies the formula",
            None => "no word satisfies the formula",
        };
        console.warn(&format!("{what}: the automaton is empty"));
    }
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

/// A formula, and what became of its translation.
type Translated = (Parsed, Result<Nba, TranslateError>);

/// Every combination of the formula's propositions is a letter.
fn alone(text: &str, limits: &Limits) -> Result<Translated, Failure> {
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
    let nba = translate(&parsed.formula, Arc::new(alphabet), limits);
    Ok((parsed, nba))
}

/// The automaton that plans on a map are made with, over the letters that occur on it.
fn on_map(args: &TranslateArgs, path: &Path, limits: &Limits) -> Result<Translated, Failure> {
    // The scenario's own task does not matter here.
    let overrides = Overrides {
        task: Some("true".to_owned()),
        ..Overrides::default()
    };
    let scenario = Scenario::load_with(path, args.pick.as_deref(), &overrides)?;
    let alphabet = Arc::clone(scenario.workspace.alphabet());
    let parsed = parse(&args.formula, alphabet.propositions())?;
    let layout = MapLayout::new(Arc::clone(&scenario.workspace), scenario.start);
    let nba = translate_on(&parsed.formula, alphabet, limits, &layout);
    Ok((parsed, nba))
}
