//! The graph of subtasks: what an automaton asks of the robot, one region after the other
//! (`transfer-planning.md`, III-A and Alg. 1).
//!
//! A subtask `((x_s, q_s), (x_e, q_e))` begins at a place whose letter takes the automaton from `q_s` to
//! `q_e` (Def. 3.1) and asks for a path to `x_e` that satisfies the self-loop of `q_e`.
//!
//! Destinations. A guard that no region is needed for (it holds where there is no region) has no
//! destination: if the letter of the place where the robot is satisfies it too, staying fulfils
//! the subtask; otherwise the robot has to leave, and the endpoint is *outside* of that place.
//! All other guards have one destination for each place whose letter they admit.

use std::collections::HashSet;
use std::fmt;

use fixedbitset::FixedBitSet;

use super::places::{PlaceId, Places};
use crate::alphabet::{Letter, LetterSet, Props};
use crate::automaton::{Nba, StateId};

/// Where the robot is when a subtask begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Position {
    /// The place.
    pub place: PlaceId,
    /// Whether the robot has just left it, and is outside of every region.
    pub outside: bool,
}

impl Position {
    /// At a place.
    #[must_use]
    pub fn at(place: PlaceId) -> Self {
        let outside = false;
        Self { place, outside }
    }

    fn code(self) -> usize {
        2 * self.place.index() + usize::from(self.outside)
    }
}

/// An endpoint of a subtask: a position and an automaton state (`q_P` of the paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Endpoint {
    /// Where.
    pub position: Position,
    /// In which automaton state.
    pub state: StateId,
}

/// A subtask (Def. 3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Subtask {
    /// The starting endpoint.
    pub from: Endpoint,
    /// The terminal endpoint; its state's self-loop must hold along the path.
    pub to: Endpoint,
}

impl Subtask {
    /// Whether the robot need not move: both endpoints are at the same position.
    #[must_use]
    pub fn is_stay(&self) -> bool {
        self.from.position == self.to.position
    }
}

/// What counts as the same subtask while the graph is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Equivalence {
    /// Def. 3.2: same positions, forward or backward, and the same label around the terminal state.
    /// For building a library (III-A).
    Match,
    /// Every subtask is one of its own. For planning a new formula (IV-A).
    None,
}

/// The graph of subtasks of one automaton on one map.
#[derive(Clone, Debug)]
pub struct SubtaskGraph {
    /// The subtasks, in the order they were found.
    pub subtasks: Vec<Subtask>,
}

impl SubtaskGraph {
    /// Builds the graph (Alg. 1).
    ///
    /// Corrections: a subtask that matches an earlier one adds no edge, but its terminal endpoint is
    /// expanded all the same (as printed, lines 10 to 14 lose what follows it). The condition (ii) of
    /// Def. 3.2 compares the self-loops of the terminal states. At the start the automaton may also
    /// take another transition than the artificial self-loop, if the start's letter allows it.
    #[must_use]
    pub fn new(nba: &Nba, places: &Places, home: PlaceId, equivalence: Equivalence) -> Self {
        let mut builder = Builder::new(nba, places, equivalence);
        let start = Position::at(home);
        for &q in &nba.initial {
            let from = Endpoint {
                position: start,
                state: q,
            };
            let letter = places.spot(home).letter;
            for (i, t) in nba.outgoing(q).iter().enumerate() {
                if t.guard.contains(letter) {
                    builder.push(from, i);
                }
            }
        }
        builder.run();
        Self {
            subtasks: builder.subtasks,
        }
    }

    /// How many there are (#T of the paper's Table I).
    #[must_use]
    pub fn len(&self) -> usize {
        self.subtasks.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.subtasks.is_empty()
    }
}

/// The labels of self-loops: for each state the letters on which it can wait.
pub(crate) fn loops(nba: &Nba) -> Vec<LetterSet> {
    let label = |q| nba.guard(q, q).cloned();
    nba.states()
        .map(|q| label(q).unwrap_or_else(|| nba.alphabet.none()))
        .collect()
}

/// A way out of an automaton state: the transition's number, and where it asks the robot to be.
enum Exit {
    /// No region is needed.
    Free(usize),
    /// One of these places.
    To(usize, Vec<PlaceId>),
}

struct Builder<'a> {
    nba: &'a Nba,
    places: &'a Places,
    equivalence: Equivalence,
    /// The letter outside of every region, if there is such a point.
    outside: Option<Letter>,
    exits: Vec<Vec<Exit>>,
    /// For each state, the number of its first transition among all.
    offsets: Vec<usize>,
    /// Which states of the search (position, transition) were seen: `S_f ∪ S_e`.
    seen: FixedBitSet,
    edges: usize,
    /// For each state, the number of its self-loop's label among the different labels.
    labels: Vec<u32>,
    matched: HashSet<(usize, usize, u32)>,
    open: Vec<(Endpoint, usize)>,
    subtasks: Vec<Subtask>,
    /// Positions that the state under expansion already leads to.
    reached: FixedBitSet,
}

impl<'a> Builder<'a> {
    fn new(nba: &'a Nba, places: &'a Places, equivalence: Equivalence) -> Self {
        let outside = nba.alphabet.letter(Props::EMPTY);
        let mut offsets = Vec::with_capacity(nba.len());
        let mut edges = 0;
        for q in nba.states() {
            offsets.push(edges);
            edges += nba.outgoing(q).len();
        }
        let exits = nba
            .states()
            .map(|q| exits(nba, places, outside, q))
            .collect();
        Self {
            nba,
            places,
            equivalence,
            outside,
            exits,
            offsets,
            seen: FixedBitSet::with_capacity(2 * places.len() * edges),
            edges,
            labels: match equivalence {
                Equivalence::Match => number_labels(&loops(nba)),
                Equivalence::None => Vec::new(),
            },
            matched: HashSet::new(),
            open: Vec::new(),
            subtasks: Vec::new(),
            reached: FixedBitSet::with_capacity(2 * places.len()),
        }
    }

    /// Adds `((x, q), σ)` to the frontier unless it was seen (lines 13 and 14).
    fn push(&mut self, endpoint: Endpoint, transition: usize) {
        let edge = self.offsets[endpoint.state.index()] + transition;
        let code = endpoint.position.code() * self.edges + edge;
        if !self.seen.put(code) {
            self.open.push((endpoint, transition));
        }
    }

    fn run(&mut self) {
        let mut next = 0;
        while let Some(&(from, transition)) = self.open.get(next) {
            next += 1;
            let target = self.nba.outgoing(from.state)[transition].target;
            self.expand(from, target);
        }
    }

    /// Lines 5 to 14: all subtasks that begin at `from` and whose transition leads to `target`.
    fn expand(&mut self, from: Endpoint, target: StateId) {
        self.reached.clear();
        let exits = std::mem::take(&mut self.exits[target.index()]);
        for exit in &exits {
            match exit {
                Exit::Free(transition) => {
                    let to = self.free_destination(from, target, *transition);
                    self.add(from, to, *transition);
                }
                Exit::To(transition, places) => {
                    for &place in places {
                        let position = Position::at(place);
                        let state = target;
                        self.add(from, Endpoint { position, state }, *transition);
                    }
                }
            }
        }
        self.exits[target.index()] = exits;
    }

    /// Where to be for a guard that needs no region: here if that will do, else outside.
    fn free_destination(&self, from: Endpoint, target: StateId, transition: usize) -> Endpoint {
        let guard = &self.nba.outgoing(target)[transition].guard;
        let here = match from.position.outside {
            true => self.outside,
            false => Some(self.places.spot(from.position.place).letter),
        };
        let stays = here.is_some_and(|letter| guard.contains(letter));
        Endpoint {
            position: Position {
                outside: from.position.outside || !stays,
                ..from.position
            },
            state: target,
        }
    }

    fn add(&mut self, from: Endpoint, to: Endpoint, transition: usize) {
        // Subtasks with identical endpoints are fulfilled already.
        if from != to && !self.reached.put(to.position.code()) && !self.is_known(from, to) {
            self.subtasks.push(Subtask { from, to });
        }
        self.push(to, transition);
    }

    /// `Match` (line 10): whether an equivalent subtask is there (Def. 3.2).
    fn is_known(&mut self, from: Endpoint, to: Endpoint) -> bool {
        if self.equivalence == Equivalence::None {
            return false;
        }
        let (a, b) = (from.position.code(), to.position.code());
        let label = self.labels[to.state.index()];
        !self.matched.insert((a.min(b), a.max(b), label))
    }
}

/// GetLabel and GetDestination (lines 6 and 7) for all ways out of `q` but its self-loop.
fn exits(nba: &Nba, places: &Places, outside: Option<Letter>, q: StateId) -> Vec<Exit> {
    let others = nba.outgoing(q).iter().enumerate();
    others
        .filter(|(_, t)| t.target != q)
        .map(|(i, t)| {
            if outside.is_some_and(|free| t.guard.contains(free)) {
                return Exit::Free(i);
            }
            let there = t.guard.iter().flat_map(|l| places.with_letter(l));
            Exit::To(i, there.collect())
        })
        .collect()
}

/// Numbers the different labels, in the order of states.
fn number_labels(loops: &[LetterSet]) -> Vec<u32> {
    let mut known: Vec<&LetterSet> = Vec::new();
    loops
        .iter()
        .map(|label| {
            let i = known.iter().position(|k| *k == label);
            i.unwrap_or_else(|| {
                known.push(label);
                known.len() - 1
            }) as u32
        })
        .collect()
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let outside = if self.outside { "+" } else { "" };
        write!(f, "{}{outside}", self.place.0)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point2;

    use super::*;
    use crate::automaton::{Limits, Task};
    use crate::system::{Continuous, TransitionSystem};
    use crate::workspace::{Bounds, Polygon, Region, Workspace};

    fn graph(formula: &str, equivalence: Equivalence) -> SubtaskGraph {
        graph_of(formula, equivalence).1
    }

    fn graph_of(formula: &str, equivalence: Equivalence) -> (Task, SubtaskGraph) {
        let square = |x: f64, y: f64| {
            Polygon::rectangle(Point2::new(x, y), Point2::new(x + 0.1, y + 0.1)).unwrap()
        };
        let regions = [
            ("a", square(0.7, 0.1)),
            ("b", square(0.1, 0.7)),
            ("c", square(0.7, 0.7)),
        ];
        let regions = regions.map(|(name, polygon)| Region {
            name: name.to_owned(),
            polygon,
        });
        let map = Workspace::new(Bounds::unit(), vec![], regions.to_vec()).unwrap();
        let system = Continuous::new(Arc::new(map), Point2::new(0.1, 0.1)).unwrap();
        let formula = formula.parse().unwrap();
        let letters = Arc::clone(system.alphabet());
        let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
        let places = Places::new(&system, system.start());
        assert_eq!(places.len(), 4);
        let graph = SubtaskGraph::new(&task.nba, &places, PlaceId::START, equivalence);
        (task, graph)
    }

    #[test]
    fn a_patrol_has_six_subtasks_as_in_the_paper() {
        let graph = graph("G(F a & F b)", Equivalence::None);
        assert_eq!(graph.len(), 6);
        // Two of them go from one of the regions to the other and are left in different states, and
        // one stays.
        assert_eq!(graph.subtasks.iter().filter(|s| s.is_stay()).count(), 1);
        assert!(graph.subtasks.iter().all(|s| s.from != s.to));
    }

    #[test]
    fn equivalent_subtasks_are_left_out_but_what_follows_them_is_not() {
        for mission in ["G(F a & F b)", "GF a & GF b & GF c"] {
            let (task, all) = graph_of(mission, Equivalence::None);
            let (_, some) = graph_of(mission, Equivalence::Match);
            let labels = number_labels(&loops(&task.nba));
            // Def. 3.2: the positions in either order, and the label of the terminal state.
            let class = |s: &Subtask| {
                let (a, b) = (s.from.position.code(), s.to.position.code());
                (a.min(b), a.max(b), labels[s.to.state.index()])
            };
            let classes = |graph: &SubtaskGraph| -> Vec<_> {
                let mut found: Vec<_> = graph.subtasks.iter().map(class).collect();
                found.sort_unstable();
                found
            };
            let (mut every, once) = (classes(&all), classes(&some));
            assert!(
                once.len() < every.len(),
                "{mission} has no equivalent subtasks"
            );
            every.dedup();
            assert_eq!(once, every, "{mission}");
        }
    }

    #[test]
    fn positions_print_for_logs() {
        let at = Position::at(PlaceId(2));
        let outside = Position {
            outside: true,
            ..at
        };
        assert_eq!(
            (at.to_string(), outside.to_string()),
            ("2".into(), "2+".into())
        );
    }
}
