//! Shortest obstacle-free paths between points of the map.
//!
//! A shortest path bends only at convex corners of obstacles, and only tangentially. Paths to one target
//! ([`VisibilityGraph::paths_to`]) are found by a wavefront over the triangulated free space, which
//! goes as far as what was asked for needs; a query from a place that it has passed
//! looks at the windows of one triangle, or, where these are too many to keep, at the corners in sight. For a target that is asked for once,
//! [`VisibilityGraph::first_leg`] sends the wavefront straight to where the question comes from.

use std::sync::{Arc, Mutex, PoisonError, RwLock};

use nalgebra::Point2;
use smallvec::SmallVec;

use super::geodesics::{Bend, Ground, Leg, Wavefront};
use super::mesh::Mesh;
use super::walls::Enclosure;
use super::{Polygon, Workspace};

/// A convex corner of an obstacle, with its neighbours along the border.
#[derive(Clone, Copy, Debug)]
struct Corner {
    at: Point2<f64>,
    before: Point2<f64>,
    after: Point2<f64>,
}

/// The triangulated free space of a map, with the corners that shortest paths bend at.
#[derive(Debug)]
pub struct VisibilityGraph {
    map: Arc<Workspace>,
    mesh: Mesh,
    corners: Vec<Corner>,
    /// For each point of the mesh what paths may do there.
    bends: Vec<Bend>,
    /// Wavefronts that are at rest, to be used again.
    idle: Mutex<Vec<Wavefront>>,
}

/// Shortest paths from everywhere to one target.
#[derive(Debug)]
pub struct PathsTo {
    target: Point2<f64>,
    /// Whether paths begin by looking which corners are in sight, instead of at the windows of a triangle.
    by_corners: bool,
    front: RwLock<Wavefront>,
}

impl VisibilityGraph {
    /// Triangulates the free space and collects the corners of the map's obstacles.
    #[must_use]
    pub fn new(map: Arc<Workspace>) -> Self {
        let mesh = Mesh::new(&map);
        let obstacles = map.obstacles();
        let corners: Vec<Corner> = obstacles
            .iter()
            .flat_map(convex_corners)
            .filter(|c| map.bounds().contains(c.at) && map.obstacle_at(c.at).is_none())
            .collect();
        let mut bends = vec![Bend::Never; mesh.len()];
        for corner in &corners {
            if let Some(p) = mesh.point_at(corner.at) {
                let bend = &mut bends[p as usize];
                *bend = match bend {
                    Bend::Never => Bend::Around(corner.before, corner.after),
                    Bend::Around(..) | Bend::Several => Bend::Several,
                };
            }
        }
        Self {
            map,
            mesh,
            corners,
            bends,
            idle: Mutex::default(),
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

    /// Shortest paths from everywhere to `target`, found as far as they will be asked for.
    #[must_use]
    pub fn paths_to(&self, target: Point2<f64>) -> PathsTo {
        let mut front = Wavefront::new(&self.mesh);
        self.start(&mut front, target, None);
        PathsTo {
            target,
            by_corners: false,
            front: RwLock::new(front),
        }
    }

    /// As [`Self::paths_to`]. To find a path takes a look at all corners in sight, which is slower, but once the wavefront
    /// is through it needs little memory ([`PathsTo::condense`]).
    #[must_use]
    pub(crate) fn paths_by_corners(&self, target: Point2<f64>) -> PathsTo {
        PathsTo {
            by_corners: true,
            ..self.paths_to(target)
        }
    }

    /// The length of the shortest path between two free points and the first point at which it bends (`to`
    /// itself if that is in sight); `None` if there is no path. For one query this is faster than
    /// [`Self::paths_to`] (A\*: Hart, Nilsson, Raphael 1968).
    #[must_use]
    pub fn first_leg(&self, from: Point2<f64>, to: Point2<f64>) -> Option<(f64, Point2<f64>)> {
        if self.map.is_free_between(from, to) {
            return Some(((to - from).norm(), to));
        }
        self.ahead(from, to, |front, leg| {
            (leg.length, self.first_bend(front, leg, from))
        })
    }

    /// The shortest path between two free points, both included; `None` if there is none. For one path this is faster than
    /// [`Self::paths_to`].
    #[must_use]
    pub fn path(&self, from: Point2<f64>, to: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        let mut path = vec![from];
        if self.map.is_free_between(from, to) {
            path.push(to);
        } else {
            self.ahead(from, to, |front, leg| match leg.corner {
                Some(corner) => front.chain(&self.mesh, corner, &mut |p| path.push(p)),
                None => path.push(to),
            })?;
        }
        Some(path)
    }

    /// What is asked of the first leg of the shortest path between two points that do not see each other, and of the wavefront that has
    /// found it.
    fn ahead<T>(
        &self,
        from: Point2<f64>,
        to: Point2<f64>,
        tell: impl FnOnce(&Wavefront, Leg) -> T,
    ) -> Option<T> {
        if self.component_at(from) != self.component_at(to) {
            return None;
        }
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let front = idle().pop();
        let mut front = front.unwrap_or_else(|| Wavefront::new(&self.mesh));
        self.start(&mut front, to, Some(from));
        let triangles = self.mesh.triangles_at(from);
        let mut failed = None;
        let found = loop {
            let best = front.best(self.ground(), from, &triangles, failed);
            if !front.is_settled(best) {
                front.advance(self.ground());
                continue;
            }
            match best {
                Some(leg) if self.sees(leg, to, from) => break Some(leg),
                Some(leg) => failed = Some(leg),
                None => break self.any_leg(&front, from),
            }
        };
        let found = found.map(|leg| tell(&front, leg));
        idle().push(front);
        found
    }

    /// How much the paths to one target will take if they are asked for from everywhere, in units of about 64 bytes: by those
    /// from around `p`, from where so many corners are reached soon.
    #[must_use]
    pub(crate) fn size_of_paths(&self, p: Point2<f64>, sample: usize) -> usize {
        let mut front = Wavefront::new(&self.mesh);
        self.start(&mut front, p, None);
        front.size_by(self.ground(), sample)
    }

    /// The corners that paths from `p` may bend at first, each once.
    fn corners_in_sight(&self, p: Point2<f64>) -> Vec<u32> {
        let mut seen: Vec<u32> = Vec::new();
        let mut note = |corner: u32| {
            if self.bends[corner as usize] != Bend::Never {
                seen.push(corner);
            }
        };
        // By a rounding error it may lie in no triangle.
        if !self.mesh.visible(p, &mut note) {
            (0..self.mesh.len() as u32).for_each(note);
        }
        seen.sort_unstable();
        seen.dedup();
        seen
    }

    fn ground(&self) -> Ground<'_> {
        let (mesh, bends) = (&self.mesh, self.bends.as_slice());
        Ground { mesh, bends }
    }

    fn start(&self, front: &mut Wavefront, target: Point2<f64>, ahead: Option<Point2<f64>>) {
        // Within an obstacle by a rounding error, a target lies in no triangle.
        let seen = |p: u32| {
            self.bends[p as usize] != Bend::Never
                && self.map.is_free_between(self.mesh.point(p), target)
        };
        front.start(self.ground(), target, ahead, seen);
    }

    /// The end of a leg on the way to `target`.
    fn end_of(&self, leg: Leg, target: Point2<f64>) -> Point2<f64> {
        leg.corner.map_or(target, |p| self.mesh.point(p))
    }

    /// Where a leg from `from` ends, or the next one where it has no length.
    fn first_bend(&self, front: &Wavefront, leg: Leg, from: Point2<f64>) -> Point2<f64> {
        // Shortened plans turn on corners to the last digit.
        let tolerance = 4.0 * self.map.tolerance();
        front.first_bend(&self.mesh, leg.corner, from, tolerance)
    }

    /// Whether a leg from `p` is free by the map's own test: the mesh may differ in what rounding does.
    fn sees(&self, leg: Leg, target: Point2<f64>, p: Point2<f64>) -> bool {
        self.map.is_free_between(self.end_of(leg, target), p)
    }

    /// The best leg to a corner that is seen from `p`, where no window reaches it: it lies in no
    /// triangle by a rounding error. The wavefront has come to its end.
    fn any_leg(&self, front: &Wavefront, p: Point2<f64>) -> Option<Leg> {
        let seen = self.corners_in_sight(p);
        let next = |leg: Option<Leg>| front.best_by(&self.mesh, p, &seen, leg);
        let mut legs = std::iter::successors(next(None), |&leg| next(Some(leg)));
        legs.find(|&leg| self.sees(leg, p, p))
    }
}

impl PathsTo {
    /// Where the paths lead.
    #[must_use]
    pub fn target(&self) -> Point2<f64> {
        self.target
    }

    /// How much of the memory is kept, in units of about 64 bytes.
    pub(crate) fn size(&self) -> usize {
        let front = self.front.read().unwrap_or_else(PoisonError::into_inner);
        front.size()
    }

    /// Keeps the lengths of paths from corners alone, if those are all that is looked at and the
    /// wavefront has passed most of the map; returns whether it did.
    pub(crate) fn condense(&self, graph: &VisibilityGraph) -> bool {
        let mut front = self.front.write().unwrap_or_else(PoisonError::into_inner);
        let pays = self.by_corners && front.has_windows(graph.mesh.triangle_count());
        if pays {
            front.condense(graph.ground());
        }
        pays
    }

    /// The length of the shortest path from `from` and the first point at which it bends (the
    /// target itself if that is in sight); `None` if there is no path. `from` must be free.
    #[must_use]
    pub fn first_leg(
        &self,
        graph: &VisibilityGraph,
        from: Point2<f64>,
    ) -> Option<(f64, Point2<f64>)> {
        if graph.map.is_free_between(from, self.target) {
            return Some(((self.target - from).norm(), self.target));
        }
        self.bend(graph, from)
    }

    /// As [`Self::first_leg`] where the target is known to be out of sight.
    pub(crate) fn bend(
        &self,
        graph: &VisibilityGraph,
        from: Point2<f64>,
    ) -> Option<(f64, Point2<f64>)> {
        let leg = self.leg_around(graph, from)?;
        let front = self.front.read().unwrap_or_else(PoisonError::into_inner);
        Some((leg.length, graph.first_bend(&front, leg, from)))
    }

    /// The shortest path from `from`, both ends included; `None` if there is none.
    #[must_use]
    pub fn path(&self, graph: &VisibilityGraph, from: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        let mut path = vec![from];
        if graph.map.is_free_between(from, self.target) {
            path.push(self.target);
            return Some(path);
        }
        self.bends(graph, from, &mut |p| path.push(p));
        (path.len() > 1).then_some(path)
    }

    /// Visits the bends of the shortest path from a point that does not see the target, and the target.
    pub(crate) fn bends(
        &self,
        graph: &VisibilityGraph,
        from: Point2<f64>,
        visit: &mut dyn FnMut(Point2<f64>),
    ) {
        if let Some(corner) = self.leg_around(graph, from).and_then(|leg| leg.corner) {
            let mut bends: SmallVec<[Point2<f64>; 16]> = SmallVec::new();
            let front = self.front.read().unwrap_or_else(PoisonError::into_inner);
            front.chain(&graph.mesh, corner, &mut |p| bends.push(p));
            // Whoever is told may ask for more ways.
            drop(front);
            bends.into_iter().for_each(visit);
        }
    }

    /// The first leg of the shortest path from a point that does not see the target.
    fn leg_around(&self, graph: &VisibilityGraph, from: Point2<f64>) -> Option<Leg> {
        let (mut seen, mut triangles): (Vec<u32>, SmallVec<[u32; 16]>) = Default::default();
        if self.by_corners {
            seen = graph.corners_in_sight(from);
        } else {
            triangles = graph.mesh.triangles_at(from);
        }
        let mut failed = None;
        loop {
            let front = self.front.read().unwrap_or_else(PoisonError::into_inner);
            let best = match self.by_corners {
                true => front.best_by(&graph.mesh, from, &seen, failed),
                false => front.best(graph.ground(), from, &triangles, failed),
            };
            if front.is_settled(best) {
                match best {
                    Some(leg) if graph.sees(leg, self.target, from) => return Some(leg),
                    Some(leg) => failed = Some(leg),
                    None if self.by_corners => return None,
                    None => return graph.any_leg(&front, from),
                }
                continue;
            }
            drop(front);
            let mut front = self.front.write().unwrap_or_else(PoisonError::into_inner);
            front.advance(graph.ground());
        }
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
