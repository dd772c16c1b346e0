//! The outcome of a comparison as Markdown, CSV and JSON.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use super::stats::{Ratio, Summary};
use super::{Comparison, Strategy, Trial};

/// Missions that uniform sampling needs this many iterations for (in the median) are complex
/// (`nngtl.md`, V-B, by iterations instead of seconds).
const COMPLEX: f64 = 4_000.0;

/// All trials of a comparison, with what they say.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The report format's version.
    pub version: u32,
    /// What was compared.
    pub comparison: Comparison,
    /// Missions that were run.
    pub missions: usize,
    /// Rows of the table.
    pub rows: Vec<Row>,
    /// Ratios of guided to the others, where both were run.
    pub ratios: Vec<RatioRow>,
    /// Every run.
    pub trials: Vec<Trial>,
}

/// What one strategy did on one class of missions.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// `all`, or `simple` and `complex` where uniform sampling was run too.
    pub class: &'static str,
    /// The strategy.
    pub strategy: Strategy,
    /// Missions.
    pub missions: usize,
    /// Runs that found a plan.
    pub solved: usize,
    /// Iterations to the first prefix (n of Table I).
    pub prefix_iterations: Option<Summary>,
    /// Iterations to the first plan.
    pub plan_iterations: Option<Summary>,
    /// Product states at the end (m of Table I).
    pub nodes: Option<Summary>,
    /// Length of the first prefix (len of Table I).
    pub prefix_length: Option<Summary>,
    /// Total cost of the first plan.
    pub cost: Option<Summary>,
    /// Milliseconds of search.
    pub search_ms: Option<Summary>,
    /// Milliseconds of search, encoding and inference (T of Table I).
    pub total_ms: Option<Summary>,
}

/// Guided compared with another strategy over the missions that both were run on.
#[derive(Clone, Debug, Serialize)]
pub struct RatioRow {
    /// The class of missions.
    pub class: &'static str,
    /// The strategy in the denominator.
    pub against: Strategy,
    /// Iterations to the first prefix.
    pub prefix_iterations: Option<Ratio>,
    /// Iterations to the first plan.
    pub plan_iterations: Option<Ratio>,
    /// Product states.
    pub nodes: Option<Ratio>,
    /// Seconds of search.
    pub search: Option<Ratio>,
    /// Seconds of search, encoding and inference.
    pub total: Option<Ratio>,
}

impl Report {
    pub(super) fn new(comparison: Comparison, missions: usize, trials: Vec<Trial>) -> Self {
        let mut classes = vec![("all", trials.iter().collect::<Vec<_>>())];
        if comparison.strategies.contains(&Strategy::Uniform) {
            let complex = complex_missions(&trials);
            let is_complex = |t: &&Trial| complex.contains(&t.case.as_str());
            let (hard, easy): (Vec<&Trial>, Vec<&Trial>) = trials.iter().partition(is_complex);
            // A class of all missions says nothing new.
            if !hard.is_empty() && !easy.is_empty() {
                classes.extend([("simple", easy), ("complex", hard)]);
            }
        }
        let mut rows = Vec::new();
        let mut ratios = Vec::new();
        for (class, trials) in &classes {
            for &strategy in &comparison.strategies {
                rows.push(row(class, strategy, trials));
                if strategy != Strategy::Guided && comparison.strategies.contains(&Strategy::Guided)
                {
                    ratios.push(ratio_row(class, strategy, trials));
                }
            }
        }
        Self {
            version: 1,
            comparison,
            missions,
            rows,
            ratios,
            trials,
        }
    }

    /// The tables as Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "{} missions, {} trials each, cap {} iterations, seed {}. Means, with medians in brackets.\n\n",
            self.missions,
            self.comparison.trials,
            self.comparison.settings.iterations,
            self.comparison.settings.seed,
        );
        if self.comparison.strategies.contains(&Strategy::Uniform)
            && self.rows.iter().all(|r| r.class == "all")
        {
            let _ = write!(
                text,
                "Simple and complex are not told apart: uniform sampling needs at least {COMPLEX} iterations to the first prefix (in the \
                 median) for either all missions or none.\n\n",
            );
        }
        text.push_str("| class | sampler | solved | iterations to first prefix | to first plan | nodes | prefix length | cost | search ms | with inference ms |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for r in &self.rows {
            let cell = |s: &Option<Summary>, digits: usize| match s {
                Some(s) => format!("{:.digits$} ({:.digits$})", s.mean, s.median),
                None => "–".to_owned(),
            };
            let runs = r.plan_iterations.map_or(0, |s| s.count);
            let _ = writeln!(
                text,
                "| {} | {} | {}/{runs} | {} | {} | {} | {} | {} | {} | {} |",
                r.class,
                r.strategy.name(),
                r.solved,
                cell(&r.prefix_iterations, 1),
                cell(&r.plan_iterations, 1),
                cell(&r.nodes, 1),
                cell(&r.prefix_length, 4),
                cell(&r.cost, 4),
                cell(&r.search_ms, 3),
                cell(&r.total_ms, 3),
            );
        }
        if !self.ratios.is_empty() {
            text.push_str("\nRatios of means, guided over the other, with 95 % bootstrap intervals over missions.\n\n");
            text.push_str("| class | against | iterations to first prefix | to first plan | nodes | search time | with inference |\n");
            text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: |\n");
        }
        for r in &self.ratios {
            let cell = |x: &Option<Ratio>| x.map_or("–".to_owned(), |x| x.to_string());
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} |",
                r.class,
                r.against.name(),
                cell(&r.prefix_iterations),
                cell(&r.plan_iterations),
                cell(&r.nodes),
                cell(&r.search),
                cell(&r.total),
            );
        }
        text
    }

    /// Every run as a line of comma-separated values, with a header.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "case,strategy,seed,solved,prefix_iterations,plan_iterations,nodes,prefix_length,cost,search_seconds,inference_seconds\n",
        );
        let number = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        for t in &self.trials {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{}",
                quoted(&t.case),
                t.strategy.name(),
                t.seed,
                t.solved,
                t.prefix_iterations,
                t.plan_iterations,
                t.nodes,
                number(t.prefix_length),
                number(t.cost),
                t.search_seconds,
                t.inference_seconds,
            );
        }
        text
    }
}

/// A CSV field; quoted if it needs to be.
pub(super) fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", field.replace('"', "\"\""));
    }
    field.to_owned()
}

/// The missions for which uniform sampling's median is at the threshold or above.
fn complex_missions(trials: &[Trial]) -> Vec<&str> {
    let mut uniform: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.strategy == Strategy::Uniform) {
        let runs = uniform.entry(t.case.as_str()).or_default();
        runs.push(t.prefix_iterations as f64);
    }
    let median = |runs: &[f64]| Summary::of(runs).map_or(0.0, |s| s.median);
    uniform
        .into_iter()
        .filter(|(_, runs)| median(runs) >= COMPLEX)
        .map(|(case, _)| case)
        .collect()
}

fn row(class: &'static str, strategy: Strategy, trials: &[&Trial]) -> Row {
    let mine: Vec<&Trial> = trials
        .iter()
        .copied()
        .filter(|t| t.strategy == strategy)
        .collect();
    let all = |value: &dyn Fn(&Trial) -> f64| {
        Summary::of(&mine.iter().map(|t| value(t)).collect::<Vec<_>>())
    };
    let some = |value: &dyn Fn(&Trial) -> Option<f64>| {
        Summary::of(&mine.iter().filter_map(|t| value(t)).collect::<Vec<_>>())
    };
    let mut names: Vec<&str> = mine.iter().map(|t| t.case.as_str()).collect();
    names.dedup();
    Row {
        class,
        strategy,
        missions: names.len(),
        solved: mine.iter().filter(|t| t.solved).count(),
        prefix_iterations: all(&|t| t.prefix_iterations as f64),
        plan_iterations: all(&|t| t.plan_iterations as f64),
        nodes: all(&|t| t.nodes as f64),
        prefix_length: some(&|t| t.prefix_length),
        cost: some(&|t| t.cost),
        search_ms: all(&|t| 1e3 * t.search_seconds),
        total_ms: all(&|t| 1e3 * (t.search_seconds + t.inference_seconds)),
    }
}

fn ratio_row(class: &'static str, against: Strategy, trials: &[&Trial]) -> RatioRow {
    let ratio = |value: &dyn Fn(&Trial) -> f64| {
        let mut sums: BTreeMap<&str, [(f64, u32); 2]> = BTreeMap::new();
        for t in trials {
            let side = match t.strategy {
                Strategy::Guided => 0,
                s if s == against => 1,
                _ => continue,
            };
            let entry = &mut sums.entry(t.case.as_str()).or_default()[side];
            *entry = (entry.0 + value(t), entry.1 + 1);
        }
        let pairs: Vec<(f64, f64)> = sums
            .values()
            .filter(|[g, o]| g.1 > 0 && o.1 > 0)
            .map(|[g, o]| (g.0 / f64::from(g.1), o.0 / f64::from(o.1)))
            .collect();
        Ratio::of_means(&pairs)
    };
    RatioRow {
        class,
        against,
        prefix_iterations: ratio(&|t| t.prefix_iterations as f64),
        plan_iterations: ratio(&|t| t.plan_iterations as f64),
        nodes: ratio(&|t| t.nodes as f64),
        search: ratio(&|t| t.search_seconds),
        total: ratio(&|t| t.search_seconds + t.inference_seconds),
    }
}
