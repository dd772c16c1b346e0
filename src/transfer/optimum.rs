//! The optimum of a product of finitely many states, by exhaustive search: what transfer planning and
//! every sampler on a grid can at best reach.
//!
//! One Dijkstra from the start gives the way to every product state. A cycle that passes the accepting state f
//! and is entered at m costs `d(f, m) + d(m, f)`, so one Dijkstra forwards and one backwards from f find the
//! best entry of its cycles. Accepting states are tried by the length of the way to them, as far as
//! they could still beat the best.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use crate::automaton::{StateId, Task, components};
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::Problem;
use crate::queue::Entry;
use crate::system::{Spot, TransitionSystem};

/// A move to another place.
#[derive(Clone, Copy, Debug)]
struct Move {
    to: u32,
    length: f64,
    /// A place on the way that splits the move into two; the move itself is only needed where the
    /// automaton cannot wait there.
    via: Option<u32>,
}

/// The best prefix-suffix path of a problem whose places are finitely many; `None` if there is no
/// path, or if places are infinitely many.
#[must_use]
pub fn optimum(problem: &Problem) -> Option<(Path, Cost)> {
    let product = Product::new(&*problem.system, &problem.task, problem.start)?;
    let initial = &problem.task.nba.initial;
    let roots = initial.iter().map(|&q| (product.node(0, q), 0.0));
    let ahead = |node: u32, visit: &mut dyn FnMut(u32, f64)| product.for_each_step(node, visit);
    let prefixes = product.search(roots, f64::INFINITY, ahead);
    let arrivals = product.arrivals();
    let back = |node: u32, visit: &mut dyn FnMut(u32, f64)| {
        for &(from, length) in &arrivals[node as usize] {
            visit(from, length);
        }
    };
    let mut goals: Vec<(f64, u32)> = product
        .accepting()
        .map(|node| (prefixes.costs[node as usize], node))
        .filter(|(cost, _)| cost.is_finite())
        .collect();
    goals.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (before, after) = (problem.weight, 1.0 - problem.weight);
    if after == 0.0 {
        // Any cycle will do, and nothing would keep the search from trying every one.
        let goal = product.goal_of_the_shortest_prefix(&prefixes, &arrivals, ahead, back)?;
        goals.retain(|&(_, node)| node == goal);
    }
    let mut best: Option<Lasso> = None;
    for (way, goal) in goals {
        let bound = best.as_ref().map_or(f64::INFINITY, |b| b.total);
        // The way to the goal is shared by a prefix and a part of its cycle.
        if before.min(after) * way >= bound {
            break;
        }
        let limit = match after > 0.0 {
            true => bound / after,
            false => f64::INFINITY,
        };
        let out = product.search(std::iter::once((goal, 0.0)), limit, ahead);
        let home = product.search(std::iter::once((goal, 0.0)), limit, back);
        // At the goal itself both are 0 though there is no step: its cycle has a last step.
        let last = |&(from, length): &(u32, f64)| (out.costs[from as usize] + length, from);
        let closing = arrivals[goal as usize].iter().map(last);
        let closing = closing.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for entry in product.nodes() {
            let i = entry as usize;
            let length = match closing {
                _ if entry != goal => out.costs[i] + home.costs[i],
                Some((length, _)) => length,
                None => continue,
            };
            let whole = prefixes.costs[i] + length;
            // A part that weighs nothing must be there all the same, and 0 · ∞ is no cost.
            if !whole.is_finite() {
                continue;
            }
            let total = before * prefixes.costs[i] + after * length;
            // Of equal plans through the goals that are tried the one that is shorter in the part that weighs nothing.
            let better = best
                .as_ref()
                .is_none_or(|b| (total, whole) < (b.total, b.whole));
            if !better {
                continue;
            }
            let cycle = match closing {
                Some((_, from)) if entry == goal => {
                    let mut cycle = out.path(from);
                    cycle.push(goal);
                    cycle
                }
                _ => {
                    // From the entry to the goal, and on to the entry again.
                    let mut cycle = home.path(entry);
                    cycle.reverse();
                    cycle.extend(&out.path(entry)[1..]);
                    cycle
                }
            };
            best = Some(Lasso {
                total,
                whole,
                entry,
                length,
                cycle,
            });
        }
    }
    let Lasso {
        entry,
        length,
        cycle,
        ..
    } = best?;
    let waypoints = |nodes: &[u32]| nodes.iter().map(|&n| product.waypoint(n)).collect();
    let cost = Cost::new(prefixes.costs[entry as usize], length, problem.weight);
    let suffix = if length == 0.0 { vec![entry] } else { cycle };
    Some((
        Path {
            prefix: waypoints(&prefixes.path(entry)),
            suffix: waypoints(&suffix),
        },
        cost,
    ))
}

/// The best path so far: where its suffix begins, and the suffix.
struct Lasso {
    total: f64,
    /// Prefix and suffix, unweighted.
    whole: f64,
    entry: u32,
    length: f64,
    cycle: Vec<u32>,
}

/// The whole product, spelled out.
struct Product<'a> {
    task: &'a Task,
    places: Vec<Spot>,
    moves: Vec<Vec<Move>>,
    states: usize,
}

/// Least costs from some nodes, and how they are reached.
struct Tree {
    costs: Vec<f64>,
    parents: Vec<u32>,
}

impl Tree {
    /// The path to `node`, both ends included.
    fn path(&self, node: u32) -> Vec<u32> {
        let mut path = vec![node];
        let mut at = node;
        while self.parents[at as usize] != u32::MAX {
            at = self.parents[at as usize];
            path.push(at);
        }
        path.reverse();
        path
    }
}

impl<'a> Product<'a> {
    fn new(system: &dyn TransitionSystem, task: &'a Task, start: Spot) -> Option<Self> {
        let key = |s: &Spot| (s.at.x.to_bits(), s.at.y.to_bits());
        let mut places = vec![start];
        let mut number = HashMap::from([(key(&start), 0_u32)]);
        let mut moves = Vec::new();
        let mut near = Vec::new();
        while moves.len() < places.len() {
            let from = places[moves.len()];
            if !system.neighbours(&from, &mut near) {
                return None;
            }
            let mut row: Vec<Move> = Vec::with_capacity(near.len());
            near.sort_by(|a, b| {
                let length = |s: &Spot| system.distance(from.at, s.at);
                length(a).total_cmp(&length(b)).then(key(a).cmp(&key(b)))
            });
            for to in &near {
                let length = system.distance(from.at, to.at);
                let via = row.iter().find(|m| {
                    let middle = &places[m.to as usize];
                    let whole = m.length + system.distance(middle.at, to.at);
                    (whole - length).abs() <= 1e-12 * length && system.step(middle, to)
                });
                let via = via.map(|m| m.to);
                let next = places.len() as u32;
                let to = *number.entry(key(to)).or_insert_with(|| {
                    places.push(*to);
                    next
                });
                row.push(Move { to, length, via });
            }
            moves.push(row);
        }
        Some(Self {
            task,
            places,
            moves,
            states: task.nba.len(),
        })
    }

    fn node(&self, place: usize, state: StateId) -> u32 {
        (place * self.states + state.index()) as u32
    }

    fn state(&self, node: u32) -> StateId {
        StateId((node as usize % self.states) as u32)
    }

    fn waypoint(&self, node: u32) -> Waypoint {
        Waypoint {
            at: self.places[node as usize / self.states].at,
            state: self.state(node),
        }
    }

    fn accepting(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.places.len())
            .flat_map(move |p| self.task.feasible.iter().map(move |&q| self.node(p, q)))
    }

    /// Calls `visit(successor, length)` for each product step that is needed.
    fn for_each_step(&self, node: u32, visit: &mut dyn FnMut(u32, f64)) {
        let place = node as usize / self.states;
        let nba = &self.task.nba;
        let letter = self.places[place].letter;
        for next in nba.successors(self.state(node), letter) {
            visit(self.node(place, next), 0.0);
            let waits = nba.guard(next, next);
            for m in &self.moves[place] {
                let split = m.via.is_some_and(|v| {
                    waits.is_some_and(|g| g.contains(self.places[v as usize].letter))
                });
                if !split {
                    visit(self.node(m.to as usize, next), m.length);
                }
            }
        }
    }

    /// An accepting node whose cycles the shortest of all prefixes enters, and of these the one that makes the shortest cycle there.
    fn goal_of_the_shortest_prefix(
        &self,
        prefixes: &Tree,
        arrivals: &[Vec<(u32, f64)>],
        ahead: impl Fn(u32, &mut dyn FnMut(u32, f64)),
        back: impl Fn(u32, &mut dyn FnMut(u32, f64)),
    ) -> Option<u32> {
        let successors = |node: usize| {
            let mut found = Vec::new();
            ahead(node as u32, &mut |to, _| found.push(to as usize));
            found.into_iter()
        };
        let component = components(self.nodes().len(), successors);
        let is_in_cycle = |node: u32| {
            let here = component[node as usize];
            let mut before = arrivals[node as usize].iter();
            before.any(|&(from, _)| component[from as usize] == here)
        };
        let mut accepts = vec![false; component.len()];
        for goal in self.accepting().filter(|&goal| is_in_cycle(goal)) {
            accepts[component[goal as usize] as usize] = true;
        }
        let cost = |&node: &u32| prefixes.costs[node as usize];
        let enters = |&node: &u32| accepts[component[node as usize] as usize];
        let entry = self
            .nodes()
            .filter(|node| cost(node).is_finite() && enters(node));
        let entry = entry.min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
        let seed = || std::iter::once((entry, 0.0));
        let out = self.search(seed(), f64::INFINITY, &ahead);
        let home = self.search(seed(), f64::INFINITY, back);
        let around = |&goal: &u32| out.costs[goal as usize] + home.costs[goal as usize];
        let goals = self.accepting().filter(|&goal| is_in_cycle(goal));
        goals
            .filter(|goal| around(goal).is_finite())
            .min_by(|a, b| around(a).total_cmp(&around(b)))
    }

    fn nodes(&self) -> std::ops::Range<u32> {
        0..(self.places.len() * self.states) as u32
    }

    /// For each node, the nodes that step to it, with the lengths of the steps.
    fn arrivals(&self) -> Vec<Vec<(u32, f64)>> {
        let mut found = vec![Vec::new(); self.nodes().len()];
        for node in self.nodes() {
            self.for_each_step(node, &mut |to, length| {
                found[to as usize].push((node, length))
            });
        }
        found
    }

    /// Least costs from `seeds` (with what they cost) to everything that costs less than `limit`, along
    /// the given steps.
    fn search(
        &self,
        seeds: impl Iterator<Item = (u32, f64)>,
        limit: f64,
        steps: impl Fn(u32, &mut dyn FnMut(u32, f64)),
    ) -> Tree {
        let size = self.nodes().len();
        let mut tree = Tree {
            costs: vec![f64::INFINITY; size],
            parents: vec![u32::MAX; size],
        };
        let mut open = BinaryHeap::new();
        for (node, cost) in seeds {
            if cost < limit && cost < tree.costs[node as usize] {
                tree.costs[node as usize] = cost;
                open.push(Reverse(Entry(cost, node)));
            }
        }
        while let Some(Reverse(Entry(cost, node))) = open.pop() {
            if cost > tree.costs[node as usize] {
                continue;
            }
            steps(node, &mut |to, length| {
                let new = cost + length;
                if new < limit && new < tree.costs[to as usize] {
                    tree.costs[to as usize] = new;
                    tree.parents[to as usize] = node;
                    open.push(Reverse(Entry(new, to)));
                }
            });
        }
        tree
    }
}
