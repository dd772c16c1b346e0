//! Where a suffix is entered: at whichever of its points makes prefix and suffix cost least together.

use nalgebra::Point2;

use super::chain::{Chain, MIN_WEIGHT, length};
use super::pull::star_point;
use super::{SWEEPS, Shortener};
use crate::plan::{Cost, Path};

/// How many places are tried, the best first.
const TRIES: usize = 5;

/// To how many places ways around obstacles are looked for, the best first.
const WALKED: usize = 4 * TRIES;

/// A place at which the prefix could meet the suffix.
struct Meeting {
    cost: f64,
    /// The prefix leaves its old way after this point.
    from: usize,
    /// Where the way from there bends.
    bends: Vec<Point2<f64>>,
    /// The leg of the suffix, by the number of its first point.
    leg: usize,
    at: Point2<f64>,
    /// Where the suffix bends on its way from the meeting to the leg's second point.
    out: Vec<Point2<f64>>,
    /// Where it bends on its way from the leg's first point back to the meeting.
    back: Vec<Point2<f64>>,
}

/// A way around obstacles: its bends and its end.
pub(super) type Walk<'w> = &'w dyn Fn(Point2<f64>, Point2<f64>) -> Vec<Point2<f64>>;

impl Shortener<'_> {
    /// Enters the suffix elsewhere if that is cheaper: in the middle of any of its legs, straight from any
    /// point of the prefix. Whether the suffix still does what the task wants is for the automaton to say,
    /// which must have a run along the new path.
    pub(super) fn enter(&self, chain: &mut Chain) -> bool {
        if chain.stays {
            return false;
        }
        let round = self.round(chain);
        let (found, _) = self.meetings(chain, &round);
        for meeting in found.iter().take(TRIES) {
            let new = joined(&chain.points[..=chain.split], &round, meeting);
            if self.is_free_chain(&new, meeting) && self.realise(&new).is_some() {
                *chain = new;
                return true;
            }
        }
        false
    }

    /// Enters a plan's suffix elsewhere if that is cheaper, where obstacles are in the way of every straight leg there:
    /// along the shortest way around them. Trees go on to where the automaton accepts, and so meet a suffix late in a
    /// part that the way to another point of it does not lead through.
    pub(crate) fn enter_around(&self, path: &Path, walk: Walk<'_>) -> Option<(Path, Cost)> {
        let chain = Chain::of_path(path);
        if chain.stays {
            return None;
        }
        let round = self.round(&chain);
        let (found, now) = self.meetings(&chain, &round);
        let found = found.into_iter().take(WALKED);
        let mut found: Vec<Meeting> = found
            .filter_map(|meeting| self.around(meeting, &chain, &round, walk))
            .filter(|m| m.cost < now - self.min_gain)
            .collect();
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        found.iter().take(TRIES).find_map(|meeting| {
            let mut new = joined(&chain.points[..=chain.split], &round, meeting);
            self.realise(&new)?;
            self.improve(&mut new, SWEEPS);
            self.realise(&new)
                .filter(|(path, _)| self.is_firm_path(path))
        })
    }

    /// A meeting with its legs around what is in their way; `None` if there is no way.
    fn around(
        &self,
        mut meeting: Meeting,
        chain: &Chain,
        round: &[Point2<f64>],
        walk: Walk<'_>,
    ) -> Option<Meeting> {
        let (before, after) = self.shares();
        let p = chain.points[meeting.from];
        let [u, w] = [meeting.leg, (meeting.leg + 1) % round.len()].map(|i| round[i]);
        let star = |at: Point2<f64>| {
            before * (at - p).norm() + after * ((at - u).norm() + (at - w).norm())
        };
        let straight = star(meeting.at);
        if self.map.letter_at(meeting.at).is_none() {
            // In the middle of an obstacle: at an end of the leg instead.
            meeting.at = if star(u) <= star(w) { u } else { w };
        }
        let mut cost = 0.0;
        let mut bends = |from: Point2<f64>, to: Point2<f64>, share: f64| {
            if from == to {
                return Some(Vec::new());
            }
            let mut way = vec![from];
            way.extend(walk(from, to));
            cost += share * length(&way);
            (way.len() > 1).then(|| way[1..way.len() - 1].to_vec())
        };
        meeting.bends = bends(p, meeting.at, before)?;
        meeting.out = bends(meeting.at, w, after)?;
        meeting.back = bends(u, meeting.at, after)?;
        meeting.cost += cost - straight;
        Some(meeting)
    }

    /// The places where a prefix could meet the suffix if nothing were in the way and that would be cheaper, the best
    /// first; and what prefix and suffix cost now.
    fn meetings(&self, chain: &Chain, round: &[Point2<f64>]) -> (Vec<Meeting>, f64) {
        let (before, after) = self.shares();
        let prefix = &chain.points[..=chain.split];
        let mut closed = round.to_vec();
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
                        bends: Vec::new(),
                        leg,
                        at,
                        out: Vec::new(),
                        back: Vec::new(),
                    });
                }
            }
        }
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        (found, now)
    }

    /// What a unit of prefix and of suffix cost, neither of them nothing.
    pub(super) fn shares(&self) -> (f64, f64) {
        (
            self.weight.max(MIN_WEIGHT),
            (1.0 - self.weight).max(MIN_WEIGHT),
        )
    }

    /// The points of the suffix, without the one where it is entered if it need not pass there.
    pub(super) fn round(&self, chain: &Chain) -> Vec<Point2<f64>> {
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
    points.extend_from_slice(&meeting.bends);
    if points.last() != Some(&meeting.at) {
        points.push(meeting.at);
    }
    let split = points.len() - 1;
    let count = round.len();
    points.extend_from_slice(&meeting.out);
    points.extend((1..=count).map(|k| round[(meeting.leg + k) % count]));
    // The ends of the leg may be the meeting itself.
    if points.get(split + 1) == Some(&meeting.at) {
        points.remove(split + 1);
    }
    while points.len() > split + 1 && points.last() == Some(&meeting.at) {
        points.pop();
    }
    points.extend_from_slice(&meeting.back);
    Chain {
        stays: false,
        points,
        split,
    }
}
