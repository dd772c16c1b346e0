//! Automata on the way: transition-based generalised Büchi automata over letter classes.

use super::bits::Bits;
use super::scc;

/// A set of acceptance marks, one bit each.
pub(super) type Marks = u64;

/// The most acceptance marks an automaton can have; products with one of few marks still fit.
pub(super) const MAX_MARKS: usize = 60;

/// An edge of a [`Graph`].
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub(super) struct Edge {
    pub(super) target: u32,
    pub(super) marks: Marks,
    pub(super) guard: Bits,
}

/// An automaton with one initial state that accepts a word if some run of it takes edges of every
/// mark infinitely often. State 0 is initial; without states it accepts nothing.
///
/// A Büchi automaton with accepting *states* is the case of one mark that stands on all edges of a
/// state or on none.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Graph {
    pub(super) marks: u32,
    pub(super) edges: Vec<Vec<Edge>>,
}

impl Graph {
    /// The automaton that accepts nothing.
    pub(super) fn empty() -> Self {
        Self {
            marks: 0,
            edges: Vec::new(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.edges.len()
    }

    pub(super) fn edge_count(&self) -> usize {
        self.edges.iter().map(Vec::len).sum()
    }

    /// All marks.
    pub(super) fn full(&self) -> Marks {
        full(self.marks)
    }

    /// The strongly connected components, and for each whether a run can stay in it and accept.
    pub(super) fn components(&self) -> Components {
        let of = scc::components(self.len(), |q| {
            self.edges[q].iter().map(|e| e.target as usize)
        });
        let count = of.iter().map(|&c| c as usize + 1).max().unwrap_or(0);
        let mut seen: Vec<Option<Marks>> = vec![None; count];
        for (q, edges) in self.edges.iter().enumerate() {
            for e in edges.iter().filter(|e| of[e.target as usize] == of[q]) {
                *seen[of[q] as usize].get_or_insert(0) |= e.marks;
            }
        }
        let full = self.full();
        let accepting = seen.iter().map(|&m| m == Some(full)).collect();
        Components { of, accepting }
    }

    /// Keeps the states that are reachable and from which some word is accepted; numbers them in
    /// breadth-first order; unites edges that differ in their guards alone.
    pub(super) fn trim(&mut self) -> Components {
        let components = self.components();
        let n = self.len();
        let mut useful = vec![false; components.accepting.len()];
        // Components are numbered so that edges never lead to a larger number.
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|&q| components.of[q]);
        for q in order {
            let c = components.of[q] as usize;
            useful[c] |= components.accepting[c]
                || self.edges[q]
                    .iter()
                    .any(|e| useful[components.of[e.target as usize] as usize]);
        }
        let keep = |q: u32| useful[components.of[q as usize] as usize];
        if n == 0 || !keep(0) {
            *self = Self::empty();
            return self.components();
        }
        let mut number = vec![u32::MAX; n];
        number[0] = 0;
        let mut queue = vec![0u32];
        let mut at = 0;
        while at < queue.len() {
            for e in &self.edges[queue[at] as usize] {
                if keep(e.target) && number[e.target as usize] == u32::MAX {
                    number[e.target as usize] = queue.len() as u32;
                    queue.push(e.target);
                }
            }
            at += 1;
        }
        let mut edges = Vec::with_capacity(queue.len());
        for &q in &queue {
            let mut row = std::mem::take(&mut self.edges[q as usize]);
            row.retain(|e| keep(e.target) && !e.guard.is_empty());
            for e in &mut row {
                e.target = number[e.target as usize];
            }
            edges.push(unite(row));
        }
        self.edges = edges;
        Components {
            of: queue.iter().map(|&q| components.of[q as usize]).collect(),
            accepting: components.accepting,
        }
    }

    /// Clears marks that no run can use (between components and in rejecting ones), and in every
    /// accepting component renumbers those that matter from 0, full marks standing for the rest.
    ///
    /// Duret-Lutz, "LTL translation improvements in Spot 1.0", section 6.2, does this for single
    /// components too.
    pub(super) fn tidy_marks(&mut self) {
        let components = self.components();
        let mut lists: Vec<Vec<Marks>> = vec![Vec::new(); components.accepting.len()];
        for (c, list) in lists.iter_mut().enumerate() {
            if components.accepting[c] {
                *list = self.needed_marks(&components, c as u32);
            }
        }
        // A component that rejects needs a mark to lack.
        let rejecting = (0..self.len()).any(|q| {
            let inside = |e: &Edge| components.of[e.target as usize] == components.of[q];
            !components.is_accepting(q) && self.edges[q].iter().any(inside)
        });
        let most = lists.iter().map(Vec::len).max().unwrap_or(0) as u32;
        let most = most.max(u32::from(rejecting));
        let full = full(most);
        for q in 0..self.len() {
            let c = components.of[q];
            for e in &mut self.edges[q] {
                let inside = components.of[e.target as usize] == c;
                if !inside || !components.accepting[c as usize] {
                    e.marks = 0;
                    continue;
                }
                let list = &lists[c as usize];
                let mut marks = full & !self::full(list.len() as u32);
                for (i, &mark) in list.iter().enumerate() {
                    if e.marks & mark != 0 {
                        marks |= 1 << i;
                    }
                }
                e.marks = marks;
            }
        }
        self.marks = most;
        for row in &mut self.edges {
            *row = unite(std::mem::take(row));
        }
    }

    /// The marks of a component that no other mark of it implies, each as a bit, in ascending order.
    fn needed_marks(&self, components: &Components, c: u32) -> Vec<Marks> {
        let mut seen: Vec<Marks> = Vec::new();
        for q in (0..self.len()).filter(|&q| components.of[q] == c) {
            for e in &self.edges[q] {
                if components.of[e.target as usize] == c && !seen.contains(&e.marks) {
                    seen.push(e.marks);
                }
            }
        }
        // Mark i is implied by j if every edge with j has i.
        let implied = |i: Marks, j: Marks| seen.iter().all(|m| m & j == 0 || m & i != 0);
        let all: Vec<Marks> = (0..self.marks).map(|i| 1 << i).collect();
        let mut needed: Vec<Marks> = Vec::new();
        for &i in &all {
            let everywhere = seen.iter().all(|m| m & i != 0);
            let dropped = all
                .iter()
                .any(|&j| j != i && implied(i, j) && (!implied(j, i) || j < i));
            if !everywhere && !dropped {
                needed.push(i);
            }
        }
        needed
    }
}

/// The first `count` marks.
pub(super) fn full(count: u32) -> Marks {
    if count == 0 {
        0
    } else {
        Marks::MAX >> (Marks::BITS - count)
    }
}

/// Sorts edges and unites those with equal targets and marks.
pub(super) fn unite(mut row: Vec<Edge>) -> Vec<Edge> {
    row.sort_unstable_by_key(|e| (e.target, e.marks));
    row.dedup_by(|e, kept| {
        let same = e.target == kept.target && e.marks == kept.marks;
        if same {
            kept.guard.or_with(&e.guard);
        }
        same
    });
    row
}

/// The strongly connected components of a [`Graph`].
pub(super) struct Components {
    /// For each state its component. An edge never leads to a component of a larger number.
    pub(super) of: Vec<u32>,
    /// For each component whether a run can stay in it and accept.
    pub(super) accepting: Vec<bool>,
}

impl Components {
    pub(super) fn is_accepting(&self, state: usize) -> bool {
        self.accepting[self.of[state] as usize]
    }
}
