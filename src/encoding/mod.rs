//! What goes into the networks: a raster of the map and a graph of the automaton.
//!
//! The layout of both is the contract of `docs/networks.md`. The rasteriser works from plain
//! polygons, so this module knows no workspace type.

mod graph;
mod published;
mod raster;

pub use graph::{AutomatonGraph, GraphError, Incoming, region_order};
pub use raster::{MapInput, MapTensor};

/// How inputs are encoded; weight files name theirs by its version.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// Version 1: `docs/networks.md`, *Inputs*.
    #[default]
    Own,
    /// Version 2, of weights that the paper's published code trained: *Published checkpoints*.
    Published,
}

impl Encoding {
    /// The newest version that this code implements.
    pub const NEWEST: u32 = 2;

    /// The encoding of this version.
    #[must_use]
    pub fn of_version(version: u64) -> Option<Self> {
        match version {
            1 => Some(Self::Own),
            2 => Some(Self::Published),
            _ => None,
        }
    }
}
