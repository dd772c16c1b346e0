//! One iteration on one tree.

use nalgebra::Point2;

use crate::automaton::Task;
use crate::planner::Problem;
use crate::planner::sampler::{Aim, Draw, Sampler, View};
use crate::planner::settings::Settings;
use crate::planner::tree::Tree;
use crate::random::Random;

/// One iteration on one tree: sample by the task as samplers see it, steer, extend, rewire. Whether anything was
/// connected.
pub(super) fn grow(
    (problem, task): (&Problem, &Task),
    sampler: &Sampler,
    settings: &Settings,
    tree: &mut Tree<'_>,
    aim: Aim,
    limit: f64,
    random: &mut Random,
) -> bool {
    let began = tree.began();
    let view = View {
        system: &*problem.system,
        task,
        settings,
        tree,
        aim,
    };
    let Some(Draw { at, closest }) = sampler.draw(&view, random) else {
        return false;
    };
    tree.sampled(began);
    let side = problem.system.bounds().side();
    if settings.range.is_none() && !tree.may_lead_over(at) {
        return false; // found out sooner than what is near
    }
    let near = settings.near(tree.site_count(), side);
    let (anchor, from) = match closest {
        Some(node) => (tree.site_of(node), tree.spot(node).at),
        None => tree.nearest_of(at, near),
    };
    let at = match settings.range {
        Some(range) => steer(from, at, range * side),
        None => at,
    };
    if problem.system.distance(tree.root().at, at) >= limit {
        return false;
    }
    let Some(spot) = problem.system.settle(at) else {
        return false;
    };
    tree.extend(spot, near, &[anchor]).is_some()
}

/// As [`grow`], towards a point of the best plan.
pub(super) fn grow_to(
    problem: &Problem,
    settings: &Settings,
    tree: &mut Tree<'_>,
    at: Point2<f64>,
) -> bool {
    let Some(spot) = problem.system.settle(at) else {
        return false;
    };
    let near = settings.near(tree.site_count(), problem.system.bounds().side());
    let (anchor, _) = tree.nearest_of(at, near);
    tree.extend(spot, near, &[anchor]).is_some()
}

/// The point at most `range` away from `from` in the direction of `to`.
fn steer(from: Point2<f64>, to: Point2<f64>, range: f64) -> Point2<f64> {
    let length = (to - from).norm();
    if length <= range {
        return to;
    }
    from + (to - from) * (range / length)
}
