//! Missions without a plan: each says why, by the facts of its map.

use nngtl::automaton::TaskError;
use nngtl::mission::{self, LetterFact, MissionError, NotOnThisMap, Options, SamplerChoice};
use nngtl::planner::{PlanError, Settings};
use nngtl::scenario::{Scenario, ScenarioSpec};

const MAP: &str = r#"
start = [0.5, 0.05]
[workspace]
bounds = [[0, 0], [1, 1]]
obstacles = [
    [[0.0, 0.6], [0.3, 0.6], [0.3, 0.65], [0.0, 0.65]],
    [[0.3, 0.6], [0.35, 0.6], [0.35, 1.0], [0.3, 1.0]],
    [[0.7, 0.7], [0.8, 0.7], [0.8, 0.8], [0.7, 0.8]],
]
[workspace.regions]
a = [[0.1, 0.1], [0.3, 0.1], [0.3, 0.3], [0.1, 0.3]]
inner = [[0.15, 0.15], [0.2, 0.15], [0.2, 0.2], [0.15, 0.2]]
b = [[0.6, 0.1], [0.8, 0.1], [0.8, 0.3], [0.6, 0.3]]
locked = [[0.1, 0.75], [0.2, 0.75], [0.2, 0.85], [0.1, 0.85]]
buried = [[0.72, 0.72], [0.78, 0.72], [0.78, 0.78], [0.72, 0.78]]
"#;

fn failure(task: &str, sampler: SamplerChoice, iterations: u64) -> MissionError {
    let mut spec: ScenarioSpec = toml::from_str(MAP).unwrap();
    spec.task = Some(task.to_owned());
    let scenario = Scenario::from_spec(&spec).unwrap();
    let options = Options {
        sampler,
        settings: Settings {
            iterations,
            ..Settings::default()
        },
        ..Options::default()
    };
    mission::plan(&scenario, &options).expect_err(task)
}

#[test]
fn formulas_that_nothing_satisfies_are_told_apart_from_those_that_this_map_rules_out() {
    let why = failure("<> a && [] !a", SamplerChoice::Biased, 10);
    assert!(
        matches!(why, MissionError::Task(TaskError::Unsatisfiable)),
        "{why}"
    );

    let facts = |task| match failure(task, SamplerChoice::Biased, 10) {
        MissionError::NotOnThisMap(why) => why.facts,
        other => panic!("{task}: {other}"),
    };
    let disjoint = LetterFact::Disjoint {
        region: "a".into(),
        other: "b".into(),
    };
    assert_eq!(facts("<> (a && b)"), std::slice::from_ref(&disjoint));
    assert_eq!(facts("<> (a && b) && [] (inner -> a)"), [disjoint]);
    let inside = LetterFact::Inside {
        region: "inner".into(),
        other: "a".into(),
    };
    assert_eq!(facts("<> inner && [] !a"), [inside]);
    let hidden = LetterFact::Hidden {
        region: "buried".into(),
    };
    assert_eq!(facts("<> buried || <> (buried && a)"), [hidden]);
    let both = facts("<> (a && b) || (<> inner && [] !a)");
    assert_eq!(both.len(), 2, "{both:?}");
}

/// What a map of sixteen regions rules out is found in the part of the task that asks for it, however large the rest is.
#[test]
fn facts_are_found_in_tasks_of_many_regions() {
    let mut spec: ScenarioSpec = toml::from_str(MAP).unwrap();
    spec.workspace.regions.0.clear();
    for k in 0..16 {
        let (x, y) = (
            0.05 + 0.23 * f64::from(k % 4),
            0.08 + 0.13 * f64::from(k / 4),
        );
        let square = [[x, y], [x + 0.1, y], [x + 0.1, y + 0.1], [x, y + 0.1]];
        spec.workspace
            .regions
            .0
            .push((format!("r{k}"), square.to_vec()));
    }
    let others: Vec<String> = (0..16).map(|k| format!("<> r{k}")).collect();
    let others = others.join(" && ");
    let patrol = others.replace("<>", "[]<>");
    let disjoint = LetterFact::Disjoint {
        region: "r3".into(),
        other: "r8".into(),
    };
    for task in [
        // More than can be translated.
        format!("{others} && <> (r3 && r8)"),
        format!("{patrol} && []<> (r3 && r8)"),
        // Two parts together.
        format!("{patrol} && <> r3 && [] (r3 -> r8)"),
    ] {
        spec.task = Some(task.clone());
        let scenario = Scenario::from_spec(&spec).unwrap();
        let why = mission::plan(&scenario, &Options::default()).unwrap_err();
        let MissionError::NotOnThisMap(why) = why else {
            panic!("{task}: {why}");
        };
        assert_eq!(why.facts, std::slice::from_ref(&disjoint), "{task}");
    }
}

#[test]
fn a_task_that_is_broken_at_the_start_says_so() {
    for (task, needs) in [
        ("a", "wants {a} or {a,inner} at once"),
        ("!b U inner && inner", "wants {a,inner} at once"),
        ("[] b", "wants {b} at once"),
    ] {
        for sampler in [SamplerChoice::Biased, SamplerChoice::Exact] {
            let why = failure(task, sampler, 10);
            let MissionError::Unreachable(found) = &why else {
                panic!("{task}: {why}");
            };
            assert_eq!(found.at_start.as_ref().unwrap().sees, "{}");
            let text = why.to_string();
            assert!(text.contains(needs) && text.contains("F, or <>"), "{text}");
        }
    }
    // What comes later is no matter of the start.
    let why = failure("<> locked", SamplerChoice::Biased, 10);
    assert!(matches!(why, MissionError::Unreachable(why) if why.at_start.is_none()));
}

#[test]
fn walls_are_named_for_every_sampler() {
    for sampler in [SamplerChoice::Biased, SamplerChoice::Exact] {
        let why = failure("<> a && <> locked", sampler, 10);
        let text = why.to_string();
        let MissionError::Unreachable(why) = why else {
            panic!("{text}");
        };
        assert_eq!(why.places.len(), 1, "{text}");
        let place = &why.places[0];
        assert_eq!(
            (place.letter.as_str(), &place.regions[..]),
            ("{locked}", &["locked".to_owned()][..])
        );
        let walls = &place.walls[0];
        assert_eq!(walls.obstacles, ["obstacle 1", "obstacle 2"]);
        assert!(walls.bounds && !walls.around_start, "{walls:?}");
        assert!(
            text.contains("obstacle 1, obstacle 2 and the end of the map"),
            "{text}"
        );
    }
    // Not needed: not told.
    let mut spec: ScenarioSpec = toml::from_str(MAP).unwrap();
    spec.task = Some("<> a || <> locked".to_owned());
    let scenario = Scenario::from_spec(&spec).unwrap();
    let options = Options {
        sampler: SamplerChoice::Exact,
        ..Options::default()
    };
    assert!(mission::plan(&scenario, &options).is_ok());
    // The robot itself is locked in: said once, however many places that keeps it from.
    spec.start = [0.05, 0.9];
    spec.task = Some("<> a && <> b".to_owned());
    let why = mission::plan(&Scenario::from_spec(&spec).unwrap(), &options).unwrap_err();
    let text = why.to_string();
    assert!(text.contains(" and {b} cannot be reached"), "{text}");
    assert_eq!(text.matches("walled in").count(), 1, "{text}");
    spec.task = Some("<> b".to_owned());
    let scenario = Scenario::from_spec(&spec).unwrap();
    match mission::plan(&scenario, &options).unwrap_err() {
        MissionError::Unreachable(why) => {
            let walls = &why.places[0].walls[0];
            assert!(walls.around_start, "{why}");
            assert_eq!(walls.regions, ["locked"]);
        }
        other => panic!("{other}"),
    }
}

const RINGS: &str = r#"
start = [0.1, 0.1]
[workspace]
bounds = [[0, 0], [1, 1]]
obstacles = [[[0.6, 0.0], [0.65, 0.0], [0.65, 0.4], [0.6, 0.4]]]
[workspace.regions]
wall = [[0.6, 0.4], [0.65, 0.4], [0.65, 1.0], [0.6, 1.0]]
goal = [[0.8, 0.4], [0.9, 0.4], [0.9, 0.6], [0.8, 0.6]]
yard = [[0.2, 0.4], [0.5, 0.4], [0.5, 0.7], [0.2, 0.7]]
house = [[0.3, 0.5], [0.4, 0.5], [0.4, 0.6], [0.3, 0.6]]
"#;

fn ring(task: &str, sampler: SamplerChoice) -> Result<(), MissionError> {
    let mut spec: ScenarioSpec = toml::from_str(RINGS).unwrap();
    spec.task = Some(task.to_owned());
    let scenario = Scenario::from_spec(&spec).unwrap();
    let options = Options {
        sampler,
        ..Options::default()
    };
    mission::plan(&scenario, &options).map(|_| ())
}

#[test]
fn regions_that_the_task_forbids_are_named_where_every_way_leads_through_them() {
    for sampler in [SamplerChoice::Biased, SamplerChoice::Exact] {
        let why = |task: &str| match ring(task, sampler) {
            Err(MissionError::Unreachable(why)) => why,
            other => panic!("{task}: {other:?}"),
        };
        let shut = why("<> goal && [] !wall");
        assert_eq!(shut.through, ["wall"]);
        assert_eq!(shut.beyond, ["goal"]);
        assert!(shut.places.is_empty());
        let text = shut.to_string();
        assert!(
            text.contains("`goal` cannot be reached without crossing `wall`"),
            "{text}"
        );
        // Nested: the house stands in the yard.
        let inside = why("<> house && (!yard U goal) && [] !wall");
        assert_eq!(inside.through, ["wall"], "{inside}");
        let nested = why("!yard U (yard && house)");
        assert_eq!(nested.through, ["yard"], "{nested}");
        // In the right order all is well.
        for task in ["<> goal && (!wall U house)", "<> wall && [] !goal"] {
            ring(task, sampler).unwrap();
        }
        // Between two regions that do not touch there is always something else.
        let apart = why("<> (goal && (goal U yard))");
        assert!(apart.through.is_empty(), "{apart}");
        assert!(apart.to_string().contains("orders of visits"), "{apart}");
    }
}

#[test]
fn a_spent_budget_tells_how_far_the_automaton_got() {
    match failure("<> (a && <> (b && <> a))", SamplerChoice::Uniform, 1) {
        MissionError::Plan(PlanError::NotFound(why)) => {
            let [reached, states] = why.states;
            assert!(0 < reached && reached < states, "{:?}", why.states);
            assert!(why.steps_left > 0 && !why.missing.is_empty());
        }
        other => panic!("{other}"),
    }
}

/// What is said of a task on a map that rules it out.
fn ruled_out(spec: &ScenarioSpec, task: &str) -> NotOnThisMap {
    let spec = ScenarioSpec {
        task: Some(task.to_owned()),
        ..spec.clone()
    };
    let scenario = Scenario::from_spec(&spec).unwrap();
    let why = mission::plan(&scenario, &Options::default()).expect_err(task);
    let MissionError::NotOnThisMap(why) = why else {
        panic!("{task}: {why}");
    };
    why
}

#[test]
fn three_regions_that_meet_in_pairs_alone_are_named() {
    let text = r#"
start = [0.1, 0.1]
task = "F (a & b & c)"
[workspace]
bounds = [[0, 0], [1, 1]]
[workspace.regions]
a = [[0.3, 0.3], [0.7, 0.3], [0.7, 0.4], [0.3, 0.4]]
b = [[0.3, 0.3], [0.4, 0.3], [0.4, 0.7], [0.3, 0.7]]
c = [[0.7, 0.32], [0.7, 0.38], [0.36, 0.7], [0.30, 0.7]]
d = [[0.8, 0.8], [0.9, 0.8], [0.9, 0.9]]
"#;
    let spec: ScenarioSpec = toml::from_str(text).unwrap();
    let apart = LetterFact::Apart {
        regions: ["a", "b", "c"].map(String::from).to_vec(),
    };
    for task in ["F (a & b & c)", "F (a & b & c) & G F d"] {
        let why = ruled_out(&spec, task);
        assert_eq!(why.facts, std::slice::from_ref(&apart), "{task}");
        assert!(why.to_string().contains("all of `a`, `b` and `c`"), "{why}");
    }
}

/// `a` is covered by `b` and `c` together, though by neither of them; and nine regions apart from each other in one conjunct.
#[test]
fn what_several_regions_cover_together_and_conjuncts_of_many_regions_are_explained() {
    let mut text = r#"
start = [0.1, 0.1]
task = "F (a & !b & !c)"
[workspace]
bounds = [[0, 0], [1, 1]]
[workspace.regions]
a = [[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]]
b = [[0.4, 0.4], [0.5, 0.4], [0.5, 0.6], [0.4, 0.6]]
c = [[0.5, 0.4], [0.6, 0.4], [0.6, 0.6], [0.5, 0.6]]
"#
    .to_owned();
    for (k, name) in ["r1", "r2", "r3", "r4", "r5", "r6", "r7", "r8"]
        .iter()
        .enumerate()
    {
        let (x, y) = (0.1 * k as f64, 0.9);
        let (right, top) = (x + 0.05, y + 0.05);
        text += &format!("{name} = [[{x}, {y}], [{right}, {y}], [{right}, {top}], [{x}, {top}]]\n");
    }
    let spec: ScenarioSpec = toml::from_str(&text).unwrap();
    let within = LetterFact::Within {
        regions: vec!["a".to_owned()],
        others: vec!["b".to_owned(), "c".to_owned()],
    };
    let why = ruled_out(&spec, "F (a & !b & !c)");
    assert_eq!(why.facts, [within]);
    assert!(why.to_string().contains("`a` lies in `b` or `c`"), "{why}");
    let disjoint = LetterFact::Disjoint {
        region: "r1".to_owned(),
        other: "a".to_owned(),
    };
    let why = ruled_out(
        &spec,
        "F (r1 & a | r1 & r2 & r3 & r4 & r5 & r6 & r7 & r8 & a)",
    );
    assert_eq!(why.facts, [disjoint]);
}
