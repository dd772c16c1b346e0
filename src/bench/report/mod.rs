//! The outcome of a comparison: tables by group of missions, with ratios.

mod curves;
mod text;

use std::collections::BTreeMap;

use serde::Serialize;

use super::groups::{Classes, Group, classes, groups};
use super::stats::{Measured, Ratio, Share, Summary};
use super::{Comparison, Contender, Strategy, Trial};
use crate::planner::First;

pub(super) use curves::success;
pub(super) use text::{cell_or_dash, counted, counted_first, quoted};

/// All trials of a comparison, with what they say.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The report format's version.
    pub version: u32,
    /// What was compared.
    pub comparison: Comparison,
    /// Missions that were run.
    pub missions: usize,
    /// How many of them are simple and how many complex; `None` if uniform sampling was not run.
    pub classes: Option<Classes>,
    /// The missions that are looked at together.
    pub groups: Vec<Group>,
    /// Rows of the tables.
    pub rows: Vec<Row>,
    /// How much of others' effort contenders need.
    pub ratios: Vec<RatioRow>,
    /// Every run.
    pub trials: Vec<Trial>,
}

/// What one contender needed until the first prefix, or until the first plan.
#[derive(Clone, Debug, Serialize)]
pub struct Effort {
    /// Runs that found it.
    pub found: Share,
    /// Milliseconds of encoding, networks and search (T of Table I).
    pub ms: Measured,
    /// Iterations (n).
    pub iterations: Measured,
    /// Product states in the trees (m).
    pub nodes: Measured,
    /// Of the runs that found it: the prefix's length (len), or the plan's total cost.
    pub cost: Option<Summary>,
}

/// What one contender did on one group of missions.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The group's name.
    pub group: String,
    /// The contender.
    #[serde(flatten)]
    pub contender: Contender,
    /// Missions.
    pub missions: usize,
    /// The first prefix: what the paper's Table I counts.
    pub prefix: Effort,
    /// The first plan, prefix and suffix.
    pub plan: Effort,
    /// Milliseconds of translation, encoding, networks, and search until the first plan.
    pub split_ms: [Summary; 4],
}

/// One contender's effort as a share of another's, over the missions that both were run on.
#[derive(Clone, Debug, Serialize)]
pub struct RatioRow {
    /// The group's name.
    pub group: String,
    /// The contender in the numerator.
    #[serde(flatten)]
    pub contender: Contender,
    /// The contender in the denominator.
    pub against: Contender,
    /// Iterations to the first prefix.
    pub prefix_iterations: Option<Ratio>,
    /// Iterations to the first plan.
    pub plan_iterations: Option<Ratio>,
    /// Product states at the first plan.
    pub nodes: Option<Ratio>,
    /// The first prefix's length, over missions where every run of both found one.
    pub length: Option<Ratio>,
    /// Seconds of search to the first plan.
    pub search: Option<Ratio>,
    /// Seconds of search, encoding and networks.
    pub total: Option<Ratio>,
}

impl Report {
    /// Sums trials up. Missions for which uniform sampling needs `complex_from` iterations or more in the median are
    /// complex.
    #[must_use]
    pub fn new(comparison: Comparison, complex_from: u64, trials: Vec<Trial>) -> Self {
        let divided = classes(&trials, complex_from);
        let missions = trials
            .iter()
            .map(|t| (t.case.as_str(), t.family.as_deref()));
        let groups = groups(missions, divided.as_ref().map(|(_, groups)| groups));
        let mut rows = Vec::new();
        let mut ratios = Vec::new();
        for group in &groups {
            let inside = trials.iter().filter(|t| group.cases.contains(&t.case));
            let inside: Vec<&Trial> = inside.collect();
            for contender in &comparison.contenders {
                rows.extend(row(&group.name, contender, &inside));
                for against in comparison.contenders.iter() {
                    if is_compared(contender, against) {
                        let row = ratio_row(&group.name, contender, against, &inside);
                        ratios.extend(row.plan_iterations.is_some().then_some(row));
                    }
                }
            }
        }
        Self {
            version: 2,
            missions: groups[0].cases.len(),
            comparison,
            classes: divided.map(|(classes, _)| classes),
            groups,
            rows,
            ratios,
            trials,
        }
    }

    /// Whether no run was asked for, as where costs alone are followed.
    #[must_use]
    pub fn is_unwanted(&self) -> bool {
        self.comparison.trials == 0
    }
}

/// Whether a ratio is worth a row: everything is compared with biased sampling, and the networks with
/// the same rules without them.
fn is_compared(contender: &Contender, against: &Contender) -> bool {
    let rules = [Strategy::Directed, Strategy::Flat];
    match (contender.strategy, against.strategy) {
        (Strategy::Biased, _) => false,
        (_, Strategy::Biased) => true,
        (Strategy::Guided | Strategy::Auto | Strategy::Oracle, other) => rules.contains(&other),
        _ => false,
    }
}

fn row(group: &str, contender: &Contender, trials: &[&Trial]) -> Option<Row> {
    let mine = trials.iter().filter(|t| t.contender == *contender);
    let mine: Vec<&Trial> = mine.copied().collect();
    let mut names: Vec<&str> = mine.iter().map(|t| t.case.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let ms = |value: &dyn Fn(&Trial) -> f64| {
        let all: Vec<f64> = mine.iter().map(|t| 1e3 * value(t)).collect();
        Summary::of(&all)
    };
    Some(Row {
        group: group.to_owned(),
        contender: contender.clone(),
        missions: names.len(),
        prefix: effort(&mine, |t| t.prefix)?,
        plan: effort(&mine, |t| t.plan)?,
        split_ms: [
            ms(&|t| t.times.translate)?,
            ms(&|t| t.times.encode)?,
            ms(&|t| t.times.infer)?,
            ms(&|t| t.search_until(t.plan))?,
        ],
    })
}

/// What runs needed until they found something; `None` of no runs.
fn effort(runs: &[&Trial], found: impl Fn(&Trial) -> Option<First>) -> Option<Effort> {
    let measured = |value: &dyn Fn(&Trial, Option<First>) -> f64| {
        let pair = |t: &&Trial| (value(t, found(t)), found(t).is_none());
        Measured::of(&runs.iter().map(pair).collect::<Vec<_>>())
    };
    let costs: Vec<f64> = runs.iter().filter_map(|t| Some(found(t)?.cost)).collect();
    Some(Effort {
        found: Share::new(costs.len(), runs.len()),
        ms: measured(&|t, found| 1e3 * t.seconds_until(found))?,
        iterations: measured(&Trial::iterations_until)?,
        nodes: measured(&Trial::nodes_until)?,
        cost: Summary::of(&costs),
    })
}

fn ratio_row(
    group: &str,
    contender: &Contender,
    against: &Contender,
    trials: &[&Trial],
) -> RatioRow {
    // Means over each mission's runs of both; what belongs to one mission is resampled together.
    let ratio = |found: fn(&Trial) -> Option<First>, value: fn(&Trial, Option<First>) -> f64| {
        let mut sums: BTreeMap<&str, [(f64, u32, bool); 2]> = BTreeMap::new();
        for t in trials {
            let side = match &t.contender {
                c if c == contender => 0,
                c if c == against => 1,
                _ => continue,
            };
            let entry = &mut sums.entry(t.case.as_str()).or_default()[side];
            let found = found(t);
            let capped = entry.2 || found.is_none();
            *entry = (entry.0 + value(t, found), entry.1 + 1, capped);
        }
        sums.retain(|_, [a, b]| a.1 > 0 && b.1 > 0 && a.0.is_finite() && b.0.is_finite());
        let pairs: Vec<(f64, f64)> = sums
            .values()
            .map(|[a, b]| (a.0 / f64::from(a.1), b.0 / f64::from(b.1)))
            .collect();
        let capped = [0, 1].map(|side| sums.values().any(|pair| pair[side].2));
        Some(Ratio::of_means(&pairs)?.with_capped(capped))
    };
    fn prefix(trial: &Trial) -> Option<First> {
        trial.prefix
    }
    fn plan(trial: &Trial) -> Option<First> {
        trial.plan
    }
    RatioRow {
        group: group.to_owned(),
        contender: contender.clone(),
        against: against.clone(),
        prefix_iterations: ratio(prefix, Trial::iterations_until),
        plan_iterations: ratio(plan, Trial::iterations_until),
        nodes: ratio(plan, Trial::nodes_until),
        length: ratio(prefix, |_, found| found.map_or(f64::NAN, |f| f.cost)),
        search: ratio(plan, Trial::search_until),
        total: ratio(plan, Trial::seconds_until),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::bench::Times;
    use crate::planner::Settings;

    const CAP: u64 = 20_000;

    /// A run that found prefix and plan after so many iterations, or nothing.
    pub(in crate::bench) fn trial(
        case: &str,
        family: Option<&str>,
        strategy: Strategy,
        iterations: Option<u64>,
    ) -> Trial {
        let first = iterations.map(|n| First {
            iterations: n,
            nodes: 2 * n,
            seconds: 1e-5 * n as f64,
            cost: 1.0 + 1e-4 * n as f64,
        });
        Trial {
            case: case.to_owned(),
            family: family.map(str::to_owned),
            contender: strategy.into(),
            seed: 0,
            prefix: first,
            plan: first,
            cap: CAP,
            nodes: 2 * iterations.unwrap_or(CAP),
            times: Times {
                translate: 0.001,
                encode: 0.0005,
                infer: 0.002,
                search: 1e-5 * iterations.unwrap_or(CAP) as f64,
            },
            networks_after: 0,
        }
    }

    pub(in crate::bench) fn comparison(strategies: &[Strategy]) -> Comparison {
        Comparison {
            contenders: strategies.iter().map(|&s| s.into()).collect(),
            trials: 1,
            settings: Settings {
                iterations: CAP,
                ..Settings::default()
            },
        }
    }

    const BOTH: [Strategy; 2] = [Strategy::Uniform, Strategy::Biased];

    /// Missions `m0`, `m1`, … for which uniform sampling needs these iterations, biased a tenth.
    fn report(uniform: &[Option<u64>], complex_from: u64) -> Report {
        let runs = uniform.iter().enumerate().flat_map(|(k, &n)| {
            let (case, family) = (format!("m{k}"), ["paper", "mazes"][k % 2]);
            let biased = n.map_or(CAP / 10, |n| n / 10);
            [
                trial(&case, Some(family), Strategy::Uniform, n),
                trial(&case, Some(family), Strategy::Biased, Some(biased)),
            ]
        });
        Report::new(comparison(&BOTH), complex_from, runs.collect())
    }

    #[test]
    fn the_time_of_networks_counts_from_when_they_are_asked() {
        for (after, iterations, networks) in [(0, 1, 2.5), (100, 100, 0.0), (100, 101, 2.5)] {
            let mut trial = trial("m", None, Strategy::Guided, Some(iterations));
            trial.networks_after = after;
            let whole = 1e3 * trial.seconds_until(trial.plan);
            assert!((whole - networks - 0.01 * iterations as f64).abs() < 1e-9);
        }
    }

    #[test]
    fn missions_are_divided_by_what_uniform_sampling_needs() {
        let report = report(&[Some(100), Some(3_990), Some(4_000), None], 4_000);
        let classes = report.classes.unwrap();
        assert_eq!((classes.simple, classes.complex), (2, 2));
        let names: Vec<&str> = report.groups.iter().map(|g| g.name.as_str()).collect();
        assert_eq!(names, ["all", "simple", "complex", "mazes", "paper"]);
        let find = |group: &str, strategy: Strategy| {
            let found = |r: &&Row| r.group == group && r.contender.strategy == strategy;
            report.rows.iter().find(found).unwrap().clone()
        };
        let simple = find("simple", Strategy::Uniform);
        assert_eq!(simple.prefix.iterations.summary.mean, 2_045.0);
        let complex = find("complex", Strategy::Uniform);
        // One of two runs ended at the cap, and counts there.
        assert_eq!(complex.prefix.iterations.summary.mean, 12_000.0);
        assert_eq!(complex.prefix.iterations.capped, 1);
        assert_eq!((complex.plan.found.hits, complex.plan.found.of), (1, 2));
        assert_eq!(complex.prefix.cost.unwrap().count, 1);
        // The threshold can be set, and then the classes are others.
        let other = report_classes(&[Some(100), Some(3_990)], 200);
        assert_eq!((other.simple, other.complex), (1, 1));
    }

    fn report_classes(uniform: &[Option<u64>], complex_from: u64) -> Classes {
        report(uniform, complex_from).classes.unwrap()
    }

    #[test]
    fn an_empty_class_is_told_in_one_line_and_has_no_rows() {
        let report = report(&[Some(100), Some(900)], 4_000);
        let text = report.to_markdown();
        let told = text.lines().filter(|l| l.contains("2 simple, 0 complex"));
        assert_eq!(told.count(), 1, "{text}");
        assert!(text.contains("No mission is complex"), "{text}");
        assert!(
            report
                .rows
                .iter()
                .all(|r| !["simple", "complex"].contains(&r.group.as_str()))
        );
        // Without uniform sampling nothing is said of classes.
        let biased = vec![trial("m", None, Strategy::Biased, Some(5))];
        let report = Report::new(comparison(&[Strategy::Biased]), 4_000, biased);
        assert!(report.classes.is_none());
        assert!(
            report
                .to_markdown()
                .contains("uniform sampling was not run")
        );
    }

    #[test]
    fn ratios_are_of_the_missions_that_both_ran_on_and_count_caps() {
        let strategies = [Strategy::Biased, Strategy::Directed, Strategy::Guided];
        let mut runs = Vec::new();
        for (k, n) in [100, 300].into_iter().enumerate() {
            let case = format!("m{k}");
            runs.push(trial(&case, None, Strategy::Biased, Some(n)));
            runs.push(trial(&case, None, Strategy::Directed, Some(n / 2)));
        }
        runs.push(trial("m0", None, Strategy::Guided, Some(25)));
        runs.push(trial("m2", None, Strategy::Biased, None));
        runs.push(trial("m2", None, Strategy::Directed, Some(400)));
        let report = Report::new(comparison(&strategies), 4_000, runs);
        let ratio = |of: Strategy, against: Strategy| {
            let found = |r: &&RatioRow| r.contender.strategy == of && r.against.strategy == against;
            report.ratios.iter().find(found).unwrap().clone()
        };
        let guided = ratio(Strategy::Guided, Strategy::Biased);
        assert_eq!(guided.plan_iterations.unwrap().value, 0.25);
        let directed = ratio(Strategy::Directed, Strategy::Biased);
        assert!((directed.plan_iterations.unwrap().value - 600.0 / 20_400.0).abs() < 1e-12);
        // A length that nobody knows is not compared.
        let lengths = (1.005 + 1.015) / (1.01 + 1.03);
        assert!((directed.length.unwrap().value - lengths).abs() < 1e-12);
        assert!(ratio(Strategy::Guided, Strategy::Directed).nodes.is_some());
        assert!(
            !report
                .ratios
                .iter()
                .any(|r| r.contender.strategy == Strategy::Biased)
        );
    }

    #[test]
    fn tables_of_no_missions_and_quoted_names_are_sound() {
        let empty = Report::new(comparison(&BOTH), 4_000, Vec::new());
        assert!(empty.rows.is_empty() && empty.to_markdown().contains("0 missions"));
        let odd = vec![trial("a,\"b\"", None, Strategy::Uniform, None)];
        let csv = Report::new(comparison(&BOTH), 4_000, odd).to_csv();
        assert!(
            csv.lines()
                .nth(1)
                .unwrap()
                .starts_with("\"a,\"\"b\"\"\",,uniform,"),
            "{csv}"
        );
        let fields = csv.lines().next().unwrap().split(',').count();
        assert_eq!(fields, csv.lines().nth(1).unwrap().split(',').count() - 1);
    }
}
