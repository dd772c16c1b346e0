//! The input encoding that the weights of the paper's published code were trained with.
//!
//! What differs from our own is listed in `docs/networks.md`, *Published checkpoints*.

use std::collections::HashSet;

use super::AutomatonGraph;
use super::graph::region_order;
use crate::automaton::{Distances, StateId, Task, cubes};

impl AutomatonGraph {
    /// Encodes `task` as the published code does; returns the names of the channels too, none
    /// where a channel's region is not named by the formula.
    ///
    /// Region `l3` has the third channel, whatever the formula names; where the map's regions do
    /// not bear different numbers from 1 on, the order of their names counts. A pair of states has
    /// at most one transition node, and none where two regions are needed at once.
    #[must_use]
    pub fn published(task: &Task) -> (Self, Vec<Option<String>>) {
        let alphabet = &task.nba.alphabet;
        let names = alphabet.propositions();
        let used: HashSet<&str> = match &task.formula {
            Some(formula) => region_order(formula).into_iter().collect(),
            None => names.iter().map(String::as_str).collect(),
        };
        let channels = channels(names);
        let width = (0..names.len())
            .filter(|&p| used.contains(names[p].as_str()))
            .map(|p| channels[p] + 1)
            .max()
            .unwrap_or(0);
        let mut shown = vec![None; width];
        for (name, &channel) in names.iter().zip(&channels) {
            if used.contains(name.as_str()) {
                shown[channel] = Some(name.clone());
            }
        }
        let (mut literals, mut ends) = (Vec::new(), Vec::new());
        for from in task.nba.states() {
            let mut reached = HashSet::new();
            for transition in task.nba.outgoing(from) {
                let simple = cubes(&transition.guard, alphabet)
                    .into_iter()
                    .find(|cube| cube.positive.len() <= 1);
                let Some(cube) = simple.filter(|_| reached.insert(transition.target)) else {
                    continue;
                };
                let first = literals.len();
                literals.resize(first + width, 0);
                for (p, &channel) in channels.iter().enumerate() {
                    if let Some(to) = literals[first..].get_mut(channel) {
                        *to = i8::from(cube.positive.contains(p))
                            - i8::from(cube.negative.contains(p));
                    }
                }
                ends.push((from.0, transition.target.0));
            }
        }
        let graph = Self {
            regions: width,
            states: states(task),
            literals,
            ends,
        };
        (graph, shown)
    }
}

/// For each region the number of its channel.
fn channels(names: &[String]) -> Vec<usize> {
    let numbers: Vec<usize> = names.iter().filter_map(|name| number(name)).collect();
    let different = numbers.iter().collect::<HashSet<_>>().len() == names.len();
    if numbers.len() == names.len() && different {
        return numbers.iter().map(|n| n - 1).collect();
    }
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by_key(|&p| &names[p]);
    let mut channels = vec![0; names.len()];
    for (channel, &p) in order.iter().enumerate() {
        channels[p] = channel;
    }
    channels
}

/// The number, from 1 to the most regions there may be, that a name ends with.
fn number(name: &str) -> Option<usize> {
    let digits = name.trim_start_matches(|c: char| !c.is_ascii_digit());
    let number = digits.parse().ok()?;
    (1..=crate::alphabet::MAX_PROPOSITIONS)
        .contains(&number)
        .then_some(number)
}

/// Initial; accepting and not initial; steps to the nearest accepting state, by its shortest cycle
/// from one to itself, divided by the largest finite number of steps to an accepting state.
fn states(task: &Task) -> Vec<[f32; 3]> {
    let steps = |q: StateId, f: StateId| {
        let steps = task.distances.get(q, f);
        (steps != Distances::INFINITE).then_some(steps)
    };
    let all = task.nba.states();
    let largest = all
        .flat_map(|q| task.feasible.iter().filter_map(move |&f| steps(q, f)))
        .max()
        .unwrap_or(1) as f32;
    task.nba
        .states()
        .map(|q| {
            let initial = task.nba.initial.contains(&q);
            let accepting = task.feasible.contains(&q);
            let nearest = if accepting {
                steps(q, q)
            } else {
                task.feasible.iter().filter_map(|&f| steps(q, f)).min()
            };
            [
                f32::from(u8::from(initial)),
                f32::from(u8::from(accepting && !initial)),
                nearest.map_or(-1.0, |n| n as f32 / largest),
            ]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::alphabet::Alphabet;
    use crate::automaton::Limits;

    fn task(names: &[&str], formula: &str) -> Task {
        let names = names.iter().map(|&n| n.to_owned()).collect();
        let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
        Task::from_formula(&formula.parse().unwrap(), alphabet, &Limits::default()).unwrap()
    }

    #[test]
    fn channels_go_by_the_regions_numbers() {
        let (graph, names) = AutomatonGraph::published(&task(&["l1", "l2", "l3", "l4"], "<> l3"));
        assert_eq!(names, [None, None, Some("l3".to_owned())]);
        assert_eq!(graph.regions, 3);
        graph.check().unwrap();
        // Wherever a region is asked for it is the third.
        assert!(graph.literals.chunks(3).any(|row| row == [0, 0, 1]));
        assert!(
            graph
                .literals
                .chunks(3)
                .all(|row| row[0] >= 0 && row[1] >= 0)
        );
        let (_, names) =
            AutomatonGraph::published(&task(&["desk", "attic"], "<> desk && <> attic"));
        assert_eq!(names, [Some("attic".to_owned()), Some("desk".to_owned())]);
    }

    #[test]
    fn an_initial_accepting_state_is_marked_as_initial_alone() {
        let (graph, _) = AutomatonGraph::published(&task(&["l1"], "[] !l1"));
        // One state, with a loop: one step over one.
        assert_eq!(graph.states, [[1.0, 0.0, 1.0]]);
        let (graph, _) = AutomatonGraph::published(&task(&["l1"], "<> l1"));
        assert_eq!(graph.states.len(), 2);
        // Both are one step from acceptance: ours says 0 for the accepting one.
        assert!(graph.states.contains(&[1.0, 0.0, 1.0]));
        assert!(graph.states.contains(&[0.0, 1.0, 1.0]));
    }

    #[test]
    fn a_pair_of_states_has_one_transition() {
        let (graph, _) =
            AutomatonGraph::published(&task(&["l1", "l2", "l3"], "<> (l1 || l2) && <> l3"));
        let pairs: HashSet<_> = graph.ends.iter().collect();
        assert_eq!(pairs.len(), graph.ends.len());
        let positive = |row: &[i8]| row.iter().filter(|&&e| e > 0).count();
        assert!(graph.literals.chunks(3).all(|row| positive(row) <= 1));
    }
}
