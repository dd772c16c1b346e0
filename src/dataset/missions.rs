//! Random missions: the patterns that robots use, and random syntax trees.

use std::fmt;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::maps::region_name;
use crate::ltl::Formula;
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
            (pattern, simple(pattern, &drawn_names(regions, random), 5, random))
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
        Pattern::Visit => finally(name(0)),
        Pattern::VisitOne => finally(any(props(many(2, 4, random)))),
        Pattern::VisitAll => all(props(many(2, 5, random)).into_iter().map(finally).collect()),
        Pattern::Sequence => sequence(many(2, 5, random)),
        Pattern::OrderedVisit => ordered(many(2, 4, random), false),
        Pattern::StrictOrderedVisit => ordered(many(2, 3, random), true),
        Pattern::Patrol => {
            let visits = props(many(1, 4, random)).into_iter();
            all(visits.map(|p| globally(finally(p))).collect())
        }
        Pattern::OrderedPatrol => {
            let names = many(2, 4, random);
            let order = names.windows(2).map(|w| until(not(prop(&w[1])), prop(&w[0])));
            let mut parts = vec![globally(sequence(names))];
            parts.extend(order);
            all(parts)
        }
        Pattern::AvoidUntil => {
            let first = until(not(name(0)), name(1));
            if random.random() { first } else { and(first, finally(name(0))) }
        }
        Pattern::Avoidance => {
            let names = many(2, 4, random);
            let (goal, avoid) = names.split_first().unwrap_or((&names[0], &[]));
            let avoid = avoid.iter().map(|n| globally(not(prop(n))));
            all(std::iter::once(finally(prop(goal))).chain(avoid).collect())
        }
        Pattern::Response => {
            let response = globally(implies(name(0), finally(name(1))));
            let trigger = if random.random() {
                finally(name(0))
            } else {
                globally(finally(name(0)))
            };
            and(trigger, response)
        }
        Pattern::Stay => {
            let stay = finally(globally(name(1)));
            if random.random() { stay } else { and(finally(name(0)), stay) }
        }
        Pattern::CaseStudy | Pattern::Conjunction | Pattern::Random => all(vec![
            globally(finally(name(0))),
            until(not(name(0)), name(1)),
            finally(name(2)),
        ]),
    }
}

/// `F (a & F (b & …))`
fn sequence(names: &[String]) -> Formula {
    let mut rest: Option<Formula> = None;
    for name in names.iter().rev() {
        let here = match rest {
            Some(rest) => and(prop(name), rest),
            None => prop(name),
        };
        rest = Some(finally(here));
    }
    rest.unwrap_or(Formula::True)
}

/// Each name before the next, the last at some time; strictly: once one is left it is not
/// entered again before the next is reached.
fn ordered(names: &[String], strict: bool) -> Formula {
    let mut parts: Vec<Formula> = names
        .windows(2)
        .map(|w| until(not(prop(&w[1])), prop(&w[0])))
        .collect();
    parts.extend(names.last().map(|last| finally(prop(last))));
    if strict {
        for w in names.windows(2) {
            let (first, next) = (|| prop(&w[0]), || prop(&w[1]));
            let away = until(not(first()), next());
            let visit = and(first(), until(first(), away));
            parts.push(until(not(first()), visit));
        }
    }
    all(parts)
}

fn props(names: &[String]) -> Vec<Formula> {
    names.iter().map(|n| prop(n)).collect()
}

fn prop(name: &str) -> Formula {
    Formula::Prop(name.to_owned())
}

fn not(f: Formula) -> Formula {
    Formula::Not(Box::new(f))
}

fn and(f: Formula, g: Formula) -> Formula {
    Formula::And(Box::new(f), Box::new(g))
}

fn implies(f: Formula, g: Formula) -> Formula {
    Formula::Implies(Box::new(f), Box::new(g))
}

fn until(f: Formula, g: Formula) -> Formula {
    Formula::Until(Box::new(f), Box::new(g))
}

fn finally(f: Formula) -> Formula {
    Formula::Finally(Box::new(f))
}

fn globally(f: Formula) -> Formula {
    Formula::Globally(Box::new(f))
}

fn all(parts: Vec<Formula>) -> Formula {
    let joined = parts.into_iter().reduce(and);
    joined.unwrap_or(Formula::True)
}

fn any(parts: Vec<Formula>) -> Formula {
    let joined = parts
        .into_iter()
        .reduce(|f, g| Formula::Or(Box::new(f), Box::new(g)));
    joined.unwrap_or(Formula::False)
}
