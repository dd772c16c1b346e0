//! How far the regions of a map are from each other: what orders of visits are compared by.

use nalgebra::Point2;

use super::{Landmark, TransitionSystem};

/// Lengths of shortest ways among some regions and a start, in map units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ways {
    regions: usize,
    /// `(regions + 1)²` lengths, row by row, the start last.
    lengths: Vec<f64>,
}

impl Ways {
    /// Measures the ways around obstacles (S-5 of `nngtl.md`, III-B) between `start` and the places that stand for `regions`,
    /// numbers of the alphabet's propositions. `None` is a region that the map does not have.
    ///
    /// The place of a region is the landmark of its largest part that can be reached.
    #[must_use]
    pub fn new(
        system: &dyn TransitionSystem,
        start: Point2<f64>,
        regions: &[Option<usize>],
    ) -> Self {
        let landmarks: Vec<Option<Landmark>> = regions
            .iter()
            .map(|&region| largest(system, region?))
            .collect();
        let places: Vec<Option<Point2<f64>>> = landmarks
            .iter()
            .map(|l| l.map(|l| l.at))
            .chain([Some(start)])
            .collect();
        let side = places.len();
        let mut lengths = vec![f64::INFINITY; side * side];
        for (i, from) in places.iter().enumerate() {
            for (j, to) in places.iter().enumerate().take(i) {
                let (Some(from), Some(to)) = (from, to) else {
                    continue;
                };
                // Ways to regions are kept: searches ask for them again.
                let length = system
                    .first_leg(*from, *to, true)
                    .map_or(f64::INFINITY, |leg| leg.length);
                lengths[i * side + j] = length;
                lengths[j * side + i] = length;
            }
            lengths[i * side + i] = match landmarks.get(i) {
                Some(Some(l)) => (l.area / std::f64::consts::PI).sqrt(),
                Some(None) => f64::INFINITY,
                None => 0.0,
            };
        }
        Self {
            regions: regions.len(),
            lengths,
        }
    }

    /// The lengths from `start` to the places of the regions alone.
    #[must_use]
    pub fn from_start(
        system: &dyn TransitionSystem,
        start: Point2<f64>,
        regions: &[Option<usize>],
    ) -> Vec<f64> {
        let length = |region: &Option<usize>| {
            let to = largest(system, (*region)?)?.at;
            Some(system.first_leg(start, to, true)?.length)
        };
        let lengths = regions.iter().map(length);
        lengths.map(|l| l.unwrap_or(f64::INFINITY)).collect()
    }

    /// How many regions there are.
    #[must_use]
    pub fn regions(&self) -> usize {
        self.regions
    }

    /// All lengths, row by row.
    #[must_use]
    pub fn into_lengths(self) -> Vec<f64> {
        self.lengths
    }

    /// The lengths from a region to every region and then to the start; those of number [`Self::regions`] from the start.
    /// Infinite where no way leads. From a region to itself it is the radius of a disc of its area instead, from the start to itself 0.
    #[must_use]
    pub fn from(&self, number: usize) -> &[f64] {
        let side = self.regions + 1;
        &self.lengths[number * side..][..side]
    }
}

/// The landmark of a region's largest part; of equal ones the first.
fn largest(system: &dyn TransitionSystem, region: usize) -> Option<Landmark> {
    let letters = system.alphabet().letters_with(region);
    let landmarks = letters.iter().flat_map(|l| system.landmarks(l));
    landmarks
        .copied()
        .reduce(|best, l| if l.area > best.area { l } else { best })
}
