//! What it costs at least to enter a suffix on one of its legs.
//!
//! The suffix goes from gate g to gate h in one letter, c at least, and is entered at e on that leg. The prefix
//! comes into the letter by some gate w, D at least from the start, and goes on to e. Whatever e is:
//!
//! - with t from g to e and u from e to h, the way from w to e is d(w, g) − t and d(w, h) − u at least, and so
//!   (d(w, g) + d(w, h) − (t + u)) / 2. If t + u is more than c, by s, the suffix costs (1 − λ)·s more and the
//!   prefix at most λ·s / 2 less: for λ ≤ 2/3 the sum is least at t + u = c.
//! - λ·|w e| + (1 − λ)·(|g e| + |e h|) is least where the three balance, in straight lines, between the middles
//!   of the gates; no point of a gate is further from its middle than half its length.

use std::cell::{OnceCell, RefCell};

use nalgebra::Vector2;

use super::Gates;
use super::product::Product;
use crate::shorten::star_point;

/// λ up to which the first bound holds, with some room.
const MAX_WEIGHT: f64 = 0.65;

/// Up to so many gates, what is known of all pairs is kept in tables.
const MAX_TABLE: usize = 2_000;

/// Ways into a letter in a state from which the suffix can go on.
#[derive(Debug)]
pub(super) struct Arrivals {
    letter: usize,
    /// With the gates, the shortest first, each gate once.
    ways: Vec<(f64, usize)>,
    /// For each gate, the least length of a way by some of these; not a number if it was not asked for.
    onward: RefCell<Vec<f64>>,
}

impl Arrivals {
    /// The least length of them.
    pub(super) fn nearest(&self) -> f64 {
        self.ways.first().map_or(f64::INFINITY, |w| w.0)
    }
}

/// Ways into the letters of a mission.
pub(super) struct Entrances<'g> {
    gates: &'g Gates,
    weight: f64,
    /// For each letter: lengths from the start, gates, and the states that may be entered in.
    ways: Vec<Vec<(f64, usize, u64)>>,
    /// By the classes of legs.
    classes: Vec<(usize, u64)>,
    arrivals: Vec<OnceCell<Arrivals>>,
    /// By letter and pair of gates, what is known of the leg between them.
    known: RefCell<Vec<Vec<f64>>>,
}

impl<'g> Entrances<'g> {
    pub(super) fn new(gates: &'g Gates, product: &Product<'_>, from_start: &[f64]) -> Self {
        let mut ways = vec![Vec::new(); product.letters.len()];
        for (node, &length) in product.nodes.iter().zip(from_start) {
            if length.is_finite() {
                let states = product.reads[node.letter][node.state as usize];
                ways[node.letter].push((length, node.gate, states));
            }
        }
        for row in &mut ways {
            row.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        Self {
            gates,
            weight: product.weight,
            known: RefCell::new(vec![Vec::new(); ways.len()]),
            ways,
            arrivals: product.classes.iter().map(|_| OnceCell::new()).collect(),
            classes: product.classes.clone(),
        }
    }

    /// The ways into a letter that lead to one of some states.
    pub(super) fn into(&self, letter: usize, states: u64) -> Arrivals {
        let mut seen = vec![false; self.gates.gates.len()];
        let mut ways = Vec::new();
        for &(length, gate, mine) in &self.ways[letter] {
            if mine & states != 0 && !std::mem::replace(&mut seen[gate], true) {
                ways.push((length, gate));
            }
        }
        let onward = RefCell::new(vec![f64::NAN; seen.len()]);
        Arrivals {
            letter,
            ways,
            onward,
        }
    }

    /// The ways to where a suffix can be entered on legs of a class.
    pub(super) fn of_class(&self, class: u32) -> &Arrivals {
        let (letter, states) = self.classes[class as usize];
        self.arrivals[class as usize].get_or_init(|| self.into(letter, states))
    }

    /// As [`Gates::known`], found once for each pair.
    pub(super) fn known(&self, letter: usize, g: usize, h: usize) -> f64 {
        let count = self.gates.gates.len();
        if count > MAX_TABLE {
            return self.gates.known(letter, g, h);
        }
        let mut tables = self.known.borrow_mut();
        let table = &mut tables[letter];
        if table.is_empty() {
            *table = vec![f64::NAN; count * count];
        }
        let i = g.min(h) * count + g.max(h);
        if table[i].is_nan() {
            table[i] = self.gates.known(letter, g, h);
        }
        table[i]
    }

    /// The least length of a way into a letter and on in it to a gate.
    fn onward(&self, arrivals: &Arrivals, gate: usize) -> f64 {
        let known = arrivals.onward.borrow()[gate];
        if !known.is_nan() {
            return known;
        }
        let mut least = f64::INFINITY;
        for &(length, from) in &arrivals.ways {
            if length >= least {
                break;
            }
            least = least.min(length + self.known(arrivals.letter, from, gate));
        }
        arrivals.onward.borrow_mut()[gate] = least;
        least
    }

    /// What a leg of a suffix between two gates and the prefix that enters on it cost at least; soon found.
    pub(super) fn rough(&self, arrivals: &Arrivals, [g, h]: [usize; 2], length: f64) -> f64 {
        let mut prefix = arrivals.nearest();
        if !prefix.is_finite() {
            return f64::INFINITY;
        }
        if self.weight > 0.0 && self.weight <= MAX_WEIGHT {
            let there = self.onward(arrivals, g) + self.onward(arrivals, h);
            prefix = prefix.max((there - length) / 2.0);
        }
        self.total(prefix, length)
    }

    /// The same as well as it can be found; `limit` if it is that or more.
    pub(super) fn exact(
        &self,
        arrivals: &Arrivals,
        [g, h]: [usize; 2],
        length: f64,
        limit: f64,
    ) -> f64 {
        let mut best = limit;
        for &(way, w) in &arrivals.ways {
            let least = self.total(way, length);
            if least >= best {
                break;
            }
            let mut through = least;
            if self.weight > 0.0 && self.weight <= MAX_WEIGHT {
                let known = |gate| self.known(arrivals.letter, w, gate);
                let joined = way + (known(g) + known(h) - length) / 2.0;
                through = through.max(self.total(joined, length));
            }
            if through < best {
                through = through.max(self.weight * way + self.star(w, g, h));
            }
            best = best.min(through);
        }
        best
    }

    fn total(&self, prefix: f64, suffix: f64) -> f64 {
        // A share of nothing costs nothing, even of an infinite length.
        let part = |share: f64, length: f64| if share > 0.0 { share * length } else { 0.0 };
        part(self.weight, prefix) + part(1.0 - self.weight, suffix)
    }

    /// The least of λ·|w e| + (1 − λ)·(|g e| + |e h|) over all points e of the plane. What the iteration
    /// finds is not quite the least, but by convexity that is no further below than the slope there times the
    /// distance to the best point, which lies in the triangle, too.
    fn star(&self, w: usize, g: usize, h: usize) -> f64 {
        let legs = [w, g, h].map(|i| self.gates.gates[i]);
        let ends = legs.map(|gate| gate.middle());
        let rest = 1.0 - self.weight;
        let weights = [self.weight, rest, rest];
        let at = star_point(ends, weights);
        let mut slope = Vector2::zeros();
        let (mut value, mut held, mut widest) = (0.0, 0.0, 0.0_f64);
        for (gate, (end, weight)) in legs.iter().zip(ends.iter().zip(weights)) {
            let off = at - end;
            value += weight * (off.norm() - gate.length() / 2.0);
            widest = widest.max(off.norm());
            if off.norm() > 0.0 {
                slope += off * (weight / off.norm());
            } else {
                held += weight;
            }
        }
        value - (slope.norm() - held).max(0.0) * 2.0 * widest
    }
}
