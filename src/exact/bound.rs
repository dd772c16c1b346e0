//! A certified lower bound on the cost of every plan of a mission whose suffix begins where the automaton
//! accepts, as the papers' plans do.
//!
//! # The bound
//! Where the letter changes, a path crosses the border of a region that the task speaks of. Those borders
//! are cut into pieces, the *gates*. A path is then a sequence of legs from gate to gate, each within one
//! letter, and the automaton reads each letter once or more. A leg in letter L from gate g to gate h
//! is bounded below by the larger of
//!
//! - the distance of the two pieces in a straight line, and
//! - d(m, n) − (|g| + |h|) / 2, where m and n are the middles of the pieces, |g| and |h| their lengths, and
//!   d the length of the shortest path that avoids the obstacles and every region that L lacks. Proof:
//!   d is a metric on that space, and the pieces lie in it, so for p on g and q on h
//!   d(p, q) ≥ d(m, n) − d(p, m) − d(q, n) ≥ d(m, n) − |g|/2 − |h|/2.
//!
//! What such a leg may do besides, how the next one continues it (at another point of the gate, at no
//! cost), is a relaxation. So the shortest path in the product of gates and automaton bounds every
//! prefix, and shortest cycles bound every suffix: a suffix that moves and never changes the letter could
//! stay instead, and any other one leaves the letter L in which it begins, with accepting state f, by
//! some gate h and comes back into L by some gate g; on the way between them it spends at least the leg
//! from g to h. The prefix is at least as long as the cheapest way into L from which f can be reached.
//! More than that, where the suffix begins at x, with e(z) the least length of a prefix that comes into
//! L and goes on in it to gate z, the prefix P and the parts t from x to h and u from g to x obey
//! P ≥ e(h) − t and P ≥ e(g) − u. So P ≥ (e(g) + e(h) − (t + u)) / 2, where t + u is the length c of the leg
//! from g to h or more; and if it is more, by s, the suffix costs (1 − λ)·s more and the prefix at most
//! λ·s/2 less: for λ ≤ 2/3 the total is least at t + u = c.
//!
//! # Convex regions
//! Gates that share an end are no distance apart, so a path that crossed one border in and out again and
//! again could creep along it for nothing. Such paths are not needed. Where a convex region that
//! nothing touches is left and entered again before any other, the way back can be taken inside, along
//! the chord, and the letters that the border's crossings gave can be read where the region was first
//! entered (or, if the path or the suffix begins inside, where it is last left), at no length, in the same
//! order. So a region that is left is entered again through the same gate only, and once it was crossed
//! from one gate to another, not before another region.
//!
//! # Refinement
//! Gates through which no plan cheaper than the one that is known can lead are dropped, the others are
//! halved, and again (branch and bound). The result is never above the known plan's cost.
//!
//! # Degenerate maps
//! Where regions of the task touch or overlap each other or obstacles, regions are not avoided and a gate
//! may lead from any letter to any other, since a path can pass where two borders cross. The bound
//! holds then, too, but is weaker.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::sync::Arc;

use nalgebra::Point2;

use super::words::Relations;
use crate::alphabet::{Letter, Props};
use crate::automaton::Task;
use crate::shorten::used_regions;
use crate::workspace::visibility::{PathsTo, VisibilityGraph};
use crate::workspace::{Polygon, Side, Workspace};

/// Rounds of refinement, and the number of legs in the product beyond which no further one begins.
const ROUNDS: usize = 14;
const MAX_LEGS: usize = 600_000;

/// The share of the known plan's cost that the bound need not resolve.
const PRECISION: f64 = 1e-4;

/// What borders are resolved to lets a path cut corners by about so much, as a share of the map's
/// longer side; the bound is lowered by it.
const RESOLUTION: f64 = 1e-6;

/// What every plan of the mission costs at least whose suffix begins in an accepting state; `upper` is the cost of a known one (or infinite), and
/// what is returned is at most that. `weight` is the prefix's share λ of the cost.
#[must_use]
pub fn lower_bound(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    upper: f64,
) -> f64 {
    let Some(mut gates) = Gates::new(workspace, start, task) else {
        return 0.0;
    };
    // What costs more than this is as good as the known plan.
    let cut = upper * (1.0 - PRECISION);
    let mut best: f64 = 0.0;
    let mut product = Product::new(&gates, task, weight);
    for _ in 0..ROUNDS {
        let solved = product.solve(&gates, cut);
        product.prune(&solved, cut);
        product.lengthen(&mut gates);
        let solved = product.solve(&gates, cut);
        product.prune(&solved, cut);
        best = best.max(product.bound(&gates, &solved, cut));
        if best >= cut || 4 * product.legs.len() > MAX_LEGS {
            break;
        }
        let keep = product.useful_nodes(&solved, cut);
        product.halve(&mut gates, &keep);
    }
    (best - RESOLUTION * workspace.bounds().side()).max(0.0)
}

/// A piece of a border; the first gate is the start, a piece of no length.
#[derive(Clone, Copy, Debug)]
struct Gate {
    a: Point2<f64>,
    b: Point2<f64>,
    region: usize,
    /// Whether no obstacle covers part of it, so that its points can be reached from its middle.
    free: bool,
}

impl Gate {
    fn middle(&self) -> Point2<f64> {
        nalgebra::center(&self.a, &self.b)
    }

    fn length(&self) -> f64 {
        (self.b - self.a).norm()
    }
}

/// The gates of a mission and what legs between them are known to cost.
struct Gates {
    gates: Vec<Gate>,
    /// Letters by the regions of the task in them, and one letter of the map for each.
    letters: Vec<(Props, Letter)>,
    start_letter: usize,
    apart: bool,
    /// By number, which of the map's regions are convex and apart from all else.
    convex: Vec<bool>,
    /// For each letter the space in which legs with it run.
    spaces: Vec<Option<VisibilityGraph>>,
    paths: HashMap<(usize, [u64; 2]), PathsTo>,
    legs: HashMap<(usize, [u64; 4]), f64>,
    workspace: Workspace,
}

impl Gates {
    fn new(workspace: &Workspace, start: Point2<f64>, task: &Task) -> Option<Self> {
        let used = used_regions(workspace, task);
        let alphabet = workspace.alphabet();
        let mut letters: Vec<(Props, Letter)> = Vec::new();
        for letter in alphabet.letters() {
            let props = Props(alphabet.props(letter).0 & used.0);
            if !letters.iter().any(|l| l.0 == props) {
                letters.push((props, letter));
            }
        }
        let here = Props(alphabet.props(workspace.letter_at(start)?).0 & used.0);
        let start_letter = letters.iter().position(|l| l.0 == here)?;
        let regions: Vec<(usize, &Polygon)> = used
            .iter()
            .map(|i| (i, &workspace.regions()[i].polygon))
            .collect();
        let margin = 16.0 * workspace.tolerance();
        let all = regions.iter().map(|r| r.1).chain(workspace.obstacles());
        let all: Vec<&Polygon> = all.collect();
        let apart = (0..regions.len())
            .all(|i| (i + 1..all.len()).all(|j| are_apart(all[i], all[j], margin)));
        let spaces = letters
            .iter()
            .map(|(props, _)| space(workspace, &regions, *props, apart))
            .collect();
        let origin = Gate {
            a: start,
            b: start,
            region: usize::MAX,
            free: true,
        };
        let mut gates = vec![origin];
        for &(region, polygon) in &regions {
            gates.extend(polygon.edges().map(|(a, b)| Gate {
                a,
                b,
                region,
                free: workspace.is_free_segment(a, b),
            }));
        }
        Some(Self {
            gates,
            letters,
            start_letter,
            apart,
            convex: workspace
                .regions()
                .iter()
                .map(|r| apart && is_convex(&r.polygon))
                .collect(),
            spaces,
            paths: HashMap::new(),
            legs: HashMap::new(),
            workspace: workspace.clone(),
        })
    }

    /// The letters that a path may come from and go on with at a gate.
    fn crossings(&self, gate: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let region = self.gates[gate].region;
        let n = self.letters.len();
        let pairs = (0..n).flat_map(move |from| (0..n).map(move |to| (from, to)));
        pairs.filter(move |&(from, to)| gate != 0 && self.crosses(region, from, to))
    }

    /// Whether the letter can change like this on the border of a region.
    fn crosses(&self, region: usize, from: usize, to: usize) -> bool {
        let change = self.letters[from].0.0 ^ self.letters[to].0.0;
        if self.apart {
            change == 1 << region
        } else {
            change != 0
        }
    }

    /// Whether a shortest path may go on from a node to a gate, and whether it has then crossed a convex
    /// region (see the module's words on convex regions).
    fn goes_on(&self, node: &Node, gate: usize) -> Option<bool> {
        let region = self.gates[gate].region;
        if !self.convex[region] {
            return Some(false);
        }
        if self.letters[node.letter].0.contains(region) {
            return Some(node.gate != 0 && node.gate != gate);
        }
        let back = node.gate != 0 && self.gates[node.gate].region == region;
        (!back || node.gate == gate && !node.crossed).then_some(false)
    }

    /// A lower bound on a leg's length by straight lines.
    fn straight(&self, g: usize, h: usize) -> f64 {
        let (g, h) = (&self.gates[g], &self.gates[h]);
        segment_distance((g.a, g.b), (h.a, h.b))
    }

    /// A lower bound on a leg's length by the shortest path between the middles.
    fn around(&mut self, letter: usize, g: usize, h: usize) -> f64 {
        let (g, h) = (self.gates[g], self.gates[h]);
        let Some(space) = self.spaces[letter].as_ref().filter(|_| g.free && h.free) else {
            return 0.0;
        };
        let (bits, low, high) = key(g.middle(), h.middle());
        let paths = &mut self.paths;
        let whole = *self.legs.entry((letter, bits)).or_insert_with(|| {
            let paths = paths
                .entry((letter, [bits[0], bits[1]]))
                .or_insert_with(|| space.paths_to(low));
            let found = paths.first_leg(space, high);
            found.map_or(f64::INFINITY, |(length, _)| length)
        });
        whole - (g.length() + h.length()) / 2.0
    }

    /// As much as is known of the length of a leg.
    fn known(&self, letter: usize, g: usize, h: usize) -> f64 {
        if g == h {
            return 0.0;
        }
        let straight = self.straight(g, h);
        let (g, h) = (self.gates[g], self.gates[h]);
        match self.legs.get(&(letter, key(g.middle(), h.middle()).0)) {
            Some(whole) => straight.max(whole - (g.length() + h.length()) / 2.0),
            None => straight,
        }
    }

    /// Halves the gates that are to be kept and drops the others. Returns for each the numbers of its
    /// halves.
    fn halve(&mut self, keep: &[bool]) -> Vec<Vec<usize>> {
        let mut next = vec![self.gates[0]];
        let mut halves = vec![vec![0]];
        for (gate, keep) in self.gates.iter().zip(keep).skip(1) {
            let middle = gate.middle();
            let mut mine = Vec::new();
            for (a, b) in [(gate.a, middle), (middle, gate.b)] {
                if *keep {
                    mine.push(next.len());
                    next.push(Gate {
                        a,
                        b,
                        region: gate.region,
                        free: gate.free || self.workspace.is_free_segment(a, b),
                    });
                }
            }
            halves.push(mine);
        }
        self.gates = next;
        halves
    }
}

/// Two points in an order of their own, and their bits.
fn key(m: Point2<f64>, n: Point2<f64>) -> ([u64; 4], Point2<f64>, Point2<f64>) {
    let bits = |p: Point2<f64>| [p.x.to_bits(), p.y.to_bits()];
    let (low, high) = if bits(m) < bits(n) { (m, n) } else { (n, m) };
    let ([a, b], [c, d]) = (bits(low), bits(high));
    ([a, b, c, d], low, high)
}

/// The space of legs with a letter: the map with the regions that the letter lacks as obstacles.
fn space(
    workspace: &Workspace,
    regions: &[(usize, &Polygon)],
    props: Props,
    apart: bool,
) -> Option<VisibilityGraph> {
    let mut obstacles = workspace.obstacles().to_vec();
    if apart {
        let lacking = regions.iter().filter(|(i, _)| !props.contains(*i));
        obstacles.extend(lacking.map(|(_, polygon)| (*polygon).clone()));
    }
    let map = Workspace::new(workspace.bounds(), obstacles, Vec::new()).ok()?;
    Some(VisibilityGraph::new(Arc::new(map)))
}

/// A node of the product: a gate, the letter that it leads into, and the automaton's state there.
#[derive(Clone, Copy, Debug)]
struct Node {
    gate: usize,
    letter: usize,
    state: u32,
    /// Whether a convex region was just crossed from another gate.
    crossed: bool,
}

/// A leg of the product between two nodes, by their numbers.
#[derive(Clone, Copy, Debug)]
struct Leg {
    from: u32,
    to: u32,
    length: f64,
}

/// The product of gates and automaton.
struct Product<'t> {
    task: &'t Task,
    weight: f64,
    letters: Vec<Letter>,
    relations: Relations,
    nodes: Vec<Node>,
    legs: Vec<Leg>,
    /// For each node the numbers of the legs from it, and to it.
    out: Vec<Vec<u32>>,
    into: Vec<Vec<u32>>,
}

/// Distances in a product.
struct Solved {
    from_start: Vec<f64>,
    /// To where the robot can stay for ever.
    to_rest: Vec<f64>,
    rounds: Vec<Round>,
}

/// Suffixes that begin with a letter, in an accepting state.
struct Round {
    letter: usize,
    state: u32,
    /// The least length of a prefix to there.
    prefix: f64,
    /// From where the suffix first leaves the letter, and to where it comes back into it.
    from: Vec<f64>,
    to: Vec<f64>,
    /// The least length of a suffix, without its leg within the letter.
    least: f64,
}

impl<'t> Product<'t> {
    fn new(gates: &Gates, task: &'t Task, weight: f64) -> Self {
        let relations = Relations::new(&task.nba);
        let letters: Vec<Letter> = gates.letters.iter().map(|l| l.1).collect();
        let states = task.nba.len() as u32;
        let mut nodes = Vec::new();
        let mut numbers = HashMap::new();
        // For each letter the gates at which a leg in it can end, and what they lead into.
        let mut ends: Vec<Vec<(usize, usize)>> = vec![Vec::new(); letters.len()];
        for q in &task.nba.initial {
            nodes.push(Node {
                gate: 0,
                letter: gates.start_letter,
                state: q.0,
                crossed: false,
            });
        }
        for gate in 1..gates.gates.len() {
            for (from, to) in gates.crossings(gate) {
                ends[from].push((gate, to));
                for (state, crossed) in (0..states).flat_map(|q| [(q, false), (q, true)]) {
                    numbers
                        .entry((gate, to, state, crossed))
                        .or_insert_with(|| {
                            nodes.push(Node {
                                gate,
                                letter: to,
                                state,
                                crossed,
                            });
                            nodes.len() - 1
                        });
                }
            }
        }
        let mut legs = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            for &(gate, to) in &ends[node.letter] {
                let Some(crossed) = gates.goes_on(node, gate) else {
                    continue;
                };
                let length = gates.straight(node.gate, gate);
                for &state in relations.often(letters[node.letter], node.state) {
                    legs.push(Leg {
                        from: i as u32,
                        to: numbers[&(gate, to, state, crossed)] as u32,
                        length,
                    });
                }
            }
        }
        let mut product = Self {
            task,
            weight,
            letters,
            relations,
            nodes,
            legs,
            out: Vec::new(),
            into: Vec::new(),
        };
        product.index();
        product
    }

    fn index(&mut self) {
        self.out = vec![Vec::new(); self.nodes.len()];
        self.into = vec![Vec::new(); self.nodes.len()];
        for (k, leg) in self.legs.iter().enumerate() {
            self.out[leg.from as usize].push(k as u32);
            self.into[leg.to as usize].push(k as u32);
        }
    }

    /// Shortest distances from (or to) a set of nodes, as far as they are below `limit`.
    fn distances(&self, from: impl Iterator<Item = usize>, back: bool, limit: f64) -> Vec<f64> {
        let mut found = vec![f64::INFINITY; self.nodes.len()];
        let mut queue = BinaryHeap::new();
        for n in from {
            found[n] = 0.0;
            queue.push(Reverse(Entry(0.0, n as u32)));
        }
        while let Some(Reverse(Entry(length, n))) = queue.pop() {
            if length > found[n as usize] {
                continue;
            }
            let legs = if back { &self.into } else { &self.out };
            for &k in &legs[n as usize] {
                let leg = self.legs[k as usize];
                let next = if back { leg.from } else { leg.to };
                let through = length + leg.length;
                if through < found[next as usize] && through < limit {
                    found[next as usize] = through;
                    queue.push(Reverse(Entry(through, next)));
                }
            }
        }
        found
    }

    /// The nodes from which `state` can be read to within their letter, if that is `letter`.
    fn arrivals(&self, letter: usize, state: u32) -> impl Iterator<Item = usize> + '_ {
        let all = self.nodes.iter().enumerate();
        let here = all.filter(move |(_, n)| {
            let reads = || self.relations.often(self.letters[letter], n.state);
            n.letter == letter && (n.state == state || reads().contains(&state))
        });
        here.map(|(i, _)| i)
    }

    /// The nodes at which a suffix can first leave `letter`, begun in `state`.
    fn departures(&self, gates: &Gates, letter: usize, state: u32) -> Vec<usize> {
        let reads = self.relations.often(self.letters[letter], state);
        let leaves = |n: &Node| {
            let region = gates.gates[n.gate].region;
            n.gate != 0
                && !n.crossed
                && gates.crosses(region, letter, n.letter)
                && reads.contains(&n.state)
        };
        let all = self.nodes.iter().enumerate();
        all.filter(|(_, n)| leaves(n)).map(|(i, _)| i).collect()
    }

    fn solve(&self, gates: &Gates, cut: f64) -> Solved {
        let part = |share: f64| {
            if share > 1e-9 {
                cut / share
            } else {
                f64::INFINITY
            }
        };
        let (prefix_limit, suffix_limit) = (part(self.weight), part(1.0 - self.weight));
        let starts = self.task.nba.initial.len();
        let from_start = self.distances(0..starts, false, prefix_limit);
        let mut resting: Vec<usize> = Vec::new();
        let mut rounds = Vec::new();
        for letter in 0..self.letters.len() {
            for f in &self.task.feasible {
                let arrivals: Vec<usize> = self.arrivals(letter, f.0).collect();
                let reached = arrivals.iter().map(|&n| from_start[n]);
                let prefix = reached.fold(f64::INFINITY, f64::min);
                if self
                    .relations
                    .often(self.letters[letter], f.0)
                    .contains(&f.0)
                {
                    // Staying costs nothing, so nothing else can be cheaper.
                    resting.extend(arrivals);
                    continue;
                }
                if !prefix.is_finite() {
                    continue;
                }
                let departures = self.departures(gates, letter, f.0);
                let from = self.distances(departures.into_iter(), false, suffix_limit);
                let to = self.distances(arrivals.iter().copied(), true, f64::INFINITY);
                let least = arrivals.iter().map(|&n| from[n]);
                let least = least.fold(f64::INFINITY, f64::min);
                rounds.push(Round {
                    letter,
                    state: f.0,
                    prefix,
                    from,
                    to,
                    least,
                });
            }
        }
        let to_rest = self.distances(resting.into_iter(), true, prefix_limit);
        Solved {
            from_start,
            to_rest,
            rounds,
        }
    }

    fn total(&self, prefix: f64, suffix: f64) -> f64 {
        // A share of nothing costs nothing, even of an infinite length that was cut off.
        let part = |share: f64, length: f64| if share > 0.0 { share * length } else { 0.0 };
        part(self.weight, prefix) + part(1.0 - self.weight, suffix)
    }

    /// What a plan costs at least that goes `length` from one node to another, whatever its part.
    fn through(&self, solved: &Solved, from: usize, length: f64, to: usize) -> f64 {
        let prefix = solved.from_start[from] + length;
        let mut least = self.total(prefix + solved.to_rest[to], 0.0);
        for round in &solved.rounds {
            let on_prefix = self.total(prefix + round.to[to], round.least);
            let on_suffix = self.total(round.prefix, round.from[from] + length + round.to[to]);
            least = least.min(on_prefix).min(on_suffix);
        }
        least
    }

    /// Drops the legs that no plan below `cut` can take.
    fn prune(&mut self, solved: &Solved, cut: f64) {
        let mut legs = std::mem::take(&mut self.legs);
        legs.retain(|leg| {
            self.through(solved, leg.from as usize, leg.length, leg.to as usize) < cut
        });
        self.legs = legs;
        self.index();
    }

    /// Replaces the lengths of legs by better bounds.
    fn lengthen(&mut self, gates: &mut Gates) {
        for leg in &mut self.legs {
            let (from, to) = (self.nodes[leg.from as usize], self.nodes[leg.to as usize]);
            if from.gate != to.gate {
                leg.length = leg
                    .length
                    .max(gates.around(from.letter, from.gate, to.gate));
            }
        }
        self.legs.retain(|leg| leg.length.is_finite());
        self.index();
    }

    /// What any plan costs at least; `cut` if it is that or more.
    fn bound(&self, gates: &Gates, solved: &Solved, cut: f64) -> f64 {
        let resting = (0..self.nodes.len()).filter(|&n| solved.to_rest[n] == 0.0);
        let rest = resting.map(|n| solved.from_start[n]);
        let mut best = self.total(rest.fold(f64::INFINITY, f64::min), 0.0).min(cut);
        for round in &solved.rounds {
            if self.total(round.prefix, round.least) >= best {
                continue;
            }
            let arrivals: Vec<usize> = self.arrivals(round.letter, round.state).collect();
            let entry = Entries::new(gates, self, solved, round.letter, &arrivals);
            // One search for each gate by which the suffix leaves, to close it with the leg from there.
            let mut departures = self.departures(gates, round.letter, round.state);
            departures.sort_by_key(|&n| self.nodes[n].gate);
            for group in departures.chunk_by(|&a, &b| self.nodes[a].gate == self.nodes[b].gate) {
                let gate = self.nodes[group[0]].gate;
                let least = group.iter().map(|&n| round.to[n]);
                let least = least.fold(f64::INFINITY, f64::min);
                if self.total(round.prefix, least) >= best {
                    continue;
                }
                let limit = (best - self.weight * round.prefix) / (1.0 - self.weight).max(1e-12);
                let from = self.distances(group.iter().copied(), false, limit);
                for &n in &arrivals {
                    let last = self.nodes[n].gate;
                    if self.total(round.prefix, from[n]) >= best {
                        continue;
                    }
                    let closing = gates.known(round.letter, last, gate);
                    if !closing.is_finite() || self.total(round.prefix, from[n] + closing) >= best {
                        continue;
                    }
                    let joined = (entry.to(gate) + entry.to(last) - closing) / 2.0;
                    let prefix = if self.weight <= 0.6 {
                        round.prefix.max(joined)
                    } else {
                        round.prefix
                    };
                    best = best.min(self.total(prefix, from[n] + closing));
                }
            }
        }
        best
    }

    /// Which nodes a plan below `cut` can pass.
    fn useful_nodes(&self, solved: &Solved, cut: f64) -> Vec<bool> {
        let through = |n| self.through(solved, n, 0.0, n) < cut;
        (0..self.nodes.len()).map(through).collect()
    }

    /// Halves gates. What is known of a leg holds for the legs between the halves of its gates.
    fn halve(&mut self, gates: &mut Gates, keep: &[bool]) {
        let mut kept = vec![false; gates.gates.len()];
        for (node, keep) in self.nodes.iter().zip(keep) {
            kept[node.gate] |= keep;
        }
        let halves = gates.halve(&kept);
        let mut nodes = Vec::new();
        let mut numbers: Vec<Vec<u32>> = Vec::with_capacity(self.nodes.len());
        for (i, (node, &keep)) in self.nodes.iter().zip(keep).enumerate() {
            let mut mine = Vec::new();
            // The first nodes are the starts, by number.
            if keep || i < self.task.nba.initial.len() {
                for &gate in &halves[node.gate] {
                    mine.push(nodes.len() as u32);
                    nodes.push(Node { gate, ..*node });
                }
            }
            numbers.push(mine);
        }
        let mut legs = Vec::with_capacity(4 * self.legs.len());
        for leg in &self.legs {
            for &from in &numbers[leg.from as usize] {
                for &to in &numbers[leg.to as usize] {
                    let (g, h) = (nodes[from as usize].gate, nodes[to as usize].gate);
                    let length = leg.length.max(gates.straight(g, h));
                    legs.push(Leg { from, to, length });
                }
            }
        }
        (self.nodes, self.legs) = (nodes, legs);
        self.index();
    }
}

/// The least lengths of prefixes that come into a letter with an accepting state in sight, and go on in
/// it to a gate.
struct Entries<'g> {
    gates: &'g Gates,
    letter: usize,
    /// Gates of arrival with the length until there, the shortest first.
    arrivals: Vec<(f64, usize)>,
    known: RefCell<HashMap<usize, f64>>,
}

impl<'g> Entries<'g> {
    fn new(
        gates: &'g Gates,
        product: &Product<'_>,
        solved: &Solved,
        letter: usize,
        nodes: &[usize],
    ) -> Self {
        let all = nodes
            .iter()
            .map(|&n| (solved.from_start[n], product.nodes[n].gate));
        let mut arrivals: Vec<(f64, usize)> = all.filter(|a| a.0.is_finite()).collect();
        arrivals.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self {
            gates,
            letter,
            arrivals,
            known: RefCell::default(),
        }
    }

    fn to(&self, gate: usize) -> f64 {
        *self.known.borrow_mut().entry(gate).or_insert_with(|| {
            let mut least = f64::INFINITY;
            for &(length, from) in &self.arrivals {
                if length >= least {
                    break;
                }
                least = least.min(length + self.gates.known(self.letter, from, gate));
            }
            least
        })
    }
}

/// An entry of a queue: ordered by length, then by number.
#[derive(PartialEq)]
struct Entry(f64, u32);

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

type Segment = (Point2<f64>, Point2<f64>);

/// The distance between two segments, each of which may be a point.
fn segment_distance((a, b): Segment, (c, d): Segment) -> f64 {
    let orient = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q - p).perp(&(r - p));
    let crosses =
        orient(a, b, c) * orient(a, b, d) < 0.0 && orient(c, d, a) * orient(c, d, b) < 0.0;
    if crosses {
        return 0.0;
    }
    let to = |p: Point2<f64>, (a, b): Segment| {
        let (along, off) = (b - a, p - a);
        let square = along.norm_squared();
        let t = if square > 0.0 {
            (off.dot(&along) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (off - along * t).norm()
    };
    to(a, (c, d))
        .min(to(b, (c, d)))
        .min(to(c, (a, b)))
        .min(to(d, (a, b)))
}

/// Whether a polygon's border turns left at every vertex.
fn is_convex(polygon: &Polygon) -> bool {
    let v = polygon.vertices();
    let n = v.len();
    let turn = |i: usize| (v[(i + 1) % n] - v[i]).perp(&(v[(i + 2) % n] - v[(i + 1) % n]));
    (0..n).all(|i| turn(i) > 0.0)
}

/// Whether two polygons are further apart than `margin`.
fn are_apart(p: &Polygon, q: &Polygon, margin: f64) -> bool {
    let gap = |a: &Polygon, b: &Polygon| (b.min().x - a.max().x).max(b.min().y - a.max().y);
    if gap(p, q).max(gap(q, p)) > margin {
        return true;
    }
    let inside = |a: &Polygon, b: &Polygon| b.side_of(a.vertices()[0], margin) != Side::Outside;
    !inside(p, q)
        && !inside(q, p)
        && p.edges()
            .all(|e| q.edges().all(|f| segment_distance(e, f) > margin))
}
