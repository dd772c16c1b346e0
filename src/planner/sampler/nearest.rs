//! Which of the destinations that the automaton could have next to head for (ours): legs to two of them in turn would take
//! the samples of both, and the nearest first is the better order in most missions.

use smallvec::SmallVec;

use super::View;
use super::choices::{Destination, Preference, Target, destination};
use super::leads::{self, Lead};
use crate::automaton::StateId;
use crate::random::{Random, chance};

/// Destinations that are drawn to choose from.
const DRAWN: usize = 4;

/// A destination, and with probability [`lead`](crate::planner::Settings::lead) the node that has the least way left to it.
/// Until a plan is known, it is the nearest of some that were drawn.
pub(super) fn choose(
    view: &View<'_>,
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<Destination> {
    if !chance(random, view.share(view.settings.lead)) {
        return destination(view, preference, random);
    }
    // A node from which the automaton makes no progress is not the end of the sample.
    let mut draws = (0..DRAWN).map(|_| destination(view, preference, random));
    let first = draws.find_map(|drawn| drawn)?;
    if first.target.is_none_or(|target| !target.fixed) {
        return Some(first);
    }
    let mut seen = Seen::default();
    let mut best = seen.lead_to(view, &first, f64::INFINITY);
    if !view.is_improving() {
        for next in draws.flatten() {
            let limit = best.map_or(f64::INFINITY, |(lead, _)| lead.left);
            best = seen.lead_to(view, &next, limit).or(best);
        }
    }
    let Some((lead, target)) = best else {
        return Some(first);
    };
    leads::tire(view, lead, target);
    Some(Destination {
        closest: lead.node,
        target: Some(target),
    })
}

/// What was drawn so far: from which states, to where.
#[derive(Default)]
struct Seen(SmallVec<[(StateId, Target); DRAWN]>);

impl Seen {
    /// The node to go on from to a fixed destination that is new, if less than `limit` is left from there.
    fn lead_to(
        &mut self,
        view: &View<'_>,
        next: &Destination,
        limit: f64,
    ) -> Option<(Lead, Target)> {
        let target = next.target.filter(|target| target.fixed)?;
        let state = view.tree.state(next.closest);
        let same = |known: &(StateId, Target)| {
            known.0 == state && known.1.at == target.at && known.1.step == target.step
        };
        if self.0.iter().any(same) {
            return None;
        }
        self.0.push((state, target));
        Some((leads::best(view, state, target, limit)?, target))
    }
}
