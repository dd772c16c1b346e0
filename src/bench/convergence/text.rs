//! Costs over time as Markdown and CSV.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::super::report::{cell_or_dash, counted, counted_first, quoted};
use super::super::stats::{self, Measured, Ratio, mean};
use super::super::{Contender, Group, Strategy};
use super::{Convergence, NEAR, Reference, gap};

/// What a search took to come near the exact planner's plan.
struct Spent {
    iterations: f64,
    /// With inference.
    milliseconds: f64,
    never: bool,
}

/// What searches took, by mission.
type BySearch<'a> = BTreeMap<&'a str, Vec<Spent>>;

impl Convergence {
    /// The tables as Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let all = &self.references;
        if all.is_empty() {
            return "No mission was searched that the exact planner solves: there is nothing to compare.\n".to_owned();
        }
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
            "{} that the exact planner solves, {} of each sampler on each. Its plans take {}. They cost at most {} by lower \
             bounds without refinement, which take {}",
            counted_first(all.len(), "mission", "missions"),
            counted(self.trials, "search", "searches"),
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
        let heavy = all.iter().filter(|r| r.weight >= 0.5).count();
        if heavy > 0 {
            let missions = counted_first(heavy, "mission weighs", "missions weigh");
            let _ = writeln!(
                text,
                "{missions} the prefix with one half or more. There `nngtl plan` ends by looking for loops that no run of the automaton \
                 closes, which may cost much less (on grids less so), with every sampler and with the exact planner; that is left out here on both sides.\n"
            );
        }
        text.push_str(
            "Gap of each sampler's best plan to the exact planner's (negative: better), over the searches that have one.\n\n",
        );
        text.push_str("| sampler | after | no plan | mean gap | median | 90 % | largest | within 1 % | within 0.1 % |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        for contender in &self.contenders {
            for (k, mark) in self.marks.iter().enumerate() {
                let (gaps, missing) = self.gaps(contender, k);
                let within = |limit: f64| gaps.iter().filter(|&&g| g <= limit).count();
                // Of no plans there is nothing to say.
                let shown = |gap: f64| match gaps.as_slice() {
                    [] => "–".to_owned(),
                    _ => percent(gap),
                };
                let _ = writeln!(
                    text,
                    "| {} | {} | {missing} | {} | {} | {} | {} | {} | {} |",
                    contender,
                    mark.name(),
                    shown(mean(&gaps)),
                    shown(quantile(&gaps, 0.5)),
                    shown(quantile(&gaps, 0.9)),
                    shown(gaps.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
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
             counts with all that it spent, and what that makes a lower bound is marked ≥. Mean · median [quartiles]; time with \
             encoding and networks; ratios of means to biased with 95 % bootstrap intervals over missions, ≤ where searches of biased, ≥ where \
             others, ≈ where both never got there.\n\n",
        );
        text.push_str("| missions | sampler | within | never | iterations | ms | iterations ÷ biased | time ÷ biased |\n");
        text.push_str("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n");
        let biased = Contender::from(Strategy::Biased);
        for group in self.groups() {
            for share in NEAR {
                let against = self.spent(&group, &biased, share);
                for contender in &self.contenders {
                    let mine = self.spent(&group, contender, share);
                    write_spent(text, &group, contender, share, &mine, &against);
                }
            }
        }
    }

    /// What the searches of each mission spent until they came this near, by mission.
    fn spent(&self, group: &Group, contender: &Contender, share: f64) -> BySearch<'_> {
        let mine = self.descents.iter().filter(|d| d.contender == *contender);
        let inside = mine.filter(|d| group.cases.contains(&d.case));
        let mut all = BySearch::new();
        for d in inside {
            let Some(reference) = self.reference(&d.case) else {
                continue;
            };
            let reached = d.reached(reference.upper, share);
            let (iterations, seconds) = reached.unwrap_or((d.iterations, d.seconds));
            all.entry(&d.case).or_default().push(Spent {
                iterations: iterations as f64,
                milliseconds: 1e3 * d.whole(iterations, seconds),
                never: reached.is_none(),
            });
        }
        all
    }

    /// Every search as a line of comma-separated values, with a header: bounds, the cost after so many
    /// iterations, and then what depends on the machine.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut marks: Vec<_> = self.marks.iter().collect();
        marks.sort_by_key(|m| matches!(m, super::Mark::Seconds(_)));
        let mut text = String::from("case,family,sampler,seed,lower,upper,verified");
        for mark in &marks {
            let _ = write!(text, ",{}", mark.name());
        }
        text.push_str(",seconds,network_seconds\n");
        let known = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        for d in &self.descents {
            let Some(r) = self.reference(&d.case) else {
                continue;
            };
            let mut fields = vec![
                quoted(&d.case),
                quoted(r.family.as_deref().unwrap_or("")),
                quoted(&d.contender.to_string()),
                d.seed.to_string(),
                known(r.lower),
                r.upper.to_string(),
                d.verified.map_or(String::new(), |v| v.to_string()),
            ];
            fields.extend(marks.iter().map(|m| known(m.cost(&d.improvements))));
            fields.extend([d.seconds, d.network_seconds].map(|s| s.to_string()));
            text.push_str(&fields.join(","));
            text.push('\n');
        }
        text
    }
}

fn write_spent(
    text: &mut String,
    group: &Group,
    contender: &Contender,
    share: f64,
    mine: &BySearch<'_>,
    against: &BySearch<'_>,
) {
    let cell = |value: fn(&Spent) -> f64, digits: usize| {
        let runs = mine.values().flatten().map(|s| (value(s), s.never));
        let runs: Vec<(f64, bool)> = runs.collect();
        cell_or_dash(Measured::of(&runs).map(|m| m.cell(digits)))
    };
    let ratio = |value: fn(&Spent) -> f64| {
        let of_mission =
            |searches: &Vec<Spent>| mean(&searches.iter().map(value).collect::<Vec<f64>>());
        let pairs: Vec<(f64, f64)> = mine
            .iter()
            .filter_map(|(case, s)| Some((of_mission(s), of_mission(against.get(case)?))))
            .collect();
        let never = |all: &BySearch<'_>| all.values().flatten().any(|s| s.never);
        let capped = match contender.strategy {
            Strategy::Biased => [false; 2],
            _ => [never(mine), never(against)],
        };
        let ratio = Ratio::of_means(&pairs);
        cell_or_dash(ratio.map(|r| r.with_capped(capped)))
    };
    let _ = writeln!(
        text,
        "| {} | {contender} | {} % | {} of {} | {} | {} | {} | {} |",
        group.name,
        100.0 * share,
        mine.values().flatten().filter(|s| s.never).count(),
        mine.values().flatten().count(),
        cell(|s| s.iterations, 0),
        cell(|s| s.milliseconds, 2),
        ratio(|s| s.iterations),
        ratio(|s| s.milliseconds),
    );
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
    stats::quantile(&sorted, q)
}
