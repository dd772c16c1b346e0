//! Data sets of missions with expert paths, for training the networks and for benchmarks.

pub mod maps;
pub mod missions;
mod rooms;
mod shapes;
