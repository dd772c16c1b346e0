//! One mission on a roadmap: which of its points matter, and what the automaton does on its words.

use nalgebra::Point2;

use super::chain::Chain;
use super::realise::realise;
use super::roadmap::{Edge, Roadmap};
use super::words::{Relations, WordId, Words};
use super::{ExactPlan, Infeasible};
use crate::alphabet::{Letter, LetterSet, Props};
use crate::automaton::Task;
use crate::workspace::Workspace;

/// A roadmap seen by one mission. Node number `roadmap.nodes.len()` is the start.
pub(super) struct Mission<'a> {
    pub(super) roadmap: &'a Roadmap<'a>,
    pub(super) task: &'a Task,
    /// The prefix's share λ of the cost.
    pub(super) weight: f64,
    pub(super) start: Point2<f64>,
    start_letter: Letter,
    start_edges: Vec<Edge>,
    /// Which nodes the mission may bend at.
    active: Vec<bool>,
    pub(super) relations: Relations,
}

impl<'a> Mission<'a> {
    pub(super) fn new(
        roadmap: &'a Roadmap<'a>,
        start: Point2<f64>,
        task: &'a Task,
        weight: f64,
    ) -> Result<Self, Infeasible> {
        let (x, y) = (start.x, start.y);
        let start_letter = roadmap
            .workspace
            .letter_at(start)
            .ok_or(Infeasible::Start { x, y })?;
        if task.feasible.is_empty() || task.nba.initial.is_empty() {
            return Err(Infeasible::Unsatisfiable);
        }
        let used = used_regions(roadmap.workspace, task);
        let active: Vec<bool> = roadmap
            .nodes
            .iter()
            .map(|n| n.origin.is_empty() || n.origin.0 & used.0 != 0)
            .collect();
        let mut words = roadmap.words.clone();
        let mut start_edges = roadmap.edges_from(start, &mut words);
        start_edges.retain(|e| active[e.to as usize]);
        let mut mission = Self {
            roadmap,
            task,
            weight,
            start,
            start_letter,
            start_edges,
            active,
            relations: Relations::new(&task.nba),
        };
        mission.prepare(&words);
        Ok(mission)
    }

    pub(super) fn plan(&self) -> Result<ExactPlan, Infeasible> {
        let found = self.search()?;
        let rough = Chain::new(self, &found);
        let mut refined = rough.clone();
        refined.refine(self.roadmap.config.sweeps);
        let mut plans: Vec<ExactPlan> = [refined, rough]
            .iter()
            .filter_map(|chain| realise(self, chain))
            .collect();
        plans.sort_by(|a, b| a.cost.total.total_cmp(&b.cost.total));
        plans.into_iter().next().ok_or(Infeasible::Stutter)
    }

    /// Finds the automaton's steps along every word that the mission's segments carry.
    fn prepare(&mut self, words: &Words) {
        for i in 0..=self.roadmap.nodes.len() {
            let along: Vec<WordId> = self.edges(i as u32).map(|e| e.word).collect();
            for word in along {
                self.relations.prepare(word, words);
            }
        }
    }

    /// The number of the start as a node.
    pub(super) fn start_node(&self) -> u32 {
        self.roadmap.nodes.len() as u32
    }

    pub(super) fn at(&self, node: u32) -> Point2<f64> {
        self.roadmap
            .nodes
            .get(node as usize)
            .map_or(self.start, |n| n.at)
    }

    pub(super) fn letter(&self, node: u32) -> Letter {
        self.roadmap
            .nodes
            .get(node as usize)
            .map_or(self.start_letter, |n| n.letter)
    }

    /// The segments from a node to nodes that matter.
    pub(super) fn edges(&self, node: u32) -> impl Iterator<Item = &Edge> + '_ {
        let row = match self.roadmap.edges.get(node as usize) {
            Some(_) if !self.active[node as usize] => &[][..],
            Some(row) => row,
            None => &self.start_edges,
        };
        row.iter().filter(|e| self.active[e.to as usize])
    }

    pub(super) fn is_active(&self, node: u32) -> bool {
        self.active.get(node as usize).copied().unwrap_or(true)
    }
}

/// The regions that a task speaks of: those its formula names, all if it has none.
pub(super) fn used_regions(workspace: &Workspace, task: &Task) -> Props {
    let Some(formula) = &task.formula else {
        return (0..workspace.regions().len()).fold(Props::EMPTY, Props::with);
    };
    let names = formula.propositions();
    let regions = names
        .iter()
        .filter_map(|name| workspace.alphabet().proposition(name));
    regions.fold(Props::EMPTY, Props::with)
}

/// For each letter the number of its class: letters of one class are in the same guards, so
/// the automaton cannot tell them apart.
pub(super) fn letter_classes(task: &Task) -> Vec<u16> {
    let guards: Vec<&LetterSet> = {
        let mut all: Vec<&LetterSet> = task
            .nba
            .transitions
            .iter()
            .flatten()
            .map(|t| &t.guard)
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let mut classes: Vec<Vec<bool>> = Vec::new();
    task.nba
        .alphabet
        .letters()
        .map(|letter| {
            let signature: Vec<bool> = guards.iter().map(|g| g.contains(letter)).collect();
            let known = classes.iter().position(|c| *c == signature);
            known.unwrap_or_else(|| {
                classes.push(signature);
                classes.len() - 1
            }) as u16
        })
        .collect()
}
