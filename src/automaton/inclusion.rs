//! Whether one automaton accepts all that another does, and what follows from it.

use std::collections::{HashMap, HashSet};

use super::bits::Bits;
use super::graph::{Edge, Graph, unite};
use super::{Limits, Nba, TranslateError, scc};

/// What words of one behaviour do to the larger automaton: for each state the states they lead to, and
/// those they lead to past an accepting edge.
type Box64 = Vec<(u64, u64)>;

fn compose(x: &Box64, y: &Box64) -> Box64 {
    let gather = |set: u64, of: &dyn Fn(usize) -> u64| -> u64 {
        (0..y.len())
            .filter(|&j| set >> j & 1 == 1)
            .fold(0, |all, j| all | of(j))
    };
    x.iter()
        .map(|&(reach, accept)| {
            let on = gather(reach, &|j| y[j].0);
            let marked = gather(reach, &|j| y[j].1) | gather(accept, &|j| y[j].0);
            (on, marked)
        })
        .collect()
}

/// Whether repeating the box for ever from one of `starts` can pass accepting edges for ever.
fn repeats(cycle: &Box64, starts: u64) -> bool {
    let n = cycle.len();
    let bits = |set: u64| (0..n).filter(move |&j| set >> j & 1 == 1);
    let mut seen = starts;
    let mut todo: Vec<usize> = bits(starts).collect();
    while let Some(q) = todo.pop() {
        let new = cycle[q].0 & !seen;
        seen |= new;
        todo.extend(bits(new));
    }
    let of = scc::components(n, |q| bits(cycle[q].0));
    bits(seen).any(|q| bits(cycle[q].1).any(|t| of[t] == of[q]))
}

/// Whether every word of `small` is one of `large`; `None` if more than `limit` behaviours would have
/// to be told apart or `large` has more than 64 states. Both have at most one mark.
///
/// The Ramsey-based test of Fogarty and Vardi ("Efficient Büchi universality checking", TACAS 2010): a
/// counterexample is a lasso whose loop returns to a state of `small`; prefixes are told apart by the
/// states of `large` they reach, loops by their [`Box64`].
pub(super) fn includes(large: &Graph, small: &Graph, letters: usize, limit: usize) -> Option<bool> {
    if small.len() == 0 {
        return Some(true);
    }
    if large.len() > 64 {
        return None;
    }
    let (boxes, steps) = behaviours(large, small, letters);
    let components = small.components();
    let prefixes = prefixes(&boxes, &steps, large.len() > 0, limit)?;
    let mut budget = limit;
    for p in 0..small.len() {
        if !components.is_accepting(p) || prefixes[p].is_empty() {
            continue;
        }
        let inside = |q: usize| components.of[q] == components.of[p];
        // Loops that start with an accepting edge of p.
        let mut seen: HashSet<(usize, Box64)> = HashSet::new();
        let mut todo: Vec<(usize, Box64)> = Vec::new();
        for (k, step) in steps.iter().enumerate() {
            for &(to, marked) in &step[p] {
                if inside(to) && marked && seen.insert((to, boxes[k].clone())) {
                    todo.push((to, boxes[k].clone()));
                }
            }
        }
        while let Some((q, cycle)) = todo.pop() {
            if q == p && prefixes[p].iter().any(|&s| !repeats(&cycle, s)) {
                return Some(false);
            }
            budget = budget.checked_sub(1)?;
            for (k, step) in steps.iter().enumerate() {
                for &(to, _) in step[q].iter().filter(|s| inside(s.0)) {
                    let next = (to, compose(&cycle, &boxes[k]));
                    if seen.insert(next.clone()) {
                        todo.push(next);
                    }
                }
            }
        }
    }
    Some(true)
}

/// Steps of the smaller automaton on one kind of letter: for each state targets and marks.
type Steps = Vec<Vec<(usize, bool)>>;

/// The different things a letter can do: to `large` and to `small`.
fn behaviours(large: &Graph, small: &Graph, letters: usize) -> (Vec<Box64>, Vec<Steps>) {
    let mut index: HashSet<(Box64, Steps)> = HashSet::new();
    let (mut boxes, mut steps) = (Vec::new(), Vec::new());
    for letter in 0..letters {
        let reading = |e: &&Edge| e.guard.contains(letter);
        let of: Box64 = large
            .edges
            .iter()
            .map(|row| {
                row.iter()
                    .filter(reading)
                    .fold((0, 0), |(reach, accept), e| {
                        let bit = 1u64 << e.target;
                        let marked = e.marks == large.full();
                        (reach | bit, if marked { accept | bit } else { accept })
                    })
            })
            .collect();
        let step: Steps = small
            .edges
            .iter()
            .map(|row| {
                let to = |e: &Edge| (e.target as usize, e.marks == small.full());
                row.iter().filter(reading).map(to).collect()
            })
            .collect();
        if index.insert((of.clone(), step.clone())) {
            boxes.push(of);
            steps.push(step);
        }
    }
    (boxes, steps)
}

/// For each state of the smaller automaton the sets of states of the larger one that words leading to
/// it can lead to.
fn prefixes(boxes: &[Box64], steps: &[Steps], starts: bool, limit: usize) -> Option<Vec<Vec<u64>>> {
    let n = steps.first().map_or(1, Vec::len);
    let mut found: Vec<Vec<u64>> = vec![Vec::new(); n];
    let mut seen: HashSet<(usize, u64)> = HashSet::from([(0, u64::from(starts))]);
    let mut todo: Vec<(usize, u64)> = vec![(0, u64::from(starts))];
    while let Some((q, set)) = todo.pop() {
        found[q].push(set);
        if seen.len() > limit {
            return None;
        }
        for (k, step) in steps.iter().enumerate() {
            let of = &boxes[k];
            let next = (0..of.len())
                .filter(|&j| set >> j & 1 == 1)
                .fold(0, |all, j| all | of[j].0);
            for &(to, _) in &step[q] {
                if seen.insert((to, next)) {
                    todo.push((to, next));
                }
            }
        }
    }
    Some(found)
}

impl Nba {
    /// Whether every word that `other` accepts is accepted; both must be over the same alphabet.
    ///
    /// # Errors
    /// [`TranslateError::States`] if that would need more than [`Limits::states`] behaviours of words
    /// to be told apart, or this automaton has more than 64 states.
    pub fn includes(&self, other: &Self, limits: &Limits) -> Result<bool, TranslateError> {
        let (large, mut small) = (self.to_graph(), other.to_graph());
        small.trim();
        includes(&large, &small, self.alphabet.len(), limits.states).ok_or(TranslateError::States {
            limit: limits.states,
        })
    }

    /// Whether words that differ only in how often letters are repeated are accepted alike, as is needed
    /// where a path may cross a region in any number of steps. Formulas without X give such
    /// automata.
    ///
    /// The automaton is compared with its closure under repeating and contracting letters (Michaud and
    /// Duret-Lutz, "Practical stutter-invariance checks for ω-regular languages", SPIN 2015).
    ///
    /// # Errors
    /// As [`Self::includes`].
    pub fn is_stutter_invariant(&self, limits: &Limits) -> Result<bool, TranslateError> {
        let mut graph = self.to_graph();
        graph.trim();
        let (graph, letters) = by_kind(&graph, self.alphabet.len());
        let too_large = TranslateError::States {
            limit: limits.states,
        };
        let closed = closure(&graph, letters, limits).ok_or(too_large.clone())?;
        includes(&graph, &closed, letters, limits.states).ok_or(too_large)
    }
}

/// The automaton over one representative of each kind of letters that it cannot tell apart, and how
/// many kinds there are. Replacing letters by representatives keeps repetitions.
fn by_kind(graph: &Graph, letters: usize) -> (Graph, usize) {
    let edges = || graph.edges.iter().flatten();
    let mut index: HashMap<Vec<bool>, usize> = HashMap::new();
    let mut kind = Vec::with_capacity(letters);
    for letter in 0..letters {
        let behaviour: Vec<bool> = edges().map(|e| e.guard.contains(letter)).collect();
        let fresh = index.len();
        kind.push(*index.entry(behaviour).or_insert(fresh));
    }
    let mut result = graph.clone();
    for e in result.edges.iter_mut().flatten() {
        let mut guard = Bits::none(index.len());
        e.guard.iter().for_each(|l| guard.insert(kind[l]));
        e.guard = guard;
    }
    (result, index.len())
}

/// All words that differ from one of `graph`'s in repetitions alone; `None` if that takes too many
/// states.
fn closure(graph: &Graph, letters: usize, limits: &Limits) -> Option<Graph> {
    if graph.len() == 0 {
        return Some(Graph::empty());
    }
    let short = contracted(graph);
    // Repeating: the state remembers the letter just read and may read it again.
    let mut number: HashMap<(u32, Option<usize>), u32> = HashMap::from([((0, None), 0)]);
    let mut queue: Vec<(u32, Option<usize>)> = vec![(0, None)];
    let mut long = Graph {
        marks: short.marks,
        edges: Vec::new(),
    };
    while long.len() < queue.len() {
        if queue.len() > limits.states {
            return None;
        }
        let (state, last) = queue[long.len()];
        let mut row: Vec<Edge> = Vec::new();
        let mut step = |target: u32, marks, letter| {
            let mut guard = Bits::none(letters);
            guard.insert(letter);
            row.push(Edge {
                target,
                marks,
                guard,
            });
        };
        for e in &short.edges[state as usize] {
            for letter in e.guard.iter() {
                let next = (e.target, Some(letter));
                let target = *number.entry(next).or_insert_with(|| {
                    queue.push(next);
                    queue.len() as u32 - 1
                });
                step(target, e.marks, letter);
            }
        }
        if let Some(letter) = last {
            step(long.edges.len() as u32, 0, letter);
        }
        long.edges.push(unite(row));
    }
    Some(long)
}

/// With p -a-> q -a-> r also p -a-> r, with the marks of both.
fn contracted(graph: &Graph) -> Graph {
    let mut short = graph.clone();
    loop {
        let before = short.clone();
        for p in 0..short.len() {
            let mut row = short.edges[p].clone();
            for e in &short.edges[p] {
                for f in &short.edges[e.target as usize] {
                    let guard = e.guard.and(&f.guard);
                    if !guard.is_empty() {
                        row.push(Edge {
                            target: f.target,
                            marks: e.marks | f.marks,
                            guard,
                        });
                    }
                }
            }
            short.edges[p] = unite(row);
        }
        if short == before {
            return short;
        }
    }
}
