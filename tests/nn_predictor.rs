//! From a mission's data to guidance, on the CPU.

mod common;

use nalgebra::Point2;
use nngtl::alphabet::Alphabet;
use nngtl::automaton::{Limits, Task};
use nngtl::encoding::{AutomatonGraph, MapInput};
use nngtl::ltl::{ParseOptions, parse};
use nngtl::nn::{
    DeviceChoice, HEATMAP_SIDE, LoadError, LoadOptions, MODEL_FILES, ModelInfo, PredictError,
    Predictor,
};

fn rectangle(x: f64, y: f64, w: f64, h: f64) -> Vec<Point2<f64>> {
    [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
        .map(|(x, y)| Point2::new(x, y))
        .to_vec()
}

fn file(name: &str) -> Vec<u8> {
    std::fs::read(common::goldens().join(format!("models/{name}.safetensors"))).unwrap()
}

fn predictor(options: impl Into<LoadOptions>) -> Predictor {
    let (path, state) = (file("pathnet-paint-200"), file("statenet-lookup"));
    Predictor::from_bytes([("path", &path), ("state", &state)], options).unwrap()
}

/// A mission over as many regions as there are names.
struct Mission {
    graph: AutomatonGraph,
    outlines: Vec<Vec<Point2<f64>>>,
    obstacle: Vec<Point2<f64>>,
}

impl Mission {
    fn new(formula: &str) -> Self {
        let formula = parse(formula, &ParseOptions::default()).unwrap().formula;
        let names: Vec<String> = nngtl::encoding::region_order(&formula)
            .into_iter()
            .map(str::to_owned)
            .collect();
        let outlines = (0..names.len())
            .map(|i| rectangle(0.1 + 0.1 * i as f64, 0.7, 0.08, 0.08))
            .collect();
        let alphabet = Alphabet::disjoint(names).unwrap().into();
        let task = Task::from_formula(&formula, alphabet, &Limits::default()).unwrap();
        let (graph, _) = AutomatonGraph::of_task(&task).unwrap();
        Self {
            graph,
            outlines,
            obstacle: rectangle(0.3, 0.3, 0.2, 0.2),
        }
    }

    fn map(&self) -> MapInput<'_> {
        MapInput {
            bounds: [Point2::origin(), Point2::new(1.0, 0.9)],
            obstacles: vec![&self.obstacle],
            regions: self.outlines.iter().map(Vec::as_slice).collect(),
            start: Point2::new(0.05, 0.05),
            ways: Vec::new(),
        }
    }
}

#[test]
fn a_mission_gets_guidance_and_gets_it_again() {
    let mission = Mission::new("F (a & F b) & G !c");
    let mut one = predictor(DeviceChoice::Cpu);
    assert_eq!(one.device(), "cpu");
    let (first, timings) = one.predict(&mission.map(), &mission.graph).unwrap();
    assert_eq!(first.heatmap.values.len(), HEATMAP_SIDE * HEATMAP_SIDE);
    assert_eq!(first.states.len(), mission.graph.states.len());
    let in_range =
        |v: &f32| (0.0..=1.0).contains(v) && (v * 65535.0 - (v * 65535.0).round()).abs() < 1e-2;
    assert!(
        first
            .heatmap
            .values
            .iter()
            .chain(&first.states)
            .all(in_range)
    );
    assert!(timings.infer > std::time::Duration::ZERO);
    // Another mission in between leaves no trace; other threads change nothing.
    let other = Mission::new("F a");
    one.predict(&other.map(), &other.graph).unwrap();
    assert_eq!(
        one.predict(&mission.map(), &mission.graph).unwrap().0,
        first
    );
    let mut threaded = predictor(LoadOptions {
        device: DeviceChoice::Cpu,
        missions: 1,
        threads: 3,
    });
    assert_eq!(
        threaded.predict(&mission.map(), &mission.graph).unwrap().0,
        first
    );
    assert_eq!(threaded.hash(), one.hash());
}

#[test]
fn many_missions_at_once_are_as_one_by_one() {
    let missions: Vec<Mission> = ["F a", "F (a & F b) & G !c", "G F a & G F b"]
        .into_iter()
        .cycle()
        .take(40)
        .map(Mission::new)
        .collect();
    let maps: Vec<MapInput<'_>> = missions.iter().map(Mission::map).collect();
    let mut pairs: Vec<_> = missions
        .iter()
        .zip(&maps)
        .map(|(m, map)| [(map, &m.graph), (map, &m.graph)])
        .collect();
    // One that does not fit hinders no other.
    pairs[7][1] = (&maps[7], &missions[6].graph);
    let mut one = predictor(DeviceChoice::Cpu);
    for threads in [1, 2] {
        let mut many = predictor(LoadOptions {
            device: DeviceChoice::Cpu,
            missions: 40,
            threads,
        });
        let found = many.predict_many(&pairs);
        assert_eq!(found.len(), 40);
        for (k, (found, [(map, graph), _])) in found.into_iter().zip(&pairs).enumerate() {
            match found {
                Ok((guidance, _)) => assert_eq!(guidance, one.predict(map, graph).unwrap().0),
                Err(e) => assert!(
                    k == 7 && matches!(e, PredictError::Inconsistent(_)),
                    "{k}: {e}"
                ),
            }
        }
    }
    assert!(one.predict_many(&[]).is_empty());
}

#[test]
fn converted_weights_are_asked_in_their_own_encoding() {
    use nngtl::encoding::Encoding;
    let mut bytes = file("pathnet-published");
    let at = |bytes: &[u8]| {
        let text = br#"\"encoding\": 1"#;
        bytes.windows(text.len()).position(|w| w == text).unwrap() + text.len() - 1
    };
    let place = at(&bytes);
    bytes[place] = b'2';
    let state = file("statenet-published");
    let one =
        Predictor::from_bytes([("path", &bytes), ("state", &state)], DeviceChoice::Cpu).unwrap();
    assert_eq!(one.encodings(), [Encoding::Published, Encoding::Own]);
    bytes[place] = b'3';
    let refused = Predictor::from_bytes([("path", &bytes), ("state", &state)], DeviceChoice::Cpu);
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("encoding version 3")
    );
}

#[test]
fn auto_stays_on_the_cpu_for_one_mission_with_small_networks() {
    let mut one = predictor(DeviceChoice::Auto);
    assert_eq!(one.device(), "cpu");
    assert_eq!(one.take_notice(), None);
}

#[test]
fn more_regions_than_trained_for_are_told() {
    let mut one = predictor(DeviceChoice::Cpu);
    let labels = one.labels();
    let formula: Vec<String> = (0..=labels).map(|i| format!("F r{i}")).collect();
    let graph = AutomatonGraph {
        regions: labels + 1,
        states: vec![[1.0; 3]],
        literals: Vec::new(),
        ends: Vec::new(),
    };
    let outlines: Vec<_> = formula
        .iter()
        .map(|_| rectangle(0.1, 0.1, 0.1, 0.1))
        .collect();
    let map = MapInput {
        bounds: [Point2::origin(), Point2::new(1.0, 1.0)],
        obstacles: Vec::new(),
        regions: outlines.iter().map(Vec::as_slice).collect(),
        start: Point2::origin(),
        ways: Vec::new(),
    };
    let error = one.predict(&map, &graph).unwrap_err();
    assert_eq!(
        error,
        PredictError::TooManyRegions {
            used: labels + 1,
            labels
        }
    );
}

#[test]
fn inconsistent_missions_are_refused() {
    let mission = Mission::new("F a");
    let mut one = predictor(DeviceChoice::Cpu);
    let mut map = mission.map();
    map.bounds[1].x = f64::NAN;
    assert_eq!(
        one.predict(&map, &mission.graph).unwrap_err(),
        PredictError::Bounds
    );
    let mut graph = mission.graph.clone();
    graph.ends[0].1 = 99;
    assert!(matches!(
        one.predict(&mission.map(), &graph),
        Err(PredictError::Inconsistent(_))
    ));
    let mut map = mission.map();
    map.regions.clear();
    assert!(matches!(
        one.predict(&map, &mission.graph),
        Err(PredictError::Inconsistent(_))
    ));
}

#[test]
fn a_directory_loads_and_its_faults_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let error = Predictor::load(folder.path(), DeviceChoice::Cpu).unwrap_err();
    assert!(matches!(error, LoadError::Both(..)), "{error}");
    assert!(
        MODEL_FILES
            .iter()
            .all(|name| error.to_string().contains(name)),
        "{error}"
    );
    for (name, golden) in MODEL_FILES.iter().zip(["pathnet-paint", "statenet-lookup"]) {
        std::fs::write(folder.path().join(name), file(golden)).unwrap();
    }
    let mut loaded = Predictor::load(folder.path(), DeviceChoice::Cpu).unwrap();
    let mission = Mission::new("F a");
    // This network's output is smaller than 200 × 200 and is enlarged.
    let (guidance, _) = loaded.predict(&mission.map(), &mission.graph).unwrap();
    assert_eq!(guidance.heatmap.values.len(), HEATMAP_SIDE * HEATMAP_SIDE);
    std::fs::copy(
        folder.path().join(MODEL_FILES[0]),
        folder.path().join(MODEL_FILES[1]),
    )
    .unwrap();
    let error = Predictor::load(folder.path(), DeviceChoice::Cpu).unwrap_err();
    assert!(matches!(error, LoadError::Kind { .. }), "{error}");
    std::fs::write(folder.path().join(MODEL_FILES[0]), b"short").unwrap();
    let error = Predictor::load(folder.path(), DeviceChoice::Cpu).unwrap_err();
    assert!(error.to_string().contains(MODEL_FILES[0]), "{error}");
}

#[test]
fn a_model_can_be_shown() {
    let info = ModelInfo::parse("some.safetensors", &file("statenet-paper-basic")).unwrap();
    assert_eq!(info.config["variant"], "paper");
    let sizes = info
        .tensors
        .iter()
        .map(|(_, shape, _)| shape.iter().product::<usize>());
    assert_eq!(info.parameters, sizes.sum::<usize>());
    assert!(info.multiply_adds > 100_000 && info.sha256.len() == 64);
    assert!(
        serde_json::to_string(&info)
            .unwrap()
            .contains("squeeze.weight")
    );
}

#[test]
fn a_network_that_reads_ways_is_given_them_or_refuses() {
    let files = [file("pathnet-paint"), file("statenet-ways")];
    let files = [
        ("path", files[0].as_slice()),
        ("state", files[1].as_slice()),
    ];
    let mut one = Predictor::from_bytes(files, DeviceChoice::Cpu).unwrap();
    assert_eq!(one.read_ways(), [false, true]);
    let mission = Mission::new("F (a & F b) & G !c");
    let error = one.predict(&mission.map(), &mission.graph).unwrap_err();
    assert!(matches!(error, PredictError::Inconsistent(why) if why.contains("ways")));
    let mut with = |lengths: [f64; 16]| {
        let ways = lengths.to_vec();
        let map = MapInput {
            ways,
            ..mission.map()
        };
        one.predict(&map, &mission.graph).map(|found| found.0)
    };
    let near = with([0.3; 16]).unwrap();
    // Ways that lead nowhere are as long as the longest, and what is farther makes a difference.
    let nowhere = with([f64::INFINITY; 16]).unwrap();
    assert_eq!(nowhere, with([1e9; 16]).unwrap());
    assert_ne!(near.states, nowhere.states);
    assert_eq!(near.heatmap, nowhere.heatmap);
    assert!(with([f64::NAN; 16]).is_err());
}
