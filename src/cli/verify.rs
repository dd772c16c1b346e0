//! `nngtl verify`.

use std::path::Path;

use serde_json::json;

use super::args::VerifyArgs;
use super::console::{Console, rest};
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::mission;
use crate::plan::{Cost, PlanFile};
use crate::scenario::{Overrides, ScenarioText};
use crate::verify::Refusal;

/// Whether a plan was made on this map and from this start, for whatever mission.
fn made_here(text: &ScenarioText, plan: &PlanFile, hash: &str) -> bool {
    let overrides = Overrides {
        // What stands for the formula where an automaton took its place.
        task: Some(plan.task.clone().unwrap_or_else(|| "true".to_owned())),
        weight: plan.weight,
        ..Overrides::default()
    };
    let same = text.scenario(&overrides);
    same.is_ok_and(|scenario| scenario.hash == hash)
}

pub(super) fn run(args: &VerifyArgs, console: &Console) -> Result<(), Failure> {
    let stdin = Path::new("-");
    if args.plan == stdin && args.mission.scenario == stdin {
        let message = "the scenario and the plan cannot both be standard input: name a file";
        return Err(Failure::input(message));
    }
    let plan = PlanFile::read(&args.plan)?;
    let mut wanted = args.mission.clone();
    if args.automaton.is_some() && wanted.task.is_none() {
        // The automaton takes the formula's place; the scenario need not have one.
        wanted.task = Some("true".to_owned());
    }
    let text = files::scenario_text(&wanted)?;
    let scenario = files::scenario_of(&text, &wanted, console)?;
    if let Some(hash) = &plan.scenario_hash
        && *hash != scenario.hash
        && !made_here(&text, &plan, hash)
    {
        console.warn(&format!(
            "{} was made for another scenario, or for another state of this one",
            args.plan.display()
        ));
    }
    let path = plan.path();
    // The stated cost is checked by the weight that the plan was made with; another is for looking.
    let stated_weight = plan.weight.unwrap_or(scenario.weight);
    let weight = args.mission.weight.unwrap_or(stated_weight);
    let automaton = match &args.automaton {
        Some(file) => Some(files::automaton(file, &scenario, &(&args.limits).into())?),
        None => None,
    };
    let stated = plan.cost.as_ref();
    let verdict = mission::verify(&scenario, automaton.as_ref(), &path, stated_weight, stated);
    let verified = verdict.map_err(|refusal| {
        let mut message = format!("{}: refused: {refusal}", args.plan.display());
        let other = plan.task.as_ref().filter(|task| **task != scenario.task);
        if let (Refusal::Formula { .. }, Some(task)) = (&refusal, other) {
            message += &format!(" (the plan was made for the task {task})");
        }
        Failure::negative("refused", message).with_details(json!({
            "scenario": scenario.name,
            "reason": refusal.to_string(),
        }))
    })?;
    let (cost, word) = (
        Cost::new(verified.cost.prefix, verified.cost.suffix, weight),
        super::plan::shown(&scenario, &verified.word),
    );
    let text = if console.json() {
        let object = json!({
            "version": JSON_VERSION,
            "outcome": "verified",
            "scenario": scenario.name,
            "word": word,
            "cost": cost,
        });
        format!("{object}\n")
    } else {
        format!(
            "{}: verified\n  word  {word}\n  cost  {:.6} = {weight} × {:.6} + {} × {:.6}\n",
            args.plan.display(),
            cost.total,
            cost.prefix,
            rest(weight),
            cost.suffix,
        )
    };
    Ok(console.result(&text)?)
}
