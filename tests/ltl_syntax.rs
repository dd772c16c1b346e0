//! The grammar of formulas: every alias, precedence, errors with their places, printing.

use nngtl::ltl::{Formula, ParseErrorKind, ParseOptions, Unsupported, check_propositions, parse};

fn read(text: &str) -> Formula {
    text.parse().unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn error(text: &str) -> nngtl::ltl::ParseError {
    parse(text, &ParseOptions::default()).expect_err(text)
}

#[test]
fn aliases_mean_the_same() {
    for (canonical, aliases) in [
        ("!a", vec!["~a", "NOT a", "not a", "! a", "¬a"]),
        (
            "a & b",
            vec!["a && b", "a /\\ b", "a AND b", "a and b", "a&b", "a ∧ b"],
        ),
        (
            "a | b",
            vec!["a || b", "a \\/ b", "a OR b", "a or b", "a ∨ b"],
        ),
        (
            "a -> b",
            vec!["a => b", "a --> b", "a → b", "a ⇒ b", "a implies b"],
        ),
        (
            "a <-> b",
            vec!["a <=> b", "a <--> b", "a ⇔ b", "a ↔ b", "a equivalent b"],
        ),
        ("!(a <-> b)", vec!["a xor b", "a ^ b", "a XOR b"]),
        (
            "Fa",
            vec!["<>a", "F a", "F(a)", "<> a", "◇a", "◊ a", "eventually a"],
        ),
        ("Ga", vec!["[]a", "□a", "G a", "always a", "always(a)"]),
        ("Xa", vec!["X a", "X(a)", "○a", "next a"]),
        ("a R b", vec!["a V b", "a Rb", "a release b"]),
        ("a W b", vec!["a weakuntil b"]),
        (
            "a U b",
            vec![
                "a Ub",
                "(a)U(b)",
                "a U\n\tb",
                "a until b",
                "a stronguntil b",
            ],
        ),
        ("1", vec!["true", "TRUE", "True"]),
        ("0", vec!["false"]),
        ("a", vec!["\"a\"", "((a))"]),
    ] {
        for alias in aliases {
            assert_eq!(read(alias), read(canonical), "{alias}");
        }
    }
}

#[test]
fn operators_bind_as_in_spot() {
    for (text, grouped) in [
        ("a | b & c", "a | (b & c)"),
        ("a & b | c & d", "(a & b) | (c & d)"),
        ("a -> b -> c", "a -> (b -> c)"),
        ("a <-> b -> c", "a <-> (b -> c)"),
        ("a -> b <-> c", "a -> (b <-> c)"),
        ("a | b -> c", "(a | b) -> c"),
        ("a | b xor c & d", "a | (b xor (c & d))"),
        ("a U b U c", "a U (b U c)"),
        ("a U b R c W d M e", "a U (b R (c W (d M e)))"),
        ("a & b U c", "a & (b U c)"),
        ("!a U b", "(!a) U b"),
        ("Fa U Gb", "(Fa) U (Gb)"),
        ("a & b & c", "(a & b) & c"),
        ("X a & b", "(Xa) & b"),
    ] {
        assert_eq!(read(text), read(grouped), "{text}");
    }
}

#[test]
fn operators_run_into_names() {
    for (text, spaced) in [
        ("GFa", "G F a"),
        ("FGp1", "F G p1"),
        ("XXa", "X X a"),
        ("FG!a", "F G !a"),
        ("F!Gb", "F !G b"),
        ("aUFb", "\"aUFb\""),
        ("a UFb", "a U F b"),
        ("a U Ub", "a U \"Ub\""),
        ("Fd U !G(g)", "(F d) U (!(G g))"),
        ("G1", "\"G1\""),
        ("FRED", "F \"RED\""),
        ("[]<>GFa", "G F G F a"),
    ] {
        assert_eq!(read(text), read(spaced), "{text}");
    }
    let known = ParseOptions {
        known: vec!["Goal".to_owned(), "true".to_owned()],
        ..ParseOptions::default()
    };
    let parsed = parse("FGoal & GGoal & true", &known).unwrap();
    let goal = || Formula::prop("Goal");
    assert_eq!(
        parsed.formula,
        goal()
            .finally()
            .and(goal().globally())
            .and(Formula::prop("true")),
    );
    assert_eq!(parse("F Goal", &known).unwrap().formula, goal().finally());
}

#[test]
fn printing_is_minimal_and_reads_back() {
    for (text, printed) in [
        ("(a & b) & c", "a & b & c"),
        ("a & (b & c)", "a & (b & c)"),
        ("(a U b) U c", "(a U b) U c"),
        ("a U (b U c)", "a U b U c"),
        ("(a -> b) -> c", "(a -> b) -> c"),
        ("a -> b -> c", "a -> b -> c"),
        ("a -> (b <-> c)", "a -> (b <-> c)"),
        ("G(a & F b)", "G(a & Fb)"),
        ("!(!a)", "!!a"),
        ("F(true)", "F(1)"),
        ("!1", "!1"),
        ("F \"Goal\"", "F\"Goal\""),
        ("F \"a b\\\"c\\\\\"", "F\"a b\\\"c\\\\\""),
        ("\"true\" & F1", "\"true\" & F1"),
        ("(a | b) & c U (d & e)", "(a | b) & c U (d & e)"),
    ] {
        let formula = read(text);
        assert_eq!(formula.to_string(), printed);
        assert_eq!(read(printed), formula, "{text}");
    }
}

#[test]
fn errors_know_kind_and_place() {
    use ParseErrorKind as K;
    type Check = fn(&K) -> bool;
    let cases: [(&str, std::ops::Range<usize>, Check); 18] = [
        ("", 0..0, |k| matches!(k, K::UnexpectedEnd { .. })),
        ("a &", 3..3, |k| matches!(k, K::UnexpectedEnd { .. })),
        (
            "a b",
            2..3,
            |k| matches!(k, K::Unexpected { found, .. } if found == "b"),
        ),
        (
            "a & & b",
            4..5,
            |k| matches!(k, K::Unexpected { found, .. } if found == "&"),
        ),
        ("(a | b", 0..1, |k| matches!(k, K::Unclosed)),
        ("a | b)", 5..6, |k| matches!(k, K::Unopened)),
        ("F \"ab", 2..5, |k| matches!(k, K::UnterminatedName)),
        ("F \"\"", 2..4, |k| matches!(k, K::EmptyName)),
        (
            "a & 12",
            4..6,
            |k| matches!(k, K::Unexpected { found, .. } if found == "12"),
        ),
        ("a # b", 2..3, |k| matches!(k, K::Unexpected { .. })),
        ("{a;b}[]->c", 0..1, |k| {
            matches!(k, K::Unsupported(Unsupported::RegularExpression))
        }),
        ("X[!] a", 1..4, |k| {
            matches!(k, K::Unsupported(Unsupported::StrongNext))
        }),
        ("F[2:5] a", 1..2, |k| {
            matches!(k, K::Unsupported(Unsupported::Bounds))
        }),
        ("a & Y b", 4..5, |k| {
            matches!(k, K::Unsupported(Unsupported::Past))
        }),
        ("a S b", 2..3, |k| {
            matches!(k, K::Unsupported(Unsupported::Past))
        }),
        ("AG a", 0..2, |k| {
            matches!(k, K::Unsupported(Unsupported::PathQuantifier))
        }),
        ("p=1 U q=0", 1..2, |k| {
            matches!(k, K::Unsupported(Unsupported::Values))
        }),
        ("a & é ∧ ☃", 11..14, |k| {
            matches!(k, K::Unexpected { .. })
        }),
    ];
    for (text, span, expected) in cases {
        let error = error(text);
        assert!(expected(&error.kind), "{text}: {:?}", error.kind);
        assert_eq!(error.span, span, "{text}: {error}");
        assert!(error.render(None, false).contains('^'), "{text}");
    }
}

#[test]
fn a_rendered_error_points_at_the_place() {
    let text = error("[]<> l1 && (!l1 U ) && <> l3").render(Some("mission.toml"), false);
    let expected = "\
error: unexpected `)`
 --> mission.toml:1:19
  |
1 | []<> l1 && (!l1 U ) && <> l3
  |                   ^ expected a proposition, `!`, `X`, `F`, `G`, `true`, `false` or `(`";
    assert_eq!(text.trim_end(), expected);
}

#[test]
fn unknown_propositions_are_named_with_what_was_meant() {
    let parsed = parse("F kitchn & G !door", &ParseOptions::default()).unwrap();
    let error = check_propositions(&parsed, &["kitchen", "door"]).unwrap_err();
    assert_eq!(error.span, 2..8);
    let text = error.to_string();
    assert!(text.contains("did you mean `kitchen`?"), "{text}");
    assert!(check_propositions(&parsed, &["kitchn", "door"]).is_ok());
    let error = check_propositions(&parsed, &["door", "hall"]).unwrap_err();
    assert!(
        error.to_string().contains("the names are door, hall"),
        "{error}"
    );
}

#[test]
fn deep_formulas_are_refused_not_overflowed() {
    for text in [
        "(".repeat(100_000),
        "!".repeat(100_000),
        "a & ".repeat(100_000),
        "a -> ".repeat(100_000),
        "a U (".repeat(100_000),
        format!("{}a", "GF".repeat(100_000)),
    ] {
        let error = error(&text);
        assert!(
            matches!(error.kind, ParseErrorKind::TooDeep { limit: 500 }),
            "{:?}",
            error.kind
        );
    }
    let deep = format!("{}a", "X".repeat(499));
    assert_eq!(read(&deep).depth(), 500);
    assert_eq!(read(&deep).to_string(), deep);
}
