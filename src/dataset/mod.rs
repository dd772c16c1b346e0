//! Data sets of missions with expert paths, for training the networks and for benchmarks.
//!
//! [`generate`] draws maps ([`maps`]) and formulas ([`missions`]), plans each mission with the exact
//! planner ([`crate::exact`]) and writes shards that `training/` reads (`docs/dataset.md`);
//! [`read_shard`] and [`labelled_missions`] read them back.

mod blobs;
mod differences;
mod formulas;
mod gap;
mod generate;
pub mod maps;
mod mazes;
mod merge;
pub mod missions;
mod read;
mod record;
mod rooms;
mod sample;
mod shapes;

pub use differences::Difference;
pub use formulas::{FormulaList, FormulaListError};
pub use generate::{
    Expert, GenerateConfig, GenerateError, MANIFEST, MAX_STATES, MISSIONS_PER_MAP, Outcome,
    Progress, RANDOM_SHARE, generate,
};
pub use merge::{MergeError, merge};
pub use read::{
    LabelledMission, ReadError, drawn_missions, missions as labelled_missions, read_manifest,
    read_shard,
};
pub use sample::Barren;

pub use record::{
    AutomatonRecord, Counts, FORMAT, Gap, Manifest, MapRecord, MissionRecord, Pair, RecordError,
    ShardEntry, pair, point,
};
