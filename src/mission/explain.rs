//! Why a mission has no plan: which facts of the map stand in the way ([`facts`]), or what cannot be reached, and what walls it in.

mod crossing;
mod facts;

use std::sync::Arc;

use serde::Serialize;

use crate::alphabet::{Letter, LetterSet};
use crate::automaton::Task;
use crate::number::Brief;
use crate::scenario::Scenario;
use crate::system::{Continuous, TransitionSystem};
use crate::workspace::{Enclosure, Workspace};

use crossing::Crossing;
pub use facts::{LetterFact, NotOnThisMap};

/// Obstacles that are named in a sentence at most.
const NAMED: usize = 8;

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

/// Names as they stand in a sentence.
fn quoted(names: &[String]) -> Vec<String> {
    names.iter().map(|n| format!("`{n}`")).collect()
}

/// `a, b and c`.
fn join(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}
