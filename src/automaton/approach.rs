//! How far a robot has to go before it makes its round, by places alone.
//!
//! Two directions of a tour are equally long, but the way to it need not be: a place that must not be seen before another
//! one may come first in one of them. So each direction's automaton is walked over the places of the map, and that is taken
//! whose round begins sooner (ours).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::buchi::Buchi;
use super::tour::Layout;
use crate::alphabet::Props;
use crate::queue::Entry;

/// With more kinds of places than this, directions are not compared.
const PLACES: usize = 64;

/// An automaton over the places of a map.
pub(super) struct Approach<'a> {
    buchi: &'a Buchi,
    seen: &'a [Props],
    layout: &'a dyn Layout,
    /// The letter class between places, if there is any.
    between: Option<usize>,
}

impl<'a> Approach<'a> {
    /// `seen` tells for each letter class of the automaton's guards what holds.
    pub(super) fn new(buchi: &'a Buchi, seen: &'a [Props], layout: &'a dyn Layout) -> Self {
        Self {
            buchi,
            seen,
            layout,
            between: seen.iter().position(|p| p.is_empty()),
        }
    }

    /// The least way from the start to a place of the round, letter classes in their order, from which the automaton goes
    /// around with it once for each time; infinite if there is none, 0 if there are too many places to tell.
    pub(super) fn length(&self, round: &[usize]) -> f64 {
        let places: Vec<usize> = (0..self.seen.len())
            .filter(|&c| !self.seen[c].is_empty())
            .collect();
        if places.len() > PLACES || self.buchi.len() == 0 {
            return 0.0;
        }
        let mut least: BTreeMap<(usize, u32), f64> = BTreeMap::new();
        let mut queue = BinaryHeap::new();
        queue.push(Reverse(Entry(0.0, (usize::MAX, 0))));
        while let Some(Reverse(Entry(length, (place, state)))) = queue.pop() {
            if least.get(&(place, state)).is_some_and(|&l| l < length) {
                continue; // an older, longer label
            }
            let mut stops = round.iter().enumerate();
            if stops.any(|(i, &stop)| stop == place && self.goes_around(round, i, state)) {
                return length;
            }
            for &next in places.iter().filter(|&&p| p != place) {
                let there = length + self.between(place, next);
                if !there.is_finite() {
                    continue;
                }
                for (to, _) in self.arrivals(state, next) {
                    let known = least.entry((next, to)).or_insert(f64::INFINITY);
                    if there < *known {
                        *known = there;
                        queue.push(Reverse(Entry(there, (next, to))));
                    }
                }
            }
        }
        f64::INFINITY
    }

    /// From a place to another, from the start if there is no such place.
    fn between(&self, from: usize, to: usize) -> f64 {
        let first = |class: usize| self.seen[class].iter().next();
        let from = self.seen.get(from).and_then(|_| first(from));
        first(to).map_or(f64::INFINITY, |to| self.layout.length(from, to))
    }

    /// The states after a way to a place, and whether an accepting one was passed.
    fn arrivals(&self, state: u32, class: usize) -> Vec<(u32, bool)> {
        let accepts = |q: u32| self.buchi.accepting[q as usize];
        let targets = |q: u32, class: usize| {
            let edges = self.buchi.edges[q as usize].iter();
            edges.filter(move |e| e.1.contains(class)).map(|e| e.0)
        };
        let mut under_way = vec![(state, false)];
        let mut next = 0;
        while let (Some(&(q, passed)), Some(between)) = (under_way.get(next), self.between) {
            for to in targets(q, between) {
                let reached = (to, passed || accepts(to));
                if !under_way.contains(&reached) {
                    under_way.push(reached);
                }
            }
            next += 1;
        }
        let mut found = Vec::new();
        for (q, passed) in under_way {
            for to in targets(q, class) {
                let reached = (to, passed || accepts(to));
                if !found.contains(&reached) {
                    found.push(reached);
                }
            }
        }
        found
    }

    /// Whether a run goes around once from a stop and is back in its state, with an accepting one on the way.
    fn goes_around(&self, round: &[usize], from: usize, state: u32) -> bool {
        let mut at = vec![(state, false)];
        for k in 1..=round.len() {
            let class = round[(from + k) % round.len()];
            let mut next: Vec<(u32, bool)> = Vec::new();
            for (q, passed) in at {
                for (to, accepted) in self.arrivals(q, class) {
                    let reached = (to, passed || accepted);
                    if !next.contains(&reached) {
                        next.push(reached);
                    }
                }
            }
            at = next;
        }
        at.contains(&(state, true))
    }
}
