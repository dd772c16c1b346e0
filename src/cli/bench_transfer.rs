//! `nngtl bench transfer`.

use serde_json::json;

use super::args::{BenchTransferArgs, TransferTable};
use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::automaton::{Limits, Task};
use crate::bench::transfer::{
    PAPER, TransferBench, TransferBenchError, changed_environments, continuous_workspace,
    grid_library, grid_scenario, table,
};
use crate::mission::{MissionError, Options};

impl From<TransferBenchError> for Failure {
    fn from(e: TransferBenchError) -> Self {
        Self::negative("not-measured", e.to_string())
    }
}

pub(super) fn run(args: &BenchTransferArgs, console: &Console) -> Result<(), Failure> {
    files::check_folders(args.report.iter().map(|p| p.as_path()))?;
    let settings = TransferBench {
        trials: args.trials,
        environments: args.environments,
        seed: args.seed,
        anytime_seconds: args.anytime,
        ..TransferBench::default()
    };
    let others = automata(args)?;
    let mut text = String::new();
    let mut object = json!({ "version": JSON_VERSION, "outcome": "measured" });
    let wanted = |t: TransferTable| args.table.contains(&t);
    if wanted(TransferTable::One) || wanted(TransferTable::Two) {
        let library = grid_library(settings.seed)?;
        if wanted(TransferTable::One) {
            let bar = console.progress(PAPER.len() as u64, "new formulas");
            let table = table(&library, &settings, &others, &mut |n| {
                bar.set_position(n as u64)
            })?;
            bar.finish_and_clear();
            text.push_str("## New formulas (Table I)\n\n");
            text.push_str(&table.to_markdown());
            object["formulas"] = json!(table);
        }
        if wanted(TransferTable::Two) {
            let bar = console.progress(3 * PAPER.len() as u64, "changed environments");
            let table =
                changed_environments(&library, &settings, &mut |n| bar.set_position(n as u64))?;
            bar.finish_and_clear();
            text.push_str("\n## Changed environments (Table II)\n\n");
            text.push_str(&table.to_markdown());
            object["environments"] = json!(table);
        }
    }
    if wanted(TransferTable::Continuous) {
        let options = Options {
            device: args.network.device.into(),
            model: args.network.model.clone(),
            ..Options::default()
        };
        let bar = console.progress(4, "continuous workspace");
        let table = continuous_workspace(&settings, &options, &mut |n| bar.set_position(n as u64))?;
        bar.finish_and_clear();
        text.push_str("\n## Continuous workspace\n\n");
        text.push_str(&table.to_markdown());
        object["continuous"] = json!(table);
    }
    if let Some(path) = &args.report {
        files::write(path, text.as_bytes(), console)?;
    }
    let text = if console.json() {
        format!("{object}\n")
    } else {
        text
    };
    Ok(console.result(&text)?)
}

/// The automata of the folder, by formula.
fn automata(args: &BenchTransferArgs) -> Result<Vec<(String, Task)>, Failure> {
    let Some(folder) = &args.hoa else {
        return Ok(Vec::new());
    };
    if !folder.is_dir() {
        return Err(Failure::input(format!(
            "{}: there is no such folder",
            folder.display()
        )));
    }
    let mut found = Vec::new();
    for paper in &PAPER {
        let file = folder.join(format!("{}.hoa", paper.name));
        if file.exists() {
            let nba = files::automaton(
                &file,
                &grid_scenario(Some(paper.formula))?,
                &Limits::default(),
            )?;
            let task = Task::from_nba(nba).map_err(MissionError::from)?;
            found.push((paper.name.to_owned(), task));
        }
    }
    Ok(found)
}
