//! Which tree grows next, and what its paths may cost.

use nalgebra::Point2;
use rustc_hash::FxHashMap;

use super::{Best, Search};
use crate::alphabet::Letter;
use crate::automaton::StateId;
use crate::planner::suffix::SuffixTree;
use crate::planner::tree::NodeId;
use crate::system::TransitionSystem;

/// Another suffix tree is opened once the open ones have had so many iterations each, times their number: none of them can block
/// the others, and few are grown deep.
const SUFFIX_QUANTUM: u64 = 40;

/// Once a loop is known, others are looked for in more places: the number of trees counts from this one on.
const MANY_SUFFIXES: u64 = 32;

/// An accepting state, and the letter of a goal in it.
type Kind = (StateId, Letter);

/// Which tree an iteration goes to.
#[derive(Clone, Copy)]
pub(super) enum Turn {
    Prefix,
    Suffix(usize),
}

impl Search<'_> {
    /// Without a goal the prefix tree grows. With goals but no plan, seven of eight iterations
    /// look for ways back from the cheapest goals, in turn. With a plan, every second iteration goes to
    /// the prefix, the others to suffix trees that can still lead to a cheaper plan.
    pub(super) fn choose_turn(&mut self) -> Turn {
        if self.open_goals.is_empty() {
            return Turn::Prefix;
        }
        self.turn += 1;
        let prefix_turn = match self.best {
            None => self.turn.is_multiple_of(8),
            Some(_) => self.turn.is_multiple_of(2),
        };
        if prefix_turn {
            return Turn::Prefix;
        }
        self.choose_suffix().map_or(Turn::Prefix, Turn::Suffix)
    }

    fn choose_suffix(&mut self) -> Option<usize> {
        let trees = self.suffixes.len() as u64;
        let each = match self.best {
            None => SUFFIX_QUANTUM * trees,
            Some(_) => SUFFIX_QUANTUM * trees.max(MANY_SUFFIXES) / MANY_SUFFIXES,
        };
        let due = (each * trees).max(self.next_opening);
        if self.suffix_iterations >= due {
            if let Some(goal) = self.next_goal() {
                self.open_suffix(goal);
                return Some(self.suffixes.len() - 1);
            }
            // Looking through all goals takes time: not again at once.
            self.next_opening =
                self.suffix_iterations + SUFFIX_QUANTUM.max(self.open_goals.len() as u64);
        }
        // The tree of the best plan gets every second turn, the others share the rest.
        let best = self.best.as_ref().and_then(|b| self.suffix_of.get(&b.goal));
        if let Some(&i) = best
            && self.turn % 4 == 1
        {
            return Some(i);
        }
        let promising = |s: &SuffixTree<'_>| self.can_improve(self.prefix.cost(s.goal));
        (0..self.suffixes.len())
            .filter(|&i| promising(&self.suffixes[i]))
            .min_by_key(|&i| self.suffixes[i].iterations)
    }

    /// The goal to open the next suffix tree at, if any that has none could lead to a better plan than the best.
    /// Every second one is of a kind, accepting state and letter, that has the fewest trees: cycles through one of them
    /// may be long or impossible whatever the goal, and through another one short. And every
    /// fourth one is the furthest from those of its kind that were tried: where a cycle is short cannot be told
    /// from long ones.
    fn next_goal(&self) -> Option<NodeId> {
        let unopened = |g: &NodeId| !self.suffix_of.contains_key(g);
        let goals = self.open_goals.iter().copied().filter(unopened);
        let goals = goals.filter(|&g| self.can_improve(self.prefix.cost(g)));
        match self.suffixes.len() % 4 {
            0 => self.most_promising(goals, |_| 0),
            2 => self.furthest(goals),
            _ => {
                let mut trees: FxHashMap<Kind, usize> = FxHashMap::default();
                for suffix in &self.suffixes {
                    *trees.entry(self.kind(suffix.goal)).or_default() += 1;
                }
                self.most_promising(goals, |kind| trees.get(&kind).copied().unwrap_or(0))
            }
        }
    }

    fn kind(&self, goal: NodeId) -> Kind {
        (self.prefix.state(goal), self.prefix.spot(goal).letter)
    }

    /// Of the goals whose kinds have the fewest `trees` the one whose plan could be cheapest.
    fn most_promising(
        &self,
        goals: impl Iterator<Item = NodeId>,
        trees: impl Fn(Kind) -> usize,
    ) -> Option<NodeId> {
        let detour = self.detour();
        let cost = |g: NodeId| {
            let at = self.prefix.spot(g).at;
            self.prefix.cost(g) + detour.as_ref().map_or(0.0, |detour| detour.by(at))
        };
        goals
            .map(|g| (trees(self.kind(g)), cost(g), g))
            .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)))
            .map(|(_, _, g)| g)
    }

    /// The goal that is furthest from those of its kind that have trees.
    fn furthest(&self, goals: impl Iterator<Item = NodeId>) -> Option<NodeId> {
        let mut tried: FxHashMap<Kind, Vec<Point2<f64>>> = FxHashMap::default();
        for suffix in &self.suffixes {
            let at = self.prefix.spot(suffix.goal).at;
            tried.entry(self.kind(suffix.goal)).or_default().push(at);
        }
        let apart = |g: NodeId| {
            let at = self.prefix.spot(g).at;
            let tried = tried.get(&self.kind(g)).map_or(&[][..], Vec::as_slice);
            let distances = tried.iter().map(|&p| self.problem.system.distance(at, p));
            distances.fold(f64::INFINITY, f64::min)
        };
        goals
            .map(|g| (-apart(g), self.prefix.cost(g), g))
            .min_by(|a, b| {
                a.0.total_cmp(&b.0)
                    .then(a.1.total_cmp(&b.1))
                    .then(a.2.cmp(&b.2))
            })
            .map(|(_, _, g)| g)
    }

    /// What it takes to pass another goal in place of that of the best suffix. `None` while there is no suffix.
    fn detour(&self) -> Option<Detour<'_>> {
        let Best { path, pivot, .. } = self.best.as_ref()?;
        if path.suffix.len() <= 2 {
            return None;
        }
        let system = &*self.problem.system;
        let count = path.suffix.len() - 1;
        let point = |k: usize| path.suffix[(pivot + k) % count].at;
        let is_visit = |at| system.settle(at).is_some_and(|s| s.letter != Letter(0));
        // The ways to the visits next to the goal's, all around if there is no other.
        let reach = |step: usize| {
            let (mut way, mut last) = (0.0, point(0));
            let mut known = Vec::new();
            for k in 1..count {
                let at = point(k * step);
                way += system.distance(last, at);
                known.push((at, way));
                last = at;
                if is_visit(at) {
                    break;
                }
            }
            known
        };
        let weight = self.problem.weight.max(1e-9);
        Some(Detour {
            system,
            ways: [reach(1), reach(count - 1)],
            share: (1.0 - self.problem.weight) / weight,
        })
    }

    fn open_suffix(&mut self, goal: NodeId) {
        let tree = SuffixTree::weighted(&self.prefix, goal, self.problem.weight);
        self.suffix_of.insert(goal, self.suffixes.len());
        self.suffixes.push(tree);
    }
}

/// The best suffix around its goal.
struct Detour<'s> {
    system: &'s dyn TransitionSystem,
    /// For both directions the points from the goal on up to the next visit, and how far along the suffix they are.
    ways: [Vec<(Point2<f64>, f64)>; 2],
    /// What a length of suffix costs in lengths of prefix.
    share: f64,
}

impl Detour<'_> {
    /// By how much the suffix would get longer (or, negative, shorter) if it passed a goal at `at` instead of its own, as
    /// the crow flies, weighted against the prefix. Corners that the goal's place makes needless are left
    /// out: a region behind a wall may have a part before it.
    fn by(&self, at: Point2<f64>) -> f64 {
        let longer = self.ways.each_ref().map(|way| {
            let longer = way.iter();
            let longer = longer.map(|&(p, along)| self.system.distance(p, at) - along);
            longer.reduce(f64::min).unwrap_or(0.0)
        });
        (longer[0] + longer[1]) * self.share
    }
}
