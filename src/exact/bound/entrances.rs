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

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::Vector2;

use super::Gates;
use super::product::{Leg, Product};
use crate::shorten::star_point;

/// λ up to which the first bound holds, with some room.
const MAX_WEIGHT: f64 = 0.65;

/// Ways into a letter in a state from which the suffix can go on.
struct Arrivals {
    /// With the gates, the shortest first, each gate once.
    ways: Vec<(f64, usize)>,
    /// For each gate, the least length of a way by some of these; not a number if it was not asked for.
    onward: RefCell<Vec<f64>>,
}

/// Ways into the letters of a mission.
pub(super) struct Entrances<'g> {
    gates: &'g Gates,
    weight: f64,
    /// For each letter: lengths from the start, gates, and the states that may be entered in.
    ways: Vec<Vec<(f64, usize, u64)>>,
    /// By letter and states.
    arrivals: RefCell<HashMap<(usize, u64), Rc<Arrivals>>>,
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
            ways,
            arrivals: RefCell::default(),
        }
    }

    fn arrivals(&self, letter: usize, states: u64) -> Rc<Arrivals> {
        let mut known = self.arrivals.borrow_mut();
        let new = || {
            let mut seen = vec![false; self.gates.gates.len()];
            let mut ways = Vec::new();
            for &(length, gate, mine) in &self.ways[letter] {
                if mine & states != 0 && !std::mem::replace(&mut seen[gate], true) {
                    ways.push((length, gate));
                }
            }
            let onward = RefCell::new(vec![f64::NAN; self.gates.gates.len()]);
            Rc::new(Arrivals { ways, onward })
        };
        Rc::clone(known.entry((letter, states)).or_insert_with(new))
    }

    /// The least length of a prefix that enters a letter in one of some states.
    pub(super) fn nearest(&self, letter: usize, states: u64) -> f64 {
        let arrivals = self.arrivals(letter, states);
        arrivals.ways.first().map_or(f64::INFINITY, |w| w.0)
    }

    /// The least length of a way into a letter and on in it to a gate.
    fn onward(&self, letter: usize, arrivals: &Arrivals, gate: usize) -> f64 {
        let known = arrivals.onward.borrow()[gate];
        if !known.is_nan() {
            return known;
        }
        let mut least = f64::INFINITY;
        for &(length, from) in &arrivals.ways {
            if length >= least {
                break;
            }
            least = least.min(length + self.gates.known(letter, from, gate));
        }
        arrivals.onward.borrow_mut()[gate] = least;
        least
    }

    /// What a leg of a suffix and the prefix that enters on it cost at least; soon found.
    pub(super) fn rough(&self, product: &Product<'_>, leg: &Leg) -> f64 {
        let (from, to) = (
            &product.nodes[leg.from as usize],
            &product.nodes[leg.to as usize],
        );
        let arrivals = self.arrivals(from.letter, product.entered_in(leg));
        let Some(&(nearest, _)) = arrivals.ways.first() else {
            return f64::INFINITY;
        };
        let mut prefix = nearest;
        if self.weight > 0.0 && self.weight <= MAX_WEIGHT {
            let there = self.onward(from.letter, &arrivals, from.gate);
            let there = there + self.onward(from.letter, &arrivals, to.gate);
            prefix = prefix.max((there - leg.length) / 2.0);
        }
        self.total(prefix, leg.length)
    }

    /// The same for a leg of this length between two gates, as well as it can be found.
    pub(super) fn exact(
        &self,
        letter: usize,
        states: u64,
        [g, h]: [usize; 2],
        length: f64,
    ) -> f64 {
        let arrivals = self.arrivals(letter, states);
        let mut best = f64::INFINITY;
        for &(way, w) in &arrivals.ways {
            let least = self.total(way, length);
            if least >= best {
                break;
            }
            let mut through = least;
            if self.weight > 0.0 && self.weight <= MAX_WEIGHT {
                let known = |gate| self.gates.known(letter, w, gate);
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
