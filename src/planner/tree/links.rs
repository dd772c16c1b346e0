//! Parents, children, and what a new parent saves.

use super::{NONE, Node, NodeId, Tree};

impl Tree<'_> {
    /// Gives `node` a new parent and passes the saving on to everything below it.
    pub(super) fn reparent(&mut self, node: NodeId, parent: NodeId, cost: f64) {
        self.unlink(node);
        if parent.0 == NONE {
            self.nodes[node.index()].parent = NONE;
        } else {
            self.link(node, parent.0);
        }
        let mut stack = std::mem::take(&mut self.stack);
        stack.push((node, cost));
        while let Some((node, cost)) = stack.pop() {
            let saving = self.costs[node.index()] - cost;
            self.costs[node.index()] = cost;
            self.touched.push(node);
            let Node {
                site, first_child, ..
            } = self.nodes[node.index()];
            let rank = &mut self.ranks[site.0 as usize];
            rank.least = rank.least.min(cost);
            let mut child = first_child;
            while child != NONE {
                stack.push((NodeId(child), self.costs[child as usize] - saving));
                child = self.nodes[child as usize].next_sibling;
            }
        }
        self.stack = stack;
    }

    pub(super) fn link(&mut self, node: NodeId, parent: u32) {
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
