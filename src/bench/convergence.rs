//! How near samplers come to the optimum: the gap to the exact planner's plan after so many iterations
//! and so much time.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Instant;

use serde::Serialize;

use super::stats::{Ratio, mean};
use super::{BenchError, Case, Strategy, sampler};
use crate::exact;
use crate::planner::{Improvement, PlanError, Problem, Settings, Solution, Stop, plan};
use crate::verify::verify;

/// A moment of a search at which its best plan is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// After so many iterations.
    Iterations(u64),
    /// After so many seconds.
    Seconds(f64),
}

impl Mark {
    /// The best cost at this moment.
    fn cost(self, improvements: &[Improvement]) -> Option<f64> {
        let before = |i: &&Improvement| match self {
            Self::Iterations(n) => i.iterations <= n,
            Self::Seconds(s) => i.seconds <= s,
        };
        improvements
            .iter()
            .take_while(before)
            .last()
            .map(|i| i.cost)
    }

    fn name(self) -> String {
        match self {
            Self::Iterations(n) => format!("{n} iterations"),
            Self::Seconds(s) => format!("{s} s"),
        }
    }
}

/// What the exact planner says about a mission.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    /// The mission's name.
    pub case: String,
    /// The cost of the exact planner's plan.
    pub upper: f64,
    /// What every plan costs at least, if that was asked for.
    pub lower: Option<f64>,
    /// Seconds that the plan took.
    pub seconds: f64,
    /// Seconds that the lower bound took.
    pub bound_seconds: f64,
    /// What every plan costs at least, as soon as that can be said.
    pub quick: f64,
    /// Seconds that took.
    pub quick_seconds: f64,
}

/// How near to the exact planner's plan counts as there.
pub(super) const NEAR: [f64; 2] = [0.05, 0.01];

/// The costs of one search.
#[derive(Clone, Debug, Serialize)]
pub struct Descent {
    /// The mission's name.
    pub case: String,
    /// The strategy.
    pub strategy: Strategy,
    /// The best cost at each mark, if there was a plan.
    pub costs: Vec<Option<f64>>,
    /// For 5 % and for 1 %: after how many iterations and seconds the best plan cost at most that much
    /// more than the exact planner's; `None` if it never did.
    pub reached: [Option<(u64, f64)>; NEAR.len()],
    /// Iterations of the whole search.
    pub iterations: u64,
    /// Seconds of the whole search.
    pub seconds: f64,
    /// Seconds of encoding and inference before it, for the guided strategy.
    pub inference_seconds: f64,
    /// Whether the checker accepted the last plan; `None` without a plan, or without a formula to
    /// check it by.
    pub verified: Option<bool>,
}

/// Costs over time of samplers, with bounds on the optimum.
#[derive(Clone, Debug, Serialize)]
pub struct Convergence {
    /// The report format's version.
    pub version: u32,
    /// The moments looked at.
    pub marks: Vec<Mark>,
    /// The strategies, in the order of the report.
    pub strategies: Vec<Strategy>,
    /// Settings of every search.
    pub settings: Settings,
    /// Bounds by mission.
    pub references: Vec<Reference>,
    /// Every search.
    pub descents: Vec<Descent>,
}

/// Searches every mission that the exact planner solves with every strategy until the last mark; with
/// `bounds`, certified lower bounds are computed too, which takes seconds a mission.
///
/// # Errors
/// As [`compare`](super::compare).
pub fn converge(
    cases: &[Case],
    strategies: &[Strategy],
    settings: &Settings,
    marks: &[Mark],
    bounds: bool,
    stop: &Stop,
    progress: &mut dyn FnMut(usize),
) -> Result<Convergence, BenchError> {
    let mut all = Convergence {
        version: 1,
        marks: marks.to_vec(),
        strategies: strategies.to_vec(),
        settings: settings.clone(),
        references: Vec::new(),
        descents: Vec::new(),
    };
    for (done, case) in cases.iter().enumerate() {
        if stop.is_raised() {
            break;
        }
        if let Some(reference) = reference(case, bounds) {
            for &strategy in strategies {
                if let Some(descent) =
                    descend(case, strategy, settings, marks, reference.upper, stop)?
                {
                    all.descents.push(descent);
                }
            }
            all.references.push(reference);
        }
        progress(done + 1);
    }
    Ok(all)
}

fn reference(case: &Case, bounds: bool) -> Option<Reference> {
    let problem = &case.problem;
    let map = problem.system.plane()?;
    let began = Instant::now();
    let plan = exact::plan(map, problem.start.at, &problem.task, problem.weight).ok()?;
    let seconds = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let upper = plan.cost.total;
    let (start, task, weight) = (problem.start.at, &problem.task, problem.weight);
    let lower = bounds.then(|| exact::lower_bound(map, start, task, weight, upper));
    let bound_seconds = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let quick = exact::quick_bound(map, start, task, weight, upper);
    Some(Reference {
        case: case.name.clone(),
        upper,
        lower,
        seconds,
        bound_seconds,
        quick,
        quick_seconds: began.elapsed().as_secs_f64(),
    })
}

fn descend(
    case: &Case,
    strategy: Strategy,
    settings: &Settings,
    marks: &[Mark],
    upper: f64,
    stop: &Stop,
) -> Result<Option<Descent>, BenchError> {
    let Some(sampler) = sampler(case, strategy)? else {
        return Ok(None);
    };
    let found = plan(&case.problem, &sampler, settings, stop, &mut |_| {});
    let mut verified = None;
    let stats = match found {
        Ok(solution) => {
            verified = check(&case.problem, &solution);
            solution.stats
        }
        Err(PlanError::NotFound(why)) => why.stats,
        Err(source) => {
            return Err(BenchError::Plan {
                case: case.name.clone(),
                source: Box::new(source),
            });
        }
    };
    Ok(Some(Descent {
        case: case.name.clone(),
        strategy,
        costs: marks.iter().map(|m| m.cost(&stats.improvements)).collect(),
        reached: NEAR.map(|share| {
            let there = |i: &&Improvement| gap(i.cost, upper) <= share;
            let first = stats.improvements.iter().find(there)?;
            Some((first.iterations, first.seconds))
        }),
        iterations: stats.iterations,
        seconds: stats.seconds,
        inference_seconds: match strategy {
            Strategy::Guided => case.inference_seconds,
            _ => 0.0,
        },
        verified,
    }))
}

/// Whether the checker accepts a plan.
fn check(problem: &Problem, found: &Solution) -> Option<bool> {
    let (map, formula) = (problem.system.plane()?, problem.task.formula.as_ref()?);
    let (start, weight) = (problem.start.at, problem.weight);
    let judged = verify(map, start, formula, &found.path, weight, Some(&found.cost));
    Some(judged.is_ok())
}

/// What a search took to come near the exact planner's plan.
struct Spent {
    iterations: f64,
    /// With inference.
    milliseconds: f64,
    never: bool,
}

/// How much of `base` a cost lies above it; both may be 0.
fn gap(cost: f64, base: f64) -> f64 {
    (cost - base) / base.abs().max(1e-6)
}

impl Convergence {
    /// The gaps of a strategy's plans to the exact planner's at a mark, and how many had no plan.
    #[must_use]
    pub fn gaps(&self, strategy: Strategy, mark: usize) -> (Vec<f64>, usize) {
        let upper = |case: &str| {
            self.references
                .iter()
                .find(|r| r.case == case)
                .map(|r| r.upper)
        };
        let mine = self.descents.iter().filter(|d| d.strategy == strategy);
        let mut missing = 0;
        let gaps = mine.filter_map(|d| {
            missing += usize::from(d.costs[mark].is_none());
            Some(gap(d.costs[mark]?, upper(&d.case)?))
        });
        let gaps = gaps.collect();
        (gaps, missing)
    }

    /// The tables as Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let all = &self.references;
        let of = |value: fn(&Reference) -> f64| all.iter().map(value).collect::<Vec<f64>>();
        let gaps = |lower: fn(&Reference) -> Option<f64>| {
            let gaps: Vec<f64> = all
                .iter()
                .filter_map(|r| Some(gap(r.upper, lower(r)?)))
                .collect();
            let largest = gaps.iter().copied().fold(0.0, f64::max);
            let [largest, middle, mean] = [largest, quantile(&gaps, 0.5), mean(&gaps)].map(percent);
            format!("{largest} more than the optimum (mean {mean}, median {middle})")
        };
        let time = |seconds: Vec<f64>| {
            let [mean, middle] = [mean(&seconds), quantile(&seconds, 0.5)].map(|s| 1e3 * s);
            format!("{mean:.1} ms on average (median {middle:.1} ms)")
        };
        let mut text = format!(
            "{} missions that the exact planner solves. Its plans take {}. They cost at most {} by lower \
             bounds without refinement, which take {}",
            all.len(),
            time(of(|r| r.seconds)),
            gaps(|r| Some(r.quick)),
            time(of(|r| r.quick_seconds)),
        );
        if all.iter().any(|r| r.lower.is_some()) {
            let _ = write!(
                text,
                "; by refined ones at most {}, which take {}",
                gaps(|r| r.lower),
                time(of(|r| r.bound_seconds)),
            );
        }
        let refused = self.descents.iter().filter(|d| d.verified == Some(false));
        let checked = self.descents.iter().filter(|d| d.verified.is_some());
        let _ = writeln!(
            text,
            ".\n\nThe checker refused {} of {} plans that the samplers ended with.\n",
            refused.count(),
            checked.count()
        );
        text.push_str(
            "Gap of each sampler's best plan to the exact planner's (negative: better).\n\n",
        );
        text.push_str("| sampler | after | no plan | mean gap | median | 90 % | largest | within 1 % | within 0.1 % |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for &strategy in &self.strategies {
            for (k, mark) in self.marks.iter().enumerate() {
                let (gaps, missing) = self.gaps(strategy, k);
                let within = |limit: f64| gaps.iter().filter(|&&g| g <= limit).count();
                let _ = writeln!(
                    text,
                    "| {} | {} | {missing} | {} | {} | {} | {} | {} | {} |",
                    strategy.name(),
                    mark.name(),
                    percent(mean(&gaps)),
                    percent(quantile(&gaps, 0.5)),
                    percent(quantile(&gaps, 0.9)),
                    percent(gaps.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
                    within(0.01),
                    within(0.001),
                );
            }
        }
        self.write_reached(&mut text);
        text
    }

    /// The table of iterations and seconds until plans are near the exact planner's.
    fn write_reached(&self, text: &mut String) {
        text.push_str(
            "\nUntil the best plan costs at most so much more than the exact planner's; a search that never gets there \
             counts with all that it spent. Means, with medians in brackets; ratios of means to biased with 95 % \
             bootstrap intervals over missions.\n\n",
        );
        text.push_str("| sampler | within | never | iterations | ms | iterations ÷ biased | time ÷ biased |\n");
        text.push_str("| --- | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for (k, share) in NEAR.iter().enumerate() {
            for &strategy in &self.strategies {
                let mine = self.spent(strategy, k);
                let never = mine.values().filter(|s| s.never).count();
                let cell = |value: fn(&Spent) -> f64, digits: usize| {
                    let all: Vec<f64> = mine.values().map(value).collect();
                    format!("{:.digits$} ({:.digits$})", mean(&all), quantile(&all, 0.5))
                };
                let against = self.spent(Strategy::Biased, k);
                let ratio = |value: fn(&Spent) -> f64| {
                    let pairs: Vec<(f64, f64)> = mine
                        .iter()
                        .filter_map(|(case, s)| Some((value(s), value(against.get(case)?))))
                        .collect();
                    Ratio::of_means(&pairs).map_or("–".to_owned(), |r| r.to_string())
                };
                let _ = writeln!(
                    text,
                    "| {} | {} % | {never} of {} | {} | {} | {} | {} |",
                    strategy.name(),
                    100.0 * share,
                    mine.len(),
                    cell(|s| s.iterations, 0),
                    cell(|s| s.milliseconds, 2),
                    ratio(|s| s.iterations),
                    ratio(|s| s.milliseconds),
                );
            }
        }
    }

    /// What each mission's search spent until the share number `k` of [`NEAR`], by mission.
    fn spent(&self, strategy: Strategy, k: usize) -> BTreeMap<&str, Spent> {
        let mine = self.descents.iter().filter(|d| d.strategy == strategy);
        mine.map(|d| {
            let (iterations, seconds) = d.reached[k].unwrap_or((d.iterations, d.seconds));
            let spent = Spent {
                iterations: iterations as f64,
                milliseconds: 1e3 * (seconds + d.inference_seconds),
                never: d.reached[k].is_none(),
            };
            (d.case.as_str(), spent)
        })
        .collect()
    }

    /// Every search as a line of comma-separated values, with a header: costs at the marks beside the
    /// bounds.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from("case,strategy,lower,upper");
        for mark in &self.marks {
            let _ = write!(text, ",{}", mark.name());
        }
        text.push('\n');
        for d in &self.descents {
            let Some(r) = self.references.iter().find(|r| r.case == d.case) else {
                continue;
            };
            let name = super::report::quoted(&d.case);
            let _ = write!(
                text,
                "{name},{},{},{}",
                d.strategy.name(),
                r.lower.map_or(String::new(), |l| l.to_string()),
                r.upper
            );
            for cost in &d.costs {
                let _ = write!(text, ",{}", cost.map_or(String::new(), |c| c.to_string()));
            }
            text.push('\n');
        }
        text
    }
}

fn percent(share: f64) -> String {
    if share.is_finite() {
        format!("{:.3} %", 100.0 * share)
    } else {
        "–".to_owned()
    }
}

fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    if sorted.is_empty() {
        return f64::NAN;
    }
    super::stats::quantile(&sorted, q)
}
