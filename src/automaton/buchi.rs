//! Automata on the way, last stage: Büchi automata with accepting states over letter classes.

use super::bits::Bits;
use super::graph::{Edge, Graph, Marks};
use super::simulation;

/// A Büchi automaton with accepting states. State 0 is initial; without states it accepts nothing.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Buchi {
    pub(super) accepting: Vec<bool>,
    /// By state: targets, ascending and without repetition, with guards.
    pub(super) edges: Vec<Vec<(u32, Bits)>>,
}

impl Buchi {
    pub(super) fn len(&self) -> usize {
        self.accepting.len()
    }

    pub(super) fn edge_count(&self) -> usize {
        self.edges.iter().map(Vec::len).sum()
    }

    /// States and edges: what smaller means.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.len(), self.edge_count())
    }

    /// What better means: smaller, and of equal size with fewer transitions on the way to acceptance.
    pub(super) fn rank(&self) -> ((usize, usize), usize) {
        (self.size(), self.transitions_to_accept())
    }

    /// Transitions from the initial state to the nearest accepting one.
    fn transitions_to_accept(&self) -> usize {
        let mut seen = vec![false; self.len()];
        let mut layer: Vec<usize> = (0..self.len().min(1)).collect();
        for distance in 0.. {
            if layer.is_empty() || layer.iter().any(|&q| self.accepting[q]) {
                return distance;
            }
            layer.iter().for_each(|&q| seen[q] = true);
            let targets = layer.iter().flat_map(|&q| &self.edges[q]);
            let mut next: Vec<usize> = targets.map(|&(t, _)| t as usize).collect();
            next.retain(|&q| !seen[q]);
            next.sort_unstable();
            next.dedup();
            layer = next;
        }
        unreachable!("a layer without new states ends the loop")
    }

    /// The same with marks: one mark, on all edges of accepting states.
    pub(super) fn to_graph(&self) -> Graph {
        let edges = self.edges.iter().zip(&self.accepting).map(|(row, &acc)| {
            row.iter()
                .map(|(target, guard)| Edge {
                    target: *target,
                    marks: Marks::from(acc),
                    guard: guard.clone(),
                })
                .collect()
        });
        Graph {
            marks: 1,
            edges: edges.collect(),
        }
    }

    fn from_graph(graph: Graph, labels: &[Marks]) -> Self {
        let edges = graph.edges.into_iter().map(|row| {
            let mut merged: Vec<(u32, Bits)> = Vec::with_capacity(row.len());
            for e in row {
                match merged.last_mut() {
                    Some((target, guard)) if *target == e.target => guard.or_with(&e.guard),
                    _ => merged.push((e.target, e.guard)),
                }
            }
            merged
        });
        Self {
            edges: edges.collect(),
            accepting: labels.iter().map(|&l| l == 1).collect(),
        }
    }

    /// Drops useless states; no state outside an accepting component is accepting after it.
    pub(super) fn trim(&mut self) {
        let mut graph = self.to_graph();
        // Marks of edges between components say nothing, and trimming loses the states' own ones:
        // a state keeps its acceptance if an edge that stays in its component carries the mark.
        let components = graph.trim();
        let accepting: Vec<Marks> = graph
            .edges
            .iter()
            .enumerate()
            .map(|(q, row)| {
                let inside = |e: &&Edge| components.of[e.target as usize] == components.of[q];
                let marked = row.iter().filter(inside).any(|e| e.marks == 1);
                Marks::from(marked && components.is_accepting(q))
            })
            .collect();
        *self = Self::from_graph(graph, &accepting);
    }

    /// Trims and reduces by simulation until nothing changes.
    pub(super) fn reduce(&mut self) {
        loop {
            let before = self.size();
            self.trim();
            if self.len() < 2 {
                return;
            }
            let mut graph = self.to_graph();
            let mut labels: Vec<Marks> = self.accepting.iter().map(|&a| Marks::from(a)).collect();
            simulation::reduce(&mut graph, &mut labels);
            *self = Self::from_graph(graph, &labels);
            if self.size() == before {
                return;
            }
        }
    }
}
