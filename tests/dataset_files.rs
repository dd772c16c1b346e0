//! Data sets on disk: the same bytes from any number of threads and after any interruption, damage
//! detected, and every expert plan right by LTL's own semantics.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use nngtl::alphabet::Props;
use nngtl::dataset::maps::Family;
use nngtl::dataset::{
    AutomatonRecord, Expert, GenerateConfig, GenerateError, LabelledMission, MANIFEST, Manifest,
    MergeError, Outcome, Pair, Progress, ReadError, generate, labelled_missions, merge, point,
    read_manifest, read_shard,
};
use nngtl::exact;
use nngtl::ltl::semantics;
use nngtl::system::{Continuous, Ways};
use tempfile::TempDir;

fn config(out: &Path) -> GenerateConfig {
    GenerateConfig {
        to: 6,
        shard_maps: 2,
        threads: 2,
        missions_per_map: 3,
        families: Family::ALL.map(|f| (f, 1.0)).to_vec(),
        ..GenerateConfig::new(out, 11, 0)
    }
}

fn run(config: &GenerateConfig) -> Manifest {
    let outcome = generate(config, &|_| {}, &AtomicBool::new(false)).unwrap();
    assert!(matches!(outcome, Outcome::Complete(_)));
    outcome.manifest().clone()
}

/// The files of a data set with their bytes.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, fs::read(path).unwrap())
        })
        .collect();
    files.sort();
    files
}

fn fresh() -> (TempDir, Vec<(String, Vec<u8>)>) {
    let folder = TempDir::new().unwrap();
    run(&config(folder.path()));
    let files = contents(folder.path());
    (folder, files)
}

#[test]
fn threads_do_not_change_a_byte() {
    let (_folder, files) = fresh();
    let single = TempDir::new().unwrap();
    run(&GenerateConfig {
        threads: 1,
        ..config(single.path())
    });
    assert_eq!(contents(single.path()), files);
}

#[test]
fn shards_do_not_change_a_sample_and_parts_are_parts_of_the_whole() {
    let maps = |folder: &Path| -> Vec<_> {
        let manifest = read_manifest(folder).unwrap();
        let read = |shard| read_shard(folder, shard).unwrap();
        manifest.shards.iter().flat_map(read).collect()
    };
    let (folder, _) = fresh();
    let whole = maps(folder.path());
    let other = TempDir::new().unwrap();
    run(&GenerateConfig {
        shard_maps: 5,
        ..config(other.path())
    });
    assert_eq!(maps(other.path()), whole);
    let part = TempDir::new().unwrap();
    let manifest = run(&GenerateConfig {
        from: 4,
        ..config(part.path())
    });
    assert_eq!(manifest.shards[0].file, "shard-00002.jsonl.gz");
    assert_eq!(maps(part.path()), whole[4..]);
}

#[test]
fn parts_put_together_are_the_whole_byte_for_byte() {
    let (_folder, whole) = fresh();
    let parts: Vec<TempDir> = (0..2).map(|_| TempDir::new().unwrap()).collect();
    for (k, part) in parts.iter().enumerate() {
        let manifest = run(&config(part.path()).part(k as u64 + 1, 2).unwrap());
        assert_eq!(manifest.shards.len(), 1 + k);
    }
    let folders = |k: [usize; 2]| k.map(|k| parts[k].path().to_owned());
    for order in [[0, 1], [1, 0]] {
        let out = TempDir::new().unwrap();
        let manifest = merge(&folders(order), out.path()).unwrap();
        assert_eq!(contents(out.path()), whole);
        assert_eq!(manifest, read_manifest(out.path()).unwrap());
        // The whole and a part of it are the whole; and it can be continued by a run.
        let again = [out.path().to_owned(), parts[0].path().to_owned()];
        let twice = TempDir::new().unwrap();
        merge(&again, twice.path()).unwrap();
        run(&config(twice.path()));
        assert_eq!(contents(twice.path()), whole);
    }
    for (part, of) in [(0, 2), (3, 2), (1, 4)] {
        let refused = config(parts[0].path()).part(part, of);
        assert!(
            matches!(refused, Err(GenerateError::Config(_))),
            "{part}/{of}"
        );
    }
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let part = |seed, from, to, shard_maps| {
        let folder = TempDir::new().unwrap();
        run(&GenerateConfig {
            seed,
            from,
            to,
            shard_maps,
            ..config(folder.path())
        });
        folder
    };
    let out = TempDir::new().unwrap();
    let out = out.path().join("out");
    let with = |others: &[&TempDir]| {
        let folders: Vec<_> = others.iter().map(|t| t.path().to_owned()).collect();
        merge(&folders, &out).unwrap_err()
    };
    let first = part(11, 0, 2, 2);
    assert!(matches!(with(&[]), MergeError::Nothing));
    let alien = part(12, 2, 4, 2);
    let other = with(&[&first, &alien]);
    assert!(matches!(other, MergeError::OtherSet { .. }), "{other}");
    assert!(other.to_string().contains("(seed 11, here 12)"), "{other}");
    let late = part(11, 4, 6, 2);
    let gap = with(&[&late, &first]);
    assert!(
        matches!(gap, MergeError::Missing { from: 2, to: 4 }),
        "{gap}"
    );
    // The last shard of a shorter set holds fewer maps.
    let short = part(11, 0, 1, 2);
    assert!(matches!(
        with(&[&first, &short]),
        MergeError::Overlap { .. }
    ));
    fs::write(late.path().join("shard-00002.jsonl.gz"), b"no shard").unwrap();
    let damaged = with(&[&part(11, 0, 4, 2), &late]);
    assert!(matches!(damaged, MergeError::Damaged { .. }), "{damaged}");
    let nowhere = merge(&[out.join("nowhere")], &out).unwrap_err();
    assert!(matches!(nowhere, MergeError::Manifest(_)), "{nowhere}");
    assert!(
        !out.join(MANIFEST).exists(),
        "no manifest of what is not whole"
    );
}

#[test]
fn a_run_that_was_stopped_is_finished_by_the_next() {
    let (_folder, files) = fresh();
    let folder = TempDir::new().unwrap();
    let stop = AtomicBool::new(false);
    let after_three = |p: &Progress| stop.store(p.maps >= 3, Ordering::Relaxed);
    let outcome = generate(&config(folder.path()), &after_three, &stop).unwrap();
    assert!(matches!(outcome, Outcome::Stopped(_)));
    assert!(outcome.manifest().maps < 6);
    run(&config(folder.path()));
    assert_eq!(contents(folder.path()), files);
}

/// A sample depends on seed and index alone: a set of fewer maps is the beginning of a larger one.
#[test]
fn a_finished_set_is_extended_in_place_and_never_cut() {
    let (_folder, whole) = fresh();
    // The last shard is full, or has to be made again.
    for maps in [2, 3] {
        let folder = TempDir::new().unwrap();
        let shorter = GenerateConfig {
            to: maps,
            ..config(folder.path())
        };
        run(&shorter);
        let drawn = AtomicU64::new(0);
        let count = |_: &Progress| {
            drawn.fetch_add(1, Ordering::Relaxed);
        };
        generate(&config(folder.path()), &count, &AtomicBool::new(false)).unwrap();
        assert_eq!(contents(folder.path()), whole);
        assert_eq!(drawn.into_inner(), 4, "full shards are kept");
        let cut = generate(&shorter, &|_| {}, &AtomicBool::new(false)).unwrap_err();
        let says = format!("(missions 18, now {})", 3 * maps);
        assert!(cut.to_string().contains(&says), "{cut}");
        let later = GenerateConfig {
            from: 2,
            ..config(folder.path())
        };
        let later = generate(&later, &|_| {}, &AtomicBool::new(false)).unwrap_err();
        assert!(
            later.to_string().contains("(missions 18, now 6 to 18)"),
            "{later}"
        );
        assert_eq!(contents(folder.path()), whole);
    }
}

/// Whenever it is stopped, what the manifest lists can be read.
#[test]
fn an_extension_that_was_stopped_keeps_what_was_there_and_goes_on() {
    let (_folder, whole) = fresh();
    let folder = TempDir::new().unwrap();
    run(&GenerateConfig {
        to: 3,
        ..config(folder.path())
    });
    let before = contents(folder.path());
    let at_once = generate(&config(folder.path()), &|_| {}, &AtomicBool::new(true));
    assert!(matches!(at_once, Ok(Outcome::Stopped(_))));
    assert_eq!(contents(folder.path()), before);
    let stop = AtomicBool::new(false);
    let after_four = |p: &Progress| stop.store(p.maps >= 4, Ordering::Relaxed);
    let outcome = generate(&config(folder.path()), &after_four, &stop).unwrap();
    assert!(matches!(outcome, Outcome::Stopped(m) if m.maps == 4));
    let manifest = read_manifest(folder.path()).unwrap();
    assert_eq!((manifest.maps, manifest.to), (4, 6));
    assert_eq!(labelled_missions(folder.path()).unwrap().count(), 12);
    run(&config(folder.path()));
    assert_eq!(contents(folder.path()), whole);
}

/// One map of this many missions would take hours.
#[test]
fn an_interrupt_is_heard_within_a_map() {
    let folder = TempDir::new().unwrap();
    let endless = GenerateConfig {
        to: 2,
        missions_per_map: 1_000_000,
        ..config(folder.path())
    };
    let stop = AtomicBool::new(false);
    let outcome = std::thread::scope(|scope| {
        let running = scope.spawn(|| generate(&endless, &|_| {}, &stop).unwrap());
        std::thread::sleep(std::time::Duration::from_millis(300));
        stop.store(true, Ordering::Relaxed);
        running.join().unwrap()
    });
    assert!(matches!(outcome, Outcome::Stopped(m) if m.maps == 0));
}

#[test]
fn missions_that_are_drawn_are_those_that_would_be_written() {
    let (folder, _) = fresh();
    let config = config(folder.path());
    let stop = AtomicBool::new(false);
    let drawn = nngtl::dataset::drawn_missions(&config, &stop);
    let drawn: Vec<_> = drawn.map(|m| m.unwrap()).collect();
    let written: Vec<_> = labelled_missions(folder.path())
        .unwrap()
        .map(|m| m.unwrap())
        .collect();
    let records = |all: &[LabelledMission]| -> Vec<_> {
        all.iter()
            .map(|m| (m.map, m.family, m.record.clone()))
            .collect()
    };
    assert_eq!(records(&drawn), records(&written));
    stop.store(true, Ordering::Relaxed);
    assert_eq!(nngtl::dataset::drawn_missions(&config, &stop).count(), 0);
}

#[test]
fn what_a_kill_or_a_bad_disk_leaves_is_made_again() {
    let (folder, files) = fresh();
    let shard = |k: usize| folder.path().join(format!("shard-0000{k}.jsonl.gz"));
    // Cut short, missing, and one flipped bit.
    fs::write(shard(0), &files[1].1[..files[1].1.len() / 2]).unwrap();
    fs::remove_file(shard(1)).unwrap();
    let mut bytes = files[3].1.clone();
    bytes[100] ^= 1;
    fs::write(shard(2), bytes).unwrap();
    let manifest = read_manifest(folder.path()).unwrap();
    for entry in [&manifest.shards[0], &manifest.shards[2]] {
        let error = read_shard(folder.path(), entry).unwrap_err();
        assert!(matches!(error, ReadError::Damaged { .. }), "{error}");
    }
    let missing = read_shard(folder.path(), &manifest.shards[1]).unwrap_err();
    assert!(matches!(missing, ReadError::Io { .. }), "{missing}");
    run(&config(folder.path()));
    assert_eq!(contents(folder.path()), files);
    // A kill between the last shard and its manifest: the manifest does not know the shard yet.
    let mut text: serde_json::Value = serde_json::from_slice(&files[0].1).unwrap();
    text["shards"].as_array_mut().unwrap().pop();
    fs::write(folder.path().join(MANIFEST), text.to_string()).unwrap();
    run(&config(folder.path()));
    assert_eq!(contents(folder.path()), files);
}

#[test]
fn other_settings_never_mix_and_bad_ones_are_refused() {
    let (folder, _) = fresh();
    let usual = config(folder.path());
    let mut turned = usual.families.clone();
    turned.swap(0, 1);
    let error =
        |config: &GenerateConfig| generate(config, &|_| {}, &AtomicBool::new(false)).unwrap_err();
    let expert = Expert::TlRrtStar { iterations: 9 };
    for (other, says) in [
        (
            GenerateConfig {
                seed: 12,
                max_states: 7,
                ..usual.clone()
            },
            "(seed 11, now 12; max_states 60, now 7)",
        ),
        (
            GenerateConfig {
                expert,
                ..usual.clone()
            },
            "(expert exact, now name=tl-rrt-star,iterations=9)",
        ),
        // What is drawn depends on the order of the families, too.
        (
            GenerateConfig {
                families: turned,
                ..usual.clone()
            },
            "(families paper=1.0,clutter=1.0,",
        ),
    ] {
        let error = error(&other);
        assert!(matches!(error, GenerateError::OtherSet { .. }), "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
    let empty = TempDir::new().unwrap();
    let base = config(empty.path());
    for bad in [
        GenerateConfig {
            to: 0,
            ..base.clone()
        },
        GenerateConfig {
            from: 1,
            ..base.clone()
        },
        GenerateConfig {
            shard_maps: 0,
            ..base.clone()
        },
        GenerateConfig {
            missions_per_map: 0,
            ..base.clone()
        },
        GenerateConfig {
            weight: f64::NAN,
            ..base.clone()
        },
        GenerateConfig {
            random_share: 1.5,
            ..base.clone()
        },
        GenerateConfig {
            families: vec![(Family::Paper, 0.0)],
            ..base.clone()
        },
    ] {
        assert!(matches!(error(&bad), GenerateError::Config(_)));
    }
    fs::write(folder.path().join(MANIFEST), r#"{"format": 2}"#).unwrap();
    let error = read_manifest(folder.path()).unwrap_err();
    assert!(
        matches!(error, ReadError::Format { found: 2, .. }),
        "{error}"
    );
}

/// The letters along the points: what the robot sees.
fn trace(mission: &LabelledMission, points: &[Pair]) -> Vec<Props> {
    let workspace = &mission.workspace;
    let props = |l| workspace.alphabet().props(l);
    let mut word = vec![props(workspace.letter_at(point(points[0])).unwrap())];
    for w in points.windows(2) {
        let stretches = workspace.trace(point(w[0]), point(w[1])).unwrap();
        word.extend(stretches.into_iter().map(|s| props(s.letter)));
    }
    word
}

#[test]
fn every_expert_plan_satisfies_its_formula_and_keeps_the_segment_rule() {
    let (folder, _) = fresh();
    let mut count = 0;
    for mission in labelled_missions(folder.path()).unwrap() {
        let mission = mission.unwrap();
        let record = &mission.record;
        for part in [&record.prefix, &record.suffix] {
            for w in part.windows(2) {
                assert!(
                    mission.workspace.step(point(w[0]), point(w[1])),
                    "{}",
                    record.formula
                );
            }
        }
        assert_eq!(record.prefix[0], record.start);
        assert_eq!(record.prefix.last(), record.suffix.first());
        assert_eq!(record.suffix.first(), record.suffix.last());
        let (prefix, suffix) = (
            trace(&mission, &record.prefix),
            trace(&mission, &record.suffix),
        );
        let alphabet = mission.workspace.alphabet();
        let holds = semantics::holds(&mission.formula, &prefix, &suffix, alphabet).unwrap();
        assert!(holds, "map {}: {}", mission.map, record.formula);
        count += 1;
    }
    assert_eq!(count, 18);
}

#[test]
fn what_is_read_back_is_what_the_program_makes_of_the_formula() {
    let (folder, _) = fresh();
    for mission in labelled_missions(folder.path()).unwrap() {
        let mission = mission.unwrap();
        let record = &mission.record;
        assert_eq!(mission.formula.to_string(), record.formula);
        let automaton = AutomatonRecord::new(&mission.task, &record.order).unwrap();
        assert_eq!(automaton, record.automaton);
        assert!(record.visited.iter().all(|&q| q < automaton.states));
        let length = |points: &[Pair]| -> f64 {
            points
                .windows(2)
                .map(|w| (point(w[1]) - point(w[0])).norm())
                .sum()
        };
        let cost = 0.2 * length(&record.prefix) + 0.8 * length(&record.suffix);
        assert!((cost - record.cost).abs() < 1e-6);
    }
}

/// Coordinates are rounded: plans that hug borders would nearly all be lost, and their missions with them.
/// Training reads lengths of ways from the data set, planning takes them from the map: they are the same.
#[test]
fn the_ways_that_are_written_are_those_that_networks_are_asked_with() {
    let (folder, _) = fresh();
    let manifest = read_manifest(folder.path()).unwrap();
    let mut compared = 0;
    for shard in &manifest.shards {
        for map in read_shard(folder.path(), shard).unwrap() {
            let workspace = map.workspace().unwrap();
            for mission in &map.missions {
                let start = point(mission.start);
                let system = Continuous::new(Arc::clone(&workspace), start).unwrap();
                let used: Vec<Option<usize>> = mission.order.iter().copied().map(Some).collect();
                let ways = Ways::new(&system, start, &used);
                let written = |a: usize, b: usize| {
                    let (from, to) = (mission.order.get(a), mission.order.get(b));
                    match (from, to) {
                        (Some(&a), Some(&b)) => map.ways[a.max(b)][a.min(b)],
                        (Some(&k), None) | (None, Some(&k)) => mission.ways[k],
                        (None, None) => 0.0,
                    }
                };
                for a in 0..=used.len() {
                    for (b, &length) in ways.from(a).iter().enumerate() {
                        assert!(
                            (length - written(a, b)).abs() < 6e-5,
                            "{a} to {b}: {length}"
                        );
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(compared > 100);
}

/// The paper's expert needs many samples and finds plans that are no better than the exact planner's, but for rounding.
#[test]
fn the_papers_expert_plans_the_same_kind_of_missions() {
    let make = |expert, threads| {
        let folder = TempDir::new().unwrap();
        let config = GenerateConfig {
            expert,
            threads,
            to: 4,
            ..config(folder.path())
        };
        run(&config);
        (folder, config)
    };
    let sampled = Expert::TlRrtStar { iterations: 1000 };
    let (folder, config) = make(sampled, 2);
    let (again, _) = make(sampled, 1);
    assert_eq!(contents(folder.path()), contents(again.path()));
    let mut worse = 0;
    for mission in labelled_missions(folder.path()).unwrap() {
        let mission = mission.unwrap();
        assert!(
            mission
                .record
                .visited
                .contains(&mission.record.automaton.initial[0])
                || mission.record.automaton.initial.len() > 1
        );
        let best = exact::plan(&mission.workspace, mission.start, &mission.task, 0.2).unwrap();
        assert!(mission.record.cost > 0.97 * best.cost.total - 1e-3);
        worse += usize::from(mission.record.cost > 1.001 * best.cost.total);
    }
    assert!(worse > 0, "without shortening, sampled plans are longer");
    // Missions by other experts never mix.
    let other = GenerateConfig {
        expert: Expert::Exact,
        ..config
    };
    let mixed = generate(&other, &|_| {}, &AtomicBool::new(false));
    assert!(mixed.is_err(), "{mixed:?}");
}

/// The manifest's gap is that of what is written: certified bounds of the first mission of each map.
#[test]
fn the_manifest_tells_how_far_plans_are_from_the_optimum() {
    let (folder, _) = fresh();
    let told = read_manifest(folder.path()).unwrap().gap.unwrap();
    let mut gaps = Vec::new();
    let mut last = None;
    for mission in labelled_missions(folder.path()).unwrap() {
        let mission = mission.unwrap();
        if last.replace(mission.map) == Some(mission.map) {
            continue;
        }
        let cost = mission.record.cost;
        let (map, start, task) = (&mission.workspace, mission.start, &mission.task);
        let bound = exact::quick_bound(map, start, task, 0.2, cost);
        assert!(bound > 0.0 && bound <= cost);
        gaps.push((cost - bound) / bound);
    }
    assert_eq!((told.missions, told.unbounded), (6, 0));
    let mean = gaps.iter().sum::<f64>() / 6.0;
    let worst = gaps.iter().copied().fold(0.0, f64::max);
    assert!((told.mean - mean).abs() < 3e-6, "{told:?}, {mean}");
    assert!((told.worst - worst).abs() < 1e-6, "{told:?}, {worst}");
    assert!(worst > 0.0);
}

/// Sets of earlier programs do not tell it: they are read, continued and put together with those that do.
#[test]
fn sets_without_gaps_are_read_continued_and_merged() {
    let (told, whole) = fresh();
    let folder = TempDir::new().unwrap();
    run(&GenerateConfig {
        to: 4,
        ..config(folder.path())
    });
    let path = folder.path().join(MANIFEST);
    let mut text: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let forget = |object: &mut serde_json::Value| {
        assert!(
            object
                .as_object_mut()
                .unwrap()
                .shift_remove("gap")
                .is_some()
        );
    };
    forget(&mut text);
    text["shards"]
        .as_array_mut()
        .unwrap()
        .iter_mut()
        .for_each(forget);
    fs::write(&path, text.to_string()).unwrap();
    assert_eq!(read_manifest(folder.path()).unwrap().gap, None);
    let grown = run(&config(folder.path()));
    assert_eq!(
        grown.gap.map(|gap| gap.missions),
        Some(2),
        "that of new maps"
    );
    let parts = [folder.path().to_owned(), told.path().to_owned()];
    let out = TempDir::new().unwrap();
    merge(&parts, out.path()).unwrap();
    assert_eq!(contents(out.path()), whole);
}

#[test]
fn few_missions_are_lost_by_rounding() {
    let folder = TempDir::new().unwrap();
    let manifest = run(&GenerateConfig {
        to: 12,
        ..config(folder.path())
    });
    let lost = manifest.filtered.get("lost by rounding").copied();
    assert!(
        10 * lost.unwrap_or(0) <= manifest.missions,
        "{lost:?} of {}",
        manifest.missions
    );
}

/// The set that the training package's tests read is what this program makes now: what the format says and what training reads are
/// the same. After a change of maps, missions or plans it is made anew:
/// `nngtl dataset generate --out training/tests/made_by_nngtl --seed 7 --missions 12 --families paper,mazes` in an empty folder.
#[test]
fn the_set_that_training_is_tested_with_is_made_by_this_program() {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("training/tests/made_by_nngtl");
    let new = TempDir::new().unwrap();
    run(&GenerateConfig {
        families: vec![(Family::Paper, 1.0), (Family::Mazes, 1.0)],
        ..GenerateConfig::new(new.path(), 7, 12)
    });
    let all = |folder: &Path| {
        let missions = labelled_missions(folder).unwrap();
        let missions: Vec<LabelledMission> = missions.map(Result::unwrap).collect();
        assert_eq!(missions.len(), 12);
        missions
    };
    for (old, new) in all(&kept).iter().zip(&all(new.path())) {
        let (old, new) = (&old.record, &new.record);
        assert_eq!((&old.formula, &old.order), (&new.formula, &new.order));
        assert_eq!(
            (&old.automaton, &old.visited),
            (&new.automaton, &new.visited)
        );
        // Other machines may round the last digit otherwise.
        for (old, new) in [(&old.prefix, &new.prefix), (&old.suffix, &new.suffix)] {
            assert_eq!(old.len(), new.len());
            for (a, b) in old.iter().flatten().zip(new.iter().flatten()) {
                assert!((a - b).abs() < 1e-3, "{a} {b}");
            }
        }
    }
}
