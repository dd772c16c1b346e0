//! The automaton as samplers see it: without the transitions that the map rules out.
//!
//! ρ counts steps on any letters. Where two regions do not touch, no leg leads from one into the other, and a step that needs
//! their letters one right after the other is none; a sampler that counts on it heads for it for ever. So transitions that are
//! physically impossible are left out of what is counted (as in X. Luo, Y. Kantaros, M. M. Zavlanos, "An abstraction-free method for
//! multirobot temporal logic optimal control synthesis", T-RO 2021): those on letters that no walk over the map's letters
//! meets in their state. Trees grow by the whole automaton.

use std::collections::VecDeque;

use super::Problem;
use crate::alphabet::{Letter, LetterSet};
use crate::automaton::{Distances, Nba, StateId, Task, Transition};
use crate::workspace::Workspace;

/// Of products of states and letters that are larger, nothing is removed.
const MAX_PAIRS: usize = 100_000;

/// The task with fewer transitions and the same states; `None` if none can be removed.
pub(super) fn advice(problem: &Problem) -> Option<Task> {
    let (map, nba) = (problem.system.plane()?, &problem.task.nba);
    if nba.len() * nba.alphabet.len() > MAX_PAIRS {
        return None;
    }
    let met = letters_met(nba, problem.start.letter, &neighbours(map, problem));
    let mut removed = false;
    let mut keep = |(q, transition): (usize, &Transition)| {
        let guard = transition.guard.intersection(&met[q]);
        removed |= guard != transition.guard;
        let target = transition.target;
        (!guard.is_empty()).then_some(Transition { target, guard })
    };
    let transitions = (0..nba.len())
        .map(|q| {
            nba.transitions[q]
                .iter()
                .filter_map(|t| keep((q, t)))
                .collect()
        })
        .collect();
    if !removed {
        return None;
    }
    let less = Nba {
        transitions,
        ..nba.clone()
    };
    let task = Task::from_trimmed(less, problem.task.formula.clone());
    // Letters that touch at corners alone are not seen as neighbours: that must not end a search.
    let leads = |q: &StateId| {
        let goal = |&f: &StateId| task.distances.to_go(*q, f) != Distances::INFINITE;
        task.feasible.iter().any(goal)
    };
    task.nba.initial.iter().any(leads).then_some(task)
}

/// For each letter those that a leg may lead to from it, itself included.
fn neighbours(map: &Workspace, problem: &Problem) -> Vec<Vec<Letter>> {
    let alphabet = map.alphabet();
    let boxes: Vec<[f64; 4]> = map
        .regions()
        .iter()
        .map(|region| {
            let v = region.polygon.vertices();
            let most = |f: fn(&nalgebra::Point2<f64>) -> f64| {
                v.iter().map(f).fold(f64::NEG_INFINITY, f64::max)
            };
            [most(|p| p.x), most(|p| p.y), most(|p| -p.x), most(|p| -p.y)]
        })
        .collect();
    let slack = 4.0 * map.tolerance();
    let touch = |r: usize, s: usize| {
        let apart = |i: usize, j: usize| boxes[r][i] + boxes[s][j] < -slack;
        !(apart(0, 2) || apart(2, 0) || apart(1, 3) || apart(3, 1))
    };
    let near = |a: Letter, b: Letter| {
        let (a, b) = (alphabet.props(a), alphabet.props(b));
        let both = a.0 & b.0;
        // One has all regions of the other, or one is left where another begins.
        both == a.0
            || both == b.0
            || a.iter().filter(|&r| !b.contains(r)).any(|r| {
                let mut entered = b.iter().filter(|&s| !a.contains(s));
                entered.any(|s| touch(r, s))
            })
    };
    let reachable = problem.system.reachable();
    let to = |a: Letter| {
        let all = alphabet.letters().filter(|&b| reachable.contains(b));
        all.filter(|&b| near(a, b)).collect()
    };
    alphabet.letters().map(to).collect()
}

/// For each state the letters that some walk has in it.
fn letters_met(nba: &Nba, start: Letter, near: &[Vec<Letter>]) -> Vec<LetterSet> {
    let mut met = vec![nba.alphabet.none(); nba.len()];
    let mut open: VecDeque<(StateId, Letter)> = VecDeque::new();
    let mut meet = |q: StateId, letter: Letter, open: &mut VecDeque<_>| {
        if !met[q.index()].contains(letter) {
            met[q.index()].insert(letter);
            open.push_back((q, letter));
        }
    };
    for &q in &nba.initial {
        meet(q, start, &mut open);
    }
    while let Some((q, letter)) = open.pop_front() {
        for next in nba.successors(q, letter) {
            for &beside in &near[letter.index()] {
                meet(next, beside, &mut open);
            }
        }
    }
    met
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point2;

    use super::*;
    use crate::automaton::Limits;
    use crate::system::Continuous;
    use crate::workspace::{Bounds, Polygon, Region};

    /// Two squares, `gap` apart, and a task on them.
    fn problem(gap: f64, task: &str) -> Problem {
        let square = |name: &str, x: f64| Region {
            name: name.to_owned(),
            polygon: Polygon::rectangle(Point2::new(x, 0.4), Point2::new(x + 0.2, 0.6)).unwrap(),
        };
        let regions = vec![square("a", 0.2), square("b", 0.4 + gap)];
        let map = Workspace::new(Bounds::unit(), Vec::new(), regions).unwrap();
        let system = Continuous::new(Arc::new(map), Point2::new(0.1, 0.1)).unwrap();
        let alphabet = Arc::clone(system.map().alphabet());
        let formula = task.parse().unwrap();
        let task = Task::from_formula(&formula, alphabet, &Limits::default()).unwrap();
        Problem {
            start: system.start(),
            system: Arc::new(system),
            task: Arc::new(task),
            weight: 0.2,
        }
    }

    fn edges(nba: &Nba) -> Vec<(StateId, StateId, usize)> {
        let of = |q: StateId| {
            let edges = nba.outgoing(q).iter();
            edges.map(move |t| (q, t.target, t.guard.len()))
        };
        nba.states().flat_map(of).collect()
    }

    #[test]
    fn what_only_touching_regions_allow_is_left_out_where_they_do_not_touch() {
        // After b the automaton could go on with a at once; the robot passes neither on its way.
        let apart = problem(0.1, "G (F b U a)");
        let (whole, less) = (&apart.task.nba, advice(&apart).unwrap().nba);
        assert!(edges(&less) != edges(whole) && less.len() == whole.len());
        for q in less.states() {
            for t in less.outgoing(q) {
                assert!(t.guard.is_subset(whole.guard(q, t.target).unwrap()));
            }
        }
        // "a, and b right after": reachable only if they touch.
        let direct = "F (a && (a U b))";
        assert!(
            advice(&problem(0.1, direct)).is_none(),
            "else no way would be left"
        );
        let touching = problem(0.0, direct);
        let found = advice(&touching).map_or(edges(&touching.task.nba), |t| edges(&t.nba));
        assert!(found.iter().any(|e| e.1 != e.0));
    }
}
