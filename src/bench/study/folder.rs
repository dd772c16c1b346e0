//! The report of a study: Markdown with plots beside it, every run as CSV and JSON.

use std::fmt::Write as _;

use serde_json::json;

use super::log::{LogError, io_error};
use super::{Findings, Machine, Study, StudyFolder, plots};
use crate::bench::Report;
use crate::plan::write_atomically;

/// The names of a report's files; the plots and tables of costs are there only if costs were followed, and those of
/// first plans only if there were runs until then.
pub const REPORT_FILES: [&str; 8] = [
    "report.md",
    "report.json",
    "trials.csv",
    "costs.csv",
    FIRST,
    SUCCESS,
    RATIOS,
    COSTS,
];

const FIRST: &str = "first-prefixes.svg";
const SUCCESS: &str = "success.svg";
const RATIOS: &str = "ratios.svg";
const COSTS: &str = "costs.svg";

impl StudyFolder {
    /// Writes the report, each file whole or not at all; `command` is what was typed.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(
        &self,
        study: &Study,
        findings: &Findings,
        machine: &Machine,
        command: &str,
    ) -> Result<(), LogError> {
        let put = |name: &str, bytes: &[u8]| {
            let path = self.path.join(name);
            write_atomically(&path, bytes).map_err(io_error(&path))
        };
        let svg = |name: &str, chart: Option<crate::render::chart::Chart>| match chart {
            Some(chart) => put(name, chart.to_svg().as_bytes()),
            None => Ok(()),
        };
        let first = &findings.first;
        if !first.is_unwanted() {
            svg(FIRST, plots::first_prefixes(first))?;
            svg(SUCCESS, plots::success(first))?;
            svg(RATIOS, plots::ratios(first))?;
            put("trials.csv", first.to_csv().as_bytes())?;
        }
        if let Some(costs) = &findings.costs {
            svg(COSTS, plots::costs(costs))?;
            put("costs.csv", costs.to_csv().as_bytes())?;
        }
        let object = json!({
            "version": findings.version,
            "machine": machine,
            "command": command,
            "study": study,
            "findings": findings,
        });
        let mut bytes = serde_json::to_vec(&object)
            .map_err(|e| io_error(&self.path.join("report.json"))(e.into()))?;
        bytes.push(b'\n');
        put("report.json", &bytes)?;
        // Last, so that a report speaks of files that are there.
        let text = markdown(study, findings, machine, command);
        put("report.md", text.as_bytes())
    }
}

fn markdown(study: &Study, findings: &Findings, machine: &Machine, command: &str) -> String {
    let mut text = String::from("# Samplers side by side\n\n");
    if findings.is_partial() {
        let _ = writeln!(
            text,
            "**Interrupted**: {} of {} missions were run. The same command continues from here.\n",
            findings.done, findings.wanted
        );
    }
    let first = Some(&findings.first).filter(|first| !first.is_unwanted());
    match first {
        Some(first) => text.push_str(&first.introduction()),
        None => text.push_str(&costs_alone(study, findings)),
    }
    if findings.without_predictions > 0 {
        let _ = writeln!(
            text,
            "\nOn {} missions the networks said nothing (they do not fit); guided sampling was not run there.",
            findings.without_predictions
        );
    }
    if let Some(first) = first {
        first_plans(&mut text, first);
    }
    if let Some(costs) = findings.costs.as_ref().filter(|c| !c.references.is_empty()) {
        let says = "gap to the exact planner's plan over iterations and time";
        let picture = plots::costs(costs).map(|_| (COSTS, says));
        section(&mut text, "Cost over time", picture, &costs.to_markdown());
    }
    let settings = serde_json::to_string_pretty(study).unwrap_or_default();
    let trials = first.map_or("", |_| "`trials.csv`, ");
    let costs = findings.costs.as_ref().map_or("", |_| "`costs.csv`, ");
    let body = format!(
        "- {}\n- command: `{}`\n- every run: {trials}{costs}`report.json`\n\n```json\n{settings}\n```\n",
        machine.line(),
        command.replace('`', "'"),
    );
    section(&mut text, "Machine and settings", None, &body);
    text
}

/// What was run where there are no runs until the first plan.
fn costs_alone(study: &Study, findings: &Findings) -> String {
    let settings = study.costs.as_ref().map(|costs| &costs.settings);
    let searches = match study.costs.as_ref().map_or(1, |costs| costs.trials) {
        1 => "one search".to_owned(),
        more => format!("{more} searches"),
    };
    let budget = settings.map_or_else(String::new, |s| match s.time_limit {
        Some(limit) => format!(", at most {} iterations and {limit} s", s.iterations),
        None => format!(", at most {} iterations", s.iterations),
    });
    format!(
        "{} missions, {searches} of each sampler{budget}, seed {}.\n",
        findings.done, study.comparison.settings.seed
    )
}

/// The sections of runs until the first plan.
fn first_plans(text: &mut String, first: &Report) {
    let shown = |file: &'static str, says: &'static str, there: bool| there.then_some((file, says));
    let any = !first.rows.is_empty();
    let body = format!("{}\n{}", first.first_prefixes(), Report::published());
    let says = "box plots of iterations, product states and length by sampler";
    section(text, "First prefix", shown(FIRST, says, any), &body);
    let says = "share of runs with a plan over iterations and time";
    let body = first.first_plans();
    section(text, "First plan", shown(SUCCESS, says, any), &body);
    if !first.ratios.is_empty() {
        let says = "ratios of iterations with intervals by group of missions";
        let picture = shown(RATIOS, says, plots::ratios(first).is_some());
        let body = first.ratio_table();
        section(text, "Against biased sampling", picture, &body);
    }
    section(text, "Time", None, &first.split());
}

/// A section with its picture, given by file and what it shows.
fn section(text: &mut String, title: &str, picture: Option<(&str, &str)>, body: &str) {
    let _ = write!(text, "\n## {title}\n\n");
    if let Some((file, says)) = picture {
        let _ = write!(text, "![{says}]({file})\n\n");
    }
    text.push_str(body);
}
