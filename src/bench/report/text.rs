//! Comparisons as Markdown and CSV.

use std::fmt::Write as _;

use super::super::stats::{Ratio, Summary};
use super::{Effort, Report, Row};

/// The published table (`nngtl.md`, Table I): class, sampler, seconds, n, len, m. Its authors' Python on their
/// machine, missions and maps of the same kind.
const PAPER: [(&str, &str, &str, &str, &str, &str); 6] = [
    ("simple", "uniform", "54.2", "1908.1", "0.788", "3167.6"),
    ("simple", "biased", "1.03", "101.0", "0.808", "200.3"),
    ("simple", "guided", "0.095", "22.9", "0.905", "48.1"),
    ("complex", "uniform", "1401.8", "7401.3", "–", "21501.2"),
    ("complex", "biased", "15.6", "321.6", "1.086", "704.1"),
    ("complex", "guided", "2.19", "44.9", "1.126", "182.7"),
];

impl Report {
    /// The tables as Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = self.introduction();
        for part in [
            self.first_prefixes(),
            self.first_plans(),
            self.ratio_table(),
            self.split(),
        ] {
            text.push('\n');
            text.push_str(&part);
        }
        text
    }

    /// What was run, how to read the cells, and how many missions each class has.
    pub(in crate::bench) fn introduction(&self) -> String {
        let mut text = format!(
            "{}, {} each, cap {} iterations, seed {}. Cells: mean · median [quartiles]. Runs that end at the cap without \
             a result count with what they spent, and what they make a lower bound is marked ≥.\n\n",
            counted_first(self.missions, "mission", "missions"),
            counted(self.comparison.trials, "trial", "trials"),
            self.comparison.settings.iterations,
            self.comparison.settings.seed,
        );
        let classes = match &self.classes {
            Some(classes) => classes.line(),
            None => "Simple and complex missions are not told apart: uniform sampling was not run."
                .to_owned(),
        };
        text.push_str(&classes);
        text.push('\n');
        text
    }

    /// The paper's Table I: until the first prefix.
    pub(in crate::bench) fn first_prefixes(&self) -> String {
        let mut text = String::from(
            "First prefix (the paper's Table I; T is encoding, networks and search, n iterations, len the prefix's length where one was \
             found, m product states):\n\n",
        );
        self.efforts(&mut text, "len", |row| &row.prefix);
        text
    }

    /// The published figures.
    pub(in crate::bench) fn published() -> String {
        let mut text = String::from(
            "| published | sampler | T, s | n | len | m |\n| --- | --- | ---: | ---: | ---: | ---: |\n",
        );
        for (class, sampler, seconds, n, len, m) in PAPER {
            let _ = writeln!(
                text,
                "| {class} | {sampler} | {seconds} | {n} | {len} | {m} |"
            );
        }
        text
    }

    /// Until the first plan.
    pub(in crate::bench) fn first_plans(&self) -> String {
        let mut text = String::from("First plan (prefix and suffix):\n\n");
        self.efforts(&mut text, "cost", |row| &row.plan);
        text
    }

    fn efforts(&self, text: &mut String, cost: &str, of: impl Fn(&Row) -> &Effort) {
        let _ = writeln!(
            text,
            "| missions | sampler | found | T, ms | n | {cost} | m |\n| --- | --- | ---: | ---: | ---: | ---: | ---: |"
        );
        for row in &self.rows {
            let effort = of(row);
            let _ = writeln!(
                text,
                "| {} ({}) | {} | {} | {} | {} | {} | {} |",
                row.group,
                row.missions,
                row.contender,
                effort.found,
                effort.ms.cell(2),
                effort.iterations.cell(1),
                effort.cost.as_ref().map_or("–".to_owned(), |s| cell(s, 3)),
                effort.nodes.cell(1),
            );
        }
    }

    /// How much of others' effort contenders need.
    pub(in crate::bench) fn ratio_table(&self) -> String {
        if self.ratios.is_empty() {
            return String::new();
        }
        let mut text = String::from(
            "Ratios of means with 95 % bootstrap intervals over missions (time: to the first plan, with and without encoding and networks; runs \
             that ended at the cap make them bounds, ≥, ≤, or both, ≈):\n\n\
             | missions | sampler | ÷ | n, first prefix | n, first plan | m, first plan | len | search | with networks |\n\
             | --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n",
        );
        let shown = |r: &Option<Ratio>| cell_or_dash(r.as_ref());
        for r in &self.ratios {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                r.group,
                r.contender,
                r.against,
                shown(&r.prefix_iterations),
                shown(&r.plan_iterations),
                shown(&r.nodes),
                shown(&r.length),
                shown(&r.search),
                shown(&r.total),
            );
        }
        text
    }

    /// Where the time went.
    pub(in crate::bench) fn split(&self) -> String {
        let mut text = String::from(
            "Where the time goes until the first plan, ms (mean · median):\n\n\
             | missions | sampler | translate | encode | networks | search | mean sum |\n\
             | --- | --- | ---: | ---: | ---: | ---: | ---: |\n",
        );
        for row in &self.rows {
            let part = |s: &Summary| {
                if s.max == 0.0 {
                    return "0".to_owned();
                }
                format!("{:.3} · {:.3}", s.mean, s.median)
            };
            let [translate, encode, infer, search] = &row.split_ms;
            let sum: f64 = row.split_ms.iter().map(|s| s.mean).sum();
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {sum:.3} |",
                row.group,
                row.contender,
                part(translate),
                part(encode),
                part(infer),
                part(search),
            );
        }
        text
    }

    /// Every run as a line of comma-separated values, with a header. What depends on the machine, seconds, stands in the last
    /// columns.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "case,family,sampler,seed,solved,prefix_iterations,prefix_nodes,prefix_length,plan_iterations,plan_nodes,plan_cost,cap,nodes,\
             prefix_seconds,plan_seconds,translate_seconds,encode_seconds,infer_seconds,search_seconds\n",
        );
        fn known<T: ToString>(x: Option<T>) -> String {
            x.map_or(String::new(), |x| x.to_string())
        }
        for t in &self.trials {
            let (prefix, plan) = (t.prefix, t.plan);
            let fields = [
                quoted(&t.case),
                quoted(t.family.as_deref().unwrap_or("")),
                quoted(&t.contender.to_string()),
                t.seed.to_string(),
                t.solved().to_string(),
                known(prefix.map(|f| f.iterations)),
                known(prefix.map(|f| f.nodes)),
                known(prefix.map(|f| f.cost)),
                known(plan.map(|f| f.iterations)),
                known(plan.map(|f| f.nodes)),
                known(plan.map(|f| f.cost)),
                t.cap.to_string(),
                t.nodes.to_string(),
                known(prefix.map(|f| f.seconds)),
                known(plan.map(|f| f.seconds)),
                t.times.translate.to_string(),
                t.times.encode.to_string(),
                t.times.infer.to_string(),
                t.times.search.to_string(),
            ];
            text.push_str(&fields.join(","));
            text.push('\n');
        }
        text
    }
}

/// Mean, median and quartiles.
fn cell(s: &Summary, digits: usize) -> String {
    format!(
        "{:.digits$} · {:.digits$} [{:.digits$}, {:.digits$}]",
        s.mean, s.median, s.quarter, s.three_quarters
    )
}

/// A value as a cell of a table.
pub(in crate::bench) fn cell_or_dash<T: std::fmt::Display>(value: Option<T>) -> String {
    value.map_or("–".to_owned(), |v| v.to_string())
}

/// A number with what is counted.
pub(in crate::bench) fn counted(number: u64, one: &str, more: &str) -> String {
    match number {
        1 => format!("one {one}"),
        _ => format!("{number} {more}"),
    }
}

/// As [`counted`], at the beginning of a sentence.
pub(in crate::bench) fn counted_first(number: usize, one: &str, more: &str) -> String {
    match number {
        1 => format!("One {one}"),
        _ => format!("{number} {more}"),
    }
}

/// A CSV field; quoted if it needs to be.
pub(in crate::bench) fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", field.replace('"', "\"\""));
    }
    field.to_owned()
}
