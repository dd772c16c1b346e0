//! Reading automata in the Hanoi omega-automata format, version 1.
//!
//! Read are Büchi, generalised Büchi and `t` acceptance with marks on states or edges, labels on
//! states, on edges or implicit, Boolean labels and aliases, several starts. All else (`Fin`,
//! complemented sets, disjunctive acceptance, alternation, headers that change the meaning) is refused
//! by name. See Babiak et al., "The Hanoi Omega-Automata Format", CAV 2015.

mod error;
mod label;
mod lexer;
mod reader;

use std::sync::Arc;

use super::buchi::Buchi;
use super::degeneralize::degeneralize;
use super::graph::{Edge, Graph, Marks, unite};
use super::limits::{Limits, Watch};
use super::{Nba, StateId, Transition, TranslateError};
use crate::alphabet::{Alphabet, LetterSet};

pub use error::{HoaError, HoaErrorKind};

use reader::{Automaton, Reader};

/// Reads one automaton over the letters of `alphabet`, whose names its propositions must have.
///
/// With state acceptance and one set the states keep their numbers; other automata are turned into such
/// ones and numbered anew. Useless states are kept; [`super::Task::from_nba`] removes them.
///
/// # Errors
/// [`HoaError`] with the place in the text; also if there is no automaton or more than one.
///
/// ```
/// use std::sync::Arc;
/// use nngtl::alphabet::Alphabet;
/// use nngtl::automaton::{Limits, read_hoa};
/// let text = r#"HOA: v1 States: 1 Start: 0 AP: 1 "a" Acceptance: 1 Inf(0)
/// --BODY-- State: 0 [0] 0 {0} [!0] 0 --END--"#;
/// let alphabet = Arc::new(Alphabet::disjoint(vec!["a".into(), "b".into()])?);
/// let often = read_hoa(text, alphabet, &Limits::default())?;
/// assert_eq!(often.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_hoa(text: &str, alphabet: Arc<Alphabet>, limits: &Limits) -> Result<Nba, HoaError> {
    let mut reader = Reader::new(text, Some(alphabet), limits)?;
    let automaton = reader.automaton()?;
    reader.finish()?;
    convert(automaton, limits).map_err(|kind| reader.error(kind))
}

/// Reads all automata of a text, each over all combinations of its own propositions.
///
/// # Errors
/// As [`read_hoa`], and more than [`crate::alphabet::MAX_POWERSET`] propositions.
pub fn read_hoa_stream(text: &str, limits: &Limits) -> Result<Vec<Nba>, HoaError> {
    let mut reader = Reader::new(text, None, limits)?;
    let mut all = Vec::new();
    while !reader.at_end() {
        let automaton = reader.automaton()?;
        all.push(convert(automaton, limits).map_err(|kind| reader.error(kind))?);
    }
    Ok(all)
}

/// Makes a Büchi automaton with accepting states.
fn convert(automaton: Automaton, limits: &Limits) -> Result<Nba, HoaErrorKind> {
    // One mark on all edges of a state or on none: the state is accepting or not.
    let uniform = automaton.marks <= 1
        && automaton.edges.iter().all(|row| {
            let all = (1 << automaton.marks) - 1;
            row.iter().all(|e| e.1 & all == row[0].1 & all)
        });
    if uniform {
        return Ok(keep_states(automaton));
    }
    let alphabet = automaton.alphabet.clone();
    let graph = to_graph(&automaton);
    let order: Vec<u32> = (0..graph.marks).collect();
    let buchi = degeneralize(&graph, &order, 0, &Watch::new(limits)).map_err(|e| match e {
        TranslateError::States { limit } => HoaErrorKind::States { limit },
        TranslateError::Transitions { limit } => HoaErrorKind::Transitions { limit },
        other => HoaErrorKind::Inconsistent(other.to_string()),
    })?;
    Ok(from_buchi(&buchi, alphabet))
}

fn keep_states(automaton: Automaton) -> Nba {
    let mut initial: Vec<StateId> = automaton.starts.iter().map(|&q| StateId(q)).collect();
    initial.sort_unstable();
    initial.dedup();
    let accepting = |row: &Vec<(u32, Marks, LetterSet)>| {
        automaton.marks == 0 || row.first().is_some_and(|e| e.1 & 1 == 1)
    };
    Nba {
        initial,
        accepting: automaton.edges.iter().map(accepting).collect(),
        transitions: automaton
            .edges
            .iter()
            .map(|row| unite_guards(row))
            .collect(),
        alphabet: automaton.alphabet,
    }
}

fn unite_guards(row: &[(u32, Marks, LetterSet)]) -> Vec<Transition> {
    let mut united: Vec<Transition> = Vec::new();
    for (target, _, guard) in row.iter().filter(|e| !e.2.is_empty()) {
        match united.iter_mut().find(|t| t.target.0 == *target) {
            Some(t) => t.guard.union_with(guard),
            None => united.push(Transition {
                target: StateId(*target),
                guard: guard.clone(),
            }),
        }
    }
    united.sort_unstable_by_key(|t| t.target);
    united
}

fn to_graph(automaton: &Automaton) -> Graph {
    let letters = automaton.alphabet.len();
    let row = |row: &Vec<(u32, Marks, LetterSet)>| -> Vec<Edge> {
        row.iter()
            .filter(|e| !e.2.is_empty())
            .map(|(target, marks, guard)| Edge {
                target: *target,
                marks: *marks,
                guard: super::language::to_bits(guard, letters),
            })
            .collect()
    };
    let mut edges: Vec<Vec<Edge>> = automaton.edges.iter().map(row).collect();
    // The initial state comes first. Several are joined by one that has the edges of all.
    let start = match automaton.starts[..] {
        [only] => only,
        _ => {
            let starts = automaton.starts.iter();
            let all = starts.flat_map(|&q| edges[q as usize].clone()).collect();
            edges.push(all);
            edges.len() as u32 - 1
        }
    };
    edges.swap(0, start as usize);
    for e in edges.iter_mut().flatten() {
        e.target = match e.target {
            0 => start,
            q if q == start => 0,
            q => q,
        };
    }
    let mut graph = Graph {
        marks: automaton.marks,
        edges: edges.into_iter().map(unite).collect(),
    };
    graph.trim();
    graph
}

fn from_buchi(buchi: &Buchi, alphabet: Arc<Alphabet>) -> Nba {
    let transitions = buchi.edges.iter().map(|row| {
        row.iter()
            .map(|(target, guard)| {
                let mut letters = alphabet.none();
                let members = alphabet.letters().filter(|l| guard.contains(l.index()));
                members.for_each(|l| letters.insert(l));
                Transition {
                    target: StateId(*target),
                    guard: letters,
                }
            })
            .collect()
    });
    Nba {
        initial: (0..buchi.len().min(1) as u32).map(StateId).collect(),
        transitions: transitions.collect(),
        accepting: buchi.accepting.clone(),
        alphabet,
    }
}
