use std::fs;
use std::sync::Arc;

use nalgebra::Point2;

use super::*;
use crate::automaton::{Limits, Task};
use crate::bench::{Contender, Mark, Strategy};
use crate::planner::{Problem, Settings};
use crate::system::Continuous;
use crate::workspace::{Bounds, Region, Workspace};

const STRATEGIES: [Strategy; 3] = [Strategy::Uniform, Strategy::Biased, Strategy::Flat];

/// A mission on a map with a wall; `k` moves the start.
fn case(k: u32) -> Case {
    let rectangle = |low: [f64; 2], high: [f64; 2]| {
        Polygon::rectangle(Point2::from(low), Point2::from(high)).unwrap()
    };
    let region = |name: &str, low: [f64; 2], high: [f64; 2]| Region {
        name: name.to_owned(),
        polygon: rectangle(low, high),
    };
    let map = Workspace::new(
        Bounds::unit(),
        vec![rectangle([0.4, 0.1], [0.5, 0.9])],
        vec![
            region("l1", [0.7, 0.2], [0.8, 0.3]),
            region("l2", [0.7, 0.7], [0.8, 0.8]),
        ],
    );
    let map = Arc::new(map.unwrap());
    let formula = "F l1 & G F l2".parse().unwrap();
    let task = Task::from_formula(&formula, map.alphabet().clone(), &Limits::default()).unwrap();
    let start = Point2::new(0.1 + 0.01 * f64::from(k), 0.5);
    let system = Continuous::new(map, start).unwrap();
    Case {
        name: format!("mission {k}"),
        family: Some(["paper", "mazes"][k as usize % 2].to_owned()),
        problem: Problem {
            start: system.start(),
            system: Arc::new(system),
            task: Arc::new(task),
            weight: 0.2,
        },
        translate_seconds: 0.001,
        predictions: Vec::new(),
        labels: None,
    }
}

fn study() -> Study {
    let settings = Settings {
        iterations: 3_000,
        ..Settings::default()
    };
    Study {
        comparison: Comparison {
            contenders: STRATEGIES.map(Contender::from).to_vec(),
            trials: 2,
            settings: settings.clone(),
        },
        complex_from: 4_000,
        costs: Some(CostSettings {
            settings: Settings {
                iterations: 200,
                ..settings
            },
            trials: 2,
            marks: vec![Mark::Iterations(100), Mark::Iterations(200)],
            bounds: false,
        }),
        model: None,
    }
}

fn cases() -> Vec<Case> {
    (0..4).map(case).collect()
}

fn run(cases: &[Case], folder: Option<&mut StudyFolder>, stop: &Stop) -> Findings {
    study().run(cases, folder, stop, &mut |_| {}).unwrap()
}

/// The CSV without the columns from `first` on, which hold seconds.
fn without_times(csv: &str, first: &str) -> Vec<String> {
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let kept = header.iter().position(|name| *name == first).unwrap();
    assert!(header[kept..].iter().all(|name| name.ends_with("seconds")));
    let cut = |line: &str| line.split(',').take(kept).collect::<Vec<_>>().join(",");
    csv.lines().map(cut).collect()
}

#[test]
fn two_runs_differ_in_seconds_alone() {
    let [one, two] = [(); 2].map(|()| run(&cases(), None, &Stop::new()));
    let tables = |f: &Findings| {
        [
            without_times(&f.first.to_csv(), "prefix_seconds"),
            without_times(&f.costs.as_ref().unwrap().to_csv(), "seconds"),
        ]
    };
    assert_eq!(tables(&one), tables(&two));
    assert_eq!(tables(&one)[0].len(), 1 + 4 * 3 * 2);
    // Searches that go on have seeds of their own, and a mission counts once in the ratios.
    assert_eq!(tables(&one)[1].len(), 1 + 4 * 3 * 2);
    let costs = one.costs.as_ref().unwrap();
    for case in &costs.references {
        let mine = costs.descents.iter();
        let mine = mine.filter(|d| d.case == case.case && d.contender == Strategy::Uniform.into());
        let mine: Vec<_> = mine.collect();
        assert_eq!(mine.iter().map(|d| d.seed).collect::<Vec<_>>(), [0, 1]);
        assert_ne!(mine[0].improvements, mine[1].improvements);
    }
    let text = costs.to_markdown();
    assert!(
        text.contains(
            "4 missions that the exact planner solves, 2 searches of each sampler on each"
        ),
        "{text}"
    );
    assert!(text.contains(" of 8 |"), "{text}");
    let iterations = |f: &Findings| -> Vec<f64> {
        f.first
            .rows
            .iter()
            .map(|r| r.plan.iterations.summary.mean)
            .collect()
    };
    assert_eq!(iterations(&one), iterations(&two));
    let ratios = |f: &Findings| -> Vec<_> {
        let rows = f.first.ratios.iter();
        rows.map(|r| (r.plan_iterations, r.nodes, r.length))
            .collect()
    };
    assert_eq!(ratios(&one), ratios(&two));
    // Families are rows of their own.
    assert_eq!(one.first.groups.len(), 3);
}

#[test]
fn a_run_that_was_interrupted_goes_on_with_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let whole = run(&cases(), None, &Stop::new());
    let stop = Stop::new();
    let mut open = StudyFolder::open(folder.path(), &study()).unwrap();
    let raise = stop.clone();
    let partial = study()
        .run(&cases(), Some(&mut open), &stop, &mut |done| {
            if done == 2 {
                raise.raise();
            }
        })
        .unwrap();
    assert!(partial.is_partial() && partial.first.missions == 2);
    let machine = Machine::here(Vec::new());
    open.write(&study(), &partial, &machine, "nngtl bench")
        .unwrap();
    let report = fs::read_to_string(folder.path().join("report.md")).unwrap();
    assert!(report.contains("2 of 4 missions were run"), "{report}");
    drop(open);
    // A kill in the middle of a line.
    let log = folder.path().join(log::LOG);
    let mut text = fs::read(&log).unwrap();
    text.extend(b"{\"case\":\"miss");
    fs::write(&log, text).unwrap();
    let mut open = StudyFolder::open(folder.path(), &study()).unwrap();
    assert_eq!(open.kept(), 2);
    // Another run may not write to the same folder.
    let busy = StudyFolder::open(folder.path(), &study());
    assert!(matches!(busy, Err(LogError::Busy { .. })));
    let finished = run(&cases(), Some(&mut open), &Stop::new());
    assert!(!finished.is_partial());
    assert_eq!(finished.first.trials.len(), whole.first.trials.len());
    // What was kept was not measured again: its very seconds are there.
    assert_eq!(finished.first.trials[..12], partial.first.trials[..]);
    assert_eq!(
        without_times(&finished.first.to_csv(), "prefix_seconds"),
        without_times(&whole.first.to_csv(), "prefix_seconds")
    );
    open.write(&study(), &finished, &machine, "nngtl bench")
        .unwrap();
    let files = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<String> = files
        .map(|f| f.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    let mut expected = REPORT_FILES.map(str::to_owned).to_vec();
    expected.push(log::LOG.to_owned());
    names.sort();
    expected.sort();
    assert_eq!(names, expected, "no temporary file is left");
}

#[test]
fn other_settings_and_changed_missions_are_not_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let mut open = StudyFolder::open(folder.path(), &study()).unwrap();
    run(&cases()[..1], Some(&mut open), &Stop::new());
    drop(open);
    let mut other = study();
    other.comparison.settings.seed = 7;
    let refused = StudyFolder::open(folder.path(), &other);
    assert!(matches!(refused, Err(LogError::Other { .. })));
    // Classes are made of the same runs.
    let mut classes = study();
    classes.complex_from = 10;
    let mut open = StudyFolder::open(folder.path(), &classes).unwrap();
    let mut moved = case(3);
    moved.name = case(0).name;
    assert!(open.take(&moved.name, &digest(&moved)).is_none());
    assert!(open.take(&case(0).name, &digest(&case(0))).is_some());
    drop(open);
    let log = folder.path().join(log::LOG);
    let mut text = fs::read(&log).unwrap();
    text.extend(b"{\"case\": 3}\n");
    fs::write(&log, text).unwrap();
    let damaged = StudyFolder::open(folder.path(), &study());
    assert!(
        matches!(damaged, Err(LogError::Damaged { line: 3, .. })),
        "{damaged:?}"
    );
}

#[test]
fn plots_are_drawings_with_every_sampler_and_no_number_that_is_none() {
    let findings = run(&cases(), None, &Stop::new());
    let charts = [
        plots::first_prefixes(&findings.first),
        plots::success(&findings.first),
        plots::ratios(&findings.first),
        plots::costs(findings.costs.as_ref().unwrap()),
    ];
    for chart in charts {
        let svg = chart.unwrap().to_svg();
        let numbers = svg.replace("infinite", "");
        assert!(
            !numbers.contains("NaN") && !numbers.contains("inf"),
            "{svg}"
        );
        assert!(svg.contains(">flat</text>"), "{svg}");
        crate::render::svg_png(&svg, 1.0).unwrap();
    }
    let nothing = run(&[], None, &Stop::new());
    assert!(plots::first_prefixes(&nothing.first).is_none());
    assert!(plots::ratios(&nothing.first).is_none());
    assert!(plots::costs(nothing.costs.as_ref().unwrap()).is_none());
}
