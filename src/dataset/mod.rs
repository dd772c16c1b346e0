//! Data.
pub mod maps;
pub mod missions;
mod rooms;
mod shapes;
