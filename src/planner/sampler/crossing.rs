//! Legs along which the letter changes more than once: a move changes it once at most, so they take waypoints on the way
//! (ours).

use nalgebra::{Point2, Vector2};

use super::View;
use super::choices::{Target, below};
use super::passage::goes_on;
use crate::random::{Random, unit};
use crate::system::Spot;
use crate::workspace::Polygon;

/// How far beside a corner of a region a way around it leads at most, as a share of the corner's way from the region's middle.
const BESIDE: f64 = 0.3;

/// Points beside each corner that are looked at.
const TRIES: usize = 4;

/// Corners of a region that are looked at; of regions with more, some are drawn.
const CORNERS: usize = 16;

/// So many letters on a leg take three moves or more.
const MANY: usize = 4;

/// The part of a leg that a first waypoint has to be put on, if more than one move is needed.
pub(super) fn stopover(view: &View<'_>, spot: &Spot, to: Point2<f64>) -> Option<[Point2<f64>; 2]> {
    let map = view.system.plane()?;
    let letter = map.letter_at(to)?;
    let ends = map.second_letter(spot.at, spot.letter, to, letter)?;
    Some(ends.map(|t| spot.at + (to - spot.at) * t))
}

/// A waypoint beside a region that the leg would cross, where two moves by it take the place of three or more
/// through the region: of those that were found the one with the shortest way.
pub(super) fn around(
    view: &View<'_>,
    spot: &Spot,
    to: Point2<f64>,
    target: Target,
    random: &mut Random,
) -> Option<Point2<f64>> {
    let map = view.system.plane()?;
    let there = view.system.settle(to)?;
    let letters = map.letters_along(spot.at, spot.letter, to, there.letter)?;
    if letters.len() < MANY {
        return None;
    }
    let mut best: Option<(f64, Point2<f64>)> = None;
    let crossed = letters[1..letters.len() - 1].iter();
    for region in crossed.flat_map(|&letter| map.alphabet().props(letter).iter()) {
        for at in beside(&map.regions()[region].polygon, random) {
            let length = (at - spot.at).norm() + (to - at).norm();
            if best.is_none_or(|(shortest, _)| length < shortest)
                && let Some(beside) = view.system.settle(at)
                && goes_on(view, &beside, target)
                && view.system.step(spot, &beside)
                && view.system.step(&beside, &there)
            {
                best = Some((length, at));
            }
        }
    }
    best.map(|b| b.1)
}

/// Points outside of the corners of a region, some for each.
fn beside<'r>(
    polygon: &'r Polygon,
    random: &'r mut Random,
) -> impl Iterator<Item = Point2<f64>> + 'r {
    let (middle, corners) = (middle(polygon), polygon.vertices());
    let few = corners.len() <= CORNERS;
    (0..TRIES * corners.len().min(CORNERS)).map(move |k| {
        let k = match few {
            true => k / TRIES,
            false => below(random, corners.len() as u64) as usize,
        };
        corners[k] + (corners[k] - middle) * (BESIDE * (1.0 - unit(random)))
    })
}

/// The mean of a polygon's corners.
fn middle(polygon: &Polygon) -> Point2<f64> {
    let corners = polygon.vertices();
    let sum: Vector2<f64> = corners.iter().map(|v| v.coords).sum();
    Point2::from(sum / corners.len() as f64)
}
