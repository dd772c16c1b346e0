//! Parents, children, and what a new parent saves.

use super::{NONE, Node, NodeId, Tree};

impl Tree<'_> {
    /// Gives `node` a new parent. What that saves is owed to everything below it until
    /// [`Self::pass_on`]. Until then a cost is what it should be or more, and none is below that of
    /// its parent, so that no cycle can arise.
    pub(super) fn reparent(&mut self, node: NodeId, parent: NodeId, cost: f64) {
        self.unlink(node);
        if parent.0 == NONE {
            self.nodes[node.index()].parent = NONE;
        } else {
            self.link(node, parent.0);
        }
        let saving = self.nodes[node.index()].cost - cost;
        self.save(node, saving);
        let n = &mut self.nodes[node.index()];
        n.cost = cost; // not off by rounding
        self.index.rank_mut(n.site).lower(cost);
    }

    /// Passes on what nodes owe to their children, and so on, for as many of them as
    /// [`Self::pass_on_at_most`] allows; the rest waits for the next call. Many savings reach the same nodes: while
    /// one waits it gathers what it is told and passes on all of it in one.
    pub(super) fn pass_on(&mut self) {
        let doublings = 1 + (self.nodes.len() + 1).ilog2() as usize; // a tree may have no nodes yet
        let allowance = self.allowance.saturating_mul(doublings);
        let mut paid = 0;
        while paid < allowance {
            let Some(node) = self.owing.pop_front() else {
                return;
            };
            paid += self.pay(node);
        }
    }

    /// Pays the children of a node what it owes them, and says how many they are.
    fn pay(&mut self, node: NodeId) -> usize {
        let saving = std::mem::take(&mut self.owed[node.index()]);
        let mut paid = 0;
        if saving > 0.0 {
            let mut child = self.nodes[node.index()].first_child;
            while child != NONE {
                self.save(NodeId(child), saving);
                child = self.nodes[child as usize].next_sibling;
                paid += 1;
            }
        }
        paid
    }

    /// Makes a node cheaper, and owes that to its children.
    fn save(&mut self, node: NodeId, saving: f64) {
        let n = &mut self.nodes[node.index()];
        n.cost -= saving;
        if n.first_child != NONE {
            let owed = &mut self.owed[node.index()];
            if *owed == 0.0 {
                self.owing.push_back(node);
            }
            *owed += saving;
        }
        self.index.rank_mut(n.site).lower(n.cost);
        self.touched.push(node);
    }

    pub(super) fn link(&mut self, node: NodeId, parent: u32) {
        if self.owed[parent as usize] > 0.0 {
            self.pay(NodeId(parent)); // the new child knows of it already
        }
        let first = self.nodes[parent as usize].first_child;
        let n = &mut self.nodes[node.index()];
        n.parent = parent;
        n.previous_sibling = NONE;
        n.next_sibling = first;
        if first != NONE {
            self.nodes[first as usize].previous_sibling = node.0;
        }
        self.nodes[parent as usize].first_child = node.0;
    }

    pub(super) fn unlink(&mut self, node: NodeId) {
        let Node {
            parent,
            next_sibling,
            previous_sibling,
            ..
        } = self.nodes[node.index()];
        if parent == NONE {
            return;
        }
        if previous_sibling == NONE {
            self.nodes[parent as usize].first_child = next_sibling;
        } else {
            self.nodes[previous_sibling as usize].next_sibling = next_sibling;
        }
        if next_sibling != NONE {
            self.nodes[next_sibling as usize].previous_sibling = previous_sibling;
        }
    }
}
