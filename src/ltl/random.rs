//! Random formulas: syntax trees for tests, and for data sets of missions.

use rand::{Rng, RngExt};

use super::Formula;

/// What [`formula`] draws from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RandomOptions {
    /// The propositions; must not be empty.
    pub propositions: Vec<String>,
    /// The number of nodes of the tree, propositions included, at least 1.
    pub size: usize,
    /// How often each operator is drawn, relative to the others of its arity.
    pub weights: Weights,
}

/// Relative frequencies of operators; at least one of each arity must be positive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Weights {
    /// `!`
    pub not: u32,
    /// `X`
    pub next: u32,
    /// `F`
    pub finally: u32,
    /// `G`
    pub globally: u32,
    /// `&`
    pub and: u32,
    /// `|`
    pub or: u32,
    /// `->`
    pub implies: u32,
    /// `<->`
    pub iff: u32,
    /// `U`
    pub until: u32,
    /// `R`
    pub release: u32,
    /// `W`
    pub weak_until: u32,
    /// `M`
    pub strong_release: u32,
}

impl Weights {
    /// Operators of robot missions: no X, mostly `&`, `|`, `F`, `G`, `U` and `!`.
    #[must_use]
    pub fn missions() -> Self {
        Self {
            not: 1,
            next: 0,
            finally: 1,
            globally: 1,
            and: 1,
            or: 1,
            implies: 0,
            iff: 0,
            until: 1,
            release: 0,
            weak_until: 0,
            strong_release: 0,
        }
    }

    /// Every operator alike.
    #[must_use]
    pub fn uniform() -> Self {
        Self {
            next: 1,
            implies: 1,
            iff: 1,
            release: 1,
            weak_until: 1,
            strong_release: 1,
            ..Self::missions()
        }
    }
}

type Unary = fn(Formula) -> Formula;
type Binary = fn(Formula, Formula) -> Formula;

/// Draws a formula with exactly `options.size` nodes.
///
/// At every node an operator is drawn by its weight and the remaining size is split uniformly between
/// its operands; leaves are propositions, each with equal probability. Equal generators give equal
/// formulas. Weight 0 for all operators of one arity makes some sizes impossible: the tree is then
/// smaller.
///
/// # Panics
/// If there are no propositions.
///
/// ```
/// use nngtl::ltl::random::{RandomOptions, Weights, formula};
/// use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
/// let options = RandomOptions {
///     propositions: vec!["a".into(), "b".into()],
///     size: 7,
///     weights: Weights::missions(),
/// };
/// let f = formula(&mut ChaCha8Rng::seed_from_u64(1), &options);
/// assert_eq!(f.size(), 7);
/// assert_eq!(f, formula(&mut ChaCha8Rng::seed_from_u64(1), &options));
/// ```
pub fn formula(rng: &mut impl Rng, options: &RandomOptions) -> Formula {
    assert!(
        !options.propositions.is_empty(),
        "a random formula needs propositions to draw from"
    );
    let w = &options.weights;
    let unary: [(Unary, u32); 4] = [
        (Formula::not, w.not),
        (Formula::next, w.next),
        (Formula::finally, w.finally),
        (Formula::globally, w.globally),
    ];
    let binary: [(Binary, u32); 8] = [
        (Formula::and, w.and),
        (Formula::or, w.or),
        (Formula::implies, w.implies),
        (Formula::iff, w.iff),
        (Formula::until, w.until),
        (Formula::release, w.release),
        (Formula::weak_until, w.weak_until),
        (Formula::strong_release, w.strong_release),
    ];
    let tables = Tables {
        propositions: &options.propositions,
        unary: &unary,
        binary: &binary,
    };
    tables.draw(rng, options.size.max(1))
}

struct Tables<'o> {
    propositions: &'o [String],
    unary: &'o [(Unary, u32)],
    binary: &'o [(Binary, u32)],
}

impl Tables<'_> {
    fn draw(&self, rng: &mut impl Rng, size: usize) -> Formula {
        let total = |weights: u32, possible: bool| if possible { weights } else { 0 };
        let unary = total(self.unary.iter().map(|o| o.1).sum(), size >= 2);
        let binary = total(self.binary.iter().map(|o| o.1).sum(), size >= 3);
        if unary + binary == 0 {
            let i = rng.random_range(0..self.propositions.len());
            return Formula::prop(self.propositions[i].as_str());
        }
        let mut ticket = rng.random_range(0..unary + binary);
        if ticket < unary {
            let inner = self.draw(rng, size - 1);
            return pick(self.unary, &mut ticket)(inner);
        }
        ticket -= unary;
        let left = rng.random_range(1..size - 1);
        let a = self.draw(rng, left);
        let b = self.draw(rng, size - 1 - left);
        pick(self.binary, &mut ticket)(a, b)
    }
}

/// The entry on which `ticket` falls when the weights are laid end to end.
fn pick<T: Copy>(table: &[(T, u32)], ticket: &mut u32) -> T {
    for &(operator, weight) in table {
        if *ticket < weight {
            return operator;
        }
        *ticket -= weight;
    }
    unreachable!("the ticket is below the sum of the weights")
}
