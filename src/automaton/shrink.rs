//! Merging states that no relation shows to be alike, as long as the language stays.
//!
//! Merging two states of a Büchi automaton can only add words. Whether it does is decided exactly by
//! the product with an automaton of the negated formula: if that is empty, nothing was added. On the
//! small automata that reductions leave this costs little and finds more than any simulation does.

use super::bits::Bits;
use super::buchi::Buchi;
use super::emptiness::share_a_word;
use super::graph::Graph;

/// The total number of pairs of edges that may be looked at; beyond it states stay apart. Counted, not
/// timed, so that results do not depend on the machine.
const WORK: usize = 1_000_000;

/// Merges pairs of states while no word of `negation` becomes accepted.
pub(super) fn shrink(buchi: &mut Buchi, negation: &Graph) {
    let mut work = WORK;
    let mut pair = (0, 1);
    let mut tried = 0;
    while buchi.len() > 1 && tried < buchi.len() * (buchi.len() - 1) / 2 {
        let cost = 1 + buchi.edge_count() * negation.edge_count();
        if cost > work {
            return;
        }
        work -= cost;
        let (p, q) = pair;
        let mut candidate = merged(buchi, p, q);
        if !share_a_word(&candidate.to_graph(), negation) {
            candidate.trim();
            candidate.reduce();
            *buchi = candidate;
            pair = (0, 1);
            tried = 0;
            continue;
        }
        tried += 1;
        pair = if q + 1 < buchi.len() {
            (p, q + 1)
        } else {
            (p + 1, p + 2)
        };
    }
}

/// The automaton in which `q` is `p`.
fn merged(buchi: &Buchi, p: usize, q: usize) -> Buchi {
    let number = |t: u32| match t as usize {
        t if t == q => p as u32,
        t if t > q => t as u32 - 1,
        t => t as u32,
    };
    let mut accepting = buchi.accepting.clone();
    accepting[p] |= accepting[q];
    accepting.remove(q);
    let mut rows: Vec<Vec<(u32, Bits)>> = buchi.edges.clone();
    let removed = rows.remove(q);
    rows[p].extend(removed);
    for row in &mut rows {
        for edge in row.iter_mut() {
            edge.0 = number(edge.0);
        }
        row.sort_by_key(|e| e.0);
        row.dedup_by(|e, kept| {
            let same = e.0 == kept.0;
            if same {
                kept.1.or_with(&e.1);
            }
            same
        });
    }
    Buchi {
        accepting,
        edges: rows,
    }
}
