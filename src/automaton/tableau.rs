//! From normal form to a generalised automaton with marks on edges.
//!
//! A state is a set of formulas that the rest of the word must satisfy. Expanding a formula gives
//! *terms* "read one of these letters, then owe these formulas"; a term that puts an eventuality off
//! is *pending* in it. There is one mark per eventuality, on all edges that are not pending in it
//! (Couvreur, "On-the-fly verification of linear temporal logic", FM 1999; Gastin and Oddoux, "Fast LTL
//! to Büchi automata translation", CAV 2001).
//!
//! **Obligations that others cover.** A formula may be dropped beside one that *dominates* it: one
//! each of whose terms is answered by a term of the first with no fewer letters, no more pending
//! eventualities, and obligations that are dominated in turn: a direct simulation. A run that drops it
//! can be completed by that simulation, and if the dropped formula were put off for ever, the one
//! mark it waits for would be missing for ever too. Mere implication would not do: two
//! eventualities could excuse each other in turn. For the same reason eventualities with equal right
//! sides share a mark, which lets `aUb` dominate `Fb`.

use std::collections::HashMap;
use std::rc::Rc;

use super::TranslateError;
use super::bits::Bits;
use super::graph::{Edge, Graph, MAX_MARKS, Marks, full};
use super::limits::Watch;
use super::normal::{Arena, Id, Node};

/// A set of formulas owed: ascending and without repetition.
type Owed = Rc<[Id]>;

/// One way to satisfy a formula: letters now, obligations afterwards.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
struct Term {
    owed: Owed,
    pending: Marks,
    letters: Bits,
}

/// The automaton of `formula`, trimmed.
pub(super) fn build(
    arena: &mut Arena,
    formula: Id,
    watch: &Watch<'_>,
) -> Result<Graph, TranslateError> {
    let mut tableau = Tableau {
        arena,
        watch,
        terms: HashMap::new(),
        dominations: HashMap::new(),
        eventualities: HashMap::new(),
    };
    tableau.explore(formula)
}

struct Tableau<'a> {
    arena: &'a mut Arena,
    watch: &'a Watch<'a>,
    terms: HashMap<Id, Rc<[Term]>>,
    dominations: HashMap<(Id, Id), bool>,
    /// By the formula that is waited for.
    eventualities: HashMap<Id, u32>,
}

impl Tableau<'_> {
    fn explore(&mut self, formula: Id) -> Result<Graph, TranslateError> {
        // States with the same terms are the same state (Gastin and Oddoux, section 5.2).
        let mut by_terms: HashMap<Vec<Term>, u32> = HashMap::new();
        let mut by_owed: HashMap<Owed, u32> = HashMap::new();
        let mut rows: Vec<Vec<Term>> = Vec::new();
        let mut transitions = 0;
        let start = self.owe([formula]);
        let mut queue = vec![start.clone()];
        while let Some(owed) = queue.pop() {
            if by_owed.contains_key(&owed) {
                continue;
            }
            let terms = self.state_terms(&owed)?;
            let known = rows.len();
            let state = *by_terms.entry(terms).or_insert_with_key(|terms| {
                rows.push(terms.clone());
                rows.len() as u32 - 1
            });
            by_owed.insert(owed, state);
            let row = &rows[state as usize];
            if rows.len() > known {
                transitions += row.len();
                self.watch.check(rows.len(), transitions)?;
            }
            queue.extend(
                row.iter()
                    .filter(|t| !by_owed.contains_key(&t.owed))
                    .map(|t| t.owed.clone()),
            );
        }
        let marks = self.eventualities.len() as u32;
        let initial = by_owed[&start];
        // The initial state comes first.
        let place = |q: u32| match q {
            0 => initial,
            q if q == initial => 0,
            q => q,
        };
        rows.swap(0, initial as usize);
        let edges = rows.into_iter().map(|row| {
            row.into_iter()
                .map(|t| Edge {
                    target: place(by_owed[&t.owed]),
                    marks: full(marks) & !t.pending,
                    guard: t.letters,
                })
                .collect()
        });
        let mut graph = Graph {
            marks,
            edges: edges.collect(),
        };
        graph.trim();
        Ok(graph)
    }

    fn state_terms(&mut self, owed: &[Id]) -> Result<Vec<Term>, TranslateError> {
        let mut terms = vec![self.free(Bits::all(self.arena.letters()))];
        for &formula in owed {
            let more = self.expand(formula)?;
            terms = self.product(&terms, &more)?;
        }
        terms.sort_unstable_by(|a, b| (&a.owed, a.pending).cmp(&(&b.owed, b.pending)));
        Ok(terms)
    }

    /// The term that owes nothing.
    fn free(&self, letters: Bits) -> Term {
        Term {
            owed: Rc::new([]),
            pending: 0,
            letters,
        }
    }

    /// The mark of the eventuality that waits for `formula`.
    fn pending(&mut self, formula: Id) -> Result<Marks, TranslateError> {
        let next = self.eventualities.len() as u32;
        let mark = *self.eventualities.entry(formula).or_insert(next);
        if mark as usize >= MAX_MARKS {
            return Err(TranslateError::Eventualities { limit: MAX_MARKS });
        }
        Ok(1 << mark)
    }

    fn expand(&mut self, id: Id) -> Result<Rc<[Term]>, TranslateError> {
        if let Some(known) = self.terms.get(&id) {
            return Ok(known.clone());
        }
        let all = Bits::all(self.arena.letters());
        let terms = match self.arena.node(id).clone() {
            Node::Letters(set) if set.is_empty() => Vec::new(),
            Node::Letters(set) => vec![self.free(set)],
            Node::And(items) => self.state_terms(&items)?,
            Node::Or(items) => {
                let mut terms = Vec::new();
                for &item in &items {
                    terms.extend(self.expand(item)?.iter().cloned());
                }
                self.prune(terms)?
            }
            Node::Next(a) => vec![Term {
                owed: self.owe([a]),
                pending: 0,
                letters: all,
            }],
            Node::Finally(a) => {
                let pending = self.pending(a)?;
                let later = self.later(id, a, pending);
                let mut terms = self.expand(a)?.to_vec();
                terms.push(later);
                self.prune(terms)?
            }
            Node::Globally(a) => {
                let now = self.expand(a)?;
                let on = self.stay(id, all, 0);
                self.product(&now, &[on])?
            }
            Node::Until(a, b) | Node::Weak(a, b) => {
                let pending = match self.arena.node(id) {
                    Node::Until(..) => self.pending(b)?,
                    _ => 0,
                };
                let later = self.later(id, b, pending);
                let waiting = self.expand(a)?;
                let mut terms = self.product(&waiting, &[later])?;
                terms.extend(self.expand(b)?.iter().cloned());
                self.prune(terms)?
            }
            Node::Release(a, b) | Node::Strong(a, b) => {
                let pending = match self.arena.node(id) {
                    Node::Strong(..) => {
                        let both = self.arena.and([a, b]);
                        self.pending(both)?
                    }
                    _ => 0,
                };
                let mut release = self.expand(a)?.to_vec();
                release.push(self.later(id, a, pending));
                let hold = self.expand(b)?;
                self.product(&release, &hold)?
            }
        };
        let terms: Rc<[Term]> = terms.into();
        self.terms.insert(id, terms.clone());
        Ok(terms)
    }

    /// The term that owes `id` again.
    fn stay(&mut self, id: Id, letters: Bits, pending: Marks) -> Term {
        Term {
            owed: self.owe([id]),
            pending,
            letters,
        }
    }

    /// The term that owes `id` again because `goal` is not taken now. Where a set of letters is the
    /// goal there is no reason to wait once it is read.
    fn later(&mut self, id: Id, goal: Id, pending: Marks) -> Term {
        let all = Bits::all(self.arena.letters());
        let letters = match self.arena.as_letters(goal) {
            Some(set) => all.minus(set),
            None => all,
        };
        self.stay(id, letters, pending)
    }

    /// All ways to satisfy both.
    fn product(&mut self, a: &[Term], b: &[Term]) -> Result<Vec<Term>, TranslateError> {
        let mut terms = Vec::with_capacity(a.len() * b.len());
        for x in a {
            self.watch.check(0, terms.len())?;
            for y in b {
                let letters = x.letters.and(&y.letters);
                if letters.is_empty() {
                    continue;
                }
                let owed = match (x.owed.is_empty(), y.owed.is_empty()) {
                    (_, true) => x.owed.clone(),
                    (true, _) => y.owed.clone(),
                    _ => self.owe(x.owed.iter().chain(y.owed.iter()).copied()),
                };
                if owed.first() == Some(&Id::FALSE) {
                    continue;
                }
                terms.push(Term {
                    owed,
                    pending: x.pending | y.pending,
                    letters,
                });
            }
        }
        self.prune(terms)
    }

    /// Unites terms that differ in their letters alone, and takes away letters on which another term
    /// asks for less.
    fn prune(&mut self, mut terms: Vec<Term>) -> Result<Vec<Term>, TranslateError> {
        if terms.len() > 1 {
            terms.sort_by(|a, b| (a.pending, &a.owed).cmp(&(b.pending, &b.owed)));
            terms.dedup_by(|t, kept| {
                let same = t.owed == kept.owed && t.pending == kept.pending;
                if same {
                    kept.letters.or_with(&t.letters);
                }
                same
            });
        }
        for i in 0..terms.len() {
            if i % 64 == 63 {
                self.watch.tick()?;
            }
            for j in 0..terms.len() {
                if i == j || terms[j].letters.is_disjoint(&terms[i].letters) {
                    continue;
                }
                let less = terms[j].pending & !terms[i].pending == 0
                    && self.covers(&terms[i].owed.clone(), &terms[j].owed.clone())
                    // Of two that ask for the same the first stays.
                    && !(j > i
                        && terms[i].pending == terms[j].pending
                        && self.covers(&terms[j].owed.clone(), &terms[i].owed.clone()));
                if less {
                    let taken = terms[j].letters.clone();
                    terms[i].letters.minus_with(&taken);
                }
            }
        }
        terms.retain(|t| !t.letters.is_empty());
        Ok(terms)
    }

    /// Whether every formula of `weak` is dominated by one of `strong`.
    fn covers(&mut self, strong: &[Id], weak: &[Id]) -> bool {
        weak.iter()
            .all(|&w| strong.iter().any(|&s| self.dominates(s, w)))
    }

    /// The set of obligations, without those that others dominate.
    fn owe(&mut self, formulas: impl IntoIterator<Item = Id>) -> Owed {
        let mut owed: Vec<Id> = Vec::new();
        for formula in formulas {
            match self.arena.node(formula) {
                Node::And(items) => owed.extend_from_slice(items),
                _ if formula == Id::TRUE => {}
                _ => owed.push(formula),
            }
        }
        owed.sort_unstable();
        owed.dedup();
        let mut i = 0;
        while i < owed.len() {
            let item = owed[i];
            let dominated = (0..owed.len()).any(|j| j != i && self.dominates(owed[j], item));
            if dominated {
                owed.remove(i);
            } else {
                i += 1;
            }
        }
        if owed.len() > 1 && self.impossible(&owed) {
            return Rc::new([Id::FALSE]);
        }
        owed.into()
    }

    /// Whether two obligations exclude each other, as far as syntax shows it.
    fn impossible(&mut self, owed: &[Id]) -> bool {
        owed.iter().enumerate().any(|(i, &a)| {
            owed[i + 1..]
                .iter()
                .any(|&b| self.arena.contradicts(a, b) || self.arena.contradicts(b, a))
        })
    }

    /// Whether `strong` dominates `weak`; see the module's head.
    fn dominates(&mut self, strong: Id, weak: Id) -> bool {
        if strong == weak || weak == Id::TRUE || strong == Id::FALSE {
            return true;
        }
        if strong == Id::TRUE || weak == Id::FALSE {
            return false;
        }
        if let Some(&known) = self.dominations.get(&(strong, weak)) {
            return known;
        }
        let result = self.dominates_by_left(strong, weak) || self.dominates_by_right(strong, weak);
        self.dominations.insert((strong, weak), result);
        result
    }

    /// Every term of `strong` contains one of a part of it.
    fn dominates_by_left(&mut self, strong: Id, weak: Id) -> bool {
        match self.arena.node(strong).clone() {
            Node::Letters(set) => {
                matches!(self.arena.node(weak), Node::Letters(other) if set.is_subset(other))
            }
            Node::And(items) => items.iter().any(|&i| self.dominates(i, weak)),
            Node::Or(items) => items.iter().all(|&i| self.dominates(i, weak)),
            Node::Globally(a) | Node::Release(_, a) | Node::Strong(_, a) => self.dominates(a, weak),
            Node::Until(a, b) | Node::Weak(a, b) => {
                self.dominates(a, weak) && self.dominates(b, weak)
            }
            Node::Next(_) | Node::Finally(_) => false,
        }
    }

    /// `weak` can answer every term of `strong`.
    fn dominates_by_right(&mut self, strong: Id, weak: Id) -> bool {
        let node = self.arena.node(strong).clone();
        let forever = matches!(node, Node::Globally(_));
        match self.arena.node(weak).clone() {
            Node::Letters(_) => false,
            Node::And(items) => items.iter().all(|&i| self.dominates(strong, i)),
            Node::Or(items) => items.iter().any(|&i| self.dominates(strong, i)),
            Node::Next(a) => {
                forever && self.dominates(strong, a)
                    || matches!(node, Node::Next(b) if self.dominates(b, a))
            }
            Node::Globally(a) => forever && self.dominates(strong, a),
            Node::Finally(a) => {
                self.dominates(strong, a) || matches!(node, Node::Until(_, b) if a == b)
            }
            Node::Until(a, b) => {
                self.dominates(strong, b)
                    || matches!(node, Node::Until(c, d) if b == d && self.dominates(c, a))
            }
            Node::Weak(a, b) => {
                self.dominates(strong, b)
                    || forever && self.dominates(strong, a)
                    || matches!(node, Node::Until(c, d) | Node::Weak(c, d)
                        if self.dominates(c, a) && self.dominates(d, b))
            }
            Node::Release(a, b) => {
                self.dominates(strong, b)
                    && (forever
                        || self.dominates(strong, a)
                        || matches!(node, Node::Release(c, _) | Node::Strong(c, _)
                            if self.dominates(c, a)))
            }
            Node::Strong(a, b) => self.dominates(strong, a) && self.dominates(strong, b),
        }
    }
}
