//! The path as a chain of points, and its local refinement.

use nalgebra::{Point2, Vector2};

use super::mission::{Mission, letter_classes, used_regions};
use super::roadmap::inward_normal;
use super::search::Found;
use super::words::word_of;
use crate::workspace::{Polygon, Workspace};

/// Weights of prefix and suffix below this count as this much in refinement, so that a part of no
/// weight is tidy too.
const MIN_WEIGHT: f64 = 1e-3;

/// An improvement below this share of the map's longer side is not worth a move.
const MIN_GAIN: f64 = 1e-7;

/// How much of the way to the best place is tried where the whole of it is blocked.
const PARTS: [f64; 4] = [1.0, 0.5, 0.25, 0.0625];

/// How many places are tried for a waypoint, best first.
const TRIES: usize = 6;

/// A prefix-suffix path by its points alone.
#[derive(Clone)]
pub(super) struct Chain<'m> {
    shape: Shape<'m>,
    /// The prefix, then the suffix without its ends.
    pub(super) points: Vec<Point2<f64>>,
    /// The index of the prefix's last point.
    pub(super) split: usize,
    /// Whether the robot stays there.
    pub(super) stays: bool,
}

/// What refinement must know of the mission.
#[derive(Clone)]
struct Shape<'m> {
    workspace: &'m Workspace,
    classes: Vec<u16>,
    polygons: Vec<&'m Polygon>,
    inset: f64,
    min_gain: f64,
    weight: f64,
}

/// A path's classes of letters in a row.
type Word = Vec<u16>;

impl<'m> Chain<'m> {
    pub(super) fn new(mission: &'m Mission<'m>, found: &Found) -> Self {
        let workspace = mission.roadmap.workspace;
        let side = workspace.bounds().side();
        let used = used_regions(workspace, mission.task);
        let mut nodes = found.prefix.clone();
        nodes.extend(found.suffix.iter().flatten());
        Self {
            shape: Shape {
                workspace,
                classes: letter_classes(mission.task),
                polygons: used
                    .iter()
                    .map(|i| &workspace.regions()[i].polygon)
                    .collect(),
                inset: mission.roadmap.config.inset * side,
                min_gain: MIN_GAIN * side,
                weight: mission.weight,
            },
            points: nodes.into_iter().map(|n| mission.at(n)).collect(),
            split: found.prefix.len() - 1,
            stays: found.suffix.is_none(),
        }
    }

    /// Slides and drops waypoints until nothing improves, at most `sweeps` times over all.
    pub(super) fn refine(&mut self, sweeps: usize) {
        for _ in 0..sweeps {
            let mut moved = false;
            let mut i = 1;
            while i < self.points.len() {
                if self.drop_point(i) {
                    moved = true;
                    continue;
                }
                moved |= self.slide(i);
                i += 1;
            }
            if !moved {
                break;
            }
        }
    }

    /// The points before and after `i`, with the weights of the segments to them. The prefix's last
    /// point has three neighbours where the suffix moves.
    fn neighbours(&self, i: usize) -> Vec<(Point2<f64>, f64)> {
        let prefix = self.shape.weight.max(MIN_WEIGHT);
        let suffix = (1.0 - self.shape.weight).max(MIN_WEIGHT);
        let last = self.points.len() - 1;
        let mut found = Vec::with_capacity(3);
        if i > 0 {
            let weight = if i <= self.split { prefix } else { suffix };
            found.push((self.points[i - 1], weight));
        }
        if i < last {
            let weight = if i < self.split { prefix } else { suffix };
            found.push((self.points[i + 1], weight));
        } else if i > self.split {
            found.push((self.points[self.split], suffix));
        }
        if i == self.split && !self.stays && last > self.split {
            found.push((self.points[last], suffix));
        }
        found
    }

    /// Leaves out point `i` where the straight line past it carries the same word.
    fn drop_point(&mut self, i: usize) -> bool {
        let only_one = i > self.split && self.points.len() == self.split + 2;
        if i == 0 || i == self.split || only_one {
            return false;
        }
        let (before, after) = match self.neighbours(i)[..] {
            [(before, _), (after, _)] => (before, after),
            _ => return false,
        };
        let at = self.points[i];
        let Some(word) = self.shape.word_through(before, at, after) else {
            return false;
        };
        if self.shape.word(before, after).as_ref() != Some(&word) {
            return false;
        }
        self.points.remove(i);
        if i < self.split {
            self.split -= 1;
        }
        true
    }

    /// Moves point `i` to where the weighted length is least, as far as the word allows.
    fn slide(&mut self, i: usize) -> bool {
        let neighbours = self.neighbours(i);
        let at = self.points[i];
        let length =
            |p: Point2<f64>| -> f64 { neighbours.iter().map(|&(n, w)| (p - n).norm() * w).sum() };
        let now = length(at);
        let mut places: Vec<(f64, Point2<f64>)> = self
            .shape
            .places(at, &length)
            .into_iter()
            .filter(|&(l, _)| l < now - self.shape.min_gain)
            .collect();
        if places.is_empty() {
            return false;
        }
        let Some(word) = self.shape.star_word(at, &neighbours) else {
            return false;
        };
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        for part in PARTS {
            for &(_, place) in places.iter().take(TRIES) {
                let p = at + (place - at) * part;
                if length(p) < now - self.shape.min_gain
                    && self.shape.is_firm(p)
                    && self.shape.star_word(p, &neighbours).as_ref() == Some(&word)
                {
                    self.points[i] = p;
                    return true;
                }
            }
        }
        false
    }
}

impl Shape<'_> {
    /// The classes of letters along `ab`, neighbours different.
    fn word(&self, a: Point2<f64>, b: Point2<f64>) -> Option<Word> {
        let mut word: Word = word_of(self.workspace, a, b)?
            .into_iter()
            .map(|l| self.classes[l.index()])
            .collect();
        word.dedup();
        Some(word)
    }

    fn word_through(&self, a: Point2<f64>, at: Point2<f64>, b: Point2<f64>) -> Option<Word> {
        let mut word = self.word(a, at)?;
        word.extend(self.word(at, b)?);
        word.dedup();
        Some(word)
    }

    /// Whether no region's border runs much closer to `p` than the inset: on the way to a place on
    /// the other side of a border a waypoint must not creep up to it.
    fn is_firm(&self, p: Point2<f64>) -> bool {
        let letter = self.workspace.letter_at(p);
        let reach = 0.9 * self.inset;
        let around = [(reach, 0.0), (-reach, 0.0), (0.0, reach), (0.0, -reach)];
        around.into_iter().all(|(x, y)| {
            let near = self.workspace.letter_at(p + Vector2::new(x, y));
            near.is_none() || near == letter
        })
    }

    /// What must stay the same when a point moves: for an inner point the word past it, for
    /// others the word on each of its segments.
    fn star_word(&self, at: Point2<f64>, neighbours: &[(Point2<f64>, f64)]) -> Option<Vec<Word>> {
        if let [(before, _), (after, _)] = *neighbours {
            return Some(vec![self.word_through(before, at, after)?]);
        }
        neighbours.iter().map(|&(n, _)| self.word(n, at)).collect()
    }

    /// For every border near `at`, the best place beside it, with its length.
    fn places(
        &self,
        at: Point2<f64>,
        length: &impl Fn(Point2<f64>) -> f64,
    ) -> Vec<(f64, Point2<f64>)> {
        let reach = Vector2::repeat(100.0 * self.inset);
        let mut places = Vec::new();
        for polygon in &self.polygons {
            let (min, max) = (polygon.min() - reach, polygon.max() + reach);
            if at.x < min.x || at.y < min.y || at.x > max.x || at.y > max.y {
                continue;
            }
            for (a, b) in polygon.edges() {
                let along = (b - a).normalize() * self.inset;
                let inward = inward_normal(a, b) * self.inset;
                if (b - a).norm() > 2.5 * self.inset {
                    places.push(least(a + along + inward, b - along + inward, length));
                }
                places.push(least(a - inward, b - inward, length));
            }
        }
        places
    }
}

/// The point of the segment `ab` where a convex function is least, by golden-section search.
fn least(
    mut a: Point2<f64>,
    mut b: Point2<f64>,
    f: &impl Fn(Point2<f64>) -> f64,
) -> (f64, Point2<f64>) {
    const RATIO: f64 = 0.618_033_988_749_894_8;
    let (ends, at) = ([a, b], |p: Point2<f64>, q: Point2<f64>, t: f64| {
        p + (q - p) * t
    });
    let (mut c, mut d) = (at(b, a, RATIO), at(a, b, RATIO));
    let (mut fc, mut fd) = (f(c), f(d));
    for _ in 0..28 {
        if fc <= fd {
            (b, d, fd) = (d, c, fc);
            c = at(b, a, RATIO);
            fc = f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = at(a, b, RATIO);
            fd = f(d);
        }
    }
    [
        (fc, c),
        (fd, d),
        (f(ends[0]), ends[0]),
        (f(ends[1]), ends[1]),
    ]
    .into_iter()
    .min_by(|x, y| x.0.total_cmp(&y.0))
    .unwrap_or((fc, c))
}
