use super::*;

const BASE: &str = r#"name = "base"
start = [0.1, 0.1]
task = "[]<> a && !b"

[workspace]
bounds = [[0, 0], [1, 1]]
obstacles = [
    [[0.4, 0.0], [0.6, 0.0], [0.6, 0.7], [0.4, 0.7]],
]

[workspace.regions]
b = [[0.1, 0.8], [0.3, 0.8], [0.2, 0.95]]
a = [[0.7, 0.1], [0.9, 0.1], [0.8, 0.3]]
"#;

/// Loads `text` from a file with this ending.
fn load_as(ending: &str, text: &str) -> Result<Scenario, ScenarioError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("map.{ending}"));
    std::fs::write(&path, text).unwrap();
    Scenario::load(&path)
}

/// The base scenario with one replacement, which must be refused: the message without folder, and
/// the part of the file that the caret marks.
fn refused(from: &str, to: &str) -> (String, ScenarioErrorKind) {
    assert!(BASE.contains(from), "`{from}` is not in the base scenario");
    let error = load_as("toml", &BASE.replace(from, to)).unwrap_err();
    let text = error.to_string();
    let text = text
        .split_once("map.toml")
        .map_or(text.clone(), |t| t.1.to_owned());
    (text, *error.kind)
}

#[test]
fn a_scenario_loads_with_regions_in_file_order() {
    let s = load_as("toml", BASE).unwrap();
    assert_eq!(s.name, "base");
    assert_eq!(s.weight, DEFAULT_WEIGHT);
    assert_eq!(s.workspace.alphabet().propositions(), ["b", "a"]);
    assert_eq!(s.formula.to_string(), "GFa & !b");
    assert!(s.warnings().is_empty());
}

#[test]
fn all_formats_give_the_same_hash_and_names_do_not_count() {
    let spec: ScenarioSpec = toml::from_str(BASE).unwrap();
    let json = serde_json::to_string_pretty(&spec).unwrap();
    let line = serde_json::to_string(&spec).unwrap();
    let hash = load_as("toml", BASE).unwrap().hash;
    assert_eq!(hash.len(), 64);
    assert_eq!(load_as("json", &json).unwrap().hash, hash);
    assert_eq!(
        load_as("jsonl", &format!("\n{line}\n\n")).unwrap().hash,
        hash
    );
    let renamed = BASE
        .replace("\"base\"", "\"other\"")
        .replace("0.0]", "-0.0]");
    assert_eq!(load_as("toml", &renamed).unwrap().hash, hash);
    let moved = BASE.replace("[0.1, 0.1]\n", "[0.1, 0.11]\n");
    assert_ne!(load_as("toml", &moved).unwrap().hash, hash);
}

#[test]
fn overrides_replace_task_and_weight_and_change_the_hash() {
    let spec: ScenarioSpec = toml::from_str(BASE).unwrap();
    let overrides = Overrides {
        task: Some("<> b".into()),
        weight: Some(1.0),
        ..Overrides::default()
    };
    let s = Scenario::check(&spec, None, &overrides).unwrap();
    assert_eq!((s.task.as_str(), s.weight), ("<> b", 1.0));
    assert_ne!(s.hash, Scenario::from_spec(&spec).unwrap().hash);
}

#[test]
fn every_invalid_scenario_says_what_is_wrong_and_where() {
    use ScenarioErrorKind as Kind;
    let (text, kind) = refused("[0.1, 0.1]\n", "[0.1, nan]\n");
    assert!(matches!(kind, Kind::NotFinite { .. }), "{text}");
    assert!(
        text.starts_with(":2:9: ") && text.contains("finite"),
        "{text}"
    );

    let (text, kind) = refused("[0.1, 0.1]\n", "[0.5, 0.1]\n");
    assert!(
        matches!(kind, Kind::StartInObstacle { obstacle: 1, .. }),
        "{text}"
    );

    let (text, kind) = refused("[0.1, 0.1]\n", "[0.5, 1.1]\n");
    assert!(matches!(kind, Kind::StartOutside { .. }), "{text}");

    let (text, kind) = refused("[0.6, 0.0], [0.6, 0.7]", "[0.6, 0.7], [0.6, 0.0]");
    assert!(matches!(kind, Kind::Polygon { .. }), "{text}");
    assert!(text.starts_with(":8:5: obstacle 1: "), "{text}");
    assert!(text.contains("edge 0") && text.contains("edge 2"), "{text}");

    let (text, kind) = refused("[0.3, 0.8], ", "");
    assert!(matches!(kind, Kind::Polygon { .. }), "{text}");
    assert!(text.starts_with(":12:5: region `b`: "), "{text}");

    let (text, kind) = refused("[0.2, 0.95]", "[inf, 0.95]");
    assert!(
        matches!(kind, Kind::Polygon { .. }) && text.contains("inf"),
        "{text}"
    );

    let (text, kind) = refused("[1, 1]]", "[0, 1]]");
    assert!(
        matches!(kind, Kind::Bounds { .. }) && text.starts_with(":6:10: "),
        "{text}"
    );

    let (text, kind) = refused("task =", "weight = 1.5\ntask =");
    assert!(
        matches!(kind, Kind::Weight(_)) && text.starts_with(":3:10: "),
        "{text}"
    );

    let (text, kind) = refused("task = \"[]<> a && !b\"\n", "");
    assert!(matches!(kind, Kind::NoTask), "{text}");

    let (text, kind) = refused("!b\"", "!bb\"");
    assert!(
        matches!(kind, Kind::Formula(_)) && text.starts_with(":3:20: "),
        "{text}"
    );
    assert!(
        text.contains("unknown proposition `bb`") && text.contains("b, a"),
        "{text}"
    );

    let (text, kind) = refused("&& !b\"", "&& (!b\"");
    assert!(
        matches!(kind, Kind::Formula(_)) && text.starts_with(":3:"),
        "{text}"
    );
    assert!(
        !text.contains(" at line "),
        "two places in one message: {text}"
    );

    let (text, kind) = refused(
        "[workspace]\n",
        "[workspace]\ngrid = { cells = [30, 20], cell = 0.05 }\n",
    );
    assert!(
        matches!(kind, Kind::Grid(_)) && text.starts_with(":6:8: "),
        "{text}"
    );

    let (text, kind) = refused("name =", "colour = 3\nname =");
    assert!(
        matches!(kind, Kind::Syntax(_)) && text.contains("colour"),
        "{text}"
    );
    assert!(text.starts_with(":1:1: "), "{text}");

    let (text, kind) = refused("b = [[0.1, 0.8]", "a = [[0.1, 0.8]");
    assert!(
        matches!(kind, Kind::Syntax(_)) && text.contains("duplicate"),
        "{text}"
    );

    let (text, kind) = refused("start = [0.1, 0.1]", "start = [0.1, \"x\"]");
    assert!(
        matches!(kind, Kind::Syntax(_)) && text.starts_with(":2:"),
        "{text}"
    );
}

#[test]
fn names_that_formulas_cannot_say_are_refused() {
    for name in [
        "\"\"", "\"l 1\"", "1a", "true", "Not", "U", "G", "GF", "\"a-b\"",
    ] {
        let (text, kind) = refused("b = [", &format!("{name} = ["));
        assert!(
            matches!(kind, ScenarioErrorKind::RegionName { .. }),
            "{name}: {text}"
        );
        assert!(text.starts_with(":12:"), "{text}");
    }
    for name in ["Goal", "Ux", "F1", "_a", "überall", "room.2"] {
        let text = BASE
            .replace("b = [", &format!("\"{name}\" = ["))
            .replace("!b", &format!("!{name}"));
        assert!(load_as("toml", &text).is_ok(), "{name}");
    }
}

#[test]
fn json_errors_have_places_too() {
    let spec: ScenarioSpec = toml::from_str(BASE).unwrap();
    let json = serde_json::to_string_pretty(&spec).unwrap();
    let twice = json.replace("\"b\": [", "\"a\": [");
    let error = load_as("json", &twice).unwrap_err();
    assert!(
        error.to_string().contains("region `a` is there twice"),
        "{error}"
    );
    assert!(error.position().is_some_and(|p| p.0 > 20), "{error}");

    let error = load_as("json", &json.replace("!b", "!c")).unwrap_err();
    let (line, column) = error.position().unwrap();
    let marked = json.replace("!b", "!c").lines().nth(line - 1).unwrap()[column - 1..].to_owned();
    assert!(marked.starts_with("c\""), "{marked}");
    let snippet = error.snippet().unwrap();
    let lines: Vec<&str> = snippet.lines().collect();
    let caret = lines[2].find('^').unwrap();
    assert_eq!(&lines[1][caret..=caret], "c", "{snippet}");

    let error = load_as("json", &json.replace("0.95", "1e999")).unwrap_err();
    assert!(
        error.position().is_some() && error.to_string().contains("out of range"),
        "{error}"
    );
    let error = load_as("json", "{\"name\": ").unwrap_err();
    assert!(error.to_string().contains("EOF"), "{error}");
}

#[test]
fn lines_of_jsonl_fail_one_by_one() {
    let spec: ScenarioSpec = toml::from_str(BASE).unwrap();
    let good = serde_json::to_string(&spec).unwrap();
    let bad = good.replace("!b", "!!c");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.jsonl");
    let other = good.replace("\"base\"", "\"other\"");
    std::fs::write(&path, format!("{good}\n\n{bad}\n{other}\n")).unwrap();
    let all = Scenario::load_all(&path).unwrap();
    assert_eq!(all.len(), 3);
    assert!(all[0].is_ok() && all[2].is_ok());
    assert_eq!(all[1].as_ref().unwrap_err().position().unwrap().0, 3);

    let pick = |name| Scenario::load_with(&path, Some(name), &Overrides::default());
    assert_eq!(pick("other").unwrap().name, "other");
    assert_eq!(pick("4").unwrap().name, "other");
    assert_eq!(pick("3").unwrap_err().position().unwrap().0, 3);
    assert!(matches!(
        pick("2").unwrap_err().kind(),
        ScenarioErrorKind::NotFound { .. }
    ));
    assert!(matches!(
        Scenario::load(&path).unwrap_err().kind(),
        ScenarioErrorKind::NotOne { found: 3 }
    ));
    std::fs::write(&path, format!("{good}\n{other}\n{good}\n")).unwrap();
    let pick = |name| Scenario::load_with(&path, Some(name), &Overrides::default());
    let several = pick("base").unwrap_err().to_string();
    assert!(several.contains("by its line, 1 or 3"), "{several}");
    assert!(pick("3").is_ok() && pick("other").is_ok());
}

#[test]
fn files_that_are_no_scenarios_are_refused() {
    let kind = |r: Result<Scenario, ScenarioError>| *r.unwrap_err().kind;
    assert!(matches!(
        kind(Scenario::load("no/such.toml")),
        ScenarioErrorKind::Read(_)
    ));
    assert!(matches!(
        kind(load_as("yaml", BASE)),
        ScenarioErrorKind::UnknownEnding { .. }
    ));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.toml");
    std::fs::write(&path, b"name = \"\xff\"").unwrap();
    assert!(matches!(
        kind(Scenario::load(&path)),
        ScenarioErrorKind::NotText
    ));
    std::fs::write(&path, format!("# {}\n{BASE}", "x".repeat(17 << 20))).unwrap();
    assert!(matches!(
        kind(Scenario::load(&path)),
        ScenarioErrorKind::TooLarge { .. }
    ));
}

#[test]
fn a_hidden_region_is_a_warning() {
    let hidden = BASE.replace(
        "[0.7, 0.1], [0.9, 0.1], [0.8, 0.3]",
        "[0.45, 0.1], [0.55, 0.1], [0.5, 0.3]",
    );
    let s = load_as("toml", &hidden).unwrap();
    assert_eq!(s.warnings().len(), 1);
    assert!(s.warnings()[0].contains("`a`"), "{:?}", s.warnings());
}

#[test]
fn an_obstacle_without_width_is_a_warning() {
    let wall = |width: f64| {
        let x = 0.3 + width;
        let text = format!("obstacles = [[[0.3, 0.4], [{x:?}, 0.4], [{x:?}, 0.6], [0.3, 0.6]],");
        let scenario = load_as("toml", &BASE.replace("obstacles = [", &text)).unwrap();
        scenario.warnings()
    };
    assert!(wall(1e-9)[0].contains("obstacle 1 is too thin"));
    assert!(wall(1e-3).is_empty());
}

#[test]
fn obstacles_outside_the_bounds_are_a_warning() {
    let with = |more: &str| {
        let text = format!("obstacles = [{more}");
        let scenario = load_as("toml", &BASE.replace("obstacles = [", &text)).unwrap();
        scenario.warnings()
    };
    let one = "[[40, 30], [60, 30], [60, 70]],";
    assert!(with(one)[0].starts_with("obstacle 1 lies outside the bounds"));
    let three = with(&one.repeat(3));
    assert!(
        three[0].starts_with("obstacle 1 and 2 others lie outside"),
        "{three:?}"
    );
    // Partly outside is what people mean.
    assert!(with("[[-1, -1], [0.05, -1], [0.05, 0.05]],").is_empty());
}

#[test]
fn a_file_without_name_is_called_like_the_file() {
    let s = load_as("toml", &BASE.replace("name = \"base\"\n", "")).unwrap();
    assert_eq!(s.name, "map");
}

#[test]
fn a_grid_says_how_large_its_map_is() {
    let with = |workspace: &str| {
        load_as(
            "toml",
            &format!("start = [0.25, 0.25]\ntask = \"true\"\n[workspace]\n{workspace}\n"),
        )
    };
    let s = with("grid = { cells = [4, 2], cell = 0.5 }").unwrap();
    let bounds = s.workspace.bounds();
    assert_eq!(
        (bounds.min, bounds.max),
        (Point2::origin(), Point2::new(2.0, 1.0))
    );
    for (nothing, says) in [
        (
            "grid = { cells = [0, 2], cell = 0.5 }",
            "0 × 2 cells: expected at least one",
        ),
        (
            "grid = { cells = [4, 2], cell = -1.0 }",
            "a side of -1: expected a length above 0",
        ),
        (
            "grid = { cells = [4, 2], cell = nan }",
            "a side of NaN: expected a length above 0",
        ),
        ("", "missing field `bounds`"),
    ] {
        let error = with(nothing).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn a_start_on_a_grid_is_its_cells_centre() {
    for (cells, cell) in [(10, 0.1), (20, 0.05), (5, 0.2), (25, 0.04)] {
        for k in 0..cells {
            // As people write it, and as it is computed here, which differ in the last place.
            let start = format!("{:.3}", (f64::from(k) + 0.5) * cell);
            let text = format!(
                "start = [{start}, {start}]\ntask = \"true\"\n[workspace]\nbounds = [[0, 0], [1, 1]]\n\
                 grid = {{ cells = [{cells}, {cells}], cell = {cell} }}\n"
            );
            let s = load_as("toml", &text).unwrap();
            let grid = s.grid.unwrap();
            let system = Grid::new(Arc::clone(&s.workspace), grid.cells, grid.cell, s.start);
            assert_eq!(s.start, system.unwrap().start().at, "{text}");
        }
    }
}
