//! The continuous workspace as a transition system: straight segments, Euclidean lengths.

mod allowed;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::Point2;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::{Landmark, Leg, Spot, TransitionSystem};
use crate::alphabet::{Alphabet, Letter, LetterSet, Props};
use crate::number::Brief;
use crate::random::Random;
use crate::workspace::visibility::{PathsTo, VisibilityGraph};
use crate::workspace::{Bounds, Place, Polygon, Workspace};
use allowed::Allowed;

/// Shortest paths are kept up to so many units of 64 bytes (256 MiB), and those to the newest target
/// however many they are.
const MAX_KEPT: usize = 4 << 20;

/// Whether all paths fit is estimated from how much those to the first so many corners take.
const SAMPLE: usize = 2_000;

/// Paths take at most about so many windows for each corner: in lattices, where ways of equal length abound.
const MOST_WINDOWS: usize = 16;

/// Where paths take more windows than that for each corner, almost all corners see each other, as among specks on an open field.
/// A wavefront that goes everywhere would take minutes there, while one that goes to a single place meets little.
const OPEN_WINDOWS: usize = 32;

/// On maps with fewer corners it takes no longer than a second either way.
const OPEN_CORNERS: usize = 4_000;

/// A search asks for ways to about so many places of each region: the middles of its parts and its corners.
const TARGETS_OF_REGION: usize = 7;

/// Why a robot cannot start where it should.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// Beyond the bounds, or not a number.
    #[error("the start ({}, {}) lies outside the bounds of the workspace: move it inside", Brief(*x), Brief(*y))]
    Outside {
        /// Its x coordinate.
        x: f64,
        /// Its y coordinate.
        y: f64,
    },
    /// In the interior of an obstacle.
    #[error("the start ({x}, {y}) lies inside obstacle {obstacle} (counted from 0): move it out")]
    InObstacle {
        /// Its x coordinate.
        x: f64,
        /// Its y coordinate.
        y: f64,
        /// The obstacle.
        obstacle: usize,
    },
}

/// Of maps with more corners than this, no shortest ways around regions are prepared: each set of forbidden regions
/// needs a triangulation of its own.
const MAX_CORNERS: usize = 20_000;

/// Ways around so many sets of forbidden regions are kept at most.
const MAX_SETS: usize = 64;

/// A workspace with a start: which parts of the map can be reached, and how.
#[derive(Debug)]
pub struct Continuous {
    ways: Ways,
    /// By the letters that may be passed: shortest ways that keep out of all other regions. `None` where there is
    /// nothing to keep out of, or no map would be left.
    around: Mutex<FxHashMap<LetterSet, Option<Arc<Ways>>>>,
    /// Which ways need none of them.
    allowed: Mutex<Allowed>,
    start: Spot,
    landmarks: Vec<Vec<Landmark>>,
    /// For each letter and cell, the number of the landmark that stands for it.
    parts: Vec<Vec<Option<u32>>>,
    reachable: LetterSet,
}

/// Shortest ways between places of a map, those to some targets kept.
#[derive(Debug)]
struct Ways {
    graph: VisibilityGraph,
    known: Mutex<Known>,
    /// Where the robot starts.
    start: Point2<f64>,
    /// How many targets a search will ask for, about.
    targets: usize,
    /// What is kept; found when it is first asked for.
    keeping: OnceLock<Keeping>,
}

/// What is kept of the paths to a target that is asked for more than once.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Keeping {
    /// All of it.
    Windows,
    /// Lengths from corners, once the wavefront is through: the rest would not fit for all targets.
    Corners,
    /// Nothing: every path is found by itself.
    Nothing,
}

/// Paths to targets that are asked for more than once.
#[derive(Debug, Default)]
struct Known {
    /// By the bits of the targets' coordinates.
    paths: FxHashMap<[u64; 2], Arc<PathsTo>>,
    /// The targets, oldest first.
    order: VecDeque<[u64; 2]>,
}

impl Continuous {
    /// Prepares a map for planning from `start`.
    ///
    /// # Errors
    /// A start outside the bounds or inside an obstacle.
    pub fn new(map: Arc<Workspace>, start: Point2<f64>) -> Result<Self, StartError> {
        let (x, y) = (start.x, start.y);
        let letter = match map.locate(start) {
            Place::Free { letter, .. } => letter,
            Place::Outside => return Err(StartError::Outside { x, y }),
            Place::Obstacle(obstacle) => return Err(StartError::InObstacle { x, y, obstacle }),
        };
        let regions = map.regions().len();
        let graph = VisibilityGraph::new(map);
        let here = graph.component_at(start);
        let alphabet = graph.map().alphabet();
        let reached = |letter: Letter| -> Vec<Landmark> {
            let cells = graph.map().cells(letter).iter();
            let landmark = cells.map(|c| Landmark {
                at: c.inner_point(),
                area: c.area(),
            });
            landmark
                .filter(|l| graph.component_at(l.at) == here)
                .collect()
        };
        let landmarks: Vec<Vec<Landmark>> = alphabet.letters().map(reached).collect();
        let number = |letter: Letter| -> Vec<Option<u32>> {
            let here = &landmarks[letter.index()];
            let cells = graph.map().cells(letter).iter();
            cells
                .map(|c| here.iter().position(|l| l.at == c.inner_point()))
                .map(|i| i.map(|i| i as u32))
                .collect()
        };
        let parts = alphabet.letters().map(number).collect();
        let mut reachable = alphabet.none();
        for l in alphabet.letters() {
            if l == letter || !landmarks[l.index()].is_empty() {
                reachable.insert(l);
            }
        }
        Ok(Self {
            start: Spot { at: start, letter },
            landmarks,
            parts,
            reachable,
            ways: Ways::new(graph, start, regions),
            around: Mutex::default(),
            allowed: Mutex::default(),
        })
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &Arc<Workspace> {
        self.ways.graph.map()
    }

    /// Where the robot starts.
    #[must_use]
    pub fn start(&self) -> Spot {
        self.start
    }

    /// Which obstacle corners see each other, and what hangs together.
    #[must_use]
    pub fn graph(&self) -> &VisibilityGraph {
        &self.ways.graph
    }

    /// The shortest obstacle-free path between two free points, ends included.
    #[must_use]
    pub fn shortest_path(&self, from: Point2<f64>, to: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        self.graph().path(from, to)
    }

    /// Shortest ways that keep out of where the letter is missing in `through`; `None` if that rules out
    /// nothing, or more than can be prepared.
    fn around(&self, through: &LetterSet) -> Option<Arc<Ways>> {
        let mut around = self.around.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = around.get(through) {
            return known.clone();
        }
        // What is forgotten is found again when it is needed, with the same answers, whoever asked before.
        if around.len() >= MAX_SETS {
            around.clear();
        }
        let ways = self.without(through).map(Arc::new);
        around.insert(through.clone(), ways.clone());
        ways
    }

    /// The first leg of the shortest way around the obstacles, where the straight way is blocked and that one keeps to the letters
    /// of `through` by itself: many do, and then no map without the other regions has to be prepared.
    fn allowed_leg(&self, from: Point2<f64>, to: Point2<f64>, through: &LetterSet) -> Option<Leg> {
        let map = self.map();
        if map.is_free_between(from, to) {
            return None;
        }
        let (length, bend) = self.ways.bend(from, to)?;
        let mut bends: SmallVec<[Point2<f64>; 16]> = SmallVec::new();
        self.ways.bends(from, to, &mut |p| bends.push(p));
        let mut allowed = self.allowed.lock().unwrap_or_else(PoisonError::into_inner);
        let keeps = allowed.keeps(map, from, &bends, through);
        keeps.then_some(Leg { to: bend, length })
    }

    fn without(&self, through: &LetterSet) -> Option<Ways> {
        if self.graph().corners().count() > MAX_CORNERS {
            return None;
        }
        let map = self.map();
        let alphabet = map.alphabet();
        let regions = 0..map.regions().len();
        let whole: Vec<usize> = regions
            .filter(|&i| alphabet.letters_with(i).is_disjoint(through))
            .collect();
        let polygon = |&i: &usize| map.regions()[i].polygon.clone();
        let mut barred: Vec<Polygon> = whole.iter().map(polygon).collect();
        // Regions of which a part is allowed, alone or together with others, are barred where they are not.
        let in_part = |props: Props| {
            let letter = alphabet.letter(props);
            letter.is_some_and(|l| !through.contains(l))
                && !whole.iter().any(|&i| props.contains(i))
        };
        if alphabet.letters().any(|l| in_part(alphabet.props(l))) {
            barred.extend(map.area_of(in_part));
        }
        if barred.is_empty() {
            return None;
        }
        let graph = VisibilityGraph::new(Arc::new(map.barred(barred)));
        Some(Ways::new(graph, self.start.at, map.regions().len()))
    }
}

impl Ways {
    fn new(graph: VisibilityGraph, start: Point2<f64>, regions: usize) -> Self {
        Self {
            graph,
            known: Mutex::default(),
            start,
            targets: TARGETS_OF_REGION * regions + 1,
            keeping: OnceLock::new(),
        }
    }

    fn keeping(&self) -> Keeping {
        let start = self.start;
        *self.keeping.get_or_init(|| {
            let corners = self.graph.corners().count();
            if self.targets * corners * MOST_WINDOWS <= MAX_KEPT && corners < OPEN_CORNERS {
                return Keeping::Windows;
            }
            let size = self.graph.size_of_paths(start, SAMPLE);
            if corners >= OPEN_CORNERS && size > OPEN_WINDOWS * corners {
                Keeping::Nothing
            } else if self.targets * size > MAX_KEPT {
                Keeping::Corners
            } else {
                Keeping::Windows
            }
        })
    }

    /// The length of the shortest path to a place out of sight and the first point at which it bends.
    fn bend(&self, from: Point2<f64>, to: Point2<f64>) -> Option<(f64, Point2<f64>)> {
        match self.keeping() {
            Keeping::Nothing => self.graph.first_leg(from, to),
            _ => self.paths_to(to).bend(&self.graph, from),
        }
    }

    /// Visits the bends of that path, and the place.
    fn bends(&self, from: Point2<f64>, to: Point2<f64>, visit: &mut dyn FnMut(Point2<f64>)) {
        if self.keeping() != Keeping::Nothing {
            return self.paths_to(to).bends(&self.graph, from, visit);
        }
        let path = self.graph.path(from, to);
        path.into_iter().flatten().skip(1).for_each(visit);
    }

    fn paths_to(&self, to: Point2<f64>) -> Arc<PathsTo> {
        let key = [to.x.to_bits(), to.y.to_bits()];
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(paths) = known.paths.get(&key) {
            return Arc::clone(paths);
        }
        // What is forgotten is found again when it is needed, with the same answers.
        let mut size: usize = known.paths.values().map(|p| p.size()).sum();
        for paths in known.order.iter().filter_map(|key| known.paths.get(key)) {
            if size <= MAX_KEPT {
                break;
            }
            let before = paths.size();
            if paths.condense(&self.graph) {
                size = size.saturating_sub(before) + paths.size();
            }
        }
        while size > MAX_KEPT
            && let Some(oldest) = known.order.pop_front()
        {
            size = size.saturating_sub(known.paths.remove(&oldest).map_or(0, |p| p.size()));
        }
        let paths = Arc::new(match self.keeping() {
            Keeping::Corners => self.graph.paths_by_corners(to),
            _ => self.graph.paths_to(to),
        });
        known.paths.insert(key, Arc::clone(&paths));
        known.order.push_back(key);
        paths
    }
}

impl TransitionSystem for Continuous {
    fn alphabet(&self) -> &Arc<Alphabet> {
        self.map().alphabet()
    }

    fn bounds(&self) -> Bounds {
        self.map().bounds()
    }

    fn settle(&self, p: Point2<f64>) -> Option<Spot> {
        match self.map().locate(p) {
            Place::Free {
                letter,
                on_boundary: false,
            } => Some(Spot { at: p, letter }),
            _ => None,
        }
    }

    fn distance(&self, a: Point2<f64>, b: Point2<f64>) -> f64 {
        (b - a).norm()
    }

    fn step(&self, a: &Spot, b: &Spot) -> bool {
        self.map().step_between(a.at, a.letter, b.at, b.letter)
    }

    fn sample_free(&self, random: &mut Random) -> Point2<f64> {
        self.map().sample_free(random)
    }

    fn sample_letter(&self, letter: Letter, random: &mut Random) -> Point2<f64> {
        self.map().sample_letter(letter, random)
    }

    fn reachable(&self) -> &LetterSet {
        &self.reachable
    }

    fn landmarks(&self, letter: Letter) -> &[Landmark] {
        &self.landmarks[letter.index()]
    }

    fn first_leg(&self, from: Point2<f64>, to: Point2<f64>, keep: bool) -> Option<Leg> {
        let leg = |(length, to)| Leg { to, length };
        // Most legs are in sight: that needs no paths at all.
        if self.map().is_free_between(from, to) {
            return Some(leg(((to - from).norm(), to)));
        }
        if !keep {
            return self.graph().first_leg(from, to).map(leg);
        }
        self.ways.bend(from, to).map(leg)
    }

    fn first_leg_through(
        &self,
        from: Point2<f64>,
        to: Point2<f64>,
        through: &LetterSet,
    ) -> Option<Leg> {
        if self.map().passes(from, to, through) {
            let length = (to - from).norm();
            return Some(Leg { to, length });
        }
        if let Some(leg) = self.allowed_leg(from, to, through) {
            return Some(leg);
        }
        let Some(ways) = self.around(through) else {
            return self.first_leg(from, to, true);
        };
        let barred = |p| matches!(ways.graph.map().locate(p), Place::Obstacle(_));
        if barred(from) || barred(to) {
            return None;
        }
        let (length, to) = match ways.graph.map().is_free_between(from, to) {
            true => ((to - from).norm(), to),
            false => ways.bend(from, to)?,
        };
        Some(Leg { to, length })
    }

    fn walk(&self, from: Point2<f64>, to: Point2<f64>, visit: &mut dyn FnMut(Point2<f64>)) {
        if self.map().is_free_between(from, to) {
            return visit(to);
        }
        self.ways.bends(from, to, visit);
    }

    fn forget(&self) {
        *self
            .ways
            .known
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = Known::default();
        let mut around = self.around.lock().unwrap_or_else(PoisonError::into_inner);
        around.clear();
        let mut allowed = self.allowed.lock().unwrap_or_else(PoisonError::into_inner);
        *allowed = Allowed::default();
    }

    fn part(&self, spot: &Spot) -> Option<u32> {
        let cells = self.map().cells(spot.letter);
        let parts = &self.parts[spot.letter.index()];
        if let ([_], [part]) = (cells, parts.as_slice()) {
            return *part;
        }
        let i = cells.iter().position(|c| c.contains(spot.at))?;
        parts[i]
    }

    fn plane(&self) -> Option<&Workspace> {
        Some(self.map())
    }

    fn fingerprint(&self) -> String {
        super::fingerprint(self.map(), &[])
    }
}

#[cfg(test)]
mod tests;
