//! The library of skills 𝓛 of one map.

mod file;

use std::collections::HashMap;

use super::places::{PlaceId, Places};
use super::skill::{ROUNDING, Skill};
use crate::alphabet::Letter;
use crate::system::{Spot, TransitionSystem};

pub use file::{Dropped, LibraryError, LibraryFile, Loaded, StoredSkill};

/// What a skill ends at: any point of a part of a region, or one point outside of regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Anchor {
    /// A connected part of the space that carries a letter.
    Part(Letter, u32),
    /// A point outside of regions, by the bits of its coordinates.
    Point(u64, u64),
}

impl Anchor {
    /// What a spot belongs to.
    #[must_use]
    pub fn of(system: &dyn TransitionSystem, spot: &Spot) -> Self {
        let region = !system.alphabet().props(spot.letter).is_empty();
        match system.part(spot).filter(|_| region) {
            Some(part) => Self::Part(spot.letter, part),
            None => Self::Point(spot.at.x.to_bits(), spot.at.y.to_bits()),
        }
    }
}

/// What became of a skill that was offered to a library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Offer {
    /// It is new or better than what it replaces.
    Kept,
    /// The library has one that is as short and passes no other letters.
    Dominated,
}

/// Skills of one map, none of which is dominated by another.
#[derive(Clone, Debug)]
pub struct Library {
    fingerprint: String,
    skills: Vec<Skill>,
    /// Skills by the things they join, the smaller first.
    by_ends: HashMap<(Anchor, Anchor), Vec<usize>>,
}

impl Library {
    /// A library of a map, without skills.
    #[must_use]
    pub fn new(system: &dyn TransitionSystem) -> Self {
        Self {
            fingerprint: system.fingerprint(),
            skills: Vec::new(),
            by_ends: HashMap::new(),
        }
    }

    /// The hash of the map's geometry.
    #[must_use]
    pub fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    /// The skills, in the order they were learned.
    #[must_use]
    pub fn skills(&self) -> &[Skill] {
        &self.skills
    }

    /// How many pairs of endpoints the skills join (the paper counts these as skills: 21).
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.by_ends.len()
    }

    /// Offers a skill. One that another dominates (same ends, no longer, no other letters) is not
    /// kept; what it dominates is replaced. Moves are reversible, so a path and its reverse are one.
    pub fn offer(&mut self, system: &dyn TransitionSystem, skill: Skill) -> Offer {
        let (a, b) = (
            Anchor::of(system, &skill.first()),
            Anchor::of(system, &skill.last()),
        );
        let entry = self.by_ends.entry((a.min(b), a.max(b))).or_default();
        let dominates = |x: &Skill, y: &Skill| {
            x.cost() <= y.cost() * (1.0 + ROUNDING) && x.letters().is_subset(y.letters())
        };
        if entry.iter().any(|&i| dominates(&self.skills[i], &skill)) {
            return Offer::Dominated;
        }
        let beaten: Vec<usize> = entry
            .iter()
            .copied()
            .filter(|&i| dominates(&skill, &self.skills[i]))
            .collect();
        match beaten.split_first() {
            None => {
                entry.push(self.skills.len());
                self.skills.push(skill);
            }
            Some((&first, rest)) => {
                self.skills[first] = skill;
                if !rest.is_empty() {
                    self.remove(system, rest);
                }
            }
        }
        Offer::Kept
    }

    /// Takes over the skills of another library of the same map; returns how many were kept.
    pub fn merge(&mut self, system: &dyn TransitionSystem, other: &Self) -> usize {
        let offers = other.skills.iter().cloned();
        offers
            .map(|skill| self.offer(system, skill))
            .filter(|&offer| offer == Offer::Kept)
            .count()
    }

    fn remove(&mut self, system: &dyn TransitionSystem, which: &[usize]) {
        let skills = std::mem::take(&mut self.skills);
        self.by_ends.clear();
        for (i, skill) in skills.into_iter().enumerate() {
            if which.contains(&i) {
                continue;
            }
            let (a, b) = (
                Anchor::of(system, &skill.first()),
                Anchor::of(system, &skill.last()),
            );
            let entry = self.by_ends.entry((a.min(b), a.max(b))).or_default();
            entry.push(self.skills.len());
            self.skills.push(skill);
        }
    }
}

/// A skill on the shelf, and which way it is to be walked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Use {
    pub(crate) skill: u32,
    /// A backward match (Def. 3.2): the path is walked from its end.
    pub(crate) backward: bool,
}

/// A library laid out for one start: skills by the places they lead from and to.
#[derive(Clone, Debug)]
pub(crate) struct Shelf<'a> {
    pub(crate) library: &'a Library,
    places: usize,
    between: Vec<Vec<Use>>,
}

impl<'a> Shelf<'a> {
    pub(crate) fn new(
        library: &'a Library,
        system: &dyn TransitionSystem,
        places: &Places,
    ) -> Self {
        let n = places.len();
        let mut between = vec![Vec::new(); n * n];
        for (i, skill) in library.skills.iter().enumerate() {
            let skill_number = i as u32;
            let ends = (
                places.of(system, &skill.first()),
                places.of(system, &skill.last()),
            );
            let (Some(a), Some(b)) = ends else { continue };
            for (from, to, backward) in [(a, b, false), (b, a, true)] {
                between[from.index() * n + to.index()].push(Use {
                    skill: skill_number,
                    backward,
                });
            }
        }
        Self {
            library,
            places: n,
            between,
        }
    }

    pub(crate) fn skill(&self, used: Use) -> &'a Skill {
        &self.library.skills[used.skill as usize]
    }

    /// Skills that lead from one place to another.
    pub(crate) fn between(&self, from: PlaceId, to: PlaceId) -> &[Use] {
        &self.between[from.index() * self.places + to.index()]
    }

    /// Skills that leave a place, with where they lead.
    pub(crate) fn leaving(&self, from: PlaceId) -> impl Iterator<Item = (PlaceId, Use)> + '_ {
        let row = &self.between[from.index() * self.places..(from.index() + 1) * self.places];
        row.iter()
            .enumerate()
            .flat_map(|(to, uses)| uses.iter().map(move |&u| (PlaceId(to as u32), u)))
    }
}
