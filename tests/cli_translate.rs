//! The program itself, on formulas.

mod cli;

use cli::{nngtl, shipped};

#[test]
fn an_automaton_is_written_as_text_hoa_and_dot() {
    let formula = "[]<> l1 && (!l1 U l2) && <> l3";
    let text = nngtl(&["translate", formula]);
    assert_eq!((text.code, text.err.as_str()), (0, ""), "{text:?}");
    assert!(
        text.out.starts_with("5 states, "),
        "the case study's automaton: {text:?}"
    );
    let hoa = nngtl(&["translate", formula, "--format", "hoa"]);
    for line in [
        "HOA: v1",
        "States: 5",
        "AP: 3 \"l1\" \"l2\" \"l3\"",
        "--END--",
    ] {
        assert!(hoa.out.contains(line), "{line}: {hoa:?}");
    }
    let dot = nngtl(&["translate", formula, "--format", "dot"]);
    assert!(dot.out.starts_with("digraph"), "{dot:?}");
}

#[test]
fn a_map_takes_letters_away() {
    let states = |more: &[&str]| {
        let mut words = vec!["translate", "<> (l1 && l2) || <> l3", "--json"];
        words.extend(more);
        let run = nngtl(&words);
        assert_eq!(run.code, 0, "{run:?}");
        run.json()
    };
    let map = shipped("case-study.toml");
    let (free, mapped) = (states(&[]), states(&["--scenario", &map]));
    assert_eq!(
        (free["letters"].as_u64(), mapped["letters"].as_u64()),
        (Some(8), Some(4))
    );
    // On the map l1 and l2 are apart: the guard is l3 alone.
    assert!(free["automaton"].as_str().unwrap().contains("l2"));
    assert!(
        !mapped["automaton"].as_str().unwrap().contains("l2"),
        "{mapped}"
    );
}

#[test]
fn errors_show_a_caret() {
    let run = nngtl(&["translate", "a U (b"]);
    assert_eq!(run.code, 2, "{run:?}");
    let lines: Vec<&str> = run.err.lines().collect();
    assert!(lines[0].contains("never closed"), "{run:?}");
    assert_eq!(
        lines[2].as_bytes()[lines[3].find('^').unwrap()],
        b'(',
        "{run:?}"
    );

    let run = nngtl(&[
        "translate",
        "<> l9",
        "--scenario",
        &shipped("case-study.toml"),
    ]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("unknown proposition `l9`"), "{run:?}");

    let long: Vec<String> = (0..14).map(|i| format!("<> p{i}")).collect();
    let run = nngtl(&["translate", &long.join(" && ")]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(
        run.err.contains("14 propositions") && run.err.contains("--scenario"),
        "{run:?}"
    );
}

#[test]
fn names_that_begin_like_operators_are_told() {
    let run = nngtl(&["translate", "Goal"]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(run.err.contains("`Goal` is read as `G oal`"), "{run:?}");
    for plain in ["\"Goal\"", "GFa", "GFp1 & Xb", "G load", "F(dock)"] {
        let run = nngtl(&["translate", plain]);
        assert_eq!((run.code, run.err.as_str()), (0, ""), "{plain}: {run:?}");
    }
}

#[test]
fn an_empty_automaton_is_told() {
    let run = nngtl(&["translate", "a & !a"]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(run.err.contains("no word satisfies"), "{run:?}");
    let scenario = shipped("case-study.toml");
    let run = nngtl(&["translate", "F (l1 & l2)", "--scenario", &scenario]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(run.err.contains("letters of this map"), "{run:?}");
}
