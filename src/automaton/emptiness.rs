//! Whether two automata accept a common word.
//!
//! Their product is made while it is searched, and the search ends with the first component in which a run can stay and
//! accept. Making an automaton smaller asks this of many candidates, most of which accept a wrong word soon.
//!
//! J.-M. Couvreur, "On-the-fly verification of linear temporal logic", FM 1999: depth first, with a stack of the
//! components found so far and the marks seen in each, which become one where an edge leads back to them.

use std::collections::HashMap;

use super::graph::{Graph, Marks, full};

/// A state of the product.
type Pair = (u32, u32);

/// Products of so many pairs of states are numbered in a table.
const TABLE: usize = 1 << 16;

/// Whether some word is accepted by both automata, which must be over the same letters.
pub(super) fn share_a_word(a: &Graph, b: &Graph) -> bool {
    let start = (a.len() > 0 && b.len() > 0).then_some((0, 0));
    share_a_word_from(a, b, start)
}

/// As [`share_a_word`], from one of several pairs of states.
pub(super) fn share_a_word_from(
    a: &Graph,
    b: &Graph,
    starts: impl IntoIterator<Item = Pair>,
) -> bool {
    let mut search = Search {
        graphs: [a, b],
        full: full(a.marks + b.marks),
        orders: Orders::new(a.len(), b.len()),
        entered: 0,
        live: Vec::new(),
        roots: Vec::new(),
        calls: Vec::new(),
    };
    starts.into_iter().any(|start| search.accepts(start))
}

struct Search<'g> {
    graphs: [&'g Graph; 2],
    /// The marks of both.
    full: Marks,
    orders: Orders,
    /// How many pairs were entered.
    entered: u32,
    /// Pairs of components that are not complete, in the order in which they were entered.
    live: Vec<Pair>,
    roots: Vec<Root>,
    calls: Vec<Call>,
}

/// A component as far as it is known: its pairs are those that are live from its first one to the next component's.
struct Root {
    /// The order of its first pair.
    order: u32,
    /// Where that stands among the live ones.
    at: usize,
    /// The marks of the edge that it was entered by, and of those inside.
    entering: Marks,
    inside: Marks,
}

/// A pair and the next edges of its two states to look at.
struct Call {
    pair: Pair,
    next: [usize; 2],
}

impl Search<'_> {
    /// Whether an accepting component can be reached from `start` by pairs that were not entered before.
    fn accepts(&mut self, start: Pair) -> bool {
        if self.orders.get(start) != Orders::NEW {
            return false;
        }
        self.enter(start, 0);
        while let Some(call) = self.calls.last_mut() {
            let pair = call.pair;
            match call.step(self.graphs) {
                Some((to, marks)) => match self.orders.get(to) {
                    Orders::NEW => self.enter(to, marks),
                    Orders::DONE => {}
                    order => {
                        if self.close(order, marks) {
                            return true;
                        }
                    }
                },
                None => {
                    self.calls.pop();
                    self.leave(pair);
                }
            }
        }
        false
    }

    fn enter(&mut self, pair: Pair, entering: Marks) {
        self.entered += 1;
        self.orders.set(pair, self.entered);
        self.roots.push(Root {
            order: self.entered,
            at: self.live.len(),
            entering,
            inside: 0,
        });
        self.live.push(pair);
        self.calls.push(Call { pair, next: [0; 2] });
    }

    /// An edge leads back to a live pair: components from that on are one. Whether a run accepts in it.
    fn close(&mut self, order: u32, marks: Marks) -> bool {
        let mut inside = marks;
        while let Some(root) = self.roots.pop_if(|root| root.order > order) {
            inside |= root.inside | root.entering;
        }
        let Some(root) = self.roots.last_mut() else {
            return false;
        };
        root.inside |= inside;
        root.inside == self.full
    }

    /// All that a pair leads to is known.
    fn leave(&mut self, pair: Pair) {
        let order = self.orders.get(pair);
        if let Some(root) = self.roots.pop_if(|root| root.order == order) {
            for done in self.live.drain(root.at..) {
                self.orders.set(done, Orders::DONE);
            }
        }
    }
}

impl Call {
    /// The next pair that a common letter leads to, and the marks of both edges.
    fn step(&mut self, [a, b]: [&Graph; 2]) -> Option<(Pair, Marks)> {
        let (p, q) = self.pair;
        let [i, j] = &mut self.next;
        while let Some(e) = a.edges[p as usize].get(*i) {
            while let Some(f) = b.edges[q as usize].get(*j) {
                *j += 1;
                if !e.guard.is_disjoint(&f.guard) {
                    return Some(((e.target, f.target), e.marks | f.marks << a.marks));
                }
            }
            (*i, *j) = (*i + 1, 0);
        }
        None
    }
}

/// For each pair when it was entered.
enum Orders {
    Table { width: usize, orders: Vec<u32> },
    Map(HashMap<Pair, u32>),
}

impl Orders {
    /// Of a pair that was not entered yet.
    const NEW: u32 = 0;
    /// Of a pair whose component is complete.
    const DONE: u32 = u32::MAX;

    fn new(height: usize, width: usize) -> Self {
        let pairs = height.saturating_mul(width);
        if pairs > TABLE {
            return Self::Map(HashMap::new());
        }
        let orders = vec![Self::NEW; pairs];
        Self::Table { width, orders }
    }

    fn get(&self, pair: Pair) -> u32 {
        match self {
            Self::Table { width, orders } => orders[pair.0 as usize * width + pair.1 as usize],
            Self::Map(orders) => orders.get(&pair).copied().unwrap_or(Self::NEW),
        }
    }

    fn set(&mut self, pair: Pair, order: u32) {
        match self {
            Self::Table { width, orders } => {
                orders[pair.0 as usize * *width + pair.1 as usize] = order;
            }
            Self::Map(orders) => {
                orders.insert(pair, order);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::Rng;

    use super::*;
    use crate::automaton::bits::Bits;
    use crate::automaton::graph::Edge;
    use crate::random::generator;

    const LETTERS: usize = 3;

    fn random_graph(random: &mut impl Rng) -> Graph {
        let mut below = |n: u32| random.next_u32() % n;
        let (states, marks) = (1 + below(5), below(3));
        let mut edge = || {
            let mut guard = Bits::none(LETTERS);
            guard.insert(below(LETTERS as u32) as usize);
            guard.insert(below(LETTERS as u32) as usize);
            Edge {
                target: below(states),
                marks: Marks::from(below(4)) & full(marks),
                guard,
            }
        };
        let edges = (0..states).map(|_| vec![edge(), edge()]).collect();
        Graph { marks, edges }
    }

    /// The definition: some component of the whole product holds an edge, and edges of every mark.
    fn by_components(a: &Graph, b: &Graph) -> bool {
        let width = b.len();
        let row = |n: usize| {
            let pairs = a.edges[n / width]
                .iter()
                .flat_map(move |e| b.edges[n % width].iter().map(move |f| (e, f)));
            let met = pairs.filter(|(e, f)| !e.guard.is_disjoint(&f.guard));
            met.map(|(e, f)| Edge {
                target: e.target * width as u32 + f.target,
                marks: e.marks | f.marks << a.marks,
                guard: Bits::all(LETTERS),
            })
        };
        let mut whole = Graph {
            marks: a.marks + b.marks,
            edges: (0..a.len() * width).map(|n| row(n).collect()).collect(),
        };
        whole.trim();
        whole.len() > 0
    }

    #[test]
    fn agrees_with_the_components_of_the_whole_product() {
        let mut random = generator(11, 0);
        let mut shared = 0;
        for _ in 0..5_000 {
            let (a, b) = (random_graph(&mut random), random_graph(&mut random));
            let expected = by_components(&a, &b);
            assert_eq!(share_a_word(&a, &b), expected, "{a:?} {b:?}");
            shared += u32::from(expected);
        }
        assert!((1_000..4_500).contains(&shared), "{shared}");
    }

    #[test]
    fn large_products_are_numbered_in_a_map() {
        let ring = |n: u32, marked: u32| Graph {
            marks: 1,
            edges: (0..n)
                .map(|q| {
                    vec![Edge {
                        target: (q + 1) % n,
                        marks: Marks::from(q == marked),
                        guard: Bits::all(LETTERS),
                    }]
                })
                .collect(),
        };
        assert!(share_a_word(&ring(300, 7), &ring(301, 9)));
        assert!(!share_a_word(&ring(300, 7), &ring(301, 400)));
        assert!(!share_a_word(&Graph::empty(), &ring(3, 0)));
    }
}
