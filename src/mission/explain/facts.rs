//! Which facts of the map rule a mission out, whatever way the robot takes.

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::{join, quoted};
use crate::alphabet::{Alphabet, Props};
use crate::automaton::{Limits, translate};
use crate::ltl::Formula;

/// Parts of formulas over more regions than this are not explained in detail: there are automata to make over all sets of the
/// regions.
const MAX_REGIONS: usize = 10;

/// Of parts over more regions than this, facts about one or two regions are looked at, and none about three or more.
const MAX_TOGETHER: usize = 7;

/// So many pairs of conjuncts are looked at, at most.
const PAIRS: usize = 256;

/// The time for all translations that an explanation takes.
const BUDGET: Duration = Duration::from_secs(2);

/// Something that holds everywhere on a map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum LetterFact {
    /// No point of the region is free.
    Hidden {
        /// The region.
        region: String,
    },
    /// No free point lies in both regions.
    Disjoint {
        /// One region.
        region: String,
        /// The other.
        other: String,
    },
    /// No free point lies in all of three or more regions, though one does in any fewer of them.
    Apart {
        /// The regions.
        regions: Vec<String>,
    },
    /// Every free point of the region lies in the other.
    Inside {
        /// The inner region.
        region: String,
        /// The outer one.
        other: String,
    },
    /// Every free point that lies in all of some regions lies in one of the others, though in no smaller number of these, and
    /// of the points in fewer of those some do not.
    Within {
        /// The regions that all hold.
        regions: Vec<String>,
        /// The others, of which one does.
        others: Vec<String>,
    },
    /// Every free point lies in one of the regions that the formula names.
    Covered,
}

impl fmt::Display for LetterFact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hidden { region } => write!(
                f,
                "no point of `{region}` is free (obstacles cover it, it lies outside the bounds, or is too small for the map)"
            ),
            Self::Disjoint { region, other } => {
                write!(f, "`{region}` and `{other}` have no free point in common")
            }
            Self::Apart { regions } => {
                write!(f, "no free point lies in all of {}", join(&quoted(regions)))
            }
            Self::Inside { region, other } => {
                write!(f, "every free point of `{region}` lies in `{other}`")
            }
            Self::Within { regions, others } => {
                let all = if regions.len() > 1 { "all of " } else { "" };
                let regions = join(&quoted(regions));
                let others = quoted(others).join(" or ");
                write!(f, "every free point of {all}{regions} lies in {others}")
            }
            Self::Covered => {
                f.write_str("every free point lies in one of the regions that the task names")
            }
        }
    }
}

/// A formula that some sequence of letters satisfies, but none of this map's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the formula can be satisfied, but not on this map: {}", self.reason())]
pub struct NotOnThisMap {
    /// Facts of the map that together rule the formula out, none of which can be left out. Empty
    /// if facts of these kinds do not suffice.
    pub facts: Vec<LetterFact>,
    /// How many letters occur on the map.
    pub letters: usize,
}

impl NotOnThisMap {
    /// Finds the facts of the map that rule out a formula. Mostly one conjunct asks for what the map does not have, and names few
    /// regions: so conjuncts are looked at alone and in pairs before the formula as a whole.
    #[must_use]
    pub fn new(formula: &Formula, alphabet: &Alphabet) -> Self {
        let parts = parts(formula).chain([formula.clone()]);
        Self::by_first(parts, alphabet).unwrap_or(Self {
            facts: Vec::new(),
            letters: alphabet.len(),
        })
    }

    /// As [`Self::new`], of a formula of which it is not known whether it can be satisfied on the map, as it is too large to
    /// translate: `None` if no conjunct and no two of them are ruled out.
    pub(in crate::mission) fn in_parts(formula: &Formula, alphabet: &Alphabet) -> Option<Self> {
        Self::by_first(parts(formula), alphabet)
    }

    /// By the first part that is ruled out, as far as the time reaches.
    fn by_first(mut parts: impl Iterator<Item = Formula>, alphabet: &Alphabet) -> Option<Self> {
        let began = Instant::now();
        parts.find_map(|part| Self::of_part(&part, alphabet, began))
    }

    /// The facts that rule out a part of the formula.
    fn of_part(formula: &Formula, alphabet: &Alphabet, began: Instant) -> Option<Self> {
        let names = formula.propositions();
        let regions: Vec<usize> = names
            .iter()
            .filter_map(|name| alphabet.proposition(name))
            .collect();
        if regions.len() < names.len() || regions.len() > MAX_REGIONS {
            return None;
        }
        let facts = Fact::all(alphabet, &regions);
        let rules_out = |facts: &[Fact]| {
            let limits = Limits {
                time: Some(BUDGET.saturating_sub(began.elapsed())),
                ..Limits::default()
            };
            rule_out(facts, formula, alphabet, &limits)
        };
        if !rules_out(&facts) {
            return None;
        }
        let facts = needed(&facts, &rules_out);
        if facts.is_empty() {
            return None;
        }
        let name = |i: usize| alphabet.propositions()[i].clone();
        let named = |fact: &Fact| match *fact {
            Fact::Never(i) => LetterFact::Hidden { region: name(i) },
            Fact::NotBoth(i, j) => LetterFact::Disjoint {
                region: name(i),
                other: name(j),
            },
            Fact::NotAll(regions) => LetterFact::Apart {
                regions: regions.iter().map(name).collect(),
            },
            Fact::Implies(i, j) => LetterFact::Inside {
                region: name(i),
                other: name(j),
            },
            Fact::Within { all, any } => LetterFact::Within {
                regions: all.iter().map(name).collect(),
                others: any.iter().map(name).collect(),
            },
            Fact::Some => LetterFact::Covered,
        };
        Some(Self {
            facts: facts.iter().map(named).collect(),
            letters: alphabet.len(),
        })
    }

    fn reason(&self) -> String {
        if self.facts.is_empty() {
            return format!(
                "it needs regions to hold together, or apart, as they never do here ({} sets of regions occur)",
                self.letters
            );
        }
        let facts: Vec<String> = self.facts.iter().map(ToString::to_string).collect();
        join(&facts)
    }
}

/// The conjuncts of a formula, and each two of them; nothing of one that is no conjunction.
fn parts(formula: &Formula) -> impl Iterator<Item = Formula> {
    let mut conjuncts = Vec::new();
    collect_conjuncts(formula, &mut conjuncts);
    if conjuncts.len() < 2 {
        conjuncts.clear();
    }
    let single = conjuncts.clone().into_iter().cloned();
    let pairs = (0..conjuncts.len()).flat_map(move |i| {
        let (first, rest) = (conjuncts[i], conjuncts[i + 1..].to_vec());
        let pair = move |second: &Formula| first.clone().and(second.clone());
        rest.into_iter().map(pair)
    });
    single.chain(pairs.take(PAIRS))
}

/// What has to hold together.
fn collect_conjuncts<'f>(formula: &'f Formula, into: &mut Vec<&'f Formula>) {
    match formula {
        Formula::And(a, b) => {
            collect_conjuncts(a, into);
            collect_conjuncts(b, into);
        }
        other => into.push(other),
    }
}

/// A fact about regions, by their numbers.
#[derive(Clone, Copy, Debug)]
enum Fact {
    Never(usize),
    NotBoth(usize, usize),
    Implies(usize, usize),
    /// Three or more, though any fewer of them occur together.
    NotAll(Props),
    /// Where all of some hold, one of others does: three or more regions, and none can be left out.
    Within {
        all: Props,
        any: Props,
    },
    Some,
}

impl Fact {
    /// What holds of the regions wherever the robot can be: of each, of pairs, and which of them never meet.
    fn all(alphabet: &Alphabet, regions: &[usize]) -> Vec<Self> {
        let letters: Vec<Props> = alphabet.letters().map(|l| alphabet.props(l)).collect();
        let occurs = |test: &dyn Fn(Props) -> bool| letters.iter().any(|&p| test(p));
        let mut facts = Vec::new();
        let (seen, never): (Vec<usize>, Vec<usize>) =
            regions.iter().partition(|&&i| occurs(&|p| p.contains(i)));
        facts.extend(never.into_iter().map(Self::Never));
        for (k, &i) in seen.iter().enumerate() {
            for &j in &seen[k + 1..] {
                if !occurs(&|p| p.contains(i) && p.contains(j)) {
                    facts.push(Self::NotBoth(i, j));
                }
                for (i, j) in [(i, j), (j, i)] {
                    if !occurs(&|p| p.contains(i) && !p.contains(j)) {
                        facts.push(Self::Implies(i, j));
                    }
                }
            }
        }
        // Those of fewer regions first: of facts that serve as well, the first are told.
        if !occurs(&|p| regions.iter().all(|&i| !p.contains(i))) {
            facts.push(Self::Some);
        }
        if seen.len() <= MAX_TOGETHER {
            facts.extend(Self::of_three_or_more(&letters, &seen));
        }
        facts
    }

    /// What holds of three or more regions together, each of which is needed for it. With the facts about one and two regions these say all
    /// that the letters do, but for what is covered by no region.
    fn of_three_or_more(letters: &[Props], seen: &[usize]) -> impl Iterator<Item = Self> {
        let members = |set: u64| {
            let members = Props(set).iter().map(|k| seen[k]);
            members.fold(Props::EMPTY, Props::with)
        };
        let subsets: Vec<Props> = (0..1_u64 << seen.len()).map(members).collect();
        // Whether nowhere all of the first hold and none of the second.
        let holds = |all: Props, any: Props| {
            let breaks = |p: &Props| all.0 & !p.0 == 0 && any.0 & p.0 == 0;
            !letters.iter().any(breaks)
        };
        let without = |set: Props, i: usize| Props(set.0 & !(1 << i));
        let least = |all: Props, any: Props| {
            let fewer_all = all.iter().any(|i| holds(without(all, i), any));
            let fewer_any = any.iter().any(|i| holds(all, without(any, i)));
            holds(all, any) && !fewer_all && !fewer_any
        };
        let mut found = Vec::new();
        for &all in subsets.iter().filter(|all| !all.is_empty()) {
            for &any in subsets.iter().filter(|any| any.0 & all.0 == 0) {
                if all.len() + any.len() > 2 && least(all, any) {
                    found.push(match any.len() {
                        0 => Self::NotAll(all),
                        _ => Self::Within { all, any },
                    });
                }
            }
        }
        found.into_iter()
    }
}

/// Whether no word over letters that obey the facts satisfies the formula. What cannot be
/// translated counts as satisfiable.
fn rule_out(facts: &[Fact], formula: &Formula, alphabet: &Alphabet, limits: &Limits) -> bool {
    let names = formula.propositions();
    let regions: Vec<usize> = names
        .iter()
        .filter_map(|name| alphabet.proposition(name))
        .collect();
    let obeys = |set: u64| {
        let has = |i: usize| {
            let k = regions.iter().position(|&r| r == i);
            k.is_some_and(|k| set >> k & 1 == 1)
        };
        facts.iter().all(|fact| match *fact {
            Fact::Never(i) => !has(i),
            Fact::NotBoth(i, j) => !(has(i) && has(j)),
            Fact::Implies(i, j) => !has(i) || has(j),
            Fact::NotAll(regions) => !regions.iter().all(has),
            Fact::Within { all, any } => !all.iter().all(has) || any.iter().any(has),
            Fact::Some => set != 0,
        })
    };
    let sets = (0..1_u64 << regions.len()).filter(|&s| obeys(s)).map(Props);
    let names = regions
        .iter()
        .map(|&i| alphabet.propositions()[i].clone())
        .collect();
    Alphabet::new(names, sets).is_ok_and(|letters| {
        translate(formula, Arc::new(letters), limits).is_ok_and(|nba| nba.is_empty())
    })
}

/// Of facts that suffice some that do, and none of which can be left out (QuickXplain: U. Junker, "QuickXplain: preferred
/// explanations and relaxations for over-constrained problems", AAAI 2004): few of many are found in few attempts.
fn needed(facts: &[Fact], suffice: &dyn Fn(&[Fact]) -> bool) -> Vec<Fact> {
    /// Of `facts` those that are needed beside `given`; `grown` says whether `given` got more since it was last tried.
    fn beside(
        given: &[Fact],
        grown: bool,
        facts: &[Fact],
        suffice: &dyn Fn(&[Fact]) -> bool,
    ) -> Vec<Fact> {
        if facts.is_empty() || grown && suffice(given) {
            return Vec::new();
        }
        if facts.len() == 1 {
            return facts.to_vec();
        }
        let (first, rest) = facts.split_at(facts.len() / 2);
        let of_rest = beside(&[given, first].concat(), true, rest, suffice);
        let grown = !of_rest.is_empty();
        let of_first = beside(&[given, &of_rest].concat(), grown, first, suffice);
        [of_first, of_rest].concat()
    }
    beside(&[], true, facts, suffice)
}
