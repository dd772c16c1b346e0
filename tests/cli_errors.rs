//! The program itself, on bad input and odd surroundings: exit code 2 and a message that helps.

mod cli;

use std::io::Read;
use std::process::Stdio;

use cli::{command, finish, folder, nngtl, shipped};

#[test]
fn bad_input_ends_with_2_and_names_file_line_and_column() {
    let folder = folder();
    let path = folder.path().join("bad.toml");
    let text = std::fs::read_to_string(shipped("case-study.toml")).unwrap();
    std::fs::write(&path, text.replace("<> l3\"", "<> l33\"")).unwrap();
    let path = path.display().to_string();
    let run = nngtl(&["plan", &path]);
    assert_eq!((run.code, run.out.as_str()), (2, ""), "{run:?}");
    let first = run.err.lines().next().unwrap();
    assert!(
        first.starts_with(&format!("nngtl: error: {path}:6:")),
        "{run:?}"
    );
    assert!(
        first.contains("unknown proposition `l33`") && first.contains("`l3`"),
        "{run:?}"
    );
    let lines: Vec<&str> = run.err.lines().collect();
    let caret = lines[3].find("^^^").expect("a caret");
    assert_eq!(&lines[2][caret..caret + 3], "l33", "{run:?}");

    let run = nngtl(&["plan", &path, "--json"]);
    let object = run.json();
    assert_eq!(
        (run.code, object["outcome"].as_str()),
        (2, Some("bad-input"))
    );
    assert_eq!(
        (object["version"].as_u64(), object["line"].as_u64()),
        (Some(1), Some(6))
    );
}

#[test]
fn what_cannot_be_understood_is_usage_and_ends_with_2() {
    let scenario = shipped("case-study.toml");
    let cases: [&[&str]; 9] = [
        &["plan"],
        &["plan", &scenario, "--png", "plan.svg"],
        &["plan", &scenario, "--svg", "plan.PNG"],
        &["plan", &scenario, "--tree"],
        &["fly", &scenario],
        &["plan", &scenario, "--sampler", "magic"],
        &["plan", &scenario, "--seed", "-1"],
        &["plan", &scenario, "--automaton", "a.hoa", "--task", "<> l1"],
        &[],
    ];
    for arguments in cases {
        let run = nngtl(arguments);
        assert_eq!(
            (run.code, run.out.as_str()),
            (2, ""),
            "{arguments:?}: {run:?}"
        );
        assert!(run.err.contains("nngtl"), "{arguments:?}: {run:?}");
    }
    let object = nngtl(&["plan", &scenario, "--seed", "-1", "--json"]).json();
    assert_eq!(object["outcome"], "bad-input");
    assert!(
        object["message"].as_str().unwrap().contains("-1"),
        "{object}"
    );
}

#[test]
fn input_that_is_out_of_range_ends_with_2() {
    let scenario = shipped("case-study.toml");
    let many = shipped("transfer-grid.jsonl");
    let cases: [(&[&str], &str); 16] = [
        (&["plan", "no-such.toml"], "no-such.toml: cannot read"),
        (
            &["plan", &scenario, "--weight", "2"],
            "the given weight: the weight is 2:",
        ),
        // Not with its two hundred digits.
        (
            &["plan", &scenario, "--weight", "1e200"],
            "weight is 1e200:",
        ),
        (&["plan", &many], "line number (--pick)"),
        (&["plan", &scenario, "--out", "-"], "`-` is no file"),
        (
            &["translate", "F a & F b & F c", "--max-states", "3"],
            "(--max-states)",
        ),
        (
            &["translate", "F a & F b & F c", "--max-transitions", "3"],
            "(--max-transitions)",
        ),
        (
            &["translate", "F a", "--max-translation", "0.0"],
            "(--max-translation)",
        ),
        (&["translate", "F a", "--max-translation=-1"], "as in 0.5"),
        (
            &[
                "library",
                "build",
                &scenario,
                "--samples",
                "0",
                "--out",
                "l",
            ],
            "0 is not in",
        ),
        (&["plan", &scenario, "--y-rand", "1"], "y_rand"),
        (&["plan", &scenario, "--task", "X l1"], "next"),
        (
            &["plan", &scenario, "--task", "l1 &"],
            "the formula ends too early",
        ),
        (
            &["plan", &scenario, "--out", "no/such/folder/p.json"],
            "no such folder",
        ),
        (&["heatmap", &scenario, "--out", "h.gif"], ".npy"),
        (&["verify", &scenario, &scenario], "not a plan"),
    ];
    for (arguments, reason) in cases {
        let run = nngtl(arguments);
        // A limit that was hit is no bad input.
        let code = if reason.starts_with("(--max") { 1 } else { 2 };
        assert_eq!(run.code, code, "{arguments:?}: {run:?}");
        assert!(run.err.contains(reason), "{arguments:?}: {run:?}");
        assert!(
            run.err.starts_with("nngtl: error: "),
            "{arguments:?}: {run:?}"
        );
        assert!(run.out.is_empty(), "{arguments:?}: {run:?}");
    }
}

#[test]
fn files_without_scenarios_and_regions_beyond_the_map_are_called_so() {
    let folder = folder();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let run = nngtl(&["plan", &file("none.jsonl", "\n")]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("it is empty"), "{run:?}");

    let square = |x: f64| format!("[[{x}, 0], [{}, 0], [{}, 1]]", x + 1.0, x + 1.0);
    let text = format!(
        "start = [5, 5]\ntask = \"F near\"\n[workspace]\nbounds = [[0, 0], [9, 9]]\nobstacles = [{}]\n\
         [workspace.regions]\nnear = {}\nfar = {}\ncovered = {}\n",
        square(0.0),
        square(4.0),
        square(9.0),
        square(0.0),
    );
    let run = nngtl(&["plan", &file("far.toml", &text), "--first"]);
    assert_eq!(run.code, 0, "{run:?}");
    for says in [
        "region `far` lies outside the bounds",
        "region `covered` is covered by obstacles entirely",
    ] {
        assert!(run.err.contains(says), "{run:?}");
    }
}

/// Writes an automaton file, and gives its path.
fn automaton(folder: &tempfile::TempDir, text: &str) -> String {
    let path = folder.path().join("a.hoa");
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn a_mistake_in_an_automaton_is_told_once() {
    let folder = folder();
    let text = "HOA: v1\nStates: 1\nStart: 0\nAP: 1 \"l1\"\nAcceptance: 1 Fin(0)\n--BODY--\nState: 0 [0] 0\n--END--\n";
    let path = automaton(&folder, text);
    let run = nngtl(&["plan", &shipped("case-study.toml"), "--automaton", &path]);
    assert_eq!(run.code, 2, "{run:?}");
    assert_eq!(run.err.matches("error").count(), 1, "{run:?}");
    assert_eq!(run.err.matches("supported").count(), 1, "{run:?}");
    assert!(run.err.contains("Acceptance: 1 Fin(0)\n"), "{run:?}");
    assert!(run.err.contains('^'), "{run:?}");
}

#[test]
fn limits_of_translation_have_an_outcome_and_an_option() {
    let folder = folder();
    let scenario = shipped("case-study.toml");
    let text =
        "HOA: v1\nStates: 3\nStart: 0\nAP: 0\nAcceptance: 0 t\n--BODY--\nState: 0 [t] 0\n--END--\n";
    let hoa = automaton(&folder, text);
    let out = folder.path().join("x.png").display().to_string();
    for (words, option) in [
        (
            vec!["translate", "GFa & GFb & Fc", "--max-states", "1"],
            "--max-states",
        ),
        (
            vec!["plan", &scenario, "--max-transitions", "1"],
            "--max-transitions",
        ),
        (
            vec!["plan", &scenario, "--automaton", &hoa, "--max-states", "2"],
            "--max-states",
        ),
        (
            vec!["heatmap", &scenario, "--out", &out, "--max-states", "1"],
            "--max-states",
        ),
        (
            vec![
                "library",
                "build",
                &scenario,
                "--out",
                &out,
                "--max-states",
                "1",
            ],
            "--max-states",
        ),
        (
            vec!["plan", &scenario, "--max-translation", "0"],
            "--max-translation",
        ),
    ] {
        let run = nngtl(&[&words[..], &["--json"]].concat());
        let object: serde_json::Value = serde_json::from_str(&run.out).unwrap();
        assert_eq!(
            (run.code, &object["outcome"]),
            (1, &"translation-limit".into()),
            "{run:?}"
        );
        assert!(run.err.contains(option), "{words:?}: {run:?}");
    }
}

#[test]
fn an_automaton_that_accepts_nothing_is_not_the_maps_fault() {
    let folder = folder();
    let text = "\u{feff}HOA: v1\nStates: 2\nStart: 0\nAP: 1 \"l1\"\nAcceptance: 1 Inf(0)\n--BODY--\nState: 0 [!0] 0 [0] 1\nState: 1 [t] 1\n--END--\n";
    let hoa = automaton(&folder, text);
    let run = nngtl(&[
        "plan",
        &shipped("case-study.toml"),
        "--automaton",
        &hoa,
        "--json",
    ]);
    assert_eq!(run.code, 1, "{run:?}");
    assert!(run.out.contains("\"unsatisfiable\""), "{run:?}");
}

#[test]
fn colours_are_only_where_they_are_wanted() {
    let arguments = |when| ["plan", "no-such.toml", "--color", when];
    assert!(nngtl(&arguments("always")).err.contains("\u{1b}["));
    assert!(!nngtl(&arguments("never")).err.contains('\u{1b}'));
    assert!(
        !nngtl(&arguments("auto")).err.contains('\u{1b}'),
        "stderr is no terminal here"
    );
    let usage = |when| nngtl(&["plan", "--color", when]).err;
    assert!(usage("always").contains('\u{1b}') && !usage("never").contains('\u{1b}'));
}

#[test]
fn help_and_version_go_to_stdout() {
    let run = nngtl(&["plan", "--help"]);
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{run:?}");
    for word in ["--sampler", "--time-limit", "Examples:"] {
        assert!(run.out.contains(word), "{word}");
    }
    let run = nngtl(&["--version"]);
    assert_eq!(
        (run.code, run.out.trim()),
        (0, concat!("nngtl ", env!("CARGO_PKG_VERSION")))
    );
}

#[test]
fn a_closed_pipe_is_no_error() {
    let mut child = command()
        .args([
            "translate",
            "[]<> a && []<> b && []<> c && []<> d",
            "--format",
            "dot",
        ])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let mut err = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut err)
        .unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(err, "");
}

#[test]
fn the_log_answers_to_its_variable() {
    let translate = ["translate", "<> a"];
    let run = finish(command().args(translate).env("RUST_LOG", "trace"));
    assert_eq!(run.code, 0);
    let quiet = nngtl(&translate);
    assert_eq!((quiet.code, quiet.err.as_str()), (0, ""));
    assert_eq!(run.out, quiet.out, "the log goes to stderr");
}

/// Ctrl-C ends the search with the best plan so far, not with nothing.
#[cfg(unix)]
#[test]
fn an_interrupt_gives_the_best_plan_so_far() {
    let scenario = shipped("tl-rrt-star.toml");
    let child = command()
        .args([
            "plan",
            &scenario,
            "--sampler",
            "biased",
            "--iterations",
            "100000000",
        ])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (code, out, err) = interrupted(child, 2.0);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(
        out.contains("planned and verified") && err.contains("interrupted"),
        "{out}{err}"
    );
}

/// Interrupts a program after so many seconds; its exit code, and what it said.
fn interrupted(child: std::process::Child, after: f64) -> (Option<i32>, String, String) {
    std::thread::sleep(std::time::Duration::from_secs_f64(after));
    let kill = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    (output.status.code(), out, err)
}

/// Twelve places in any order: the exact planner has 2^12 states to search, for a minute.
fn many_places() -> String {
    let place = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / 12.0;
        let (x, y) = (0.5 + 0.4 * angle.cos(), 0.5 + 0.4 * angle.sin());
        let (right, top) = (x + 0.05, y + 0.05);
        format!("r{k} = [[{x}, {y}], [{right}, {y}], [{right}, {top}], [{x}, {top}]]\n")
    };
    let visits: Vec<String> = (0..12).map(|k| format!("F r{k}")).collect();
    let places: String = (0..12).map(place).collect();
    format!(
        "start = [0.5, 0.5]\ntask = \"{}\"\n[workspace]\nbounds = [[0, 0], [1, 1]]\n[workspace.regions]\n{places}",
        visits.join(" & ")
    )
}

/// The exact planner, too, ends when it is asked to, or when its time is over.
#[test]
fn an_exact_search_can_be_ended() {
    let folder = folder();
    let path = folder.path().join("many.toml");
    std::fs::write(&path, many_places()).unwrap();
    let path = path.display().to_string();
    let arguments = ["plan", &path, "--sampler", "exact", "--json"];
    let start = || {
        let mut child = command();
        child.args(arguments).stdout(Stdio::piped());
        child.stderr(Stdio::piped()).spawn().unwrap()
    };
    // While the formula is translated there is nothing to lose, and an interrupt ends the program as usual.
    let waits = [2.0, 4.0, 8.0, 16.0].into_iter();
    let mut ends = waits.map(|after| interrupted(start(), after));
    let (code, out, err) = ends.find(|end| end.0.is_some()).expect("a search");
    let object: serde_json::Value = serde_json::from_str(&out).expect(&err);
    let expected = match code {
        Some(0) => "planned",
        Some(1) => "not-found",
        _ => panic!("{code:?}: {out}{err}"),
    };
    assert_eq!(object["outcome"], expected, "{out}{err}");

    let mut timed = arguments.to_vec();
    timed.extend(["--time-limit", "1"]);
    let run = nngtl(&timed);
    assert!([0, 1].contains(&run.code), "{run:?}");
    let told = run.json().to_string() + &run.err;
    assert!(
        told.contains("time limit") || told.contains("was ended before"),
        "{run:?}"
    );
}

#[test]
fn points_have_two_coordinates_in_every_format() {
    let folder = folder();
    let text = |start: &str, vertex: &str, bounds: &str| {
        format!(
            "start = {start}\ntask = \"<> a\"\n[workspace]\nbounds = {bounds}\n[workspace.regions]\na = [{vertex}, [0.9, 0.1], [0.9, 0.9]]\n"
        )
    };
    let json = |start: &str, vertex: &str, bounds: &str| {
        format!(
            r#"{{"start": {start}, "task": "<> a", "workspace": {{"bounds": {bounds}, "regions": {{"a": [{vertex}, [0.9, 0.1], [0.9, 0.9]]}}}}}}"#
        )
    };
    let (point, square) = ("[0.5, 0.2]", "[[0, 0], [1, 1]]");
    let good = [point, point, square];
    let worse = [
        ["[0.5, 0.2, 1.57]", point, square],
        ["[0.5]", point, square],
        [point, "[0.5, 0.2, 0.0]", square],
        [point, point, "[[0, 0], [1, 1], [2, 2]]"],
        [point, point, "[[0, 0, 0], [1, 1, 1]]"],
        [point, point, "[0, 0, 1, 1]"],
        ["0.5", point, square],
    ];
    for (ending, write) in [
        ("toml", &text as &dyn Fn(&str, &str, &str) -> String),
        ("json", &json),
    ] {
        let path = folder.path().join(format!("points.{ending}"));
        let plan = |[start, vertex, bounds]: [&str; 3]| {
            std::fs::write(&path, write(start, vertex, bounds)).unwrap();
            nngtl(&["plan", &path.display().to_string(), "--first"])
        };
        assert_eq!(plan(good).code, 0, "{ending}");
        for wrong in worse {
            let run = plan(wrong);
            assert_eq!(run.code, 2, "{ending} {wrong:?}: {run:?}");
            let says = [
                "a point [x, y] has two",
                "bounds have two",
                "bounds are two, [[left, bottom], [right, top]]",
                "expected a point [x, y]",
            ];
            assert!(says.iter().any(|s| run.err.contains(s)), "{run:?}");
        }
    }
}

#[test]
fn what_was_meant_is_told() {
    let scenario = shipped("case-study.toml");
    for (arguments, says) in [
        // Not that `-1` is no option.
        (
            vec!["plan", &scenario, "--weight", "-1"],
            "the weight is -1",
        ),
        (vec!["plan", &scenario, "--seed", "-1"], "'--seed <N>'"),
        (vec!["plan", &shipped("office.yaml")], "`[map]`"),
        (vec!["plan", &shipped("cavern.map")], "`[map]`"),
        (vec!["translate", "a ==> b"], "unexpected `=`"),
        (vec!["translate", "a = 3"], "no values here"),
    ] {
        let run = nngtl(&arguments);
        assert_eq!(run.code, 2, "{arguments:?}: {run:?}");
        assert!(run.err.contains(says), "{arguments:?}: {run:?}");
    }
    let mut plan = command();
    let run = finish(plan.args(["plan", "-"]).stdin(Stdio::null()));
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("it is empty"), "{run:?}");
}

#[test]
fn a_map_in_metres_that_is_read_as_degrees_is_doubted() {
    let folder = folder();
    let map = |units: &str| {
        let polygon = |kind: &str, [x, y]: [f64; 2], side: f64| {
            let (right, top) = (x + side, y + side);
            format!(
                r#"{{"type": "Feature", "properties": {kind}, "geometry": {{"type": "Polygon", "coordinates": [[[{x}, {y}], [{right}, {y}], [{right}, {top}], [{x}, {top}], [{x}, {y}]]]}}}}"#
            )
        };
        format!(
            r#"{{"type": "FeatureCollection", {units} "features": [{}, {}]}}"#,
            polygon(r#"{"kind": "bounds"}"#, [0.0, 0.0], 40.0),
            polygon(r#"{"kind": "region", "name": "a"}"#, [20.0, 20.0], 2.0),
        )
    };
    let scenario = folder.path().join("room.toml");
    let text = "task = \"<> a\"\nstart = [1.0, 1.0]\n[map]\nfile = \"room.geojson\"\n";
    std::fs::write(&scenario, text).unwrap();
    for (units, doubted) in [("", true), (r#""units": "m","#, false)] {
        std::fs::write(folder.path().join("room.geojson"), map(units)).unwrap();
        let run = nngtl(&["plan", &scenario.display().to_string(), "--first"]);
        assert_eq!(run.code, 0, "{run:?}");
        assert_eq!(
            run.err
                .contains("nngtl: warning: the map is 4448 km across"),
            doubted,
            "{run:?}"
        );
    }
}

#[test]
fn two_results_are_not_written_to_one_file() {
    let folder = folder();
    let file = folder.path().join("a").display().to_string();
    let scenario = shipped("case-study.toml");
    let run = nngtl(&["plan", &scenario, "--first", "--svg", &file, "--png", &file]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("two results"), "{run:?}");
    assert!(!folder.path().join("a").exists());
}

#[test]
fn comparisons_without_missions_say_why() {
    let scenario = shipped("case-study.toml");
    for (arguments, why) in [
        (vec!["bench", "nothere"], "no such scenario file or folder"),
        (
            vec!["bench", &scenario, "--samplers", "oracle"],
            "needs the labels of a data set",
        ),
    ] {
        let run = nngtl(&arguments);
        assert_eq!(run.code, 2, "{run:?}");
        assert!(run.err.contains(why), "{run:?}");
    }
    let none = shipped("infeasible.toml");
    let run = nngtl(&["bench", &none, "--gaps", "--iterations", "10"]);
    assert!(!run.out.contains("NaN"), "{run:?}");
}

#[test]
fn what_is_left_out_is_told() {
    let run = nngtl(&[
        "bench",
        &shipped("infeasible.toml"),
        &shipped("patrol.toml"),
        "--samplers",
        "directed",
        "--trials",
        "1",
        "--json",
    ]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(
        run.err
            .contains("infeasible.toml: left out: no plan exists"),
        "{run:?}"
    );
    assert_eq!(
        run.json()["trials"].as_array().map(Vec::len),
        Some(1),
        "{run:?}"
    );

    let folder = folder();
    let text = std::fs::read_to_string(shipped("campus.geojson")).unwrap();
    let mut map: serde_json::Value = serde_json::from_str(&text).unwrap();
    let features = map["features"].as_array_mut().unwrap();
    let mut lake = features[0].clone();
    lake["properties"] = serde_json::json!({ "name": "lake" });
    features.extend([lake.clone(), lake]);
    let path = folder.path().join("campus.geojson");
    std::fs::write(&path, map.to_string()).unwrap();
    let scenario = folder.path().join("campus.toml");
    std::fs::copy(shipped("campus.toml"), &scenario).unwrap();
    let scenario = scenario.display().to_string();
    let run = nngtl(&["plan", &scenario, "--first"]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(
        run.err
            .contains("left out of the map: feature 14 (`lake`) and 1 more"),
        "{run:?}"
    );
}

#[test]
fn numbers_that_no_benchmark_can_use_are_refused() {
    for (name, value) in [
        ("--seconds", "nan"),
        ("--seconds", "inf"),
        ("--seconds=-1", ""),
        ("--runs", "0"),
        ("--threads", "0"),
        ("--trials", "0"),
    ] {
        let given = [name, value];
        let given = given.iter().filter(|part| !part.is_empty());
        let arguments: Vec<&str> = ["bench", "inference"]
            .iter()
            .chain(given)
            .copied()
            .collect();
        let run = nngtl(&arguments);
        assert_eq!(run.code, 2, "{arguments:?}: {run:?}");
        assert!(run.err.contains("invalid value"), "{arguments:?}: {run:?}");
    }
    let run = nngtl(&["bench", "transfer", "--anytime", "nan"]);
    assert!(run.code == 2 && run.err.contains("--anytime"), "{run:?}");
}

#[test]
fn files_for_folders_and_folders_for_data_sets_are_called_so() {
    let folder = folder();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let file = file.to_str().unwrap();
    for command in [&["bench"][..], &["dataset", "generate"]] {
        let run = nngtl(&[command, &["--missions", "1", "--out", file]].concat());
        assert_eq!(run.code, 2, "{run:?}");
        assert!(
            run.err.contains("this is a file, expected a folder"),
            "{run:?}"
        );
    }
    let run = nngtl(&["bench", folder.path().to_str().unwrap()]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("this is no data set"), "{run:?}");
}

#[test]
fn regions_too_small_for_their_map_are_called_so() {
    let folder = folder();
    let path = folder.path().join("wide.toml");
    let text = "start = [1, 1]\ntask = \"F a\"\n[workspace]\nbounds = [[0, 0], [1e7, 1e7]]\n\
                [workspace.regions]\na = [[0.7, 0.7], [0.9, 0.7], [0.9, 0.9]]\n";
    std::fs::write(&path, text).unwrap();
    let run = nngtl(&["plan", path.to_str().unwrap()]);
    assert_eq!(run.code, 1, "{run:?}");
    assert!(
        run.err.contains("`a` is too small for a map of this size"),
        "{run:?}"
    );
}

#[test]
fn missions_that_a_grid_rules_out_say_that_it_does() {
    let folder = folder();
    let path = folder.path().join("grid.toml");
    let text = "start = [0.5, 0.5]\ntask = \"true\"\n[workspace]\nbounds = [[0, 0], [5, 5]]\n\
                grid = { cells = [5, 5], cell = 1.0 }\n[workspace.regions]\n\
                far = [[4, 4], [5, 4], [5, 5], [4, 5]]\nbetween = [[2.8, 2.8], [3.2, 2.8], [3.2, 3.2], [2.8, 3.2]]\n";
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let plan = |task: &str| nngtl(&["plan", path, "--task", task, "--json"]);
    for (task, says) in [
        ("X far", "on this grid: no sequence of waypoints"),
        (
            "F between",
            "no cell whose centre lies there can be entered",
        ),
    ] {
        let run = plan(task);
        assert_eq!(run.code, 1, "{run:?}");
        assert_eq!(run.json()["outcome"], "unreachable", "{run:?}");
        assert!(run.err.contains(says), "{run:?}");
    }
    let json = plan("X far").json();
    let beyond = json["beyond"].as_array();
    assert!(
        beyond.is_none_or(Vec::is_empty),
        "far can be reached: {json}"
    );
    assert_eq!(plan("X X far").code, 0);
}
