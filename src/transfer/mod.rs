//! Transfer planning: skills that are learned once and reused (`transfer-planning.md`).

mod budget;
mod build;
mod goals;
mod learn;
mod library;
mod matching;
mod optimum;
mod places;
mod plan;
mod replan;
mod reuse;
mod rounds;
mod search;
mod skill;
mod subtasks;
mod suffix;

pub use build::{BuildProgress, BuildSampler, BuildSettings, Built, build};
pub use learn::learn;
pub use library::{
    Anchor, Dropped, Library, LibraryError, LibraryFile, Loaded, Offer, StoredSkill,
};
pub use optimum::optimum;
pub use places::{PlaceId, Places};
pub use plan::{Reused, SubtaskCounts, Transferred, count_subtasks, transfer};
pub use replan::{BeyondRepair, Repair, Replanned, replan};
pub use skill::{Skill, SkillError};
pub use subtasks::{Endpoint, Equivalence, Position, Subtask, SubtaskGraph};
