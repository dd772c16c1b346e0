//! Shortest obstacle-free paths from everywhere to one target, found as far as they are asked for.
//!
//! A wavefront runs from the target over the triangulated free space, nearest first. What the target, or
//! a corner that paths bend at, sees through an edge of a triangle is a *window*; from triangle to triangle
//! windows get narrower, and every corner that a window meets on a shorter way than before sees on its
//! own account (J. Chen, Y. Han, "Shortest paths on a polyhedron", SoCG 1990, which needs no unfolding
//! in the plane). Windows that are certain to be no shortest way are dropped (S.-Q. Xin, G.-J. Wang,
//! "Improving Chen and Han's algorithm on the discrete geodesic problem", TOG 2009, 3.2), so that about
//! as many are kept as there are edges. The wavefront rests as soon as nothing in it can be shorter
//! than the best answer to a query, and goes on from there when more is asked. What it answers does
//! not depend on what it was asked before.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Point2, Vector2};

use super::mesh::Mesh;

/// No triangle, no window; as a root: the target.
const NONE: u32 = u32::MAX;

/// Marks windows among the entries of the queue.
const WINDOW: u32 = 1 << 31;

/// Ways that differ by less than this share are equal: neither rules the other out.
const EQUAL: f64 = 1e-12;

/// Rounding could lead around a corner for ever: so many windows for a triangle, and the wavefront ends.
const MOST_WINDOWS: usize = 512;

/// So many steps of the wavefront between two looks at what they brought.
const STEPS: usize = 16;

/// What is seen from a root through an edge.
#[derive(Clone, Copy, Debug)]
struct Window {
    /// The triangle beyond the edge.
    triangle: u32,
    /// The edge's ends, the right one first as seen from the root.
    edge: [u32; 2],
    /// The corner of the mesh that paths through here bend at last.
    root: u32,
    /// The length of the path from the root to the target.
    length: f64,
    /// The sides of the cone that is seen, from the root.
    right: Vector2<f64>,
    left: Vector2<f64>,
    /// The next window into the same triangle.
    next: u32,
}

/// A corner that paths may bend at: the point before and after it on the obstacle's border, if they
/// are known and the only ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Bend {
    /// Paths do not bend here.
    Never,
    /// Around one corner with these neighbours.
    Around(Point2<f64>, Point2<f64>),
    /// Corners of several obstacles meet.
    Several,
}

/// An end of a shortest path's first leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    /// The length of the path from here to the target.
    pub(super) length: f64,
    /// The corner that the leg ends at; `None` for the target.
    pub(super) corner: Option<u32>,
}

/// Shortest paths to one target, as far as they are known.
#[derive(Debug)]
pub(super) struct Wavefront {
    target: Point2<f64>,
    /// Where the only query will come from, if that is known.
    ahead: Option<Point2<f64>>,
    /// For each corner the length of the shortest path to the target that is known, and its next bend.
    lengths: Vec<f64>,
    next: Vec<u32>,
    /// For each triangle the first window that looks into it.
    first: Vec<u32>,
    windows: Vec<Window>,
    /// Corners and windows to go on from, by the length of what they could bring at least.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    /// The corners that have a length.
    reached: Vec<u32>,
}

/// The mesh with what paths may do at its corners.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) bends: &'a [Bend],
}

impl Wavefront {
    /// A wavefront that has no target yet.
    pub(super) fn new(mesh: &Mesh) -> Self {
        Self {
            target: Point2::origin(),
            ahead: None,
            lengths: vec![f64::INFINITY; mesh.len()],
            next: vec![NONE; mesh.len()],
            first: vec![NONE; mesh.triangle_count()],
            windows: Vec::new(),
            queue: BinaryHeap::new(),
            reached: Vec::new(),
        }
    }

    /// Forgets everything and starts from `target`, for queries from everywhere or, if that is given, from
    /// `ahead` alone. `seen` holds the corners that see the target, if it lies in no triangle.
    pub(super) fn start(
        &mut self,
        ground: Ground<'_>,
        target: Point2<f64>,
        ahead: Option<Point2<f64>>,
        seen: impl Fn(u32) -> bool,
    ) {
        for &p in &self.reached {
            self.lengths[p as usize] = f64::INFINITY;
            self.next[p as usize] = NONE;
        }
        for window in &self.windows {
            self.first[window.triangle as usize] = NONE;
        }
        self.reached.clear();
        self.windows.clear();
        self.queue.clear();
        (self.target, self.ahead) = (target, ahead);
        let mesh = ground.mesh;
        let start = mesh.triangles_around(target);
        for &t in &start {
            for p in mesh.corners(t) {
                self.reach(ground, p, (mesh.point(p) - target).norm(), NONE);
            }
        }
        for &t in &start {
            let corners = mesh.corners(t);
            for k in 0..3 {
                let triangle = mesh.beyond(t, k);
                if triangle == NONE || start.contains(&triangle) {
                    continue;
                }
                let edge = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
                let [right, left] = edge.map(|p| mesh.point(p) - target);
                self.open(
                    mesh,
                    Window {
                        triangle,
                        edge,
                        root: NONE,
                        length: 0.0,
                        right,
                        left,
                        next: NONE,
                    },
                    None,
                );
            }
        }
        if start.is_empty() {
            for p in (0..mesh.len() as u32).filter(|&p| seen(p)) {
                self.reach(ground, p, (mesh.point(p) - target).norm(), NONE);
            }
        }
    }

    /// Whether so many windows are kept at least.
    pub(super) fn has_windows(&self, least: usize) -> bool {
        self.windows.len() >= least
    }

    /// Goes on until so many corners are reached; returns how many windows there will be if all corners have as many.
    pub(super) fn size_by(&mut self, ground: Ground<'_>, corners: usize) -> usize {
        while self.reached.len() < corners && !self.queue.is_empty() {
            self.advance(ground);
        }
        self.windows.len() * ground.mesh.len() / self.reached.len().max(1)
    }

    /// Goes on to the end.
    pub(super) fn finish(&mut self, ground: Ground<'_>) {
        while !self.queue.is_empty() {
            self.advance(ground);
        }
    }

    /// Goes on to the end and keeps only what is known of corners; nothing is asked of windows any more.
    pub(super) fn condense(&mut self, ground: Ground<'_>) {
        self.finish(ground);
        (self.windows, self.first) = (Vec::new(), Vec::new());
        self.queue = BinaryHeap::new();
    }

    /// How much is kept, in windows.
    pub(super) fn size(&self) -> usize {
        self.windows.len() + self.lengths.len() / 4 + self.first.len() / 16
    }

    /// The place of a root.
    fn place(&self, mesh: &Mesh, root: u32) -> Point2<f64> {
        if root == NONE {
            self.target
        } else {
            mesh.point(root)
        }
    }

    /// The shortest known way from `p`, which lies in `triangles`, of those that come after `after`
    /// in the order of lengths and corners.
    pub(super) fn best(
        &self,
        ground: Ground<'_>,
        p: Point2<f64>,
        triangles: &[u32],
        after: Option<Leg>,
    ) -> Option<Leg> {
        let mesh = ground.mesh;
        let mut best: Option<(f64, u32)> = None;
        let after = after.map(|leg| (leg.length, leg.corner.unwrap_or(NONE)));
        let mut offer = |length: f64, root: u32| {
            let new = (length, root);
            if length.is_finite()
                && after.is_none_or(|a| new > a)
                && best.is_none_or(|known| new < known)
            {
                best = Some(new);
            }
        };
        for &t in triangles {
            for c in mesh.corners(t) {
                if ground.bends[c as usize] != Bend::Never {
                    offer(self.lengths[c as usize] + (p - mesh.point(c)).norm(), c);
                }
            }
            let mut i = self.first[t as usize];
            while let Some(window) = self.windows.get(i as usize) {
                i = window.next;
                let to = p - self.place(mesh, window.root);
                let slack = -EQUAL * to.norm_squared();
                let inside = window.right.perp(&to) >= slack && to.perp(&window.left) >= slack;
                if inside && !self.is_stale(window) {
                    offer(window.length + to.norm(), window.root);
                }
            }
        }
        best.map(|(length, root)| Leg {
            length,
            corner: (root != NONE).then_some(root),
        })
    }

    /// As [`Self::best`], by the corners that are seen from `p`.
    pub(super) fn best_by(
        &self,
        mesh: &Mesh,
        p: Point2<f64>,
        seen: &[u32],
        after: Option<Leg>,
    ) -> Option<Leg> {
        let leg = |&c: &u32| (self.lengths[c as usize] + (p - mesh.point(c)).norm(), c);
        let after = after.map(|leg| (leg.length, leg.corner.unwrap_or(NONE)));
        let known = |leg: &(f64, u32)| leg.0.is_finite() && after.is_none_or(|a| *leg > a);
        let least = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let best = seen.iter().map(leg).filter(known).min_by(least);
        best.map(|(length, corner)| Leg {
            length,
            corner: Some(corner),
        })
    }

    /// Whether nothing that is still open can lead to a way as short as `leg`, or to any way at all.
    pub(super) fn is_settled(&self, leg: Option<Leg>) -> bool {
        let Some(Reverse((key, _))) = self.queue.peek() else {
            return true;
        };
        leg.is_some_and(|leg| f64::from_bits(*key) > leg.length * (1.0 + EQUAL))
    }

    /// Takes a few steps.
    pub(super) fn advance(&mut self, ground: Ground<'_>) {
        if self.windows.len() > MOST_WINDOWS * (ground.mesh.triangle_count() + 8) {
            log::debug!("a wavefront of shortest paths grew too large and was ended");
            self.queue.clear();
        }
        for _ in 0..STEPS {
            let Some(Reverse((key, entry))) = self.queue.pop() else {
                return;
            };
            if entry & WINDOW != 0 {
                self.look_through(ground, self.windows[(entry & !WINDOW) as usize]);
            } else if key == self.key_of(ground.mesh, entry).to_bits() {
                self.look_around(ground, entry);
            }
        }
    }

    /// Visits the bends of the path from a corner, that corner first and the target last.
    pub(super) fn chain(&self, mesh: &Mesh, corner: u32, visit: &mut dyn FnMut(Point2<f64>)) {
        let mut p = corner;
        while p != NONE {
            visit(mesh.point(p));
            p = self.next[p as usize];
        }
        visit(self.target);
    }

    /// Where the path from `from` by this corner bends first, or the target. A corner that `from` stands on is no bend: nobody gets on by
    /// going there.
    pub(super) fn first_bend(
        &self,
        mesh: &Mesh,
        corner: Option<u32>,
        from: Point2<f64>,
        tolerance: f64,
    ) -> Point2<f64> {
        let mut p = corner.unwrap_or(NONE);
        while p != NONE {
            let at = mesh.point(p);
            if (at - from).norm() > tolerance {
                return at;
            }
            p = self.next[p as usize];
        }
        self.target
    }

    /// Whether a shorter way to the window's root was found since.
    fn is_stale(&self, window: &Window) -> bool {
        window.root != NONE && window.length > self.lengths[window.root as usize]
    }

    fn key_of(&self, mesh: &Mesh, p: u32) -> f64 {
        let rest = self.ahead.map_or(0.0, |a| (a - mesh.point(p)).norm());
        self.lengths[p as usize] + rest
    }

    /// Takes note of a way to corner `p`.
    fn reach(&mut self, ground: Ground<'_>, p: u32, length: f64, root: u32) {
        let known = &mut self.lengths[p as usize];
        if length >= *known {
            return;
        }
        if *known == f64::INFINITY {
            self.reached.push(p);
        }
        *known = length;
        self.next[p as usize] = root;
        if ground.bends[p as usize] != Bend::Never {
            let key = self.key_of(ground.mesh, p).to_bits();
            self.queue.push(Reverse((key, p)));
        }
    }

    /// Opens a window, unless it is certain to be no shortest way. `crossed` is the third corner of the
    /// triangle on this side of the edge, and whether it is the left corner of the edge that the triangle was
    /// entered by.
    fn open(&mut self, mesh: &Mesh, mut window: Window, crossed: Option<(u32, bool)>) {
        if window.triangle == NONE || window.right.perp(&window.left) <= 0.0 {
            return;
        }
        let from = self.place(mesh, window.root);
        let [right, left] = window.edge.map(|p| mesh.point(p) - from);
        let along = left - right;
        // Where a ray from the root meets the edge.
        let meet = |ray: Vector2<f64>, end: f64| {
            let slope = ray.perp(&along);
            let t = if slope > 0.0 {
                (-ray.perp(&right) / slope).clamp(0.0, 1.0)
            } else {
                end
            };
            right + along * t
        };
        let (a, b) = (meet(window.right, 0.0), meet(window.left, 1.0));
        let worse = |corner: u32, off: Vector2<f64>, end: Vector2<f64>| {
            let around = self.lengths[corner as usize] + (end - off).norm();
            around < (window.length + end.norm()) * (1.0 - EQUAL)
        };
        if worse(window.edge[0], right, b) || worse(window.edge[1], left, a) {
            return;
        }
        if let Some((corner, on_left)) = crossed {
            let end = if on_left { a } else { b };
            if worse(corner, mesh.point(corner) - from, end) {
                return;
            }
        }
        let nearest = |to: Vector2<f64>| {
            let across = b - a;
            let t = (to - a).dot(&across) / across.norm_squared();
            // A window as narrow as a point gives no number.
            let t = if t.is_finite() {
                t.clamp(0.0, 1.0)
            } else {
                0.0
            };
            (a + across * t - to).norm()
        };
        let rest = self.ahead.map_or(0.0, |ahead| nearest(ahead - from));
        let key = window.length + nearest(Vector2::zeros()) + rest;
        let number = self.windows.len() as u32;
        window.next = std::mem::replace(&mut self.first[window.triangle as usize], number);
        self.windows.push(window);
        self.queue.push(Reverse((key.to_bits(), number | WINDOW)));
    }

    /// Passes a window on through the triangle that it looks into.
    fn look_through(&mut self, ground: Ground<'_>, window: Window) {
        if self.is_stale(&window) {
            return;
        }
        let mesh = ground.mesh;
        let corners = mesh.corners(window.triangle);
        let [right, left] = window.edge;
        let Some(k) = corners.iter().position(|c| !window.edge.contains(c)) else {
            return;
        };
        let apex = corners[k];
        let to = mesh.point(apex) - self.place(mesh, window.root);
        let (past_right, past_left) = (window.right.perp(&to) >= 0.0, to.perp(&window.left) >= 0.0);
        if past_right && past_left {
            self.reach(ground, apex, window.length + to.norm(), window.root);
        }
        // Counter-clockwise: apex, left, right. Opposite the left end lies the edge of apex and right.
        let to_right = Window {
            triangle: mesh.beyond(window.triangle, (k + 1) % 3),
            edge: [right, apex],
            left: if past_left { to } else { window.left },
            next: NONE,
            ..window
        };
        let to_left = Window {
            triangle: mesh.beyond(window.triangle, (k + 2) % 3),
            edge: [apex, left],
            right: if past_right { to } else { window.right },
            next: NONE,
            ..window
        };
        self.open(mesh, to_right, Some((left, true)));
        self.open(mesh, to_left, Some((right, false)));
    }

    /// Opens the windows of a corner that paths bend at: on the side where the obstacle is.
    fn look_around(&mut self, ground: Ground<'_>, p: u32) {
        let mesh = ground.mesh;
        let at = mesh.point(p);
        let length = self.lengths[p as usize];
        let came = at - self.place(mesh, self.next[p as usize]);
        if came.norm_squared() == 0.0 {
            return; // the target itself, which has its windows
        }
        // 1 for bends to the left, -1 to the right, 0 for both.
        let side = match ground.bends[p as usize] {
            Bend::Never => return,
            Bend::Several => 0.0,
            Bend::Around(before, after) => {
                let slack = EQUAL * came.norm_squared();
                let (s, t) = (came.perp(&(before - at)), came.perp(&(after - at)));
                match (s.max(t) > slack, s.min(t) < -slack) {
                    (true, true) => return,
                    (true, false) => 1.0,
                    (false, true) => -1.0,
                    (false, false) => 0.0,
                }
            }
        };
        let beyond = |ray: Vector2<f64>| side * came.perp(&ray) < 0.0;
        for &t in mesh.around(p) {
            let corners = mesh.corners(t);
            let Some(k) = corners.iter().position(|&c| c == p) else {
                continue;
            };
            let edge = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            let [mut right, mut left] = edge.map(|c| mesh.point(c) - at);
            for (c, ray) in edge.into_iter().zip([right, left]) {
                self.reach(ground, c, length + ray.norm(), p);
            }
            match (beyond(right), beyond(left)) {
                (true, true) => continue,
                (true, false) => right = came * side,
                (false, true) => left = came * -side,
                (false, false) => {}
            }
            self.open(
                mesh,
                Window {
                    triangle: mesh.beyond(t, k),
                    edge,
                    root: p,
                    length,
                    right,
                    left,
                    next: NONE,
                },
                None,
            );
        }
    }
}
