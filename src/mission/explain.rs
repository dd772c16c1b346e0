//! Why a mission has no plan: which facts of the map stand in the way.

mod crossing;

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::alphabet::{Alphabet, Letter, LetterSet, Props};
use crate::automaton::{Limits, Task, translate};
use crate::ltl::Formula;
use crate::number::Brief;
use crate::scenario::Scenario;
use crate::system::{Continuous, TransitionSystem};
use crate::workspace::{Enclosure, Workspace};

use crossing::Crossing;

/// Parts of formulas over more regions than this are not explained in detail: there are automata to make over all sets of the
/// regions.
const MAX_REGIONS: usize = 10;

/// Of parts over more regions than this, facts about one or two regions are looked at, and none about three or more.
const MAX_TOGETHER: usize = 7;

/// So many pairs of conjuncts are looked at, at most.
const PAIRS: usize = 256;

/// The time for all translations that an explanation takes.
const BUDGET: Duration = Duration::from_secs(2);

/// Obstacles that are named in a sentence at most.
const NAMED: usize = 8;

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

/// Names as they stand in a sentence.
fn quoted(names: &[String]) -> Vec<String> {
    names.iter().map(|n| format!("`{n}`")).collect()
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
    pub(super) fn in_parts(formula: &Formula, alphabet: &Alphabet) -> Option<Self> {
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

/// A mission that needs places which the robot cannot reach, or cannot reach as the task wants.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no plan exists: {}", self.reason())]
pub struct Unreachable {
    /// The places that would be needed, one entry for each set of regions; empty if each of them can be
    /// reached, but not without breaking the task.
    pub places: Vec<OutOfReach>,
    /// Regions that would have to be crossed where the task does not allow it.
    pub through: Vec<String>,
    /// Regions that the task names and that can be reached only like that; none if nothing has to be crossed.
    pub beyond: Vec<String>,
    /// What the robot sees at its start, if the task allows no beginning there, and what it would have to see.
    pub at_start: Option<Box<AtStart>>,
    /// By how much obstacles were grown for the robot, which may be why.
    pub robot_radius: f64,
    /// Whether the robot moves between the cells of a grid.
    pub on_grid: bool,
}

/// A start at which the task is broken already.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct AtStart {
    /// The set of regions that the start lies in, as it is printed: `{}`.
    pub sees: String,
    /// The sets that the task may begin with, as they are printed.
    pub needs: Vec<String>,
}

impl AtStart {
    fn find(scenario: &Scenario, task: &Task) -> Option<Self> {
        let sees = scenario.workspace.letter_at(scenario.start)?;
        let nba = &task.nba;
        let mut allowed = nba.alphabet.none();
        for t in nba.initial.iter().flat_map(|&q| nba.outgoing(q)) {
            allowed.union_with(&t.guard);
        }
        (!allowed.contains(sees)).then(|| Self {
            sees: nba.alphabet.show(sees),
            needs: allowed.iter().map(|l| nba.alphabet.show(l)).collect(),
        })
    }

    fn sentence(&self) -> String {
        let mut needs: Vec<String> = self.needs.iter().take(NAMED).cloned().collect();
        if self.needs.len() > needs.len() {
            needs.push(format!("{} more", self.needs.len() - needs.len()));
        }
        format!(
            "the task wants {} at once, and the robot starts in {} (a border counts as outside); what is to come later is written with F, or <>",
            needs.join(" or "),
            self.sees
        )
    }
}

/// A set of regions that holds nowhere that the robot can reach.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutOfReach {
    /// The set of regions, as it is printed: `{a,b}`.
    pub letter: String,
    /// The regions of that set.
    pub regions: Vec<String>,
    /// What closes it off, one entry for each connected part where the set holds; empty where no
    /// walls do (on a grid whose cells do not lead there).
    pub walls: Vec<Walls>,
}

/// What closes a part of the map off.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Walls {
    /// Whether it is the robot's start that is closed in, and not the place that is needed.
    pub around_start: bool,
    /// The obstacles around it, by their names or numbers in the scenario.
    pub obstacles: Vec<String>,
    /// Whether the end of the map is part of the enclosure.
    pub bounds: bool,
    /// The regions that lie in the closed part, wholly or partly.
    pub regions: Vec<String>,
}

impl Unreachable {
    /// Explains why nothing is accepted where the robot can go; `None` if something is.
    #[must_use]
    pub fn find(scenario: &Scenario, task: &Task, system: &dyn TransitionSystem) -> Option<Self> {
        let reachable = system.reachable();
        let at_start = AtStart::find(scenario, task).map(Box::new);
        if at_start.is_some() {
            return Some(Self {
                places: Vec::new(),
                through: Vec::new(),
                beyond: Vec::new(),
                at_start,
                robot_radius: 0.0,
                on_grid: scenario.grid.is_some(),
            });
        }
        if accepts(task, reachable) {
            return Self::crossing(scenario, task, system);
        }
        let alphabet = &task.nba.alphabet;
        let beyond = alphabet.letters().filter(|&l| !reachable.contains(l));
        let beyond: Vec<Letter> = beyond.collect();
        let mut needed = beyond.clone();
        for &letter in &beyond {
            let mut fewer = reachable.clone();
            needed
                .iter()
                .filter(|&&l| l != letter)
                .for_each(|&l| fewer.insert(l));
            if accepts(task, &fewer) {
                needed.retain(|&l| l != letter);
            }
        }
        let map = Arc::clone(&scenario.workspace);
        let world = Continuous::new(map, scenario.start).ok();
        let place = |letter: Letter| {
            let props = alphabet.props(letter);
            let name = |i: usize| alphabet.propositions()[i].clone();
            OutOfReach {
                letter: alphabet.show(letter),
                regions: props.iter().map(name).collect(),
                walls: world.iter().flat_map(|w| walls(w, letter)).collect(),
            }
        };
        Some(Self {
            places: needed.into_iter().map(place).collect(),
            through: Vec::new(),
            beyond: Vec::new(),
            at_start: None,
            robot_radius: scenario.robot_radius,
            on_grid: scenario.grid.is_some(),
        })
    }

    /// Whether the mission is out of reach only for how the task wants it to be done.
    fn crossing(scenario: &Scenario, task: &Task, system: &dyn TransitionSystem) -> Option<Self> {
        let found = Crossing::find(&scenario.workspace, scenario.start, task, system)?;
        let name = |&i: &usize| task.nba.alphabet.propositions()[i].clone();
        Some(Self {
            places: Vec::new(),
            through: found.through.iter().map(name).collect(),
            beyond: found.beyond.iter().map(name).collect(),
            at_start: None,
            robot_radius: scenario.robot_radius,
            on_grid: scenario.grid.is_some(),
        })
    }

    /// How it is not allowed to go where it can go.
    fn crossing_reason(&self) -> String {
        let quoted = |names: &[String]| join(&quoted(names));
        let what = match &self.beyond[..] {
            [] => "the task cannot be done".to_owned(),
            beyond => format!("{} cannot be reached", quoted(beyond)),
        };
        match &self.through[..] {
            [] if self.on_grid => format!(
                "{what} on this grid: no sequence of waypoints that its moves allow is one that the task allows"
            ),
            [] => format!(
                "{what} on this map: where its regions lie, none of the orders of visits that the task allows can be followed"
            ),
            through => format!(
                "{what} without crossing {}, where the task does not allow it",
                quoted(through)
            ),
        }
    }

    fn reason(&self) -> String {
        if let Some(start) = &self.at_start {
            return start.sentence();
        }
        if self.places.is_empty() {
            return self.crossing_reason();
        }
        let place = |place: &OutOfReach| {
            let mut text = format!("{} cannot be reached from the start", place.letter);
            if self.on_grid && place.walls.is_empty() {
                text.push_str(": no cell whose centre lies there can be entered");
            }
            if let Some(first) = place.walls.first() {
                text.push_str(": ");
                text.push_str(&first.sentence(&place.letter));
                let more = place.walls.len() - 1;
                if more > 0 {
                    text.push_str(&format!(" (and {more} more such places)"));
                }
            }
            text
        };
        // What closes in the start keeps it from many places, and is said once.
        let mut told: Vec<(&[Walls], Vec<String>, String)> = Vec::new();
        for this in &self.places {
            let around_start = this.walls.iter().any(|w| w.around_start);
            match told.iter_mut().find(|t| around_start && t.0 == this.walls) {
                Some((_, letters, _)) => letters.push(this.letter.clone()),
                None => told.push((&this.walls, vec![this.letter.clone()], place(this))),
            }
        }
        let sentence = |(_, letters, text): (&[Walls], Vec<String>, String)| {
            text.replacen(&letters[0], &join(&letters), 1)
        };
        let mut text = told
            .into_iter()
            .map(sentence)
            .collect::<Vec<_>>()
            .join("; ");
        if self.robot_radius > 0.0 {
            let radius = Brief(self.robot_radius);
            text.push_str(&format!(
                " (obstacles were grown by the robot_radius of {radius}: a gap may be too narrow for this robot)"
            ));
        }
        text
    }
}

impl Walls {
    fn new(map: &Workspace, enclosure: &Enclosure) -> Self {
        let mut obstacles: Vec<String> = Vec::new();
        for &i in &enclosure.obstacles {
            let name = map.obstacle_name(i);
            if !obstacles.contains(&name) {
                obstacles.push(name);
            }
        }
        let region = |&i: &usize| map.regions()[i].name.clone();
        Self {
            around_start: enclosure.first,
            obstacles,
            bounds: enclosure.bounds,
            regions: enclosure.regions.iter().map(region).collect(),
        }
    }

    fn sentence(&self, letter: &str) -> String {
        let what = if self.around_start {
            "the start"
        } else {
            letter
        };
        let mut by: Vec<String> = self.obstacles.iter().take(NAMED).cloned().collect();
        let more = self.obstacles.len() - by.len();
        if more > 0 {
            by.push(format!("{more} more obstacles"));
        }
        if self.bounds {
            by.push("the end of the map".to_owned());
        }
        let mut text = format!("{what} is walled in by {}", join(&by));
        if self.around_start && !self.regions.is_empty() {
            let regions = join(&quoted(&self.regions));
            text.push_str(&format!(", together with {regions}"));
        }
        text
    }
}

/// What lies between the start and each part of the map that carries the letter.
fn walls(world: &Continuous, letter: Letter) -> Vec<Walls> {
    let map = world.map();
    let mut found: Vec<Walls> = Vec::new();
    for cell in map.cells(letter) {
        let between = world.graph().between(world.start().at, cell.inner_point());
        if let Some(enclosure) = between {
            let walls = Walls::new(map, &enclosure);
            if !found.contains(&walls) {
                found.push(walls);
            }
        }
    }
    found
}

/// Whether some word over these letters is accepted.
fn accepts(task: &Task, letters: &LetterSet) -> bool {
    let mut left = task.nba.clone();
    for row in &mut left.transitions {
        for transition in row.iter_mut() {
            transition.guard.intersect_with(letters);
        }
        row.retain(|t| !t.guard.is_empty());
    }
    !left.trimmed().is_empty()
}

/// `a, b and c`.
fn join(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}
