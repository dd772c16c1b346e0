//! Shortest obstacle-free paths between points of the map, by a visibility graph.
//!
//! A shortest path bends only at convex corners of obstacles, and only tangentially. Which corners
//! see each other is found when first asked for, by looking through the mesh of the
//! free space, and kept up to [a bound](MAX_LINKS). From all corners to a target, distances are found
//! once per target ([`VisibilityGraph::paths_to`]); a query from a point then needs the corners that it
//! sees. For a target that is asked for once, [`VisibilityGraph::first_leg`] searches from both ends of
//! what is needed only.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use nalgebra::Point2;
use smallvec::SmallVec;

use super::mesh::Mesh;
use super::walls::Enclosure;
use super::{Polygon, Workspace};

/// Links between corners that are kept at most (16 bytes each: 256 MiB). Those of further corners
/// are found anew whenever they are needed.
pub const MAX_LINKS: usize = 16 << 20;

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
    mesh: Mesh,
    corners: Vec<Corner>,
    /// For each point of the mesh the corners there.
    corners_at: Vec<SmallVec<[u32; 1]>>,
    neighbours: Vec<OnceLock<Links>>,
    /// How many links are kept so far.
    kept: AtomicUsize,
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
    /// Triangulates the free space and collects the corners of the map's obstacles; which of them
    /// see each other is found when first needed.
    #[must_use]
    pub fn new(map: Arc<Workspace>) -> Self {
        let mesh = Mesh::new(&map);
        let obstacles = map.obstacles();
        let corners: Vec<Corner> = obstacles
            .iter()
            .flat_map(convex_corners)
            .filter(|c| map.bounds().contains(c.at) && map.obstacle_at(c.at).is_none())
            .collect();
        let mut corners_at = vec![SmallVec::new(); mesh.len()];
        for (i, corner) in corners.iter().enumerate() {
            if let Some(p) = mesh.point_at(corner.at) {
                corners_at[p as usize].push(i as u32);
            }
        }
        Self {
            neighbours: (0..corners.len()).map(|_| OnceLock::new()).collect(),
            kept: AtomicUsize::new(0),
            map,
            mesh,
            corners,
            corners_at,
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

    /// A number for the connected part of the free space that holds `p`: two free points have a
    /// path between them if and only if theirs are equal. `None` away from free space.
    #[must_use]
    pub fn component_at(&self, p: Point2<f64>) -> Option<u32> {
        self.mesh.component_at(p)
    }

    /// What keeps two points of the free space apart; `None` if a path joins them.
    #[must_use]
    pub fn between(&self, a: Point2<f64>, b: Point2<f64>) -> Option<Enclosure> {
        Enclosure::between(&self.map, &self.mesh, a, b)
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
        for (i, length) in self.seen_from(target) {
            if self.sees(i, target) {
                paths.lengths[i as usize] = length;
                queue.push(Reverse(Entry(length, i)));
            }
        }
        while let Some(Reverse(Entry(length, i))) = queue.pop() {
            if length > paths.lengths[i as usize] {
                continue;
            }
            self.with_neighbours(i, |j, edge| {
                let through = length + edge;
                if through < paths.lengths[j as usize] {
                    paths.lengths[j as usize] = through;
                    paths.next[j as usize] = Some(i);
                    queue.push(Reverse(Entry(through, j)));
                }
            });
        }
        paths
    }

    /// The length of the shortest path between two free points and the first point at which it bends (`to`
    /// itself if that is in sight); `None` if there is no path. For one query this is faster than
    /// [`Self::paths_to`] (A\*: Hart, Nilsson, Raphael 1968).
    #[must_use]
    pub fn first_leg(&self, from: Point2<f64>, to: Point2<f64>) -> Option<(f64, Point2<f64>)> {
        if self.map.is_free_between(from, to) {
            return Some(((to - from).norm(), to));
        }
        if self.component_at(from) != self.component_at(to) {
            return None;
        }
        // Backwards, so that the corner that reaches `from` is the answer.
        let ends: HashMap<u32, f64> = self.seen_from(from).into_iter().collect();
        let mut lengths: HashMap<u32, f64> = HashMap::new();
        let mut queue = BinaryHeap::new();
        let ahead = |i: u32| (self.corners[i as usize].at - from).norm();
        for (i, length) in self.seen_from(to) {
            if self.sees(i, to) {
                lengths.insert(i, length);
                queue.push(Reverse((Entry(length + ahead(i), i), false)));
            }
        }
        while let Some(Reverse((Entry(bound, i), complete))) = queue.pop() {
            if complete {
                return Some((bound, self.corners[i as usize].at));
            }
            let length = lengths[&i];
            if bound > length + ahead(i) {
                continue;
            }
            if ends.contains_key(&i) && self.sees(i, from) {
                queue.push(Reverse((Entry(bound, i), true)));
            }
            self.with_neighbours(i, |j, edge| {
                let through = length + edge;
                let known = lengths.entry(j).or_insert(f64::INFINITY);
                if through < *known {
                    *known = through;
                    queue.push(Reverse((Entry(through + ahead(j), j), false)));
                }
            });
        }
        None
    }

    /// The corners that are seen from a point and may be bent at on the way there, with their
    /// distances, by number. The mesh decides; [`Self::sees`] confirms.
    fn seen_from(&self, from: Point2<f64>) -> Vec<(u32, f64)> {
        let mut seen: Vec<u32> = Vec::new();
        let found = self.mesh.visible(from, &mut |p| {
            seen.extend(&self.corners_at[p as usize]);
        });
        if !found {
            // Within an obstacle by a rounding error.
            seen.extend(0..self.corners.len() as u32);
        }
        seen.sort_unstable();
        seen.dedup();
        let corner = |i: u32| &self.corners[i as usize];
        seen.into_iter()
            .filter(|&i| corner(i).is_tangent(from))
            .map(|i| (i, (corner(i).at - from).norm()))
            .collect()
    }

    /// Whether the segment from a corner to a free point is free, by the map's own test.
    fn sees(&self, i: u32, p: Point2<f64>) -> bool {
        self.map.is_free_between(self.corners[i as usize].at, p)
    }

    fn with_neighbours(&self, i: u32, mut visit: impl FnMut(u32, f64)) {
        let kept = &self.neighbours[i as usize];
        if kept.get().is_none() && self.kept.load(Ordering::Relaxed) >= MAX_LINKS {
            let found = self.neighbours(i);
            return found.iter().for_each(|&(j, length)| visit(j, length));
        }
        let links = kept.get_or_init(|| {
            let found = self.neighbours(i);
            self.kept.fetch_add(found.len(), Ordering::Relaxed);
            found
        });
        links.iter().for_each(|&(j, length)| visit(j, length));
    }

    fn neighbours(&self, i: u32) -> Links {
        let from = self.corners[i as usize];
        let seen = self.seen_from(from.at).into_iter();
        seen.filter(|&(j, _)| j != i && from.is_tangent(self.corners[j as usize].at))
            .filter(|&(j, _)| self.sees(j, from.at))
            .collect()
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
        if graph.map.is_free_between(from, self.target) {
            return Some(((self.target - from).norm(), None));
        }
        let mut seen: Vec<(f64, u32)> = graph
            .seen_from(from)
            .into_iter()
            .map(|(i, length)| (length + self.lengths[i as usize], i))
            .filter(|(length, _)| length.is_finite())
            .collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (length, i) = seen.into_iter().find(|&(_, i)| graph.sees(i, from))?;
        Some((length, Some(i)))
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
