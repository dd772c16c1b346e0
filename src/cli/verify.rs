//! `nngtl verify`.

use serde_json::json;

use super::args::VerifyArgs;
use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::plan::PlanFile;
use crate::verify;

pub(super) fn run(args: &VerifyArgs, console: &Console) -> Result<(), Failure> {
    let mut mission = args.mission.clone();
    if args.automaton.is_some() && mission.task.is_none() {
        // The automaton takes the formula's place; the scenario need not have one.
        mission.task = Some("true".to_owned());
    }
    let scenario = files::scenario(&mission, console)?;
    let plan = PlanFile::read(&args.plan)?;
    if let Some(hash) = &plan.scenario_hash
        && *hash != scenario.hash
        && args.automaton.is_none()
    {
        console.warn(&format!(
            "{} was made for another scenario, or for another state of this one",
            args.plan.display()
        ));
    }
    let path = plan.path();
    let (map, start) = (&scenario.workspace, scenario.start);
    let weight = match (args.mission.weight, plan.weight) {
        (None, Some(weight)) => weight,
        _ => scenario.weight,
    };
    let verdict = match &args.automaton {
        Some(file) => {
            let automaton = files::automaton(file, &scenario)?;
            verify::verify_automaton(map, start, &automaton, &path, weight, plan.cost.as_ref())
        }
        None => verify::verify(
            map,
            start,
            &scenario.formula,
            &path,
            weight,
            plan.cost.as_ref(),
        ),
    };
    let verified = verdict.map_err(|refusal| {
        let message = format!("{}: refused: {refusal}", args.plan.display());
        Failure::negative("refused", message).with_details(json!({
            "scenario": scenario.name,
            "reason": refusal.to_string(),
        }))
    })?;
    let (cost, word) = (verified.cost, verified.word.show(map.alphabet()));
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
            1.0 - weight,
            cost.suffix,
        )
    };
    Ok(console.result(&text)?)
}
