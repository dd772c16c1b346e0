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

use std::cell::OnceCell;
use std::sync::Arc;

use nalgebra::Point2;

use super::Halt;
use super::bound::{RESOLUTION, are_apart, segment_distance};
use crate::alphabet::{LetterSet, Props};
use crate::automaton::{Nba, Task};
use crate::shorten::used_regions;
use crate::workspace::visibility::{PathsTo, VisibilityGraph};
use crate::workspace::{Polygon, Side, Workspace};

/// So many places count at most: the work doubles with each.
const MOST_DUTIES: usize = 10;

/// Into about so many pieces borders are cut.
const PIECES: f64 = 72.0;

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

/// A place that the language asks for: a region, or what two regions have in common.
#[derive(Debug, PartialEq)]
struct Duty {
    regions: Props,
    /// Whether every loop holds it.
    recurring: bool,
    /// The duties that are never seen for the first time after this one, as bits.
    before: u32,
}

/// What the language asks for.
fn duties(workspace: &Workspace, task: &Task) -> Vec<Duty> {
    let nba = &task.nba;
    let alphabet = workspace.alphabet();
    let all = alphabet.all();
    let within = |place: Props| alphabet.filter(|props| place.0 & !props.0 == 0);
    let without = |place: Props| within(place).complement();
    let used: Vec<usize> = used_regions(workspace, task).iter().collect();
    let pairs = used.iter().enumerate().flat_map(|(k, &r)| {
        let others = used[k + 1..].iter();
        others.map(move |&s| Props::single(r).with(s))
    });
    let meeting = pairs.filter(|&pair| !within(pair).is_empty());
    let singles = used.iter().map(|&r| Props::single(r));
    let needed = meeting
        .chain(singles)
        .filter(|&place| !accepts(nba, &without(place), &without(place)))
        .map(|place| (!accepts(nba, &all, &without(place)), place));
    let mut needed: Vec<(bool, Props)> = needed.collect();
    // A pair says all that its regions do, unless these recur and it does not.
    let told = |&(recurring, place): &(bool, Props)| {
        let holds = |other: &(bool, Props)| place != other.1 && place.0 & !other.1.0 == 0;
        needed
            .iter()
            .any(|other| holds(other) && other.0 >= recurring)
    };
    let told: Vec<bool> = needed.iter().map(told).collect();
    let mut told = told.iter();
    needed.retain(|_| told.next() == Some(&false));
    // Where there are too many, those that cost the most.
    needed.sort_by_key(|&(recurring, place)| (!recurring, place.0));
    needed.truncate(MOST_DUTIES);
    let comes_first = |first: Props, then: Props| {
        let early = reached(nba, &without(first));
        let mut too_early = within(then);
        too_early.subtract(&within(first));
        let steps = nba.transitions.iter().zip(&early);
        let mut steps = steps.filter(|(_, early)| **early).flat_map(|(t, _)| t);
        first != then && steps.all(|t| t.guard.is_disjoint(&too_early))
    };
    let duty = |&(recurring, regions): &(bool, Props)| Duty {
        regions,
        recurring,
        before: (0..needed.len())
            .filter(|&i| comes_first(needed[i].1, regions))
            .fold(0, |set, i| set | 1 << i),
    };
    needed.iter().map(duty).collect()
}

/// The states that words over some letters lead to.
fn reached(nba: &Nba, letters: &LetterSet) -> Vec<bool> {
    let mut seen = vec![false; nba.len()];
    let mut open: Vec<usize> = nba.initial.iter().map(|q| q.index()).collect();
    while let Some(q) = open.pop() {
        if !std::mem::replace(&mut seen[q], true) {
            open.extend(steps(nba, q, letters));
        }
    }
    seen
}

fn steps<'n>(nba: &'n Nba, q: usize, letters: &'n LetterSet) -> impl Iterator<Item = usize> + 'n {
    let taken = nba.transitions[q].iter();
    taken
        .filter(|t| !t.guard.is_disjoint(letters))
        .map(|t| t.target.index())
}

/// Whether the automaton accepts a word that holds some letters alone, and from some moment on others alone.
fn accepts(nba: &Nba, ever: &LetterSet, at_last: &LetterSet) -> bool {
    let reached = reached(nba, ever);
    let accepting = nba.states().filter(|&q| nba.is_accepting(q));
    accepting
        .map(|q| q.index())
        .filter(|&q| reached[q])
        .any(|goal| {
            let mut seen = vec![false; nba.len()];
            let mut open: Vec<usize> = steps(nba, goal, at_last).collect();
            while let Some(q) = open.pop() {
                if q == goal {
                    return true;
                }
                if !std::mem::replace(&mut seen[q], true) {
                    open.extend(steps(nba, q, at_last));
                }
            }
            false
        })
}

/// A piece of the border of a place that is asked for, free of obstacles.
struct Piece {
    ends: Ends,
    /// The number of the duty.
    duty: usize,
}

/// Pieces of borders, and what legs between them are at least.
struct Pieces {
    all: Vec<Piece>,
    /// Row by row.
    between: Vec<f64>,
    from_start: Vec<f64>,
    /// The duties that the start fulfils, as bits.
    at_start: u32,
    /// For each duty, whether its place is apart from all others.
    apart: Vec<bool>,
}

impl Pieces {
    fn new(
        map: &Workspace,
        start: Point2<f64>,
        duties: &[Duty],
        task: &Task,
        halt: Halt<'_>,
    ) -> Option<Self> {
        let here = map.letter_at(start).map(|l| map.alphabet().props(l));
        let is_here = |d: &Duty| here.is_some_and(|props| d.regions.0 & !props.0 == 0);
        let bit = |(i, _): (usize, &Duty)| 1_u32 << i;
        let fulfilled = duties.iter().enumerate().filter(|(_, d)| is_here(d));
        let at_start = fulfilled.map(bit).fold(0, |set, bit| set | bit);
        let is_apart = |d: &Duty| {
            let mut others = duties.iter().filter(|other| *other != d);
            others.all(|other| are_duties_apart(map, d, other))
        };
        let mut pieces = Self {
            all: cut(map, duties),
            between: Vec::new(),
            from_start: Vec::new(),
            at_start,
            apart: duties.iter().map(is_apart).collect(),
        };
        let space = space(map, start, task);
        let count = pieces.all.len();
        pieces.between = vec![0.0; count * count];
        for i in 0..count {
            if halt.is_due() {
                return None;
            }
            let legs = Legs::new(space.as_ref(), pieces.all[i].ends);
            for j in 0..i {
                let least = legs.from(pieces.all[j].ends);
                (pieces.between[i * count + j], pieces.between[j * count + i]) = (least, least);
            }
            pieces.from_start.push(legs.from((start, start)));
        }
        Some(pieces)
    }

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

/// The map with the regions that no accepted word holds as obstacles, as far as they are apart from all else.
fn space(map: &Workspace, start: Point2<f64>, task: &Task) -> Option<VisibilityGraph> {
    let passable = {
        let mut all = map.alphabet().none();
        let guards = task.nba.transitions.iter().flatten();
        guards.for_each(|t| all.union_with(&t.guard));
        all
    };
    let margin = 16.0 * map.tolerance();
    let is_forbidden = |r: usize| passable.is_disjoint(&map.alphabet().letters_with(r));
    let is_apart = |r: usize| {
        let mine = &map.regions()[r].polygon;
        let others = map.regions().iter().enumerate().filter(|(i, _)| *i != r);
        let mut others = others
            .map(|(_, region)| &region.polygon)
            .chain(map.obstacles());
        others.all(|other| are_apart(mine, other, margin))
    };
    let forbidden = (0..map.regions().len()).filter(|&r| is_forbidden(r) && is_apart(r));
    let mut obstacles = map.obstacles().to_vec();
    obstacles.extend(forbidden.map(|r| map.regions()[r].polygon.clone()));
    let space = Workspace::new(map.bounds(), obstacles, Vec::new()).ok()?;
    space.letter_at(start)?;
    Some(VisibilityGraph::new(Arc::new(space)))
}

type Ends = (Point2<f64>, Point2<f64>);

/// Whether no place can fulfil two duties, or touch two such places.
fn are_duties_apart(map: &Workspace, first: &Duty, second: &Duty) -> bool {
    let margin = 16.0 * map.tolerance();
    let polygon = |r: usize| &map.regions()[r].polygon;
    let mut pairs = first
        .regions
        .iter()
        .flat_map(|r| second.regions.iter().map(move |s| (r, s)));
    pairs.any(|(r, s)| r != s && are_apart(polygon(r), polygon(s), margin))
}

/// The borders of the duties' places in pieces that no obstacle covers part of.
fn cut(map: &Workspace, duties: &[Duty]) -> Vec<Piece> {
    let margin = 4.0 * map.tolerance();
    let polygon = |r: usize| &map.regions()[r].polygon;
    let free = |p: Point2<f64>| map.letter_at(p).is_some();
    let mut whole: Vec<Piece> = Vec::new();
    for (duty, Duty { regions, .. }) in duties.iter().enumerate() {
        for r in regions.iter() {
            let other = regions.iter().find(|&s| s != r).map(polygon);
            let inside = |p| other.is_none_or(|o| o.side_of(p, margin) != Side::Outside);
            for (a, b) in polygon(r).edges() {
                let at = |t: f64| a + (b - a) * t;
                let turns = crossings(map, (a, b), other);
                let parts = turns.windows(2).map(|t| (at(t[0]), at(t[1])));
                let open = parts.filter(|&part| free(middle(part)) && inside(middle(part)));
                whole.extend(open.map(|ends| Piece { ends, duty }));
            }
        }
    }
    let length = |p: &Piece| (p.ends.1 - p.ends.0).norm();
    let sum: f64 = whole.iter().map(length).sum();
    let pieces = |p: &Piece| {
        let count = (PIECES * length(p) / sum).ceil().max(1.0);
        let (a, b) = p.ends;
        let at = move |k: f64| a + (b - a) * (k / count);
        let duty = p.duty;
        (0..count as usize).map(move |k| Piece {
            ends: (at(k as f64), at((k + 1) as f64)),
            duty,
        })
    };
    whole.iter().flat_map(pieces).collect()
}

/// Where an edge meets the borders of obstacles, of the bounds, and of another polygon: ascending, from 0 to 1.
fn crossings(map: &Workspace, (a, b): Ends, other: Option<&Polygon>) -> Vec<f64> {
    let (min, max) = (a.inf(&b), a.sup(&b));
    let meets = |p: &&Polygon| {
        p.min().x <= max.x && p.min().y <= max.y && p.max().x >= min.x && p.max().y >= min.y
    };
    let bounds = map.bounds();
    let frame = Polygon::rectangle(bounds.min, bounds.max).ok();
    let near = map
        .obstacles()
        .iter()
        .chain(other)
        .chain(&frame)
        .filter(meets);
    let along = b - a;
    let square = along.norm_squared();
    let mut found = vec![0.0, 1.0];
    for (c, d) in near.flat_map(Polygon::edges) {
        let across = d - c;
        let turn = along.perp(&across);
        if turn != 0.0 {
            let (t, u) = ((c - a).perp(&across) / turn, (c - a).perp(&along) / turn);
            if (-1e-9..=1.0 + 1e-9).contains(&u) {
                found.push(t);
            }
        } else {
            // Borders that run along each other begin and end somewhere.
            found.extend([c, d].map(|p| along.dot(&(p - a)) / square));
        }
    }
    found.retain(|t| (0.0..=1.0).contains(t));
    found.sort_by(f64::total_cmp);
    found.dedup_by(|b, a| *b - *a < 1e-9);
    found
}

fn middle((a, b): Ends) -> Point2<f64> {
    nalgebra::center(&a, &b)
}

/// What legs to a piece are at least.
struct Legs<'l> {
    /// `None` where straight lines are all that is known.
    space: Option<&'l VisibilityGraph>,
    piece: Ends,
    /// Ways around obstacles, made where they are asked for first.
    ways: OnceCell<PathsTo>,
}

impl<'l> Legs<'l> {
    fn new(space: Option<&'l VisibilityGraph>, piece: Ends) -> Self {
        Self {
            space,
            piece,
            ways: OnceCell::new(),
        }
    }

    fn from(&self, other: Ends) -> f64 {
        let straight = segment_distance(self.piece, other);
        let Some(space) = self.space else {
            return straight;
        };
        let (here, there) = (middle(self.piece), middle(other));
        if space.map().is_free_between(there, here) {
            return straight;
        }
        let ways = self.ways.get_or_init(|| space.paths_to(here));
        let around = ways
            .first_leg(space, there)
            .map_or(0.0, |(length, _)| length);
        let halves = ((self.piece.1 - self.piece.0).norm() + (other.1 - other.0).norm()) / 2.0;
        straight.max(around - halves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::Limits;
    use crate::ltl::Formula;
    use crate::workspace::{Bounds, Region};

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
