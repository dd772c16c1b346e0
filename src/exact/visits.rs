//! What every plan costs at least that the checker accepts, wherever its loop begins.
//!
//! The [bound of the product](super::bound) is one of plans whose suffix comes back to its place and its automaton state.
//! A loop may close sooner: its word, repeated for ever, satisfies the task though no run of the automaton closes there.
//! What holds for all loops follows from the language alone:
//!
//! - Some places, regions or what two of them have in common, are in every accepted word, some in every loop (*recurring*: no
//!   accepted word leaves them out from some moment on), and some never come before others.
//! - Prefix and suffix together are a path from the start that visits these places in an order that is allowed: P + S ≥ T.
//! - The suffix is a closed way by all that recur: S ≥ S₀.
//! - The prefix, the suffix and the prefix back again are a closed way from the start by all of them: 2P + S ≥ C.
//!
//! The least λP + (1 − λ)S under these is the bound. T, S₀ and C are tours of pieces of the places' borders, by dynamic programming over
//! sets of regions (M. Held, R. M. Karp, "A dynamic programming approach to sequencing problems", 1962), with what legs between
//! pieces are at least (proof: [`bound`](super::bound)).

mod duties;
mod pieces;

use nalgebra::Point2;

use super::{Halt, RESOLUTION};
use crate::automaton::Task;
use crate::workspace::Workspace;
use duties::{Duty, duties};
use pieces::Pieces;

/// What every plan costs at least that satisfies the task, whether or not it is one of the product with the automaton; `weight` is the
/// prefix's share λ of the cost. `None` if the work was ended before that was known.
#[must_use]
pub fn least_cost(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    halt: Halt<'_>,
) -> Option<f64> {
    let duties = duties(workspace, task);
    let pieces = Pieces::new(workspace, start, &duties, task, halt)?;
    let [path, closed, round] = [
        pieces.path(&duties, false),
        pieces.path(&duties, true),
        pieces.round(&duties),
    ];
    let cost = |prefix: f64| {
        let suffix = round.max(path - prefix).max(closed - 2.0 * prefix);
        weight * prefix + (1.0 - weight) * suffix
    };
    // Convex in the prefix, and straight between these.
    let turns = [0.0, path - round, (closed - round) / 2.0, closed - path];
    let least = turns.into_iter().filter(|p| *p >= 0.0).map(cost);
    let least = least.fold(f64::INFINITY, f64::min);
    Some((least - RESOLUTION * workspace.bounds().side()).max(0.0))
}

impl Pieces {
    /// The least length of a path from the start by all places, `closed` with the way back.
    fn path(&self, duties: &[Duty], closed: bool) -> f64 {
        let full = (1_u32 << duties.len()) - 1;
        if self.at_start == full {
            return 0.0;
        }
        let may_come = |region: usize, seen: u32| duties[region].before & !seen == 0;
        let begin = |piece: usize| {
            let new = self.at_start >> self.all[piece].duty & 1 == 0;
            let comes = may_come(self.all[piece].duty, self.at_start);
            (new && comes).then_some(self.from_start[piece])
        };
        let ends = self.tours(self.at_start, full, begin, may_come);
        let back = |piece: usize| if closed { self.from_start[piece] } else { 0.0 };
        let whole = ends
            .iter()
            .enumerate()
            .map(|(piece, way)| way + back(piece));
        let least = whole.fold(f64::INFINITY, f64::min);
        // No order is allowed if the task is impossible, which others find out.
        if least.is_finite() { least } else { 0.0 }
    }

    /// The least length of a closed way by all places that recur: of those that others touch none, as it may lie within one.
    fn round(&self, duties: &[Duty]) -> f64 {
        let counts = |&i: &usize| duties[i].recurring && self.apart[i];
        let set = (0..duties.len())
            .filter(counts)
            .fold(0, |set, i| set | 1 << i);
        let first = u32::trailing_zeros(set) as usize;
        if u32::count_ones(set) < 2 {
            return 0.0;
        }
        let begins = (0..self.all.len()).filter(|&p| self.all[p].duty == first);
        let whole = begins.flat_map(|home| {
            let begin = |piece| (piece == home).then_some(0.0);
            let ends = self.tours(0, set, begin, |region, seen| seen != 0 || region == first);
            let back = move |(piece, way)| way + self.between[piece * self.all.len() + home];
            ends.into_iter().enumerate().map(back)
        });
        whole.fold(f64::INFINITY, f64::min)
    }

    /// The least lengths of ways by the places of a set, those of `seen` left out, to each piece that the last one can be met at.
    fn tours(
        &self,
        seen: u32,
        set: u32,
        begin: impl Fn(usize) -> Option<f64>,
        may_come: impl Fn(usize, u32) -> bool,
    ) -> Vec<f64> {
        let count = self.all.len();
        let mut ways = vec![f64::INFINITY; (set as usize + 1) * count];
        for piece in 0..count {
            let after = (seen | 1 << self.all[piece].duty) as usize;
            if let Some(way) = begin(piece).filter(|_| after & !(set as usize) == 0) {
                ways[after * count + piece] = way;
            }
        }
        for now in 0..=set as usize {
            for piece in 0..count {
                let way = ways[now * count + piece];
                if !way.is_finite() {
                    continue;
                }
                for next in 0..count {
                    let region = self.all[next].duty;
                    let new = set >> region & 1 == 1 && now >> region & 1 == 0;
                    if new && may_come(region, now as u32) {
                        let to = &mut ways[(now | 1 << region) * count + next];
                        *to = to.min(way + self.between[piece * count + next]);
                    }
                }
            }
        }
        ways.split_off(set as usize * count)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::automaton::Limits;
    use crate::ltl::Formula;
    use crate::workspace::{Bounds, Polygon, Region};

    /// Regions a to d, apart from one another.
    fn map() -> Workspace {
        let region = |k: usize| {
            let corner = Point2::new(0.1 + 0.2 * k as f64, 0.4);
            Region {
                name: ["a", "b", "c", "d"][k].to_owned(),
                polygon: Polygon::rectangle(corner, corner + nalgebra::Vector2::repeat(0.1))
                    .unwrap(),
            }
        };
        Workspace::new(Bounds::unit(), Vec::new(), (0..4).map(region).collect()).unwrap()
    }

    /// The regions of each duty as bits, whether it recurs, and what comes before it.
    fn told(map: &Workspace, text: &str) -> Vec<(u64, bool, u32)> {
        let formula: Formula = text.parse().unwrap();
        let alphabet = Arc::clone(map.alphabet());
        let task = Task::from_formula(&formula, alphabet, &Limits::default()).unwrap();
        let duties = duties(map, &task);
        duties
            .iter()
            .map(|d| (d.regions.0, d.recurring, d.before))
            .collect()
    }

    #[test]
    fn duties_are_read_off_the_language() {
        let map = map();
        for (text, expected) in [
            ("F a", vec![(1, false, 0)]),
            ("F a | F b", vec![]),
            ("G F a & F b", vec![(1, true, 0), (2, false, 0)]),
            ("F b & (!b U a)", vec![(1, false, 0), (2, false, 1)]),
            (
                "F (a & F (b & F c))",
                vec![(1, false, 0), (2, false, 0), (4, false, 0)],
            ),
            ("G F (a & F b) & (!b U a)", vec![(1, true, 0), (2, true, 1)]),
            ("F G a", vec![(1, true, 0)]),
            (
                "G (a -> F b) & F a & G !c",
                vec![(1, false, 0), (2, false, 0)],
            ),
        ] {
            assert_eq!(told(&map, text), expected, "{text}");
        }
    }

    /// What two regions have in common is a place of its own.
    #[test]
    fn overlaps_are_asked_for() {
        let region = |name: &str, left: f64| Region {
            name: name.to_owned(),
            polygon: Polygon::rectangle(Point2::new(left, 0.4), Point2::new(left + 0.3, 0.6))
                .unwrap(),
        };
        let regions = vec![region("a", 0.2), region("b", 0.4), region("c", 0.8)];
        let bounds = Bounds {
            min: Point2::origin(),
            max: Point2::new(1.2, 1.0),
        };
        let map = Workspace::new(bounds, Vec::new(), regions).unwrap();
        assert_eq!(told(&map, "F (a & b)"), [(3, false, 0)]);
        assert_eq!(
            told(&map, "F (a & b) & G F a"),
            [(1, true, 0), (3, false, 1)]
        );
        // From the left to the overlap's near border, and on to c.
        let formula: Formula = "F (a & b) & F c".parse().unwrap();
        let alphabet = Arc::clone(map.alphabet());
        let task = Task::from_formula(&formula, alphabet, &Limits::default()).unwrap();
        let least = least_cost(&map, Point2::new(0.1, 0.5), &task, 1.0, Halt::NEVER);
        assert_eq!(least, Some(0.0), "the prefix alone counts, and may be none");
        let least = least_cost(&map, Point2::new(0.1, 0.5), &task, 0.4, Halt::NEVER).unwrap();
        assert!(least <= 0.4 * 0.7 && least > 0.98 * 0.4 * 0.7, "{least}");
    }
}
