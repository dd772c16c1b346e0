//! Fewer choices: states that stand for "one of these".
//!
//! Targets that are reached from one state on the same letter with the same marks become one state,
//! the disjunction of them. A run of sets carries, by König's lemma, a run of members with the same
//! marks, so the language stays. Often the sets merge afterwards and the automaton gets smaller (the
//! branching postponement of Duret-Lutz, "LTL translation improvements in Spot 1.0", section 4.3,
//! done on automata).

use std::collections::HashMap;

use super::bits::Bits;
use super::graph::{Edge, Graph, unite};

/// For each set of targets the letters that lead there, for one set of marks.
pub(super) fn split<'e>(
    edges: impl Iterator<Item = &'e Edge>,
    letters: &Bits,
) -> Vec<(Bits, Vec<u32>)> {
    // A partition of the letters, refined by one edge after the other.
    let mut parts: Vec<(Bits, Vec<u32>)> = vec![(letters.clone(), Vec::new())];
    for e in edges {
        for i in 0..parts.len() {
            let inside = parts[i].0.and(&e.guard);
            if inside.is_empty() {
                continue;
            }
            let outside = parts[i].0.minus(&e.guard);
            if !outside.is_empty() {
                let rest = (outside, parts[i].1.clone());
                parts.push(rest);
                parts[i].0 = inside;
            }
            parts[i].1.push(e.target);
        }
    }
    for part in &mut parts {
        part.1.sort_unstable();
        part.1.dedup();
    }
    parts
}

/// The automaton of sets; `None` if it would have more than `limit` states.
pub(super) fn postpone(graph: &Graph, letters: usize, limit: usize) -> Option<Graph> {
    let all = Bits::all(letters);
    let mut number: HashMap<Vec<u32>, u32> = HashMap::from([(vec![0], 0)]);
    let mut queue = vec![vec![0u32]];
    let mut result = Graph {
        marks: graph.marks,
        edges: Vec::new(),
    };
    while result.len() < queue.len() {
        if queue.len() > limit {
            return None;
        }
        let members = queue[result.len()].clone();
        let edges: Vec<&Edge> = members
            .iter()
            .flat_map(|&q| &graph.edges[q as usize])
            .collect();
        let mut kinds: Vec<_> = edges.iter().map(|e| e.marks).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let mut row = Vec::new();
        for marks in kinds {
            let alike = edges.iter().copied().filter(|e| e.marks == marks);
            for (guard, targets) in split(alike, &all) {
                if targets.is_empty() {
                    continue;
                }
                let target = *number.entry(targets.clone()).or_insert_with(|| {
                    queue.push(targets);
                    queue.len() as u32 - 1
                });
                row.push(Edge {
                    target,
                    marks,
                    guard,
                });
            }
        }
        result.edges.push(unite(row));
    }
    Some(result)
}
