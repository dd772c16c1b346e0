//! Nondeterministic Büchi automata over the letters of a map.
//!
//! Formula → generalised automaton → degeneralised → reduced, knowing which letters occur; then
//! a [`Task`] adds what planning asks for: feasible accepting states and the distance ρ.

mod approach;
mod bits;
mod buchi;
mod copies;
mod cubes;
mod degeneralize;
mod emptiness;
mod graph;
mod hoa;
mod inclusion;
mod language;
mod limits;
mod nba;
mod normal;
mod obligation;
mod scc;
mod shrink;
mod simulation;
mod subset;
mod tableau;
mod task;
mod tour;
mod translate;
mod write;

pub(crate) use copies::Copies;
pub use cubes::{Cube, cubes, guard_text, letters_of};
pub use hoa::{HoaError, HoaErrorKind, read_hoa, read_hoa_stream};
pub use limits::Limits;
pub use nba::{Nba, StateId, Transition};
pub(crate) use scc::components;
pub use task::{Distances, Task, TaskError};
pub use tour::Layout;
pub use translate::{TranslateError, translate, translate_on};
