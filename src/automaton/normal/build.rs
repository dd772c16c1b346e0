//! From syntax trees to normal form, over the letters that a formula can tell apart.

use std::collections::HashMap;

use super::{Arena, Id};
use crate::alphabet::{Alphabet, LetterSet, Props};
use crate::automaton::bits::Bits;
use crate::ltl::Formula;

/// A formula in normal form and the letter classes its sets speak of.
///
/// Letters that agree on every proposition of the formula behave alike: they form one class.
pub(in crate::automaton) struct Lowered {
    pub(in crate::automaton) arena: Arena,
    pub(in crate::automaton) formula: Id,
    /// For each letter of the alphabet its class.
    classes: Vec<usize>,
    /// For each class which of the formula's propositions hold.
    pub(in crate::automaton) seen: Vec<Props>,
}

impl Lowered {
    /// Brings a formula into normal form and simplifies it.
    ///
    /// # Errors
    /// The first proposition that the alphabet does not have.
    pub(in crate::automaton) fn new(
        formula: &Formula,
        alphabet: &Alphabet,
    ) -> Result<Self, String> {
        let mut used = Props::EMPTY;
        let mut index = HashMap::new();
        for name in formula.propositions() {
            let i = alphabet.proposition(name).ok_or_else(|| name.to_owned())?;
            used = used.with(i);
            index.insert(name, i);
        }
        let mut valuations: Vec<Props> = Vec::new();
        let mut known: HashMap<Props, usize> = HashMap::new();
        let mut classes = Vec::with_capacity(alphabet.len());
        for letter in alphabet.letters() {
            let seen = Props(alphabet.props(letter).0 & used.0);
            classes.push(*known.entry(seen).or_insert_with(|| {
                valuations.push(seen);
                valuations.len() - 1
            }));
        }
        let mut lowering = Lowering {
            arena: Arena::new(valuations.len()),
            index,
            valuations,
            memo: HashMap::new(),
        };
        let formula = lowering.lower(formula, true);
        Ok(Self {
            arena: lowering.arena,
            formula,
            classes,
            seen: lowering.valuations,
        })
    }

    /// The letters of the classes in `set`.
    pub(in crate::automaton) fn expand(&self, set: &Bits, alphabet: &Alphabet) -> LetterSet {
        let mut letters = alphabet.none();
        for letter in alphabet.letters() {
            if set.contains(self.classes[letter.index()]) {
                letters.insert(letter);
            }
        }
        letters
    }
}

struct Lowering<'f> {
    arena: Arena,
    index: HashMap<&'f str, usize>,
    valuations: Vec<Props>,
    /// By node and polarity: `<->` visits its operands with both.
    memo: HashMap<(*const Formula, bool), Id>,
}

impl<'f> Lowering<'f> {
    fn proposition(&mut self, name: &str, positive: bool) -> Id {
        let bit = self.index[name];
        let mut set = Bits::none(self.valuations.len());
        for (class, valuation) in self.valuations.iter().enumerate() {
            if valuation.contains(bit) == positive {
                set.insert(class);
            }
        }
        self.arena.set(set)
    }

    /// The normal form of `formula`, or of its negation.
    fn lower(&mut self, formula: &'f Formula, positive: bool) -> Id {
        let key = (std::ptr::from_ref(formula), positive);
        if let Some(&id) = self.memo.get(&key) {
            return id;
        }
        let id = match formula {
            Formula::True | Formula::False => {
                if matches!(formula, Formula::True) == positive {
                    Id::TRUE
                } else {
                    Id::FALSE
                }
            }
            Formula::Prop(name) => self.proposition(name, positive),
            Formula::Not(a) => self.lower(a, !positive),
            Formula::Iff(a, b) => {
                let (a1, b1) = (self.lower(a, true), self.lower(b, positive));
                let (a0, b0) = (self.lower(a, false), self.lower(b, !positive));
                // The form with fewer eventualities in the end depends on the context; this one has
                // the nondeterministic choice at the top, where expansion resolves it first.
                let both = self.arena.and([a1, b1]);
                let neither = self.arena.and([a0, b0]);
                self.arena.or([both, neither])
            }
            Formula::Implies(a, b) => {
                let (a, b) = (self.lower(a, !positive), self.lower(b, positive));
                self.junction(!positive, a, b)
            }
            Formula::And(a, b) | Formula::Or(a, b) => {
                let conjunction = matches!(formula, Formula::And(..)) == positive;
                let (a, b) = (self.lower(a, positive), self.lower(b, positive));
                self.junction(conjunction, a, b)
            }
            Formula::Next(a) => {
                let a = self.lower(a, positive);
                self.arena.next(a)
            }
            Formula::Finally(a) | Formula::Globally(a) => {
                let globally = matches!(formula, Formula::Globally(_)) == positive;
                let a = self.lower(a, positive);
                if globally {
                    self.arena.globally(a)
                } else {
                    self.arena.finally(a)
                }
            }
            Formula::Until(a, b)
            | Formula::Release(a, b)
            | Formula::WeakUntil(a, b)
            | Formula::StrongRelease(a, b) => {
                let (a, b) = (self.lower(a, positive), self.lower(b, positive));
                self.binary(formula, positive, a, b)
            }
        };
        self.memo.insert(key, id);
        id
    }

    fn junction(&mut self, conjunction: bool, a: Id, b: Id) -> Id {
        if conjunction {
            self.arena.and([a, b])
        } else {
            self.arena.or([a, b])
        }
    }

    fn binary(&mut self, operator: &Formula, positive: bool, a: Id, b: Id) -> Id {
        match (operator, positive) {
            (Formula::Until(..), true) | (Formula::Release(..), false) => self.arena.until(a, b),
            (Formula::Release(..), true) | (Formula::Until(..), false) => self.arena.release(a, b),
            (Formula::WeakUntil(..), true) | (Formula::StrongRelease(..), false) => {
                self.arena.weak(a, b)
            }
            _ => self.arena.strong(a, b),
        }
    }
}
