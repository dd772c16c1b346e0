//! `nngtl dataset generate`: whole maps, sets that grow, and settings that do not fit.

mod cli;

use cli::{Run, folder, nngtl};

fn generate(out: &str, more: &[&str]) -> Run {
    nngtl(&[&["dataset", "generate", "--out", out], more].concat())
}

#[test]
fn a_set_is_extended_by_whole_maps_and_says_which_settings_differ() {
    let folder = folder();
    let out = folder.path().join("set").display().to_string();
    let missions = |wanted: &str| {
        let run = generate(&out, &["--missions", wanted, "--json"]);
        assert_eq!(run.code, 0, "{run:?}");
        let object = run.json();
        (object["missions"].as_u64(), object["maps"].as_u64())
    };
    assert_eq!(missions("10"), (Some(12), Some(2)));
    assert_eq!(missions("18"), (Some(18), Some(3)));
    assert_eq!(missions("18"), (Some(18), Some(3)));
    let told = generate(&out, &["--missions", "18"]).out;
    assert!(told.contains("% at worst (3 missions looked at)"), "{told}");
    for (arguments, says) in [
        (&["--missions", "10"][..], "(missions 18, now 12)"),
        (&["--missions", "18", "--seed", "4"], "(seed 0, now 4)"),
        (
            &["--missions", "18", "--families", "mazes=2,paper"],
            "(families paper=0.55,clutter=0.25,rooms=0.2, now mazes=2.0,paper=1.0)",
        ),
    ] {
        let run = generate(&out, arguments);
        assert_eq!((run.code, run.out.as_str()), (2, ""), "{run:?}");
        assert!(run.err.contains(says), "{says}: {run:?}");
    }
}

#[test]
fn help_and_refusal_tell_how_small_sets_and_parts_may_be() {
    let help = nngtl(&["dataset", "generate", "--help"]).out;
    // Lines are wrapped wherever the terminal ends.
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in [
        "rounded up to whole maps",
        "A part is at least one shard of 100 maps",
        "Missions on each map [default: 6]",
    ] {
        assert!(help.contains(words), "{words}: {help}");
    }
    let none = nngtl(&["dataset", "generate", "--out", "x", "--missions", "0"]);
    assert!(none.err.contains("0 is not in"), "{none:?}");
    let folder = folder();
    let out = folder.path().join("part").display().to_string();
    let run = generate(&out, &["--missions", "1201", "--part", "1/4"]);
    assert_eq!(run.code, 2, "{run:?}");
    let says = "a part is at least a shard of 100 maps (600 missions), of which there are 3";
    assert!(run.err.contains(says), "{run:?}");
}

/// Parts that several machines made become one set, in whatever order they are named.
#[test]
fn parts_are_put_together() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (one, two, merged) = (at("one"), at("two"), at("merged"));
    for (out, part) in [(&one, "1/2"), (&two, "2/2")] {
        let arguments = ["--missions", "1200", "--families", "small", "--part", part];
        let run = generate(out, &[&arguments[..], &["-q"]].concat());
        assert_eq!(run.code, 0, "{run:?}");
    }
    let run = nngtl(&["dataset", "merge", "--out", &merged, &two, &one]);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(
        run.out.contains("1200 missions on 200 maps in 2 shards"),
        "{run:?}"
    );
    for (part, shard) in [
        (&one, "shard-00000.jsonl.gz"),
        (&two, "shard-00001.jsonl.gz"),
    ] {
        let [there, here] = [part, &merged]
            .map(|set| std::fs::read(std::path::Path::new(set).join(shard)).unwrap());
        assert!(there == here, "{shard} differs");
    }
    let (half, nowhere) = (at("half"), at("nowhere"));
    let run = nngtl(&["dataset", "merge", "--out", &half, &two, &nowhere]);
    assert_eq!(run.code, 2, "{run:?}");
    assert!(run.err.contains("nowhere"), "{run:?}");
    assert!(!std::path::Path::new(&half).join("manifest.json").exists());
}

/// The paper's expert is another set: the manifest says so, and its plans cost no less than the exact planner's by much.
#[test]
fn the_papers_expert_makes_sets_too() {
    let folder = folder();
    let out = folder.path().join("set").display().to_string();
    let arguments = ["--missions", "6", "--seed", "5", "--expert", "tl-rrt-star"];
    let run = generate(&out, &arguments);
    assert_eq!(run.code, 0, "{run:?}");
    assert!(run.out.contains("6 missions on 1 maps"), "{run:?}");
    let other = generate(&out, &arguments[..4]);
    assert_eq!(other.code, 2, "{other:?}");
    assert!(other.err.contains("expert"), "{other:?}");
}
