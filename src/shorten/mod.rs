//! Shortening of plans: string pulling around corners, and sliding along the borders of regions.
//!
//! A plan's path is taken as a chain of points. Each inner point is in turn replaced by the taut string
//! past it (straight, or around the corners in the way), or slid along a border at hand to where the
//! weighted length is least, as long as the letters that the path meets stay the same in the eyes of
//! the automaton: up to stuttering, and up to letters that no guard tells apart. The point where the
//! suffix is entered moves to where its three legs balance, or to another leg of the suffix. What comes
//! out is a local optimum for the order of visits and the way around obstacles that the given plan chose.
//! Other entries, ways and orders are tried apart from that, as they take longer: by
//! `enter_around`, `go_around` and `reorder`, with shortest ways that the planner knows. The result's run is found anew.
//!
//! Planners that share nothing else use this: it sees a path and makes it shorter.

mod around;
mod chain;
mod earlier;
mod enter;
mod follow;
mod pull;
mod reorder;
mod shift;
mod word;

use std::cell::RefCell;

use nalgebra::{Point2, Vector2};
use smallvec::SmallVec;

use crate::alphabet::{Letter, LetterSet, Props};
use crate::automaton::Task;
use crate::plan::{Cost, Path};
use crate::workspace::{Polygon, Workspace};

pub(crate) use chain::Chain;
use chain::Neighbours;
use enter::Walk;
pub(crate) use pull::star_point;
pub(crate) use reorder::orders;
use word::KnownWords;
pub(crate) use word::word_of;

/// How far from a border a visit's waypoint comes to lie, as a share of the map's longer side: a
/// thousand times what borders are resolved to.
const INSET: f64 = 1e-6;

/// An improvement below this share of the map's longer side is not worth a move.
const MIN_GAIN: f64 = 1e-7;

/// Passes over the points of a plan that is shortened, at most, where nothing else is asked for.
pub(crate) const SWEEPS: usize = 12;

/// So often a plan is made another one at most; each is cheaper than the one before.
const ROUNDS: usize = 8;

/// Where time is left for it, orders of visits are tried that are longer than a plan by so much: what is shorter once it is taut
/// may be longer as long as visits lie where the old order wanted them.
pub(crate) const SLACK: f64 = 1.1;

/// What shortening must know of a mission.
#[derive(Clone, Debug)]
pub struct Shortener<'a> {
    map: &'a Workspace,
    task: &'a Task,
    /// The prefix's share λ of the cost.
    weight: f64,
    /// For each letter the number of its class (see [`letter_classes`]).
    classes: Vec<u16>,
    /// The letters that some guard admits: no plan passes through others.
    passable: LetterSet,
    /// The regions that the task speaks of.
    regions: Vec<&'a Polygon>,
    /// Convex corners of obstacles.
    corners: Vec<Point2<f64>>,
    /// The same, and points just outside the convex corners of regions, for going round these.
    all_corners: Vec<Point2<f64>>,
    inset: f64,
    min_gain: f64,
    words: RefCell<KnownWords>,
    /// Places where nothing could be gained: nothing can be as long as the neighbours stay. A buffer.
    still: RefCell<Vec<(Point2<f64>, Neighbours)>>,
}

impl<'a> Shortener<'a> {
    /// Prepares to shorten plans of one mission.
    #[must_use]
    pub fn new(map: &'a Workspace, task: &'a Task, weight: f64) -> Self {
        Self::with_inset(map, task, weight, INSET)
    }

    /// The same, with waypoints that keep this far from the borders of regions, as a share of the map's
    /// longer side: plans that will be rounded need more than those that will not.
    #[must_use]
    pub fn with_inset(map: &'a Workspace, task: &'a Task, weight: f64, inset: f64) -> Self {
        let side = map.bounds().side();
        let inset = inset.max(INSET) * side;
        let used = used_regions(map, task).iter();
        let regions: Vec<&Polygon> = used.map(|i| &map.regions()[i].polygon).collect();
        let convex = |polygon: &'a Polygon| {
            let v = polygon.vertices();
            let n = v.len();
            let turns = move |i: usize| {
                let (before, at, after) = (v[(i + n - 1) % n], v[i], v[(i + 1) % n]);
                let outward = -(inward_normal(before, at) + inward_normal(at, after));
                let convex = (at - before).perp(&(after - at)) > 0.0;
                convex.then_some((at, outward))
            };
            (0..n).filter_map(turns)
        };
        let inside = |p: &Point2<f64>| map.bounds().contains(*p);
        let corners: Vec<Point2<f64>> = map
            .obstacles()
            .iter()
            .flat_map(convex)
            .map(|(at, _)| at)
            .filter(inside)
            .collect();
        let around = regions.iter().copied().flat_map(convex);
        let around = around.map(|(at, outward)| {
            // Between the normals of two edges, so that both borders are the inset away.
            at + outward * (2.0 * inset / outward.norm_squared().max(0.05))
        });
        let all_corners = corners
            .iter()
            .copied()
            .chain(around.filter(inside))
            .collect();
        Self {
            map,
            task,
            weight,
            classes: letter_classes(task),
            passable: passable(task),
            regions,
            corners,
            all_corners,
            inset,
            min_gain: MIN_GAIN * side,
            words: RefCell::default(),
            still: RefCell::default(),
        }
    }

    /// The plan made shorter, in at most `sweeps` passes over its points; `None` if the path is not one
    /// of this mission. A plan that cannot be made shorter comes back as good as it was.
    #[must_use]
    pub fn shorten(&self, path: &Path, sweeps: usize) -> Option<(Path, Cost)> {
        let mut chain = Chain::of_path(path);
        self.improve(&mut chain, sweeps);
        self.realise(&chain)
            .filter(|(path, _)| self.is_firm_path(path))
    }

    /// How many corners of obstacles ways can bend at.
    pub(crate) fn corner_count(&self) -> usize {
        self.corners.len()
    }

    /// The letters that some guard of the automaton admits: no plan passes through others.
    pub(crate) fn passable(&self) -> &LetterSet {
        &self.passable
    }

    /// Plans near this one that no pull and no slide leads to, cheaper or not: entered elsewhere, around other sides of
    /// obstacles, with visits in another order, and with a suffix that does what the prefix did. The ways that `walk` gives may
    /// touch what they lead around. Orders are tried that are longer by `slack` times before they are pulled taut.
    pub(crate) fn others(
        &self,
        path: &Path,
        walk: Walk<'_>,
        slack: f64,
    ) -> impl Iterator<Item = (Path, Cost)> {
        let walk = |from, to| self.keep_off(from, walk(from, to));
        let walk: Walk<'_> = &walk;
        let entered = self.enter_around(path, walk);
        let earlier = self.begin_earlier(path, walk);
        let around = self.go_around(path, walk);
        let reordered = self.reorder(path, walk, slack);
        [entered, earlier, around, reordered].into_iter().flatten()
    }

    /// The plan, or a cheaper one that [`Self::others`] lead to, one after another, for as long as it is not time to end.
    pub(crate) fn look_around(
        &self,
        plan: (Path, Cost),
        walk: Walk<'_>,
        is_due: impl Fn() -> bool,
    ) -> (Path, Cost) {
        let mut best = plan;
        for _ in 0..ROUNDS {
            if is_due() {
                break;
            }
            let found = self.others(&best.0, walk, SLACK);
            match found.min_by(|a, b| a.1.total.total_cmp(&b.1.total)) {
                Some(other) if other.1.total < best.1.total => best = other,
                _ => break,
            }
        }
        best
    }

    /// A way with those of its bends that touch the border of a region moved off it.
    fn keep_off(&self, from: Point2<f64>, mut way: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
        let mut before = from;
        for i in 1..way.len() {
            let (at, after) = (way[i - 1], way[i]);
            if !self.is_firm(at) {
                // What the way bends around lies between its legs.
                let inward = (before - at).normalize() + (after - at).normalize();
                let away = at - inward.normalize() * (2.0 * self.inset);
                if self.is_firm(away) {
                    way[i - 1] = away;
                }
            }
            before = at;
        }
        way
    }

    /// Whether the letters met along the path are those of its waypoints: a stretch so short that it
    /// could count or not must not decide whether a region was visited.
    pub(crate) fn is_firm_path(&self, path: &Path) -> bool {
        [&path.prefix, &path.suffix].into_iter().all(|part| {
            let class = |letter: Letter| self.classes[letter.index()];
            let letters = part.iter().filter_map(|w| self.map.letter_at(w.at));
            let mut said: SmallVec<[u16; 32]> = letters.map(class).collect();
            let mut seen: SmallVec<[u16; 32]> = SmallVec::new();
            for w in part.windows(2) {
                let ends = [w[0].at, w[1].at].map(|at| (at, self.map.locate(at)));
                match self.map.trace_located(ends) {
                    Ok(_) if w[0].at == w[1].at => {}
                    Ok(stretches) => seen.extend(stretches.iter().map(|s| class(s.letter))),
                    Err(_) => return false,
                }
            }
            said.dedup();
            seen.dedup();
            seen.is_empty() || seen == said
        })
    }
}

/// The unit normal of a counter-clockwise border's edge that points inwards.
pub(crate) fn inward_normal(a: Point2<f64>, b: Point2<f64>) -> Vector2<f64> {
    let d = b - a;
    Vector2::new(-d.y, d.x) / d.norm()
}

/// The regions that a task speaks of: those its formula names, all if it has none.
pub(crate) fn used_regions(workspace: &Workspace, task: &Task) -> Props {
    let Some(formula) = &task.formula else {
        return (0..workspace.regions().len()).fold(Props::EMPTY, Props::with);
    };
    let names = formula.propositions();
    let regions = names
        .iter()
        .filter_map(|name| workspace.alphabet().proposition(name));
    regions.fold(Props::EMPTY, Props::with)
}

/// The letters that are in some guard.
fn passable(task: &Task) -> LetterSet {
    let mut all = task.nba.alphabet.none();
    let guards = task.nba.transitions.iter().flatten();
    guards.for_each(|t| all.union_with(&t.guard));
    all
}

/// For each letter the number of its class: letters of one class are in the same guards, so
/// the automaton cannot tell them apart.
pub(crate) fn letter_classes(task: &Task) -> Vec<u16> {
    let guards: Vec<&LetterSet> = {
        let all = task.nba.transitions.iter().flatten();
        let mut all: Vec<&LetterSet> = all.map(|t| &t.guard).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let mut classes: Vec<Vec<bool>> = Vec::new();
    let class = |letter: Letter| {
        let signature: Vec<bool> = guards.iter().map(|g| g.contains(letter)).collect();
        let known = classes.iter().position(|c| *c == signature);
        known.unwrap_or_else(|| {
            classes.push(signature);
            classes.len() - 1
        }) as u16
    };
    task.nba.alphabet.letters().map(class).collect()
}

#[cfg(test)]
mod tests;
