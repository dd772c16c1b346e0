//! Biased sampling: S-1 to S-6 of `nngtl.md`, III-B, with the distributions of TL-RRT*.

use super::choices::{Preference, Target, destination, settle};
use super::{Draw, View, uniform};
use crate::planner::tree::NodeId;
use crate::random::{Random, chance, normal};

/// Draws a point towards what the automaton needs next.
pub(super) fn draw(view: &View<'_>, random: &mut Random) -> Option<Draw> {
    let chosen = destination(view, Preference { predicted: None }, random)?;
    let Some(target) = chosen.target else {
        return Some(uniform(view, random));
    };
    if !chance(random, view.settings.y_rand) {
        return Some(Draw {
            closest: Some(chosen.closest),
            ..uniform(view, random)
        });
    }
    towards(view, chosen.closest, target, random)
}

/// S-5 and S-6: a point around the direction from `closest` to the second point of the shortest
/// path to `target`.
pub(super) fn towards(
    view: &View<'_>,
    closest: NodeId,
    target: Target,
    random: &mut Random,
) -> Option<Draw> {
    let from = view.tree.spot(closest).at;
    let leg = view.system.first_leg(from, target.at, target.fixed)?.to;
    let heading = leg - from;
    if let Some(letter) = target.letter
        && leg == target.at
        && chance(random, view.settings.p_target)
    {
        let at = view.system.sample_letter(letter, random);
        return Some(Draw {
            at,
            closest: Some(closest),
        });
    }
    let length = heading.norm();
    if length <= 0.0 {
        return Some(uniform(view, random));
    }
    let direction = heading / length;
    let side = view.system.bounds().side();
    let at = settle(view, random, |random| {
        let distance = (normal(random) * view.settings.distance_deviation * side).abs();
        let angle = normal(random) * view.settings.angle_deviation;
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let turned = nalgebra::Vector2::new(
            direction.x * cos - direction.y * sin,
            direction.x * sin + direction.y * cos,
        );
        from + turned * distance
    })?;
    Some(Draw {
        at,
        closest: Some(closest),
    })
}
