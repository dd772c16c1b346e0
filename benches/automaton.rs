//! Translation: sizes and times over files of formulas, and single translations under criterion.
//!
//! `NNGTL_FORMULAS=FILE[:STEP[:OFFSET]] cargo bench --bench automaton` translates every STEP-th line of a
//! file, from line OFFSET (from 1) on, and prints totals; blank lines and lines that start with `#` are
//! skipped, but counted as lines. `NNGTL_LETTERS=disjoint|free` says whether regions overlap (disjoint
//! by default; with `disjoint` all files share the regions a to g), `NNGTL_CHECK=1` also translates
//! every negation and checks that the two automata share no word and agree with the formula's
//! semantics on random lassos, `NNGTL_LIST=1` lists every formula.
//! Without a file a fixed set of missions is timed.

#![allow(clippy::print_stdout)] // a report is what this program is for

use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use criterion::Criterion;
use nngtl::alphabet::{Alphabet, Letter};
use nngtl::automaton::{Limits, Nba, Task, TaskError, translate};
use nngtl::ltl::{Formula, semantics};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const MISSIONS: [(&str, &str); 5] = [
    ("case study", "[]<> l1 && (!l1 U l2) && <> l3"),
    (
        "reference case",
        "<> l1 && []<> (l2 && <> l3) && (!l3 U l4) && []!l5",
    ),
    ("any order of 5", "<>l1 && <>l2 && <>l3 && <>l4 && <>l5"),
    ("two tours", "F(p1 & F(p2 & F p3)) & F(q1 & F(q2 & F q3))"),
    (
        "pick and deliver",
        "G(p1 -> X(!p1 U d1)) & G(p2 -> X(!p2 U d2)) & GF p1 & GF p2",
    ),
];

fn alphabet(formula: &Formula, free: bool) -> Arc<Alphabet> {
    let mut names: Vec<String> = formula
        .propositions()
        .into_iter()
        .map(str::to_owned)
        .collect();
    let regions = ["a", "b", "c", "d", "e", "f", "g"];
    if !free && names.iter().all(|n| regions.contains(&n.as_str())) {
        names = regions.map(str::to_owned).to_vec();
    }
    let made = if free {
        Alphabet::powerset(names)
    } else {
        Alphabet::disjoint(names)
    };
    Arc::new(made.expect("few names, all different"))
}

#[derive(Default)]
struct Totals {
    formulas: usize,
    empty: usize,
    states: usize,
    edges: usize,
    times: Vec<Duration>,
    failed: usize,
    wrong: usize,
}

impl Totals {
    fn add(&mut self, nba: &Nba, time: Duration) {
        self.formulas += 1;
        self.empty += usize::from(nba.is_empty());
        self.states += nba.len();
        self.edges += nba.edge_count();
        self.times.push(time);
    }

    fn report(&mut self, name: &str) {
        self.times.sort_unstable();
        let n = self.formulas.max(1);
        let total: Duration = self.times.iter().sum();
        let at = |share: f64| {
            let i = (share * (self.times.len().max(1) - 1) as f64) as usize;
            self.times.get(i).copied().unwrap_or_default().as_secs_f64() * 1e3
        };
        println!(
            "{name}: {} formulas, {} empty, {} failed, {} wrong; {} states, {} edges; mean {:.4} / {:.4}; time mean {:.3} ms, median {:.3}, 95 % {:.3}, worst {:.3}",
            self.formulas,
            self.empty,
            self.failed,
            self.wrong,
            self.states,
            self.edges,
            self.states as f64 / n as f64,
            self.edges as f64 / n as f64,
            total.as_secs_f64() * 1e3 / n as f64,
            at(0.5),
            at(0.95),
            at(1.0),
        );
    }
}

fn file(spec: &str) {
    let mut parts = spec.split(':');
    let path = parts.next().expect("a split has a first part");
    let mut number = || parts.next().and_then(|p| p.parse::<usize>().ok());
    let (step, offset) = (number().unwrap_or(1), number().unwrap_or(1));
    let text = std::fs::read_to_string(path).expect("NNGTL_FORMULAS names a readable file");
    let set = |name: &str| std::env::var(name).is_ok_and(|v| v == "1");
    let free = std::env::var("NNGTL_LETTERS").is_ok_and(|v| v == "free");
    let limits = Limits::default();
    let (mut part, mut all) = (Totals::default(), Totals::default());
    let mut heading = String::from("formulas");
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some(comment) = line.strip_prefix('#') {
            if part.formulas > 0 {
                part.report(&heading);
                part = Totals::default();
            }
            heading = comment
                .trim()
                .split([':', ','])
                .next()
                .unwrap_or("")
                .to_owned();
            continue;
        }
        if line.is_empty() || i + 1 < offset || (i + 1 - offset) % step != 0 {
            continue;
        }
        let formula: Formula = line.parse().expect("every line holds a formula");
        let letters = alphabet(&formula, free);
        let start = Instant::now();
        let result = translate(&formula, letters.clone(), &limits);
        let time = start.elapsed();
        let nba = match result {
            Ok(nba) => nba,
            Err(error) => {
                println!("{line}: {error}");
                part.failed += 1;
                all.failed += 1;
                continue;
            }
        };
        part.add(&nba, time);
        all.add(&nba, time);
        if set("NNGTL_LIST") {
            println!(
                "{}\t{}\t{:.3}\t{line}",
                nba.len(),
                nba.edge_count(),
                time.as_secs_f64() * 1e3
            );
        }
        if set("NNGTL_CHECK") {
            let not = translate(&formula.clone().not(), letters, &limits);
            let sound = match &not {
                Ok(not) => nba.is_disjoint_from(not) && agree(&formula, &nba, not, i as u64),
                Err(error) => {
                    println!("!({line}): {error}");
                    true
                }
            };
            if !sound {
                println!("WRONG {line}");
            }
            part.wrong += usize::from(!sound);
            all.wrong += usize::from(!sound);
        }
    }
    part.report(&heading);
    all.report("all");
}

/// Whether both automata agree with the semantics on a few random lassos.
fn agree(formula: &Formula, nba: &Nba, not: &Nba, seed: u64) -> bool {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = nba.alphabet.len() as u32;
    (0..50).all(|_| {
        let mut letters = |least: u32| -> Vec<Letter> {
            let n = least + rng.next_u32() % 5;
            (0..n).map(|_| Letter(rng.next_u32() % count)).collect()
        };
        let (prefix, cycle) = (letters(0), letters(1));
        let props = |w: &[Letter]| -> Vec<_> { w.iter().map(|&l| nba.alphabet.props(l)).collect() };
        let truth = semantics::holds(formula, &props(&prefix), &props(&cycle), &nba.alphabet);
        truth == Ok(nba.accepts(&prefix, &cycle)) && truth == Ok(!not.accepts(&prefix, &cycle))
    })
}

fn main() {
    if let Ok(spec) = std::env::var("NNGTL_FORMULAS") {
        file(&spec);
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    for (name, text) in MISSIONS {
        let formula: Formula = text.parse().expect("the missions are well-formed");
        let letters = alphabet(&formula, false);
        criterion.bench_function(&format!("translate {name}"), |b| {
            b.iter(|| translate(black_box(&formula), letters.clone(), &Limits::default()));
        });
    }
    let infeasible: Formula = "F(a & b)".parse().expect("well-formed");
    let letters = alphabet(&infeasible, false);
    criterion.bench_function("translate infeasible", |b| {
        b.iter(|| {
            let task = Task::from_formula(&infeasible, letters.clone(), &Limits::default());
            assert!(matches!(task, Err(TaskError::NotWithTheseLetters { .. })));
        });
    });
    criterion.final_summary();
}
