//! Borders that a region shares with a wall or with another region leave no gap between them: who moves along one is in the
//! region. Planners, the exact one and the checker agree.

mod made;

use made::{Edges, options, rectangles, scenario};
use nalgebra::Point2;
use nngtl::mission::{self, MissionError, SamplerChoice};
use nngtl::plan::{Path, Waypoint};
use nngtl::random::{Random, generator};
use nngtl::scenario::Scenario;
use nngtl::verify::Refusal;
use nngtl::workspace::Workspace;
use rand::RngExt;

fn map(side: f64, obstacles: &[Edges], regions: &[(&str, Edges)]) -> Workspace {
    rectangles(side, obstacles, regions).expect("the map is sound")
}

/// A wall with a doorway that the region `door` fills.
fn doorway() -> Workspace {
    let walls = [[4.0, 0.0, 5.0, 4.0], [4.0, 6.0, 5.0, 10.0]];
    let regions = [
        ("door", [4.0, 4.0, 5.0, 6.0]),
        ("goal", [8.0, 1.0, 9.0, 2.0]),
    ];
    map(10.0, &walls, &regions)
}

fn path(points: &[[f64; 2]]) -> Path {
    let at = |&[x, y]: &[f64; 2]| Waypoint {
        at: Point2::new(x, y),
        state: nngtl::automaton::StateId(0),
    };
    let prefix: Vec<Waypoint> = points.iter().map(at).collect();
    let suffix = vec![*prefix.last().unwrap()];
    Path { prefix, suffix }
}

fn checked(scenario: &Scenario, path: &Path) -> Result<String, Refusal> {
    let found = mission::verify(scenario, None, path, scenario.weight, None)?;
    Ok(found.word.show(scenario.workspace.alphabet()))
}

#[test]
fn nobody_slips_between_a_door_and_its_frame() {
    let task = "<> goal && [] !door";
    let closed = scenario(doorway(), Point2::new(1.0, 1.0), task);
    for sampler in [
        SamplerChoice::Exact,
        SamplerChoice::Directed,
        SamplerChoice::Biased,
    ] {
        let refused = mission::plan(&closed, &options(sampler, 500)).unwrap_err();
        assert!(
            matches!(refused, MissionError::Unreachable(_)),
            "{sampler:?}: {refused}"
        );
    }
    let slip = path(&[[1.0, 1.0], [1.0, 4.0], [4.5, 4.0], [8.5, 4.0], [8.5, 1.5]]);
    let refused = checked(&closed, &slip).unwrap_err();
    assert!(refused.to_string().contains("door"), "{refused}");
    // Open to all, the same way passes the door.
    let open = scenario(doorway(), Point2::new(1.0, 1.0), "<> goal");
    assert_eq!(checked(&open, &slip).unwrap(), "{} {door} {} ({goal})^ω");
    assert!(mission::plan(&open, &options(SamplerChoice::Exact, 1)).is_ok());
}

#[test]
fn along_the_wall_of_a_room_one_is_in_the_room() {
    let walls = [[0.0, 0.0, 10.0, 1.0]];
    let regions = [
        ("room", [2.0, 1.0, 8.0, 5.0]),
        ("hall", [0.0, 5.0, 10.0, 10.0]),
    ];
    let scenario = scenario(
        map(10.0, &walls, &regions),
        Point2::new(3.0, 1.0),
        "[] room",
    );
    let along = path(&[[3.0, 1.0], [7.0, 1.0], [7.0, 3.0]]);
    assert_eq!(checked(&scenario, &along).unwrap(), "({room})^ω");
    let out = path(&[[3.0, 1.0], [9.0, 1.0]]);
    assert!(checked(&scenario, &out).is_err());
}

#[test]
fn between_two_rooms_one_is_in_one_of_them() {
    let regions = [("a", [2.0, 2.0, 5.0, 8.0]), ("b", [5.0, 2.0, 8.0, 8.0])];
    let task = "[] !(a | b)";
    let scenario = scenario(map(10.0, &[], &regions), Point2::new(5.0, 1.0), task);
    let through = path(&[[5.0, 1.0], [5.0, 5.0], [5.0, 9.0]]);
    assert!(checked(&scenario, &through).is_err());
    let around = path(&[[5.0, 1.0], [8.0, 2.0], [8.0, 8.0], [5.0, 9.0]]);
    assert_eq!(checked(&scenario, &around).unwrap(), "({})^ω");
}

fn on_whole_numbers(random: &mut Random) -> Edges {
    let mut pair = || {
        let low = random.random_range(0..7_u32);
        let high = low + random.random_range(1..=3_u32.min(8 - low));
        [f64::from(low), f64::from(high)]
    };
    let ([x0, x1], [y0, y1]) = (pair(), pair());
    [x0, y0, x1, y1]
}

/// Borders coincide all over such maps. What reachability calls impossible, the exact planner must not find.
#[test]
fn what_is_called_impossible_has_no_exact_plan() {
    let mut random = generator(41, 0);
    let mut impossible = 0;
    for round in 0..600 {
        let obstacles: Vec<Edges> = (0..4).map(|_| on_whole_numbers(&mut random)).collect();
        let regions = ["a", "b", "c"].map(|name| (name, on_whole_numbers(&mut random)));
        let map = map(8.0, &obstacles, &regions);
        let start = Point2::new(0.4, 0.3);
        if map.letter_at(start).is_none() {
            continue;
        }
        let task = ["<> a && [] !b", "<> b && [] !(a | c)", "(!b U a) && <> c"][round % 3];
        let scenario = scenario(map, start, task);
        let Err(why) = mission::plan(&scenario, &options(SamplerChoice::Directed, 1)) else {
            continue;
        };
        if !matches!(
            why,
            MissionError::Unreachable(_) | MissionError::NotOnThisMap(_)
        ) {
            continue;
        }
        impossible += 1;
        let exact = mission::plan(&scenario, &options(SamplerChoice::Exact, 1));
        let word = exact.map(|p| p.verified.word.show(scenario.workspace.alphabet()));
        assert!(word.is_err(), "round {round}: {why}, but {word:?}");
    }
    assert!(impossible > 50, "{impossible}");
}
