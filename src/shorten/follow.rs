//! From points to a plan: waypoints for every letter that is crossed, and a run of the automaton.

use std::collections::VecDeque;

use nalgebra::Point2;

use super::Shortener;
use super::chain::Chain;
use super::word::pieces;
use crate::alphabet::Letter;
use crate::automaton::{Nba, StateId};
use crate::plan::{Cost, Path, Waypoint, length};

/// A place and its letter.
type Stop = (Point2<f64>, Letter);

impl Shortener<'_> {
    /// Makes a plan of a chain; `None` if a segment is blocked or no run of the automaton follows it.
    pub(crate) fn realise(&self, chain: &Chain) -> Option<(Path, Cost)> {
        let (prefix, rest) = chain.points.split_at(chain.split + 1);
        let prefix = self.expand(prefix)?;
        let suffix = if chain.stays {
            vec![*prefix.last()?]
        } else {
            let turn = chain.points[chain.split];
            let round: Vec<Point2<f64>> = [&[turn], rest, &[turn]].concat();
            self.expand(&round)?
        };
        let path = self.follow(&prefix, &suffix)?;
        let cost = Cost::new(length(&path.prefix), length(&path.suffix), self.weight);
        Some((path, cost))
    }

    /// Puts a waypoint into every letter that is crossed, so that each segment changes it at most once.
    fn expand(&self, points: &[Point2<f64>]) -> Option<Vec<Stop>> {
        let map = self.map;
        let mut stops = vec![(points[0], map.letter_at(points[0])?)];
        for ends in points.windows(2) {
            let between = pieces(map, ends[0], ends[1])?;
            let inner = between.len().saturating_sub(1).max(1);
            stops.extend(between[1..inner].iter().map(|&(letter, p)| (p, letter)));
            stops.push((ends[1], map.letter_at(ends[1])?));
        }
        let steps = |w: &[Stop]| map.step(w[0].0, w[1].0);
        stops.windows(2).all(steps).then_some(stops)
    }

    /// Finds a run along the stops: to some state where the suffix is entered, and along the suffix back to
    /// it, by an accepting state.
    fn follow(&self, prefix: &[Stop], suffix: &[Stop]) -> Option<Path> {
        let nba = &self.task.nba;
        let end = prefix.len() - 1;
        let ways = Runs::new(nba, prefix, &nba.initial, false);
        let mut entries: Vec<(usize, StateId)> = nba
            .states()
            .filter_map(|q| Some((ways.waits(end, q)?, q)))
            .collect();
        entries.sort_unstable();
        let round = |&(_, q): &(usize, StateId)| {
            let suffix = if let [here] = suffix {
                let stays = nba.is_accepting(q) && stays(nba, here.1, q);
                stays.then(|| vec![waypoint(here, q)])?
            } else {
                Runs::new(nba, suffix, &[q], true).run_to(suffix.len() - 1, q)?
            };
            let prefix = ways.run_to(end, q)?;
            Some(Path { prefix, suffix })
        };
        entries.iter().find_map(round)
    }
}

/// Whether reading `letter` again and again, at least once, can lead back to `state`.
fn stays(nba: &Nba, letter: Letter, state: StateId) -> bool {
    let mut seen = vec![false; nba.len()];
    let mut open = vec![state];
    while let Some(q) = open.pop() {
        for next in nba.successors(q, letter) {
            if next == state {
                return true;
            }
            if !std::mem::replace(&mut seen[next.index()], true) {
                open.push(next);
            }
        }
    }
    false
}

fn waypoint(stop: &Stop, state: StateId) -> Waypoint {
    Waypoint { at: stop.0, state }
}

/// All runs of an automaton along stops, with as few waits as possible; of a suffix, those that have
/// passed an accepting state are told apart from the others.
struct Runs<'s> {
    stops: &'s [Stop],
    states: usize,
    /// The number of layers: two where it matters whether an accepting state was passed.
    layers: usize,
    /// For each (stop, state, layer): the waits needed and where it was reached from.
    labels: Vec<Option<(usize, Option<usize>)>>,
}

impl<'s> Runs<'s> {
    fn new(nba: &Nba, stops: &'s [Stop], from: &[StateId], accept: bool) -> Self {
        let (states, layers) = (nba.len(), 1 + usize::from(accept));
        let mut runs = Self {
            stops,
            states,
            layers,
            labels: vec![None; stops.len() * states * layers],
        };
        let layer = |q: StateId, before: usize| {
            if accept && nba.is_accepting(q) {
                1
            } else {
                before
            }
        };
        let mut queue: VecDeque<(usize, usize, Option<usize>)> = from
            .iter()
            .map(|&q| (0, runs.number(0, q, layer(q, 0)), None))
            .collect();
        while let Some((waits, s, parent)) = queue.pop_front() {
            if runs.labels[s].is_some() {
                continue;
            }
            runs.labels[s] = Some((waits, parent));
            let (stop, state) = runs.split(s);
            for q in nba.successors(state, stops[stop].1) {
                let on = layer(q, s % layers);
                if stop + 1 < stops.len() {
                    queue.push_front((waits, runs.number(stop + 1, q, on), Some(s)));
                }
                queue.push_back((waits + 1, runs.number(stop, q, on), Some(s)));
            }
        }
        runs
    }

    fn number(&self, stop: usize, state: StateId, layer: usize) -> usize {
        (stop * self.states + state.index()) * self.layers + layer
    }

    fn split(&self, s: usize) -> (usize, StateId) {
        let s = s / self.layers;
        (s / self.states, StateId((s % self.states) as u32))
    }

    /// The waits of the run that ends in a state at a stop, having passed an accepting one if that matters.
    fn waits(&self, stop: usize, state: StateId) -> Option<usize> {
        let label = self.labels[self.number(stop, state, self.layers - 1)];
        label.map(|(waits, _)| waits)
    }

    fn run_to(&self, stop: usize, state: StateId) -> Option<Vec<Waypoint>> {
        self.waits(stop, state)?;
        let mut s = self.number(stop, state, self.layers - 1);
        let mut run = Vec::new();
        loop {
            let (stop, state) = self.split(s);
            run.push(waypoint(&self.stops[stop], state));
            match self.labels[s] {
                Some((_, Some(parent))) => s = parent,
                _ => break,
            }
        }
        run.reverse();
        Some(run)
    }
}
