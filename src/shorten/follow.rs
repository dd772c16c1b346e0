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

    /// Finds a run along the stops: to a feasible accepting state at the prefix's end, and along the
    /// suffix back to it.
    fn follow(&self, prefix: &[Stop], suffix: &[Stop]) -> Option<Path> {
        let nba = &self.task.nba;
        let end = prefix.len() - 1;
        let to_goal = Runs::new(nba, prefix, &nba.initial);
        let mut best: Option<(usize, Path)> = None;
        for &goal in &self.task.feasible {
            let Some((waits, run)) = to_goal.run_to(end, goal) else {
                continue;
            };
            if best.as_ref().is_some_and(|b| b.0 <= waits) {
                continue;
            }
            let round = if let [here] = suffix {
                stays(nba, here.1, goal).then(|| vec![waypoint(here, goal)])
            } else {
                let round = Runs::new(nba, suffix, &[goal]).run_to(suffix.len() - 1, goal);
                round.map(|(_, run)| run)
            };
            if let Some(suffix) = round {
                let prefix = run;
                best = Some((waits, Path { prefix, suffix }));
            }
        }
        best.map(|(_, path)| path)
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

/// All runs of an automaton along stops, with as few waits as possible.
struct Runs<'s> {
    stops: &'s [Stop],
    states: usize,
    /// For each (stop, state): the waits needed and where it was reached from.
    labels: Vec<Option<(usize, Option<usize>)>>,
}

impl<'s> Runs<'s> {
    fn new(nba: &Nba, stops: &'s [Stop], from: &[StateId]) -> Self {
        let states = nba.len();
        let mut runs = Self {
            stops,
            states,
            labels: vec![None; stops.len() * states],
        };
        let mut queue: VecDeque<(usize, usize, Option<usize>)> =
            from.iter().map(|q| (0, q.index(), None)).collect();
        while let Some((waits, s, parent)) = queue.pop_front() {
            if runs.labels[s].is_some() {
                continue;
            }
            runs.labels[s] = Some((waits, parent));
            let (stop, state) = (s / states, StateId((s % states) as u32));
            for q in nba.successors(state, stops[stop].1) {
                if stop + 1 < stops.len() {
                    queue.push_front((waits, (stop + 1) * states + q.index(), Some(s)));
                }
                queue.push_back((waits + 1, stop * states + q.index(), Some(s)));
            }
        }
        runs
    }

    fn run_to(&self, stop: usize, state: StateId) -> Option<(usize, Vec<Waypoint>)> {
        let mut s = stop * self.states + state.index();
        let (waits, _) = self.labels[s]?;
        let mut run = Vec::new();
        loop {
            let state = StateId((s % self.states) as u32);
            run.push(waypoint(&self.stops[s / self.states], state));
            match self.labels[s] {
                Some((_, Some(parent))) => s = parent,
                _ => break,
            }
        }
        run.reverse();
        Some((waits, run))
    }
}
