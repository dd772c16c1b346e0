//! Neural-network guided temporal-logic motion planning.

pub mod alphabet;
pub mod automaton;
pub mod bench;
pub mod guidance;
pub mod ltl;
pub mod plan;
pub mod planner;
pub mod random;
pub mod system;
pub mod transfer;
pub mod workspace;
