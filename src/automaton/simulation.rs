//! Direct simulation: states that can be merged and edges that are not needed.
//!
//! `p ≤ q` if every edge of p can be answered by edges of q on the same letters, with at least the
//! same marks, to targets that are again related. Then q accepts all that p does, states related both
//! ways can be merged, and an edge beside a better one can go (Etessami and Holzmann, CONCUR 2000;
//! Bustan and Grumberg, "Simulation-based minimization", TOCL 4 (2003), "little brothers"). The same
//! read backwards merges states with equal pasts. Guards range over the letters that occur, so
//! what differs only on other letters is equal here.

use std::collections::{HashMap, VecDeque};

use super::bits::Bits;
use super::graph::{Edge, Graph, Marks, unite};

/// Above this many edges the relation is not computed: it takes the square of them.
const MAX_EDGES: usize = 3_000;

/// Merges and removes until nothing changes. `labels` (one set of marks per state, or none) must be
/// respected: only states whose labels contain p's can simulate p, and merged states have equal ones.
pub(super) fn reduce(graph: &mut Graph, labels: &mut Vec<Marks>) {
    loop {
        let before = (graph.len(), graph.edge_count());
        merge_bisimilar(graph, labels);
        if graph.edge_count() > MAX_EDGES || graph.len() < 2 {
            return;
        }
        forward(graph, labels);
        backward(graph, labels);
        if (graph.len(), graph.edge_count()) == before {
            return;
        }
    }
}

/// Merges states with the same edges up to merged targets, by partition refinement.
fn merge_bisimilar(graph: &mut Graph, labels: &mut Vec<Marks>) {
    let n = graph.len();
    let mut class: Vec<u32> = vec![0; n];
    let mut count = 0;
    loop {
        let mut index: HashMap<(u32, Marks, Vec<Edge>), u32> = HashMap::new();
        let next: Vec<u32> = (0..n)
            .map(|q| {
                let row = graph.edges[q].iter().map(|e| Edge {
                    target: class[e.target as usize],
                    ..e.clone()
                });
                let key = (class[q], labels[q], unite(row.collect()));
                let fresh = index.len() as u32;
                *index.entry(key).or_insert(fresh)
            })
            .collect();
        let found = index.len();
        class = next;
        if found == count {
            break;
        }
        count = found;
    }
    if count < n {
        merge(graph, labels, &class, count);
    }
}

/// Makes one state of each class. Classes are numbered by their first members.
fn merge(graph: &mut Graph, labels: &mut Vec<Marks>, class: &[u32], count: usize) {
    let mut edges: Vec<Vec<Edge>> = vec![Vec::new(); count];
    let mut merged = vec![0; count];
    for (q, row) in graph.edges.iter_mut().enumerate() {
        let c = class[q] as usize;
        merged[c] = labels[q];
        edges[c].extend(std::mem::take(row).into_iter().map(|e| Edge {
            target: class[e.target as usize],
            ..e
        }));
    }
    graph.edges = edges.into_iter().map(unite).collect();
    *labels = merged;
}

/// For each state the states that simulate it.
///
/// Pairs are struck out until the rest is a simulation; only pairs that lead to a pair struck out
/// are looked at again.
fn relation(edges: &[Vec<Edge>], allowed: impl Fn(usize, usize) -> bool) -> Vec<Bits> {
    let n = edges.len();
    let mut above = vec![Bits::all(n); n];
    let mut before: Vec<Vec<usize>> = vec![Vec::new(); n];
    for (p, row) in edges.iter().enumerate() {
        for e in row {
            let sources = &mut before[e.target as usize];
            if sources.last() != Some(&p) {
                sources.push(p);
            }
        }
    }
    let answered =
        |p: usize, q: usize, above: &[Bits]| edges[p].iter().all(|e| answers(&edges[q], e, above));
    // First in, first out: by the time a pair is looked at again, most of what can be struck out
    // below it has been.
    let mut queue: VecDeque<(usize, usize)> = VecDeque::new();
    let mut queued = vec![Bits::all(n); n];
    for p in 0..n {
        queue.extend((0..n).filter(|&q| q != p).map(|q| (p, q)));
    }
    while let Some((p, q)) = queue.pop_front() {
        queued[p].remove(q);
        if !above[p].contains(q) || allowed(p, q) && answered(p, q, &above) {
            continue;
        }
        above[p].remove(q);
        for &p in &before[p] {
            for &q in before[q].iter().filter(|&&q| q != p) {
                if above[p].contains(q) && !queued[p].contains(q) {
                    queued[p].insert(q);
                    queue.push_back((p, q));
                }
            }
        }
    }
    above
}

/// Whether the edges of `row` together answer `edge`.
fn answers(row: &[Edge], edge: &Edge, above: &[Bits]) -> bool {
    let targets = &above[edge.target as usize];
    let mut open = edge.guard.clone();
    for f in row {
        if edge.marks & !f.marks == 0 && targets.contains(f.target as usize) {
            open.minus_with(&f.guard);
            if open.is_empty() {
                return true;
            }
        }
    }
    false
}

/// The classes of the relation: for each state the number of its class, and how many there are.
fn classes(above: &[Bits]) -> (Vec<u32>, usize) {
    let n = above.len();
    let mut class = vec![u32::MAX; n];
    let mut count = 0;
    for p in 0..n {
        if class[p] != u32::MAX {
            continue;
        }
        for q in above[p].iter() {
            if above[q].contains(p) {
                class[q] = count;
            }
        }
        count += 1;
    }
    (class, count as usize)
}

/// The relation between classes.
fn lift(above: &[Bits], class: &[u32], count: usize) -> Vec<Bits> {
    let mut lifted = vec![Bits::none(count); count];
    for (p, row) in above.iter().enumerate() {
        for q in row.iter() {
            lifted[class[p] as usize].insert(class[q] as usize);
        }
    }
    lifted
}

fn forward(graph: &mut Graph, labels: &mut Vec<Marks>) {
    let above = relation(&graph.edges, |p, q| labels[p] & !labels[q] == 0);
    let (class, count) = classes(&above);
    merge(graph, labels, &class, count);
    let above = lift(&above, &class, count);
    for row in &mut graph.edges {
        prune(row, |e, f| {
            e.marks & !f.marks == 0 && above[e.target as usize].contains(f.target as usize)
        });
    }
    drop_unreachable(graph, labels);
}

fn backward(graph: &mut Graph, labels: &mut Vec<Marks>) {
    let reversed = reverse(&graph.edges);
    // Only the initial state can stand for the initial state.
    let above = relation(&reversed, |p, q| {
        (p != 0 || q == 0) && labels[p] & !labels[q] == 0
    });
    let (class, count) = classes(&above);
    merge(graph, labels, &class, count);
    let above = lift(&above, &class, count);
    let mut reversed = reverse(&graph.edges);
    for row in &mut reversed {
        prune(row, |e, f| {
            e.marks & !f.marks == 0 && above[e.target as usize].contains(f.target as usize)
        });
    }
    graph.edges = reverse(&reversed);
    drop_unreachable(graph, labels);
}

fn reverse(edges: &[Vec<Edge>]) -> Vec<Vec<Edge>> {
    let mut reversed: Vec<Vec<Edge>> = vec![Vec::new(); edges.len()];
    for (q, row) in edges.iter().enumerate() {
        for e in row {
            reversed[e.target as usize].push(Edge {
                target: q as u32,
                ..e.clone()
            });
        }
    }
    reversed.into_iter().map(unite).collect()
}

/// Takes from each edge the letters on which another edge of the row is at least as good.
fn prune(row: &mut Vec<Edge>, better: impl Fn(&Edge, &Edge) -> bool) {
    for i in 0..row.len() {
        for j in 0..row.len() {
            // Of two that are as good as each other the first stays.
            if i != j && better(&row[i], &row[j]) && !(i < j && better(&row[j], &row[i])) {
                let taken = row[j].guard.clone();
                row[i].guard.minus_with(&taken);
            }
        }
    }
    row.retain(|e| !e.guard.is_empty());
}

fn drop_unreachable(graph: &mut Graph, labels: &mut Vec<Marks>) {
    let mut number = vec![u32::MAX; graph.len()];
    number[0] = 0;
    let mut queue = vec![0usize];
    let mut at = 0;
    while at < queue.len() {
        for e in &graph.edges[queue[at]] {
            if number[e.target as usize] == u32::MAX {
                number[e.target as usize] = queue.len() as u32;
                queue.push(e.target as usize);
            }
        }
        at += 1;
    }
    *labels = queue.iter().map(|&q| labels[q]).collect();
    let mut edges: Vec<Vec<Edge>> = Vec::with_capacity(queue.len());
    for &q in &queue {
        let mut row = std::mem::take(&mut graph.edges[q]);
        for e in &mut row {
            e.target = number[e.target as usize];
        }
        edges.push(unite(row));
    }
    graph.edges = edges;
}
