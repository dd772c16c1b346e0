//! Where a target's region is met (ours).
//!
//! A plan has to touch regions only. So a point that was drawn in one is pulled to where the leg enters it; and once a plan is known,
//! ways lead to corners of the region as well as to its middle: the shortest way to the middle may pass an obstacle on
//! one side, and the shortest plan on the other.

use nalgebra::Point2;
use smallvec::SmallVec;

use super::View;
use super::choices::Target;
use crate::alphabet::Letter;
use crate::random::{Random, chance, choose, unit};
use crate::system::Spot;

/// Share of the points in a region that are pulled to where the leg enters it.
const PULLED: f64 = 0.8;

/// How deep they lie, as a share of the way from there to the point that was drawn.
const DEPTH: f64 = 1e-3;

/// Share of samples, once a plan is known, that head for a corner of the target's region.
const CORNERS: f64 = 0.6;

/// How far from a corner they go at most, as a share of the way to another point of the region.
const SPREAD: f64 = 0.25;

/// A corner of the target's region to head for instead of its middle, in some of the samples that look for a better plan.
pub(super) fn corner(view: &View<'_>, target: Target, random: &mut Random) -> Option<Target> {
    let (letter, map) = (target.letter?, view.system.plane()?);
    if !view.is_improving() || !target.fixed || !chance(random, CORNERS) {
        return None;
    }
    let mut cells = map.cells(letter).iter();
    let cell = cells.find(|c| c.inner_point() == target.at)?;
    let corners: SmallVec<[usize; 16]> = (0..cell.corner_count()).collect();
    let at = cell.corner(*choose(random, &corners)?)?;
    Some(Target { at, ..target })
}

/// A point close to a corner of the region.
pub(super) fn beside(
    view: &View<'_>,
    corner: Point2<f64>,
    letter: Letter,
    random: &mut Random,
) -> Point2<f64> {
    let towards = view.system.sample_letter(letter, random) - corner;
    corner + towards * (SPREAD * unit(random) * unit(random))
}

/// A point of the region, or the point where the leg to it from `from` enters the region.
pub(super) fn pulled(
    view: &View<'_>,
    from: &Spot,
    at: Point2<f64>,
    letter: Letter,
    random: &mut Random,
) -> Point2<f64> {
    let Some(map) = view.system.plane().filter(|_| chance(random, PULLED)) else {
        return at;
    };
    match map.entry(from.at, from.letter, at, letter) {
        Some(t) => from.at + (at - from.at) * (t + (1.0 - t) * DEPTH),
        None => at,
    }
}
