//! The automaton as the map allows it: without the transitions that it rules out.
//!
//! ρ counts steps on any letters. Where two regions do not touch, no leg leads from one into the other, and a step that needs
//! their letters one right after the other is none; a sampler that counts on it heads for it for ever, and nodes that wait for it
//! are dead ends. So transitions that are physically impossible are left out (as in X. Luo, Y. Kantaros, M. M. Zavlanos, "An
//! abstraction-free method for multirobot temporal logic optimal control synthesis", T-RO 2021): those on letters that no walk over the
//! map's letters meets in their state, and those after which no such walk accepts. Trees grow by what is left, too.

use std::collections::VecDeque;

use super::Problem;
use crate::alphabet::{Letter, LetterSet};
use crate::automaton::{Distances, Nba, StateId, Task, Transition, components};
use crate::workspace::Workspace;

/// Of products of states and letters that are larger, nothing is removed.
const MAX_PAIRS: usize = 100_000;

/// Where walks have more steps, what no walk accepts after is not looked for.
const MAX_STEPS: usize = 2_000_000;

/// The task with fewer transitions and the same states; `None` if none can be removed.
pub(super) fn advice(problem: &Problem) -> Option<Task> {
    let (map, nba) = (problem.system.plane()?, &problem.task.nba);
    if nba.len() * nba.alphabet.len() > MAX_PAIRS {
        return None;
    }
    let walks = Walks::new(problem, neighbours(map, problem));
    let mut removed = false;
    let mut keep = |(q, transition): (StateId, &Transition)| {
        let (target, mut guard) = (transition.target, nba.alphabet.none());
        for letter in transition.guard.iter() {
            if walks.accepts_after(q, letter, target) {
                guard.insert(letter);
            }
        }
        removed |= guard != transition.guard;
        (!guard.is_empty()).then_some(Transition { target, guard })
    };
    let transitions = nba
        .states()
        .map(|q| {
            nba.outgoing(q)
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
    // A task that no walk fulfils is none that samplers can be advised on.
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

/// Walks over the map's letters, with the states that the automaton can be in.
struct Walks {
    /// For each letter those that a leg may lead to.
    near: Vec<Vec<Letter>>,
    /// For each state the letters that some walk has in it from which one accepts.
    live: Vec<LetterSet>,
}

impl Walks {
    fn new(problem: &Problem, near: Vec<Vec<Letter>>) -> Self {
        let nba = &problem.task.nba;
        let met = letters_met(nba, problem.start.letter, &near);
        let live = letters_live(&problem.task, &met, &near).unwrap_or(met);
        Self { near, live }
    }

    /// Whether some walk that accepts is in state `q` on this letter, and in state `target` next.
    fn accepts_after(&self, q: StateId, letter: Letter, target: StateId) -> bool {
        let mut next = self.near[letter.index()].iter();
        let live = &self.live[target.index()];
        self.live[q.index()].contains(letter) && next.any(|&beside| live.contains(beside))
    }
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

/// For each state the letters of `met` from which some walk accepts; `None` if there are too many steps to look at.
fn letters_live(task: &Task, met: &[LetterSet], near: &[Vec<Letter>]) -> Option<Vec<LetterSet>> {
    let nba = &task.nba;
    let letters = nba.alphabet.len();
    let pair = |q: StateId, letter: Letter| q.index() * letters + letter.index();
    let pairs: Vec<(StateId, Letter)> = nba
        .states()
        .flat_map(|q| met[q.index()].iter().map(move |letter| (q, letter)))
        .collect();
    let steps = |&(q, letter): &(StateId, Letter)| {
        nba.successors(q, letter).count() * near[letter.index()].len()
    };
    if pairs.iter().map(steps).sum::<usize>() > MAX_STEPS {
        return None;
    }
    let mut number = vec![u32::MAX; nba.len() * letters];
    for (i, &(q, letter)) in pairs.iter().enumerate() {
        number[pair(q, letter)] = i as u32;
    }
    let after = |i: usize| {
        let (q, letter) = pairs[i];
        let number = &number;
        nba.successors(q, letter).flat_map(move |next| {
            let beside = near[letter.index()].iter();
            beside.map(move |&beside| number[pair(next, beside)] as usize)
        })
    };
    let component = components(pairs.len(), after);
    let count = component.iter().max().map_or(0, |&last| last as usize + 1);
    // What a component's cycles have, if it has any.
    let (mut cycles, mut accepts) = (vec![false; count], vec![false; count]);
    for (i, &of) in component.iter().enumerate() {
        cycles[of as usize] |= after(i).any(|next| component[next] == of);
        accepts[of as usize] |= nba.is_accepting(pairs[i].0);
    }
    let mut lives: Vec<bool> = cycles.iter().zip(accepts).map(|(&c, a)| c && a).collect();
    // Steps lead to smaller numbers.
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by_key(|&i| component[i]);
    for i in order {
        if after(i).any(|next| lives[component[next] as usize]) {
            lives[component[i] as usize] = true;
        }
    }
    let mut live = vec![nba.alphabet.none(); nba.len()];
    for (i, (q, letter)) in pairs.into_iter().enumerate() {
        if lives[component[i] as usize] {
            live[q.index()].insert(letter);
        }
    }
    Some(live)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point2;

    use super::*;
    use crate::automaton::Limits;
    use crate::planner::{Sampler, Settings, Stop, plan};
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

    /// To stay in `a` and `b` together, seeing `b` again and again, is to stay in `b` where the two do not touch: nothing comes of it
    /// in `a`.
    #[test]
    fn what_no_walk_accepts_after_is_left_out() {
        let steps_on_a = |gap: f64| {
            let problem = problem(gap, "F G (a U b)");
            let advised = advice(&problem);
            let nba = advised.as_ref().map_or(&problem.task.nba, |task| &task.nba);
            let a = nba.alphabet.letters_with(0).iter().next().unwrap();
            let steps = nba
                .states()
                .flat_map(|q| nba.outgoing(q).iter().map(move |t| (q, t)));
            steps
                .filter(|(q, t)| *q != t.target && t.guard.contains(a))
                .count()
        };
        assert_eq!(steps_on_a(0.1), 0);
        assert!(steps_on_a(0.0) > 0);
    }

    /// A search that went to `a` first would have to find by chance that it must leave it again.
    #[test]
    fn no_sample_is_spent_on_what_leads_nowhere() {
        let problem = problem(0.3, "F G (a U b)");
        for seed in 0..20 {
            let settings = Settings {
                first: true,
                iterations: 4,
                seed,
                ..Settings::default()
            };
            plan(
                &problem,
                &Sampler::Directed,
                &settings,
                &Stop::new(),
                &mut |_| {},
            )
            .unwrap();
        }
    }
}
