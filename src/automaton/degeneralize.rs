//! From marks on edges to accepting states.

use std::collections::HashMap;

use super::TranslateError;
use super::bits::Bits;
use super::buchi::Buchi;
use super::graph::{Graph, Marks};
use super::limits::Watch;

/// Copies each state of an accepting component once per mark that is waited for, in the order given
/// (a permutation of the marks); a copy that waits for none is accepting.
///
/// Marks are skipped several at a time (Gastin and Oddoux, CAV 2001, section 6), levels are forgotten
/// between components and never made outside accepting ones, and a mark that all edges of a state
/// carry counts on arrival (Babiak et al., "Compositional approach to suspension and other improvements
/// to LTL translation", SPIN 2013, section 4).
///
/// `skipped` marks, at most one less than there are, need not be waited for on the first round through an
/// accepting component: any level accepts the same words, and a high one accepts sooner.
pub(super) fn degeneralize(
    graph: &Graph,
    order: &[u32],
    skipped: u32,
    watch: &Watch<'_>,
) -> Result<Buchi, TranslateError> {
    if graph.len() == 0 {
        return Ok(Buchi {
            accepting: Vec::new(),
            edges: Vec::new(),
        });
    }
    let components = graph.components();
    let levels = order.len() as u32;
    let advance = |level: u32, marks: Marks| {
        let reached = |l: u32| marks >> order[l as usize] & 1 == 1;
        (level..levels).find(|&l| !reached(l)).unwrap_or(levels)
    };
    let common: Vec<Marks> = (0..graph.len())
        .map(|q| {
            graph.edges[q]
                .iter()
                .filter(|e| components.of[e.target as usize] == components.of[q])
                .fold(graph.full(), |all, e| all & e.marks)
        })
        .collect();
    // The level on arrival in `q` when `level` was reached on the way.
    let arrive = |q: usize, level: u32| {
        if components.is_accepting(q) {
            advance(level, common[q])
        } else {
            0
        }
    };
    let mut number: HashMap<(usize, u32), u32> = HashMap::new();
    let mut queue = vec![(0, arrive(0, skipped))];
    number.insert(queue[0], 0);
    let mut result = Buchi {
        accepting: Vec::new(),
        edges: Vec::new(),
    };
    let mut transitions = 0;
    while result.len() < queue.len() {
        let (q, level) = queue[result.len()];
        let from = if level == levels { 0 } else { level };
        let mut row: Vec<(u32, Bits)> = Vec::new();
        for e in &graph.edges[q] {
            let to = e.target as usize;
            let inside = components.of[to] == components.of[q] && components.is_accepting(q);
            let next = (
                to,
                arrive(
                    to,
                    if inside {
                        advance(from, e.marks)
                    } else {
                        skipped
                    },
                ),
            );
            let target = *number.entry(next).or_insert_with(|| {
                queue.push(next);
                queue.len() as u32 - 1
            });
            match row.iter_mut().find(|(t, _)| *t == target) {
                Some((_, guard)) => guard.or_with(&e.guard),
                None => row.push((target, e.guard.clone())),
            }
        }
        row.sort_unstable_by_key(|&(t, _)| t);
        transitions += row.len();
        result.edges.push(row);
        result
            .accepting
            .push(components.is_accepting(q) && level == levels);
        watch.check(queue.len(), transitions)?;
    }
    Ok(result)
}
