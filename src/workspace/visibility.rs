//! Shortest obstacle-free paths between points of the map, by a visibility graph.
//!
//! A shortest path bends only at convex corners of obstacles, and only tangentially. Corners are
//! collected once; which of them see each other is found when first asked for and kept. From
//! all corners to a target, distances are found once per target ([`VisibilityGraph::paths_to`]); a
//! query from a point then tests corners in the order of what a path through them would cost and
//! stops at the first one that it sees.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::{Arc, OnceLock};

use nalgebra::Point2;

use super::{Polygon, Side, Workspace};

/// A convex corner of an obstacle, with its neighbours along the border.
#[derive(Clone, Copy, Debug)]
struct Corner {
    at: Point2<f64>,
    before: Point2<f64>,
    after: Point2<f64>,
}

impl Corner {
    /// Whether a path may bend here when it runs along `ab` through this corner: the obstacle
    /// must lie on one side of the line.
    fn is_tangent(&self, other: Point2<f64>) -> bool {
        let d = self.at - other;
        let left = d.perp(&(self.before - self.at));
        let right = d.perp(&(self.after - self.at));
        let slack = 1e-12 * d.norm_squared();
        !(left > slack && right < -slack || left < -slack && right > slack)
    }
}

/// The corners that a corner sees, with their distances.
type Links = Box<[(u32, f64)]>;

/// Which convex obstacle corners of a map see each other.
#[derive(Debug)]
pub struct VisibilityGraph {
    map: Arc<Workspace>,
    corners: Vec<Corner>,
    neighbours: Vec<OnceLock<Links>>,
}

/// Shortest paths from everywhere to one target.
#[derive(Clone, Debug)]
pub struct PathsTo {
    target: Point2<f64>,
    /// For each corner, the length of the shortest path to the target; infinite if there is none.
    lengths: Vec<f64>,
    /// For each corner, the corner after it; `None` if the target is next.
    next: Vec<Option<u32>>,
}

/// An entry of Dijkstra's queue, ordered by length, then by number.
#[derive(PartialEq)]
struct Entry(f64, u32);

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl VisibilityGraph {
    /// Collects the corners of the map's obstacles; edges are found when first needed.
    #[must_use]
    pub fn new(map: Arc<Workspace>) -> Self {
        let obstacles = map.obstacles();
        let exposed = |i: usize, p: Point2<f64>| {
            map.bounds().contains(p)
                && !obstacles
                    .iter()
                    .enumerate()
                    .any(|(j, o)| j != i && o.side_of(p, map.tolerance()) == Side::Inside)
        };
        let corners: Vec<Corner> = obstacles
            .iter()
            .enumerate()
            .flat_map(|(i, o)| convex_corners(o).map(move |c| (i, c)))
            .filter(|&(i, c)| exposed(i, c.at))
            .map(|(_, c)| c)
            .collect();
        Self {
            neighbours: (0..corners.len()).map(|_| OnceLock::new()).collect(),
            map,
            corners,
        }
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &Arc<Workspace> {
        &self.map
    }

    /// The corners that paths may bend at.
    pub fn corners(&self) -> impl Iterator<Item = Point2<f64>> + '_ {
        self.corners.iter().map(|c| c.at)
    }

    /// Shortest paths from every corner to `target` (Dijkstra's algorithm, backwards).
    #[must_use]
    pub fn paths_to(&self, target: Point2<f64>) -> PathsTo {
        let n = self.corners.len();
        let mut paths = PathsTo {
            target,
            lengths: vec![f64::INFINITY; n],
            next: vec![None; n],
        };
        let mut queue = BinaryHeap::new();
        for (i, corner) in self.corners.iter().enumerate() {
            if corner.is_tangent(target) && self.map.is_free_segment(corner.at, target) {
                paths.lengths[i] = (target - corner.at).norm();
                queue.push(Reverse(Entry(paths.lengths[i], i as u32)));
            }
        }
        while let Some(Reverse(Entry(length, i))) = queue.pop() {
            if length > paths.lengths[i as usize] {
                continue;
            }
            for &(j, edge) in self.neighbours(i as usize) {
                let through = length + edge;
                if through < paths.lengths[j as usize] {
                    paths.lengths[j as usize] = through;
                    paths.next[j as usize] = Some(i);
                    queue.push(Reverse(Entry(through, j)));
                }
            }
        }
        paths
    }

    fn neighbours(&self, i: usize) -> &[(u32, f64)] {
        self.neighbours[i].get_or_init(|| {
            let from = self.corners[i];
            let sees = |to: &Corner| {
                from.is_tangent(to.at)
                    && to.is_tangent(from.at)
                    && self.map.is_free_segment(from.at, to.at)
            };
            self.corners
                .iter()
                .enumerate()
                .filter(|&(j, to)| j != i && sees(to))
                .map(|(j, to)| (j as u32, (to.at - from.at).norm()))
                .collect()
        })
    }
}

impl PathsTo {
    /// Where the paths lead.
    #[must_use]
    pub fn target(&self) -> Point2<f64> {
        self.target
    }

    /// The length of the shortest path from `from` and the first point at which it bends (the
    /// target itself if that is in sight); `None` if there is no path. `from` must be free.
    #[must_use]
    pub fn first_leg(
        &self,
        graph: &VisibilityGraph,
        from: Point2<f64>,
    ) -> Option<(f64, Point2<f64>)> {
        self.entry(graph, from).map(|(length, corner)| {
            let at = corner.map_or(self.target, |i| graph.corners[i as usize].at);
            (length, at)
        })
    }

    /// The shortest path from `from`, both ends included; `None` if there is none.
    #[must_use]
    pub fn path(&self, graph: &VisibilityGraph, from: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        let (_, mut corner) = self.entry(graph, from)?;
        let mut path = vec![from];
        while let Some(i) = corner {
            path.push(graph.corners[i as usize].at);
            corner = self.next[i as usize];
        }
        path.push(self.target);
        Some(path)
    }

    fn entry(&self, graph: &VisibilityGraph, from: Point2<f64>) -> Option<(f64, Option<u32>)> {
        let map = &graph.map;
        if map.is_free_between(from, self.target) {
            return Some(((self.target - from).norm(), None));
        }
        let mut queue: BinaryHeap<Reverse<Entry>> = graph
            .corners
            .iter()
            .zip(&self.lengths)
            .enumerate()
            .filter(|(_, (corner, length))| length.is_finite() && corner.is_tangent(from))
            .map(|(i, (corner, length))| {
                Reverse(Entry((corner.at - from).norm() + length, i as u32))
            })
            .collect();
        while let Some(Reverse(Entry(length, i))) = queue.pop() {
            if map.is_free_between(from, graph.corners[i as usize].at) {
                return Some((length, Some(i)));
            }
        }
        None
    }
}

fn convex_corners(polygon: &Polygon) -> impl Iterator<Item = Corner> + '_ {
    let v = polygon.vertices();
    let n = v.len();
    (0..n).filter_map(move |i| {
        let (before, at, after) = (v[(i + n - 1) % n], v[i], v[(i + 1) % n]);
        ((at - before).perp(&(after - at)) > 0.0).then_some(Corner { at, before, after })
    })
}
