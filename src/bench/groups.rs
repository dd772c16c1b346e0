//! Which missions are looked at together: all, the paper's simple and complex ones, families of maps.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::stats::Summary;
use super::{Strategy, Trial};

/// Missions for which uniform sampling needs this many iterations to the first prefix (in the median of its
/// runs) are complex. The paper divides by its seconds (`nngtl.md`, V-B); this is about where its classes part.
pub const COMPLEX_FROM: u64 = 4_000;

/// Some missions of a comparison.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Group {
    /// `all`, `simple`, `complex`, or the name of a family.
    pub name: String,
    /// The missions' names.
    pub cases: BTreeSet<String>,
}

/// How many missions are simple and how many complex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Classes {
    /// From how many iterations of uniform sampling on a mission is complex.
    pub complex_from: u64,
    /// Missions below.
    pub simple: usize,
    /// The others.
    pub complex: usize,
}

impl Classes {
    /// One line for people to read.
    #[must_use]
    pub fn line(&self) -> String {
        let rule = format!(
            "iterations of uniform sampling to the first prefix (median of its runs): fewer than {} for simple missions, \
             as many or more for complex ones",
            self.complex_from
        );
        let empty = match (self.simple, self.complex) {
            (_, 0) => " No mission is complex, so the classes are not told apart.",
            (0, _) => " No mission is simple, so the classes are not told apart.",
            _ => "",
        };
        let (simple, complex) = (self.simple, self.complex);
        format!("Classes by {rule}: {simple} simple, {complex} complex.{empty}")
    }
}

/// The classes of the missions that uniform sampling was run on; `None` if it was not run.
pub(super) fn classes(trials: &[Trial], complex_from: u64) -> Option<(Classes, [Group; 2])> {
    let mut uniform: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let runs = trials
        .iter()
        .filter(|t| t.contender.strategy == Strategy::Uniform);
    for t in runs {
        let needed = t.iterations_until(t.prefix);
        uniform.entry(t.case.as_str()).or_default().push(needed);
    }
    if uniform.is_empty() {
        return None;
    }
    let group = |name: &str| Group {
        name: name.to_owned(),
        cases: BTreeSet::new(),
    };
    let mut groups = [group("simple"), group("complex")];
    for (case, needed) in &uniform {
        let median = Summary::of(needed).map_or(0.0, |s| s.median);
        let class = usize::from(median >= complex_from as f64);
        groups[class].cases.insert((*case).to_owned());
    }
    let [simple, complex] = [&groups[0], &groups[1]].map(|g| g.cases.len());
    let classes = Classes {
        complex_from,
        simple,
        complex,
    };
    Some((classes, groups))
}

/// All missions, the classes if both hold some, and the families if there are several.
pub(super) fn groups<'a>(
    missions: impl Iterator<Item = (&'a str, Option<&'a str>)>,
    classes: Option<&[Group; 2]>,
) -> Vec<Group> {
    let mut all = Group {
        name: "all".to_owned(),
        cases: BTreeSet::new(),
    };
    let mut families: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (case, family) in missions {
        all.cases.insert(case.to_owned());
        if let Some(family) = family {
            families.entry(family).or_default().insert(case.to_owned());
        }
    }
    let mut found = vec![all];
    if let Some(classes) = classes.filter(|c| c.iter().all(|g| !g.cases.is_empty())) {
        found.extend(classes.iter().cloned());
    }
    if families.len() > 1 {
        found.extend(families.into_iter().map(|(name, cases)| Group {
            name: name.to_owned(),
            cases,
        }));
    }
    found
}
