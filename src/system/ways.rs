//! How far the regions of a map are from each other: what orders of visits are compared by.

use std::cell::OnceCell;
use std::sync::Arc;

use nalgebra::Point2;

use super::{Continuous, Landmark, TransitionSystem};
use crate::automaton::Layout;
use crate::workspace::Workspace;

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

/// A map as tours see it: ways around obstacles between the places that stand for regions, as in [`Ways`]. Nothing is
/// prepared before the first question, which most formulas never ask.
#[derive(Debug)]
pub struct MapLayout {
    map: Arc<Workspace>,
    start: Point2<f64>,
    system: OnceCell<Option<Arc<Continuous>>>,
}

impl MapLayout {
    /// The places of a map with the robot at `start`.
    #[must_use]
    pub fn new(map: Arc<Workspace>, start: Point2<f64>) -> Self {
        Self {
            map,
            start,
            system: OnceCell::new(),
        }
    }

    /// The same where the map is prepared already.
    #[must_use]
    pub fn of(system: &Arc<Continuous>, start: Point2<f64>) -> Self {
        Self {
            map: Arc::clone(system.map()),
            start,
            system: OnceCell::from(Some(Arc::clone(system))),
        }
    }
}

impl Layout for MapLayout {
    fn length(&self, from: Option<usize>, to: usize) -> f64 {
        let system = self.system.get_or_init(|| {
            Continuous::new(Arc::clone(&self.map), self.start)
                .ok()
                .map(Arc::new)
        });
        let between = || {
            let system = system.as_deref()?;
            let from = match from {
                Some(region) => largest(system, region)?.at,
                None => self.start,
            };
            let to = largest(system, to)?.at;
            Some(system.first_leg(from, to, true)?.length)
        };
        between().unwrap_or(f64::INFINITY)
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::system::Continuous;
    use crate::workspace::{Bounds, Polygon, Region, Workspace};

    fn rectangle(low: [f64; 2], high: [f64; 2]) -> Polygon {
        let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
        Polygon::new(corners.map(|[x, y]| Point2::new(x, y)).to_vec()).unwrap()
    }

    /// Regions a and b on both sides of a wall that ends at a height of 0.8, c walled in.
    fn world() -> Continuous {
        let obstacles = vec![
            rectangle([0.45, 0.0], [0.55, 0.8]),
            rectangle([0.7, 0.7], [0.95, 0.75]),
            rectangle([0.7, 0.9], [0.95, 0.95]),
            rectangle([0.7, 0.75], [0.75, 0.9]),
            rectangle([0.9, 0.75], [0.95, 0.9]),
        ];
        let region = |name: &str, low, high| Region {
            name: name.to_owned(),
            polygon: rectangle(low, high),
        };
        let regions = vec![
            region("a", [0.2, 0.1], [0.3, 0.2]),
            region("b", [0.7, 0.1], [0.8, 0.2]),
            region("c", [0.8, 0.8], [0.85, 0.85]),
        ];
        let map = Workspace::new(Bounds::unit(), obstacles, regions).unwrap();
        Continuous::new(Arc::new(map), Point2::new(0.1, 0.9)).unwrap()
    }

    #[test]
    fn ways_go_around_walls_and_end_where_none_leads() {
        let system = world();
        let start = system.start().at;
        let ways = Ways::new(&system, start, &[Some(1), None, Some(0), Some(2)]);
        let place = |p: usize| largest(&system, p).unwrap().at;
        let (a, b) = (place(0), place(1));
        let corners = [Point2::new(0.45, 0.8), Point2::new(0.55, 0.8)];
        let around = (corners[0] - a).norm() + 0.1 + (b - corners[1]).norm();
        assert!((ways.from(0)[2] - around).abs() < 1e-9, "{ways:?}");
        assert_eq!(ways.from(0)[2], ways.from(2)[0]);
        assert!((ways.from(2)[4] - (a - start).norm()).abs() < 1e-9);
        assert!((ways.from(0)[0] - (0.01_f64 / std::f64::consts::PI).sqrt()).abs() < 1e-9);
        assert_eq!(ways.from(4)[4], 0.0);
        for (other, &length) in ways.from(3).iter().enumerate() {
            assert!(length.is_infinite(), "from c to {other}");
            assert!(ways.from(1)[other].is_infinite());
        }
        let from_start = Ways::from_start(&system, start, &[Some(1), None, Some(0), Some(2)]);
        assert_eq!(from_start, ways.from(4)[..4]);
    }
}
