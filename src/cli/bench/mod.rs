//! `nngtl bench`.

mod missions;

use std::path::Path;

use serde::Serialize;
use serde_json::json;

use super::args::{BenchArgs, StrategyName};
use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::bench::{
    Case, Contender, CostSettings, Findings, Machine, Mark, Strategy, Study, StudyFolder, converge,
};
use crate::mission::MissionError;
use crate::nn::{DeviceChoice, Predictor};
use crate::planner::{Settings, Stop};

pub(super) use missions::missions;

pub(super) fn run(args: &BenchArgs, console: &Console) -> Result<(), Failure> {
    files::check_folders(
        [&args.report, &args.csv]
            .into_iter()
            .flatten()
            .map(|p| p.as_path()),
    )?;
    args.out
        .as_deref()
        .map_or(Ok(()), files::check_result_folder)?;
    let mut predictors = predictors(args, console)?;
    let study = study(args, &predictors);
    // Before any work: the folder may hold something else.
    let folder = args
        .out
        .as_deref()
        .map(|path| StudyFolder::open(path, &study));
    let folder = folder
        .transpose()
        .map_err(|e| Failure::input(e.to_string()))?;
    let stop = super::interrupt::stop_on_interrupt();
    let wanted = missions::wanted(&args.scenarios, &args.missions, &stop, console)?;
    let cases = missions::cases(wanted, &mut predictors, console)?;
    if cases.is_empty() && !stop.is_raised() {
        return Err(Failure::input("there is no mission to compare samplers on"));
    }
    if args.samplers.contains(&StrategyName::Oracle) && !cases.iter().any(|c| c.labels.is_some()) {
        return Err(Failure::input(
            "the sampler `oracle` needs the labels of a data set (`nngtl dataset generate`): leave it out, or name such a folder",
        ));
    }
    let machine = Machine::here(predictors.iter().map(|p| p.device().to_owned()).collect());
    let tell = Tell {
        args,
        machine: &machine,
        stop: &stop,
        console,
    };
    match (folder, &study.costs) {
        (Some(folder), _) => in_folder(&study, &cases, folder, &machine, &stop, console),
        (None, Some(costs)) => gaps(&study, costs, &cases, &tell),
        (None, None) => first_plans(&study, &cases, &tell),
    }
}

/// What the arguments ask to measure.
fn study(args: &BenchArgs, predictors: &[Predictor]) -> Study {
    let settings = settings(args);
    let (trials, costs) = match args.costs.gaps {
        true => (0, Some(costs(args, &settings))),
        false => {
            let followed = args.out.is_some() && args.costs.cost_iterations > 0;
            let costs = followed.then(|| costs(args, &settings));
            (args.trials.unwrap_or(5), costs)
        }
    };
    Study {
        comparison: crate::bench::Comparison {
            contenders: contenders(args, predictors),
            trials,
            settings,
        },
        complex_from: args.complex_from,
        costs,
        model: predictors.first().map(|p| p.hash().to_owned()),
    }
}

/// How the searches that go on are followed.
fn costs(args: &BenchArgs, settings: &Settings) -> CostSettings {
    let (iterations, trials) = match args.costs.gaps {
        true => (args.iterations, args.trials.unwrap_or(1)),
        false => (args.costs.cost_iterations, args.costs.cost_trials),
    };
    let time_limit = args.costs.time_limit;
    CostSettings {
        settings: Settings {
            iterations,
            time_limit,
            ..settings.clone()
        },
        trials,
        marks: marks(iterations, time_limit),
        bounds: args.costs.bounds,
    }
}

/// The samplers in the order given, the guided one once for each device.
fn contenders(args: &BenchArgs, predictors: &[Predictor]) -> Vec<Contender> {
    let mut found: Vec<Contender> = Vec::new();
    for &name in &args.samplers {
        let strategy = strategy(name);
        let contenders = match (strategy, predictors) {
            (Strategy::Guided, [_, _, ..]) => predictors
                .iter()
                .map(|p| Contender {
                    strategy,
                    device: Some(p.device().to_owned()),
                })
                .collect(),
            _ => vec![strategy.into()],
        };
        for contender in contenders {
            if !found.contains(&contender) {
                found.push(contender);
            }
        }
    }
    found
}

/// Runs until the first plan, told at once.
fn first_plans(study: &Study, cases: &[Case], tell: &Tell<'_>) -> Result<(), Failure> {
    let bar = tell.console.progress(cases.len() as u64, "comparing");
    let findings = study
        .run(cases, None, tell.stop, &mut |done| {
            bar.set_position(done as u64);
        })
        .map_err(|e| Failure::input(e.to_string()))?;
    bar.finish_and_clear();
    let report = &findings.first;
    tell.result(
        report,
        report.missions,
        &report.to_markdown(),
        &report.to_csv(),
    )
}

/// Runs until the first plan and costs over time, or those alone, in a folder.
fn in_folder(
    study: &Study,
    cases: &[Case],
    mut folder: StudyFolder,
    machine: &Machine,
    stop: &Stop,
    console: &Console,
) -> Result<(), Failure> {
    let failed = |e: &dyn std::fmt::Display| Failure::input(e.to_string());
    if folder.kept() > 0 {
        console.note(&format!(
            "{} missions are kept from earlier runs",
            folder.kept()
        ));
    }
    let bar = console.progress(cases.len() as u64, "comparing");
    let findings = study
        .run(cases, Some(&mut folder), stop, &mut |done| {
            bar.set_position(done as u64);
        })
        .map_err(|e| failed(&e))?;
    bar.finish_and_clear();
    if folder.kept() > 0 {
        console.note(&format!(
            "the report is of these {} missions; {} more, measured before, stay in its log",
            findings.done,
            folder.kept()
        ));
    }
    folder
        .write(study, &findings, machine, &command())
        .map_err(|e| failed(&e))?;
    console.note(&format!(
        "wrote {}",
        folder.path().join("report.md").display()
    ));
    let partial = findings.is_partial();
    console.result(&summary(&findings, folder.path(), console.json()))?;
    if !partial {
        return Ok(());
    }
    Err(Failure::negative(
        "interrupted",
        "interrupted; the report holds what was done, and the same command continues from here",
    )
    .already_told())
}

/// The tables of first plans (of costs where there are no others), or as JSON everything but the runs.
fn summary(findings: &Findings, folder: &Path, as_json: bool) -> String {
    let first = &findings.first;
    if !as_json {
        return match &findings.costs {
            Some(costs) if first.is_unwanted() => costs.to_markdown(),
            _ => first.to_markdown(),
        };
    }
    let mut object = json!({
        "version": JSON_VERSION,
        "outcome": if findings.is_partial() { "interrupted" } else { "compared" },
        "folder": folder,
        "missions": findings.done,
        "wanted": findings.wanted,
    });
    if !first.is_unwanted() {
        object["classes"] = json!(first.classes);
        object["rows"] = json!(first.rows);
        object["ratios"] = json!(first.ratios);
    }
    format!("{object}\n")
}

/// Costs over time, beside the exact planner's and a lower bound.
fn gaps(
    study: &Study,
    costs: &CostSettings,
    cases: &[Case],
    tell: &Tell<'_>,
) -> Result<(), Failure> {
    let bar = tell.console.progress(cases.len() as u64, "searching");
    let contenders = &study.comparison.contenders;
    let report = converge(cases, contenders, costs, tell.stop, &mut |done| {
        bar.set_position(done as u64);
    })
    .map_err(|e| Failure::input(e.to_string()))?;
    bar.finish_and_clear();
    tell.result(
        &report,
        report.references.len(),
        &report.to_markdown(),
        &report.to_csv(),
    )
}

/// Where a result without a folder goes.
struct Tell<'a> {
    args: &'a BenchArgs,
    machine: &'a Machine,
    stop: &'a Stop,
    console: &'a Console,
}

impl Tell<'_> {
    /// Writes the files that were asked for and prints the result, of so many missions. Files and JSON say what was typed, and where it ran.
    fn result(
        &self,
        report: &impl Serialize,
        missions: usize,
        markdown: &str,
        csv: &str,
    ) -> Result<(), Failure> {
        let Self { args, console, .. } = *self;
        if self.stop.is_raised() && missions == 0 {
            return Err(Failure::negative(
                "interrupted",
                "interrupted before the first mission was done",
            ));
        }
        if self.stop.is_raised() {
            console.note("interrupted: these are the missions that were done");
        }
        if let Some(path) = &args.report {
            let command = command().replace('`', "'");
            let text = format!(
                "{markdown}\n- {}\n- command: `{command}`\n",
                self.machine.line()
            );
            files::write(path, text.as_bytes(), console)?;
        }
        if let Some(path) = &args.csv {
            files::write(path, csv.as_bytes(), console)?;
        }
        if !console.json() {
            return Ok(console.result(markdown)?);
        }
        let failed = |e: serde_json::Error| Failure::input(e.to_string());
        let mut object = serde_json::to_value(report).map_err(failed)?;
        object["machine"] = json!(self.machine);
        object["command"] = json!(command());
        Ok(console.result(&format!("{object}\n"))?)
    }
}

/// The moments at which costs are looked at: powers of ten from 10 up to the budget.
fn marks(iterations: u64, time_limit: Option<f64>) -> Vec<Mark> {
    let powers = (1..).map(|k| 10_u64.saturating_pow(k));
    let powers: Vec<u64> = powers.take_while(|&n| n < iterations).collect();
    // The last ones, where the curves part least but figures are wanted most.
    let from = powers.len().saturating_sub(5);
    let mut marks: Vec<Mark> = powers[from..]
        .iter()
        .map(|&n| Mark::Iterations(n))
        .collect();
    marks.push(Mark::Iterations(iterations));
    if let Some(limit) = time_limit {
        let seconds = [0.1, 1.0, 10.0].into_iter().filter(|&s| s < limit);
        marks.extend(seconds.chain([limit]).map(Mark::Seconds));
    }
    marks
}

/// What was typed, so that it can be typed again.
fn command() -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    let quoted = |word: String| {
        if !word.is_empty() && word.chars().all(plain) {
            return word;
        }
        format!("'{}'", word.replace('\'', "'\\''"))
    };
    let words = std::env::args_os().skip(1);
    let words = words.map(|word| quoted(word.to_string_lossy().into_owned()));
    std::iter::once("nngtl".to_owned())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

fn settings(args: &BenchArgs) -> Settings {
    let settings = Settings {
        seed: args.seed,
        iterations: args.iterations,
        y_rand: args.y_rand,
        p_target: args.p_target,
        alpha: args.alpha,
        lead: args.guided.lead,
        p_region: args.guided.p_region,
        corner: args.guided.corner,
        networks_first: args.guided.networks_first,
        ..Settings::default()
    };
    if args.paper_rule {
        settings.paper_rule()
    } else {
        settings
    }
}

fn strategy(name: StrategyName) -> Strategy {
    match name {
        StrategyName::Uniform => Strategy::Uniform,
        StrategyName::Biased => Strategy::Biased,
        StrategyName::Directed => Strategy::Directed,
        StrategyName::Flat => Strategy::Flat,
        StrategyName::Guided => Strategy::Guided,
        StrategyName::Auto => Strategy::Auto,
        StrategyName::Oracle => Strategy::Oracle,
    }
}

/// The networks on each device, if anyone asks them.
fn predictors(args: &BenchArgs, console: &Console) -> Result<Vec<Predictor>, Failure> {
    let mut found: Vec<Predictor> = Vec::new();
    let asks = |name: &StrategyName| matches!(name, StrategyName::Guided | StrategyName::Auto);
    if !args.samplers.iter().any(asks) {
        return Ok(found);
    }
    for &name in &args.device {
        let device = DeviceChoice::from(name);
        let loaded = match &args.model {
            Some(folder) => Predictor::load(folder, device),
            None => Predictor::embedded(device),
        };
        let predictor = loaded.map_err(MissionError::from)?;
        if found.iter().any(|p| p.device() == predictor.device()) {
            console.warn(&format!(
                "device {device} is {} again: left out",
                predictor.device()
            ));
            continue;
        }
        found.push(predictor);
    }
    Ok(found)
}
