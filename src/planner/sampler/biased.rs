//! Biased sampling: S-1 to S-6 of `nngtl.md`, III-B, with the distributions of TL-RRT*.

use super::choices::{Preference, Target, destination, settle};
use super::{Draw, View, uniform};
use crate::planner::tree::NodeId;
use crate::random::{Random, chance, normal, unit};

/// Share of points between two bends: a leg across a region takes waypoints inside.
const ON_THE_WAY: f64 = 0.3;

/// Draws a point towards what the automaton needs next.
pub(super) fn draw(view: &View<'_>, random: &mut Random) -> Option<Draw> {
    let chosen = destination(view, Preference::default(), random)?;
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
/// path to `target`. With probability `p_target` a point of the target's region instead, if that is in
/// sight, or else [one further along the path](along).
pub(super) fn towards(
    view: &View<'_>,
    closest: NodeId,
    target: Target,
    random: &mut Random,
) -> Option<Draw> {
    let from = view.tree.spot(closest).at;
    let leg = view.system.first_leg(from, target.at, target.fixed)?.to;
    let heading = leg - from;
    if leg == target.at {
        if let Some(letter) = target.letter
            && chance(random, view.settings.p_target)
        {
            let at = view.system.sample_letter(letter, random);
            return Some(Draw {
                at,
                closest: Some(closest),
            });
        }
    } else if target.fixed
        && view.system.plane().is_some()
        && chance(random, view.settings.p_target)
    {
        return Some(along(view, closest, target, random));
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

/// A point of the shortest path to `target` that the tree has not followed yet: the first bend after the
/// last one that is a node of the tree in the state of `closest`, or now and then a point on the way to that
/// bend, or in the target's region at the end (ours: where the path has many bends, the papers' choice
/// among all nodes seldom falls on one that is as far as the tree has come, and their distribution seldom
/// meets what can be seen from it).
fn along(view: &View<'_>, closest: NodeId, target: Target, random: &mut Random) -> Draw {
    let state = view.tree.state(closest);
    // The last node on the path, the bend after it, and the bend that was visited last.
    let mut node = closest;
    let mut next = None;
    view.system.walk(
        view.tree.spot(closest).at,
        target.at,
        &mut |bend| match view.tree.find(bend, state) {
            Some(known) if bend != target.at => (node, next) = (known, None),
            _ => next = next.or(Some(bend)),
        },
    );
    let bend = next.unwrap_or(target.at);
    let from = view.tree.spot(node).at;
    let at = if !chance(random, ON_THE_WAY) {
        match target.letter {
            Some(letter) if bend == target.at => view.system.sample_letter(letter, random),
            _ => bend,
        }
    } else {
        from + (bend - from) * unit(random)
    };
    Draw {
        at,
        closest: Some(node),
    }
}
