//! The syntax tree of an LTL formula.

/// An LTL formula over named propositions, read over infinite words.
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
