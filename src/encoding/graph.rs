//! The automaton as a graph of three node types.

use std::collections::HashSet;

use crate::automaton::{Distances, StateId, Task, cubes};
use crate::ltl::Formula;

/// Why an automaton could not be encoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphError {
    /// A channel names a proposition that the automaton's alphabet does not have.
    #[error(
        "region `{0}` is not among the automaton's propositions: list the regions that the formula names"
    )]
    UnknownRegion(String),
}

/// For each target node the source nodes of its incoming edges: the edges of one type.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Incoming {
    /// `targets + 1` offsets into [`Self::sources`].
    pub offsets: Vec<u32>,
    /// The source nodes, grouped by target, ascending within a group.
    pub sources: Vec<u32>,
}

impl Incoming {
    /// Groups a list of (source, target) pairs by target.
    ///
    /// # Panics
    /// If a target is not below `targets`.
    #[must_use]
    pub fn new(targets: usize, edges: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut edges: Vec<(u32, u32)> = edges.map(|(source, target)| (target, source)).collect();
        edges.sort_unstable();
        let mut offsets = vec![0; targets + 1];
        for &(target, _) in &edges {
            offsets[target as usize + 1] += 1;
        }
        for i in 0..targets {
            offsets[i + 1] += offsets[i];
        }
        Self {
            offsets,
            sources: edges.into_iter().map(|(_, source)| source).collect(),
        }
    }

    /// One target node with an edge from every one of `sources` nodes.
    #[must_use]
    pub fn pool(sources: usize) -> Self {
        Self {
            offsets: vec![0, sources as u32],
            sources: (0..sources as u32).collect(),
        }
    }
}

/// An automaton as the networks see it: state nodes, transition nodes, and how they are linked.
///
/// There is one transition node per cube of each guard (`docs/networks.md`, Inputs).
#[derive(Clone, Debug, PartialEq)]
pub struct AutomatonGraph {
    /// How many regions (channels) the mission uses.
    pub regions: usize,
    /// Shape (states, 3), row-major: initial, feasible accepting, normalised distance.
    pub states: Vec<[f32; 3]>,
    /// Shape (transitions, regions), row-major: 1 where the cube asks for the region, −1 where
    /// it forbids it, 0 where it does not care.
    pub literals: Vec<i8>,
    /// For each transition node its source and its target state.
    pub ends: Vec<(u32, u32)>,
}

impl AutomatonGraph {
    /// Encodes `task`; `regions` are the names of the channels, in order.
    ///
    /// Literals of propositions that are not among `regions` are left out.
    ///
    /// # Errors
    /// A name in `regions` that the automaton's alphabet does not have.
    pub fn new(task: &Task, regions: &[&str]) -> Result<Self, GraphError> {
        let alphabet = &task.nba.alphabet;
        let channels: Vec<usize> = regions
            .iter()
            .map(|&name| {
                alphabet
                    .proposition(name)
                    .ok_or_else(|| GraphError::UnknownRegion(name.to_owned()))
            })
            .collect::<Result<_, _>>()?;
        let (mut literals, mut ends) = (Vec::new(), Vec::new());
        for from in task.nba.states() {
            for transition in task.nba.outgoing(from) {
                for cube in cubes(&transition.guard, alphabet) {
                    literals.extend(channels.iter().map(|&p| {
                        i8::from(cube.positive.contains(p)) - i8::from(cube.negative.contains(p))
                    }));
                    ends.push((from.0, transition.target.0));
                }
            }
        }
        Ok(Self {
            regions: regions.len(),
            states: state_features(task),
            literals,
            ends,
        })
    }

    /// Encodes `task` with the channels in order of first use in its formula, and returns their
    /// names too. A task without a formula uses the propositions that its guards ask for or forbid, in the
    /// alphabet's order.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_task(task: &Task) -> Result<(Self, Vec<String>), GraphError> {
        let known = task.nba.alphabet.propositions();
        let refs: Vec<&str> = match &task.formula {
            Some(formula) => region_order(formula),
            None => known.iter().map(String::as_str).collect(),
        };
        let mut graph = Self::new(task, &refs)?;
        let mut names: Vec<String> = refs.into_iter().map(str::to_owned).collect();
        if task.formula.is_none() {
            let used = graph.keep_used();
            let mut used = used.iter();
            names.retain(|_| used.next() == Some(&true));
        }
        Ok((graph, names))
    }

    /// Drops the channels that no transition has a literal of, and returns for each whether it stays.
    fn keep_used(&mut self) -> Vec<bool> {
        let mut used = vec![false; self.regions];
        for row in self.literals.chunks(self.regions.max(1)) {
            for (used, &literal) in used.iter_mut().zip(row) {
                *used |= literal != 0;
            }
        }
        let mut channel = used.iter().cycle();
        self.literals.retain(|_| channel.next() == Some(&true));
        self.regions = used.iter().filter(|&&u| u).count();
        used
    }

    /// Whether the lists fit together; graphs that [`Self::new`] made always do.
    ///
    /// # Errors
    /// What does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        let states = self.states.len() as u32;
        if self.literals.len() != self.ends.len() * self.regions {
            return Err("the literals are not one row of all regions per transition");
        }
        if self
            .ends
            .iter()
            .any(|&(from, to)| from >= states || to >= states)
        {
            return Err("a transition leads from or to a state that is not there");
        }
        if self.states.iter().flatten().any(|v| !v.is_finite()) {
            return Err("a state has features that are not finite");
        }
        Ok(())
    }

    /// How many transition nodes there are.
    #[must_use]
    pub fn transitions(&self) -> usize {
        self.ends.len()
    }

    /// The edges `state_to_transition`: from the source state of each transition.
    #[must_use]
    pub fn state_to_transition(&self) -> Incoming {
        let edges = self.ends.iter().zip(0..).map(|(&(from, _), t)| (from, t));
        Incoming::new(self.transitions(), edges)
    }

    /// The edges `target_to_transition`: from the target state of each transition.
    #[must_use]
    pub fn target_to_transition(&self) -> Incoming {
        let edges = self.ends.iter().zip(0..).map(|(&(_, to), t)| (to, t));
        Incoming::new(self.transitions(), edges)
    }

    /// The edges `transition_to_state`: each transition to its target state.
    #[must_use]
    pub fn transition_to_state(&self) -> Incoming {
        let edges = self.ends.iter().zip(0..).map(|(&(_, to), t)| (t, to));
        Incoming::new(self.states.len(), edges)
    }

    /// The edges `transition_to_source`: each transition to its source state.
    #[must_use]
    pub fn transition_to_source(&self) -> Incoming {
        let edges = self.ends.iter().zip(0..).map(|(&(from, _), t)| (t, from));
        Incoming::new(self.states.len(), edges)
    }
}

/// The features of the state nodes: initial, feasible accepting, and ρ to the nearest feasible
/// accepting state divided by the largest finite ρ between two different states (−1 if none).
fn state_features(task: &Task) -> Vec<[f32; 3]> {
    let finite = |steps: u32| (steps != Distances::INFINITE).then_some(steps);
    let to_go = |a: StateId, b: StateId| finite(task.distances.to_go(a, b));
    let states = || task.nba.states();
    // No two states that reach one another: every finite distance is 0, whatever it is divided by.
    let largest = task.distances.largest().max(1) as f32;
    states()
        .map(|q| {
            let nearest = task.feasible.iter().filter_map(|&f| to_go(q, f)).min();
            [
                f32::from(u8::from(task.nba.initial.contains(&q))),
                f32::from(u8::from(task.feasible.contains(&q))),
                nearest.map_or(-1.0, |steps| steps as f32 / largest),
            ]
        })
        .collect()
}

/// The regions that a formula names, in order of first use (left to right).
#[must_use]
pub fn region_order(formula: &Formula) -> Vec<&str> {
    let mut seen = HashSet::new();
    let mut order = Vec::new();
    // An explicit stack: formulas may nest deeper than threads' stacks allow.
    let mut stack = vec![formula];
    while let Some(node) = stack.pop() {
        match node {
            Formula::True | Formula::False => {}
            Formula::Prop(name) => {
                if seen.insert(name.as_str()) {
                    order.push(name.as_str());
                }
            }
            Formula::Not(a) | Formula::Next(a) | Formula::Finally(a) | Formula::Globally(a) => {
                stack.push(a);
            }
            Formula::And(a, b)
            | Formula::Or(a, b)
            | Formula::Implies(a, b)
            | Formula::Iff(a, b)
            | Formula::Until(a, b)
            | Formula::Release(a, b)
            | Formula::WeakUntil(a, b)
            | Formula::StrongRelease(a, b) => {
                stack.push(b);
                stack.push(a);
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::alphabet::Alphabet;
    use crate::automaton::{Nba, Transition};

    /// `F b` over the disjoint regions a and b: wait for b, then anything.
    fn eventually_b() -> Task {
        let alphabet = Arc::new(Alphabet::disjoint(vec!["a".into(), "b".into()]).unwrap());
        let (b, all) = (alphabet.letters_with(1), alphabet.all());
        let to = |target, guard: &crate::alphabet::LetterSet| Transition {
            target: StateId(target),
            guard: guard.clone(),
        };
        let nba = Nba {
            transitions: vec![vec![to(0, &all), to(1, &b)], vec![to(1, &all)]],
            initial: vec![StateId(0)],
            accepting: vec![false, true],
            alphabet,
        };
        Task::from_trimmed(
            nba,
            Some(Formula::Finally(Box::new(Formula::Prop("b".into())))),
        )
    }

    #[test]
    fn features_and_edges_of_a_small_task() {
        let (graph, names) = AutomatonGraph::of_task(&eventually_b()).unwrap();
        assert_eq!(names, ["b"]);
        assert_eq!(graph.states, [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
        assert_eq!(graph.ends, [(0, 0), (0, 1), (1, 1)]);
        assert_eq!(graph.literals, [0, 1, 0]);
        assert_eq!(
            graph.transition_to_state(),
            Incoming {
                offsets: vec![0, 1, 3],
                sources: vec![0, 1, 2]
            }
        );
        assert_eq!(graph.state_to_transition().sources, [0, 0, 1]);
        assert_eq!(graph.target_to_transition().sources, [0, 1, 1]);
        assert_eq!(graph.transition_to_source().offsets, [0, 2, 3]);
    }

    #[test]
    fn an_automaton_alone_uses_the_regions_of_its_guards() {
        let task = Task {
            formula: None,
            ..eventually_b()
        };
        let (graph, names) = AutomatonGraph::of_task(&task).unwrap();
        assert_eq!(names, ["b"]);
        assert_eq!((graph.regions, &graph.literals[..]), (1, &[0, 1, 0][..]));
        assert_eq!(graph.check(), Ok(()));
    }

    #[test]
    fn unknown_regions_are_named() {
        let error = AutomatonGraph::new(&eventually_b(), &["c"]).unwrap_err();
        assert_eq!(error, GraphError::UnknownRegion("c".into()));
    }

    #[test]
    fn regions_stand_in_order_of_first_use() {
        let p = |name: &str| Box::new(Formula::Prop(name.into()));
        let formula = Formula::And(
            Box::new(Formula::Until(p("b"), p("a"))),
            Box::new(Formula::Or(p("b"), p("c"))),
        );
        assert_eq!(region_order(&formula), ["b", "a", "c"]);
    }
}
