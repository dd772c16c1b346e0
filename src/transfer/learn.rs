//! Learning from plans: the legs between regions that a plan found become skills, so that a library
//! grows with use.

use super::build::polish;
use super::library::{Library, Offer};
use super::places::Places;
use super::skill::Skill;
use crate::plan::{Path, Waypoint};
use crate::system::{Spot, TransitionSystem};

/// Offers a library every part of a plan that leads from one place (the start, or a part of a region)
/// to the next; returns how many skills were kept.
pub fn learn(
    library: &mut Library,
    system: &dyn TransitionSystem,
    start: Spot,
    path: &Path,
) -> usize {
    let places = Places::new(system, start);
    let mut points: Vec<Waypoint> = path.prefix.clone();
    points.extend(path.suffix.iter().skip(1));
    // Where the suffix closes it goes on from its beginning: once more up to the first place.
    let closes = path.suffix.iter().skip(1);
    let spot = |w: &Waypoint| system.settle(w.at);
    let is_place = |w: &Waypoint| spot(w).is_some_and(|s| places.of(system, &s).is_some());
    for w in closes {
        points.push(*w);
        if is_place(w) {
            break;
        }
    }
    let mut kept = 0;
    let mut current: Vec<Spot> = Vec::new();
    for w in &points {
        let Some(here) = spot(w) else {
            current.clear();
            continue;
        };
        let place = places.of(system, &here);
        if !current.is_empty() || place.is_some() {
            current.push(here);
        }
        if place.is_none() {
            continue;
        }
        let from = current.first().and_then(|s| places.of(system, s));
        if current.len() >= 2 && from != place {
            current.dedup_by(|b, a| a.at == b.at);
            polish(system, &mut current);
            let skill = Skill::from_spots(system, std::mem::take(&mut current));
            kept += usize::from(library.offer(system, skill) == Offer::Kept);
        }
        current = vec![here];
    }
    kept
}
