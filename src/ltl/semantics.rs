//! What a formula says about a word, by its own definition.
//!
//! Words are infinite; the ones that can be written down are lassos `u v v v …`. Every subformula
//! is evaluated at every position of `u v`: the temporal operators are the least (`F`, `U`, `M`) and
//! greatest (`G`, `R`, `W`) solutions of their expansion laws, found by walking backwards, twice
//! around the loop. Nothing here knows automata, so that plans can be checked against it.

use super::Formula;
use crate::alphabet::{Alphabet, Props};

/// Why a formula could not be evaluated.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// The repeated part has no letter.
    #[error("the repeated part of a word needs at least one letter, found none")]
    EmptyCycle,
    /// A proposition has no meaning.
    #[error("proposition `{0}` of the formula has no meaning in this word: give it one")]
    UnknownProposition(String),
}

/// Whether the word `prefix cycle cycle cycle …` satisfies the formula; the propositions of a
/// letter are numbered as in `alphabet`. The letters need not occur in the alphabet.
///
/// # Errors
/// An empty cycle, or a proposition that `alphabet` does not have.
///
/// ```
/// use nngtl::alphabet::{Alphabet, Props};
/// use nngtl::ltl::{Formula, semantics};
/// let alphabet = Alphabet::disjoint(vec!["a".into(), "b".into()])?;
/// let formula: Formula = "Fa & G(a -> Xb)".parse()?;
/// let (none, a, b) = (Props::EMPTY, Props::single(0), Props::single(1));
/// assert!(semantics::holds(&formula, &[none, a], &[b], &alphabet)?);
/// assert!(!semantics::holds(&formula, &[none, a], &[a, b], &alphabet)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn holds(
    formula: &Formula,
    prefix: &[Props],
    cycle: &[Props],
    alphabet: &Alphabet,
) -> Result<bool, EvaluateError> {
    let word = |i: usize| *prefix.get(i).unwrap_or_else(|| &cycle[i - prefix.len()]);
    holds_by(formula, prefix.len(), cycle.len(), |name, position| {
        alphabet
            .proposition(name)
            .map(|index| word(position).contains(index))
    })
}

/// As [`holds`], for a word of which only the lengths and a look-up are known: `lookup(p, i)` says
/// whether proposition `p` holds at position `i` of the prefix followed by one round of the cycle,
/// `None` that `p` has no meaning.
///
/// # Errors
/// An empty cycle, or a proposition without meaning.
pub fn holds_by(
    formula: &Formula,
    prefix: usize,
    cycle: usize,
    mut lookup: impl FnMut(&str, usize) -> Option<bool>,
) -> Result<bool, EvaluateError> {
    if cycle == 0 {
        return Err(EvaluateError::EmptyCycle);
    }
    let lasso = Lasso {
        prefix,
        length: prefix + cycle,
    };
    // Children come after their parents in `subformulas`, so the reverse order has all values ready,
    // the left child's on top.
    let nodes: Vec<&Formula> = formula.subformulas().collect();
    let mut values: Vec<Vec<bool>> = Vec::new();
    for node in nodes.into_iter().rev() {
        let arity = node.children().count();
        let mut operands = values.split_off(values.len() - arity);
        let first = operands.pop().unwrap_or_default();
        let second = operands.pop().unwrap_or_default();
        values.push(match node {
            Formula::Prop(name) => (0..lasso.length)
                .map(|i| lookup(name, i))
                .collect::<Option<Vec<bool>>>()
                .ok_or_else(|| EvaluateError::UnknownProposition(name.clone()))?,
            other => lasso.apply(other, &first, &second),
        });
    }
    Ok(values[0][0])
}

/// The positions of a lasso word; the one after the last is `prefix`.
struct Lasso {
    prefix: usize,
    length: usize,
}

impl Lasso {
    fn next(&self, i: usize) -> usize {
        if i + 1 == self.length {
            self.prefix
        } else {
            i + 1
        }
    }

    /// Solves `x(i) = step(i, x(i+1))` from below (`start` false) or above (`start` true).
    ///
    /// Once around the loop gives the right value at the loop's first position, the second round
    /// carries it to all the others.
    fn solve(&self, start: bool, step: impl Fn(usize, bool) -> bool) -> Vec<bool> {
        let mut x = vec![start; self.length];
        let round = (self.prefix..self.length).rev();
        for i in round.clone().chain(round).chain((0..self.prefix).rev()) {
            x[i] = step(i, x[self.next(i)]);
        }
        x
    }

    /// The values of an operator from those of its operands (`a` alone if it has one).
    fn apply(&self, operator: &Formula, a: &[bool], b: &[bool]) -> Vec<bool> {
        let each = |f: &dyn Fn(usize) -> bool| (0..self.length).map(f).collect();
        match operator {
            Formula::True => vec![true; self.length],
            Formula::False | Formula::Prop(_) => vec![false; self.length],
            Formula::Not(_) => each(&|i| !a[i]),
            Formula::And(..) => each(&|i| a[i] && b[i]),
            Formula::Or(..) => each(&|i| a[i] || b[i]),
            Formula::Implies(..) => each(&|i| !a[i] || b[i]),
            Formula::Iff(..) => each(&|i| a[i] == b[i]),
            Formula::Next(_) => each(&|i| a[self.next(i)]),
            Formula::Finally(_) => self.solve(false, |i, later| a[i] || later),
            Formula::Globally(_) => self.solve(true, |i, later| a[i] && later),
            Formula::Until(..) => self.solve(false, |i, later| b[i] || a[i] && later),
            Formula::WeakUntil(..) => self.solve(true, |i, later| b[i] || a[i] && later),
            Formula::Release(..) => self.solve(true, |i, later| b[i] && (a[i] || later)),
            Formula::StrongRelease(..) => self.solve(false, |i, later| b[i] && (a[i] || later)),
        }
    }
}
