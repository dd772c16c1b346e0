//! Polygons with holes as simple polygons.
//!
//! The obstacles of a map are simple polygons, and obstacles that share a border leave no gap. So
//! a polygon with holes is cut along vertical lines: from the top of each hole up to the next border, and
//! from its bottom down. Going up from hole to hole the tops rise, so the cuts upwards hang together as
//! a tree with the outer border, and those downwards do too: every cut lies on a closed way around,
//! and what remains are polygons without holes.

use std::f64::consts::TAU;

use nalgebra::Point2;

/// Cuts a polygon with holes into polygons without; rings in either direction, without closing
/// repetitions. They are simple if the given rings are and do not meet.
#[must_use]
pub fn split(rings: Vec<Vec<Point2<f64>>>) -> Vec<Vec<Point2<f64>>> {
    if rings.len() <= 1 {
        return rings;
    }
    let mut plane = Plane::new(rings);
    plane.cut();
    plane.faces()
}

/// The rings with the polygon on their left, and the cuts.
struct Plane {
    at: Vec<Point2<f64>>,
    /// Directed borders.
    edges: Vec<[u32; 2]>,
    /// For each border the points that cuts put on it.
    on: Vec<Vec<u32>>,
    cuts: Vec<[u32; 2]>,
    /// For each hole its highest and its lowest point.
    ends: Vec<[u32; 2]>,
    columns: Columns,
}

/// The borders by the range of x that they cover.
struct Columns {
    low: f64,
    width: f64,
    edges: Vec<Vec<u32>>,
}

impl Columns {
    fn new(at: &[Point2<f64>], edges: &[[u32; 2]]) -> Self {
        let count = (edges.len() / 4).clamp(1, 4096);
        let low = at.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
        let high = at.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max);
        let mut columns = Self {
            low,
            width: (high - low) / count as f64,
            edges: vec![Vec::new(); count],
        };
        for (i, e) in edges.iter().enumerate() {
            let [a, b] = e.map(|p| at[p as usize].x);
            let (from, to) = (columns.of(a.min(b)), columns.of(a.max(b)));
            for column in &mut columns.edges[from..=to] {
                column.push(i as u32);
            }
        }
        columns
    }

    fn of(&self, x: f64) -> usize {
        (((x - self.low) / self.width).max(0.0) as usize).min(self.edges.len() - 1)
    }
}

impl Plane {
    fn new(rings: Vec<Vec<Point2<f64>>>) -> Self {
        let (mut at, mut edges, mut ends) = (Vec::new(), Vec::new(), Vec::new());
        for (k, mut ring) in rings.into_iter().enumerate() {
            // The outer border counter-clockwise, holes clockwise.
            if (signed_area(&ring) > 0.0) != (k == 0) {
                ring.reverse();
            }
            let (first, n) = (at.len() as u32, ring.len() as u32);
            edges.extend((0..n).map(|i| [first + i, first + (i + 1) % n]));
            if k > 0 {
                let by = |i: &u32, j: &u32| {
                    let (p, q) = (ring[*i as usize], ring[*j as usize]);
                    p.y.total_cmp(&q.y).then(p.x.total_cmp(&q.x))
                };
                let (top, bottom) = ((0..n).max_by(by), (0..n).min_by(by));
                ends.extend(top.zip(bottom).map(|(t, b)| [first + t, first + b]));
            }
            at.extend(ring);
        }
        Self {
            on: vec![Vec::new(); edges.len()],
            columns: Columns::new(&at, &edges),
            at,
            edges,
            cuts: Vec::new(),
            ends,
        }
    }

    fn cut(&mut self) {
        for [top, bottom] in self.ends.clone() {
            self.cut_from(top, 1.0);
            self.cut_from(bottom, -1.0);
        }
        self.cuts.sort_unstable();
        self.cuts.dedup();
    }

    /// Cuts from a point straight up (or down) to the next border.
    fn cut_from(&mut self, from: u32, up: f64) {
        let p = self.at[from as usize];
        let mut nearest: Option<(f64, u32, Option<u32>)> = None;
        for &e in &self.columns.edges[self.columns.of(p.x)] {
            let [i, j] = self.edges[e as usize];
            let (a, b) = (self.at[i as usize], self.at[j as usize]);
            if i == from || j == from || p.x < a.x.min(b.x) || p.x > a.x.max(b.x) {
                continue;
            }
            let mut meet = |y: f64, end: Option<u32>| {
                let height = (y - p.y) * up;
                // At the same height a corner counts more than the border that ends there.
                let better = nearest.is_none_or(|(h, _, known)| {
                    height < h || height == h && known.is_none() && end.is_some()
                });
                if height > 0.0 && better {
                    nearest = Some((height, e, end));
                }
            };
            if a.x == p.x {
                meet(a.y, Some(i));
            }
            if b.x == p.x {
                meet(b.y, Some(j));
            }
            if a.x != p.x && b.x != p.x {
                meet(a.y + (b.y - a.y) * ((p.x - a.x) / (b.x - a.x)), None);
            }
        }
        let Some((height, edge, end)) = nearest else {
            return;
        };
        let to = end.unwrap_or_else(|| self.point_on(edge, Point2::new(p.x, p.y + up * height)));
        self.cuts.push([from.min(to), from.max(to)]);
    }

    /// The number of a point on a border, which may be there already.
    fn point_on(&mut self, edge: u32, p: Point2<f64>) -> u32 {
        let known = self.on[edge as usize].iter();
        if let Some(&i) = known.into_iter().find(|&&i| self.at[i as usize] == p) {
            return i;
        }
        let i = self.at.len() as u32;
        self.at.push(p);
        self.on[edge as usize].push(i);
        i
    }

    /// Walks around what lies between borders and cuts.
    fn faces(mut self) -> Vec<Vec<Point2<f64>>> {
        let mut half: Vec<[u32; 2]> = Vec::new();
        for (e, on) in self.edges.iter().zip(&mut self.on) {
            let [a, b] = e.map(|p| self.at[p as usize]);
            let along = |i: &u32| (self.at[*i as usize] - a).dot(&(b - a));
            on.sort_by(|i, j| along(i).total_cmp(&along(j)));
            let mut from = e[0];
            for &to in on.iter().chain([&e[1]]) {
                half.push([from, to]);
                from = to;
            }
        }
        for &[a, b] in &self.cuts {
            half.extend([[a, b], [b, a]]);
        }
        let mut leaving: Vec<Vec<u32>> = vec![Vec::new(); self.at.len()];
        for (h, e) in half.iter().enumerate() {
            leaving[e[0] as usize].push(h as u32);
        }
        let mut done = vec![false; half.len()];
        let mut faces = Vec::new();
        for start in 0..half.len() {
            let mut face = Vec::new();
            let mut h = start;
            while !std::mem::replace(&mut done[h], true) {
                let [from, to] = half[h];
                face.push(self.at[from as usize]);
                h = self.next(from, to, &leaving[to as usize], &half);
            }
            if face.len() >= 3 {
                faces.push(face);
            }
        }
        faces
    }

    /// Where the border of the part on the left goes on: the first way out, turning clockwise from the
    /// way back.
    fn next(&self, from: u32, at: u32, leaving: &[u32], half: &[[u32; 2]]) -> usize {
        if let [only] = leaving {
            return *only as usize;
        }
        let angle = |to: u32| {
            let d = self.at[to as usize] - self.at[at as usize];
            libm::atan2(d.y, d.x)
        };
        let back = angle(from);
        let turn = |h: u32| {
            let to = half[h as usize][1];
            let turn = (back - angle(to)).rem_euclid(TAU);
            // Straight back comes last.
            if to == from || turn == 0.0 { TAU } else { turn }
        };
        let first = leaving
            .iter()
            .copied()
            .min_by(|&i, &j| turn(i).total_cmp(&turn(j)));
        first.map_or(0, |h| h as usize)
    }
}

/// The area, positive if the ring runs counter-clockwise.
pub(super) fn signed_area(ring: &[Point2<f64>]) -> f64 {
    let n = ring.len();
    let cross = |i: usize| (ring[i] - ring[0]).perp(&(ring[(i + 1) % n] - ring[0]));
    (0..n).map(cross).sum::<f64>() / 2.0
}
