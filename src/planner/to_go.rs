//! What is left of a path at least: the informed part of a search.
//!
//! Once a plan is known, a product state can lead to a cheaper one only if the way to it and what is left from there are short enough together
//! (the idea of J. D. Gammell, S. S. Srinivasa, T. D. Barfoot, "Informed RRT*: optimal sampling-based path planning focused via direct sampling of an
//! admissible ellipsoidal heuristic", IROS 2014, in the product of map and automaton; the relaxation is ours).
//!
//! # The relaxation
//! The automaton reads a letter where the robot sees it. So who is to read letter l has to go to where l is, and that is at least as far as each of its
//! regions is in a straight line. Between places of letters a path is at least as long as these are apart. The empty letter may be read anywhere, and inside a
//! region the robot moves at no cost. What is left under these rules is a shortest path among pairs of letter and state, found once; from a point the
//! distance to the letter that comes next is added. Obstacles and regions that must not be entered are left out: all that makes ways longer only.

use std::collections::BinaryHeap;
use std::cmp::Reverse;

use nalgebra::Point2;

use crate::alphabet::{Letter, Props};
use crate::automaton::{Nba, StateId};
use crate::queue::Entry;
use crate::workspace::{Polygon, Workspace};

/// Tables of more entries, pairs of letter and state, are not made.
const ENTRIES: usize = 1 << 14;

/// Of a region with more edges its bounding box stands for it.
const EDGES: usize = 32;

/// The letters of a map other than the empty one, and how far they are from each other.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// The regions that the letters name.
    regions: Vec<Polygon>,
    /// The letters, each with its regions' numbers.
    letters: Vec<(Letter, Vec<usize>)>,
    /// At `i · letters + k` how far letters number `i` and `k` are apart at least.
    apart: Vec<f64>,
    empty: Option<Letter>,
}

impl Places {
    /// Those of a map whose letters an automaton of so many states reads; `None` if there are too many.
    pub(super) fn of(map: &Workspace, states: usize) -> Option<Self> {
        let alphabet = map.alphabet();
        let named: Vec<_> = alphabet.letters().filter(|&l| !alphabet.props(l).is_empty()).collect();
        if named.len() * states > ENTRIES {
            return None;
        }
        let numbers = |l: &Letter| alphabet.props(*l).iter().collect();
        let letters: Vec<(Letter, Vec<usize>)> = named.iter().map(|l| (*l, numbers(l))).collect();
        let number = |name: &String| map.regions().iter().find(|r| r.name == *name);
        let regions = alphabet.propositions().iter().map(|name| number(name).map(|r| r.polygon.clone()));
        let regions = regions.collect::<Option<Vec<_>>>()?;
        let between = |i: usize, k: usize| distance(&regions[i], &regions[k]);
        let mut apart = Vec::with_capacity(letters.len() * letters.len());
        for (_, from) in &letters {
            for (_, to) in &letters {
                let pairs = from.iter().flat_map(|&i| to.iter().map(move |&k| (i, k)));
                apart.push(pairs.fold(0.0, |most, (i, k)| f64::max(most, between(i, k))));
            }
        }
        Some(Self { regions, letters, apart, empty: alphabet.letter(Props::EMPTY) })
    }

    /// How far the letters are from a point, in the order of the letters.
    fn from(&self, p: Point2<f64>, into: &mut Vec<f64>) {
        into.clear();
        let far = |i: &usize| point_distance(&self.regions[*i], p);
        let letters = self.letters.iter();
        into.extend(letters.map(|(_, regions)| regions.iter().map(far).fold(0.0, f64::max)));
    }
}
