//! Automata as text: a table for people, DOT for pictures, HOA for other tools.

use std::fmt::{self, Write};

use super::cubes::{cubes, guard_text, join};
use super::{Nba, StateId, Transition};
use crate::alphabet::Props;

/// A table: one line per transition, `>` before initial states, `*` after accepting ones.
///
/// ```
/// use std::sync::Arc;
/// use nngtl::alphabet::Alphabet;
/// use nngtl::automaton::{Limits, translate};
/// let alphabet = Arc::new(Alphabet::disjoint(vec!["a".into(), "b".into()])?);
/// let nba = translate(&"!a U b".parse()?, alphabet, &Limits::default())?;
/// assert_eq!(nba.to_string(), "\
/// 2 states, 3 edges
/// > 0    -> 0  !a & !b
///        -> 1  b
///   1 *  -> 1  1
/// ");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl fmt::Display for Nba {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        let (n, e) = (self.len(), self.edge_count());
        writeln!(f, "{n} state{}, {e} edge{}", plural(n), plural(e))?;
        let width = n.saturating_sub(1).to_string().len();
        for q in self.states() {
            let start = if self.initial.contains(&q) { '>' } else { ' ' };
            let accept = if self.is_accepting(q) { '*' } else { ' ' };
            let head = format!("{start} {:width$} {accept}", q.0);
            if self.outgoing(q).is_empty() {
                writeln!(f, "{}", head.trim_end())?;
            }
            for (i, t) in self.outgoing(q).iter().enumerate() {
                let head = if i == 0 { head.as_str() } else { "" };
                let guard = guard_text(&t.guard, &self.alphabet);
                let margin = width + 4;
                writeln!(f, "{head:margin$}  -> {:width$}  {guard}", t.target.0)?;
            }
        }
        Ok(())
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

impl Nba {
    /// The automaton in Graphviz' DOT language; `name` is the picture's title.
    #[must_use]
    pub fn to_dot(&self, name: Option<&str>) -> String {
        let mut text = String::from("digraph nba {\n  rankdir=LR\n");
        if let Some(name) = name {
            let _ = writeln!(text, "  label={}\n  labelloc=t", quoted(name));
        }
        text.push_str("  node [shape=circle]\n");
        for q in &self.initial {
            let _ = writeln!(text, "  i{0} [shape=point, label=\"\"]\n  i{0} -> {0}", q.0);
        }
        for q in self.states() {
            let shape = if self.is_accepting(q) {
                " [shape=doublecircle]"
            } else {
                ""
            };
            let _ = writeln!(text, "  {}{shape}", q.0);
        }
        for q in self.states() {
            for t in self.outgoing(q) {
                let guard = quoted(&guard_text(&t.guard, &self.alphabet));
                let _ = writeln!(text, "  {} -> {} [label={guard}]", q.0, t.target.0);
            }
        }
        text.push_str("}\n");
        text
    }

    /// The automaton in the Hanoi omega-automata format, version 1; `name` is usually the formula.
    ///
    /// One start (a fresh state is added where there are several or none), state acceptance,
    /// explicit labels, `AP` in order of first use. Labels are the [`cubes`] of the guards: on letters
    /// that do not occur on the map they say nothing, so read the automaton back over the same
    /// letters.
    #[must_use]
    pub fn to_hoa(&self, name: Option<&str>) -> String {
        let single = self.with_one_initial();
        single.write_hoa(name)
    }

    /// The same language with exactly one initial state, the first; itself if it is so already.
    #[must_use]
    pub fn with_one_initial(&self) -> Self {
        if self.initial == [StateId(0)] {
            return self.clone();
        }
        let mut first: Vec<Transition> = Vec::new();
        for q in &self.initial {
            for t in self.outgoing(*q) {
                match first.iter_mut().find(|f| f.target.0 == t.target.0 + 1) {
                    Some(f) => f.guard.union_with(&t.guard),
                    None => first.push(Transition {
                        target: StateId(t.target.0 + 1),
                        guard: t.guard.clone(),
                    }),
                }
            }
        }
        first.sort_unstable_by_key(|t| t.target);
        let shifted = self.transitions.iter().map(|row| {
            row.iter()
                .map(|t| Transition {
                    target: StateId(t.target.0 + 1),
                    guard: t.guard.clone(),
                })
                .collect()
        });
        Self {
            alphabet: self.alphabet.clone(),
            initial: vec![StateId(0)],
            accepting: std::iter::once(false)
                .chain(self.accepting.iter().copied())
                .collect(),
            transitions: std::iter::once(first).chain(shifted).collect(),
        }
    }

    fn write_hoa(&self, name: Option<&str>) -> String {
        let guards: Vec<Vec<_>> = self
            .transitions
            .iter()
            .map(|row| {
                row.iter()
                    .map(|t| cubes(&t.guard, &self.alphabet))
                    .collect()
            })
            .collect();
        let mut used: Vec<usize> = Vec::new();
        for cube in guards.iter().flatten().flatten() {
            for i in Props(cube.positive.0 | cube.negative.0).iter() {
                if !used.contains(&i) {
                    used.push(i);
                }
            }
        }
        let mut text = String::from("HOA: v1\n");
        if let Some(name) = name {
            let _ = writeln!(text, "name: {}", quoted(name));
        }
        let _ = write!(text, "States: {}\nStart: 0\nAP: {}", self.len(), used.len());
        for &i in &used {
            let _ = write!(text, " {}", quoted(&self.alphabet.propositions()[i]));
        }
        text.push_str("\nacc-name: Buchi\nAcceptance: 1 Inf(0)\n");
        text.push_str("properties: trans-labels explicit-labels state-acc\n--BODY--\n");
        let number = |i: usize| used.iter().position(|&u| u == i).unwrap_or(i).to_string();
        for q in self.states() {
            let sets = if self.is_accepting(q) { " {0}" } else { "" };
            let _ = writeln!(text, "State: {}{sets}", q.0);
            for (t, guard) in self.outgoing(q).iter().zip(&guards[q.index()]) {
                let label = join(guard, "&", " | ", ["t", "f"], number);
                let _ = writeln!(text, "[{label}] {}", t.target.0);
            }
        }
        text.push_str("--END--\n");
        text
    }
}
