//! Formulas in normal form: negation only inside sets of letters, equal formulas shared.
//!
//! A propositional subformula becomes the set of letters in which it holds, so `a & b` over disjoint
//! regions *is* `false` and `!a | !b` *is* `true` before any rule looks at them. All rules are
//! equivalences over words of the letters at hand. Operators come in dual pairs and [`Arena::negate`]
//! maps one onto the other, so each rule is written once, for `&`, `G`, `R` and `W`.

mod build;
mod implies;
mod rules;

use std::collections::HashMap;

use super::bits::Bits;

pub(super) use build::Lowered;

/// A formula of an [`Arena`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub(super) struct Id(pub(super) u32);

impl Id {
    pub(super) const TRUE: Self = Self(0);
    pub(super) const FALSE: Self = Self(1);

    pub(super) fn index(self) -> usize {
        self.0 as usize
    }
}

/// The shape of a formula.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(super) enum Node {
    /// The first letter is in the set. Constants are the full and the empty set.
    Letters(Bits),
    /// At least two, ascending, at most one of them `Letters`.
    And(Box<[Id]>),
    /// At least two, ascending, at most one of them `Letters`.
    Or(Box<[Id]>),
    Next(Id),
    Finally(Id),
    Globally(Id),
    Until(Id, Id),
    Release(Id, Id),
    Weak(Id, Id),
    Strong(Id, Id),
}

/// What is known of a formula (Etessami and Holzmann, "Optimizing Büchi automata", CONCUR 2000).
#[derive(Clone, Copy)]
struct Facts {
    /// A pure eventuality: if it holds of a suffix, it holds of the whole word.
    eventual: bool,
    /// Purely universal: if it holds of a word, it holds of every suffix.
    universal: bool,
}

/// All formulas of one translation; equal formulas have equal numbers.
pub(super) struct Arena {
    letters: usize,
    nodes: Vec<Node>,
    facts: Vec<Facts>,
    negations: Vec<Option<Id>>,
    index: HashMap<Node, Id>,
    implications: HashMap<(Id, Id), bool>,
    /// What may still be spent on rules that are not needed for correctness.
    effort: usize,
}

/// The total number of implication tests and restriction steps of one translation. Formulas that
/// people write need a few hundred; beyond it formulas stay as they are.
const EFFORT: usize = 200_000;

impl Arena {
    /// An arena over `letters` letter classes.
    pub(super) fn new(letters: usize) -> Self {
        let mut arena = Self {
            letters,
            nodes: Vec::new(),
            facts: Vec::new(),
            negations: Vec::new(),
            index: HashMap::new(),
            implications: HashMap::new(),
            effort: EFFORT,
        };
        arena.intern(Node::Letters(Bits::all(letters)));
        arena.intern(Node::Letters(Bits::none(letters)));
        arena
    }

    pub(super) fn letters(&self) -> usize {
        self.letters
    }

    pub(super) fn node(&self, id: Id) -> &Node {
        &self.nodes[id.index()]
    }

    pub(super) fn as_letters(&self, id: Id) -> Option<&Bits> {
        match self.node(id) {
            Node::Letters(set) => Some(set),
            _ => None,
        }
    }

    pub(super) fn is_universal(&self, id: Id) -> bool {
        self.facts[id.index()].universal
    }

    pub(super) fn is_eventual(&self, id: Id) -> bool {
        self.facts[id.index()].eventual
    }

    /// Whether the formula speaks only of what happens for ever: any prefix may change.
    fn is_limit(&self, id: Id) -> bool {
        self.is_universal(id) && self.is_eventual(id)
    }

    /// Takes `amount` from the effort that is left; false when there is too little.
    fn spend(&mut self, amount: usize) -> bool {
        let enough = self.effort >= amount;
        self.effort = self.effort.saturating_sub(amount);
        enough
    }

    /// Finds or makes a node as it is, without any rule.
    pub(super) fn intern(&mut self, node: Node) -> Id {
        if let Some(&id) = self.index.get(&node) {
            return id;
        }
        let id = Id(u32::try_from(self.nodes.len()).expect("fewer than 2^32 formulas"));
        self.facts.push(self.facts_of(&node));
        self.nodes.push(node.clone());
        self.negations.push(None);
        self.index.insert(node, id);
        id
    }

    fn facts_of(&self, node: &Node) -> Facts {
        let eventual = |id: &Id| self.is_eventual(*id);
        let universal = |id: &Id| self.is_universal(*id);
        let (eventual, universal) = match node {
            Node::Letters(set) => {
                let constant = set.is_empty() || set.len() == self.letters;
                (constant, constant)
            }
            Node::And(items) | Node::Or(items) => {
                (items.iter().all(eventual), items.iter().all(universal))
            }
            Node::Next(a) => (eventual(a), universal(a)),
            Node::Finally(a) => (true, universal(a)),
            Node::Globally(a) => (eventual(a), true),
            Node::Until(a, b) => (eventual(b), universal(a) && universal(b)),
            Node::Release(a, b) => (eventual(a) && eventual(b), universal(b)),
            Node::Weak(a, b) => (eventual(a) && eventual(b), universal(a) && universal(b)),
            Node::Strong(a, b) => (eventual(a) && eventual(b), universal(a) && universal(b)),
        };
        Facts {
            eventual,
            universal,
        }
    }

    /// The negation, by duality: no rule fires, since the dual of a simplified formula is simplified.
    pub(super) fn negate(&mut self, id: Id) -> Id {
        if let Some(dual) = self.negations[id.index()] {
            return dual;
        }
        let node = match self.node(id).clone() {
            Node::Letters(set) => Node::Letters(Bits::all(self.letters).minus(&set)),
            Node::And(items) => Node::Or(self.negate_all(&items)),
            Node::Or(items) => Node::And(self.negate_all(&items)),
            Node::Next(a) => Node::Next(self.negate(a)),
            Node::Finally(a) => Node::Globally(self.negate(a)),
            Node::Globally(a) => Node::Finally(self.negate(a)),
            Node::Until(a, b) => Node::Release(self.negate(a), self.negate(b)),
            Node::Release(a, b) => Node::Until(self.negate(a), self.negate(b)),
            Node::Weak(a, b) => Node::Strong(self.negate(a), self.negate(b)),
            Node::Strong(a, b) => Node::Weak(self.negate(a), self.negate(b)),
        };
        let dual = self.intern(node);
        self.negations[id.index()] = Some(dual);
        self.negations[dual.index()] = Some(id);
        dual
    }

    fn negate_all(&mut self, items: &[Id]) -> Box<[Id]> {
        let mut duals: Vec<Id> = items.iter().map(|&i| self.negate(i)).collect();
        duals.sort_unstable();
        duals.into()
    }
}
