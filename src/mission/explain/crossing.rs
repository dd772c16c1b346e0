//! Missions whose ways all lead through regions that the automaton does not admit there.
//!
//! Continuous motion is, in the automaton's eyes, a walk over the parts of the map that carry one letter: a
//! part is read once or more, and any part next to it may follow. So the product of automaton and
//! parts decides whether a mission has a plan at all; on a grid that of automaton and cells does. To say
//! what is in the way, regions are taken to be invisible, and those are named without which there is a plan.

use std::sync::Arc;

use nalgebra::Point2;

use crate::alphabet::{Letter, Props};
use crate::automaton::{StateId, Task};
use crate::system::{Spot, TransitionSystem};
use crate::workspace::Workspace;
use crate::workspace::parts::Parts;

/// On grids with more moves than this it is left to the search whether a mission has a plan.
const MAX_MOVES: usize = 1_000_000;

/// Where a robot can be, as a graph; it starts in the last place.
struct Places {
    /// The letter of each; `None` where it may be any.
    letters: Vec<Option<Letter>>,
    next: Vec<Vec<u32>>,
}

/// Why nothing is accepted on a map although all that it needs can be reached.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Crossing {
    /// Regions that every way leads through, by number; none if that is not why.
    pub(super) through: Vec<usize>,
    /// Regions that the automaton never gets to because of them.
    pub(super) beyond: Vec<usize>,
}

impl Crossing {
    /// What is in the way of a mission; `None` if it has a plan.
    pub(super) fn find(
        map: &Arc<Workspace>,
        start: Point2<f64>,
        task: &Task,
        system: &dyn TransitionSystem,
    ) -> Option<Self> {
        let places = match system.plane() {
            Some(_) => Places::of_map(map, start),
            None => Places::of_grid(system, start),
        }?;
        let product = |unseen: Props| Product::new(&places, task, unseen);
        let plain = product(Props::EMPTY);
        if plain.accepts() {
            return None;
        }
        let alphabet = &task.nba.alphabet;
        let all = (0..alphabet.propositions().len()).fold(Props::EMPTY, Props::with);
        let lets_through = |unseen: Props| product(unseen).accepts();
        let single = all.iter().map(Props::single).find(|&r| lets_through(r));
        let mut through = single.unwrap_or(all);
        if single.is_none() && lets_through(all) {
            for i in all.iter() {
                let fewer = Props(through.0 & !Props::single(i).0);
                if lets_through(fewer) {
                    through = fewer;
                }
            }
        } else if single.is_none() {
            through = Props::EMPTY;
        }
        let seen = plain.seen();
        let named = task.formula.as_ref().map(|f| f.propositions());
        let named = named.unwrap_or_default();
        let is_named = |&i: &usize| named.iter().any(|n| *n == alphabet.propositions()[i]);
        // Where nothing is in the way each can be reached, if not as the task wants.
        let unseen = |&i: &usize| !through.is_empty() && !seen.contains(i) && !through.contains(i);
        Some(Self {
            through: through.iter().collect(),
            beyond: all.iter().filter(is_named).filter(unseen).collect(),
        })
    }
}

impl Places {
    /// The parts of a map, and the start.
    fn of_map(map: &Arc<Workspace>, start: Point2<f64>) -> Option<Self> {
        let parts = Parts::new(map);
        let here = parts.at(start);
        let (mut letters, mut next) = (parts.letters, parts.next);
        letters.push(Some(map.letter_at(start)?));
        next.push(here);
        Some(Self { letters, next })
    }

    /// The places of a system of finitely many; `None` of any other, and of one with too many moves.
    fn of_grid(system: &dyn TransitionSystem, start: Point2<f64>) -> Option<Self> {
        let key = |s: &Spot| [s.at.x.to_bits(), s.at.y.to_bits()];
        let start = system.settle(start)?;
        let mut near = Vec::new();
        if !system.neighbours(&start, &mut near) {
            return None;
        }
        let mut spots = vec![start];
        let mut number = std::collections::HashMap::from([(key(&start), 0_u32)]);
        let mut next: Vec<Vec<u32>> = Vec::new();
        let mut moves = 0;
        while next.len() < spots.len() {
            let from = spots[next.len()];
            system.neighbours(&from, &mut near);
            let mut row = Vec::with_capacity(near.len());
            for to in &near {
                let new = spots.len() as u32;
                row.push(*number.entry(key(to)).or_insert_with(|| {
                    spots.push(*to);
                    new
                }));
            }
            moves += row.len();
            if moves > MAX_MOVES {
                return None;
            }
            next.push(row);
        }
        let mut letters: Vec<Option<Letter>> = spots.iter().map(|s| Some(s.letter)).collect();
        letters.push(letters[0]);
        next.push(next[0].clone());
        Some(Self { letters, next })
    }
}

/// What a robot and its automaton can reach together.
struct Product<'a> {
    places: &'a Places,
    task: &'a Task,
    /// For each place the letters that may be read there.
    readings: Vec<Vec<Letter>>,
    /// By place and state.
    reached: Vec<bool>,
}

impl<'a> Product<'a> {
    /// Regions that are `unseen` may be read as if they were not there.
    fn new(places: &'a Places, task: &'a Task, unseen: Props) -> Self {
        let alphabet = &task.nba.alphabet;
        let readings = places.letters.iter().map(|letter| match letter {
            None => Vec::new(),
            Some(letter) => {
                let props = alphabet.props(*letter);
                let without = alphabet.letter(Props(props.0 & !unseen.0));
                let other = without.filter(|l| l != letter);
                std::iter::once(*letter).chain(other).collect()
            }
        });
        let readings: Vec<Vec<Letter>> = readings.collect();
        let mut product = Self {
            reached: vec![false; readings.len() * task.nba.len()],
            places,
            task,
            readings,
        };
        let start = places.letters.len() - 1;
        let mut open: Vec<usize> = Vec::new();
        for &q in &task.nba.initial {
            open.push(product.number(start, q));
        }
        while let Some(s) = open.pop() {
            if !std::mem::replace(&mut product.reached[s], true) {
                product.each_step(s, &mut |to| open.push(to));
            }
        }
        product
    }

    fn number(&self, place: usize, state: StateId) -> usize {
        place * self.task.nba.len() + state.index()
    }

    fn each_step(&self, s: usize, visit: &mut dyn FnMut(usize)) {
        let states = self.task.nba.len();
        let (place, state) = (s / states, StateId((s % states) as u32));
        let next = &self.places.next[place];
        if self.readings[place].is_empty() {
            for &p in next {
                visit(self.number(p as usize, state));
            }
        }
        for &letter in &self.readings[place] {
            for q in self.task.nba.successors(state, letter) {
                visit(self.number(place, q));
                for &p in next {
                    visit(self.number(p as usize, q));
                }
            }
        }
    }

    /// Whether an accepting state can be passed again and again: the states from which one can be reached,
    /// within the set itself, are kept until nothing changes (E. A. Emerson, C.-L. Lei, "Modalities for
    /// model checking: branching time logic strikes back", 1987).
    fn accepts(&self) -> bool {
        let size = self.reached.len();
        let mut before: Vec<Vec<u32>> = vec![Vec::new(); size];
        for s in (0..size).filter(|&s| self.reached[s]) {
            self.each_step(s, &mut |to| before[to].push(s as u32));
        }
        let accepting = |s: usize| {
            let state = StateId((s % self.task.nba.len()) as u32);
            self.task.nba.is_accepting(state)
        };
        let mut kept = self.reached.clone();
        loop {
            let mut back = vec![false; size];
            let mut open: Vec<usize> = (0..size).filter(|&s| kept[s] && accepting(s)).collect();
            while let Some(s) = open.pop() {
                for &p in &before[s] {
                    let p = p as usize;
                    if kept[p] && !std::mem::replace(&mut back[p], true) {
                        open.push(p);
                    }
                }
            }
            let left = back.iter().filter(|&&b| b).count();
            if left == 0 || left == kept.iter().filter(|&&k| k).count() {
                return left > 0;
            }
            kept = back;
        }
    }

    /// The regions of all places that are reached.
    fn seen(&self) -> Props {
        let states = self.task.nba.len();
        let alphabet = &self.task.nba.alphabet;
        let reached = (0..self.reached.len()).filter(|&s| self.reached[s]);
        reached
            .filter_map(|s| self.places.letters[s / states])
            .fold(Props::EMPTY, |all, l| Props(all.0 | alphabet.props(l).0))
    }
}
