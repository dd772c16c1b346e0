//! Where subtasks begin and end: the start, and each connected part of a region.

use crate::alphabet::Letter;
use crate::automaton::Nba;
use crate::system::{Spot, TransitionSystem};

/// The number of a place; 0 is the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PlaceId(pub(crate) u32);

impl PlaceId {
    /// Where the robot starts.
    pub const START: Self = Self(0);

    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// The places of a map as a mission begins: its start, and every part of a region that can be
/// reached from it.
///
/// The paper has one place for each region; a region that is cut by obstacles, or overlaps another,
/// has one for each connected part with one letter.
#[derive(Clone, Debug, PartialEq)]
pub struct Places {
    spots: Vec<Spot>,
    /// For each letter, the number of its first place.
    first: Vec<u32>,
    counts: Vec<u32>,
}

impl Places {
    /// Lists the places of a map.
    #[must_use]
    pub fn new(system: &dyn TransitionSystem, start: Spot) -> Self {
        let mut places = Self {
            spots: vec![start],
            first: Vec::new(),
            counts: Vec::new(),
        };
        for letter in system.alphabet().letters() {
            places.first.push(places.spots.len() as u32);
            let region = !system.alphabet().props(letter).is_empty();
            let landmarks = system.landmarks(letter).iter().filter(|_| region);
            let before = places.spots.len();
            places
                .spots
                .extend(landmarks.map(|l| Spot { at: l.at, letter }));
            places.counts.push((places.spots.len() - before) as u32);
        }
        places
    }

    /// How many there are, the start included.
    #[must_use]
    #[allow(clippy::len_without_is_empty)] // the start is always there
    pub fn len(&self) -> usize {
        self.spots.len()
    }

    /// All places.
    pub fn ids(&self) -> impl Iterator<Item = PlaceId> + use<> {
        (0..self.spots.len() as u32).map(PlaceId)
    }

    /// A point of a place (the start itself, or a landmark), and its letter.
    #[must_use]
    pub fn spot(&self, place: PlaceId) -> Spot {
        self.spots[place.index()]
    }

    /// The parts that carry a letter.
    pub(crate) fn with_letter(&self, letter: Letter) -> impl Iterator<Item = PlaceId> + use<> {
        let first = self.first[letter.index()];
        (first..first + self.counts[letter.index()]).map(PlaceId)
    }

    /// The part of a region that holds a spot, if it is in one.
    #[must_use]
    pub fn region(&self, system: &dyn TransitionSystem, spot: &Spot) -> Option<PlaceId> {
        let i = spot.letter.index();
        let part = (self.counts[i] > 0).then(|| system.part(spot))??;
        (part < self.counts[i]).then(|| PlaceId(self.first[i] + part))
    }

    /// The start or the part of a region at a spot: where a skill that ends there belongs.
    #[must_use]
    pub fn of(&self, system: &dyn TransitionSystem, spot: &Spot) -> Option<PlaceId> {
        let start = self.spots[0].at == spot.at;
        self.region(system, spot)
            .or(start.then_some(PlaceId::START))
    }

    /// Which place the robot starts in: the start counts as a place of its own only outside regions.
    pub(crate) fn home(&self, system: &dyn TransitionSystem) -> PlaceId {
        self.region(system, &self.spots[0])
            .unwrap_or(PlaceId::START)
    }

    /// A name for reports: `start`, or the letter, with a number if it has several parts.
    #[must_use]
    pub fn name(&self, nba: &Nba, place: PlaceId) -> String {
        if place == PlaceId::START {
            return "start".to_owned();
        }
        let letter = self.spots[place.index()].letter;
        let name = nba.alphabet.show(letter);
        match self.counts[letter.index()] {
            1 => name,
            _ => format!("{name}#{}", place.0 - self.first[letter.index()] + 1),
        }
    }
}
