//! Guards as short disjunctions of literals.

use std::fmt::Write;

use crate::alphabet::{Alphabet, Letter, LetterSet, Props};

/// A conjunction of literals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cube {
    /// The propositions that must hold.
    pub positive: Props,
    /// The propositions that must not hold.
    pub negative: Props,
}

impl Cube {
    /// Whether a letter in which exactly `props` hold satisfies every literal.
    #[must_use]
    pub fn admits(self, props: Props) -> bool {
        self.positive.0 & !props.0 == 0 && self.negative.0 & props.0 == 0
    }

    /// How many literals there are.
    #[must_use]
    pub fn literals(self) -> usize {
        self.positive.len() + self.negative.len()
    }

    fn without(self, index: usize) -> Self {
        let keep = !Props::single(index).0;
        Self {
            positive: Props(self.positive.0 & keep),
            negative: Props(self.negative.0 & keep),
        }
    }
}

/// A short disjunction of cubes that admits exactly the letters of `guard` among those that occur.
///
/// What a cube says of letters that do not occur is free, so over disjoint regions the guard "in a" is
/// the one literal `a`. No cube can lose a literal, none is covered by the others. No cube at all for
/// the empty guard, one without literals for the full one. Equal input gives equal cubes in equal
/// order.
///
/// Each cube grows from the first letter that is not covered yet, losing at each step the literal
/// that wins most uncovered letters (the EXPAND step of Brayton et al., "Logic Minimization Algorithms
/// for VLSI Synthesis", 1984), ties broken towards losing negative ones.
#[must_use]
pub fn cubes(guard: &LetterSet, alphabet: &Alphabet) -> Vec<Cube> {
    let on: Vec<Props> = guard.iter().map(|l| alphabet.props(l)).collect();
    let off: Vec<Props> = guard
        .complement()
        .iter()
        .map(|l| alphabet.props(l))
        .collect();
    let mut covered = vec![false; on.len()];
    let mut found: Vec<Cube> = Vec::new();
    while let Some(seed) = covered.iter().position(|&c| !c) {
        let open: Vec<Props> = (0..on.len())
            .filter(|&i| !covered[i])
            .map(|i| on[i])
            .collect();
        let cube = grow(on[seed], alphabet.propositions().len(), &open, &off);
        for (i, &props) in on.iter().enumerate() {
            covered[i] |= cube.admits(props);
        }
        found.push(cube);
    }
    // Later cubes may have made earlier ones needless.
    let mut i = 0;
    while i < found.len() {
        let others = |p: Props| (0..found.len()).any(|j| j != i && found[j].admits(p));
        if on.iter().all(|&p| others(p)) {
            found.remove(i);
        } else {
            i += 1;
        }
    }
    found
}

/// The largest cube around `seed` that admits nothing of `off`, found greedily.
fn grow(seed: Props, propositions: usize, open: &[Props], off: &[Props]) -> Cube {
    let all = if propositions == 0 {
        0
    } else {
        u64::MAX >> (64 - propositions)
    };
    let mut cube = Cube {
        positive: seed,
        negative: Props(all & !seed.0),
    };
    // Negative literals first.
    let mut candidates: Vec<usize> = cube.negative.iter().chain(cube.positive.iter()).collect();
    loop {
        // A literal that cannot be lost now cannot be lost later either.
        candidates.retain(|&i| {
            let wider = cube.without(i);
            !off.iter().any(|&p| wider.admits(p))
        });
        let wins = |i: usize| open.iter().filter(|&&p| cube.without(i).admits(p)).count();
        let Some(best) = candidates
            .iter()
            .copied()
            .rev()
            .max_by_key(|&i| (wins(i), cube.negative.contains(i)))
        else {
            return cube;
        };
        cube = cube.without(best);
        candidates.retain(|&i| i != best);
    }
}

/// A guard in Spot's syntax, for example `!a & b | c`; `1` for every letter, `0` for none.
#[must_use]
pub fn guard_text(guard: &LetterSet, alphabet: &Alphabet) -> String {
    join(&cubes(guard, alphabet), " & ", " | ", ["1", "0"], |i| {
        crate::ltl::Formula::prop(alphabet.propositions()[i].as_str()).to_string()
    })
}

/// Writes cubes with the given operators, constants (true, false) and names.
pub(super) fn join(
    cubes: &[Cube],
    and: &str,
    or: &str,
    constants: [&str; 2],
    name: impl Fn(usize) -> String,
) -> String {
    if cubes.is_empty() {
        return constants[1].to_owned();
    }
    let mut text = String::new();
    for (k, cube) in cubes.iter().enumerate() {
        if k > 0 {
            text.push_str(or);
        }
        if cube.literals() == 0 {
            text.push_str(constants[0]);
        }
        let literals = Props(cube.positive.0 | cube.negative.0);
        for (n, i) in literals.iter().enumerate() {
            let between = if n > 0 { and } else { "" };
            let sign = if cube.negative.contains(i) { "!" } else { "" };
            // Writing to a string cannot fail.
            let _ = write!(text, "{between}{sign}{}", name(i));
        }
    }
    text
}

/// The letters that some cube admits.
#[must_use]
pub fn letters_of(cubes: &[Cube], alphabet: &Alphabet) -> LetterSet {
    let mut set = alphabet.none();
    let admitted = |l: &Letter| cubes.iter().any(|c| c.admits(alphabet.props(*l)));
    alphabet
        .letters()
        .filter(admitted)
        .for_each(|l| set.insert(l));
    set
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(n: usize) -> Vec<String> {
        (0..n).map(|i| format!("r{i}")).collect()
    }

    #[test]
    fn disjoint_regions_need_single_literals() {
        let a = Alphabet::disjoint(names(5)).unwrap();
        assert_eq!(guard_text(&a.letters_with(2), &a), "r2");
        assert_eq!(guard_text(&a.letters_with(2).complement(), &a), "!r2");
        let two = a.letters_with(0).union(&a.letters_with(3));
        assert_eq!(guard_text(&two, &a), "r0 | r3");
        assert_eq!(guard_text(&two.complement(), &a), "!r0 & !r3");
        assert_eq!(guard_text(&a.all(), &a), "1");
        assert_eq!(guard_text(&a.none(), &a), "0");
    }

    #[test]
    fn every_guard_over_three_regions_is_kept_exactly() {
        for alphabet in [
            Alphabet::powerset(names(3)).unwrap(),
            Alphabet::disjoint(names(3)).unwrap(),
        ] {
            for bits in 0..1u32 << alphabet.len() {
                let mut guard = alphabet.none();
                let chosen = alphabet.letters().filter(|l| bits >> l.0 & 1 == 1);
                chosen.for_each(|l| guard.insert(l));
                let found = cubes(&guard, &alphabet);
                assert_eq!(letters_of(&found, &alphabet), guard);
                for i in 0..found.len() {
                    let mut fewer = found.clone();
                    fewer.remove(i);
                    assert_ne!(letters_of(&fewer, &alphabet), guard, "cube {i} is needless");
                }
            }
        }
    }
}
