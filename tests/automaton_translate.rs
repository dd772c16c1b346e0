//! Translation, checked against the formula's own semantics.

use std::sync::Arc;

use nngtl::alphabet::{Alphabet, Letter};
use nngtl::automaton::{Limits, Nba, Task, TaskError, translate};
use nngtl::ltl::{Formula, semantics};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn names(formula: &Formula) -> Vec<String> {
    formula
        .propositions()
        .into_iter()
        .map(str::to_owned)
        .collect()
}

fn disjoint(formula: &Formula) -> Arc<Alphabet> {
    Arc::new(Alphabet::disjoint(names(formula)).unwrap())
}

fn automaton(text: &str) -> Nba {
    let formula: Formula = text.parse().unwrap();
    translate(&formula, disjoint(&formula), &Limits::default()).unwrap()
}

/// Compares the automaton with the formula on random lassos.
fn agree(formula: &Formula, nba: &Nba, words: usize, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut letters = |n: u32| -> Vec<Letter> {
        let count = nba.alphabet.len() as u32;
        (0..n).map(|_| Letter(rng.next_u32() % count)).collect()
    };
    for i in 0..words as u32 {
        let (prefix, cycle) = (letters(i % 6), letters(1 + i / 6 % 5));
        let props =
            |word: &[Letter]| -> Vec<_> { word.iter().map(|&l| nba.alphabet.props(l)).collect() };
        let expected =
            semantics::holds(formula, &props(&prefix), &props(&cycle), &nba.alphabet).unwrap();
        assert_eq!(
            nba.accepts(&prefix, &cycle),
            expected,
            "{formula} on {prefix:?} ({cycle:?}):\n{nba}"
        );
    }
}

#[test]
fn the_case_study_has_at_most_five_states() {
    let formula: Formula = "[]<> l1 && (!l1 U l2) && <> l3".parse().unwrap();
    let nba = translate(&formula, disjoint(&formula), &Limits::default()).unwrap();
    assert!(nba.len() <= 5, "{nba}");
    agree(&formula, &nba, 500, 1);
}

#[test]
fn co_safe_missions_end_where_everything_is_accepted() {
    for text in [
        "F a",
        "!a U b",
        "F(a & F(b & F c))",
        "F a & F b & F c",
        "F(a & X b)",
    ] {
        let nba = automaton(text);
        let ends = nba
            .states()
            .any(|q| nba.is_accepting(q) && nba.guard(q, q).is_some_and(|g| g.is_all()));
        assert!(ends, "{text}:\n{nba}");
    }
}

#[test]
fn outcomes_are_distinct() {
    let task = |text: &str| {
        let formula: Formula = text.parse().unwrap();
        Task::from_formula(&formula, disjoint(&formula), &Limits::default())
    };
    assert!(task("GFa & GFb").is_ok());
    assert_eq!(task("Fa & G!a").unwrap_err(), TaskError::Unsatisfiable);
    assert_eq!(
        task("F(a & b)").unwrap_err(),
        TaskError::NotWithTheseLetters { letters: 3 }
    );
}

#[test]
fn small_formulas_agree_with_their_semantics() {
    for (i, text) in [
        "a U b",
        "a R b",
        "a W b",
        "a M b",
        "GFa",
        "FGa",
        "X a",
        "GFa & GFb",
        "GFa | FGb",
        "G(a -> F b)",
        "G(a -> X b)",
        "(a U b) U c",
        "a U (b U c)",
        "(a R b) R c",
        "a <-> F b",
        "(Fa) U (G b)",
        "F(a & X(b U c))",
        "G(a | X X b) & F c",
        "!(GFa -> GFb)",
        "(X a) R b",
        "G(a -> (!b U c)) & GF a",
        "(GFa -> GFb) & F c",
        "(a M b) W c",
        "F(a W (b & X c))",
    ]
    .iter()
    .enumerate()
    {
        let formula: Formula = text.parse().unwrap();
        for alphabet in [
            Alphabet::disjoint(names(&formula)),
            Alphabet::powerset(names(&formula)),
        ] {
            let alphabet = Arc::new(alphabet.unwrap());
            let nba = translate(&formula, alphabet.clone(), &Limits::default()).unwrap();
            agree(&formula, &nba, 300, i as u64);
            let not = formula.clone().not();
            let complement = translate(&not, alphabet, &Limits::default()).unwrap();
            assert!(nba.is_disjoint_from(&complement), "{text}");
        }
    }
}
