//! What goes into the networks: a raster of the map and a graph of the automaton.
//!
//! The layout of both is the contract of `docs/networks.md`. The rasteriser works from plain
//! polygons, so this module knows no workspace type.

mod graph;
mod raster;

pub use graph::{AutomatonGraph, GraphError, Incoming, region_order};
pub use raster::{MapInput, MapTensor};

/// The version of the input encoding that this code implements; weight files name theirs.
pub const ENCODING_VERSION: u32 = 1;
