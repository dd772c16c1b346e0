//! Random missions: the patterns that robots use, and random syntax trees.

use std::fmt;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::maps::region_name;
use crate::ltl::Formula;
use crate::ltl::random::{RandomOptions, Weights, formula};
use crate::random::{Random, choose};

/// The kind of a mission's formula. Patterns are those of the robotic-mission catalogue of
/// Menghi et al. (2019), written without X.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// `F a`
    Visit,
    /// `F (a | b | …)`
    VisitOne,
    /// `F a & F b & …`
    VisitAll,
    /// `F (a & F (b & …))`
    Sequence,
    /// `(!b U a) & (!c U b) & F c`
    OrderedVisit,
    /// Ordered, and none visited again before the next.
    StrictOrderedVisit,
    /// `G F a & G F b & …`
    Patrol,
    /// `G F (a & F (b & …)) & (!b U a) …`
    OrderedPatrol,
    /// `!a U b`, then more.
    AvoidUntil,
    /// `F b & G !a`
    Avoidance,
    /// `F a & G (a -> F b)`
    Response,
    /// `F a & F G b`
    Stay,
    /// The paper's case study: `G F a & (!a U b) & F c` (`nngtl.md`, V-A).
    CaseStudy,
    /// Two to four of the others together.
    Conjunction,
    /// A random syntax tree (`nngtl.md`, IV-D).
    Random,
    /// One of the formulas that were given.
    Given,
}

impl Pattern {
    /// The patterns that stand alone and in conjunctions.
    const SIMPLE: [Self; 12] = [
        Self::Visit,
        Self::VisitOne,
        Self::VisitAll,
        Self::Sequence,
        Self::OrderedVisit,
        Self::StrictOrderedVisit,
        Self::Patrol,
        Self::OrderedPatrol,
        Self::AvoidUntil,
        Self::Avoidance,
        Self::Response,
        Self::Stay,
    ];

    /// The pattern's name in data sets.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Visit => "visit",
            Self::VisitOne => "visit-one",
            Self::VisitAll => "visit-all",
            Self::Sequence => "sequence",
            Self::OrderedVisit => "ordered-visit",
            Self::StrictOrderedVisit => "strict-ordered-visit",
            Self::Patrol => "patrol",
            Self::OrderedPatrol => "ordered-patrol",
            Self::AvoidUntil => "avoid-until",
            Self::Avoidance => "avoidance",
            Self::Response => "response",
            Self::Stay => "stay",
            Self::CaseStudy => "case-study",
            Self::Conjunction => "conjunction",
            Self::Random => "random",
            Self::Given => "given",
        }
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Draws a formula of robot patterns over a map with `regions` regions (named `l1`, `l2`, …; at
/// least one). Regions of one pattern are different; patterns of a conjunction may share some.
///
/// ```
/// use nngtl::dataset::missions::draw_pattern;
/// use nngtl::random::generator;
/// let (pattern, formula) = draw_pattern(7, &mut generator(3, 0));
/// println!("{pattern}: {formula:?}");
/// ```
#[must_use]
pub fn draw_pattern(regions: usize, random: &mut Random) -> (Pattern, Formula) {
    match random.random_range(0..20) {
        0..12 => {
            let pattern = *choose(random, &Pattern::SIMPLE).unwrap_or(&Pattern::Visit);
            (
                pattern,
                simple(pattern, &drawn_names(regions, random), 5, random),
            )
        }
        12 => (
            Pattern::CaseStudy,
            simple(Pattern::CaseStudy, &drawn_names(regions, random), 3, random),
        ),
        _ => (Pattern::Conjunction, conjunction(regions, random)),
    }
}

fn conjunction(regions: usize, random: &mut Random) -> Formula {
    let parts = random.random_range(2..=4);
    let mut names = drawn_names(regions, random);
    let part = |random: &mut Random, names: &mut Vec<String>| {
        let pattern = *choose(random, &Pattern::SIMPLE).unwrap_or(&Pattern::Visit);
        // The next part mostly speaks of other regions, so that few conjunctions contradict
        // themselves.
        let formula = simple(pattern, names, 2, random);
        let turn = random.random_range(1..=names.len().min(3));
        names.rotate_left(turn);
        formula
    };
    let parts = (0..parts).map(|_| part(random, &mut names)).collect();
    all(parts)
}

/// The largest random syntax tree, in nodes (`nngtl.md`, IV-D).
const TREE_NODES: usize = 25;

/// Draws a random syntax tree of 3 to 25 nodes over F G U ! & | and some of the regions' names
/// (at least one region). The paper leaves the distribution open: here sizes and numbers of names
/// are uniform, operators alike.
#[must_use]
pub fn draw_tree(regions: usize, random: &mut Random) -> Formula {
    let mut names = drawn_names(regions, random);
    names.truncate(random.random_range(1..=names.len().max(1)));
    let options = RandomOptions {
        propositions: names,
        size: random.random_range(3..=TREE_NODES),
        weights: Weights::missions(),
    };
    formula(random, &options)
}

/// All region names in random order.
fn drawn_names(regions: usize, random: &mut Random) -> Vec<String> {
    let mut names: Vec<String> = (0..regions).map(region_name).collect();
    for k in (1..names.len()).rev() {
        names.swap(k, random.random_range(0..=k));
    }
    names
}

/// A pattern over the first of `names`, at most `most` of them (and never more than there are).
fn simple(pattern: Pattern, names: &[String], most: usize, random: &mut Random) -> Formula {
    let most = most.min(names.len());
    let many = |low: usize, high: usize, random: &mut Random| {
        let high = high.min(most).max(1);
        &names[..random.random_range(low.min(high)..=high)]
    };
    let name = |i: usize| prop(&names[i.min(names.len() - 1)]);
    match pattern {
        Pattern::Visit => name(0).finally(),
        Pattern::VisitOne => any(props(many(2, 4, random))).finally(),
        Pattern::VisitAll => all(props(many(2, 5, random))
            .into_iter()
            .map(Formula::finally)
            .collect()),
        Pattern::Sequence => sequence(many(2, 5, random)),
        Pattern::OrderedVisit => ordered(many(2, 4, random), false),
        Pattern::StrictOrderedVisit => ordered(many(2, 3, random), true),
        Pattern::Patrol => {
            let visits = props(many(1, 4, random)).into_iter();
            all(visits.map(|p| p.finally().globally()).collect())
        }
        Pattern::OrderedPatrol => {
            let names = many(2, 4, random);
            let order = names
                .windows(2)
                .map(|w| prop(&w[1]).not().until(prop(&w[0])));
            let mut parts = vec![sequence(names).globally()];
            parts.extend(order);
            all(parts)
        }
        Pattern::AvoidUntil => {
            let first = name(0).not().until(name(1));
            if random.random() {
                first
            } else {
                first.and(name(0).finally())
            }
        }
        Pattern::Avoidance => {
            let names = many(2, 4, random);
            let (goal, avoid) = names.split_first().unwrap_or((&names[0], &[]));
            let avoid = avoid.iter().map(|n| prop(n).not().globally());
            all(std::iter::once(prop(goal).finally()).chain(avoid).collect())
        }
        Pattern::Response => {
            let response = name(0).implies(name(1).finally()).globally();
            let trigger = if random.random() {
                name(0).finally()
            } else {
                name(0).finally().globally()
            };
            trigger.and(response)
        }
        Pattern::Stay => {
            let stay = name(1).globally().finally();
            if random.random() {
                stay
            } else {
                name(0).finally().and(stay)
            }
        }
        Pattern::CaseStudy | Pattern::Conjunction | Pattern::Random | Pattern::Given => all(vec![
            name(0).finally().globally(),
            name(0).not().until(name(1)),
            name(2).finally(),
        ]),
    }
}

/// `F (a & F (b & …))`
fn sequence(names: &[String]) -> Formula {
    let mut rest: Option<Formula> = None;
    for name in names.iter().rev() {
        let here = match rest {
            Some(rest) => prop(name).and(rest),
            None => prop(name),
        };
        rest = Some(here.finally());
    }
    rest.unwrap_or(Formula::True)
}

/// Each name before the next, the last at some time; strictly: once one is left it is not
/// entered again before the next is reached.
fn ordered(names: &[String], strict: bool) -> Formula {
    let mut parts: Vec<Formula> = names
        .windows(2)
        .map(|w| prop(&w[1]).not().until(prop(&w[0])))
        .collect();
    parts.extend(names.last().map(|last| prop(last).finally()));
    if strict {
        for w in names.windows(2) {
            let (first, next) = (|| prop(&w[0]), || prop(&w[1]));
            let away = first().not().until(next());
            let visit = first().and(first().until(away));
            parts.push(first().not().until(visit));
        }
    }
    all(parts)
}

fn props(names: &[String]) -> Vec<Formula> {
    names.iter().map(|n| prop(n)).collect()
}

fn prop(name: &str) -> Formula {
    Formula::prop(name)
}

fn all(parts: Vec<Formula>) -> Formula {
    parts
        .into_iter()
        .reduce(Formula::and)
        .unwrap_or(Formula::True)
}

fn any(parts: Vec<Formula>) -> Formula {
    let joined = parts.into_iter().reduce(Formula::or);
    joined.unwrap_or(Formula::False)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alphabet::{Alphabet, Props};
    use crate::ltl::semantics;
    use crate::random::generator;

    /// Whether a pattern over a, b, c, … (`l1`, `l2`, …) holds on a word written like "-a-b(c)",
    /// with `-` outside regions and the loop in parentheses.
    fn holds(formula: &Formula, word: &str) -> bool {
        let names = (0..7).map(region_name).collect();
        let alphabet = Alphabet::disjoint(names).unwrap();
        let letters = |text: &str| -> Vec<Props> {
            let letter = |c: u8| match c {
                b'-' => Props::EMPTY,
                c => Props::single(usize::from(c - b'a')),
            };
            text.bytes().map(letter).collect()
        };
        let (prefix, cycle) = word.strip_suffix(')').unwrap().split_once('(').unwrap();
        semantics::holds(formula, &letters(prefix), &letters(cycle), &alphabet).unwrap()
    }

    /// Every formula that a pattern draws over a, b, c in this order.
    fn drawn(pattern: Pattern, most: usize) -> Vec<Formula> {
        let names: Vec<String> = (0..most).map(region_name).collect();
        let mut found: Vec<Formula> = (0..40)
            .map(|seed| simple(pattern, &names, most, &mut generator(seed, 0)))
            .collect();
        found.sort();
        found.dedup();
        found
    }

    fn expect(pattern: Pattern, most: usize, yes: &[&str], no: &[&str]) {
        for formula in drawn(pattern, most) {
            for word in yes {
                assert!(holds(&formula, word), "{pattern}: {formula} on {word}");
            }
            for word in no {
                assert!(!holds(&formula, word), "{pattern}: {formula} on {word}");
            }
        }
    }

    #[test]
    fn patterns_mean_what_their_names_say() {
        expect(Pattern::Visit, 1, &["-a(-)"], &["-(b)"]);
        expect(Pattern::VisitOne, 2, &["-a(-)", "-b(-)"], &["-(c)"]);
        expect(Pattern::VisitAll, 2, &["-a-b(-)", "b-a(a)"], &["-a(-)"]);
        expect(Pattern::Sequence, 2, &["a-b(-)", "b-a-b(-)"], &["b-a(-)"]);
        expect(
            Pattern::OrderedVisit,
            2,
            &["a-a-b(-)"],
            &["b-a-b(-)", "a(-)"],
        );
        let strict = ["aaa--bb-a(-)"];
        expect(
            Pattern::StrictOrderedVisit,
            2,
            &strict,
            &["a-a-b(-)", "b-a-b(-)", "a(-)"],
        );
        expect(Pattern::Patrol, 2, &["(a-b)"], &["a-b(-)", "(b)"]);
        expect(
            Pattern::OrderedPatrol,
            2,
            &["(a-b)", "-(a-a-b)"],
            &["b(a-b)", "ab(a)"],
        );
        expect(Pattern::AvoidUntil, 2, &["-b-a(-)"], &["-a-b(-)"]);
        expect(Pattern::Avoidance, 2, &["-a(-)"], &["-a(b)", "(-)"]);
        expect(Pattern::Response, 2, &["(a-b)"], &["b-(a)", "(b)"]);
        expect(Pattern::Stay, 2, &["a-(b)"], &["(a-b)", "ab(-)"]);
        expect(
            Pattern::CaseStudy,
            3,
            &["b-c(a)"],
            &["a-b-c(a)", "b-c-a(-)", "b(a)"],
        );
    }

    #[test]
    fn formulas_print_and_read_back_and_name_regions_of_the_map() {
        for seed in 0..300 {
            let mut random = generator(seed, 1);
            let regions = 1 + seed as usize % 7;
            let tree = draw_tree(regions, &mut random);
            assert!((3..=TREE_NODES).contains(&tree.size()), "{tree}");
            for formula in [draw_pattern(regions, &mut random).1, tree] {
                assert_eq!(formula.to_string().parse::<Formula>().unwrap(), formula);
                assert!(!formula.has_next());
                let names: Vec<String> = (0..regions).map(region_name).collect();
                let known = |name: &&str| names.iter().any(|n| n == name);
                assert!(formula.propositions().iter().all(known), "{formula}");
            }
        }
    }

    #[test]
    fn all_patterns_are_drawn() {
        let mut random = generator(2, 2);
        let mut found: Vec<Pattern> = (0..400).map(|_| draw_pattern(7, &mut random).0).collect();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), Pattern::SIMPLE.len() + 2);
    }
}
