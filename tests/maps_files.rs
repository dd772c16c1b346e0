//! The shipped maps: they load, plan and verify; and what is wrong with broken ones is said.
#![allow(clippy::print_stdout)] // tells what was measured

use std::path::{Path, PathBuf};

use nalgebra::Point2;
use nngtl::maps::{self, Format, MapOptions};
use nngtl::mission::{self, MissionError, Options, SamplerChoice};
use nngtl::planner::Settings;
use nngtl::scenario::{Overrides, Scenario};
use nngtl::workspace::Place;

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenarios")
        .join(name)
}

fn options(iterations: u64) -> Options {
    Options {
        sampler: SamplerChoice::Biased,
        settings: Settings {
            iterations,
            first: true,
            ..Settings::default()
        },
        ..Options::default()
    }
}

#[test]
fn shipped_maps_are_planned_and_verified() {
    for name in ["office", "cavern", "campus"] {
        let scenario = Scenario::load(shipped(&format!("{name}.toml"))).unwrap();
        assert_eq!(scenario.warnings(), [""; 0]);
        let planned = mission::plan(&scenario, &options(60_000));
        let planned = planned.unwrap_or_else(|e| panic!("{name}: {e}"));
        println!(
            "{name}: {} obstacles, first plan after {} iterations",
            scenario.workspace.obstacles().len(),
            planned.file.first.unwrap().iterations
        );
    }
}

#[test]
fn the_office_keeps_its_distance_from_walls() {
    let scenario = Scenario::load(shipped("office.toml")).unwrap();
    let map = &scenario.workspace;
    // The wall below the corridor, from y = 1.2 to 1.4, between two doors.
    let place = |x: f64, y: f64| map.locate(Point2::new(x, y));
    let free = |x: f64, y: f64| matches!(place(x, y), Place::Free { .. });
    assert!(free(1.5, 1.65) && !free(1.5, 1.58), "0.2 m above the wall");
    assert!(free(0.6, 1.3) && !free(0.35, 1.3), "in a doorway");
    assert!(map.bounds().min.x == -0.8 && map.bounds().max.y == 5.8);
    // Unknown cells are obstacles unless asked otherwise.
    let raw = |unknown_is_free| {
        let options = MapOptions {
            unknown_is_free,
            ..MapOptions::default()
        };
        maps::load(shipped("office.yaml"), &options).unwrap()
    };
    assert_eq!(raw(false).cells, raw(true).cells);
    let [free, occupied, unknown] = raw(false).cells.unwrap();
    assert_eq!((free + occupied + unknown, unknown), (120 * 80, 48));
    assert!(raw(true).obstacles.len() <= raw(false).obstacles.len());
}

#[test]
fn walls_of_maps_are_named_by_place_or_name() {
    let task = |task: &str| Overrides {
        task: Some(task.to_owned()),
        ..Overrides::default()
    };
    let why = |name: &str, formula: &str| {
        let scenario = Scenario::load_with(shipped(name), None, &task(formula)).unwrap();
        match mission::plan(&scenario, &options(10)).unwrap_err() {
            MissionError::Unreachable(why) => why.to_string(),
            other => panic!("{name}: {other}"),
        }
    };
    let text = why("campus.toml", "<> court");
    assert!(text.contains("{court} is walled in by library"), "{text}");

    let locked = std::fs::read_to_string(shipped("office.toml")).unwrap();
    let locked = locked
        .replace(
            "[workspace.regions]",
            "[workspace.regions]\nlocked = [[8.5, 3], [9, 3], [9, 3.5], [8.5, 3.5]]",
        )
        .replace("task = \"", "task = \"<> locked && ")
        .replace("office.yaml", &shipped("office.yaml").display().to_string());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("locked.toml");
    std::fs::write(&path, locked).unwrap();
    let text = why(&path.display().to_string(), "<> locked");
    assert!(
        text.contains("{locked} is walled in by the wall at ("),
        "{text}"
    );
}

/// Loads a map of one text (and a picture) and returns the complaint.
fn complaint(format: Format, text: &str, picture: Option<&[u8]>) -> String {
    let mut open = |_: &str| Ok(picture.unwrap_or_default().to_vec());
    let read = maps::read(
        Path::new("m"),
        format,
        text.as_bytes(),
        &MapOptions::default(),
        &mut open,
    );
    read.map(|_| ()).expect_err(text).to_string()
}

#[test]
fn broken_maps_say_what_is_wrong_and_where() {
    let yaml = "image: a.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\nnegate: 0\n";
    let pgm: &[u8] = b"P5 2 1 255\n\xfe\x00";
    let ros = |from: &str, to: &str| complaint(Format::Ros, &yaml.replace(from, to), Some(pgm));
    let cases = [
        (
            ros("resolution: 0.1", "resolution: -1"),
            "m:2: `resolution` is -1",
        ),
        (
            ros("resolution: 0.1", "resolution: abc"),
            "m:2: `resolution` should be a finite number",
        ),
        (ros("resolution: 0.1\n", ""), "m: `resolution` is missing"),
        (
            ros("[0, 0, 0]", "[0, 0]"),
            "m:3: `origin` should be three numbers",
        ),
        (
            ros("0.196", "0.7"),
            "m:5: `free_thresh` is 0.7: it must be less",
        ),
        (ros("negate: 0", "negate: 2"), "m:6: `negate`"),
        (ros("negate: 0", "negate 0"), "m:6: expected `name: value`"),
        (
            ros("negate: 0", "image: b"),
            "m:6: this field is there twice",
        ),
        (
            ros("negate: 0", "mode: best"),
            "m:6: `mode` should be trinary",
        ),
        (
            complaint(Format::Ros, yaml, Some(b"P5 2 2 255\n\xfe\x00")),
            "a.pgm: the picture ends after 2 of 4 pixels",
        ),
        (
            complaint(Format::Ros, yaml, Some(b"P5 1000000000 9 255\n")),
            "1000000000 × 9 cells are too many",
        ),
        (
            ros("resolution: 0.1", "resolution: 1e308"),
            "coordinates must lie within",
        ),
        (
            complaint(Format::Ros, yaml, Some(b"P5 x")),
            "byte 3: expected the width",
        ),
        (complaint(Format::Ros, yaml, Some(b"GIF8")), "neither PGM"),
        (
            complaint(Format::Ros, yaml, Some(b"\x89PNG\r\n")),
            "the PNG cannot be read",
        ),
    ];
    let octile = |rows: &str| {
        complaint(
            Format::MovingAi,
            &format!("type octile\nheight 2\nwidth 3\nmap\n{rows}"),
            None,
        )
    };
    let grids = [
        (
            octile("...\n..\n"),
            "m:6: the row has 2 cells, `width` says 3",
        ),
        (octile("...\n"), "m:5: the map ends after 1 of 2 rows"),
        (octile("...\n.X.\n"), "m:6: column 2: `X` is no terrain"),
        (octile("...\n...\n...\n"), "m:7: there are more rows"),
        (
            complaint(
                Format::MovingAi,
                "type octile\nheight 2\nwidth 9999999999\nmap\n",
                None,
            ),
            "m:4: 9999999999 × 2 cells are too many",
        ),
        (
            complaint(
                Format::MovingAi,
                "type hex\nheight 2\nwidth 2\nmap\n..\n..",
                None,
            ),
            "m:1: the first line",
        ),
        (
            complaint(Format::MovingAi, "type octile\nheight -2\n", None),
            "m:2: expected a whole number",
        ),
        (
            complaint(Format::MovingAi, "type octile\nheight 2\n", None),
            "m:2: the file ends before",
        ),
    ];
    let polygon = |rings: &str, properties: &str| {
        complaint(
            Format::GeoJson,
            &format!(
                r#"{{"type":"FeatureCollection","units":"m","features":[{{"type":"Feature","properties":{properties},"geometry":{{"type":"Polygon","coordinates":{rings}}}}}]}}"#
            ),
            None,
        )
    };
    let units = r#"{"type":"FeatureCollection","units":5,"features":[]}"#;
    assert!(complaint(Format::GeoJson, units, None).contains("`units`: is 5: expected \"m\""));
    let square = "[[[0,0],[9,0],[9,9],[0,9],[0,0]]]";
    let obstacle = r#"{"kind":"obstacle","name":"hut"}"#;
    let features = [
        (
            polygon("[[[0,0],[9,9],[9,0],[0,9],[0,0]]]", obstacle),
            "feature 1 (`hut`): the polygon crosses",
        ),
        (
            polygon("[[[0,0],[9,0],[9,9],[0,9]]]", obstacle),
            "feature 1 (`hut`): ring 1 is not closed",
        ),
        (
            polygon("[[[0,0],[9,0],[0,0]]]", obstacle),
            "at least four positions",
        ),
        (
            polygon(
                "[[[0,0],[9,0],[9,9],[0,9],[0,0]],[[5,5],[12,5],[6,6],[5,5]]]",
                obstacle,
            ),
            "rings 1 and 2 meet",
        ),
        (
            polygon(
                "[[[0,0],[9,0],[9,9],[0,9],[0,0]],[[15,5],[16,5],[16,6],[15,5]]]",
                obstacle,
            ),
            "hole 1 lies outside",
        ),
        (polygon(square, r#"{"kind":"house"}"#), "`kind` is `house`"),
        (
            polygon(square, r#"{"kind":"region"}"#),
            "a region needs a `name`",
        ),
        (
            polygon(square, r#"{"kind":"region","name":"dock/1"}"#),
            "feature 1 (`dock/1`): its name cannot name a region",
        ),
        (polygon(square, "{}"), "no feature says"),
        (
            polygon(r#"[[["a",0],[9,0],[9,9],[0,0]]]"#, obstacle),
            "expected a position",
        ),
        (
            complaint(Format::GeoJson, "{\n\"type\": 3,\n", None),
            "m:3: EOF",
        ),
        (
            complaint(
                Format::GeoJson,
                r#"{"type":"Point","coordinates":[0,0]}"#,
                None,
            ),
            "found Point",
        ),
    ];
    for (text, expected) in cases.iter().chain(&grids).chain(&features) {
        assert!(text.contains(expected), "`{text}` should say `{expected}`");
    }
}

#[test]
fn scenario_files_point_to_their_map() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let load = |text: &str| {
        std::fs::write(&path, text).unwrap();
        Scenario::load(&path)
            .map(|_| ())
            .expect_err(text)
            .to_string()
    };
    let text = load("start = [1, 1]\ntask = \"true\"\n[map]\nfile = \"no.yaml\"\n");
    assert!(
        text.contains("s.toml:4:8: the map: ") && text.contains("no.yaml: cannot read"),
        "{text}"
    );
    let text = load("start = [1, 1]\ntask = \"true\"\n[map]\nfile = \"no.gif\"\n");
    assert!(text.contains("a map ends in .yaml"), "{text}");
    let text = load("start = [1, 1]\ntask = \"true\"\n");
    assert!(
        text.contains("missing field `bounds` in `workspace`"),
        "{text}"
    );
    let text = load("task = \"true\"\n[workspace]\nbounds = [[0, 0], [1, 1]]\n");
    assert!(text.contains("missing field `start`"), "{text}");
    let text = load(
        "start = [1, 1]\nrobot_radius = -1\ntask = \"true\"\n[workspace]\nbounds = [[0, 0], [1, 1]]\n",
    );
    assert!(
        text.contains("s.toml:2:16: the robot's radius is -1"),
        "{text}"
    );
    // A setting of another kind of map is not passed over.
    let text =
        load("start = [1, 1]\ntask = \"true\"\n[map]\nfile = \"a.map\"\nunknown = \"free\"\n");
    assert!(
        text.contains("s.toml:5:11: `unknown` means nothing in maps that end in `.map`"),
        "{text}"
    );
    let text =
        load("start = [1, 1]\ntask = \"true\"\n[map]\nfile = \"a.map\"\nunknown = \"maybe\"\n");
    assert!(
        text.contains("s.toml:5:11:") && text.contains("maybe"),
        "{text}"
    );
}

/// A robot's radius also grows the polygons of a plain scenario.
#[test]
fn a_radius_grows_plain_obstacles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    let text = "start = [1, 1]\nrobot_radius = 0.5\ntask = \"<> a\"\n[workspace]\nbounds = [[0, 0], [10, 10]]\nobstacles = [[[4, 0], [6, 0], [6, 8.9], [4, 8.9]]]\n[workspace.regions]\na = [[8, 1], [9, 1], [9, 2], [8, 2]]\n";
    std::fs::write(&path, text).unwrap();
    let scenario = Scenario::load(&path).unwrap();
    let place = |x: f64, y: f64| scenario.workspace.locate(Point2::new(x, y));
    assert!(matches!(place(3.6, 5.0), Place::Obstacle(0)));
    assert!(matches!(place(3.4, 5.0), Place::Free { .. }));
    assert_eq!(place(0.4, 5.0), Place::Outside);
    assert_eq!(scenario.workspace.obstacle_name(0), "obstacle 1");
    assert!(mission::plan(&scenario, &options(5_000)).is_ok());
    // Where the robot does not fit, its radius is named.
    for start in ["[0.2, 1]", "[3.8, 1]"] {
        std::fs::write(&path, text.replacen("[1, 1]", start, 1)).unwrap();
        let why = Scenario::load(&path).unwrap_err().to_string();
        assert!(
            why.contains("for a robot_radius of 0.5, obstacles"),
            "{why}"
        );
    }
    // A gap of 1.1 m above the wall is wide enough for a robot of 0.548 m radius.
    std::fs::write(&path, text.replace("0.5", "0.548")).unwrap();
    let scenario = Scenario::load(&path).unwrap();
    assert!(mission::plan(&scenario, &options(5_000)).is_ok());
    // And too narrow for one of 0.6 m.
    std::fs::write(&path, text.replace("0.5", "0.6")).unwrap();
    let scenario = Scenario::load(&path).unwrap();
    let why = mission::plan(&scenario, &options(5_000)).unwrap_err();
    for says in [
        "walled in by obstacle 1 and the end of the map",
        "the robot_radius of 0.6: a gap may be too narrow",
    ] {
        assert!(why.to_string().contains(says), "{why}");
    }
}
