//! The syntax tree of an LTL formula.

/// An LTL formula over named propositions, read over infinite words.
///
/// Formulas print in Spot's syntax with as few parentheses as the grammar of [`crate::ltl::parse`]
/// needs, and what is printed parses back to the same tree.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Formula {
    /// Holds always.
    True,
    /// Holds never.
    False,
    /// The robot is in the region of this name.
    Prop(String),
    /// `!φ`
    Not(Box<Formula>),
    /// `φ & ψ`
    And(Box<Formula>, Box<Formula>),
    /// `φ | ψ`
    Or(Box<Formula>, Box<Formula>),
    /// `φ -> ψ`
    Implies(Box<Formula>, Box<Formula>),
    /// `φ <-> ψ`
    Iff(Box<Formula>, Box<Formula>),
    /// `X φ`: φ holds from the next letter on.
    Next(Box<Formula>),
    /// `F φ`: φ holds now or later.
    Finally(Box<Formula>),
    /// `G φ`: φ holds now and for ever.
    Globally(Box<Formula>),
    /// `φ U ψ`: ψ holds now or later, and φ until then.
    Until(Box<Formula>, Box<Formula>),
    /// `φ R ψ`: ψ holds up to and including the letter where φ holds, or for ever.
    Release(Box<Formula>, Box<Formula>),
    /// `φ W ψ`: as `φ U ψ`, or φ holds for ever.
    WeakUntil(Box<Formula>, Box<Formula>),
    /// `φ M ψ`: as `φ R ψ`, and φ does hold at some letter.
    StrongRelease(Box<Formula>, Box<Formula>),
}

/// Builders, so that formulas written in Rust stay readable.
///
/// ```
/// use nngtl::ltl::Formula;
/// let mission = Formula::prop("l1").finally().and(Formula::prop("l5").not().globally());
/// assert_eq!(mission.to_string(), "Fl1 & G!l5");
/// ```
impl Formula {
    /// The proposition called `name`.
    #[must_use]
    pub fn prop(name: impl Into<String>) -> Self {
        Self::Prop(name.into())
    }

    /// `!self`
    #[must_use]
    #[allow(clippy::should_implement_trait)] // reads like its siblings, `!` would not
    pub fn not(self) -> Self {
        Self::Not(Box::new(self))
    }

    /// `self & other`
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self::And(Box::new(self), Box::new(other))
    }

    /// `self | other`
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self::Or(Box::new(self), Box::new(other))
    }

    /// `self -> other`
    #[must_use]
    pub fn implies(self, other: Self) -> Self {
        Self::Implies(Box::new(self), Box::new(other))
    }

    /// `self <-> other`
    #[must_use]
    pub fn iff(self, other: Self) -> Self {
        Self::Iff(Box::new(self), Box::new(other))
    }

    /// `X self`
    #[must_use]
    pub fn next(self) -> Self {
        Self::Next(Box::new(self))
    }

    /// `F self`
    #[must_use]
    pub fn finally(self) -> Self {
        Self::Finally(Box::new(self))
    }

    /// `G self`
    #[must_use]
    pub fn globally(self) -> Self {
        Self::Globally(Box::new(self))
    }

    /// `self U other`
    #[must_use]
    pub fn until(self, other: Self) -> Self {
        Self::Until(Box::new(self), Box::new(other))
    }

    /// `self R other`
    #[must_use]
    pub fn release(self, other: Self) -> Self {
        Self::Release(Box::new(self), Box::new(other))
    }

    /// `self W other`
    #[must_use]
    pub fn weak_until(self, other: Self) -> Self {
        Self::WeakUntil(Box::new(self), Box::new(other))
    }

    /// `self M other`
    #[must_use]
    pub fn strong_release(self, other: Self) -> Self {
        Self::StrongRelease(Box::new(self), Box::new(other))
    }

    /// The direct subformulas, left to right.
    pub fn children(&self) -> impl Iterator<Item = &Self> {
        let (first, second) = match self {
            Self::True | Self::False | Self::Prop(_) => (None, None),
            Self::Not(a) | Self::Next(a) | Self::Finally(a) | Self::Globally(a) => (Some(a), None),
            Self::And(a, b)
            | Self::Or(a, b)
            | Self::Implies(a, b)
            | Self::Iff(a, b)
            | Self::Until(a, b)
            | Self::Release(a, b)
            | Self::WeakUntil(a, b)
            | Self::StrongRelease(a, b) => (Some(a), Some(b)),
        };
        first.into_iter().chain(second).map(Box::as_ref)
    }

    /// Every subformula occurrence, a node before its children, left to right. Needs no stack.
    pub fn subformulas(&self) -> impl Iterator<Item = &Self> {
        let mut todo = vec![self];
        std::iter::from_fn(move || {
            let node = todo.pop()?;
            let at = todo.len();
            todo.extend(node.children());
            todo[at..].reverse();
            Some(node)
        })
    }

    /// The number of nodes of the tree.
    #[must_use]
    pub fn size(&self) -> usize {
        self.subformulas().count()
    }

    /// The number of nodes on the longest way from the root to a leaf; 1 for a leaf.
    #[must_use]
    pub fn depth(&self) -> usize {
        let mut deepest = 0;
        let mut todo = vec![(self, 1)];
        while let Some((node, depth)) = todo.pop() {
            deepest = deepest.max(depth);
            todo.extend(node.children().map(|c| (c, depth + 1)));
        }
        deepest
    }

    /// The names of the propositions, in order of first use.
    #[must_use]
    pub fn propositions(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for node in self.subformulas() {
            if let Self::Prop(name) = node
                && !names.contains(&name.as_str())
            {
                names.push(name);
            }
        }
        names
    }

    /// The formula with other names for its propositions.
    ///
    /// # Errors
    /// The first that `name` has none for.
    pub fn rename<E>(&self, name: &impl Fn(&str) -> Result<String, E>) -> Result<Self, E> {
        let one = |a: &Self| a.rename(name).map(Box::new);
        let two = |a: &Self, b: &Self| Ok((one(a)?, one(b)?));
        let join = |make: fn(Box<Self>, Box<Self>) -> Self, a: &Self, b: &Self| {
            two(a, b).map(|(a, b)| make(a, b))
        };
        Ok(match self {
            Self::True => Self::True,
            Self::False => Self::False,
            Self::Prop(old) => Self::Prop(name(old)?),
            Self::Not(a) => Self::Not(one(a)?),
            Self::Next(a) => Self::Next(one(a)?),
            Self::Finally(a) => Self::Finally(one(a)?),
            Self::Globally(a) => Self::Globally(one(a)?),
            Self::And(a, b) => join(Self::And, a, b)?,
            Self::Or(a, b) => join(Self::Or, a, b)?,
            Self::Implies(a, b) => join(Self::Implies, a, b)?,
            Self::Iff(a, b) => join(Self::Iff, a, b)?,
            Self::Until(a, b) => join(Self::Until, a, b)?,
            Self::Release(a, b) => join(Self::Release, a, b)?,
            Self::WeakUntil(a, b) => join(Self::WeakUntil, a, b)?,
            Self::StrongRelease(a, b) => join(Self::StrongRelease, a, b)?,
        })
    }

    /// Whether `X` occurs. Formulas without it cannot tell words apart that differ by stuttering.
    #[must_use]
    pub fn has_next(&self) -> bool {
        self.subformulas().any(|f| matches!(f, Self::Next(_)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walks_in_reading_order() {
        let f = Formula::prop("b").until(Formula::prop("a").and(Formula::prop("b")));
        assert_eq!(f.propositions(), ["b", "a"]);
        assert_eq!((f.size(), f.depth()), (5, 3));
        assert!(!f.has_next());
        assert!(f.next().globally().has_next());
    }
}
