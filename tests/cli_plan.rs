//! The program itself, on plans: what it prints, writes, and ends with.

mod cli;

use cli::{Run, command, finish, folder, nngtl, shipped};
use nngtl::plan::PlanFile;

/// The quickest way to a plan that needs no networks.
const QUICK: [&str; 4] = ["--sampler", "biased", "--iterations", "1500"];

fn plan(scenario: &str, more: &[&str]) -> Run {
    let mut words = vec!["plan".to_owned(), shipped(scenario)];
    words.extend(QUICK.iter().chain(more).map(ToString::to_string));
    nngtl(&words)
}

#[test]
fn a_plan_is_printed_written_drawn_and_verified() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (json, svg, png) = (path("plan.json"), path("plan.svg"), path("plan.png"));
    let run = plan(
        "case-study.toml",
        &["--out", &json, "--svg", &svg, "--png", &png],
    );
    assert_eq!(run.code, 0, "{run:?}");
    assert!(
        run.out.contains("planned and verified (biased sampler)"),
        "{run:?}"
    );
    assert!(run.out.contains("({l1})^ω"), "{run:?}");
    assert!(
        run.err.contains("wrote") && !run.err.contains("error"),
        "{run:?}"
    );

    let file = PlanFile::read(&json).unwrap();
    assert_eq!(file.scenario.as_deref(), Some("case-study"));
    assert_eq!(
        (file.sampler.as_deref(), file.seed),
        (Some("biased"), Some(0))
    );
    assert_eq!(file.suffix.len(), 1, "the suffix is trivial");
    assert!(file.first.unwrap().cost >= file.cost.unwrap().total);
    assert!(
        std::fs::read_to_string(&svg)
            .unwrap()
            .contains("stays here")
    );
    assert!(std::fs::read(&png).unwrap().starts_with(b"\x89PNG"));

    let run = nngtl(&["verify", &shipped("case-study.toml"), &json]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(
        run.out.contains("verified") && run.err.is_empty(),
        "{run:?}"
    );
}

/// What `plan --json` prints is a plan to those that read one, from a pipe too, and repairs keep its weight.
#[test]
fn results_are_plans_and_keep_their_weight() {
    let folder = folder();
    let result = folder.path().join("result.json");
    let run = plan("case-study.toml", &["--json", "-q", "--weight", "0.7"]);
    assert_eq!(run.code, 0, "{run:?}");
    std::fs::write(&result, &run.out).unwrap();
    let shipped = shipped("case-study.toml");
    let mut verify = command();
    verify.args(["verify", &shipped, "-"]);
    let verified = finish(verify.stdin(std::fs::File::open(&result).unwrap()));
    assert_eq!(verified.code, 0, "{verified:?}");
    assert!(verified.out.contains("= 0.7 ×"), "{verified:?}");
    // What the same path costs by another weight.
    let file = result.display().to_string();
    let other = nngtl(&["verify", &shipped, &file, "--weight", "1", "--json"]).json();
    assert_eq!(other["outcome"], "verified");
    assert_eq!(other["cost"]["total"], other["cost"]["prefix"]);
    let bad = run.out.replace("\"weight\":0.7", "\"weight\":7.0");
    std::fs::write(folder.path().join("bad.json"), bad).unwrap();
    let bad = folder.path().join("bad.json").display().to_string();
    let refused = nngtl(&["verify", &shipped, &bad]);
    assert_eq!(refused.code, 2, "{refused:?}");
    assert!(refused.err.contains("weight is 7"), "{refused:?}");
    let repaired = nngtl(&["replan", &shipped, &result.display().to_string(), "--json"]).json();
    assert_eq!(repaired["plan"]["weight"], 0.7);
    assert_eq!(repaired["plan"]["cost"], run.json()["plan"]["cost"]);
}

#[test]
fn a_plan_that_was_tampered_with_is_refused_with_the_reason() {
    let folder = folder();
    let json = folder.path().join("plan.json");
    let path = json.display().to_string();
    let run = plan("case-study.toml", &["--out", &path, "-q"]);
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{run:?}");
    let mut file = PlanFile::read(&json).unwrap();
    let last = file.prefix.len() - 1;
    file.prefix.remove(last / 2);
    file.write(&json).unwrap();
    let run = nngtl(&["verify", &shipped("case-study.toml"), &path, "--json"]);
    assert_eq!(run.code, 1, "{run:?}");
    let object = run.json();
    assert_eq!(
        (object["version"].as_u64(), object["outcome"].as_str()),
        (Some(1), Some("refused"))
    );
    assert!(run.err.starts_with("nngtl: error: "), "{run:?}");

    // Another mission on the same path.
    let run = plan("case-study.toml", &["--out", &path, "-q"]);
    assert_eq!(run.code, 0);
    let run = nngtl(&[
        "verify",
        &shipped("case-study.toml"),
        &path,
        "--task",
        "[] !l3",
    ]);
    assert_eq!(run.code, 1, "{run:?}");
    assert!(
        run.err.contains("G!l3") && run.err.contains("{l3}"),
        "{run:?}"
    );
    // The same map, another mission.
    assert!(!run.err.contains("made for another"), "{run:?}");
    assert!(run.err.contains("was made for the task"), "{run:?}");
    let mut verify = command();
    verify.args(["verify", "-", &path, "--task", "<> l1"]);
    verify.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios"));
    let map = std::fs::File::open(shipped("case-study.toml")).unwrap();
    let run = finish(verify.stdin(map));
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{run:?}");
    let run = nngtl(&["verify", "-", "-"]);
    assert!(
        run.code == 2 && run.err.contains("cannot both be"),
        "{run:?}"
    );
    // The same mission, another start.
    let text = std::fs::read_to_string(shipped("case-study.toml")).unwrap();
    let moved = folder.path().join("moved.toml");
    std::fs::write(&moved, text.replacen("start = [0.12,", "start = [0.13,", 1)).unwrap();
    let run = nngtl(&["verify", &moved.display().to_string(), &path]);
    assert!(run.err.contains("made for another scenario"), "{run:?}");
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let plan = |seed: &str| {
        let run = plan("patrol.toml", &["--seed", seed, "--json"]);
        let plan = &run.json()["plan"];
        [&plan["prefix"], &plan["suffix"], &plan["first"]["cost"]].map(ToString::to_string)
    };
    assert_eq!(plan("5"), plan("5"));
    // In the end both come to the same place, but not by the same way.
    assert_ne!(plan("5")[2], plan("6")[2]);
}

#[test]
fn json_holds_plan_word_and_files() {
    let folder = folder();
    let svg = folder.path().join("p.svg").display().to_string();
    let run = plan(
        "many.jsonl",
        &["--pick", "shuttle", "--json", "--svg", &svg],
    );
    assert_eq!(run.code, 0, "{run:?}");
    let object = run.json();
    assert_eq!(object["version"], 1);
    assert_eq!(object["outcome"], "planned");
    assert_eq!(object["verified"], true);
    assert_eq!(object["files"][0], svg);
    assert_eq!(object["plan"]["version"], 1);
    assert_eq!(object["plan"]["weight"], 0.5);
    assert!(object["word"].as_str().unwrap().contains("^ω"));
}

#[test]
fn missions_without_a_plan_end_with_1_and_say_why() {
    let run = plan("infeasible.toml", &[]);
    assert_eq!(run.code, 1, "{run:?}");
    assert!(
        run.err.contains(
            "{vault} cannot be reached from the start: {vault} is walled in by obstacle 1, obstacle 2, obstacle 3 and obstacle 4"
        ),
        "{run:?}"
    );
    assert!(run.out.is_empty(), "{run:?}");
    for sampler in ["biased", "exact"] {
        let object = plan("infeasible.toml", &["--json", "--sampler", sampler]).json();
        assert_eq!(object["outcome"], "unreachable", "{sampler}: {object}");
        assert_eq!(object["places"][0]["regions"][0], "vault");
        let walls = &object["places"][0]["walls"][0];
        assert_eq!(walls["obstacles"].as_array().unwrap().len(), 4, "{object}");
        assert_eq!(walls["around_start"], false);
    }

    // Satisfiable, but the regions lie apart.
    let run = plan("case-study.toml", &["--task", "<> (l1 && l2)", "--json"]);
    let object = run.json();
    assert_eq!(
        (run.code, object["outcome"].as_str()),
        (1, Some("not-on-this-map")),
        "{run:?}"
    );
    assert!(
        run.err
            .contains("`l1` and `l2` have no free point in common"),
        "{run:?}"
    );
    assert_eq!(object["facts"].as_array().unwrap().len(), 1, "{object}");

    let run = plan("case-study.toml", &["--task", "<> l1 && [] !l1", "--json"]);
    assert_eq!(
        (run.code, run.json()["outcome"].as_str()),
        (1, Some("unsatisfiable")),
        "{run:?}"
    );

    let run = nngtl(&[
        "plan",
        &shipped("patrol.toml"),
        "--sampler",
        "uniform",
        "--iterations",
        "5",
    ]);
    assert_eq!(run.code, 1, "{run:?}");
    assert!(
        run.err
            .contains("no plan found within 5 iterations; it reached")
            && run.err.contains("still needed to see"),
        "{run:?}"
    );
    let object = nngtl(&[
        "plan",
        &shipped("patrol.toml"),
        "--sampler",
        "uniform",
        "--iterations",
        "5",
        "--json",
    ])
    .json();
    assert_eq!(object["outcome"], "not-found");
    let count = |key: &str| object[key].as_u64().unwrap();
    assert!(count("states_reached") < count("states"), "{object}");
    assert!(!object["missing"].as_array().unwrap().is_empty());
}

#[test]
fn the_first_plan_is_enough_if_asked() {
    let first = plan("tl-rrt-star.toml", &["--first", "--json"]).json();
    let best = plan("tl-rrt-star.toml", &["--json"]).json();
    let total = |object: &serde_json::Value| object["plan"]["cost"]["total"].as_f64().unwrap();
    assert!(total(&best) < total(&first));
    assert_eq!(
        total(&first),
        best["plan"]["first"]["cost"].as_f64().unwrap()
    );
}

#[test]
fn short_searches_do_not_wait_for_the_networks() {
    let sampler = |more: &[&str]| {
        let object = plan(
            "case-study.toml",
            &[&["--json", "--sampler", "auto"], more].concat(),
        )
        .json();
        object["plan"]["sampler"].as_str().unwrap().to_owned()
    };
    assert_eq!(sampler(&["--first"]), "directed");
    assert_eq!(sampler(&["--iterations", "100"]), "directed");
    assert_eq!(sampler(&["--iterations", "101"]), "guided");
    assert_eq!(sampler(&[]), "guided");
    assert_eq!(sampler(&["--first", "--sampler", "guided"]), "guided");
}

#[test]
fn a_heatmap_that_was_not_written_is_not_listed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("heat.npy");
    let heatmap = path.to_str().unwrap();
    let files = |more: &[&str]| {
        let arguments = [&["--json", "-q", "--first", "--heatmap", heatmap], more].concat();
        let object = plan("case-study.toml", &arguments).json();
        let listed = object["files"].as_array().unwrap().len();
        let told = object["notices"].to_string().contains("was not written");
        (listed, told, path.exists())
    };
    assert_eq!(files(&[]), (0, true, false));
    assert_eq!(files(&["--sampler", "guided"]), (1, false, true));
}

/// Nobody misses an adapter that was left to `auto`; one that was asked for by name is told, once.
#[test]
fn an_adapter_that_was_asked_for_and_not_used_is_told_in_one_line() {
    let early = "was not used, nor looked for: the search ended before it asked the networks";
    let cases: [(&[&str], Option<&str>); 6] = [
        (&["--first", "--device", "gpu"], Some(early)),
        (&["--first", "--device", "software"], Some(early)),
        (
            &["--first", "--device", "gpu", "--sampler", "biased"],
            Some("the device gpu was not used, as the biased sampler asks no networks"),
        ),
        (
            &["--device", "gpu", "--sampler", "exact"],
            Some("the device gpu was not used, as the exact sampler asks no networks"),
        ),
        (&["--first", "--device", "cpu"], None),
        (&["--first"], None),
    ];
    for (arguments, says) in cases {
        let always = ["--json", "--sampler", "auto"];
        let run = plan("case-study.toml", &[&always, arguments].concat());
        // The exact planner says, too, that `--iterations` means nothing to it.
        let ignored = "draws no samples";
        let lines = run.err.lines();
        let lines: Vec<&str> = lines.filter(|l| !l.contains(ignored)).collect();
        let mut notices = run.json()["notices"].as_array().unwrap().clone();
        let all = notices.len();
        notices.retain(|n| !n.as_str().unwrap().contains(ignored));
        assert_eq!(
            all - notices.len(),
            usize::from(arguments.contains(&"exact")),
            "{run:?}"
        );
        match (says, &lines[..], &notices[..]) {
            (None, [], []) => {}
            (Some(says), [line], [notice]) => {
                assert!(line.contains(says), "{run:?}");
                assert!(notice.as_str().unwrap().contains(says), "{run:?}");
            }
            _ => panic!("{arguments:?}: {run:?}"),
        }
    }
}

#[test]
fn a_search_that_fails_tells_of_the_device_too() {
    let arguments = ["--sampler", "biased", "--device", "gpu", "--json"];
    let none = ["--iterations", "1", "--seed", "0"];
    let run = plan("case-study.toml", &[&arguments[..], &none].concat());
    assert_eq!(run.code, 1, "{run:?}");
    let says = "the device gpu was not used";
    assert!(run.err.contains(says), "{run:?}");
    let notices = &run.json()["notices"];
    assert!(notices[0].as_str().unwrap().contains(says), "{run:?}");
}

#[test]
fn a_search_that_ran_out_of_time_is_offered_more_of_it() {
    let none = ["--sampler", "uniform", "--time-limit", "0"];
    let run = plan("case-study.toml", &none);
    assert_eq!(run.code, 1, "{run:?}");
    assert!(run.err.contains("a longer --time-limit"), "{run:?}");
}

#[test]
fn the_exact_planner_beats_sampling_here() {
    let said = plan("case-study.toml", &["--sampler", "exact"]).out;
    assert!(said.contains("  bound   no plan costs less than"), "{said}");
    let exact = plan("case-study.toml", &["--sampler", "exact", "--json"]).json();
    let bound = &exact["plan"]["bound"];
    let (least, gap) = (
        bound["cost"].as_f64().unwrap(),
        bound["gap"].as_f64().unwrap(),
    );
    let cost = exact["plan"]["cost"]["total"].as_f64().unwrap();
    assert!(least > 0.0 && gap >= 0.0 && cost <= least * (1.0 + gap) * (1.0 + 1e-9));
    let sampled = plan("case-study.toml", &["--json"]).json();
    let total = |object: &serde_json::Value| object["plan"]["cost"]["total"].as_f64().unwrap();
    assert!(total(&exact) <= total(&sampled) && total(&exact) > 0.9 * total(&sampled));
    assert_eq!(exact["word"], "{} {l2} {} {l3} {} ({l1})^ω");
}

/// What comes from a pipe has no ending: its beginning tells its format.
#[test]
fn a_scenario_can_come_from_standard_input() {
    let toml = std::fs::read_to_string(shipped("case-study.toml")).unwrap();
    let value: serde_json::Value = toml::from_str(&toml).unwrap();
    let json = serde_json::to_string_pretty(&value).unwrap();
    let lines = format!("{value}\n\n{value}\n");
    let planned = |text: &str, more: &[&str]| {
        let file = folder();
        let path = file.path().join("piped");
        std::fs::write(&path, text).unwrap();
        let mut program = command();
        program.args(["plan", "-"]).args(QUICK).args(more);
        finish(program.stdin(std::fs::File::open(&path).unwrap()))
    };
    let all = [
        planned(&toml, &[]),
        planned(&json, &[]),
        planned(&lines, &["--pick", "3"]),
    ];
    for run in &all {
        assert_eq!((run.code, run.err.as_str()), (0, ""), "{run:?}");
        assert!(run.out.contains("({l1})^ω"), "{run:?}");
    }
    let run = planned("start = [0.1", &[]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("-:1:"), "{run:?}");
}

#[test]
fn pictures_are_not_written_under_the_names_of_other_formats() {
    for (option, name, why) in [
        ("--png", "plan.svg", "that is a name for `--svg`"),
        ("--png", "plan.JPG", "no `.jpg` can be written"),
        ("--svg", "plan.pdf", "no `.pdf` can be written"),
    ] {
        let run = plan("case-study.toml", &[option, name]);
        assert_eq!(run.code, 2, "{run:?}");
        assert!(run.err.contains(why), "{run:?}");
    }
}
