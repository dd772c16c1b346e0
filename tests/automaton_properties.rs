//! Properties of translation over random formulas of fixed seeds.
//!
//! `NNGTL_TEST_SCALE` multiplies the number of formulas (default 1).

use std::sync::Arc;

use nngtl::alphabet::{Alphabet, Letter};
use nngtl::automaton::{Limits, Nba, Task, TaskError, read_hoa, translate};
use nngtl::ltl::random::{RandomOptions, Weights, formula};
use nngtl::ltl::{Formula, ParseOptions, parse, semantics};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn scale() -> usize {
    std::env::var("NNGTL_TEST_SCALE")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(1)
}

fn names(n: usize) -> Vec<String> {
    ["a", "b", "c", "d", "e", "f", "g"][..n]
        .iter()
        .map(|&s| s.to_owned())
        .collect()
}

/// `count` formulas of 3 to 16 nodes over `propositions` names.
fn sample(seed: u64, count: usize, propositions: usize, weights: &Weights) -> Vec<Formula> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|i| {
            let options = RandomOptions {
                propositions: names(propositions),
                size: 3 + i % 14,
                weights: weights.clone(),
            };
            formula(&mut rng, &options)
        })
        .collect()
}

fn check(formula: &Formula, alphabet: &Arc<Alphabet>, rng: &mut ChaCha8Rng) -> Nba {
    let limits = Limits::default();
    let nba = translate(formula, alphabet.clone(), &limits).unwrap();
    let negation = translate(&formula.clone().not(), alphabet.clone(), &limits).unwrap();
    assert!(
        nba.is_disjoint_from(&negation),
        "{formula} and its negation share a word\n{nba}"
    );
    for _ in 0..40 {
        let mut letters = |from: u32, to: u32| -> Vec<Letter> {
            let n = from + rng.next_u32() % (to - from);
            (0..n)
                .map(|_| Letter(rng.next_u32() % alphabet.len() as u32))
                .collect()
        };
        let (prefix, cycle) = (letters(0, 6), letters(1, 5));
        let props = |w: &[Letter]| w.iter().map(|&l| alphabet.props(l)).collect::<Vec<_>>();
        let truth = semantics::holds(formula, &props(&prefix), &props(&cycle), alphabet).unwrap();
        assert_eq!(
            nba.accepts(&prefix, &cycle),
            truth,
            "{formula} on {prefix:?}({cycle:?})\n{nba}"
        );
        assert_eq!(negation.accepts(&prefix, &cycle), !truth, "!({formula})");
    }
    assert_eq!(nba.trimmed(), nba, "{formula}: useless states");
    nba
}

#[test]
fn automata_agree_with_semantics_over_disjoint_regions() {
    let alphabet = Arc::new(Alphabet::disjoint(names(4)).unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(100);
    let mut larger = 0;
    for f in sample(1, 3000 * scale(), 4, &Weights::missions()) {
        let nba = check(&f, &alphabet, &mut rng);
        if nba.len() <= 4 {
            let invariant = nba.is_stutter_invariant(&Limits::default());
            assert_eq!(invariant, Ok(true), "{f}\n{nba}");
        } else {
            larger += 1;
            repeat_letters(&nba, &mut rng);
        }
        let back = read_hoa(
            &nba.to_hoa(Some(&f.to_string())),
            alphabet.clone(),
            &Limits::default(),
        );
        assert_eq!(back.as_ref(), Ok(&nba.with_one_initial()), "{f}");
    }
    assert!(larger > 50, "{larger} automata of more than four states");
}

/// Words that differ in repetitions alone are accepted alike: what the closure decides for small automata, on random words of larger ones.
fn repeat_letters(nba: &Nba, rng: &mut ChaCha8Rng) {
    let mut draw = |n: usize| rng.next_u32() as usize % n;
    for _ in 0..20 {
        let [prefix, cycle] = [draw(6), 1 + draw(5)].map(|n| {
            let letters = (0..n).map(|_| Letter(draw(nba.alphabet.len()) as u32));
            letters.collect::<Vec<_>>()
        });
        let mut repeated = |word: &[Letter]| -> Vec<Letter> {
            let letters = word.iter();
            letters.flat_map(|&l| vec![l; 1 + draw(4)]).collect()
        };
        let (long_prefix, long_cycle) = (repeated(&prefix), repeated(&cycle));
        assert_eq!(
            nba.accepts(&prefix, &cycle),
            nba.accepts(&long_prefix, &long_cycle),
            "{prefix:?}({cycle:?}) and {long_prefix:?}({long_cycle:?})\n{nba}"
        );
    }
}

#[test]
fn automata_agree_with_semantics_over_all_letters() {
    let alphabet = Arc::new(Alphabet::powerset(names(3)).unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(200);
    for f in sample(2, 3000 * scale(), 3, &Weights::uniform()) {
        let nba = check(&f, &alphabet, &mut rng);
        let back = read_hoa(&nba.to_hoa(None), alphabet.clone(), &Limits::default());
        assert_eq!(back.as_ref(), Ok(&nba.with_one_initial()), "{f}");
    }
}

#[test]
fn inclusion_agrees_with_the_negation() {
    let alphabet = Arc::new(Alphabet::disjoint(names(2)).unwrap());
    let limits = Limits::default();
    let formulas = sample(3, 300 * scale(), 2, &Weights::uniform());
    let mut included = 0;
    for pair in formulas.windows(2) {
        let of = |f: &Formula| translate(f, alphabet.clone(), &limits).unwrap();
        let (a, b) = (of(&pair[0]), of(&pair[1]));
        let expected = b.is_disjoint_from(&of(&pair[0].clone().not()));
        assert_eq!(
            a.includes(&b, &limits),
            Ok(expected),
            "{} in {}",
            pair[1],
            pair[0]
        );
        included += usize::from(expected);
    }
    assert!(included > 0, "the sample holds inclusions");
}

/// Over disjoint regions some formulas with X cannot count repetitions all the same.
#[test]
fn next_may_break_stutter_invariance() {
    let alphabet = Arc::new(Alphabet::disjoint(names(2)).unwrap());
    for (text, invariant) in [
        ("a & X b", false),
        ("F(a & X b)", true),
        ("F(a & X a)", false),
        ("G(a -> X !a)", false),
        ("F a & X F a", false),
        ("G F (a & X !a)", true),
        ("a & X(a U b)", true),
        ("a U X b", false),
        ("F(a & X(a U b))", true),
        ("X G F a", true),
    ] {
        let f: Formula = text.parse().unwrap();
        let nba = translate(&f, alphabet.clone(), &Limits::default()).unwrap();
        assert_eq!(
            nba.is_stutter_invariant(&Limits::default()),
            Ok(invariant),
            "{text}\n{nba}"
        );
    }
}

#[test]
fn formulas_print_and_read_back() {
    for f in sample(4, 3000 * scale(), 5, &Weights::uniform()) {
        let text = f.to_string();
        let parsed = parse(&text, &ParseOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(parsed.formula, f, "{text}");
        for u in &parsed.uses {
            assert_eq!(text[u.span.clone()], u.name);
        }
    }
}

#[test]
fn infeasible_missions_are_told_apart() {
    let alphabet = Arc::new(Alphabet::disjoint(names(4)).unwrap());
    let free = Arc::new(Alphabet::powerset(names(4)).unwrap());
    let limits = Limits::default();
    let mut seen = [0; 3];
    for f in sample(5, 2000 * scale(), 4, &Weights::missions()) {
        let somewhere = !translate(&f, free.clone(), &limits).unwrap().is_empty();
        match Task::from_formula(&f, alphabet.clone(), &limits) {
            Ok(task) => {
                assert!(somewhere && !task.feasible.is_empty(), "{f}");
                seen[0] += 1;
            }
            Err(TaskError::NotWithTheseLetters { .. }) => {
                assert!(somewhere, "{f}");
                seen[1] += 1;
            }
            Err(TaskError::Unsatisfiable) => {
                assert!(!somewhere, "{f}");
                seen[2] += 1;
            }
            Err(other) => panic!("{f}: {other}"),
        }
    }
    assert!(seen.iter().all(|&n| n > 0), "{seen:?}");
}

/// Sizes over a fixed sample. A failure with larger totals is a regression of the reductions; with
/// smaller ones it is progress: put the new numbers here.
#[test]
fn sizes_do_not_grow() {
    let alphabet = Arc::new(Alphabet::disjoint(names(7)).unwrap());
    let (mut states, mut edges) = (0, 0);
    for f in sample(6, 500, 7, &Weights::missions()) {
        let nba = translate(&f, alphabet.clone(), &Limits::default()).unwrap();
        states += nba.len();
        edges += nba.edge_count();
    }
    assert_eq!((states, edges), (999, 1610));
}

#[test]
fn garbage_is_refused_without_panic() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let alphabet = Arc::new(Alphabet::disjoint(names(3)).unwrap());
    let pieces = [
        "a", "b", "(", ")", "!", "&", "|", "U", "F", "G", "X", "->", "<->", "[]", "<>", "\"", "\\",
        "1", "0", " ", "é", "[", "]", "{", "}", "*", "=", "\n", "R", "W", "M", "true", "xor", "_",
        ".", "☃",
    ];
    for _ in 0..4000 * scale() {
        let n = rng.next_u32() % 12;
        let text: String = (0..n)
            .map(|_| pieces[rng.next_u32() as usize % pieces.len()])
            .collect();
        match parse(&text, &ParseOptions::default()) {
            Ok(parsed) => {
                assert_eq!(
                    parsed.formula.to_string().parse(),
                    Ok(parsed.formula),
                    "{text}"
                );
            }
            Err(error) => {
                assert!(!error.render(None, false).is_empty());
                assert!(!error.to_string().is_empty());
            }
        }
    }
    let f: Formula = "GFa & (!a U b) & Fc".parse().unwrap();
    let good = translate(&f, alphabet.clone(), &Limits::default())
        .unwrap()
        .to_hoa(Some("m"));
    let pieces = [
        "0",
        "1",
        "99999999999999999999",
        "[",
        "]",
        "{",
        "}",
        "(",
        ")",
        "!",
        "&",
        "|",
        "@x",
        "\"",
        "t",
        "f",
        "State:",
        "Alias:",
        "--BODY--",
        "--END--",
        "--ABORT--",
        "/*",
        "*/",
        "Inf",
        "Fin",
        "Start: 1",
        "AP: 1 \"a\"",
        "é",
        "States: 4000000000",
        "HOA: v1",
        "4294967296",
        "-",
    ];
    for _ in 0..4000 * scale() {
        let mut text: Vec<char> = good.chars().collect();
        for _ in 0..1 + rng.next_u32() % 3 {
            let at = rng.next_u32() as usize % text.len();
            let end = (at + rng.next_u32() as usize % 6).min(text.len());
            let piece = pieces[rng.next_u32() as usize % pieces.len()];
            text.splice(at..end, piece.chars());
        }
        let text: String = text.into_iter().collect();
        if let Err(error) = read_hoa(&text, alphabet.clone(), &Limits::default()) {
            assert!(
                error.render(Some("x.hoa"), false).contains("error"),
                "{text}"
            );
        }
    }
}
