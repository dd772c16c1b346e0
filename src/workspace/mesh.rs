//! The free space in triangles: what is connected with what, and what can be seen from where.
//!
//! A constrained Delaunay triangulation of bounds and obstacles. Obstacles are open sets, so two
//! triangles that share no more than a corner are connected: a point can pass between obstacles
//! that touch at a corner. What is seen from a point is found by walking from triangle to
//! triangle within what can be seen (F. Bungiu et al., "Efficient computation of visibility
//! polygons", 2014: triangular expansion), which costs about as much as there is to be seen.

use nalgebra::Point2;
use smallvec::SmallVec;
use spade::{ConstrainedDelaunayTriangulation, Triangulation as _};

use super::index::BoxIndex;
use super::lines::{Lines, Points, arrange};
use super::{Place, Workspace};

/// Stands for "no triangle": an obstacle, or the end of the map.
const NONE: u32 = u32::MAX;

/// The triangulated free space of a map.
#[derive(Debug)]
pub(super) struct Mesh {
    points: Points,
    /// Corners of the free triangles, counter-clockwise.
    triangles: Vec<[u32; 3]>,
    /// For each corner of a triangle the triangle beyond the opposite edge.
    across: Vec<[u32; 3]>,
    /// The triangles around each point: `around[first[p]..first[p + 1]]`.
    first: Vec<u32>,
    around: Vec<u32>,
    /// The connected part that each triangle belongs to.
    component: Vec<u32>,
    index: BoxIndex,
    tolerance: f64,
}

/// A straight piece of a border of the free space.
pub(super) type WallEdge = [Point2<f64>; 2];

impl Mesh {
    pub(super) fn new(map: &Workspace) -> Self {
        let tolerance = map.tolerance();
        let lines = arrange(&map.bounds(), map.obstacles().iter(), 2.0 * tolerance);
        let Lines { mut points, edges } = lines;
        let (all, neighbours) = triangulate(&mut points, &edges);
        let free = free_triangles(map, &points.at, &all, &neighbours);
        let mut number = vec![NONE; all.len()];
        let mut triangles = Vec::new();
        for (i, t) in all.iter().enumerate().filter(|&(i, _)| free[i]) {
            number[i] = triangles.len() as u32;
            triangles.push(*t);
        }
        let across = (0..all.len())
            .filter(|&i| free[i])
            .map(|i| neighbours[i].map(|(n, _)| if n == NONE { NONE } else { number[n as usize] }))
            .collect();
        let (first, around) = incidences(points.at.len(), &triangles);
        let boxes = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| points.at[i as usize]);
            (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
        });
        let mut mesh = Self {
            index: BoxIndex::new(boxes, 4.0 * tolerance),
            component: Vec::new(),
            points,
            triangles,
            across,
            first,
            around,
            tolerance,
        };
        mesh.component = mesh.components();
        mesh
    }

    /// The corner at `p`, up to the tolerance.
    pub(super) fn point_at(&self, p: Point2<f64>) -> Option<u32> {
        self.points.find(p)
    }

    /// How many corners there are.
    pub(super) fn len(&self) -> usize {
        self.points.at.len()
    }

    /// How many triangles there are.
    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The place of a corner.
    pub(super) fn point(&self, p: u32) -> Point2<f64> {
        self.points.at[p as usize]
    }

    /// The corners of a triangle, counter-clockwise.
    pub(super) fn corners(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize]
    }

    /// The triangle beyond the edge opposite a triangle's corner with this place in [`Self::corners`];
    /// `u32::MAX` if there is none.
    pub(super) fn beyond(&self, triangle: u32, corner: usize) -> u32 {
        self.across[triangle as usize][corner]
    }

    /// The triangles around a corner.
    pub(super) fn around(&self, p: u32) -> &[u32] {
        &self.around[self.first[p as usize] as usize..self.first[p as usize + 1] as usize]
    }

    /// The triangles around a point: those that contain it, or, at a corner, all that meet there.
    pub(super) fn triangles_around(&self, p: Point2<f64>) -> SmallVec<[u32; 16]> {
        match self.point_at(p) {
            Some(corner) => SmallVec::from_slice(self.around(corner)),
            None => self.triangles_at(p),
        }
    }

    /// The connected part of the free space that holds `p`; `None` away from free space.
    pub(super) fn component_at(&self, p: Point2<f64>) -> Option<u32> {
        let holds = self.triangles_at(p);
        holds.iter().map(|&t| self.component[t as usize]).min()
    }

    /// The area of a connected part.
    pub(super) fn area(&self, component: u32) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.points.at[i as usize]);
            (b - a).perp(&(c - a)) / 2.0
        };
        let parts = self.triangles.iter().zip(&self.component);
        parts
            .filter(|&(_, c)| *c == component)
            .map(|(t, _)| of(t))
            .sum()
    }

    /// The border of a connected part in pieces that hang together, the longest extent first:
    /// what encloses it, then what it encloses.
    pub(super) fn walls(&self, component: u32) -> Vec<Vec<WallEdge>> {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for (t, corners) in self.triangles.iter().enumerate() {
            if self.component[t] != component {
                continue;
            }
            for k in (0..3).filter(|&k| self.across[t][k] == NONE) {
                edges.push([corners[(k + 1) % 3], corners[(k + 2) % 3]]);
            }
        }
        let mut sets = Sets::new(self.points.at.len());
        for &[a, b] in &edges {
            sets.join(a, b);
        }
        let mut loops: std::collections::BTreeMap<u32, Vec<WallEdge>> = Default::default();
        for e in edges {
            let ends = e.map(|i| self.points.at[i as usize]);
            loops.entry(sets.find(e[0])).or_default().push(ends);
        }
        let extent = |edges: &Vec<WallEdge>| {
            let all = edges.iter().flatten();
            let (low, high) = all.fold((edges[0][0], edges[0][0]), |(low, high), p| {
                (low.inf(p), high.sup(p))
            });
            (high - low).norm()
        };
        let mut loops: Vec<_> = loops.into_values().collect();
        loops.sort_by(|a, b| extent(b).total_cmp(&extent(a)));
        loops
    }

    /// Calls `visit` with every corner that is seen from `from`, some more than once; `false` if
    /// `from` lies in no free triangle.
    pub(super) fn visible(&self, from: Point2<f64>, visit: &mut dyn FnMut(u32)) -> bool {
        let start = self.triangles_around(from);
        let mut open: Vec<View> = Vec::new();
        for &t in &start {
            let corners = self.triangles[t as usize];
            for k in 0..3 {
                visit(corners[k]);
                let (right, left) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let beyond = self.across[t as usize][k];
                if beyond == NONE || start.contains(&beyond) {
                    continue;
                }
                let view = View {
                    triangle: beyond,
                    edge: [right, left],
                    right: self.points.at[right as usize] - from,
                    left: self.points.at[left as usize] - from,
                };
                if view.right.perp(&view.left) > 0.0 {
                    open.push(view);
                }
            }
        }
        // Rounding could lead around a corner for ever: nothing is looked through this often.
        let mut budget = 64 * self.triangles.len() + 64;
        while let Some(view) = open.pop() {
            budget -= 1;
            if budget == 0 {
                break;
            }
            self.look_through(from, &view, &mut open, visit);
        }
        !start.is_empty()
    }

    /// Looks from an edge of a triangle at its third corner and through its other edges.
    fn look_through(
        &self,
        from: Point2<f64>,
        view: &View,
        open: &mut Vec<View>,
        visit: &mut dyn FnMut(u32),
    ) {
        let corners = self.triangles[view.triangle as usize];
        let [right, left] = view.edge;
        let Some(k) = corners.iter().position(|c| !view.edge.contains(c)) else {
            return;
        };
        let apex = corners[k];
        let to = self.points.at[apex as usize] - from;
        // Where the apex lies: left of the right side of the cone, right of its left side.
        let (past_right, past_left) = (view.right.perp(&to) >= 0.0, to.perp(&view.left) >= 0.0);
        if past_right && past_left {
            visit(apex);
        }
        let beyond = |corner: u32| {
            let k = corners.iter().position(|&c| c == corner);
            k.map_or(NONE, |k| self.across[view.triangle as usize][k])
        };
        let sides = [
            (
                beyond(left),
                [right, apex],
                view.right,
                if past_left { to } else { view.left },
            ),
            (
                beyond(right),
                [apex, left],
                if past_right { to } else { view.right },
                view.left,
            ),
        ];
        for (triangle, edge, right, left) in sides {
            if triangle != NONE && right.perp(&left) > 0.0 {
                open.push(View {
                    triangle,
                    edge,
                    right,
                    left,
                });
            }
        }
    }

    /// The free triangles that contain `p`, up to the tolerance.
    pub(super) fn triangles_at(&self, p: Point2<f64>) -> SmallVec<[u32; 16]> {
        let contains = |&t: &usize| {
            let c = self.triangles[t].map(|i| self.points.at[i as usize]);
            (0..3).all(|k| {
                let (a, b) = (c[k], c[(k + 1) % 3]);
                (b - a).perp(&(p - a)) >= -2.0 * self.tolerance * (b - a).norm()
            })
        };
        let mut found: SmallVec<[u32; 16]> = self
            .index
            .at(p)
            .filter(contains)
            .map(|t| t as u32)
            .collect();
        found.sort_unstable();
        found
    }

    /// Numbers the connected parts: triangles that share an edge or a corner.
    fn components(&self) -> Vec<u32> {
        let mut sets = Sets::new(self.triangles.len());
        for p in 0..self.points.at.len() {
            for pair in self.around(p as u32).windows(2) {
                sets.join(pair[0], pair[1]);
            }
        }
        (0..self.triangles.len() as u32)
            .map(|t| sets.find(t))
            .collect()
    }
}

/// What can be seen through an edge: the triangle beyond it and the cone that is left.
struct View {
    triangle: u32,
    /// The edge's ends, the right one first as seen from the eye.
    edge: [u32; 2],
    right: nalgebra::Vector2<f64>,
    left: nalgebra::Vector2<f64>,
}

/// Cuts what lies within an odd number of rings into triangles.
pub(super) fn cut(rings: &[Vec<Point2<f64>>]) -> Vec<[Point2<f64>; 3]> {
    let corners = || rings.iter().flatten();
    let Some(&first) = corners().next() else {
        return Vec::new();
    };
    let (min, max) = corners().fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)));
    let mut points = Points::new(1e-12 * (max - min).max());
    let mut edges = Vec::new();
    for ring in rings {
        let numbers: Vec<u32> = ring.iter().map(|&p| points.add(p)).collect();
        let next = numbers.iter().cycle().skip(1);
        let pairs = numbers.iter().zip(next);
        edges.extend(pairs.map(|(&a, &b)| [a.min(b), a.max(b)]));
    }
    edges.retain(|[a, b]| a != b);
    edges.sort_unstable();
    // What two rings share has the same on both sides.
    let alone = edges.chunk_by(|a, b| a == b).filter(|e| e.len() % 2 == 1);
    let edges: Vec<[u32; 2]> = alone.map(|e| e[0]).collect();
    let (all, neighbours) = triangulate(&mut points, &edges);
    // Inside and outside change at each border, from the outermost triangles on.
    let mut inside: Vec<Option<bool>> = vec![None; all.len()];
    let outermost = |t: usize| neighbours[t].iter().find(|(n, _)| *n == NONE);
    let mut open: Vec<usize> = (0..all.len()).filter(|&t| outermost(t).is_some()).collect();
    for &t in &open {
        inside[t] = outermost(t).map(|&(_, border)| border);
    }
    while let Some(t) = open.pop() {
        for &(n, border) in &neighbours[t] {
            if n != NONE && inside[n as usize].is_none() {
                inside[n as usize] = inside[t].map(|here| here != border);
                open.push(n as usize);
            }
        }
    }
    let found = all.iter().zip(&inside).filter(|(_, i)| **i == Some(true));
    found
        .map(|(t, _)| t.map(|c| points.at[c as usize]))
        .collect()
}

/// For each triangle and corner: the triangle beyond the opposite edge, and whether that edge is
/// a border.
pub(super) type Neighbours = Vec<[(u32, bool); 3]>;

/// Triangulates with the edges kept. Where rounding makes edges cross after all, points are added.
pub(super) fn triangulate(points: &mut Points, edges: &[[u32; 2]]) -> (Vec<[u32; 3]>, Neighbours) {
    let at = points.at.iter().map(|p| spade::Point2::new(p.x, p.y));
    let edges = edges.iter().map(|e| e.map(|i| i as usize)).collect();
    let mut conflicts = Vec::new();
    let cdt = ConstrainedDelaunayTriangulation::<spade::Point2<f64>>::try_bulk_load_cdt(
        at.collect(),
        edges,
        |conflict| conflicts.push(conflict),
    );
    let Ok(mut cdt) = cdt else {
        log::error!("the map's coordinates are too large or too small to triangulate");
        return (Vec::new(), Vec::new());
    };
    for ends in conflicts {
        let [from, to] = ends.map(spade::handles::FixedVertexHandle::from_index);
        cdt.add_constraint_and_split(from, to, |p| p);
    }
    for vertex in cdt.vertices().skip(points.at.len()) {
        let p = vertex.position();
        points.at.push(Point2::new(p.x, p.y));
    }
    let mut number = vec![NONE; cdt.num_all_faces()];
    for (i, face) in cdt.inner_faces().enumerate() {
        number[face.fix().index()] = i as u32;
    }
    cdt.inner_faces()
        .map(|face| {
            let edges = face.adjacent_edges();
            let corners = edges.map(|e| e.from().fix().index() as u32);
            // The edge opposite a corner begins at the next one.
            let beyond = [1, 2, 0].map(|k: usize| {
                let n = edges[k].rev().face().as_inner();
                (
                    n.map_or(NONE, |n| number[n.fix().index()]),
                    edges[k].is_constraint_edge(),
                )
            });
            (corners, beyond)
        })
        .unzip()
}

/// Which triangles are free. Triangles with no border between them are alike, and the largest is
/// asked, whose middle is furthest from any rounding.
fn free_triangles(
    map: &Workspace,
    at: &[Point2<f64>],
    triangles: &[[u32; 3]],
    neighbours: &Neighbours,
) -> Vec<bool> {
    let mut sets = Sets::new(triangles.len());
    for (i, row) in neighbours.iter().enumerate() {
        for &(n, _) in row.iter().filter(|&&(n, border)| n != NONE && !border) {
            sets.join(i as u32, n);
        }
    }
    let corners = |i: usize| triangles[i].map(|c| at[c as usize]);
    let area = |i: usize| {
        let [a, b, c] = corners(i);
        (b - a).perp(&(c - a))
    };
    let mut largest: Vec<u32> = (0..triangles.len() as u32).collect();
    for i in 0..triangles.len() {
        let of = sets.find(i as u32) as usize;
        if area(i) > area(largest[of] as usize) {
            largest[of] = i as u32;
        }
    }
    let is_free = |i: u32| {
        let [a, b, c] = corners(i as usize);
        let middle = Point2::from((a.coords + b.coords + c.coords) / 3.0);
        matches!(map.locate(middle), Place::Free { .. }) && !map.is_on_obstacle(middle, 0.0)
    };
    let mut known: Vec<Option<bool>> = vec![None; triangles.len()];
    // Beyond the bounds: where they were bent inwards to run through a point near them.
    for (i, row) in neighbours.iter().enumerate() {
        if row.iter().any(|&(n, border)| n == NONE && !border) {
            known[sets.find(i as u32) as usize] = Some(false);
        }
    }
    (0..triangles.len() as u32)
        .map(|i| {
            let of = sets.find(i) as usize;
            *known[of].get_or_insert_with(|| is_free(largest[of]))
        })
        .collect()
}

pub(super) fn incidences(points: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0_u32; points + 1];
    for &c in triangles.iter().flatten() {
        first[c as usize + 1] += 1;
    }
    for i in 0..points {
        first[i + 1] += first[i];
    }
    let mut next = first.clone();
    let mut around = vec![0; 3 * triangles.len()];
    for (t, corners) in triangles.iter().enumerate() {
        for &c in corners {
            around[next[c as usize] as usize] = t as u32;
            next[c as usize] += 1;
        }
    }
    (first, around)
}

/// Disjoint sets of numbers, each named by its least member.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub(super) fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    pub(super) fn find(&mut self, i: u32) -> u32 {
        let mut root = i;
        while self.0[root as usize] != root {
            root = self.0[root as usize];
        }
        let mut i = i;
        while self.0[i as usize] != root {
            i = std::mem::replace(&mut self.0[i as usize], root);
        }
        root
    }

    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
