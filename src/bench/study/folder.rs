//! The report of a study: Markdown with plots beside it, every run as CSV and JSON.

use std::fmt::Write as _;

use serde_json::json;

use super::log::{LogError, io_error};
use super::{Findings, Machine, Study, StudyFolder, plots};
use crate::bench::Report;
use crate::plan::write_atomically;

/// The names of a report's files; the plots and tables of costs are there only if costs were followed.
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
        svg(FIRST, plots::first_prefixes(first))?;
        svg(SUCCESS, plots::success(first))?;
        svg(RATIOS, plots::ratios(first))?;
        put("trials.csv", first.to_csv().as_bytes())?;
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
    let first = &findings.first;
    let mut text = String::from("# Samplers side by side\n\n");
    if findings.is_partial() {
        let _ = writeln!(
            text,
            "**Interrupted**: {} of {} missions were run. The same command continues from here.\n",
            first.missions, findings.wanted
        );
    }
    text.push_str(&first.introduction());
    if findings.without_predictions > 0 {
        let _ = writeln!(
            text,
            "\nOn {} missions the networks said nothing (they do not fit); guided sampling was not run there.",
            findings.without_predictions
        );
    }
    let mut section = |title: &str, picture: Option<(&str, &str)>, body: &str| {
        let _ = write!(text, "\n## {title}\n\n");
        if let Some((file, says)) = picture {
            let _ = write!(text, "![{says}]({file})\n\n");
        }
        text.push_str(body);
    };
    let body = format!("{}\n{}", first.first_prefixes(), Report::published());
    let shown = |file: &'static str, says: &'static str, there: bool| there.then_some((file, says));
    section(
        "First prefix",
        shown(
            FIRST,
            "box plots of iterations, product states and length by sampler",
            !first.rows.is_empty(),
        ),
        &body,
    );
    section(
        "First plan",
        shown(
            SUCCESS,
            "share of runs with a plan over iterations and time",
            !first.rows.is_empty(),
        ),
        &first.first_plans(),
    );
    if !first.ratios.is_empty() {
        section(
            "Against biased sampling",
            shown(
                RATIOS,
                "ratios of iterations with intervals by group of missions",
                plots::ratios(first).is_some(),
            ),
            &first.ratio_table(),
        );
    }
    section("Time", None, &first.split());
    if let Some(costs) = findings.costs.as_ref().filter(|c| !c.references.is_empty()) {
        section(
            "Cost over time",
            shown(
                COSTS,
                "gap to the exact planner's plan over iterations and time",
                plots::costs(costs).is_some(),
            ),
            &costs.to_markdown(),
        );
    }
    let settings = serde_json::to_string_pretty(study).unwrap_or_default();
    let body = format!(
        "- {}\n- command: `{}`\n- every run: `trials.csv`, `costs.csv`, `report.json`\n\n```json\n{settings}\n```\n",
        machine.line(),
        command.replace('`', "'"),
    );
    section("Machine and settings", None, &body);
    text
}
