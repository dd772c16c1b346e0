//! Other plans near the best one: entered elsewhere, on other sides of obstacles, with visits in another order.
//!
//! The roadmap's borders are sampled, so of two plans that cost nearly the same the one that is cheaper there may be the
//! costlier one once both are refined, and where a suffix is best entered in the middle of a leg the roadmap has no
//! node. What [shortening](crate::shorten) can change beyond a local optimum is tried on the refined plan, with the roadmap's
//! own corners for the ways around obstacles.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::rc::Rc;

use nalgebra::Point2;
use rustc_hash::FxHashMap;

use super::mission::Mission;
use super::search::Labels;
use crate::plan::{Cost, Path};
use crate::queue::Entry;
use crate::shorten::Shortener;

/// The corners that a point sees: their numbers, and how far they are.
type Seen = Rc<Vec<(u32, f64)>>;

/// Shortest ways around obstacles, whatever regions they cross.
struct Walks<'m, 'a> {
    mission: &'m Mission<'a>,
    seen: RefCell<FxHashMap<[u64; 2], Seen>>,
    labels: RefCell<Labels>,
}

impl Mission<'_> {
    /// The plan, or a cheaper one near it.
    pub(super) fn look_around(
        &self,
        shortener: &Shortener<'_>,
        plan: (Path, Cost),
    ) -> (Path, Cost) {
        let walks = Walks {
            mission: self,
            seen: RefCell::default(),
            labels: RefCell::new(Labels::new(self.start_node() as usize)),
        };
        let walk = |from, to| walks.walk(from, to).unwrap_or_default();
        shortener.look_around(plan, &walk, || self.roadmap.halt.is_due())
    }
}

impl Walks<'_, '_> {
    /// The bends of the shortest way and its end; `None` if there is no way.
    fn walk(&self, from: Point2<f64>, to: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        let roadmap = self.mission.roadmap;
        if roadmap.workspace.is_free_segment(from, to) {
            return Some(vec![to]);
        }
        if roadmap.halt.is_due() {
            return None;
        }
        let (first, last) = (self.seen_from(from), self.seen_from(to));
        let last: FxHashMap<u32, f64> = last.iter().copied().collect();
        let mut labels = self.labels.borrow_mut();
        labels.clear();
        let left = |node: u32| (roadmap.nodes[node as usize].at - to).norm();
        let mut queue = BinaryHeap::new();
        for &(node, length) in first.iter() {
            labels.improve(node, length, u32::MAX);
            queue.push(Reverse(Entry(length + left(node), node)));
        }
        let mut end: Option<(f64, u32)> = None;
        while let Some(Reverse(Entry(least, node))) = queue.pop() {
            if end.is_some_and(|e| e.0 <= least) {
                break;
            }
            let cost = labels.cost(node);
            if least > cost + left(node) {
                continue; // an older, longer label
            }
            if let Some(length) = last.get(&node) {
                let whole = cost + length;
                if end.is_none_or(|e| whole < e.0) {
                    end = Some((whole, node));
                }
            }
            for edge in &roadmap.edges[node as usize] {
                let through = cost + edge.length;
                if self.is_corner(edge.to) && labels.improve(edge.to, through, node) {
                    queue.push(Reverse(Entry(through + left(edge.to), edge.to)));
                }
            }
        }
        let nodes = labels.path_to(end?.1);
        let bends = nodes.iter().map(|&n| roadmap.nodes[n as usize].at);
        Some(bends.chain([to]).collect())
    }

    /// The corners that a shortest way from a point may bend at first.
    fn seen_from(&self, p: Point2<f64>) -> Seen {
        let key = [p.x.to_bits(), p.y.to_bits()];
        if let Some(known) = self.seen.borrow().get(&key) {
            return Rc::clone(known);
        }
        let roadmap = self.mission.roadmap;
        let sees = |&i: &u32| {
            let node = &roadmap.nodes[i as usize];
            self.is_corner(i)
                && node.may_bend_towards(p)
                && roadmap.workspace.is_free_segment(p, node.at)
        };
        let length = |i: u32| (i, (roadmap.nodes[i as usize].at - p).norm());
        let all = 0..roadmap.nodes.len() as u32;
        let found: Seen = Rc::new(all.filter(sees).map(length).collect());
        self.seen.borrow_mut().insert(key, Rc::clone(&found));
        found
    }

    /// Whether a node is there for an obstacle, and not only for regions.
    fn is_corner(&self, node: u32) -> bool {
        self.mission.roadmap.nodes[node as usize].origin.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::automaton::{Limits, Task};
    use crate::exact::{ExactConfig, Roadmap};
    use crate::random::generator;
    use crate::workspace::visibility::VisibilityGraph;
    use crate::workspace::{Bounds, Polygon, Region, Workspace};

    fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
        Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1)).unwrap()
    }

    /// Two programs that share nothing find ways of the same length, and agree where there are none.
    #[test]
    fn ways_are_as_short_as_those_of_the_visibility_graph() {
        let walls = [
            rectangle(0.2, 0.1, 0.25, 0.9),
            rectangle(0.25, 0.5, 0.6, 0.55),
            rectangle(0.7, 0.0, 0.72, 0.7),
            // A room without a door.
            rectangle(0.8, 0.75, 0.82, 1.0),
            rectangle(0.8, 0.75, 1.0, 0.77),
        ];
        let region = Region {
            name: "l1".to_owned(),
            polygon: rectangle(0.4, 0.2, 0.5, 0.3),
        };
        let map = Workspace::new(Bounds::unit(), walls.to_vec(), vec![region]).unwrap();
        let letters = Arc::clone(map.alphabet());
        let formula = "F l1".parse().unwrap();
        let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
        let map = Arc::new(map);
        let graph = VisibilityGraph::new(Arc::clone(&map));
        let roadmap = Roadmap::new(&map, ExactConfig::default());
        let start = Point2::new(0.05, 0.05);
        let mission = Mission::new(&roadmap, start, &task, 0.2).unwrap();
        let walks = Walks {
            mission: &mission,
            seen: RefCell::default(),
            labels: RefCell::new(Labels::new(mission.start_node() as usize)),
        };
        let mut random = generator(3, 0);
        let (mut bent, mut none) = (0, 0);
        for _ in 0..300 {
            let [from, to] = [(); 2].map(|()| map.sample_free(&mut random));
            let known = graph.paths_to(to).path(&graph, from);
            let found = walks.walk(from, to);
            assert_eq!(known.is_some(), found.is_some(), "{from} {to}");
            let (Some(known), Some(found)) = (known, found) else {
                none += 1;
                continue;
            };
            let length = |points: &[Point2<f64>]| -> f64 {
                points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
            };
            bent += usize::from(found.len() > 1);
            let whole = [&[from][..], &found].concat();
            let least = length(&known);
            assert!((length(&whole) - least).abs() < 1e-9, "{from} {to}");
        }
        assert!(bent > 100 && none > 5, "{bent} {none}");
    }
}
