//! The tree's invariants, in one place.

use super::*;

impl Tree<'_> {
    /// Checks that costs are sums of moves, moves are possible, automaton steps are allowed, child
    /// lists mirror parents, and there is one node for each place and state.
    pub(crate) fn check(&self, system: &dyn TransitionSystem, nba: &Nba) {
        let mut children = vec![0_usize; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            let mut child = node.first_child;
            while child != NONE {
                assert_eq!(self.nodes[child as usize].parent, i as u32);
                children[i] += 1;
                child = self.nodes[child as usize].next_sibling;
            }
            let rank = self.index.rank(node.site);
            assert!(rank.least <= node.cost && node.cost <= rank.most());
            let here = &self.sites[node.site.0 as usize];
            let nodes = self.at_site(node.site);
            let only = if nodes.len() == 1 { i as u32 } else { NONE };
            assert_eq!(rank.only, only);
            assert!(only == NONE || rank.most() == node.cost);
            assert!(nodes.is_sorted_by_key(|&(q, _)| q));
            let same = nodes.iter().filter(|(q, _)| *q == node.state);
            assert_eq!(same.map(|&(_, n)| n.0).collect::<Vec<_>>(), [i as u32]);
            assert!(self.by_state[node.state.index()].contains(&NodeId(i as u32)));
            let Some(parent) = self.nodes.get(node.parent as usize) else {
                assert_eq!(node.cost, 0.0, "only roots have no parent");
                continue;
            };
            assert!(!self.steps.is_end(here.letter, node.state), "a dead end");
            let from = self.site_spot(parent.site);
            let owed = self.owed[node.parent as usize];
            let length = system.distance(from.at, here.at);
            assert!((parent.cost + owed + length - node.cost).abs() < 1e-9);
            assert!(parent.site == node.site || system.step(&from, &here.spot()));
            let guard = nba
                .guard(parent.state, node.state)
                .expect("an automaton step");
            assert!(guard.contains(from.letter));
        }
        let linked = self.nodes.iter().filter(|n| n.parent != NONE).count();
        assert_eq!(children.iter().sum::<usize>(), linked);
        // No cycles: every node leads to a root.
        for i in 0..self.nodes.len() {
            assert!(self.path(NodeId(i as u32)).len() <= self.nodes.len());
        }
        let mut places: Vec<_> = self
            .sites
            .iter()
            .map(|s| (s.at.x.to_bits(), s.at.y.to_bits()))
            .collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), self.sites.len(), "one site for each place");
    }
}
