//! The free space cut into parts of one letter, and which of them a robot can go between directly.
//!
//! The triangulation of bounds, obstacles and regions: triangles that meet, if only at a corner, are
//! one part if they carry the same letter, and neighbours otherwise (see [the mesh](super::mesh) on corners).

use std::collections::BTreeSet;

use nalgebra::Point2;

use super::lines::{Lines, arrange};
use super::mesh::{Neighbours, Sets, incidences, triangulate};
use super::{Place, Workspace};
use crate::alphabet::Letter;

/// The parts of a map.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    /// The letter of each part; `None` where the borders are so close that it could be any.
    pub(crate) letters: Vec<Option<Letter>>,
    /// The parts next to each.
    pub(crate) next: Vec<Vec<u32>>,
    /// The corners of the triangles, with their parts.
    triangles: Vec<([Point2<f64>; 3], u32)>,
    tolerance: f64,
}

impl Parts {
    /// Cuts a map.
    pub(crate) fn new(map: &Workspace) -> Self {
        let tolerance = map.tolerance();
        let regions = map.regions().iter().map(|r| &r.polygon);
        let borders = map.obstacles().iter().chain(regions);
        let Lines { mut points, edges } = arrange(&map.bounds(), borders, 2.0 * tolerance);
        let (all, neighbours) = triangulate(&mut points, &edges);
        let corners: Vec<[Point2<f64>; 3]> = all
            .iter()
            .map(|t| t.map(|c| points.at[c as usize]))
            .collect();
        let seen = what_is_seen(map, &corners, &neighbours);
        let mut sets = Sets::new(all.len());
        let (first, around) = incidences(points.at.len(), &all);
        let at_point = |p: usize| {
            let range = first[p] as usize..first[p + 1] as usize;
            around[range].iter().copied()
        };
        for p in 0..points.at.len() {
            for t in at_point(p) {
                let alike = |s: &u32| seen[*s as usize] == seen[t as usize];
                at_point(p).filter(alike).for_each(|s| sets.join(s, t));
            }
        }
        let mut number = vec![u32::MAX; all.len()];
        let mut parts = Self {
            letters: Vec::new(),
            next: Vec::new(),
            triangles: Vec::new(),
            tolerance,
        };
        for t in 0..all.len() {
            let Some(letter) = seen[t] else { continue };
            let root = sets.find(t as u32) as usize;
            if number[root] == u32::MAX {
                number[root] = parts.letters.len() as u32;
                parts.letters.push(letter);
            }
            parts.triangles.push((corners[t], number[root]));
            number[t] = number[root];
        }
        let mut next = vec![BTreeSet::new(); parts.letters.len()];
        for p in 0..points.at.len() {
            let here: BTreeSet<u32> = at_point(p).map(|t| number[t as usize]).collect();
            for &a in here.iter().filter(|&&a| a != u32::MAX) {
                let others = here.iter().filter(|&&b| b != a && b != u32::MAX);
                next[a as usize].extend(others);
            }
        }
        parts.next = next.into_iter().map(|n| n.into_iter().collect()).collect();
        parts
    }

    /// The parts that hold a point; several on a border.
    pub(crate) fn at(&self, p: Point2<f64>) -> Vec<u32> {
        let holds = |c: &[Point2<f64>; 3]| {
            (0..3).all(|k| {
                let (a, b) = (c[k], c[(k + 1) % 3]);
                (b - a).perp(&(p - a)) >= -2.0 * self.tolerance * (b - a).norm()
            })
        };
        let held = self.triangles.iter().filter(|(c, _)| holds(c));
        let mut found: Vec<u32> = held.map(|&(_, part)| part).collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

/// What is seen in each triangle: nothing where it is not free, a letter, or any of several. Triangles
/// without a border between them are alike, and the largest is asked.
fn what_is_seen(
    map: &Workspace,
    corners: &[[Point2<f64>; 3]],
    neighbours: &Neighbours,
) -> Vec<Option<Option<Letter>>> {
    let mut sets = Sets::new(corners.len());
    for (i, row) in neighbours.iter().enumerate() {
        for &(n, _) in row.iter().filter(|&&(n, border)| n != u32::MAX && !border) {
            sets.join(i as u32, n);
        }
    }
    let area = |i: usize| {
        let [a, b, c] = corners[i];
        (b - a).perp(&(c - a))
    };
    let mut largest: Vec<usize> = (0..corners.len()).collect();
    for i in 0..corners.len() {
        let of = sets.find(i as u32) as usize;
        if area(i) > area(largest[of]) {
            largest[of] = i;
        }
    }
    let look = |i: usize| {
        let [a, b, c] = corners[i];
        let middle = Point2::from((a.coords + b.coords + c.coords) / 3.0);
        match map.locate(middle) {
            Place::Free {
                letter,
                on_boundary,
            } if !map.is_on_obstacle(middle, 0.0) => Some((!on_boundary).then_some(letter)),
            _ => None,
        }
    };
    let mut known: Vec<Option<Option<Option<Letter>>>> = vec![None; corners.len()];
    // Beyond the bounds: where they were bent inwards to run through a point near them.
    for (i, row) in neighbours.iter().enumerate() {
        if row.iter().any(|&(n, border)| n == u32::MAX && !border) {
            known[sets.find(i as u32) as usize] = Some(None);
        }
    }
    (0..corners.len())
        .map(|i| {
            let of = sets.find(i as u32) as usize;
            *known[of].get_or_insert_with(|| look(largest[of]))
        })
        .collect()
}
