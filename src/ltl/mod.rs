//! Linear temporal logic: syntax, parser, printer, and semantics on lasso words.
//!
//! Three layers with three types: text → [`Formula`] (prints back) → automaton
//! (see [`crate::automaton`]).

mod formula;

pub use formula::Formula;
