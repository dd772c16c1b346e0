//! From a formula to a small Büchi automaton.

use std::sync::Arc;
use std::time::Duration;

use super::approach::Approach;
use super::buchi::Buchi;
use super::degeneralize::degeneralize;
use super::graph::Graph;
use super::limits::{Limits, Watch};
use super::normal::Lowered;
use super::tour::{self, Layout, Round};
use super::{Nba, StateId, Transition, obligation, shrink, simulation, subset, tableau};
use crate::alphabet::{Alphabet, MAX_POWERSET, Props};
use crate::ltl::{Formula, MAX_DEPTH};

/// Why a formula could not be translated.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TranslateError {
    /// A proposition that the alphabet does not have.
    #[error(
        "proposition `{name}` of the formula is not one of the alphabet's: add it, or correct its name"
    )]
    UnknownProposition {
        /// Its name.
        name: String,
    },
    /// The formula is nested too deeply.
    #[error("the formula is {found} levels deep, at most {limit} are supported: split it")]
    TooDeep {
        /// Its depth.
        found: usize,
        /// [`MAX_DEPTH`].
        limit: usize,
    },
    /// [`Limits::states`] was hit.
    #[error(
        "the automaton needs more than {limit} states on the way: simplify the formula, or raise the limit on states"
    )]
    States {
        /// The limit.
        limit: usize,
    },
    /// [`Limits::transitions`] was hit.
    #[error(
        "the automaton needs more than {limit} transitions on the way: simplify the formula, or raise the limit on transitions"
    )]
    Transitions {
        /// The limit.
        limit: usize,
    },
    /// [`Limits::time`] was hit.
    #[error(
        "translation took longer than {} s: simplify the formula, or raise the limit on time", limit.as_secs_f64()
    )]
    Time {
        /// The limit.
        limit: Duration,
    },
    /// The formula waits for too many different things.
    #[error(
        "the formula has more than {limit} different eventualities (F, U, M), which is not supported: split it"
    )]
    Eventualities {
        /// How many are supported.
        limit: usize,
    },
}

/// Translates a formula to an automaton over the letters of `alphabet`.
///
/// The automaton accepts a word over these letters if and only if the word satisfies the formula.
/// Every state is useful: it can be reached, and from it some word is accepted; without states nothing
/// is accepted. There is one initial state, number 0, and states are numbered breadth-first. Equal
/// input gives the equal automaton.
///
/// Propositions of the alphabet that the formula does not use are free.
///
/// # Errors
/// A proposition that the alphabet lacks, or a limit that was hit.
///
/// ```
/// use std::sync::Arc;
/// use nngtl::alphabet::Alphabet;
/// use nngtl::automaton::{Limits, translate};
/// let alphabet = Arc::new(Alphabet::disjoint(vec!["a".into(), "b".into()])?);
/// let nba = translate(&"!a U b".parse()?, alphabet, &Limits::default())?;
/// assert_eq!((nba.len(), nba.edge_count()), (2, 3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn translate(
    formula: &Formula,
    alphabet: Arc<Alphabet>,
    limits: &Limits,
) -> Result<Nba, TranslateError> {
    translated(formula, alphabet, limits, None)
}

/// As [`translate`], for a map: what is due again and again at several places is waited for in the order of a short tour of
/// them. In the order that gives the smallest automaton a cycle of its states may go to and fro between them.
///
/// # Errors
/// As [`translate`].
pub fn translate_on(
    formula: &Formula,
    alphabet: Arc<Alphabet>,
    limits: &Limits,
    layout: &dyn Layout,
) -> Result<Nba, TranslateError> {
    translated(formula, alphabet, limits, Some(layout))
}

fn translated(
    formula: &Formula,
    alphabet: Arc<Alphabet>,
    limits: &Limits,
    layout: Option<&dyn Layout>,
) -> Result<Nba, TranslateError> {
    let depth = formula.depth();
    if depth > MAX_DEPTH {
        return Err(TranslateError::TooDeep {
            found: depth,
            limit: MAX_DEPTH,
        });
    }
    let watch = Watch::new(limits);
    let mut lowered = Lowered::new(formula, &alphabet)
        .map_err(|name| TranslateError::UnknownProposition { name })?;
    let buchi = small(&mut lowered, layout, &watch)?;
    Ok(finish(buchi, &lowered, alphabet))
}

/// Whether some word over any letters at all satisfies the formula; `None` if that was not found out.
pub(super) fn is_satisfiable(
    formula: &Formula,
    limits: &Limits,
) -> Result<Option<bool>, TranslateError> {
    let names: Vec<String> = formula
        .propositions()
        .into_iter()
        .map(str::to_owned)
        .collect();
    let n = names.len();
    let complete = n <= MAX_POWERSET;
    // With too many propositions for all combinations, letters in which at most two hold, or all but
    // at most two, may still give an example.
    let alphabet = if complete {
        Alphabet::powerset(names)
    } else {
        let pairs = (0..n).flat_map(|i| (0..n).map(move |j| Props::single(i).with(j)));
        let all = Props((0..n).fold(0, |all, i| all | Props::single(i).0));
        let sparse = pairs.chain([Props::EMPTY]);
        let letters = sparse.flat_map(|p| [p, Props(all.0 & !p.0)]);
        Alphabet::new(names, letters.collect::<Vec<_>>())
    };
    // More propositions than an alphabet can hold are not those of one.
    let Ok(alphabet) = alphabet else {
        return Ok(None);
    };
    let watch = Watch::new(limits);
    let mut lowered = Lowered::new(formula, &alphabet)
        .map_err(|name| TranslateError::UnknownProposition { name })?;
    let graph = tableau::build(&mut lowered.arena, lowered.formula, &watch)?;
    Ok((complete || graph.len() > 0).then_some(graph.len() > 0))
}

/// The most sets of states tried per state of the automaton they are made of, and at least.
const SETS: (usize, usize) = (4, 64);

/// The most edges that the negation's automaton may have to be of use.
const NEGATION_EDGES: usize = 2_000;

/// Tries several ways and takes the smallest automaton; of equal ones that which accepts soonest, since a
/// plan's prefix leads to acceptance.
fn small(
    lowered: &mut Lowered,
    layout: Option<&dyn Layout>,
    watch: &Watch<'_>,
) -> Result<Buchi, TranslateError> {
    let seen = lowered.seen.clone();
    let letters = lowered.arena.letters();
    let mut graph = tableau::build(&mut lowered.arena, lowered.formula, watch)?;
    reduce(&mut graph);
    watch.tick()?;
    let degeneralized = |graph: &Graph| match layout {
        Some(layout) => on_tour(graph, &seen, layout, watch),
        None => accepting_states(graph, watch),
    };
    let mut candidates = vec![degeneralized(&graph)?];
    if candidates[0].len() < 2 {
        return Ok(candidates.swap_remove(0));
    }
    let sets = SETS.1.max(SETS.0 * graph.len());
    if let Some(mut fewer) = subset::postpone(&graph, letters, sets) {
        reduce(&mut fewer);
        watch.tick()?;
        candidates.push(degeneralized(&fewer)?);
    }
    let negation = negation(lowered, watch)?;
    if let Some(negation) = &negation {
        candidates.extend(obligation::minimal(&graph, negation, letters, sets));
        watch.tick()?;
        candidates.dedup();
        for candidate in &mut candidates {
            shrink::shrink(candidate, negation);
            watch.tick()?;
        }
    }
    let best = candidates.into_iter().min_by_key(Buchi::rank);
    Ok(best.expect("there is a candidate"))
}

/// An automaton of the negated formula, unless it is too large to be of use.
fn negation(lowered: &mut Lowered, watch: &Watch<'_>) -> Result<Option<Graph>, TranslateError> {
    let negated = lowered.arena.negate(lowered.formula);
    let limits = Limits {
        states: NEGATION_EDGES,
        transitions: NEGATION_EDGES,
        time: watch.limits.time,
    };
    let built = tableau::build(&mut lowered.arena, negated, &watch.within(&limits));
    watch.tick()?;
    let Ok(mut graph) = built else {
        return Ok(None);
    };
    reduce(&mut graph);
    watch.tick()?;
    Ok(Some(graph))
}

/// The automaton with accepting states whose round is that of a short tour and begins soonest, the smaller one of equals; without
/// a tour the smallest.
fn on_tour(
    graph: &Graph,
    seen: &[Props],
    layout: &dyn Layout,
    watch: &Watch<'_>,
) -> Result<Buchi, TranslateError> {
    let mut best: Option<(f64, Buchi)> = None;
    for Round { marks, stops } in tour::orders(graph, seen, layout) {
        let buchi = in_order(graph, &marks, watch)?;
        let way = Approach::new(&buchi, seen, layout).length(&stops);
        let sooner = |b: &(f64, Buchi)| (way, buchi.rank()) < (b.0, b.1.rank());
        if best.as_ref().is_none_or(sooner) {
            best = Some((way, buchi));
        }
    }
    match best {
        Some((_, buchi)) => Ok(buchi),
        None => accepting_states(graph, watch),
    }
}

/// The smallest automaton with accepting states over the orders in which marks can be waited for.
fn accepting_states(graph: &Graph, watch: &Watch<'_>) -> Result<Buchi, TranslateError> {
    let order: Vec<u32> = (0..graph.marks).collect();
    let mut orders = vec![order.clone()];
    match order[..] {
        [] | [_] => {}
        [a, b] => orders.push(vec![b, a]),
        [a, b, c] => orders.extend([
            vec![a, c, b],
            vec![b, a, c],
            vec![b, c, a],
            vec![c, a, b],
            vec![c, b, a],
        ]),
        _ => orders.push(order.iter().rev().copied().collect()),
    }
    let mut best: Option<Buchi> = None;
    for order in orders {
        let buchi = in_order(graph, &order, watch)?;
        if best.as_ref().is_none_or(|b| buchi.rank() < b.rank()) {
            best = Some(buchi);
        }
    }
    Ok(best.expect("there is at least one order"))
}

/// The smaller of two automata that wait for the marks in an order: in the first round for the last one alone, or for all.
fn in_order(graph: &Graph, order: &[u32], watch: &Watch<'_>) -> Result<Buchi, TranslateError> {
    let last = (order.len() as u32).saturating_sub(1);
    let mut best: Option<Buchi> = None;
    for skipped in [last, 0].into_iter().take(1 + usize::from(last > 0)) {
        let mut buchi = degeneralize(graph, order, skipped, watch)?;
        buchi.reduce();
        watch.tick()?;
        if best.as_ref().is_none_or(|b| buchi.rank() < b.rank()) {
            best = Some(buchi);
        }
    }
    Ok(best.expect("there is at least one way to begin"))
}

fn reduce(graph: &mut Graph) {
    loop {
        let before = (graph.len(), graph.edge_count());
        graph.tidy_marks();
        graph.trim();
        if graph.len() < 2 {
            return;
        }
        simulation::reduce(graph, &mut vec![0; graph.len()]);
        if (graph.len(), graph.edge_count()) == before {
            return;
        }
    }
}

/// Back to the alphabet's letters.
fn finish(buchi: Buchi, lowered: &Lowered, alphabet: Arc<Alphabet>) -> Nba {
    let transitions = buchi.edges.iter().map(|row| {
        row.iter()
            .map(|(target, guard)| Transition {
                target: StateId(*target),
                guard: lowered.expand(guard, &alphabet),
            })
            .collect()
    });
    Nba {
        initial: (0..buchi.len().min(1) as u32).map(StateId).collect(),
        transitions: transitions.collect(),
        accepting: buchi.accepting,
        alphabet,
    }
}
