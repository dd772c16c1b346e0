//! Goal states of Algorithm 4: accepting states above a node (`acc`), and the cycles that a node closes
//! onto its own path (`transfer-planning.md`, IV-B.1 and IV-B.2).
//!
//! The paper keeps for each node the set of accepting states on its path, and updates it from the
//! parent alone, which goes stale when a node further up is rewired and then loses goals. Here
//! a node has a link to the nearest accepting node on its path, itself included; following the
//! links gives the whole set. The tree reports every node whose path changed, parents before children,
//! so one pass over that report keeps all links right at constant cost for each changed node.

use crate::alphabet::Letter;
use crate::automaton::Task;
use crate::planner::{NodeId, Tree};
use crate::system::TransitionSystem;

/// No accepting node on the path.
const NONE: u32 = u32::MAX;

/// The accepting nodes on the paths of a tree, and what closes cycles there.
#[derive(Debug, Default)]
pub(crate) struct Goals {
    /// For each node, the nearest accepting node on its path from the root, itself included.
    acc: Vec<u32>,
    /// Accepting nodes, in the order they were found.
    accepting: Vec<NodeId>,
    known: Vec<bool>,
}

/// A triplet (q_P, q_P^mid, q_P^F) without its last part, which the cycle determines: `last` can move
/// to its ancestor `mid`, and an accepting node lies between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closure {
    pub(crate) last: NodeId,
    pub(crate) mid: NodeId,
    pub(crate) length: f64,
}

impl Goals {
    /// Takes note of nodes whose paths changed, in the order the tree reports them.
    pub(crate) fn update(&mut self, task: &Task, tree: &Tree<'_>, touched: &[NodeId]) {
        self.acc.resize(tree.len(), NONE);
        self.known.resize(tree.len(), false);
        for &node in touched {
            let accepts = task.feasible.binary_search(&tree.state(node)).is_ok();
            if accepts && !std::mem::replace(&mut self.known[node.index()], true) {
                self.accepting.push(node);
            }
            let above = tree.parent(node).map_or(NONE, |p| self.acc[p.index()]);
            self.acc[node.index()] = if accepts { node.0 } else { above };
        }
    }

    /// All accepting nodes of the tree.
    pub(crate) fn accepting(&self) -> &[NodeId] {
        &self.accepting
    }

    /// FindGoal: the shortest cycle below `limit` that `node` closes by one move onto an ancestor, with
    /// an accepting node on it. Cycles of no length are left to [`crate::planner`]'s table of
    /// letters on which staying accepts.
    pub(crate) fn close(
        &self,
        system: &dyn TransitionSystem,
        task: &Task,
        tree: &Tree<'_>,
        node: NodeId,
        limit: f64,
    ) -> Option<Closure> {
        let acc = self.acc[node.index()];
        let spot = tree.spot(node);
        let cost = tree.cost(node);
        let mut next = (acc != NONE).then_some(NodeId(acc));
        let mut best: Option<Closure> = None;
        while let Some(mid) = next {
            let along = cost - tree.cost(mid);
            // Further up cycles only get longer.
            if along >= best.map_or(limit, |b| b.length) {
                break;
            }
            next = tree.parent(mid);
            let there = tree.spot(mid);
            let length = along + system.distance(spot.at, there.at);
            if length <= 0.0 || length >= best.map_or(limit, |b| b.length) {
                continue;
            }
            if steps(task, tree, node, spot.letter, mid) && system.step(&spot, &there) {
                best = Some(Closure {
                    last: node,
                    mid,
                    length,
                });
            }
        }
        best
    }
}

/// Whether the automaton can step from one node's state to the other's on a letter.
fn steps(task: &Task, tree: &Tree<'_>, from: NodeId, letter: Letter, to: NodeId) -> bool {
    let guard = task.nba.guard(tree.state(from), tree.state(to));
    guard.is_some_and(|g| g.contains(letter))
}

#[cfg(test)]
impl Goals {
    /// The nearest accepting node on a node's path.
    fn acc_of(&self, node: NodeId) -> Option<NodeId> {
        let acc = self.acc[node.index()];
        (acc != NONE).then_some(NodeId(acc))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point2;

    use super::*;
    use crate::automaton::{Limits, Task};
    use crate::ltl::Formula;
    use crate::planner::Near;
    use crate::random::generator;
    use crate::system::Grid;
    use crate::transfer::build::one_move_away;
    use crate::workspace::{Bounds, Polygon, Region, Workspace};

    fn grid() -> Grid {
        let cell = |x: f64, y: f64| {
            Polygon::rectangle(Point2::new(x, y), Point2::new(x + 0.1, y + 0.1)).unwrap()
        };
        let region = |name: &str, polygon| Region {
            name: name.to_owned(),
            polygon,
        };
        let map = Workspace::new(
            Bounds::unit(),
            vec![cell(0.4, 0.4), cell(0.5, 0.5), cell(0.2, 0.7)],
            vec![region("a", cell(0.8, 0.1)), region("b", cell(0.1, 0.8))],
        );
        let start = Point2::new(0.05, 0.05);
        Grid::new(Arc::new(map.unwrap()), [10, 10], 0.1, start).unwrap()
    }

    /// The links agree with a walk to the root for every node, after every growth and however often
    /// paths changed above it; the paper's simplification fails this.
    #[test]
    fn links_are_right_after_any_rewiring() {
        let grid = grid();
        let formula: Formula = "GF a & GF b & G(a -> X(!a U b))".parse().unwrap();
        let letters = Arc::clone(grid.alphabet());
        let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
        for seed in 0..4 {
            let mut random = generator(seed, 0);
            let mut tree = Tree::new(&grid, &task.nba, grid.start(), &task.nba.initial);
            let (mut goals, mut touched) = (Goals::default(), Vec::new());
            let mut with_goals = 0;
            for _ in 0..400 {
                if let Some(spot) = one_move_away(&grid, &tree, &mut random) {
                    tree.extend(spot, Near::ball(1.0), &[]);
                }
                tree.take_touched(&mut touched);
                goals.update(&task, &tree, &touched);
                for node in task.nba.states().flat_map(|q| tree.in_state(q).to_vec()) {
                    let accepts = |n: &NodeId| task.nba.is_accepting(tree.state(*n));
                    let above = std::iter::successors(Some(node), |&n| tree.parent(n));
                    let expected = above.clone().find(accepts);
                    assert_eq!(goals.acc_of(node), expected);
                    with_goals += usize::from(expected.is_some());
                }
            }
            tree.check(&grid, &task.nba);
            assert!(with_goals > 1_000, "{with_goals}");
        }
    }

    /// Every closure is a cycle of the product that accepts, of the length that is stated.
    #[test]
    fn closures_are_accepting_cycles() {
        let grid = grid();
        let formula: Formula = "F b & GF a".parse().unwrap();
        let letters = Arc::clone(grid.alphabet());
        let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
        let mut random = generator(9, 0);
        let mut tree = Tree::new(&grid, &task.nba, grid.start(), &task.nba.initial);
        let (mut goals, mut touched) = (Goals::default(), Vec::new());
        for _ in 0..400 {
            if let Some(spot) = one_move_away(&grid, &tree, &mut random) {
                tree.extend(spot, Near::ball(1.0), &[]);
            }
        }
        tree.take_touched(&mut touched);
        goals.update(&task, &tree, &touched);
        let mut found = 0;
        for node in task.nba.states().flat_map(|q| tree.in_state(q).to_vec()) {
            let Some(c) = goals.close(&grid, &task, &tree, node, f64::INFINITY) else {
                continue;
            };
            found += 1;
            let mut cycle = vec![c.mid];
            cycle.extend(
                std::iter::successors(Some(c.last), |&n| tree.parent(n))
                    .take_while(|&n| n != c.mid),
            );
            assert!(cycle.iter().any(|&n| task.nba.is_accepting(tree.state(n))));
            let (last, mid) = (tree.spot(c.last), tree.spot(c.mid));
            assert!(grid.step(&last, &mid));
            let length = tree.cost(c.last) - tree.cost(c.mid) + grid.distance(last.at, mid.at);
            assert!((length - c.length).abs() < 1e-12);
        }
        assert!(found > 0);
    }
}
