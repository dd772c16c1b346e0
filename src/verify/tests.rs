use std::sync::Arc;

use super::*;
use crate::alphabet::Props;
use crate::automaton::{StateId, Transition};
use crate::workspace::{Bounds, Polygon, Region};

/// Unit square, a wall in the middle with a gap above, region `a` left, `b` right, `c` overlapping
/// the upper half of `b`.
fn map() -> Workspace {
    let rect =
        |x0, y0, x1, y1| Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1)).unwrap();
    let region = |name: &str, polygon| Region {
        name: name.into(),
        polygon,
    };
    let regions = vec![
        region("a", rect(0.1, 0.4, 0.3, 0.6)),
        region("b", rect(0.7, 0.4, 0.9, 0.6)),
        region("c", rect(0.7, 0.5, 0.9, 0.8)),
    ];
    Workspace::new(Bounds::unit(), vec![rect(0.45, 0.0, 0.55, 0.8)], regions).unwrap()
}

fn points(list: &[(f64, f64)]) -> Vec<Waypoint> {
    let waypoint = |&(x, y): &(f64, f64)| Waypoint {
        at: Point2::new(x, y),
        state: StateId(0),
    };
    list.iter().map(waypoint).collect()
}

fn path(prefix: &[(f64, f64)], suffix: &[(f64, f64)]) -> Path {
    Path {
        prefix: points(prefix),
        suffix: points(suffix),
    }
}

fn check(task: &str, path: &Path) -> Result<Verified, Refusal> {
    let formula: Formula = task.parse().unwrap();
    verify(&map(), path.prefix[0].at, &formula, path, 0.2, None)
}

/// To `a`, above the wall, into `b` from below, and stay there.
fn good() -> Path {
    let prefix = [
        (0.2, 0.1),
        (0.2, 0.5),
        (0.2, 0.9),
        (0.95, 0.9),
        (0.95, 0.45),
        (0.8, 0.45),
    ];
    path(&prefix, &[(0.8, 0.45)])
}

#[test]
fn a_good_plan_passes_and_its_word_is_told() {
    let verified = check("<> a && <>[] b && !b U a && []!c", &good()).unwrap();
    assert_eq!(verified.word.show(map().alphabet()), "{} {a} {} ({b})^ω");
    assert_eq!(verified.cost.suffix, 0.0);
    assert!((verified.cost.total - 0.2 * length(&good().prefix)).abs() < 1e-15);
}

#[test]
fn a_loop_is_read_for_ever() {
    let lap = [
        (0.2, 0.5),
        (0.2, 0.9),
        (0.95, 0.9),
        (0.8, 0.7),
        (0.8, 0.55),
        (0.8, 0.45),
    ];
    let back: Vec<(f64, f64)> = lap.iter().rev().skip(1).copied().collect();
    let lap: Vec<(f64, f64)> = lap.into_iter().chain(back).collect();
    let plan = path(&[(0.2, 0.1), (0.2, 0.5)], &lap);
    let verified = check("[]<> a && []<> (b && !c) && []<> (b && c)", &plan).unwrap();
    assert_eq!(
        verified.word.show(map().alphabet()),
        "{} ({a} {} {c} {b,c} {b} {b,c} {c} {})^ω"
    );
    assert!(verified.cost.suffix > 1.0);
}

#[test]
fn a_mission_that_is_not_fulfilled_is_told_with_word_and_part() {
    let refusal = check("<> a && []<> a", &good()).unwrap_err();
    let text = refusal.to_string();
    assert!(text.contains("{} {a} {} ({b})^ω"), "{text}");
    assert!(text.ends_with("that GFa"), "{text}");
}

#[test]
fn the_segment_rule_holds_on_every_leg() {
    // Through `a` in one leg: in and out again.
    let plan = path(&[(0.05, 0.5), (0.4, 0.5)], &[(0.4, 0.5)]);
    let refusal = check("true", &plan).unwrap_err();
    assert!(
        matches!(&refusal, Refusal::SegmentRule { part: Part::Prefix, leg: 0, letters } if letters == "{} {a} {}"),
        "{refusal}"
    );
    // The closing leg of a loop is a leg like any other.
    let suffix = [(0.2, 0.3), (0.05, 0.3), (0.05, 0.7), (0.2, 0.7), (0.2, 0.3)];
    let refusal = check("true", &path(&[(0.2, 0.3)], &suffix)).unwrap_err();
    assert!(
        matches!(
            refusal,
            Refusal::SegmentRule {
                part: Part::Suffix,
                leg: 3,
                ..
            }
        ),
        "{refusal}"
    );
}

#[test]
fn a_leg_through_a_wall_or_out_of_bounds_is_told_with_its_place() {
    let refusal = check("true", &path(&[(0.2, 0.1), (0.8, 0.1)], &[(0.8, 0.1)])).unwrap_err();
    let Refusal::Blocked {
        part: Part::Prefix,
        leg: 0,
        obstacle: Some(0),
        at,
    } = refusal
    else {
        panic!("{refusal}");
    };
    assert!((0.45..=0.55).contains(&at.x), "{at}");
    let refusal = check("true", &path(&[(0.2, 0.1), (0.2, -0.1)], &[(0.2, -0.1)])).unwrap_err();
    assert!(
        matches!(refusal, Refusal::NotFree { index: 1, .. }),
        "{refusal}"
    );
    let refusal = check("true", &path(&[(0.5, 0.5)], &[(0.5, 0.5)])).unwrap_err();
    assert!(
        matches!(refusal, Refusal::NotFree { index: 0, .. }),
        "{refusal}"
    );
}

#[test]
fn touching_a_wall_or_a_region_is_allowed_and_unseen() {
    // Along the wall's side, over its corner, and along the border of `b`.
    let prefix = [
        (0.45, 0.1),
        (0.45, 0.8),
        (0.55, 0.8),
        (0.65, 0.3),
        (0.7, 0.3),
        (0.7, 0.39),
    ];
    let plan = path(&prefix, &[(0.7, 0.39)]);
    check("[] (!a && !b && !c)", &plan).unwrap();
    let along = path(&[(0.6, 0.4), (0.95, 0.4)], &[(0.95, 0.4)]);
    check("[] !b", &along).unwrap();
}

#[test]
fn the_structure_of_a_plan_is_checked() {
    let mut plan = good();
    plan.suffix = points(&[(0.8, 0.46)]);
    assert!(matches!(
        check("true", &plan).unwrap_err(),
        Refusal::Disconnected { .. }
    ));
    plan.suffix = points(&[(0.8, 0.45), (0.85, 0.45)]);
    assert!(matches!(
        check("true", &plan).unwrap_err(),
        Refusal::NotClosed { .. }
    ));
    plan.suffix.clear();
    assert!(matches!(
        check("true", &plan).unwrap_err(),
        Refusal::Empty { part: Part::Suffix }
    ));
    plan.suffix = points(&[(f64::NAN, 0.0)]);
    assert!(matches!(
        check("true", &plan).unwrap_err(),
        Refusal::NotFinite { .. }
    ));
    let elsewhere = Point2::new(0.2, 0.2);
    let refusal = verify(&map(), elsewhere, &Formula::True, &good(), 0.2, None).unwrap_err();
    assert!(matches!(refusal, Refusal::WrongStart { .. }), "{refusal}");
    let nothing = Path {
        prefix: vec![],
        suffix: vec![],
    };
    let refusal = verify(&map(), elsewhere, &Formula::True, &nothing, 0.2, None).unwrap_err();
    assert!(matches!(refusal, Refusal::Empty { part: Part::Prefix }));
}

#[test]
fn a_stated_cost_must_be_the_paths() {
    let plan = good();
    let cost = Cost::new(length(&plan.prefix), 0.0, 0.2);
    let with = |cost: Cost| {
        verify(
            &map(),
            plan.prefix[0].at,
            &Formula::True,
            &plan,
            0.2,
            Some(&cost),
        )
    };
    with(cost).unwrap();
    for wrong in [
        Cost {
            total: cost.total * 1.001,
            ..cost
        },
        Cost {
            suffix: 0.1,
            ..cost
        },
        Cost {
            prefix: f64::NAN,
            ..cost
        },
    ] {
        assert!(
            matches!(with(wrong), Err(Refusal::Cost { .. })),
            "{wrong:?}"
        );
    }
}

#[test]
fn waiting_points_see_nothing_new_and_next_is_refused() {
    let mut plan = good();
    let again = plan.prefix[1];
    plan.prefix.insert(1, again);
    plan.suffix = vec![plan.suffix[0]; 3];
    assert!(check("<> a && <>[] b", &plan).is_ok());
    assert_eq!(check("X a", &good()).unwrap_err(), Refusal::Next);
    assert!(matches!(
        check("<> nowhere", &good()).unwrap_err(),
        Refusal::Evaluate(_)
    ));
}

#[test]
fn words_show_what_counts() {
    let alphabet = map().alphabet().clone();
    let letter = |names: &[&str]| {
        let props = names.iter().map(|n| alphabet.proposition(n).unwrap());
        alphabet
            .letter(props.fold(Props::EMPTY, Props::with))
            .unwrap()
    };
    let (none, a) = (letter(&[]), letter(&["a"]));
    let word = Lasso {
        prefix: vec![none, none, none, a],
        suffix: vec![a, none, none],
    };
    assert_eq!(word.show(&alphabet), "{} ({a} {})^ω");
    assert_eq!(word.show_counted(&alphabet), "{}^3 {a} ({a} {}^2)^ω");
}

#[test]
fn the_start_inside_a_region_counts() {
    let plan = path(&[(0.2, 0.5), (0.2, 0.3)], &[(0.2, 0.3)]);
    let verified = check("a && <>[] !a", &plan).unwrap();
    assert_eq!(verified.word.show(map().alphabet()), "{a} ({})^ω");
}

/// "Infinitely often `a`" as an automaton: state 1 is entered on `a`.
fn often_a() -> Nba {
    let map = map();
    let alphabet = Arc::clone(map.alphabet());
    let a = alphabet.letters_with(0);
    let row = vec![
        Transition {
            target: StateId(0),
            guard: a.complement(),
        },
        Transition {
            target: StateId(1),
            guard: a,
        },
    ];
    Nba {
        alphabet,
        initial: vec![StateId(0)],
        accepting: vec![false, true],
        transitions: vec![row.clone(), row],
    }
}

#[test]
fn lassos_are_accepted_as_the_automaton_says() {
    let nba = often_a();
    let letter = |p| nba.alphabet.letter(p).unwrap();
    let (none, a, b) = (
        letter(Props::EMPTY),
        letter(Props::single(0)),
        letter(Props::single(1)),
    );
    let accepted = |prefix: &[Letter], suffix: &[Letter]| {
        let word = Lasso {
            prefix: prefix.to_vec(),
            suffix: suffix.to_vec(),
        };
        accepts(&nba, &word)
    };
    assert!(accepted(&[], &[a]));
    assert!(accepted(&[b], &[none, a, b]));
    assert!(!accepted(&[a, a], &[none]));
    assert!(!accepted(&[a], &[b, none]));
}

#[test]
fn a_plan_can_be_checked_against_an_automaton() {
    let map = map();
    let nba = often_a();
    let (start, stay) = (
        Point2::new(0.2, 0.1),
        path(&[(0.2, 0.1), (0.2, 0.5)], &[(0.2, 0.5)]),
    );
    verify_automaton(&map, start, &nba, &stay, 0.2, None).unwrap();
    let refusal = verify_automaton(&map, start, &nba, &good(), 0.2, None).unwrap_err();
    assert!(matches!(refusal, Refusal::NotAccepted { .. }), "{refusal}");
    let mut foreign = nba;
    foreign.alphabet = Arc::new(Alphabet::disjoint(vec!["a".into()]).unwrap());
    let refusal = verify_automaton(&map, start, &foreign, &stay, 0.2, None).unwrap_err();
    assert_eq!(refusal, Refusal::ForeignAlphabet);
}
