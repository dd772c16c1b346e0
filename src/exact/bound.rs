//! A certified lower bound on the cost of every plan of a mission, wherever its suffix is entered.
//!
//! A plan is here a path in the product: the suffix comes back to its place *and* its automaton state. What
//! [`mission`](crate::mission) makes of a plan, whose loop may begin before its state comes back, can cost less.
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
//! stay instead, and any other one leaves the letter L in which it passes an accepting state f by
//! some gate h and comes back into L by some gate g; on the way between them it spends at least the leg
//! from g to h. On one of these legs the prefix enters, and what leg and prefix cost together at least is
//! said in [`entrances`]. All such cycles are searched with their entries ([`solve`]).
//!
//! # Convex regions
//! Gates that share an end are no distance apart, so a path that crossed one border in and out again and
//! again could creep along it for nothing. Such paths are not needed. Where a convex region that
//! nothing touches is left and entered again before any other, the way back can be taken inside, along
//! the chord, and the letters that the border's crossings gave can be read where the region was first
//! entered (or, if the path begins inside, where it is last left), at no length, in the same
//! order. So a region that is left is entered again through the same gate only, and once it was crossed
//! from one gate to another, not before another region. This holds for the three parts of a plan, each by
//! itself: the prefix, the suffix from its entry to the accepting state, and from there back. So the leg
//! on which a suffix is entered, and the one that passes the accepting state, may do as they like.
//!
//! # Refinement
//! Gates through which no plan cheaper than the one that is known can lead are dropped, those through which
//! the plans lead that hold the bound down are halved, and again (branch and bound). The result is never
//! above the known plan's cost.
//!
//! # Degenerate maps
//! A region that touches another of the task or an obstacle is not avoided, since a path can pass between
//! them, nor are its ways back cut short. On a piece where other regions' borders run, too, the letter may
//! change by any of these. The bound holds then, too, but is weaker.

mod entrances;
mod product;
mod solve;

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Point2;

use product::{Node, Product};

use super::visits::least_cost;
use super::words::Relations;
use super::{Halt, RESOLUTION};
use crate::alphabet::{Letter, Props};
use crate::automaton::Task;
use crate::shorten::used_regions;
use crate::workspace::visibility::{PathsTo, VisibilityGraph};
use crate::workspace::{Polygon, Side, Workspace, segment_distance};

/// Rounds of refinement, and the number of legs in the product beyond which no further one begins.
const ROUNDS: usize = 24;
const MAX_LEGS: usize = 60_000;

/// Gates are halved in a round if a plan may lead through them that costs no more than the bound and
/// this share of what is left between it and the known plan.
const CRITICAL: f64 = 0.2;

/// The share of the known plan's cost that the bound need not resolve.
const PRECISION: f64 = 1e-4;

/// What every plan of the mission, as a path in the product with the automaton, costs at least;
/// `upper` is the cost of a known one (or infinite), and what is returned is at most that. `weight` is the prefix's share λ of the cost.
#[must_use]
pub fn lower_bound(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    upper: f64,
) -> f64 {
    let never = Halt::NEVER;
    let all = least_cost(workspace, start, task, weight, never).unwrap_or(0.0);
    let known = (all, ROUNDS, never);
    bound(workspace, start, task, weight, upper, known).unwrap_or(all)
}

/// As [`lower_bound`], without refinement: found in a few milliseconds, and often far too low.
#[must_use]
pub fn quick_bound(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    upper: f64,
) -> f64 {
    let found = bounds_until(workspace, start, task, weight, upper, Halt::NEVER);
    found.map_or(0.0, |bounds| bounds.product)
}

/// Lower bounds on the cost of plans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// On all plans that satisfy the task: see [`least_cost`].
    pub all: f64,
    /// On those of the product: see [`quick_bound`].
    pub product: f64,
}

/// Both bounds, as quickly as they can be found; `None` if the work was ended before.
#[must_use]
pub fn bounds_until(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    upper: f64,
    halt: Halt<'_>,
) -> Option<Bounds> {
    let all = least_cost(workspace, start, task, weight, halt)?;
    let product = bound(workspace, start, task, weight, upper, (all, 1, halt))?;
    Some(Bounds { all, product })
}

fn bound(
    workspace: &Workspace,
    start: Point2<f64>,
    task: &Task,
    weight: f64,
    upper: f64,
    (all, rounds, halt): (f64, usize, Halt<'_>),
) -> Option<f64> {
    // What costs more than this is as good as the known plan.
    let cut = upper * (1.0 - PRECISION);
    // What holds for all plans holds for those of the product.
    let resolution = RESOLUTION * workspace.bounds().side();
    let mut best: f64 = if all > 0.0 { all + resolution } else { 0.0 };
    if best >= cut {
        return Some(all.min(upper));
    }
    let Some(mut gates) = Gates::new(workspace, start, task) else {
        return Some(all.min(upper));
    };
    if halt.is_due() {
        return None;
    }
    let mut product = Product::new(&gates, task, weight, halt);
    for round in 1..=rounds {
        let useful = product.useful_legs(&product.solve(&gates, cut), cut);
        product.keep_legs(&useful);
        product.lengthen(&mut gates);
        let solved = product.solve(&gates, cut);
        // What was cut short is no bound.
        let found = product.bound(&solved, cut);
        if halt.is_due() {
            return None;
        }
        best = best.max(found);
        log::debug!(
            "bound: {best} after round {round}, {} legs",
            product.legs.len()
        );
        if best >= cut || round == rounds {
            break;
        }
        let legs = product.useful_legs(&solved, cut);
        let nodes = product.useful_nodes(&solved, cut);
        let critical = product.useful_nodes(&solved, best + CRITICAL * (cut - best));
        drop(solved);
        product.keep_legs(&legs);
        if product.legs.len() > MAX_LEGS {
            break;
        }
        product.halve(&mut gates, &nodes, &critical);
    }
    Some((best - resolution).clamp(0.0, upper.max(0.0)))
}

/// A piece of a border; the first gate is the start, a piece of no length.
#[derive(Clone, Copy, Debug)]
struct Gate {
    a: Point2<f64>,
    b: Point2<f64>,
    region: usize,
    /// The regions whose borders run here, its own among them, as bits.
    borders: u64,
    /// The other regions that it lies in.
    inside: u64,
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
    /// The regions of the task, with their numbers.
    regions: Vec<(usize, Polygon)>,
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
        let is_apart = |i: usize| {
            let others = regions.iter().filter(|r| r.0 != i).map(|r| r.1);
            let mine = &workspace.regions()[i].polygon;
            let mut others = others.chain(workspace.obstacles());
            others.all(|other| mine.is_apart_from(other, margin))
        };
        let apart: Vec<bool> = (0..workspace.regions().len())
            .map(|i| used.contains(i) && is_apart(i))
            .collect();
        let avoided = regions.iter().filter(|r| apart[r.0]).copied();
        let avoided: Vec<(usize, &Polygon)> = avoided.collect();
        let spaces = letters
            .iter()
            .map(|(props, _)| space(workspace, &avoided, *props))
            .collect();
        let origin = Gate {
            a: start,
            b: start,
            region: usize::MAX,
            borders: 0,
            inside: 0,
            free: true,
        };
        let mut all = Self {
            gates: vec![origin],
            letters,
            start_letter,
            regions: regions.iter().map(|r| (r.0, r.1.clone())).collect(),
            convex: workspace
                .regions()
                .iter()
                .zip(&apart)
                .map(|(r, apart)| *apart && is_convex(&r.polygon))
                .collect(),
            spaces,
            paths: HashMap::new(),
            legs: HashMap::new(),
            workspace: workspace.clone(),
        };
        for &(region, polygon) in &regions {
            for (a, b) in polygon.edges() {
                let gate = all.gate(a, b, region, workspace.is_free_segment(a, b));
                all.gates.push(gate);
            }
        }
        Some(all)
    }

    /// A piece of a region's border.
    fn gate(&self, a: Point2<f64>, b: Point2<f64>, region: usize, free: bool) -> Gate {
        let margin = 16.0 * self.workspace.tolerance();
        let middle = nalgebra::center(&a, &b);
        let (mut borders, mut inside) = (1 << region, 0);
        for (i, polygon) in self.regions.iter().filter(|r| r.0 != region) {
            let meets = |e| segment_distance((a, b), e) <= margin;
            if polygon.edges().any(meets) {
                borders |= 1 << i;
            } else if polygon.side_of(middle, margin) == Side::Inside {
                inside |= 1 << i;
            }
        }
        Gate {
            a,
            b,
            region,
            borders,
            inside,
            free,
        }
    }

    /// The letters that a path may come from and go on with at a gate.
    fn crossings(&self, gate: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let n = self.letters.len();
        let pairs = (0..n).flat_map(move |from| (0..n).map(move |to| (from, to)));
        pairs.filter(move |&(from, to)| gate != 0 && self.crosses(gate, from, to))
    }

    /// Whether the letter can change like this at a gate: by the regions whose borders run there.
    fn crosses(&self, gate: usize, from: usize, to: usize) -> bool {
        let Gate {
            borders, inside, ..
        } = self.gates[gate];
        let (before, after) = (self.letters[from].0.0, self.letters[to].0.0);
        let change = before ^ after;
        change != 0 && change & !borders == 0 && before & !borders == inside
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

    /// Drops the gates that are not to be kept and halves some of the others. Returns for each the numbers
    /// of its parts.
    fn halve(&mut self, keep: &[bool], split: &[bool]) -> Vec<Vec<usize>> {
        let mut next = vec![self.gates[0]];
        let mut halves = vec![vec![0]];
        for (i, gate) in self.gates.iter().enumerate().skip(1) {
            let middle = gate.middle();
            let mut mine = Vec::new();
            let parts = [(gate.a, middle), (middle, gate.b)];
            let whole = [(gate.a, gate.b)];
            for &(a, b) in if split[i] { &parts[..] } else { &whole } {
                if keep[i] {
                    mine.push(next.len());
                    let free = gate.free || split[i] && self.workspace.is_free_segment(a, b);
                    next.push(match split[i] {
                        true => self.gate(a, b, gate.region, free),
                        false => *gate,
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

/// The space of legs with a letter: the map with those of the given regions that it lacks as obstacles.
fn space(
    workspace: &Workspace,
    regions: &[(usize, &Polygon)],
    props: Props,
) -> Option<VisibilityGraph> {
    let mut obstacles = workspace.obstacles().to_vec();
    let lacking = regions.iter().filter(|(i, _)| !props.contains(*i));
    obstacles.extend(lacking.map(|(_, polygon)| (*polygon).clone()));
    let map = Workspace::new(workspace.bounds(), obstacles, Vec::new()).ok()?;
    Some(VisibilityGraph::new(Arc::new(map)))
}

/// Whether a polygon's border turns left at every vertex.
fn is_convex(polygon: &Polygon) -> bool {
    let v = polygon.vertices();
    let n = v.len();
    let turn = |i: usize| (v[(i + 1) % n] - v[i]).perp(&(v[(i + 2) % n] - v[(i + 1) % n]));
    (0..n).all(|i| turn(i) > 0.0)
}
