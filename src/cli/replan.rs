//! `nngtl replan`.

use std::time::Instant;

use serde_json::json;

use super::args::ReplanArgs;
use super::console::{Console, seconds};
use super::failure::Failure;
use super::{library, plan};
use crate::mission::{self, Change};
use crate::plan::PlanFile;
use crate::planner::{Progress, Stop};

pub(super) fn run(args: &ReplanArgs, console: &Console) -> Result<(), Failure> {
    let began = Instant::now();
    let old = PlanFile::read(&args.old)?;
    let mut wanted = args.plan.clone();
    if let (None, None, Some(task)) = (&wanted.mission.task, &wanted.automaton, &old.task) {
        // The plan's own mission: a scenario has one task, a map many.
        wanted.mission.task = Some(task.clone());
        let stands_in = format!("the task of {}", args.old.display());
        wanted.mission.task_of = Some(stands_in.into());
    }
    if wanted.mission.weight.is_none() {
        wanted.mission.weight = old.weight;
    }
    let (scenario, task, translate) = plan::read(&wanted, console)?;
    let skills = match &args.library {
        Some(path) => {
            let (system, _) = mission::world(&scenario)?;
            Some(library::load(path, &*system, console)?.library)
        }
        None => None,
    };
    let options = plan::options(&args.plan);
    let path = old.path();
    let search = |stop: &Stop, observe: &mut dyn FnMut(Progress)| {
        mission::replan_task(
            &scenario,
            task,
            &path,
            skills.as_ref(),
            &options,
            stop,
            observe,
        )
    };
    let ((mut planned, change), ended) = plan::watched(&scenario, &options, console, search)?;
    plan::finish(&mut planned, ended, began, translate, console);
    plan::write_files(&args.plan, &scenario, &planned, &[], console)?;
    let told = match change {
        Change::None => "none: the plan still holds".to_owned(),
        Change::Repaired {
            segments,
            seconds: s,
        } => {
            let what = if segments == 1 { "segment" } else { "segments" };
            format!("{segments} {what} replaced in {}", seconds(s))
        }
        Change::Anew(why) => format!("planned anew, as the old plan cannot be repaired: {why}"),
    };
    let text = if console.json() {
        let mut object = plan::to_json(&args.plan, &scenario, &planned);
        object["change"] = match change {
            Change::None => json!({ "kind": "none" }),
            Change::Repaired { segments, seconds } => {
                json!({ "kind": "repaired", "segments": segments, "seconds": seconds })
            }
            Change::Anew(why) => json!({ "kind": "anew", "reason": why.to_string() }),
        };
        format!("{object}\n")
    } else {
        let summary = match change {
            Change::None => plan::describe_as(&scenario, &planned, "unchanged and verified"),
            Change::Repaired { .. } => {
                plan::describe_as(&scenario, &planned, "repaired and verified")
            }
            Change::Anew(_) => plan::describe(&scenario, &planned),
        };
        format!("{summary}  change  {told}\n")
    };
    Ok(console.result(&text)?)
}
