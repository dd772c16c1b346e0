//! What the plots show.

use crate::bench::convergence::{Along, curve};
use crate::bench::report::success as steps;
use crate::bench::stats::quantile;
use crate::bench::{Contender, Convergence, Ratio, RatioRow, Report, Strategy, Trial};
use crate::render::chart::{Axis, Chart, Ink, Mark, Panel, Spread};

/// Gaps below this, in percent, are drawn at it.
const LEAST_GAP: f64 = 0.1;

/// Gaps above this, in percent, are drawn at it.
const LARGEST_GAP: f64 = 100.0;

/// Each strategy keeps its colour in every plot; further devices of the guided one get the last ones.
fn ink(contender: &Contender, all: &[Contender]) -> Ink {
    let guided = all.iter().filter(|c| c.strategy == Strategy::Guided);
    let further = guided.clone().position(|c| c == contender).unwrap_or(0);
    Ink(match contender.strategy {
        Strategy::Uniform => 0,
        Strategy::Biased => 1,
        Strategy::Directed => 2,
        Strategy::Flat => 3,
        Strategy::Guided if further == 0 => 4,
        Strategy::Guided => 6 + further,
        Strategy::Oracle => 5,
        Strategy::Auto => 6,
    })
}

fn legend(all: &[Contender]) -> Vec<(String, Ink)> {
    all.iter().map(|c| (c.to_string(), ink(c, all))).collect()
}

/// Those of the contenders that ran, with their runs.
fn runs(report: &Report) -> Vec<(&Contender, Vec<&Trial>)> {
    let contenders = report.comparison.contenders.iter();
    contenders
        .map(|c| {
            (
                c,
                report.trials.iter().filter(|t| t.contender == *c).collect(),
            )
        })
        .filter(|(_, runs): &(_, Vec<_>)| !runs.is_empty())
        .collect()
}

/// Boxes of iterations, product states and length until the first prefix; `None` without runs.
pub(super) fn first_prefixes(report: &Report) -> Option<Chart> {
    let runs = runs(report);
    let all = &report.comparison.contenders;
    let lost = |t: &&Trial| t.prefix.is_none();
    let any_lost = runs.iter().any(|(_, runs)| runs.iter().any(lost));
    let panel = |axis: fn(&str, Vec<f64>) -> Axis,
                 label: &str,
                 names: bool,
                 value: &dyn Fn(&Trial) -> Option<f64>| {
        let mut marks = Vec::new();
        let mut shown = Vec::new();
        for (row, (contender, runs)) in runs.iter().enumerate() {
            let values: Vec<f64> = runs.iter().filter_map(|t| value(t)).collect();
            if let Some(spread) = spread(values) {
                shown.extend(spread.quantiles);
                shown.push(spread.mean);
                marks.push(Mark::Box(row as f64, spread, ink(contender, all)));
            }
        }
        let named = |c: &Contender| if names { c.to_string() } else { String::new() };
        Panel {
            x: axis(label, shown),
            y: Axis::names(runs.iter().map(|(c, _)| named(c)).collect()),
            marks,
        }
    };
    let mut iterations = panel(Axis::log, "iterations", true, &|t| {
        Some(t.iterations_until(t.prefix))
    });
    if any_lost {
        let cap = report.comparison.settings.iterations as f64;
        iterations.marks.push(Mark::Limit(cap, "cap".to_owned()));
    }
    let nodes = panel(Axis::log, "product states", false, &|t| {
        Some(t.nodes_until(t.prefix))
    });
    let length = panel(Axis::linear, "length, map units", false, &|t| {
        Some(t.prefix?.cost)
    });
    (!runs.is_empty()).then(|| Chart {
        title: "Until the first prefix".to_owned(),
        subtitle: format!(
            "{} missions. Boxes: quartiles and median; whiskers: 5 % and 95 %; circles: means. Lengths of the runs that found a prefix.",
            report.missions
        ),
        legend: Vec::new(),
        panels: vec![iterations, nodes, length],
    })
}

fn spread(mut values: Vec<f64>) -> Option<Spread> {
    values.sort_by(f64::total_cmp);
    (!values.is_empty()).then(|| Spread {
        quantiles: [0.05, 0.25, 0.5, 0.75, 0.95].map(|q| quantile(&values, q)),
        mean: crate::bench::mean(&values),
    })
}

/// The share of runs with a plan over iterations and over time; `None` without runs.
pub(super) fn success(report: &Report) -> Option<Chart> {
    let runs = runs(report);
    let all = &report.comparison.contenders;
    let panel = |label: &str, y_label: &str, value: &dyn Fn(&Trial) -> f64| {
        let curves = runs.iter().map(|(contender, runs)| {
            let points = steps(runs, value);
            let points = points.into_iter().map(|[x, share]| [x, 100.0 * share]);
            (ink(contender, all), points.collect::<Vec<_>>())
        });
        let curves: Vec<(Ink, Vec<[f64; 2]>)> = curves.collect();
        let xs = curves
            .iter()
            .flat_map(|(_, points)| points.iter().map(|p| p[0]));
        let x = Axis::log(label, xs);
        let end = x.range[1];
        let marks = curves.into_iter().map(|(ink, mut points)| {
            // What was found by the last run is what was found in the end.
            if let Some(last) = points.last().copied() {
                points.push([end, last[1]]);
            }
            Mark::Line(points, ink)
        });
        Panel {
            marks: marks.collect(),
            x,
            y: Axis::linear(y_label, [0.0, 100.0]).with_unit(" %"),
        }
    };
    let label = "runs with a plan";
    let iterations = panel("iterations", label, &|t| t.iterations_until(t.plan));
    let time = panel("milliseconds, with encoding and networks", "", &|t| {
        1e3 * t.seconds_until(t.plan)
    });
    (!runs.is_empty()).then(|| Chart {
        title: "Runs that have found a plan".to_owned(),
        subtitle: format!(
            "{} missions; runs that end at the cap of {} iterations never count.",
            report.missions, report.comparison.settings.iterations
        ),
        legend: legend(all),
        panels: vec![iterations, time],
    })
}

/// Iterations and time to the first plan as shares of biased sampling's, by group of missions; `None` without
/// anything to compare.
pub(super) fn ratios(report: &Report) -> Option<Chart> {
    let all = &report.comparison.contenders;
    let guided = [
        Strategy::Directed,
        Strategy::Flat,
        Strategy::Guided,
        Strategy::Auto,
        Strategy::Oracle,
    ];
    let shown = |r: &&RatioRow| {
        r.against.strategy == Strategy::Biased && guided.contains(&r.contender.strategy)
    };
    let rows: Vec<&RatioRow> = report.ratios.iter().filter(shown).collect();
    let mut those: Vec<&Contender> = Vec::new();
    for row in &rows {
        if !those.contains(&&row.contender) {
            those.push(&row.contender);
        }
    }
    let names = report
        .groups
        .iter()
        .map(|g| format!("{} ({})", g.name, g.cases.len()));
    let names: Vec<String> = names.collect();
    let blank = vec![String::new(); names.len()];
    let panel = |label: &str, names: Vec<String>, of: fn(&RatioRow) -> Option<Ratio>| {
        let mut marks = vec![Mark::Limit(1.0, "biased".to_owned())];
        let mut ends = vec![1.0];
        for row in &rows {
            let Some(ratio) = of(row) else { continue };
            let group = report.groups.iter().position(|g| g.name == row.group);
            let place = those.iter().position(|c| **c == row.contender).unwrap_or(0);
            // Side by side within a row.
            let aside = (place as f64 + 0.5) / those.len() as f64 - 0.5;
            let height = group.unwrap_or(0) as f64 + 0.7 * aside;
            let interval = [ratio.low, ratio.value, ratio.high];
            ends.extend(interval);
            marks.push(Mark::Interval(height, interval, ink(&row.contender, all)));
        }
        Panel {
            x: Axis::log(label, ends),
            y: Axis::names(names),
            marks,
        }
    };
    (!rows.is_empty()).then(|| Chart {
        title: "As shares of biased sampling".to_owned(),
        subtitle: "Ratios of means until the first plan, with 95 % bootstrap intervals over missions; left of the line is better."
            .to_owned(),
        legend: those.iter().map(|c| (c.to_string(), ink(c, all))).collect(),
        panels: vec![
            panel("iterations", names, |r| r.plan_iterations),
            panel("time, with encoding and networks", blank, |r| r.total),
        ],
    })
}

/// The gap to the exact planner's plan over iterations and time; `None` without searches that found plans.
pub(super) fn costs(costs: &Convergence) -> Option<Chart> {
    let all = &costs.contenders;
    let panel = |label: &str, y_label: &str, along: Along, factor: f64| {
        let curves = all.iter().map(|c| (ink(c, all), curve(costs, c, along)));
        let curves: Vec<(Ink, Vec<[f64; 4]>)> = curves.collect();
        let points = || curves.iter().flat_map(|(_, points)| points);
        let x = Axis::log(label, points().map(|p| factor * p[0]));
        let bands = curves.iter().map(|(ink, points)| {
            let band = points.iter().map(|p| [factor * p[0], p[1], p[3]]);
            Mark::Band(band.collect(), *ink)
        });
        let lines = curves.iter().map(|(ink, points)| {
            let known = points.iter().filter(|p| p[2].is_finite());
            let known = known.map(|p| [factor * p[0], p[2]]);
            // Before its first plan a median comes from above.
            let begin = known.clone().next().map(|[x, _]| [x, f64::MAX]);
            Mark::Line(begin.into_iter().chain(known).collect(), *ink)
        });
        let is_empty = points().next().is_none();
        let panel = Panel {
            marks: bands.chain(lines).collect(),
            x,
            y: Axis::log(y_label, [LEAST_GAP, LARGEST_GAP])
                .with_floor(LEAST_GAP)
                .with_unit(" %"),
        };
        (!is_empty).then_some(panel)
    };
    let label = "gap to the exact planner's plan";
    Some(Chart {
        title: "Cost over time".to_owned(),
        subtitle: format!(
            "{} missions: median (line) and quartiles (band) of how much more the best plan costs; missions without a plan yet count as infinite.",
            costs.references.len()
        ),
        legend: legend(all),
        panels: vec![
            panel("iterations", label, Along::Iterations, 1.0)?,
            panel(
                "milliseconds, with encoding and networks",
                "",
                Along::Seconds,
                1e3,
            )?,
        ],
    })
}
