//! `nngtl bench`: tables of drawn missions, and a folder that an interrupted comparison goes on from.

mod cli;

use std::path::Path;

use cli::{command, folder, nngtl, shipped};

const DRAWN: [&str; 9] = [
    "bench",
    "--missions",
    "5",
    "--families",
    "paper,mazes",
    "--trials",
    "2",
    "--iterations",
    "3000",
];

fn drawn(more: &[&str]) -> cli::Run {
    nngtl(&[&DRAWN, more].concat())
}

/// A CSV without the columns of seconds, which are the last ones.
fn without_times(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let kept = header.iter().filter(|name| !name.ends_with("seconds"));
    let kept = kept.count();
    let cut = |line: &str| line.split(',').take(kept).collect::<Vec<_>>().join(",");
    text.lines().map(cut).collect()
}

#[test]
fn drawn_missions_are_compared_and_empty_classes_told() {
    let run = drawn(&[
        "--samplers",
        "uniform,biased",
        "--complex-from",
        "100000",
        "-q",
    ]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(
        run.out
            .contains("5 simple, 0 complex. No mission is complex"),
        "{}",
        run.out
    );
    for words in [
        "| all (5) | uniform |",
        "| mazes (",
        "| paper (",
        "| uniform | biased |",
    ] {
        assert!(run.out.contains(words), "{words}: {}", run.out);
    }
    let run = drawn(&["--samplers", "biased", "--json", "-q"]).json();
    assert_eq!(run["missions"], 5);
    assert_eq!(run["trials"].as_array().unwrap().len(), 10);
    assert!(run["classes"].is_null());
}

#[test]
fn formulas_come_from_a_file_and_its_errors_have_lines() {
    let folder = folder();
    let file = folder.path().join("formulas.txt");
    let path = file.display().to_string();
    let run = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let few = [
            "bench",
            "--missions",
            "3",
            "--trials",
            "1",
            "--samplers",
            "biased",
        ];
        nngtl(&[&few[..], &["--formulas", &path, "-q", "--json"]].concat())
    };
    // Of these the first accepts after one step, which the published missions leave out.
    let given = run("# visits\nF a\nF l2 & F l3\n").json();
    let trials = given["trials"].as_array().unwrap();
    assert_eq!(trials.len(), 3);
    assert!(trials.iter().all(|t| t["family"] == "published"), "{given}");
    for (text, words) in [
        ("F a\nG (b\n", "line 2"),
        ("F a\nG (b\n", "^"),
        ("F kitchen\n", "no region `kitchen`"),
        ("\n", "no formula"),
        // Nothing to draw from is said, not looked for for ever.
        ("F a\n", "too few steps"),
    ] {
        let wrong = run(text);
        assert_eq!(wrong.code, 2, "{wrong:?}");
        assert!(wrong.err.contains(words), "{words}: {}", wrong.err);
    }
}

#[test]
fn two_reports_differ_in_times_alone() {
    let folders = [folder(), folder()];
    for folder in &folders {
        let out = folder.path().display().to_string();
        let run = drawn(&[
            "--out",
            &out,
            "--cost-iterations",
            "100",
            "--samplers",
            "biased,directed,guided",
            "--device",
            "cpu",
            "--random-formulas",
            "0.5",
        ]);
        assert_eq!(run.code, 0, "{run:?}");
    }
    let [one, two] = [&folders[0], &folders[1]].map(|f| f.path().to_owned());
    for name in ["trials.csv", "costs.csv"] {
        assert_eq!(
            without_times(&one.join(name)),
            without_times(&two.join(name))
        );
    }
    let read = |name: &str| std::fs::read_to_string(one.join(name)).unwrap();
    let report = read("report.md");
    for picture in [
        "first-prefixes.svg",
        "success.svg",
        "ratios.svg",
        "costs.svg",
    ] {
        assert!(report.contains(&format!("]({picture})")), "{report}");
        assert!(read(picture).starts_with("<svg "));
    }
    assert!(
        report.contains("--families paper,mazes") && report.contains("cores"),
        "{report}"
    );
    let object: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!(object["findings"]["first"]["missions"], 5);
    // Nothing is left to do, and other settings are not mixed in.
    let again = drawn(&[
        "--out",
        &one.display().to_string(),
        "--cost-iterations",
        "100",
        "--samplers",
        "biased,directed,guided",
        "--device",
        "cpu",
        "--random-formulas",
        "0.5",
    ]);
    assert!(again.err.contains("5 missions are kept"), "{again:?}");
    let other = drawn(&["--out", &one.display().to_string(), "--seed", "9"]);
    assert_eq!(other.code, 2);
    assert!(other.err.contains("other settings"), "{other:?}");
    for says in [
        "settings.seed 0, now 9;",
        "contenders biased,directed,guided",
        ", now uniform,biased,",
    ] {
        assert_eq!(other.err.matches(says).count(), 1, "{other:?}");
    }
}

/// The gaps alone make a report as a whole comparison does, and go on as it does.
#[test]
fn gaps_fill_a_folder_of_their_own() {
    let folder = folder();
    let out = folder.path().display().to_string();
    let gaps = |missions: &str, more: &[&str]| {
        let always = [
            "bench",
            "--gaps",
            "--iterations",
            "100",
            "--samplers",
            "biased,directed",
            "--out",
            &out,
        ];
        nngtl(&[&always[..], &["--missions", missions], more].concat())
    };
    let begun = gaps("2", &[]);
    assert_eq!(begun.code, 0, "{begun:?}");
    assert!(begun.out.contains("| directed | 100 iterations |"));
    let mut names: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|f| f.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let wanted = [
        "costs.csv",
        "costs.svg",
        "missions.jsonl",
        "report.json",
        "report.md",
    ];
    assert_eq!(names, wanted);
    let more = gaps("3", &["--json"]);
    assert!(more.err.contains("2 missions are kept"), "{more:?}");
    let object = more.json();
    assert_eq!(
        (object["outcome"].as_str(), object["missions"].as_u64()),
        (Some("compared"), Some(3))
    );
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(read("costs.csv").lines().count(), 1 + 3 * 2);
    assert!(read("costs.svg").contains(">directed</text>"));
    let report = read("report.md");
    for words in [
        "3 missions, one search of each sampler, at most 100 iterations",
        "](costs.svg)",
        "| biased | 10 iterations |",
        "every run: `costs.csv`, `report.json`",
    ] {
        assert!(report.contains(words), "{words}: {report}");
    }
    assert!(!report.contains("First plan"), "{report}");
    let object: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    let findings = &object["findings"];
    assert_eq!(findings["costs"]["descents"].as_array().unwrap().len(), 6);
    assert!(findings.get("first").is_none());
    // So are several searches.
    let several = gaps("3", &["--trials", "2"]);
    assert_eq!(several.code, 2, "{several:?}");
    assert!(several.err.contains("trials 1, now 2"), "{several:?}");
    // A whole comparison is another one.
    let whole = drawn(&["--out", &out, "--samplers", "biased,directed"]);
    assert_eq!(whole.code, 2, "{whole:?}");
    let says = "trials 0, now 2";
    assert!(whole.err.contains(says), "{whole:?}");
    // Fewer missions make a smaller report, which says so, and the rest is kept.
    let fewer = gaps("1", &[]);
    assert!(fewer.err.contains("2 more, measured before"), "{fewer:?}");
    assert_eq!(read("missions.jsonl").lines().count(), 1 + 3);
    // A report of something else is not written over.
    std::fs::remove_file(folder.path().join("missions.jsonl")).unwrap();
    let foreign = gaps("1", &[]);
    assert_eq!(foreign.code, 2, "{foreign:?}");
    assert!(foreign.err.contains("report.md"), "{foreign:?}");
}

/// Several searches on each mission, and what was measured where.
#[test]
fn gaps_without_a_folder_say_how_often_and_on_what_machine() {
    let folder = folder();
    let report = folder.path().join("gaps.md").display().to_string();
    let arguments = [
        "bench",
        "--gaps",
        "--missions",
        "2",
        "--iterations",
        "100",
        "--trials",
        "3",
        "--samplers",
        "biased,flat",
    ];
    let run = nngtl(&[&arguments[..], &["--report", &report]].concat());
    assert_eq!(run.code, 0, "{run:?}");
    assert!(run.out.contains("3 searches of each sampler"), "{run:?}");
    let text = std::fs::read_to_string(&report).unwrap();
    assert!(text.starts_with(&run.out), "{text}");
    assert!(
        text.contains("--trials 3") && text.contains(" build), no networks"),
        "{text}"
    );
    let object = nngtl(&[&arguments[..], &["--json"]].concat()).json();
    assert_eq!(object["descents"].as_array().unwrap().len(), 2 * 2 * 3);
    assert!(object["machine"]["cores"].as_u64() > Some(0), "{object}");
}

/// Ctrl-C writes the report of what is done, and the same command goes on from there.
#[cfg(unix)]
/// Biased search with too few samples for its plans makes ratios upper bounds.
#[test]
fn ratios_that_are_bounds_are_marked() {
    let run = nngtl(&[
        "bench",
        &shipped("case-study.toml"),
        "--samplers",
        "biased,directed,uniform",
        "--iterations",
        "12",
        "--trials",
        "3",
    ]);
    assert_eq!(run.code, 0, "{run:?}");
    let line = |sampler: &str| {
        let begins = format!("| all | {sampler} | biased |");
        run.out
            .lines()
            .find(|l| l.starts_with(&begins))
            .unwrap_or_else(|| panic!("{run:?}"))
    };
    assert!(line("directed").contains("| ≤ "), "{run:?}");
    assert!(line("uniform").contains("| ≈ "), "{run:?}");
}

#[test]
fn an_interrupt_keeps_what_was_done() {
    let folder = folder();
    let out = folder.path().display().to_string();
    let arguments = [
        "bench",
        "--missions",
        "60",
        "--trials",
        "2",
        "--samplers",
        "uniform",
        "--cost-iterations",
        "0",
        "--out",
        &out,
    ];
    let mut child = command()
        .args(arguments)
        .stderr(std::process::Stdio::null())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let log = folder.path().join("missions.jsonl");
    let lines = || std::fs::read_to_string(&log).map_or(0, |text| text.lines().count());
    while lines() < 4 {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let kill = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.unwrap().success());
    let code = child.wait().unwrap().code();
    let done = lines() - 1;
    assert!(
        code == Some(1) && (3..60).contains(&done),
        "{code:?}, {done} missions"
    );
    let report = std::fs::read_to_string(folder.path().join("report.md")).unwrap();
    assert!(
        report.contains(&format!("**Interrupted**: {done} of 60 missions")),
        "{report}"
    );
    let rest = nngtl(&arguments);
    assert_eq!(rest.code, 0, "{rest:?}");
    assert!(
        rest.err.contains(&format!("{done} missions are kept")),
        "{}",
        rest.err
    );
    assert_eq!(lines(), 61);
}

#[test]
fn arguments_that_make_no_sense_are_refused() {
    for (arguments, words) in [
        (
            &["bench", "--families", "caves"][..],
            "no family of maps called `caves`",
        ),
        (&["bench", "--time-limit", "1"], "required"),
        (
            &["bench", "--out", "x", "--gaps", "--cost-iterations", "9"],
            "cannot be used with",
        ),
        (
            &["bench", "scenarios", "--missions", "3"],
            "cannot be used with",
        ),
        (&["bench", "--trials", "0"], "0 is not in"),
        (&["bench", "--missions", "0"], "0 is not in"),
        (
            &["bench", "--gaps", "--cost-trials", "3"],
            "cannot be used with",
        ),
    ] {
        let run = nngtl(arguments);
        assert_eq!(run.code, 2, "{run:?}");
        assert!(run.err.contains(words), "{words}: {}", run.err);
    }
}

#[test]
fn grids_are_searched_as_grids() {
    let scenario = shipped("transfer-grid.toml");
    let always = [
        "bench",
        &scenario,
        "-q",
        "--trials",
        "1",
        "--samplers",
        "directed",
    ];
    let gaps = nngtl(
        &[
            &always[..],
            &["--gaps", "--iterations", "500", "--bounds", "--json"],
        ]
        .concat(),
    );
    let reference = &gaps.json()["references"][0];
    let best = nngtl(&["plan", &scenario, "--sampler", "exact", "--json", "-q"]).json();
    let best = best["plan"]["cost"]["total"].as_f64().unwrap();
    for bound in ["upper", "lower", "quick"] {
        let told = reference[bound].as_f64().unwrap();
        assert!((told - best).abs() < 1e-9, "{bound}: {told}, not {best}");
    }
    let folder = folder();
    let file = folder.path().join("runs.csv");
    let file = file.to_str().unwrap();
    assert_eq!(nngtl(&[&always[..], &["--csv", file]].concat()).code, 0);
    let text = std::fs::read_to_string(file).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (names, run) = (lines.next().unwrap(), lines.next().unwrap());
    let column = names
        .iter()
        .position(|name| *name == "prefix_length")
        .unwrap();
    // Centres of cells are 0.05 apart, and moves run along rows and columns.
    let cells = run[column].parse::<f64>().unwrap() / 0.05;
    assert!((cells - cells.round()).abs() < 1e-6, "{text}");
}
