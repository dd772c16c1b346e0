//! Loops that begin as soon as the mission allows it (ours).
//!
//! Planners close a suffix where a place *and* an automaton state come back. Some walks can be told with less prefix: for
//! `GF(a & F b) & (!b U a)` the automaton makes the first round in states of its own, as `b` is forbidden before `a`, so all of
//! that round is prefix though it is walked like the others; and with `X` the first step often is. The checker evaluates the
//! formula on the word of a path and knows no states, so it tells where the loop may begin.

use nalgebra::Point2;

use crate::plan::{Path, Waypoint};
use crate::verify::Verified;

/// So many entries are tried at most, the cheapest first.
const ENTRIES: usize = 256;

/// An entry: the prefix up to a point of it, and from there straight to the loop.
struct Entry {
    total: f64,
    /// The number of the prefix's point.
    leave: usize,
    /// The number of the loop's point where the leg begins that is met.
    leg: usize,
    at: Point2<f64>,
}

/// The cheapest plan that enters the loop of `path` elsewhere and passes the `check`, if there is one that costs less.
///
/// Its suffix has the automaton states of `path`'s, which the run reaches after a round or more.
pub(super) fn fold(
    path: &Path,
    known: &Verified,
    weight: f64,
    check: impl Fn(&Path) -> Option<Verified>,
) -> Option<(Path, Verified)> {
    let cost = known.cost;
    if path.suffix.len() < 2 || weight <= 0.0 {
        return None;
    }
    let mut entries = Vec::new();
    let mut walked = 0.0;
    for (leave, from) in path.prefix.iter().enumerate() {
        if leave > 0 {
            walked += (from.at - path.prefix[leave - 1].at).norm();
        }
        for (leg, ends) in path.suffix.windows(2).enumerate() {
            for at in [Some(ends[0].at), nearest(from.at, ends)]
                .into_iter()
                .flatten()
            {
                let prefix = walked + (at - from.at).norm();
                let total = weight * prefix + (1.0 - weight) * cost.suffix;
                if total < cost.total - 1e-9 * cost.total.max(1.0) {
                    entries.push(Entry {
                        total,
                        leave,
                        leg,
                        at,
                    });
                }
            }
        }
    }
    entries.sort_by(|a, b| a.total.total_cmp(&b.total));
    entries.into_iter().take(ENTRIES).find_map(|entry| {
        let folded = entry.path(path);
        let verified = check(&folded)?;
        (verified.cost.total < cost.total).then_some((folded, verified))
    })
}

/// The point of a leg that is nearest to `p`, unless that is one of its ends.
fn nearest(p: Point2<f64>, ends: &[Waypoint]) -> Option<Point2<f64>> {
    let (a, along) = (ends[0].at, ends[1].at - ends[0].at);
    let share = (p - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
    let at = a + along * share;
    (share > 0.0 && share < 1.0 && at != a && at != ends[1].at).then_some(at)
}

impl Entry {
    /// The plan that enters here.
    fn path(&self, old: &Path) -> Path {
        let open = &old.suffix[..old.suffix.len() - 1];
        let mut suffix: Vec<Waypoint> = Vec::with_capacity(open.len() + 2);
        suffix.push(Waypoint {
            at: self.at,
            ..open[self.leg]
        });
        suffix.extend(&open[self.leg + 1..]);
        suffix.extend(&open[..=self.leg]);
        suffix.push(suffix[0]);
        suffix.dedup_by(|b, a| a.at == b.at && a.state == b.state);
        let mut prefix = old.prefix[..=self.leave].to_vec();
        if prefix[self.leave].at == self.at {
            prefix[self.leave].state = suffix[0].state;
        } else {
            prefix.push(suffix[0]);
        }
        Path { prefix, suffix }
    }
}
