//! Linear temporal logic: syntax, parser, printer, and semantics on lasso words.
//!
//! Three layers with three types: text → [`Formula`] (prints back) → automaton
//! (see [`crate::automaton`]).
//!
//! # Grammar
//!
//! The syntax of Spot and of SPIN together. From loosest to tightest:
//!
//! | operators | also written | grouping |
//! | --- | --- | --- |
//! | `->` `<->` | `=>` `-->` `→` `implies`, `<=>` `<-->` `equivalent` | right |
//! | `\|` | `\|\|` `\/` `OR` `∨` | left |
//! | `xor` | `^` | left |
//! | `&` | `&&` `/\` `AND` `∧` | left |
//! | `U` `R` `W` `M` | `until` `stronguntil`, `V` `release`, `weakuntil` | right |
//! | `!` `X` `F` `G` | `~` `NOT` `¬`, `next`, `<>` `eventually`, `[]` `always` | prefix |
//!
//! `true` and `1`, `false` and `0` are constants. Everything else that looks like a name
//! (`[A-Za-z_][A-Za-z0-9_.]*`, other alphabets' letters included) is a proposition; any name can
//! stand in double quotes, with `\` before `"` and `\`.
//!
//! Beware when moving formulas between tools: ltl2ba reads `a U b U c` as `(a U b) U c` and gives
//! `|` and `&` other precedences. Here, as in Spot, it is `a U (b U c)`, and `&` binds tighter.
//!
//! **Runs of operators.** `GFa` is `G F a`, `FG!a` is `F G !a`, `a UFb` is `a U F b`: where an operand
//! is expected, a leading `F`, `G` or `X` is an operator unless a digit follows (`F1` is a name),
//! and where an operator is expected, a leading `U`, `R`, `V`, `W` or `M` is one. A proposition whose
//! name starts with such a letter (`Goal`, `Field`) must be quoted, or listed in
//! [`ParseOptions::known`], which names taken from a map are.
//!
//! # Semantics
//!
//! Words are infinite sequences of letters. `X φ` speaks of the word without its first letter; in
//! the loop of a lasso the letter after the last is the loop's first. See [`semantics`].

mod error;
mod formula;
mod lexer;
mod parser;
mod print;
pub mod random;
pub mod semantics;

pub use error::{ParseError, ParseErrorKind, Unsupported};
pub use formula::Formula;
pub(crate) use lexer::bad_name;
pub use parser::{MAX_DEPTH, ParseOptions, Parsed, PropositionUse, check_propositions, parse};
