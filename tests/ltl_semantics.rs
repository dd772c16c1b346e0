//! Lasso semantics: values worked out by hand, and laws of temporal logic on random words.

use nngtl::alphabet::{Alphabet, Props};
use nngtl::ltl::random::{RandomOptions, Weights, formula};
use nngtl::ltl::semantics::{EvaluateError, holds, holds_by};
use nngtl::ltl::{Formula, MAX_DEPTH};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn abc() -> Alphabet {
    Alphabet::powerset(["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
}

/// A word from text: one letter per group, `.` for the empty one, as in `a ab .`.
fn word(text: &str) -> Vec<Props> {
    let letter = |group: &str| {
        let names = group.bytes().filter(u8::is_ascii_lowercase);
        names.fold(Props::EMPTY, |p, c| p.with(usize::from(c - b'a')))
    };
    text.split_whitespace().map(letter).collect()
}

#[test]
fn values_worked_out_by_hand() {
    for (text, prefix, cycle, expected) in [
        ("a U b", "a a b", ".", true),
        ("a U b", "a a", ".", false),
        ("a U b", "", "a", false),
        ("a W b", "", "a", true),
        ("a R b", "b b ab", ".", true),
        ("a R b", "b b a", ".", false),
        ("a R b", "", "b", true),
        ("a M b", "", "b", false),
        ("a M b", "b", "ab", true),
        ("X X a", ". . a", ".", true),
        ("X a", "", ". a", true),
        // In the loop the letter after the last is the loop's first, not the word's.
        ("F(b & X c)", "c", "a b", false),
        ("F(b & X a)", "c", "a b", true),
        ("GF a", "a a a", ". b", false),
        ("GF a", "", ". . a", true),
        ("FG a", ".", "a", true),
        ("FG a", "", "a .", false),
        ("G(a -> F b)", "a", "a . b", true),
        ("a xor b", "ab", ".", false),
        ("a <-> b", "ab", ".", true),
        ("a -> b", ".", ".", true),
        ("G F a & F G !b", "b", "a .", true),
    ] {
        let formula: Formula = text.parse().unwrap();
        let got = holds(&formula, &word(prefix), &word(cycle), &abc());
        assert_eq!(got, Ok(expected), "{text} on {prefix} ({cycle})");
    }
}

#[test]
fn laws_hold_on_random_words() {
    let laws: [(&str, &str); 14] = [
        ("F p", "1 U p"),
        ("G p", "!F !p"),
        ("p R q", "!(!p U !q)"),
        ("p W q", "(p U q) | G p"),
        ("p M q", "q U (p & q)"),
        ("p U q", "q | (p & X(p U q))"),
        ("p R q", "q & (p | X(p R q))"),
        ("X(p U q)", "X p U X q"),
        ("!X p", "X !p"),
        ("F(p | q)", "F p | F q"),
        ("G(p & q)", "G p & G q"),
        ("GF(p | q)", "GF p | GF q"),
        ("F(p U q)", "F q"),
        ("G(p R q)", "G q"),
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for round in 0..60 {
        let options = RandomOptions {
            propositions: ["a", "b", "c"].map(str::to_owned).to_vec(),
            size: 1 + round % 8,
            weights: Weights::uniform(),
        };
        let (p, q) = (formula(&mut rng, &options), formula(&mut rng, &options));
        let mut letters = |n: u32| -> Vec<Props> {
            (0..n)
                .map(|_| Props(u64::from(rng.next_u32() % 8)))
                .collect()
        };
        let (prefix, cycle) = (letters(round as u32 % 4), letters(1 + round as u32 % 3));
        for (left, right) in laws {
            let of = |law: &str| {
                let text = law
                    .replace('p', &format!("({p})"))
                    .replace('q', &format!("({q})"));
                let formula: Formula = text.parse().unwrap();
                holds(&formula, &prefix, &cycle, &abc()).unwrap()
            };
            assert_eq!(of(left), of(right), "{left} = {right} for p = {p}, q = {q}");
        }
    }
}

#[test]
fn what_has_no_meaning_is_an_error() {
    let formula: Formula = "a U d".parse().unwrap();
    let some = word("a");
    assert_eq!(
        holds(&formula, &some, &[], &abc()),
        Err(EvaluateError::EmptyCycle)
    );
    assert_eq!(
        holds(&formula, &[], &some, &abc()),
        Err(EvaluateError::UnknownProposition("d".to_owned()))
    );
    assert_eq!(
        holds_by(&formula, 0, 1, |name, _| Some(name == "d")),
        Ok(true)
    );
}

#[test]
fn deep_formulas_need_no_stack() {
    let deep = (1..MAX_DEPTH).fold(Formula::prop("a"), |f, _| f.next().clone());
    assert_eq!(deep.depth(), MAX_DEPTH);
    assert_eq!(
        holds(&deep, &[], &word("a ."), &abc()),
        Ok(MAX_DEPTH % 2 == 1)
    );
    assert_eq!(deep.to_string().len(), MAX_DEPTH);
}
