//! Neural-network guided temporal-logic motion planning.

pub mod alphabet;
pub mod automaton;
pub mod bench;
pub mod cli;
pub mod dataset;
pub mod encoding;
pub mod exact;
pub mod guidance;
pub mod ltl;
pub mod maps;
pub mod mission;
pub mod nn;
mod number;
pub mod plan;
pub mod planner;
mod queue;
pub mod random;
pub mod render;
pub mod scenario;
pub mod shorten;
mod simd;
pub mod system;
pub mod transfer;
pub mod verify;
pub mod workspace;
