//! Nondeterministic Büchi automata over the letters of a map.
//!
//! Formula → generalised automaton → degeneralised → reduced, knowing which letters occur; then
//! a [`Task`] adds what planning asks for: feasible accepting states and the distance ρ.

mod nba;
mod task;

pub use nba::{Nba, StateId, Transition};
pub use task::{Distances, Task};
