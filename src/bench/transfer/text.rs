//! The tables as Markdown.

use std::fmt::Write as _;

use super::{ChangedTable, ContinuousTable, Table};
use crate::bench::Summary;

/// Milliseconds: median and, in brackets, the 95 % quantile.
fn ms(s: &Summary) -> String {
    format!("{:.3} ({:.3})", 1e3 * s.median, 1e3 * s.p95)
}

/// A cost: the median and, if runs differ, the range.
fn cost(s: &Summary) -> String {
    if s.max - s.min < 5e-4 {
        return format!("{:.3}", s.median);
    }
    format!("{:.3} ({:.3}–{:.3})", s.median, s.min, s.max)
}

impl Table {
    /// Table I with the paper's figures beside ours.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "Library: {} skills, {} pairs of endpoints (paper: 21), built in {:.2} s; laid out for the \
             start in {:.3} ms (median). {} trials, seed {}. Times in ms: median (95 %); paper's times \
             in ms too, on its machine.\n\n",
            self.skills,
            self.pairs,
            self.build_seconds,
            1e3 * self.layout.median,
            self.settings.trials,
            self.settings.seed,
        );
        text.push_str("| task | states | #T | %T | t_Ω | t | t_Ω + t | biased t | J | J anytime | optimum | biased J | paper: #T | %T | t_Ω | t | biased t | J | biased J |\n");
        text.push_str("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for r in &self.rows {
            let p = &r.paper;
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.1} | {} | {} | {} | {} | {} | {} | {:.3} | {} | {} | {} | {:.0} | {:.0} | {:.0} | {:.2} | {:.2} |",
                p.name,
                r.states,
                r.counts.subtasks,
                r.counts.percent(),
                ms(&r.graph),
                ms(&r.first),
                ms(&r.total),
                ms(&r.biased),
                cost(&r.cost),
                cost(&r.anytime_cost),
                r.optimum,
                cost(&r.biased_cost),
                p.subtasks,
                p.percent,
                1e3 * p.graph_seconds,
                1e3 * p.seconds,
                1e3 * p.biased_seconds,
                p.cost,
                p.biased_cost,
            );
        }
        text.push('\n');
        for r in &self.rows {
            let reached = match &r.optimal_after {
                Some(s) => format!(
                    "optimum reached in {} of {} runs after {} ms",
                    r.optimal_runs,
                    self.settings.trials,
                    ms(s)
                ),
                None => "optimum not reached".to_owned(),
            };
            let other = match (&r.other_counts, r.other_states) {
                (Some(c), Some(states)) => format!(
                    "; given automaton: {states} states, #T {}, %T {:.1}",
                    c.subtasks,
                    c.percent()
                ),
                _ => String::new(),
            };
            let _ = writeln!(
                text,
                "- {}: translation {:.1} ms; {reached}; exhaustive search {:.1} ms; known optimum with ltl2ba's automaton {:.2}; published biased code {:.0} ms{other}",
                r.paper.name,
                1e3 * r.translate_seconds,
                1e3 * r.optimum_seconds,
                r.paper.known_optimum,
                1e3 * r.paper.published_biased_seconds,
            );
        }
        text
    }
}

impl ChangedTable {
    /// Table II with the paper's figures beside ours.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "{} environments × {} trials for each row; environments without any plan are left out. Times in ms: median (95 %).\n\n",
            self.settings.environments, self.settings.trials
        );
        text.push_str("| task | m | environments | without plan | repaired | anew | t | verification | biased t | J | biased J | paper: t | biased t |\n");
        text.push_str("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for r in &self.rows {
            let (repair, anew) = r.paper.changed[r.obstacles - 1];
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.0} | {:.0} |",
                r.paper.name,
                r.obstacles,
                r.environments,
                r.infeasible,
                r.repaired,
                r.anew,
                ms(&r.seconds),
                ms(&r.verify_seconds),
                ms(&r.biased),
                cost(&r.cost),
                cost(&r.biased_cost),
                1e3 * repair,
                1e3 * anew,
            );
        }
        text
    }
}

impl ContinuousTable {
    /// The table of the continuous workspace.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "Reference case, λ = 0.5; library of {} skills built in {:.2} s; {} trials of {} s. Times in ms: median (95 %). Without a library: the biased planner beside `uniform`, the guided one beside `guided`.\n\n",
            self.skills, self.build_seconds, self.settings.trials, self.settings.anytime_seconds,
        );
        text.push_str("| mission | sampler | #T | %T | t_Ω | t | J | J anytime | without library: t | J | J anytime |\n");
        text.push_str(
            "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
        );
        for r in &self.rows {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.1} | {} | {} | {} | {} | {} | {} | {} |",
                r.name,
                r.sampler,
                r.counts.subtasks,
                r.counts.percent(),
                ms(&r.graph),
                ms(&r.first),
                cost(&r.cost),
                cost(&r.anytime_cost),
                ms(&r.without),
                cost(&r.without_cost),
                cost(&r.without_anytime_cost),
            );
        }
        text.push('\n');
        let mut last = "";
        for r in &self.rows {
            if r.name != last {
                let _ = writeln!(text, "- {}: `{}`", r.name, r.formula);
                last = r.name;
            }
        }
        if let Some(why) = &self.unguided {
            let _ = writeln!(text, "\nNo guided rows: {why}.");
        }
        text
    }
}
