//! The optimum of a product of finitely many states, by exhaustive search: what transfer planning and
//! every sampler on a grid can at best reach.
//!
//! One Dijkstra from the start gives all prefixes; for each accepting product state, cheapest prefix
//! first, another gives its shortest cycle, as far as that could still beat the best.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use crate::automaton::{StateId, Task};
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::Problem;
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

/// An entry of Dijkstra's queue, ordered by cost, then by number.
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

/// The best prefix-suffix path of a problem whose places are finitely many; `None` if there is no
/// path, or if places are infinitely many.
#[must_use]
pub fn optimum(problem: &Problem) -> Option<(Path, Cost)> {
    let product = Product::new(&*problem.system, &problem.task, problem.start)?;
    let initial = &problem.task.nba.initial;
    let roots = initial.iter().map(|&q| (product.node(0, q), 0.0));
    let forward = product.search(roots, f64::INFINITY, None);
    let mut goals: Vec<(f64, u32)> = product
        .accepting()
        .map(|node| (forward.costs[node as usize], node))
        .filter(|(cost, _)| cost.is_finite())
        .collect();
    goals.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (before, after) = (problem.weight, 1.0 - problem.weight);
    let mut best: Option<(f64, u32, f64, Vec<u32>)> = None;
    for (prefix, goal) in goals {
        let bound = best.as_ref().map_or(f64::INFINITY, |b| b.0);
        if before * prefix >= bound {
            break;
        }
        let room = if after > 0.0 {
            (bound - before * prefix) / after
        } else {
            f64::INFINITY
        };
        let Some((length, cycle)) = product.cycle(goal, room) else {
            continue;
        };
        let total = before * prefix + after * length;
        if total < bound {
            best = Some((total, goal, length, cycle));
        }
    }
    let (_, goal, length, cycle) = best?;
    let waypoints = |nodes: &[u32]| nodes.iter().map(|&n| product.waypoint(n)).collect();
    let prefix = forward.path(goal);
    let cost = Cost::new(forward.costs[goal as usize], length, problem.weight);
    let suffix = if length == 0.0 { vec![goal] } else { cycle };
    Some((
        Path {
            prefix: waypoints(&prefix),
            suffix: waypoints(&suffix),
        },
        cost,
    ))
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
    fn for_each_step(&self, node: u32, mut visit: impl FnMut(u32, f64)) {
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

    /// Least costs from `seeds` (with what they cost) to everything that costs less than `limit`, until
    /// `goal` is reached.
    fn search(
        &self,
        seeds: impl Iterator<Item = (u32, f64)>,
        limit: f64,
        goal: Option<u32>,
    ) -> Tree {
        let size = self.places.len() * self.states;
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
            if goal == Some(node) {
                break;
            }
            if cost > tree.costs[node as usize] {
                continue;
            }
            self.for_each_step(node, |to, length| {
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

    /// The shortest cycle through `goal` of a length below `limit`, from the goal to the goal.
    fn cycle(&self, goal: u32, limit: f64) -> Option<(f64, Vec<u32>)> {
        let mut firsts = Vec::new();
        self.for_each_step(goal, |to, length| firsts.push((to, length)));
        let tree = self.search(firsts.into_iter(), limit, Some(goal));
        let length = tree.costs[goal as usize];
        length.is_finite().then(|| {
            let mut path = vec![goal];
            path.extend(tree.path(goal));
            (length, path)
        })
    }
}
