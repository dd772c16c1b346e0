//! One mission on a roadmap: which of its points matter, and what the automaton does on its words.

use nalgebra::Point2;

use super::roadmap::{Edge, Roadmap};
use super::search::Found;
use super::words::{Relations, WordId, Words};
use super::{ExactPlan, Infeasible};
use crate::alphabet::Letter;
use crate::automaton::Task;
use crate::shorten::{Chain, Shortener, used_regions};

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
        let rough = self.chain(&found);
        let mut refined = rough.clone();
        let (map, config) = (self.roadmap.workspace, &self.roadmap.config);
        let shortener = Shortener::with_inset(map, self.task, self.weight, config.refined_inset);
        shortener.refine(&mut refined, self.roadmap.config.sweeps);
        let plans = [refined, rough];
        plans
            .iter()
            .enumerate()
            .filter_map(|(i, chain)| Some((i, shortener.realise(chain)?)))
            // What the roadmap gives stands on its own.
            .filter(|(i, (path, _))| *i == 1 || shortener.is_firm_path(path))
            .map(|(_, plan)| plan)
            .min_by(|a, b| a.1.total.total_cmp(&b.1.total))
            .map(|(path, cost)| ExactPlan::new(path, cost))
            .ok_or(Infeasible::Stutter)
    }

    fn chain(&self, found: &Found) -> Chain {
        let mut nodes = found.prefix.clone();
        nodes.extend(found.suffix.iter().flatten());
        Chain {
            points: nodes.into_iter().map(|n| self.at(n)).collect(),
            split: found.prefix.len() - 1,
            stays: found.suffix.is_none(),
        }
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
