//! Guided sampling: C-1 and C-2 of `nngtl.md`, IV-A, and what we add to it.
//!
//! With [`Settings::paper_rule`](crate::planner::Settings::paper_rule) it is the paper's strategy. By itself it is not much better
//! than biased sampling, whatever the networks predict: a node drawn uniformly mostly has its target out
//! of sight, a rectangle to a target behind a wall holds no way around, and few points of a
//! rectangle lie in a small region. So each choice gets a share of its own: the node with the least way left
//! ([`leads`](super::leads)) to the nearest of some targets ([`nearest`](super::nearest)) as the automaton admits it
//! ([`passage`](super::passage)), points around the corner where that way bends, in the regions that it crosses or beside them
//! ([`crossing`](super::crossing)), and in the target's region once a leg leads there.
//! `docs/guidance.md` has the measurements.

use nalgebra::Point2;

use super::choices::{Destination, Preference, Target, in_box, settle};
use super::heat::{Frame, HeatmapSums};
use super::{Draw, Guide, View, uniform};
use crate::alphabet::Letter;
use crate::random::{Random, chance, unit, weighted};
use crate::system::Spot;

/// Points of a region that are drawn for the heatmap to choose from.
const CANDIDATES: usize = 4;

/// Points of a region that are looked at to find one that a leg leads to: that its middle is in sight does not say that all of it is.
const REGION_TRIES: usize = 4;

/// Points around a corner that are looked at to find one that a leg leads to.
const CORNER_TRIES: usize = 8;

/// The squares around a corner get smaller by up to so many powers of two.
const SIZES: f64 = 6.0;

/// What a state's probability counts as at least: one that the network rules out by mistake is still chosen now and then.
const LEAST: f64 = 0.02;

/// The share of choices that follow the prediction once a plan is known, at most. By then its best guess has been tried.
const IMPROVING: f64 = 0.7;

/// Cells of the frame when there is no heatmap.
const SIDE: usize = 200;

/// Draws a point as the networks predict; without predictions, as the rules alone have it.
pub(super) fn draw(guide: Option<&Guide>, view: &View<'_>, random: &mut Random) -> Option<Draw> {
    let settings = view.settings;
    if settings.lead > 0.0 {
        view.tree.leads().borrow_mut().count();
    }
    let preference = guide.map_or(Preference::default(), |g| preference(g, view));
    let Destination { closest, target } = super::nearest::choose(view, preference, random)?;
    let Some(target) = target else {
        return Some(uniform(view, random));
    };
    let corner = (settings.p_region > 0.0)
        .then(|| super::entrance::corner(view, target, random))
        .flatten();
    let target = corner.unwrap_or(target);
    if !chance(random, view.share(settings.y_rand)) {
        return Some(Draw {
            closest: Some(closest),
            ..uniform(view, random)
        });
    }
    // The original strategy keeps its share here too: a rectangle can miss every way around a wall.
    if !chance(random, view.share(settings.alpha)) {
        return super::biased::towards(view, closest, target, random);
    }
    let from = view.tree.spot(closest);
    let heat = guide.and_then(|g| g.sums.as_deref());
    let at = match aim(view, from, target, random)? {
        Area::Region(letter) if corner.is_some() => {
            super::entrance::beside(view, target.at, letter, random)
        }
        Area::Region(letter) => entering(heat, view, &from, (target, letter), random),
        Area::Between(a, b, margin) => in_rectangle(heat, view, a, b, margin, random)?,
        Area::Along([a, b]) => a + (b - a) * unit(random),
        Area::Beside(at) => at,
        Area::Corner(corner) => in_corner(heat, view, from, target, corner, random)?,
    };
    Some(Draw {
        at,
        closest: Some(closest),
    })
}

/// C-1, and unless the paper's rule is asked for: no state is ruled out, and the search for better plans trusts the prediction less.
fn preference<'a>(guide: &'a Guide, view: &View<'_>) -> Preference<'a> {
    let (alpha, ours) = (view.share(view.settings.alpha), view.settings.lead > 0.0);
    let improving = ours && view.is_improving();
    Preference {
        predicted: Some(guide.states.as_slice()),
        alpha: if improving {
            alpha.min(IMPROVING)
        } else {
            alpha
        },
        least: if ours { LEAST } else { 0.0 },
    }
}

/// Where a point is drawn from.
enum Area {
    /// The space with this letter.
    Region(Letter),
    /// The rectangle between two points, grown by so much on each side.
    Between(Point2<f64>, Point2<f64>, f64),
    /// Straight from one point to another.
    Along([Point2<f64>; 2]),
    /// This point, beside a region that a leg would cross.
    Beside(Point2<f64>),
    /// Around a corner.
    Corner(Point2<f64>),
}

/// What the way from a node to its target asks for.
fn aim(view: &View<'_>, from: Spot, target: Target, random: &mut Random) -> Option<Area> {
    let settings = view.settings;
    if settings.p_region == 0.0 && settings.corner == 0.0 {
        return Some(Area::Between(from.at, target.at, 0.0)); // C-2
    }
    let leg = super::passage::first_leg(view, &from, target);
    let leg = leg.or_else(|| view.system.first_leg(from.at, target.at, target.fixed));
    let next = leg?.to;
    let margin = settings.corner * view.system.bounds().side();
    if let Some(part) = super::crossing::stopover(view, &from, next)
        && chance(random, view.share(settings.p_region))
    {
        // Moves count until there is a plan, their length afterwards.
        let wanted = !view.is_improving();
        let beside = wanted.then(|| super::crossing::around(view, &from, next, target, random));
        return Some(beside.flatten().map_or(Area::Along(part), Area::Beside));
    }
    if next != target.at {
        return Some(if settings.corner > 0.0 {
            Area::Corner(next)
        } else {
            Area::Between(from.at, target.at, 0.0)
        });
    }
    if let Some(letter) = target.letter
        && chance(random, view.share(settings.p_region))
    {
        return Some(Area::Region(letter));
    }
    Some(Area::Between(from.at, target.at, margin))
}

/// A point near a corner that one leg leads to: of some that are drawn from squares of all sizes around the corner the one
/// with the shortest way left, of those from which it does not bend there next if there are any. Where there are none, as where obstacles
/// touch, the corner itself.
fn in_corner(
    heat: Option<&HeatmapSums>,
    view: &View<'_>,
    from: Spot,
    target: Target,
    corner: Point2<f64>,
    random: &mut Random,
) -> Option<Point2<f64>> {
    let side = view.system.bounds().side();
    let mut last = None;
    let leads_on = |there: &Spot| {
        view.system.step(&from, there) && super::passage::goes_on(view, there, target)
    };
    // Whether the corner is still ahead, the way left, and the point.
    let mut best: Option<(bool, f64, Point2<f64>)> = None;
    for k in 0..CORNER_TRIES {
        // Until there is a plan every second point is free of the heatmap: where that is wrong, a gap must not take hundreds of
        // samples.
        let heat = heat.filter(|_| k % 2 == 0 || view.is_improving());
        let margin = view.settings.corner * side * libm::exp2(-SIZES * unit(random));
        let at = in_rectangle(heat, view, corner, corner, margin, random)?;
        last = Some(at);
        if let Some(there) = view.system.settle(at)
            && leads_on(&there)
            && let Some(leg) = super::passage::first_leg(view, &there, target)
        {
            let ahead = leg.to == corner;
            let better = |&(was, left, _): &(bool, f64, _)| (ahead, leg.length) < (was, left);
            if best.as_ref().is_none_or(better) {
                best = Some((ahead, leg.length, at));
            }
        }
    }
    let itself = || view.system.settle(corner).filter(leads_on);
    match best {
        Some((false, _, at)) => Some(at),
        _ => itself().map(|spot| spot.at).or(best.map(|b| b.2)).or(last),
    }
}

/// A point of the target's region that one leg leads to, and from which one closes the cycle if it is to be closed from there, if one of
/// some draws is such a point.
fn entering(
    heat: Option<&HeatmapSums>,
    view: &View<'_>,
    from: &Spot,
    (target, letter): (Target, Letter),
    random: &mut Random,
) -> Point2<f64> {
    let root = view.tree.root();
    let mut last = from.at;
    let mut reached = None;
    for k in 0..REGION_TRIES {
        let at = match target.at == root.at && k == 0 {
            true => root.at,
            false => in_region(heat, view, letter, random),
        };
        last = super::entrance::pulled(view, from, at, letter, random);
        if let Some(there) = view.system.settle(last)
            && view.system.step(from, &there)
        {
            if !target.closes || view.system.step(&there, &root) {
                return last;
            }
            reached = reached.or(Some(last));
        }
    }
    reached.unwrap_or(last)
}

/// A point of the space with a letter, where the heatmap prefers it.
fn in_region(
    heat: Option<&HeatmapSums>,
    view: &View<'_>,
    letter: Letter,
    random: &mut Random,
) -> Point2<f64> {
    let draw = |random: &mut Random| view.system.sample_letter(letter, random);
    let Some(heat) = heat else {
        return draw(random);
    };
    let frame = Frame::new(view.system.bounds(), heat.side());
    let candidates: [Point2<f64>; CANDIDATES] = std::array::from_fn(|_| draw(random));
    let weights = candidates.map(|at| {
        let (cell, _) = frame.rectangle(at, at);
        // One more than the prediction's least step: a region may lie in the dark.
        heat.weight(cell, cell) as f64 + 1.0
    });
    let chosen = weighted(random, weights.into_iter()).unwrap_or(0);
    candidates[chosen]
}

/// C-2: a cell of a rectangle in proportion to its weight, then a point of the cell.
fn in_rectangle(
    heat: Option<&HeatmapSums>,
    view: &View<'_>,
    a: Point2<f64>,
    b: Point2<f64>,
    margin: f64,
    random: &mut Random,
) -> Option<Point2<f64>> {
    let bounds = view.system.bounds();
    let grown = nalgebra::Vector2::repeat(margin);
    let (low, high) = (
        bounds.clip(a.inf(&b) - grown),
        bounds.clip(a.sup(&b) + grown),
    );
    let frame = Frame::new(bounds, heat.map_or(SIDE, HeatmapSums::side));
    let (first, last) = frame.rectangle(low, high);
    settle(view, random, |random| match heat {
        Some(heat) => {
            let (i, j) = heat.draw(random, first, last);
            in_box(random, frame.corner(i, j), frame.corner(i + 1, j + 1))
        }
        None => in_box(
            random,
            frame.corner(first[0], first[1]),
            frame.corner(last[0] + 1, last[1] + 1),
        ),
    })
}
