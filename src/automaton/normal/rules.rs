//! Constructors that simplify.
//!
//! The rules are those of Somenzi and Bloem (CAV 2000, section 3), Etessami and Holzmann (CONCUR
//! 2000, section 3), and Duret-Lutz, "LTL translation improvements in Spot 1.0" (2014, section 5), read
//! over sets of letters. Rules for `|`, `F`, `U` and `M` are the duals of those written here.
//!
//! A *limit* formula is both a pure eventuality and purely universal (`GFa`, `FGa`): it can be pulled
//! out of every temporal operator.

use std::collections::HashMap;

use super::{Arena, Id, Node};
use crate::automaton::bits::Bits;

/// How often a conjunction is gone over again after one of its parts changed. Two or three rounds
/// reach the end; the bound makes termination plain.
const ROUNDS: usize = 10;

impl Arena {
    /// The formula "the first letter is in `set`".
    pub(in crate::automaton) fn set(&mut self, set: Bits) -> Id {
        self.intern(Node::Letters(set))
    }

    pub(in crate::automaton) fn or(&mut self, items: impl IntoIterator<Item = Id>) -> Id {
        let duals: Vec<Id> = items.into_iter().map(|i| self.negate(i)).collect();
        let and = self.and(duals);
        self.negate(and)
    }

    pub(in crate::automaton) fn finally(&mut self, a: Id) -> Id {
        let not_a = self.negate(a);
        let globally = self.globally(not_a);
        self.negate(globally)
    }

    pub(in crate::automaton) fn until(&mut self, a: Id, b: Id) -> Id {
        let (not_a, not_b) = (self.negate(a), self.negate(b));
        let release = self.release(not_a, not_b);
        self.negate(release)
    }

    pub(in crate::automaton) fn strong(&mut self, a: Id, b: Id) -> Id {
        let (not_a, not_b) = (self.negate(a), self.negate(b));
        let weak = self.weak(not_a, not_b);
        self.negate(weak)
    }

    pub(in crate::automaton) fn next(&mut self, a: Id) -> Id {
        if self.is_limit(a) {
            return a;
        }
        match self.node(a).clone() {
            Node::And(items) if items.iter().any(|&i| self.is_limit(i)) => {
                let items: Vec<Id> = items.iter().map(|&i| self.next(i)).collect();
                self.and(items)
            }
            Node::Or(items) if items.iter().any(|&i| self.is_limit(i)) => {
                let items: Vec<Id> = items.iter().map(|&i| self.next(i)).collect();
                self.or(items)
            }
            _ => self.intern(Node::Next(a)),
        }
    }

    pub(in crate::automaton) fn globally(&mut self, a: Id) -> Id {
        if self.is_universal(a) {
            return a;
        }
        if let Node::Finally(b) = *self.node(a) {
            return self.infinitely_often(b);
        }
        let items = match self.node(a) {
            Node::And(items) => items.to_vec(),
            _ => vec![a],
        };
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for &item in &items {
            self.globally_part(item, &mut inside, &mut outside);
        }
        if outside.is_empty() && inside == items {
            return self.intern(Node::Globally(a));
        }
        let body = self.and(inside);
        outside.push(self.globally(body));
        self.and(outside)
    }

    /// `G` of one conjunct: what stays inside `G` and what is pulled out of it.
    fn globally_part(&mut self, item: Id, inside: &mut Vec<Id>, outside: &mut Vec<Id>) {
        match self.node(item).clone() {
            Node::Globally(b) => inside.push(b),
            _ if self.is_universal(item) => outside.push(item),
            Node::Next(b) => {
                let always = self.globally(b);
                outside.push(self.next(always));
            }
            Node::Until(b, c) => inside.extend([self.or([b, c]), self.finally(c)]),
            Node::Release(_, c) => inside.push(c),
            Node::Weak(b, c) => inside.push(self.or([b, c])),
            Node::Strong(b, c) => inside.extend([c, self.finally(b)]),
            Node::Or(items) if items.iter().any(|&i| self.is_limit(i)) => {
                let (limits, rest): (Vec<Id>, Vec<Id>) =
                    items.iter().partition(|&&i| self.is_limit(i));
                let rest = self.or(rest);
                let always = self.globally(rest);
                outside.push(self.or(limits.into_iter().chain([always])));
            }
            _ => inside.push(item),
        }
    }

    /// `GF a`.
    fn infinitely_often(&mut self, a: Id) -> Id {
        let items = match self.node(a) {
            Node::And(items) | Node::Or(items) => items.to_vec(),
            _ => Vec::new(),
        };
        let conjunction = matches!(self.node(a), Node::And(_));
        let splits =
            |arena: &Self, i: Id| arena.is_universal(i) || conjunction && arena.is_eventual(i);
        if !items.iter().any(|&i| splits(self, i)) {
            let eventually = self.intern(Node::Finally(a));
            return self.intern(Node::Globally(eventually));
        }
        let (mut parts, mut rest) = (Vec::new(), Vec::new());
        for i in items {
            // GF(a & e) = GFa & Ge, GF(a & u) = GFa & Fu, GF(a | u) = GFa | Fu.
            if self.is_universal(i) {
                parts.push(self.finally(i));
            } else if splits(self, i) {
                parts.push(self.globally(i));
            } else {
                rest.push(i);
            }
        }
        let rest = if conjunction {
            self.and(rest)
        } else {
            self.or(rest)
        };
        let eventually = self.finally(rest);
        parts.push(self.globally(eventually));
        if conjunction {
            self.and(parts)
        } else {
            self.or(parts)
        }
    }

    /// `a R b`.
    pub(in crate::automaton) fn release(&mut self, a: Id, b: Id) -> Id {
        if a == Id::TRUE || self.is_universal(b) || self.implies(b, a) {
            return b;
        }
        if self.contradicts(a, b) {
            return self.globally(b);
        }
        if let (Node::Next(x), Node::Next(y)) = (self.node(a), self.node(b)) {
            let (x, y) = (*x, *y);
            let inner = self.release(x, y);
            return self.next(inner);
        }
        if let Some(split) = self.release_split(a, b) {
            return split;
        }
        // a R (c R d) = c R d when c implies a.
        if let Node::Release(c, _) = *self.node(b)
            && self.implies(c, a)
        {
            return b;
        }
        // Only where b holds does a matter.
        if let (Some(x), Some(y)) = (self.as_letters(a), self.as_letters(b)) {
            let both = x.and(y);
            let a = self.set(both);
            return self.intern(Node::Release(a, b));
        }
        if let Node::And(items) = self.node(a).clone() {
            let needed: Vec<Id> = items
                .iter()
                .copied()
                .filter(|&i| !self.implies(b, i))
                .collect();
            if needed.len() < items.len() {
                let a = self.and(needed);
                return self.release(a, b);
            }
        }
        self.intern(Node::Release(a, b))
    }

    /// `a R (b & u) = (a R b) & u` for universal u, `a R (b | q) = (a R b) | q` for limits q.
    fn release_split(&mut self, a: Id, b: Id) -> Option<Id> {
        match self.node(b).clone() {
            Node::And(items) if items.iter().any(|&i| self.is_universal(i)) => {
                let (mut out, rest): (Vec<Id>, Vec<Id>) =
                    items.iter().partition(|&&i| self.is_universal(i));
                let rest = self.and(rest);
                out.push(self.release(a, rest));
                Some(self.and(out))
            }
            Node::Or(items) if items.iter().any(|&i| self.is_limit(i)) => {
                let (mut out, rest): (Vec<Id>, Vec<Id>) =
                    items.iter().partition(|&&i| self.is_limit(i));
                let rest = self.or(rest);
                out.push(self.release(a, rest));
                Some(self.or(out))
            }
            _ => None,
        }
    }

    /// `a W b`.
    pub(in crate::automaton) fn weak(&mut self, a: Id, b: Id) -> Id {
        if self.implies(a, b) {
            return b;
        }
        if b == Id::FALSE {
            return self.globally(a);
        }
        let not_a = self.negate(a);
        if self.implies(not_a, b) {
            return Id::TRUE;
        }
        if self.is_universal(a) {
            return self.or([a, b]);
        }
        if self.is_eventual(b) {
            let always = self.globally(a);
            return self.or([always, b]);
        }
        match (self.node(a).clone(), self.node(b).clone()) {
            (Node::Next(x), Node::Next(y)) => {
                let inner = self.weak(x, y);
                self.next(inner)
            }
            (Node::Letters(x), Node::Letters(y)) => {
                let either = self.set(x.or(&y));
                self.release(b, either)
            }
            // a W (c W d) = c W d when a implies c.
            (_, Node::Weak(c, _)) if self.implies(a, c) => b,
            (_, Node::Or(items)) if items.iter().any(|&i| self.is_eventual(i)) => {
                let (mut out, rest): (Vec<Id>, Vec<Id>) =
                    items.iter().partition(|&&i| self.is_eventual(i));
                let rest = self.or(rest);
                out.push(self.weak(a, rest));
                self.or(out)
            }
            // What implies b need not be waited with.
            (Node::Or(items), _) => {
                let needed: Vec<Id> = items
                    .iter()
                    .copied()
                    .filter(|&i| !self.implies(i, b))
                    .collect();
                if needed.len() < items.len() {
                    let a = self.or(needed);
                    return self.weak(a, b);
                }
                self.intern(Node::Weak(a, b))
            }
            _ => self.intern(Node::Weak(a, b)),
        }
    }

    /// The conjunction.
    pub(in crate::automaton) fn and(&mut self, items: impl IntoIterator<Item = Id>) -> Id {
        let mut items: Vec<Id> = items.into_iter().collect();
        for _ in 0..ROUNDS {
            let before = self.flatten(&items);
            items = self.merge_alike(before.clone());
            items = self.flatten(&items);
            self.use_invariants(&mut items);
            items = self.flatten(&items);
            self.drop_implied(&mut items);
            items = self.flatten(&items);
            if items == before {
                break;
            }
        }
        match items[..] {
            [] => Id::TRUE,
            [only] => only,
            _ => self.intern(Node::And(items.into())),
        }
    }

    /// Ascending, without nested conjunctions, constants or more than one set of letters.
    fn flatten(&mut self, items: &[Id]) -> Vec<Id> {
        let mut letters = Bits::all(self.letters);
        let mut flat = Vec::with_capacity(items.len());
        let mut todo: Vec<Id> = items.to_vec();
        while let Some(item) = todo.pop() {
            match self.node(item) {
                Node::Letters(set) => letters = letters.and(set),
                Node::And(parts) => todo.extend_from_slice(parts),
                _ => flat.push(item),
            }
        }
        let letters = self.set(letters);
        match letters {
            Id::TRUE => {}
            Id::FALSE => return vec![Id::FALSE],
            set => flat.push(set),
        }
        flat.sort_unstable();
        flat.dedup();
        flat
    }

    /// Unites conjuncts of one shape: `Ga & Gb = G(a & b)`, `Xa & Xb = X(a & b)`, `FGa & FGb =
    /// FG(a & b)`, `aRb & aRc = aR(b & c)`, `aUb & cUb = (a & c)Ub`, and mixtures with `M` and `W`.
    fn merge_alike(&mut self, items: Vec<Id>) -> Vec<Id> {
        #[derive(PartialEq)]
        enum Shape {
            Globally,
            Next,
            Persistently,
            Left(Id),
            Right(Id),
        }
        let mut groups: Vec<(Shape, Vec<Id>, bool)> = Vec::new();
        let mut rest = Vec::new();
        for item in items {
            let (shape, body, strong) = match *self.node(item) {
                Node::Globally(a) => (Shape::Globally, a, false),
                Node::Next(a) => (Shape::Next, a, false),
                Node::Finally(a) if self.is_universal(a) => (Shape::Persistently, a, false),
                Node::Release(a, b) => (Shape::Left(a), b, false),
                Node::Strong(a, b) => (Shape::Left(a), b, true),
                Node::Weak(a, b) => (Shape::Right(b), a, false),
                Node::Until(a, b) => (Shape::Right(b), a, true),
                _ => {
                    rest.push(item);
                    continue;
                }
            };
            match groups.iter_mut().find(|g| g.0 == shape) {
                Some(group) => {
                    group.1.push(body);
                    group.2 |= strong;
                }
                None => groups.push((shape, vec![body], strong)),
            }
        }
        for (shape, bodies, strong) in groups {
            let single = bodies.len() == 1;
            let body = if single { bodies[0] } else { self.and(bodies) };
            rest.push(match (shape, strong, single) {
                // Alone, it is in simplest form already.
                (Shape::Globally, _, true) => self.intern(Node::Globally(body)),
                (Shape::Next, _, true) => self.intern(Node::Next(body)),
                (Shape::Persistently, _, true) => self.intern(Node::Finally(body)),
                (Shape::Left(a), false, true) => self.intern(Node::Release(a, body)),
                (Shape::Left(a), true, true) => self.intern(Node::Strong(a, body)),
                (Shape::Right(b), false, true) => self.intern(Node::Weak(body, b)),
                (Shape::Right(b), true, true) => self.intern(Node::Until(body, b)),
                (Shape::Globally, ..) => self.globally(body),
                (Shape::Next, ..) => self.next(body),
                (Shape::Persistently, ..) => self.finally(body),
                (Shape::Left(a), false, _) => self.release(a, body),
                (Shape::Left(a), true, _) => self.strong(a, body),
                (Shape::Right(b), false, _) => self.weak(body, b),
                (Shape::Right(b), true, _) => self.until(body, b),
            });
        }
        rest
    }

    /// Beside `G s` with a set of letters s, only letters of s occur: every other set is cut to it.
    fn use_invariants(&mut self, items: &mut [Id]) {
        let globally = items
            .iter()
            .position(|&i| matches!(self.node(i), Node::Globally(_)));
        let Some(at) = globally else { return };
        let Node::Globally(body) = *self.node(items[at]) else {
            return;
        };
        let invariant = match self.node(body) {
            Node::Letters(set) => Some(set.clone()),
            Node::And(parts) => parts.iter().find_map(|&p| self.as_letters(p).cloned()),
            _ => None,
        };
        if let Some(set) = invariant
            && self.spend(items.len())
        {
            let mut memo = HashMap::new();
            for (i, item) in items.iter_mut().enumerate() {
                if i != at {
                    *item = self.restrict(*item, &set, &mut memo);
                }
            }
        }
        for item in items.iter_mut() {
            match self.node(*item).clone() {
                Node::Until(a, b) if self.implies(body, a) => *item = self.finally(b),
                Node::Strong(a, b) if self.implies(body, b) => *item = self.finally(a),
                _ => {}
            }
        }
    }

    /// An equivalent formula for words over the letters of `set` alone.
    fn restrict(&mut self, id: Id, set: &Bits, memo: &mut HashMap<Id, Id>) -> Id {
        if let Some(&known) = memo.get(&id) {
            return known;
        }
        if !self.spend(1) {
            return id;
        }
        let result = match self.node(id).clone() {
            Node::Letters(here) if set.is_subset(&here) => Id::TRUE,
            Node::Letters(here) => self.set(here.and(set)),
            Node::And(items) => {
                let items: Vec<Id> = items.iter().map(|&i| self.restrict(i, set, memo)).collect();
                self.and(items)
            }
            Node::Or(items) => {
                let items: Vec<Id> = items.iter().map(|&i| self.restrict(i, set, memo)).collect();
                self.or(items)
            }
            Node::Next(a) => {
                let a = self.restrict(a, set, memo);
                self.next(a)
            }
            Node::Finally(a) => {
                let a = self.restrict(a, set, memo);
                self.finally(a)
            }
            Node::Globally(a) => {
                let a = self.restrict(a, set, memo);
                self.globally(a)
            }
            node @ (Node::Until(a, b)
            | Node::Release(a, b)
            | Node::Weak(a, b)
            | Node::Strong(a, b)) => {
                let (a, b) = (self.restrict(a, set, memo), self.restrict(b, set, memo));
                match node {
                    Node::Until(..) => self.until(a, b),
                    Node::Release(..) => self.release(a, b),
                    Node::Weak(..) => self.weak(a, b),
                    _ => self.strong(a, b),
                }
            }
        };
        memo.insert(id, result);
        result
    }

    /// Drops what others imply, and disjuncts that others exclude; `false` if two exclude each other.
    fn drop_implied(&mut self, items: &mut Vec<Id>) {
        let mut i = 0;
        while i < items.len() {
            let item = items[i];
            let others: Vec<Id> = items.iter().copied().filter(|&o| o != item).collect();
            if others.iter().any(|&o| self.implies(o, item)) {
                items.remove(i);
                continue;
            }
            if others.iter().any(|&o| self.contradicts(o, item)) {
                *items = vec![Id::FALSE];
                return;
            }
            if let Node::Or(parts) = self.node(item).clone() {
                let possible: Vec<Id> = parts
                    .iter()
                    .copied()
                    .filter(|&p| !others.iter().any(|&o| self.contradicts(o, p)))
                    .collect();
                if possible.len() < parts.len() {
                    items[i] = self.or(possible);
                }
            }
            i += 1;
        }
    }
}
