//! Implication between formulas, as far as their syntax shows it.
//!
//! After Somenzi and Bloem, "Efficient Büchi automata from LTL formulae", CAV 2000, section 3, with
//! the pure eventuality and universality classes of Etessami and Holzmann added.

use super::{Arena, Id, Node};

impl Arena {
    /// Whether every word of `a` is one of `b`; `false` means "not shown".
    pub(in crate::automaton) fn implies(&mut self, a: Id, b: Id) -> bool {
        if a == b || a == Id::FALSE || b == Id::TRUE {
            return true;
        }
        if a == Id::TRUE || b == Id::FALSE {
            return false;
        }
        if let Some(&known) = self.implications.get(&(a, b)) {
            return known;
        }
        if !self.spend(1) {
            return false;
        }
        let holds = self.implied_by_left(a, b) || self.implied_by_right(a, b);
        self.implications.insert((a, b), holds);
        holds
    }

    /// Whether no word satisfies both, as far as the syntax shows it.
    pub(in crate::automaton) fn contradicts(&mut self, a: Id, b: Id) -> bool {
        let not_b = self.negate(b);
        self.implies(a, not_b)
    }

    /// Takes `a` apart.
    fn implied_by_left(&mut self, a: Id, b: Id) -> bool {
        let eventual = self.is_eventual(b);
        match self.node(a).clone() {
            Node::Letters(set) => self.as_letters(b).is_some_and(|other| set.is_subset(other)),
            Node::And(items) => items.iter().any(|&i| self.implies(i, b)),
            Node::Or(items) => items.iter().all(|&i| self.implies(i, b)),
            Node::Next(x) | Node::Finally(x) => eventual && self.implies(x, b),
            Node::Globally(x) => self.implies(x, b),
            Node::Until(x, y) => self.implies(y, b) && (eventual || self.implies(x, b)),
            Node::Weak(x, y) => self.implies(x, b) && self.implies(y, b),
            Node::Release(_, y) => self.implies(y, b),
            Node::Strong(x, y) => self.implies(y, b) || eventual && self.implies(x, b),
        }
    }

    /// Takes `b` apart, together with `a` where both have the same shape.
    fn implied_by_right(&mut self, a: Id, b: Id) -> bool {
        let universal = self.is_universal(a);
        let left = self.node(a).clone();
        match self.node(b).clone() {
            Node::Letters(_) => false,
            Node::And(items) => items.iter().all(|&i| self.implies(a, i)),
            Node::Or(items) => items.iter().any(|&i| self.implies(a, i)),
            Node::Next(y) => {
                universal && self.implies(a, y)
                    || matches!(left, Node::Next(x) if self.implies(x, y))
            }
            Node::Finally(y) => self.implies(a, y),
            Node::Globally(y) => universal && self.implies(a, y),
            Node::Until(x, y) => {
                self.implies(a, y)
                    || matches!(left, Node::Until(v, w)
                        if self.implies(v, x) && self.implies(w, y))
            }
            Node::Weak(x, y) => {
                self.implies(a, y)
                    || universal && self.implies(a, x)
                    || matches!(left, Node::Until(v, w) | Node::Weak(v, w)
                        if self.implies(v, x) && self.implies(w, y))
            }
            Node::Release(x, y) => {
                self.implies(a, y)
                    && (universal
                        || self.implies(a, x)
                        || matches!(left, Node::Release(v, _) | Node::Strong(v, _)
                            if self.implies(v, x)))
            }
            Node::Strong(x, y) => {
                self.implies(a, y)
                    && (self.implies(a, x)
                        || matches!(left, Node::Strong(v, _) if self.implies(v, x)))
            }
        }
    }
}
