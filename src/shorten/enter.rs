//! Where a suffix is entered: at whichever of its points makes prefix and suffix cost least together.

use nalgebra::Point2;

use super::Shortener;
use super::chain::{Chain, MIN_WEIGHT, length};
use super::pull::star_point;

/// How many places are tried, the best first.
const TRIES: usize = 5;

/// A place at which the prefix could meet the suffix.
struct Meeting {
    cost: f64,
    /// The prefix leaves its old way after this point.
    from: usize,
    /// The leg of the suffix, by the number of its first point.
    leg: usize,
    at: Point2<f64>,
}

impl Shortener<'_> {
    /// Enters the suffix elsewhere if that is cheaper: in the middle of any of its legs, straight from any
    /// point of the prefix. Whether the suffix still does what the task wants is for the automaton to say,
    /// which must have a run along the new path.
    pub(super) fn enter(&self, chain: &mut Chain) -> bool {
        if chain.stays {
            return false;
        }
        let (before, after) = self.shares();
        let prefix = &chain.points[..=chain.split];
        let round = self.round(chain);
        let mut closed = round.clone();
        closed.push(round[0]);
        let whole = length(&closed);
        // Where the suffix bends for the sake of the entry alone, it need not any more.
        let old = &chain.points[chain.split..];
        let now =
            before * length(prefix) + after * (length(old) + (old[0] - old[old.len() - 1]).norm());
        let mut found: Vec<Meeting> = Vec::new();
        let mut walked = 0.0;
        for (from, &p) in prefix.iter().enumerate() {
            if from > 0 {
                walked += (p - prefix[from - 1]).norm();
            }
            for (leg, ends) in closed.windows(2).enumerate() {
                let [u, w] = [ends[0], ends[1]];
                let (pu, pw, uw) = ((u - p).norm(), (w - p).norm(), (w - u).norm());
                let least = before * (walked + (pu + pw - uw) / 2.0) + after * whole;
                if before <= 0.6 && least >= now - self.min_gain {
                    continue;
                }
                let at = star_point([p, u, w], [before, after, after]);
                let cost = before * (walked + (at - p).norm())
                    + after * (whole - uw + (u - at).norm() + (w - at).norm());
                if cost < now - self.min_gain {
                    found.push(Meeting {
                        cost,
                        from,
                        leg,
                        at,
                    });
                }
            }
        }
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        for meeting in found.iter().take(TRIES) {
            let new = joined(prefix, &round, meeting);
            if self.is_free_chain(&new, meeting) && self.realise(&new).is_some() {
                *chain = new;
                return true;
            }
        }
        false
    }

    /// What a unit of prefix and of suffix cost, neither of them nothing.
    fn shares(&self) -> (f64, f64) {
        (
            self.weight.max(MIN_WEIGHT),
            (1.0 - self.weight).max(MIN_WEIGHT),
        )
    }

    /// The points of the suffix, without the one where it is entered if it need not pass there.
    fn round(&self, chain: &Chain) -> Vec<Point2<f64>> {
        let round = chain.points[chain.split..].to_vec();
        let last = round.len() - 1;
        if last >= 2 {
            let through = self.word(&[round[last], round[0], round[1]]);
            if through.is_some() && through == self.word(&[round[last], round[1]]) {
                return round[1..].to_vec();
            }
        }
        round
    }

    /// Whether the legs to the meeting are free.
    fn is_free_chain(&self, chain: &Chain, meeting: &Meeting) -> bool {
        let points = &chain.points;
        let after = points.get(chain.split + 1).copied();
        let last = points[points.len() - 1];
        let free = |p| self.map.is_free_segment(p, meeting.at);
        let inward = chain.split == 0 || free(points[chain.split - 1]);
        inward && after.is_none_or(free) && free(last)
    }
}

/// The prefix as far as it is kept, then the suffix from the meeting on.
fn joined(prefix: &[Point2<f64>], round: &[Point2<f64>], meeting: &Meeting) -> Chain {
    let mut points = prefix[..=meeting.from].to_vec();
    if points[meeting.from] != meeting.at {
        points.push(meeting.at);
    }
    let split = points.len() - 1;
    let count = round.len();
    points.extend((1..=count).map(|k| round[(meeting.leg + k) % count]));
    // The ends of the leg may be the meeting itself.
    if points.get(split + 1) == Some(&meeting.at) {
        points.remove(split + 1);
    }
    while points.len() > split + 1 && points.last() == Some(&meeting.at) {
        points.pop();
    }
    Chain {
        stays: false,
        points,
        split,
    }
}
