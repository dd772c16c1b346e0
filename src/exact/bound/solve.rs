//! Least costs in the product of gates and automaton: what prefixes and suffixes cost that pass there.
//!
//! A suffix is taken to begin where it passes an accepting state f in a letter L: it leaves L by a gate, comes
//! back into it by another, and closes with a leg from there to the first. Somewhere on the way round the
//! prefix enters. So it is followed in two layers, before and after that, and what entering on a leg costs is
//! added there ([`Entrances`]).

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::Gates;
use super::entrances::{Arrivals, Entrances};
use super::product::{Leg, Product};
use crate::queue::Entry;

/// Least costs in a product, and what they were found from.
pub(super) struct Solved<'g> {
    /// The length of the way from the start to each node.
    from_start: Vec<f64>,
    /// The length of the way to where the robot can stay for ever.
    to_rest: Vec<f64>,
    /// What is left to pay from a node of a prefix until its suffix is done.
    to_enter: Vec<f64>,
    entrances: Entrances<'g>,
    /// For each leg, what it costs to enter a suffix on it.
    entering: Vec<f64>,
    /// The same as well as it can be found; not a number where that was not asked for.
    entering_exactly: RefCell<Vec<f64>>,
    rounds: Vec<Round>,
}

/// Suffixes that pass an accepting state in a letter; all in costs.
struct Round {
    letter: usize,
    departures: Vec<usize>,
    arrivals: Vec<usize>,
    /// From where the suffix first leaves the letter: not entered yet, and entered.
    out: Vec<f64>,
    joined: Vec<f64>,
    /// To where it comes back into it: still to be entered on the way, and entered.
    left: Vec<f64>,
    home: Vec<f64>,
    /// To enter it within the letter: by automaton state on arrival, the ways there.
    within: f64,
    entries: Vec<Option<Arrivals>>,
}

impl Round {
    /// What a suffix costs at least that passes a node, with the prefix that enters it.
    fn through(&self, node: usize) -> f64 {
        let entered = self.joined[node] + self.home[node];
        entered.min(self.out[node] + self.left[node].min(self.home[node] + self.within))
    }

    /// The same for a leg of this cost, which is entered at another.
    fn by(&self, leg: &Leg, cost: f64, entering: f64) -> f64 {
        let (from, to) = (leg.from as usize, leg.to as usize);
        let here = self.out[from] + entering + self.home[to];
        if !leg.walk {
            return here;
        }
        let before = self.joined[from] + cost + self.home[to];
        let after = self.left[to].min(self.home[to] + self.within);
        here.min(before).min(self.out[from] + cost + after)
    }
}

impl Product<'_> {
    pub(super) fn solve<'g>(&self, gates: &'g Gates, cut: f64) -> Solved<'g> {
        let limit = if self.weight > 1e-9 {
            cut / self.weight
        } else {
            f64::INFINITY
        };
        let starts = (0..self.task.nba.initial.len()).map(|n| (n, 0.0));
        let from_start = self.distances(starts, 1.0, false, limit);
        let entrances = Entrances::new(gates, self, &from_start);
        let rough = |leg: &Leg| {
            let Some(class) = leg.entry else {
                return f64::INFINITY;
            };
            let ends = [leg.from, leg.to].map(|n| self.nodes[n as usize].gate);
            entrances.rough(entrances.of_class(class), ends, leg.length)
        };
        let entering: Vec<f64> = self.legs.iter().map(rough).collect();
        let mut resting: Vec<usize> = Vec::new();
        let mut rounds = Vec::new();
        for letter in 0..self.letters.len() {
            for f in &self.task.feasible {
                let arrivals: Vec<usize> = self.arrivals(letter, f.0).collect();
                let often = self.relations.often(self.letters[letter], f.0);
                if often.contains(&f.0) {
                    // Staying costs nothing, so nothing else can be cheaper.
                    resting.extend(arrivals);
                } else {
                    let departures = self.departures(gates, letter, f.0);
                    let ends = (departures, arrivals);
                    rounds.extend(self.round(&entrances, &entering, letter, ends, cut));
                }
            }
        }
        let resting = resting.into_iter().map(|n| (n, 0.0));
        let to_rest = self.distances(resting, 1.0, true, limit);
        let to_enter = self.to_enter(&rounds, cut);
        Solved {
            from_start,
            to_rest,
            to_enter,
            entrances,
            entering_exactly: RefCell::new(vec![f64::NAN; entering.len()]),
            entering,
            rounds,
        }
    }

    fn round(
        &self,
        entrances: &Entrances<'_>,
        entering: &[f64],
        letter: usize,
        (departures, arrivals): (Vec<usize>, Vec<usize>),
        cut: f64,
    ) -> Option<Round> {
        let share = 1.0 - self.weight;
        let seeds = |nodes: &[usize]| nodes.iter().map(|&n| (n, 0.0)).collect::<Vec<_>>();
        let out = self.distances(seeds(&departures).into_iter(), share, false, cut);
        if !arrivals.iter().any(|&n| out[n].is_finite()) {
            return None;
        }
        let home = self.distances(seeds(&arrivals).into_iter(), share, true, cut);
        let legs = || self.legs.iter().zip(entering).filter(|(_, x)| **x < cut);
        let after = legs().map(|(leg, x)| (leg.to as usize, out[leg.from as usize] + x));
        let joined = self.distances(after, share, false, cut);
        let before = legs().map(|(leg, x)| (leg.from as usize, x + home[leg.to as usize]));
        let left = self.distances(before, share, true, cut);
        let mut entries: Vec<Option<Arrivals>> = Vec::new();
        entries.resize_with(self.task.nba.len(), || None);
        let mut within = f64::INFINITY;
        for &n in arrivals.iter().filter(|&&n| out[n].is_finite()) {
            let state = self.nodes[n].state as usize;
            let into = || entrances.into(letter, self.reads[letter][state]);
            let ways = entries[state].get_or_insert_with(into);
            within = within.min(self.total(ways.nearest(), 0.0));
        }
        Some(Round {
            letter,
            departures,
            arrivals,
            out,
            joined,
            left,
            home,
            within,
            entries,
        })
    }

    /// What is left to pay from each node on a prefix: to some letter in which a suffix is entered, and that
    /// suffix.
    fn to_enter(&self, rounds: &[Round], cut: f64) -> Vec<f64> {
        let mut least = vec![f64::INFINITY; self.classes.len()];
        let mut within = Vec::new();
        for round in rounds {
            for leg in &self.legs {
                let Some(class) = leg.entry else { continue };
                let whole = round.out[leg.from as usize]
                    + (1.0 - self.weight) * leg.length
                    + round.home[leg.to as usize];
                let known = &mut least[class as usize];
                *known = known.min(whole);
            }
            for &n in round.arrivals.iter().filter(|&&n| round.out[n] < cut) {
                let states = self.reads[round.letter][self.nodes[n].state as usize];
                within.push((round.letter, round.out[n], states));
            }
        }
        let mut by_letter = vec![Vec::new(); self.letters.len()];
        for (&(letter, states), cost) in self.classes.iter().zip(least) {
            by_letter[letter].push((cost, states));
        }
        for (letter, cost, states) in within {
            let row = &mut by_letter[letter];
            match row.iter_mut().find(|known| known.1 == states) {
                Some(known) => known.0 = known.0.min(cost),
                None => row.push((cost, states)),
            }
        }
        let seed = |(n, node): (usize, &super::product::Node)| {
            let mine = self.reads[node.letter][node.state as usize];
            let all = by_letter[node.letter].iter();
            let least = all.filter(|(_, states)| states & mine != 0).map(|s| s.0);
            (n, least.fold(f64::INFINITY, f64::min))
        };
        let seeds: Vec<(usize, f64)> = self.nodes.iter().enumerate().map(seed).collect();
        self.distances(seeds.into_iter(), self.weight, true, cut)
    }

    fn total(&self, prefix: f64, suffix: f64) -> f64 {
        // A share of nothing costs nothing, even of an infinite length that was cut off.
        let part = |share: f64, length: f64| if share > 0.0 { share * length } else { 0.0 };
        part(self.weight, prefix) + part(1.0 - self.weight, suffix)
    }

    /// Whether a plan below `cut` can take a leg.
    fn is_useful(&self, solved: &Solved<'_>, k: usize, cut: f64) -> bool {
        let leg = &self.legs[k];
        let (from, to) = (leg.from as usize, leg.to as usize);
        if leg.walk {
            let way = solved.from_start[from] + leg.length;
            let enters = self.total(way, 0.0) + solved.to_enter[to];
            if enters < cut || self.total(way + solved.to_rest[to], 0.0) < cut {
                return true;
            }
        }
        let cost = self.total(0.0, leg.length);
        let by = |round: &Round| round.by(leg, cost, solved.entering[k]) < cut;
        solved.rounds.iter().any(by)
    }

    /// Which legs a plan below `cut` can take.
    pub(super) fn useful_legs(&self, solved: &Solved<'_>, cut: f64) -> Vec<bool> {
        (0..self.legs.len())
            .map(|k| self.is_useful(solved, k, cut))
            .collect()
    }

    /// Which nodes a plan below `cut` can pass.
    pub(super) fn useful_nodes(&self, solved: &Solved<'_>, cut: f64) -> Vec<bool> {
        let useful = |n: usize| {
            let way = solved.from_start[n];
            self.total(way, 0.0) + solved.to_enter[n] < cut
                || self.total(way + solved.to_rest[n], 0.0) < cut
                || solved.rounds.iter().any(|round| round.through(n) < cut)
        };
        (0..self.nodes.len()).map(useful).collect()
    }

    /// What any plan costs at least; `cut` if it is that or more.
    pub(super) fn bound(&self, solved: &Solved<'_>, cut: f64) -> f64 {
        let resting = (0..self.nodes.len()).filter(|&n| solved.to_rest[n] == 0.0);
        let rest = resting.map(|n| solved.from_start[n]);
        let mut best = self.total(rest.fold(f64::INFINITY, f64::min), 0.0).min(cut);
        for round in &solved.rounds {
            // One search for each gate by which the suffix leaves, to close it with the leg from there.
            let mut departures = round.departures.clone();
            departures.sort_by_key(|&n| self.nodes[n].gate);
            for group in departures.chunk_by(|&a, &b| self.nodes[a].gate == self.nodes[b].gate) {
                best = Closing {
                    product: self,
                    solved,
                    round,
                    gate: self.nodes[group[0]].gate,
                }
                .least(group, best);
            }
        }
        best
    }
}

/// The search for suffixes that leave their letter by one gate.
struct Closing<'a, 'g, 't> {
    product: &'a Product<'t>,
    solved: &'a Solved<'g>,
    round: &'a Round,
    gate: usize,
}

/// What a queue's entry stands for.
const OUT: u32 = 0;
const JOINED: u32 = 1;
const ENTERING: u32 = 2;

impl Closing<'_, '_, '_> {
    /// The least cost of a plan with such a suffix, if it is below `best`. An A* over both layers; what
    /// entering on a leg costs is found well only when it comes to that.
    fn least(&self, departures: &[usize], mut best: f64) -> f64 {
        let (product, round) = (self.product, self.round);
        let share = 1.0 - product.weight;
        let hopeless = |&n: &usize| round.through(n) >= best;
        if departures.iter().all(hopeless) {
            return best;
        }
        let size = product.nodes.len();
        let mut costs = [vec![f64::INFINITY; size], vec![f64::INFINITY; size]];
        let mut queue = BinaryHeap::new();
        let ahead = |layer: u32, n: usize| match layer {
            OUT => round.left[n].min(round.home[n] + round.within),
            _ => round.home[n],
        };
        let push = |queue: &mut BinaryHeap<Reverse<(Entry<u32>, u32)>>, kind, cost: f64, i| {
            queue.push(Reverse((Entry(cost, i), kind)));
        };
        for &n in departures {
            costs[0][n] = 0.0;
            push(&mut queue, OUT, ahead(OUT, n), n as u32);
        }
        let mut is_arrival = vec![false; size];
        round.arrivals.iter().for_each(|&n| is_arrival[n] = true);
        while let Some(Reverse((Entry(whole, i), kind))) = queue.pop() {
            if whole >= best {
                break;
            }
            if kind == ENTERING {
                let leg = &product.legs[i as usize];
                let (from, to) = (leg.from as usize, leg.to as usize);
                let cost = costs[0][from] + self.entering(i as usize);
                if cost < costs[1][to] && cost + ahead(JOINED, to) < best {
                    costs[1][to] = cost;
                    push(&mut queue, JOINED, cost + ahead(JOINED, to), to as u32);
                }
                continue;
            }
            let n = i as usize;
            let cost = costs[kind as usize][n];
            if whole > cost + ahead(kind, n) + 1e-12 {
                continue;
            }
            if is_arrival[n] {
                best = best.min(cost + self.close(n, kind == JOINED, best - cost));
            }
            for &k in &product.out[n] {
                let leg = &product.legs[k as usize];
                let to = leg.to as usize;
                if kind == OUT && leg.entry.is_some() {
                    let enters = cost + self.solved.entering[k as usize] + ahead(JOINED, to);
                    if enters < best {
                        push(&mut queue, ENTERING, enters, k);
                    }
                }
                let through = cost + share * leg.length;
                let known = &mut costs[kind as usize][to];
                if leg.walk && through < *known && through + ahead(kind, to) < best {
                    *known = through;
                    push(&mut queue, kind, through + ahead(kind, to), leg.to);
                }
            }
        }
        best
    }

    /// What entering on a leg costs, as well as it can be found.
    fn entering(&self, k: usize) -> f64 {
        let known = self.solved.entering_exactly.borrow()[k];
        if !known.is_nan() {
            return known;
        }
        let (leg, entrances) = (&self.product.legs[k], &self.solved.entrances);
        let ends = [leg.from, leg.to].map(|n| self.product.nodes[n as usize].gate);
        let exact = leg.entry.map_or(f64::INFINITY, |class| {
            entrances.exact(entrances.of_class(class), ends, leg.length, f64::INFINITY)
        });
        let exact = exact.max(self.solved.entering[k]);
        self.solved.entering_exactly.borrow_mut()[k] = exact;
        exact
    }

    /// What closing costs from where the suffix comes back: the leg to where it left, on which it is
    /// entered if it was not; `limit` if that or more.
    fn close(&self, n: usize, joined: bool, limit: f64) -> f64 {
        let (product, letter) = (self.product, self.round.letter);
        let node = &product.nodes[n];
        let entrances = &self.solved.entrances;
        let length = entrances.known(letter, node.gate, self.gate);
        let cost = product.total(0.0, length);
        if joined || !length.is_finite() || cost >= limit {
            return cost;
        }
        let ends = [node.gate, self.gate];
        match &self.round.entries[node.state as usize] {
            Some(ways) if entrances.rough(ways, ends, length) < limit => {
                entrances.exact(ways, ends, length, limit)
            }
            _ => limit,
        }
    }
}
