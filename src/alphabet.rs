//! Letters: what a robot can see at a point of its map.
//!
//! A *letter* is a set of propositions (region names) that hold together at some point. Only the
//! sets that occur on a map are letters of it: `m + 1` of them when its `m` regions are disjoint.
//! Guards of automata are sets of letters, so every question a planner asks an automaton is a
//! bit test. This module knows neither geometry nor automata.

use std::fmt;

use fixedbitset::FixedBitSet;

/// The largest number of propositions an [`Alphabet`] can hold (the width of [`Props`]).
pub const MAX_PROPOSITIONS: usize = 64;

/// The largest number of propositions [`Alphabet::powerset`] accepts (2¹² letters).
pub const MAX_POWERSET: usize = 12;

/// A set of propositions, as bits: bit `i` stands for proposition number `i` of the [`Alphabet`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Props(pub u64);

impl Props {
    /// The empty set: no region holds.
    pub const EMPTY: Self = Self(0);

    /// The set that holds proposition `index` alone.
    #[must_use]
    pub fn single(index: usize) -> Self {
        Self(1 << index)
    }

    /// Whether proposition `index` is in the set.
    #[must_use]
    pub fn contains(self, index: usize) -> bool {
        self.0 >> index & 1 == 1
    }

    /// The set with proposition `index` added.
    #[must_use]
    pub fn with(self, index: usize) -> Self {
        Self(self.0 | 1 << index)
    }

    /// The indices of the propositions in the set, ascending.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..MAX_PROPOSITIONS).filter(move |&i| self.contains(i))
    }

    /// How many propositions the set holds.
    #[must_use]
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// The number of a letter in its [`Alphabet`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Letter(pub u32);

impl Letter {
    /// The letter's number as an index into arrays.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Why an [`Alphabet`] could not be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AlphabetError {
    /// Two propositions share a name.
    #[error("proposition `{0}` is named twice: give each region a name of its own")]
    DuplicateProposition(String),
    /// More propositions than the representation holds.
    #[error(
        "{found} propositions, at most {limit} are supported here: {}", if *limit == MAX_POWERSET { "name fewer, or say that they are disjoint" } else { "leave some out" }
    )]
    TooManyPropositions {
        /// How many were asked for.
        found: usize,
        /// How many are supported.
        limit: usize,
    },
    /// A letter mentions a proposition that the alphabet does not have, or no letter was given.
    #[error("an alphabet needs at least one letter, over its own propositions only")]
    BadLetters,
}

/// The propositions of a map and the letters that occur on it.
///
/// Letters are numbered in ascending order of their [`Props`] bits, so letter 0 is the empty set
/// wherever that occurs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Alphabet {
    propositions: Vec<String>,
    /// Ascending.
    letters: Vec<Props>,
}

impl Alphabet {
    /// Makes an alphabet from proposition names and the sets that occur together.
    ///
    /// # Errors
    /// Duplicate names, more than [`MAX_PROPOSITIONS`] of them, no letter at all, or a letter
    /// that mentions a proposition beyond the names.
    pub fn new(
        propositions: Vec<String>,
        letters: impl IntoIterator<Item = Props>,
    ) -> Result<Self, AlphabetError> {
        let n = propositions.len();
        if n > MAX_PROPOSITIONS {
            return Err(AlphabetError::TooManyPropositions {
                found: n,
                limit: MAX_PROPOSITIONS,
            });
        }
        for (i, name) in propositions.iter().enumerate() {
            if propositions[..i].contains(name) {
                return Err(AlphabetError::DuplicateProposition(name.clone()));
            }
        }
        let mut letters: Vec<Props> = letters.into_iter().collect();
        letters.sort_unstable();
        letters.dedup();
        let beyond = |l: &Props| n < MAX_PROPOSITIONS && l.0 >> n != 0;
        if letters.is_empty() || letters.iter().any(beyond) {
            return Err(AlphabetError::BadLetters);
        }
        Ok(Self {
            propositions,
            letters,
        })
    }

    /// The alphabet of disjoint regions: nothing, or exactly one proposition.
    ///
    /// # Errors
    /// As [`Alphabet::new`].
    pub fn disjoint(propositions: Vec<String>) -> Result<Self, AlphabetError> {
        let n = propositions.len().min(MAX_PROPOSITIONS);
        let letters = std::iter::once(Props::EMPTY).chain((0..n).map(Props::single));
        Self::new(propositions, letters.collect::<Vec<_>>())
    }

    /// The alphabet in which every combination of propositions occurs.
    ///
    /// # Errors
    /// As [`Alphabet::new`], and more than [`MAX_POWERSET`] propositions.
    pub fn powerset(propositions: Vec<String>) -> Result<Self, AlphabetError> {
        let n = propositions.len();
        if n > MAX_POWERSET {
            return Err(AlphabetError::TooManyPropositions {
                found: n,
                limit: MAX_POWERSET,
            });
        }
        Self::new(propositions, (0..1u64 << n).map(Props))
    }

    /// The proposition names, in order.
    #[must_use]
    pub fn propositions(&self) -> &[String] {
        &self.propositions
    }

    /// The index of the proposition called `name`.
    #[must_use]
    pub fn proposition(&self, name: &str) -> Option<usize> {
        self.propositions.iter().position(|p| p == name)
    }

    /// How many letters there are (at least one).
    #[must_use]
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.letters.len()
    }

    /// All letters, in order.
    pub fn letters(&self) -> impl Iterator<Item = Letter> + use<> {
        (0..self.letters.len() as u32).map(Letter)
    }

    /// The propositions that hold in `letter`.
    #[must_use]
    pub fn props(&self, letter: Letter) -> Props {
        self.letters[letter.index()]
    }

    /// The letter in which exactly `props` hold, if it occurs.
    #[must_use]
    pub fn letter(&self, props: Props) -> Option<Letter> {
        let found = self.letters.binary_search(&props);
        found.ok().map(|i| Letter(i as u32))
    }

    /// The letters in which proposition `index` holds.
    #[must_use]
    pub fn letters_with(&self, index: usize) -> LetterSet {
        self.filter(|p| p.contains(index))
    }

    /// The letters whose propositions pass `keep`.
    #[must_use]
    pub fn filter(&self, mut keep: impl FnMut(Props) -> bool) -> LetterSet {
        let mut set = self.none();
        for (i, &props) in self.letters.iter().enumerate() {
            if keep(props) {
                set.0.insert(i);
            }
        }
        set
    }

    /// The empty set of letters.
    #[must_use]
    pub fn none(&self) -> LetterSet {
        LetterSet(FixedBitSet::with_capacity(self.letters.len()))
    }

    /// The set of all letters.
    #[must_use]
    pub fn all(&self) -> LetterSet {
        let mut set = self.none();
        set.0.insert_range(..);
        set
    }

    /// Shows a letter as `{a,b}`; the empty letter as `{}`.
    #[must_use]
    pub fn show(&self, letter: Letter) -> String {
        let names: Vec<&str> = self
            .props(letter)
            .iter()
            .map(|i| self.propositions[i].as_str())
            .collect();
        format!("{{{}}}", names.join(","))
    }
}

/// A set of letters of one [`Alphabet`]: the guard of an automaton's transition.
///
/// Sets of different alphabets must not be mixed.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LetterSet(FixedBitSet);

impl LetterSet {
    /// Whether `letter` is in the set.
    #[must_use]
    #[inline]
    pub fn contains(&self, letter: Letter) -> bool {
        self.0.contains(letter.index())
    }

    /// Adds a letter.
    pub fn insert(&mut self, letter: Letter) {
        self.0.insert(letter.index());
    }

    /// Whether no letter is in the set: such a guard can never be taken.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_clear()
    }

    /// Whether every letter is in the set: the guard `true`.
    #[must_use]
    pub fn is_all(&self) -> bool {
        self.0.is_full()
    }

    /// How many letters are in the set.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.count_ones(..)
    }

    /// The letters of the set, ascending.
    pub fn iter(&self) -> impl Iterator<Item = Letter> + '_ {
        self.0.ones().map(|i| Letter(i as u32))
    }

    /// Whether every letter of `self` is in `other`.
    #[must_use]
    pub fn is_subset(&self, other: &Self) -> bool {
        self.0.is_subset(&other.0)
    }

    /// Whether the two sets share no letter.
    #[must_use]
    pub fn is_disjoint(&self, other: &Self) -> bool {
        self.0.is_disjoint(&other.0)
    }

    /// Adds every letter of `other`.
    pub fn union_with(&mut self, other: &Self) {
        self.0.union_with(&other.0);
    }

    /// Keeps only letters that are also in `other`.
    pub fn intersect_with(&mut self, other: &Self) {
        self.0.intersect_with(&other.0);
    }

    /// Removes every letter of `other`.
    pub fn subtract(&mut self, other: &Self) {
        self.0.difference_with(&other.0);
    }

    /// The letters that are not in the set.
    #[must_use]
    pub fn complement(&self) -> Self {
        let mut set = self.clone();
        set.0.toggle_range(..);
        set
    }

    /// The letters in both sets.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let mut set = self.clone();
        set.intersect_with(other);
        set
    }

    /// The letters in either set.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut set = self.clone();
        set.union_with(other);
        set
    }
}

impl fmt::Debug for LetterSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.0.ones()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(n: usize) -> Vec<String> {
        (0..n).map(|i| format!("l{i}")).collect()
    }

    #[test]
    fn disjoint_regions_have_one_letter_each_and_the_empty_one() {
        let a = Alphabet::disjoint(names(7)).unwrap();
        assert_eq!(a.len(), 8);
        assert_eq!(a.props(Letter(0)), Props::EMPTY);
        assert_eq!(a.letters_with(3).len(), 1);
        assert_eq!(a.show(a.letter(Props::single(3)).unwrap()), "{l3}");
    }

    #[test]
    fn powerset_holds_every_combination_and_refuses_too_many() {
        let a = Alphabet::powerset(names(3)).unwrap();
        assert_eq!(a.len(), 8);
        assert_eq!(a.letters_with(1).len(), 4);
        assert!(Alphabet::powerset(names(MAX_POWERSET + 1)).is_err());
    }

    #[test]
    fn sets_behave_like_sets() {
        let a = Alphabet::powerset(names(2)).unwrap();
        let x = a.letters_with(0);
        assert!(x.is_subset(&a.all()));
        assert!(x.is_disjoint(&x.complement()));
        assert!(x.union(&x.complement()).is_all());
        assert!(x.intersection(&x.complement()).is_empty());
    }

    #[test]
    fn bad_alphabets_are_refused() {
        let twice = vec!["a".to_owned(), "a".to_owned()];
        assert!(matches!(
            Alphabet::disjoint(twice),
            Err(AlphabetError::DuplicateProposition(_))
        ));
        assert!(Alphabet::new(names(1), [Props(2)]).is_err());
        assert!(Alphabet::new(names(1), []).is_err());
        assert!(Alphabet::disjoint(names(65)).is_err());
    }
}
