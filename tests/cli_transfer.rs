//! The program itself, on libraries of skills: build, look at, merge, plan with, learn, repair.

mod cli;

use std::collections::BTreeSet;
use std::path::Path;

use cli::{Run, folder, nngtl, shipped};
use nngtl::plan::PlanFile;

fn run(words: &[&str]) -> Run {
    nngtl(words)
}

fn done(words: &[&str]) -> Run {
    let run = run(words);
    assert_eq!(run.code, 0, "{words:?}: {run:?}");
    run
}

/// The path of a file in a folder, as text.
fn file(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).display().to_string()
}

/// A library of the paper's map, built from a mission over these regions.
fn build(task: &str, out: &str) {
    let grid = shipped("transfer-grid.toml");
    done(&[
        "library", "build", &grid, "--task", task, "--out", out, "-q",
    ]);
}

#[test]
fn a_library_is_built_shown_merged_and_reused() {
    let folder = folder();
    let grid = shipped("transfer-grid.toml");
    let (left, right, both) = (
        file(&folder, "left.library"),
        file(&folder, "right.library"),
        file(&folder, "both.library"),
    );
    build("F r1 & F r2", &left);
    build("F r2 & F r3", &right);
    done(&["library", "merge", &left, &right, "--out", &both]);
    // start–r1, start–r2, r1–r2; start–r2, start–r3, r2–r3. Of two skills for the same pair both stay if
    // the cheaper one passes more.
    for (library, pairs) in [(&left, 3), (&right, 3), (&both, 5)] {
        let shown = done(&["library", "show", library, "--json"]).json();
        let skills = shown["library"]["skills"].as_array().unwrap();
        let ends = |skill: &serde_json::Value| {
            let path = skill["path"].as_array().unwrap();
            let mut ends = [path[0].to_string(), path[path.len() - 1].to_string()];
            ends.sort_unstable();
            ends
        };
        let found: BTreeSet<_> = skills.iter().map(ends).collect();
        assert_eq!(found.len(), pairs, "{shown}");
    }
    let png = file(&folder, "library.png");
    done(&["library", "show", &both, "--scenario", &grid, "--png", &png]);
    assert!(std::fs::read(&png).unwrap().starts_with(b"\x89PNG"));

    let (plan, svg) = (file(&folder, "plan.json"), file(&folder, "plan.svg"));
    let task = "GF r1 & GF r2 & GF r3";
    let words = [
        "transfer",
        &grid,
        "--task",
        task,
        "--library",
        &both,
        "--first",
    ];
    let told = done(&[&words[..], &["--out", &plan, "--svg", &svg]].concat());
    assert!(told.out.contains("planned and verified"), "{told:?}");
    assert!(told.out.contains("legs are reused"), "{told:?}");
    assert!(
        std::fs::read_to_string(&svg)
            .unwrap()
            .contains("reused skill")
    );
    done(&["verify", &grid, &plan, "--task", task]);
}

#[test]
fn a_library_learns_what_a_plan_found() {
    let folder = folder();
    let grid = shipped("transfer-grid.toml");
    let library = file(&folder, "some.library");
    build("F r1 & F r2", &library);
    let count = || {
        let shown = done(&["library", "show", &library, "--json"]).json();
        shown["library"]["skills"].as_array().map_or(0, Vec::len)
    };
    let before = count();
    let task = "GF r1 & GF r5";
    let words = ["transfer", &grid, "--task", task, "--library", &library];
    let more = ["--iterations", "400", "--learn", "--json"];
    let first = done(&[&words[..], &more].concat()).json();
    assert!(count() > before);
    let again = done(&[&words[..], &more].concat()).json();
    let matched = |run: &serde_json::Value| run["reuse"]["matched"].as_u64().unwrap();
    assert!(matched(&again) > matched(&first), "{first} {again}");
}

#[test]
fn a_plan_is_repaired_when_an_obstacle_appears_on_its_way() {
    let folder = folder();
    let grid = shipped("transfer-grid.toml");
    let (library, plan, repaired) = (
        file(&folder, "l.library"),
        file(&folder, "plan.json"),
        file(&folder, "repaired.json"),
    );
    build("F r1 & F r2", &library);
    let task = "GF r1 & GF r2";
    let words = ["transfer", &grid, "--task", task, "--library", &library];
    done(&[&words[..], &["--first", "--out", &plan, "-q"]].concat());
    // The mission is the plan's, not the scenario's.
    let unchanged = done(&["replan", &grid, &plan]);
    assert!(unchanged.out.contains("the plan still holds"));
    assert!(unchanged.out.contains("unchanged and verified"));

    // An obstacle on the middle of the suffix's longest leg.
    let path = PlanFile::read(Path::new(&plan)).unwrap().path();
    let legs = path.suffix.windows(2).map(|w| (w[0].at, w[1].at));
    let (a, b) = legs
        .max_by(|x, y| (x.1 - x.0).norm().total_cmp(&(y.1 - y.0).norm()))
        .unwrap();
    let middle = nalgebra::center(&a, &b);
    let cell = [(middle.x / 0.05).floor(), (middle.y / 0.05).floor()].map(|i| 0.05 * i);
    let corner = |i: f64, j: f64| format!("[{:.2}, {:.2}]", cell[0] + i, cell[1] + j);
    let (w, block) = (0.05, file(&folder, "changed.toml"));
    let square = [(0.0, 0.0), (w, 0.0), (w, w), (0.0, w)].map(|(i, j)| corner(i, j));
    let map = std::fs::read_to_string(&grid).unwrap();
    let more = format!("obstacles = [\n    [{}],", square.join(", "));
    std::fs::write(&block, map.replacen("obstacles = [", &more, 1)).unwrap();

    let refused = run(&["verify", &block, &plan, "--task", task]);
    assert_eq!(refused.code, 1, "{refused:?}");
    let told = done(&["replan", &block, &plan, "--out", &repaired]);
    assert!(told.out.contains("repaired and verified"), "{told:?}");
    assert!(told.out.contains("replaced in"), "{told:?}");
    done(&["verify", &block, &repaired, "--task", task]);

    // The robot stands elsewhere: there is no segment to repair.
    let moved = file(&folder, "moved.toml");
    let map = std::fs::read_to_string(&grid).unwrap();
    let start = map.replacen("start = [0.025, 0.025]", "start = [0.925, 0.925]", 1);
    std::fs::write(&moved, start).unwrap();
    let told = done(&["replan", &moved, &plan, "--library", &library, "--first"]);
    let says =
        "cannot be repaired: it begins at (0.025, 0.025), the robot stands at (0.925, 0.925)";
    assert!(told.out.contains(says), "{told:?}");
    // A task of the plan's that this map does not know is the plan's, not the user's.
    let renamed = file(&folder, "renamed.toml");
    std::fs::write(&renamed, map.replace("r2", "q2")).unwrap();
    let refused = run(&["replan", &renamed, &plan]);
    assert_eq!(refused.code, 2, "{refused:?}");
    assert!(refused.err.contains(&format!("{plan}:1:")), "{refused:?}");

    // The library of the old map is checked skill by skill, and what is blocked is told.
    let words = ["transfer", &block, "--task", task, "--library", &library];
    let told = done(&[&words[..], &["--first"]].concat());
    assert!(told.err.contains("another map"), "{told:?}");
    // It is not written under the other map's name.
    let before = std::fs::read(&library).unwrap();
    for words in [
        &[&words[..], &["--learn"]].concat()[..],
        &["library", "build", &block, "--out", &library, "--extend"],
    ] {
        let refused = run(words);
        assert_eq!(refused.code, 2, "{refused:?}");
        assert!(refused.err.contains("would keep"), "{refused:?}");
    }
    assert_eq!(std::fs::read(&library).unwrap(), before);
}

#[test]
fn a_library_of_nothing_is_not_written() {
    let folder = folder();
    let out = file(&folder, "l.library");
    let grid = shipped("transfer-grid.toml");
    for (task, code, says) in [
        ("G !r1", 1, "no subtask that asks for a path"),
        ("F r1 & G !r1", 1, "unsatisfiable"),
    ] {
        let words = ["library", "build", &grid, "--task", task, "--out", &out];
        let told = run(&words);
        assert_eq!(told.code, code, "{told:?}");
        assert!(told.err.contains(says), "{told:?}");
        assert!(!Path::new(&out).exists());
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_work() {
    let folder = folder();
    let map = file(&folder, "map.toml");
    std::fs::copy(shipped("transfer-grid.toml"), &map).unwrap();
    let here = folder.path().display().to_string();
    for (out, reason) in [
        (map.as_str(), "read as input"),
        (here.as_str(), "it is a folder"),
        ("/nowhere/x.library", "no such folder"),
    ] {
        let refused = run(&["library", "build", &map, "--out", out]);
        assert_eq!(refused.code, 2, "{refused:?}");
        assert!(refused.err.contains(reason), "{refused:?}");
    }
    let shipped = std::fs::read(shipped("transfer-grid.toml")).unwrap();
    assert_eq!(std::fs::read(&map).unwrap(), shipped);
}

/// What is not an ordinary file is written to, not replaced.
#[cfg(unix)]
#[test]
fn links_stay_links_and_devices_devices() {
    let folder = folder();
    let (real, link) = (file(&folder, "real.library"), file(&folder, "link.library"));
    std::fs::write(&real, "old").unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    build("F r1", &link);
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(
        std::fs::read_to_string(&real)
            .unwrap()
            .starts_with("nngtl-library")
    );
    // A pipe of our own, in place of a device.
    let pipe = file(&folder, "pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if !made.is_ok_and(|status| status.success()) {
        return;
    }
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read_to_string(pipe).unwrap()
    });
    build("F r1", &pipe);
    assert!(reader.join().unwrap().starts_with("nngtl-library"));
    use std::os::unix::fs::FileTypeExt;
    assert!(
        std::fs::symlink_metadata(&pipe)
            .unwrap()
            .file_type()
            .is_fifo()
    );
}

#[test]
fn damaged_and_foreign_libraries_are_refused_with_the_reason() {
    let folder = folder();
    let grid = shipped("transfer-grid.toml");
    let library = file(&folder, "l.library");
    build("F r1", &library);
    let words = |library: &str| {
        run(&[
            "transfer",
            &grid,
            "--task",
            "F r1",
            "--library",
            library,
            "--first",
        ])
    };
    let text = std::fs::read_to_string(&library).unwrap();
    let (cut, changed, none) = (
        file(&folder, "cut.library"),
        file(&folder, "changed.library"),
        file(&folder, "none.library"),
    );
    std::fs::write(&cut, &text[..text.len() / 2]).unwrap();
    std::fs::write(&changed, text.replacen("0.02", "0.03", 1)).unwrap();
    for (library, reason) in [
        (&cut, "damaged"),
        (&changed, "damaged"),
        (&none, "none.library"),
    ] {
        let refused = words(library);
        assert_eq!(refused.code, 2, "{refused:?}");
        assert!(refused.err.contains(reason), "{refused:?}");
    }
    assert!(!Path::new(&none).exists());
}

/// The plan's states are those of another automaton, which has more of them.
#[test]
fn a_plan_is_repaired_for_another_task() {
    let folder = folder();
    let scenario = file(&folder, "map.toml");
    let plan = file(&folder, "plan.json");
    let text = |obstacle: &str| {
        format!(
            "start = [0.1, 0.1]\ntask = \"<> a && <> b && <> c\"\n[workspace]\nbounds = [[0, 0], [1, 1]]\nobstacles = [{obstacle}]\n[workspace.regions]\n\
             a = [[0.1, 0.8], [0.2, 0.8], [0.2, 0.9]]\nb = [[0.8, 0.1], [0.9, 0.1], [0.9, 0.2]]\nc = [[0.8, 0.8], [0.9, 0.8], [0.9, 0.9]]\n"
        )
    };
    std::fs::write(&scenario, text("")).unwrap();
    done(&["plan", &scenario, "--out", &plan]);
    let wall = "[[0.05, 0.4], [0.6, 0.4], [0.6, 0.45], [0.05, 0.45]], [[0.4, 0.05], [0.45, 0.05], [0.45, 0.35], [0.4, 0.35]]";
    std::fs::write(&scenario, text(wall)).unwrap();
    for task in ["<> b", "<> a", "[]<> a && []<> b", "<>[] c"] {
        let repaired = done(&["replan", &scenario, &plan, "--task", task]);
        assert!(repaired.out.contains("verified"), "{task}: {repaired:?}");
    }
}

/// One end of an aisle is closed: the old way out of it, now there and back, is not kept for its own sake.
#[test]
fn a_repair_keeps_no_way_that_leads_nowhere() {
    let folder = folder();
    let (scenario, plan) = (file(&folder, "map.toml"), file(&folder, "plan.json"));
    let text = |closed: &str| {
        format!(
            r#"
start = [1, 1]
robot_radius = 0.3
task = "[]<> dock && []<> shelf1 && []<> shelf2 && [] !hazard && (!shelf1 U charge)"
[workspace]
bounds = [[0, 0], [20, 12]]
obstacles = [{closed}
  [[4, 2], [5, 2], [5, 10], [4, 10]],
  [[8, 2], [9, 2], [9, 10], [8, 10]],
  [[12, 2], [13, 2], [13, 10], [12, 10]],
]
[workspace.regions]
dock = [[0, 10], [2, 10], [2, 12], [0, 12]]
shelf1 = [[6, 5], [7, 5], [7, 6], [6, 6]]
shelf2 = [[10, 5], [11, 5], [11, 6], [10, 6]]
charge = [[17, 1], [19, 1], [19, 3], [17, 3]]
hazard = [[14, 8], [19, 8], [19, 11], [14, 11]]
"#
        )
    };
    std::fs::write(&scenario, text("")).unwrap();
    done(&["plan", &scenario, "--out", &plan, "--iterations", "1000"]);
    std::fs::write(&scenario, text("[[5, 9.5], [8, 9.5], [8, 12], [5, 12]],")).unwrap();
    let cost = |words: &[&str]| {
        let object = done(words).json();
        let repaired = object["change"]["kind"] == "repaired";
        (object["plan"]["cost"]["total"].as_f64().unwrap(), repaired)
    };
    let (repaired, is_repaired) = cost(&["replan", &scenario, &plan, "--json"]);
    let (anew, _) = cost(&["plan", &scenario, "--iterations", "1000", "--json"]);
    assert!(is_repaired && repaired < 1.05 * anew, "{repaired} {anew}");
}
