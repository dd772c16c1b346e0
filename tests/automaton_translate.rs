//! Translation, checked against the formula's own semantics.

use std::sync::Arc;
use std::time::Duration;

use nngtl::alphabet::{Alphabet, Letter};
use nngtl::automaton::{Limits, Nba, Task, TaskError, TranslateError, translate};
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

#[test]
fn limits_are_named_when_hit() {
    let formula: Formula = "Fa & Fb & Fc & Fd & Fe & Ff".parse().unwrap();
    let with = |limits: Limits| translate(&formula, disjoint(&formula), &limits);
    let default = Limits::default();
    assert_eq!(with(default.clone()).unwrap().len(), 64);
    let few = Limits {
        states: 20,
        ..default.clone()
    };
    assert_eq!(with(few), Err(TranslateError::States { limit: 20 }));
    let few = Limits {
        transitions: 50,
        ..default.clone()
    };
    assert_eq!(with(few), Err(TranslateError::Transitions { limit: 50 }));
    let none = Limits {
        time: Some(Duration::ZERO),
        ..default
    };
    assert!(matches!(with(none), Err(TranslateError::Time { .. })));
}

#[test]
fn what_users_write_stays_small() {
    for (text, states) in [
        // Visit n places in any order: 2^n.
        ("Fa & Fb & Fc & Fd & Fe & Fh & Fi & Fj", 256),
        // Ordered tours: one state per stop.
        ("F(a & F(b & F(c & F(d & F(e & F h)))))", 7),
        // Carry things one at a time, each from its place to its goal.
        ("F(p1 & F d1) & F(p2 & F d2) & F(p3 & F d3)", 27),
        // Pick-and-deliver for ever: pick again only after delivering.
        (
            "G(p1 -> X(!p1 U d1)) & G(p2 -> X(!p2 U d2)) & GF p1 & GF p2",
            12,
        ),
        // Patrol n places: as many states as places, and one.
        ("GFa & GFb & GFc & GFd & GFe", 6),
    ] {
        let nba = automaton(text);
        assert!(nba.len() <= states, "{text}: {} states", nba.len());
    }
}

#[test]
fn automata_given_are_trimmed_and_empty_ones_refused() {
    let nba = automaton("!a U b");
    let task = Task::from_nba(nba.clone()).unwrap();
    assert_eq!(task.nba, nba);
    assert_eq!(task.feasible.len(), 1);
    let mut nothing = nba;
    nothing.accepting = vec![false; nothing.len()];
    assert_eq!(
        Task::from_nba(nothing).unwrap_err(),
        TaskError::EmptyAutomaton { letters: 3 }
    );
}

#[test]
fn no_disjunct_of_a_guard_is_lost() {
    // Overlapping regions: "a or both b and c" holds in five of eight letters.
    let formula: Formula = "F(a | b & c)".parse().unwrap();
    let alphabet = Arc::new(Alphabet::powerset(names(&formula)).unwrap());
    let nba = translate(&formula, alphabet, &Limits::default()).unwrap();
    let (start, end) = (nba.initial[0], nba.states().nth(1).unwrap());
    assert_eq!(nba.guard(start, end).map(|g| g.len()), Some(5));
}

#[test]
fn propositions_of_the_map_that_the_mission_ignores_are_free() {
    let formula: Formula = "F a".parse().unwrap();
    let regions = ["x", "a", "y"].map(str::to_owned).to_vec();
    let alphabet = Arc::new(Alphabet::disjoint(regions).unwrap());
    let nba = translate(&formula, alphabet.clone(), &Limits::default()).unwrap();
    assert_eq!(nba.len(), 2);
    agree(&formula, &nba, 200, 9);
    let unknown = translate(&"F z".parse().unwrap(), alphabet, &Limits::default());
    let name = "z".to_owned();
    assert_eq!(unknown, Err(TranslateError::UnknownProposition { name }));
}

#[test]
fn deep_formulas_are_translated_or_refused_without_overflow() {
    let chain = (0..900).fold(Formula::prop("a"), |f, _| f.next());
    let nba = translate(&chain, disjoint(&chain), &Limits::default()).unwrap();
    assert_eq!(nba.len(), 902);
    let mixed = (0..450).fold(Formula::prop("a"), |f, i| {
        let p = Formula::prop(["a", "b", "c"][i % 3]);
        if i % 2 == 0 {
            p.and(f).finally()
        } else {
            p.until(f.globally())
        }
    });
    let result = translate(&mixed, disjoint(&mixed), &Limits::default());
    assert!(
        result.is_ok() || matches!(result, Err(TranslateError::Time { .. })),
        "{result:?}"
    );
    let deep = (0..1500).fold(Formula::prop("a"), |f, _| f.not());
    assert!(matches!(
        translate(&deep, disjoint(&deep), &Limits::default()),
        Err(TranslateError::TooDeep { found: 1501, .. })
    ));
}
