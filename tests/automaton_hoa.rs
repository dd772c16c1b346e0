//! The Hanoi omega-automata format: what is read, what is refused, and where errors point.

use std::sync::Arc;

use nngtl::alphabet::Alphabet;
use nngtl::automaton::{HoaErrorKind, Limits, Nba, read_hoa, read_hoa_stream, translate};
use nngtl::ltl::Formula;

fn abc() -> Arc<Alphabet> {
    let names = ["a", "b", "c"].map(str::to_owned).to_vec();
    Arc::new(Alphabet::powerset(names).unwrap())
}

fn read(text: &str) -> Nba {
    read_hoa(text, abc(), &Limits::default())
        .unwrap_or_else(|e| panic!("{}", e.render(None, false)))
}

fn refuse(text: &str) -> nngtl::automaton::HoaError {
    read_hoa(text, abc(), &Limits::default()).expect_err(text)
}

/// Whether the automaton accepts exactly the words of the formula.
fn means(nba: &Nba, formula: &str) -> bool {
    let formula: Formula = formula.parse().unwrap();
    let of = |f: &Formula| translate(f, nba.alphabet.clone(), &Limits::default()).unwrap();
    nba.is_disjoint_from(&of(&formula.clone().not()))
        && nba.includes(&of(&formula), &Limits::default()).unwrap()
}

/// The example of the format's description.
const GENERALIZED: &str = r#"HOA: v1
States: 1
Start: 0
AP: 2 "a" "b"
acc-name: generalized-Buchi 2
Acceptance: 2 Inf(0)&Inf(1)
--BODY--
State: 0
[!0&!1] 0
[0&!1] 0 {0}
[!0&1] 0 {1}
[0&1] 0 {0 1}
--END--
"#;

#[test]
fn every_supported_form_is_read() {
    assert!(means(&read(GENERALIZED), "GFa & GFb"));
    for (text, formula) in [
        // State acceptance, aliases, nested comments, names, unknown lower-case items.
        (
            r#"HOA: v1 /* a /* nested */ comment */ name: "x \"y\"" tool: "t" "1" colour: red 5
               States: 2 AP: 2 "b" "a" Start: 0 Alias: @a 1 Alias: @not !@a & t
               acc-name: Buchi Acceptance: 1 Inf(0) properties: state-acc explicit-labels
               --BODY-- State: 0 "first" [@not] 0 [@a] 1 State: 1 {0} [t] 1 --END--"#,
            "F a",
        ),
        // Labels on states.
        (
            r#"HOA: v1 States: 2 Start: 0 Start: 1 AP: 1 "c" Acceptance: 1 (Inf(0))
               --BODY-- State: [0] 0 {0} 0 1 State: [!0] 1 0 1 --END--"#,
            "GFc",
        ),
        // Implicit labels, proposition 0 the lowest bit.
        (
            r#"HOA: v1 States: 2 Start: 0 AP: 2 "a" "b" Acceptance: 0 t
               --BODY-- State: 0 1 0 1 1 State: 1 1 1 1 1 --END--"#,
            "1",
        ),
        (
            r#"HOA: v1 States: 2 Start: 0 AP: 2 "a" "b" Acceptance: 1 Inf(0)
               --BODY-- State: 0 0 1 0 0 State: 1 {0} 1 1 1 1 --END--"#,
            "F(a & !b)",
        ),
        // No propositions, no `States:`, dead ends, unused sets, parentheses in the condition.
        (
            r#"HOA: v1 Start: 0 AP: 0 Acceptance: 3 (Inf(2)&(t))
               --BODY-- State: 0 {0 2} [t] 0 [t] 7 --END--"#,
            "1",
        ),
        // No start: no run.
        (
            r#"HOA: v1 States: 1 AP: 0 Acceptance: 0 t --BODY-- State: 0 [t] 0 --END--"#,
            "0",
        ),
    ] {
        assert!(means(&read(text), formula), "{formula}: {text}");
    }
}

#[test]
fn states_of_a_büchi_automaton_keep_their_numbers() {
    let text = r#"HOA: v1 States: 4 Start: 2 AP: 1 "a" Acceptance: 1 Inf(0)
        --BODY-- State: 2 [0] 1 State: 1 {0} [t] 1 State: 3 [t] 3 --END--"#;
    let nba = read(text);
    assert_eq!(nba.len(), 4);
    assert_eq!(nba.initial[0].0, 2);
    assert_eq!(nba.accepting, [false, true, false, false]);
    assert_eq!(nba.trimmed().len(), 2);
}

#[test]
fn streams_hold_several_automata() {
    let text = format!("{GENERALIZED}\n/* next */ {GENERALIZED}");
    let all = read_hoa_stream(&text, &Limits::default()).unwrap();
    assert_eq!(all.len(), 2);
    assert!(
        all.iter()
            .all(|nba| nba.alphabet.len() == 4 && means(nba, "GFa & GFb"))
    );
    assert!(matches!(refuse(&text).kind, HoaErrorKind::Expected { .. }));
    assert_eq!(
        read_hoa_stream("  /* nothing */ ", &Limits::default()),
        Ok(vec![])
    );
}

#[test]
fn everything_else_is_refused_by_name() {
    let with = |header: &str, body: &str| {
        format!("HOA: v1\nStates: 2\nStart: 0\nAP: 1 \"a\"\n{header}\n--BODY--\n{body}\n--END--\n")
    };
    let buchi = "Acceptance: 1 Inf(0)";
    for (text, part) in [
        (with("Acceptance: 1 Fin(0)", ""), "`Fin`"),
        (with("Acceptance: 2 Inf(0)&Fin(1)", ""), "`Fin`"),
        (with("Acceptance: 1 Inf(!0)", ""), "complemented"),
        (with("Acceptance: 2 Inf(0)|Inf(1)", ""), "`|`"),
        (with("Acceptance: 0 f", ""), "`f`"),
        (with(&format!("{buchi}\nGoto: 3"), ""), "`Goto:`"),
        (with(buchi, "State: 0\n[t] 0&1"), "alternation"),
        ("HOA: v2\n".to_owned(), "version `v2`"),
        (with(buchi, "State: 0\n--ABORT--"), "aborted"),
        (
            with(buchi, "State: 0 [0] 2"),
            "state 2 is not one of the 2 states",
        ),
        (with(buchi, "State: 0 [1] 1"), "proposition 1"),
        (with(buchi, "State: 0 [@x] 1"), "`@x` is not defined"),
        (with(buchi, "State: 0 [0] 1 {1}"), "set 1"),
        (with(buchi, "State: 0 [0] 1 State: 0 [0] 1"), "listed twice"),
        (
            with(buchi, "State: [0] 0 [0] 1"),
            "although its state has one",
        ),
        (with(buchi, "State: 0 1"), "one edge for each"),
        (with(buchi, "State: 0 1 [0] 1"), "mixed"),
        (with(&format!("{buchi}\n{buchi}"), ""), "stands twice"),
        (with("", ""), "no `Acceptance:`"),
        (
            "HOA: v1 Start: 0 AP: 2 \"a\" Acceptance: 0 t".to_owned(),
            "2 propositions are announced",
        ),
        ("HOA: v1 AP: 2 \"a\" \"a\"".to_owned(), "named twice"),
        (
            "HOA: v1 AP: 1 \"kitchen\"".to_owned(),
            "`kitchen` is not one of the regions (a, b, c)",
        ),
        (
            "HOA: v1 States: 4000000000".to_owned(),
            "more than 20000 states",
        ),
        ("HOA: v1 /* x".to_owned(), "comment has no end"),
        ("HOA: v1 name: \"x".to_owned(), "string has no end"),
        ("HOA: v1 $".to_owned(), "found `$`"),
        ("".to_owned(), "expected `HOA: v1`"),
        (
            with(buchi, &format!("State: 0 [{}0] 1", "!".repeat(100_000))),
            "levels of nesting",
        ),
        (
            with(buchi, &format!("State: 0 [{}0", "(".repeat(100_000))),
            "levels of nesting",
        ),
    ] {
        let error = refuse(&text);
        assert!(error.to_string().contains(part), "{part}: {error}");
    }
}

#[test]
fn errors_point_at_the_place() {
    let text =
        "HOA: v1\nStates: 1\nStart: 0\nAP: 1 \"a\"\nAcceptance: 1 Fin(0)\n--BODY--\n--END--\n";
    let error = refuse(text);
    assert_eq!((error.line, error.column), (5, 15));
    let expected = "\
error: an acceptance condition with `Fin` is not supported: give a Büchi or generalised Büchi automaton
 --> mission.hoa:5:15
  |
5 | Acceptance: 1 Fin(0)
  |               ^^^";
    assert_eq!(
        error.render(Some("mission.hoa"), false).trim_end(),
        expected
    );
}

#[test]
fn what_is_written_is_the_standard_form() {
    let names = ["a", "b"].map(str::to_owned).to_vec();
    let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
    let formula: Formula = "!a U b".parse().unwrap();
    let nba = translate(&formula, alphabet, &Limits::default()).unwrap();
    let expected = r#"HOA: v1
name: "!a U b"
States: 2
Start: 0
AP: 2 "a" "b"
acc-name: Buchi
Acceptance: 1 Inf(0)
properties: trans-labels explicit-labels state-acc
--BODY--
State: 0
[!0&!1] 0
[1] 1
State: 1 {0}
[t] 1
--END--
"#;
    assert_eq!(nba.to_hoa(Some(&formula.to_string())), expected);
    let dot = nba.to_dot(None);
    assert!(
        dot.contains("0 -> 1 [label=\"b\"]") && dot.contains("1 [shape=doublecircle]"),
        "{dot}"
    );
}
