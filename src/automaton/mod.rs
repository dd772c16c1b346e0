//! Nondeterministic Büchi automata over the letters of a map.
//!
//! Formula → generalised automaton → degeneralised → reduced, knowing which letters occur; then
//! a [`Task`] adds what planning asks for: feasible accepting states and the distance ρ.

mod bits;
mod buchi;
mod cubes;
mod degeneralize;
mod graph;
mod language;
mod limits;
mod nba;
mod normal;
mod scc;
mod simulation;
mod tableau;
mod task;
mod translate;
mod write;

pub use cubes::{Cube, cubes, guard_text, letters_of};
pub use limits::Limits;
pub use nba::{Nba, StateId, Transition};
pub use task::{Distances, Task, TaskError};
pub use translate::{TranslateError, translate};
