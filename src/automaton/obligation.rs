//! The minimal deterministic automaton of an obligation.
//!
//! Boolean combinations of safety and guarantee properties have a deterministic automaton in which
//! every component accepts or rejects as a whole, and among those a unique smallest one (Dax, Eisinger,
//! Klaedtke, "Mechanizing the powerset construction for restricted classes of ω-automata", ATVA 2007;
//! Löding, "Efficient minimization of deterministic weak ω-automata", IPL 2001). Most missions that
//! end are of this kind.

use std::collections::HashMap;

use super::bits::Bits;
use super::buchi::Buchi;
use super::emptiness::{share_a_word, share_a_word_from};
use super::graph::{Edge, Graph, Marks};
use super::scc;
use super::subset::split;

/// A deterministic, complete automaton. State 0 is initial.
struct Deterministic {
    members: Vec<Vec<u32>>,
    edges: Vec<Vec<(u32, Bits)>>,
    component: Vec<u32>,
}

/// The minimal weak deterministic automaton of `graph`'s language, if there is one and it is found
/// among at most `limit` sets of states. `negation` accepts the other words.
pub(super) fn minimal(
    graph: &Graph,
    negation: &Graph,
    letters: usize,
    limit: usize,
) -> Option<Buchi> {
    let sets = powerset(graph, letters, limit)?;
    let count = sets.component.iter().max().map_or(0, |&c| c as usize + 1);
    let verdicts: Vec<Option<bool>> = (0..count)
        .map(|c| sets.verdict(graph, letters, c as u32))
        .collect();
    let verdict = |q: usize| verdicts[sets.component[q] as usize];
    let accepted = sets.to_graph(|q| verdict(q) == Some(true));
    let rejected = sets.to_graph(|q| verdict(q) == Some(false));
    if share_a_word(&accepted, negation) || share_a_word(&rejected, graph) {
        return None;
    }
    let colors = sets.colors(&verdicts);
    Some(sets.minimize(&colors))
}

fn powerset(graph: &Graph, letters: usize, limit: usize) -> Option<Deterministic> {
    let all = Bits::all(letters);
    let mut number: HashMap<Vec<u32>, u32> = HashMap::from([(vec![0], 0)]);
    let mut members = vec![vec![0u32]];
    let mut edges: Vec<Vec<(u32, Bits)>> = Vec::new();
    while edges.len() < members.len() {
        if members.len() > limit {
            return None;
        }
        let here = members[edges.len()].clone();
        let out = here.iter().flat_map(|&q| &graph.edges[q as usize]);
        let mut row: Vec<(u32, Bits)> = Vec::new();
        for (guard, targets) in split(out, &all) {
            let target = *number.entry(targets.clone()).or_insert_with(|| {
                members.push(targets);
                members.len() as u32 - 1
            });
            match row.iter_mut().find(|(t, _)| *t == target) {
                Some((_, known)) => known.or_with(&guard),
                None => row.push((target, guard)),
            }
        }
        edges.push(row);
    }
    let component = scc::components(edges.len(), |q| edges[q].iter().map(|&(t, _)| t as usize));
    Some(Deterministic {
        members,
        edges,
        component,
    })
}

impl Deterministic {
    /// Whether a word that stays in component `c` is accepted; `None` if no word can.
    ///
    /// One word decides: if words of the component disagree, the automaton is not weak, and the
    /// comparison with the language fails.
    fn verdict(&self, graph: &Graph, letters: usize, c: u32) -> Option<bool> {
        let start = self.component.iter().position(|&of| of == c)?;
        let cycle = self.cycle(start)?;
        let lasso = Graph {
            marks: 0,
            edges: cycle
                .iter()
                .enumerate()
                .map(|(i, &letter)| {
                    let mut guard = Bits::none(letters);
                    guard.insert(letter);
                    let target = ((i + 1) % cycle.len()) as u32;
                    vec![Edge {
                        target,
                        marks: 0,
                        guard,
                    }]
                })
                .collect(),
        };
        let starts = self.members[start].iter().map(|&q| (q, 0));
        Some(share_a_word_from(graph, &lasso, starts))
    }

    /// The letters of a shortest cycle through `start`.
    fn cycle(&self, start: usize) -> Option<Vec<usize>> {
        let mut from: Vec<Option<(usize, usize)>> = vec![None; self.edges.len()];
        let mut queue = vec![start];
        let mut at = 0;
        while at < queue.len() && from[start].is_none() {
            let q = queue[at];
            at += 1;
            for (target, guard) in &self.edges[q] {
                let to = *target as usize;
                if self.component[to] == self.component[start] && from[to].is_none() {
                    from[to] = Some((q, guard.first()?));
                    queue.push(to);
                }
            }
        }
        let mut letters = Vec::new();
        let mut q = start;
        loop {
            let (before, letter) = from[q]?;
            letters.push(letter);
            q = before;
            if q == start {
                letters.reverse();
                return Some(letters);
            }
        }
    }

    fn to_graph(&self, accepting: impl Fn(usize) -> bool) -> Graph {
        let edges = self.edges.iter().enumerate().map(|(q, row)| {
            let marks = Marks::from(accepting(q));
            row.iter()
                .map(|(target, guard)| Edge {
                    target: *target,
                    marks,
                    guard: guard.clone(),
                })
                .collect()
        });
        Graph {
            marks: 1,
            edges: edges.collect(),
        }
    }

    /// Löding's colouring: even accepts, and states on no cycle take the colour that lets most merge.
    fn colors(&self, verdicts: &[Option<bool>]) -> Vec<u32> {
        let top = 2 * verdicts.len() as u32;
        let mut lowest = vec![u32::MAX; verdicts.len()];
        let mut order: Vec<usize> = (0..self.edges.len()).collect();
        order.sort_by_key(|&q| self.component[q]);
        let mut color = vec![0; verdicts.len()];
        for group in order.chunk_by(|&a, &b| self.component[a] == self.component[b]) {
            let c = self.component[group[0]] as usize;
            for &q in group {
                for (target, _) in &self.edges[q] {
                    let to = self.component[*target as usize] as usize;
                    if to != c {
                        lowest[c] = lowest[c].min(color[to]);
                    }
                }
            }
            let parity = |wanted: u32| match lowest[c] {
                u32::MAX => top + wanted,
                l => l - u32::from(l % 2 != wanted),
            };
            color[c] = match verdicts[c] {
                Some(true) => parity(0),
                Some(false) => parity(1),
                None => lowest[c],
            };
        }
        self.component.iter().map(|&c| color[c as usize]).collect()
    }

    /// Moore's partition refinement, from accepting and rejecting.
    fn minimize(&self, colors: &[u32]) -> Buchi {
        let n = self.edges.len();
        let mut class: Vec<u32> = colors.iter().map(|c| c % 2).collect();
        let mut count = 0;
        loop {
            let mut index: HashMap<(u32, Vec<(u32, Bits)>), u32> = HashMap::new();
            let next: Vec<u32> = (0..n)
                .map(|q| {
                    let fresh = index.len() as u32;
                    *index
                        .entry((class[q], merged(&self.edges[q], &class)))
                        .or_insert(fresh)
                })
                .collect();
            class = next;
            if index.len() == count {
                break;
            }
            count = index.len();
        }
        let mut result = Buchi {
            accepting: vec![false; count],
            edges: vec![Vec::new(); count],
        };
        for q in 0..n {
            let c = class[q] as usize;
            result.accepting[c] = colors[q].is_multiple_of(2);
            result.edges[c] = merged(&self.edges[q], &class);
        }
        result.trim();
        result
    }
}

/// The edges between classes.
fn merged(row: &[(u32, Bits)], class: &[u32]) -> Vec<(u32, Bits)> {
    let mut out: Vec<(u32, Bits)> = Vec::new();
    for (target, guard) in row {
        let to = class[*target as usize];
        match out.iter_mut().find(|(t, _)| *t == to) {
            Some((_, known)) => known.or_with(guard),
            None => out.push((to, guard.clone())),
        }
    }
    out.sort_unstable();
    out
}
