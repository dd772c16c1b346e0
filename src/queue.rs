//! Entries of the priority queues that searches use.

use std::cmp::Ordering;

/// An item with its priority, ordered by priority, then by the item, so that ties do not depend on anything else.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry<T>(pub(crate) f64, pub(crate) T);

impl<T: Ord> Ord for Entry<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0
            .total_cmp(&other.0)
            .then_with(|| self.1.cmp(&other.1))
    }
}

impl<T: Ord> PartialOrd for Entry<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T: Ord> PartialEq for Entry<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<T: Ord> Eq for Entry<T> {}
