//! Why a plan cannot be repaired.

use nalgebra::Point2;

/// What keeps a plan from being repaired, so that the mission has to be planned anew.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BeyondRepair {
    /// The robot does not stand where the plan begins.
    #[error("it begins at ({}), the robot stands at ({})", show(.begins), show(.stands))]
    Start {
        /// The plan's first point.
        begins: Point2<f64>,
        /// The mission's start.
        stands: Point2<f64>,
    },
    /// Prefix or suffix has no point at all.
    #[error("it has no points")]
    Empty,
    /// The letters that the plan's points see on this map are no run of the mission's automaton.
    #[error("the regions that it sees on this map, in its order, do not do the task")]
    Word,
    /// The robot should stay where an obstacle is now.
    #[error("an obstacle covers ({}), where it stays", show(.0))]
    Stay(Point2<f64>),
    /// Obstacles cover every point of the loop.
    #[error("obstacles cover every point of its loop")]
    Loop,
    /// No other way was found from here to the points that come next.
    #[error("from ({}) no other way was found to the points that come next", show(.0))]
    Segment(Point2<f64>),
    /// The repaired loop passes no accepting state.
    #[error("its loop, repaired, does not do the task")]
    Acceptance,
}

fn show(p: &Point2<f64>) -> String {
    let short = |v: f64| (v * 1e4).round() / 1e4;
    format!("{}, {}", short(p.x), short(p.y))
}
