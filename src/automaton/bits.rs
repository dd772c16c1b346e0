//! Sets of letter classes: guards while an automaton is being built.
//!
//! Most maps have at most 64 letters, so the usual set is one machine word without an allocation.

/// A set of small numbers below a bound that all sets of one translation share.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub(super) enum Bits {
    One(u64),
    Many(Box<[u64]>),
}

impl Bits {
    /// The empty set of numbers below `bound`.
    pub(super) fn none(bound: usize) -> Self {
        if bound <= 64 {
            Self::One(0)
        } else {
            Self::Many(vec![0; bound.div_ceil(64)].into())
        }
    }

    /// The set of all numbers below `bound`.
    pub(super) fn all(bound: usize) -> Self {
        let mut set = Self::none(bound);
        for (i, word) in set.words_mut().iter_mut().enumerate() {
            let here = (bound - 64 * i).min(64);
            *word = u64::MAX >> (64 - here);
        }
        set
    }

    pub(super) fn words(&self) -> &[u64] {
        match self {
            Self::One(word) => std::slice::from_ref(word),
            Self::Many(words) => words,
        }
    }

    fn words_mut(&mut self) -> &mut [u64] {
        match self {
            Self::One(word) => std::slice::from_mut(word),
            Self::Many(words) => words,
        }
    }

    pub(super) fn insert(&mut self, i: usize) {
        self.words_mut()[i / 64] |= 1 << (i % 64);
    }

    pub(super) fn remove(&mut self, i: usize) {
        self.words_mut()[i / 64] &= !(1 << (i % 64));
    }

    pub(super) fn contains(&self, i: usize) -> bool {
        self.words()[i / 64] >> (i % 64) & 1 == 1
    }

    pub(super) fn is_empty(&self) -> bool {
        self.words().iter().all(|&w| w == 0)
    }

    pub(super) fn len(&self) -> usize {
        self.words().iter().map(|w| w.count_ones() as usize).sum()
    }

    pub(super) fn is_subset(&self, other: &Self) -> bool {
        let mut pairs = self.words().iter().zip(other.words());
        pairs.all(|(a, b)| a & !b == 0)
    }

    pub(super) fn is_disjoint(&self, other: &Self) -> bool {
        let mut pairs = self.words().iter().zip(other.words());
        pairs.all(|(a, b)| a & b == 0)
    }

    fn zip(&self, other: &Self, f: impl Fn(u64, u64) -> u64) -> Self {
        match (self, other) {
            (Self::One(a), Self::One(b)) => Self::One(f(*a, *b)),
            _ => {
                let pairs = self.words().iter().zip(other.words());
                Self::Many(pairs.map(|(&a, &b)| f(a, b)).collect())
            }
        }
    }

    pub(super) fn and(&self, other: &Self) -> Self {
        self.zip(other, |a, b| a & b)
    }

    pub(super) fn or(&self, other: &Self) -> Self {
        self.zip(other, |a, b| a | b)
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        self.zip(other, |a, b| a & !b)
    }

    pub(super) fn or_with(&mut self, other: &Self) {
        for (a, b) in self.words_mut().iter_mut().zip(other.words()) {
            *a |= b;
        }
    }

    pub(super) fn minus_with(&mut self, other: &Self) {
        for (a, b) in self.words_mut().iter_mut().zip(other.words()) {
            *a &= !b;
        }
    }

    /// The members, ascending.
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.words().iter().enumerate().flat_map(|(i, &word)| {
            let mut left = word;
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros();
                left &= left.wrapping_sub(1);
                (bit < 64).then(|| 64 * i + bit as usize)
            })
        })
    }

    pub(super) fn first(&self) -> Option<usize> {
        self.iter().next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_at_the_edges_of_words() {
        for bound in [1, 63, 64, 65, 128, 130] {
            let all = Bits::all(bound);
            assert_eq!(all.len(), bound);
            assert_eq!(
                all.iter().collect::<Vec<_>>(),
                (0..bound).collect::<Vec<_>>()
            );
            let mut last = Bits::none(bound);
            assert!(last.is_empty() && last.first().is_none());
            last.insert(bound - 1);
            assert!(last.is_subset(&all) && last.contains(bound - 1));
            assert_eq!(all.minus(&last).len(), bound - 1);
            assert!(all.minus(&last).is_disjoint(&last));
            assert_eq!(all.minus(&last).or(&last), all);
        }
    }
}
