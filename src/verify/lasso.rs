//! Infinite words that repeat, and who accepts them.

use crate::alphabet::{Alphabet, Letter, Props};
use crate::automaton::Nba;
use crate::ltl::{Formula, semantics};

use super::Refusal;

/// The infinite word `prefix (suffix)^ω`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lasso {
    /// Read once; may be empty.
    pub prefix: Vec<Letter>,
    /// Read for ever; never empty.
    pub suffix: Vec<Letter>,
}

impl Lasso {
    /// Shows the word as `{} {a} ({b} {})^ω`. Letters that only continue what was there before
    /// are left out: the words of continuous motion mean the same when a letter is repeated.
    #[must_use]
    pub fn show(&self, alphabet: &Alphabet) -> String {
        let mut prefix = self.prefix.clone();
        prefix.dedup();
        let mut suffix = self.suffix.clone();
        suffix.dedup();
        if suffix.len() > 1 && suffix.first() == suffix.last() {
            suffix.pop();
        }
        if prefix.last() == suffix.first() {
            prefix.pop();
        }
        let once = |letters: Vec<Letter>| letters.into_iter().map(|l| alphabet.show(l)).collect();
        joined(once(prefix), once(suffix))
    }

    /// Shows the word as `{}^3 {a} ({b} {}^2)^ω`, where every letter counts, as on a grid: how often each is read in a row.
    #[must_use]
    pub fn show_counted(&self, alphabet: &Alphabet) -> String {
        let counted = |letters: &[Letter]| {
            let runs = letters.chunk_by(|a, b| a == b);
            runs.map(|run| match run.len() {
                1 => alphabet.show(run[0]),
                n => format!("{}^{n}", alphabet.show(run[0])),
            })
            .collect()
        };
        joined(counted(&self.prefix), counted(&self.suffix))
    }
}

fn joined(mut prefix: Vec<String>, suffix: Vec<String>) -> String {
    prefix.push(format!("({})^ω", suffix.join(" ")));
    prefix.join(" ")
}

/// Whether the word satisfies the formula, by LTL's own semantics.
pub(super) fn satisfies(
    word: &Lasso,
    formula: &Formula,
    alphabet: &Alphabet,
) -> Result<bool, Refusal> {
    let props =
        |letters: &[Letter]| -> Vec<Props> { letters.iter().map(|&l| alphabet.props(l)).collect() };
    semantics::holds(
        formula,
        &props(&word.prefix),
        &props(&word.suffix),
        alphabet,
    )
    .map_err(|e| Refusal::Evaluate(e.to_string()))
}

/// The formulas whose conjunction `formula` is, at its top.
pub(super) fn conjuncts(formula: &Formula) -> Vec<&Formula> {
    match formula {
        Formula::And(a, b) => {
            let mut parts = conjuncts(a);
            parts.extend(conjuncts(b));
            parts
        }
        other => vec![other],
    }
}

/// Whether a Büchi automaton accepts the word: some run visits an accepting state for ever.
///
/// Positions of the word and states of the automaton span a finite graph; the word is accepted if
/// an accepting node in the repeated part can be reached from the beginning and from itself.
#[must_use]
pub fn accepts(automaton: &Nba, word: &Lasso) -> bool {
    let graph = Graph { automaton, word };
    let begin = automaton.initial.iter().map(|q| (0, q.index()));
    let reachable = graph.reach(begin);
    let states = automaton.len();
    (word.prefix.len()..word.prefix.len() + word.suffix.len())
        .flat_map(|position| (0..states).map(move |q| (position, q)))
        .filter(|&(position, q)| reachable[position * states + q] && automaton.accepting[q])
        .any(|node| graph.reach(graph.next(node))[node.0 * states + node.1])
}

struct Graph<'a> {
    automaton: &'a Nba,
    word: &'a Lasso,
}

impl Graph<'_> {
    fn letter(&self, position: usize) -> Letter {
        let word = self.word;
        match word.prefix.get(position) {
            Some(&letter) => letter,
            None => word.suffix[position - word.prefix.len()],
        }
    }

    fn next(&self, (position, q): (usize, usize)) -> impl Iterator<Item = (usize, usize)> + '_ {
        let letter = self.letter(position);
        let end = self.word.prefix.len() + self.word.suffix.len();
        let after = if position + 1 == end {
            self.word.prefix.len()
        } else {
            position + 1
        };
        self.automaton.transitions[q]
            .iter()
            .filter(move |t| t.guard.contains(letter))
            .map(move |t| (after, t.target.index()))
    }

    /// Which nodes can be reached from `begin`, these included, by `position * states + q`.
    fn reach(&self, begin: impl Iterator<Item = (usize, usize)>) -> Vec<bool> {
        let states = self.automaton.len();
        let positions = self.word.prefix.len() + self.word.suffix.len();
        let mut seen = vec![false; positions * states];
        let mut open: Vec<(usize, usize)> = begin.collect();
        while let Some(node) = open.pop() {
            if !std::mem::replace(&mut seen[node.0 * states + node.1], true) {
                open.extend(self.next(node));
            }
        }
        seen
    }
}
