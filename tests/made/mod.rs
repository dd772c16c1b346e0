//! Scenarios made in tests, and how they are planned.

use std::sync::Arc;

use nalgebra::Point2;
use nngtl::mission::{Options, SamplerChoice};
use nngtl::planner::Settings;
use nngtl::scenario::Scenario;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

pub(crate) fn scenario(workspace: Workspace, start: Point2<f64>, task: &str) -> Scenario {
    Scenario {
        name: "made".to_owned(),
        workspace: Arc::new(workspace),
        start,
        formula: task.parse().unwrap(),
        task: task.to_owned(),
        weight: 0.2,
        robot_radius: 0.0,
        hash: String::new(),
        grid: None,
    }
}

pub(crate) fn options(sampler: SamplerChoice, iterations: u64) -> Options {
    Options {
        sampler,
        settings: Settings {
            iterations,
            ..Settings::default()
        },
        ..Options::default()
    }
}

#[allow(dead_code, reason = "not every test is made of it")]
/// A corridor of 11 × 1 with places `a`, `b` and `c` from 1, 5 and 9 to half a unit further on.
pub(crate) fn corridor() -> Workspace {
    let region = |(name, x): (&str, f64)| Region {
        name: name.to_owned(),
        polygon: Polygon::rectangle(Point2::new(x, 0.2), Point2::new(x + 0.5, 0.8)).unwrap(),
    };
    let regions = [("a", 1.0), ("b", 5.0), ("c", 9.0)].map(region).to_vec();
    let bounds = Bounds {
        min: Point2::new(0.0, 0.0),
        max: Point2::new(11.0, 1.0),
    };
    Workspace::new(bounds, Vec::new(), regions).unwrap()
}

#[allow(dead_code, reason = "not every test is made of it")]
/// Left, lower, right and upper edge.
pub(crate) type Edges = [f64; 4];

#[allow(dead_code, reason = "not every test is made of it")]
/// A square map of rectangles; `None` if they leave none.
pub(crate) fn rectangles(
    side: f64,
    obstacles: &[Edges],
    regions: &[(&str, Edges)],
) -> Option<Workspace> {
    let polygon = |e: &Edges| {
        Polygon::rectangle(Point2::new(e[0], e[1]), Point2::new(e[2], e[3])).expect("it has area")
    };
    let region = |(name, edges): &(&str, Edges)| Region {
        name: (*name).to_owned(),
        polygon: polygon(edges),
    };
    let bounds = Bounds {
        min: Point2::origin(),
        max: Point2::new(side, side),
    };
    let obstacles = obstacles.iter().map(polygon).collect();
    let regions = regions.iter().map(region).collect();
    Workspace::new(bounds, obstacles, regions).ok()
}
