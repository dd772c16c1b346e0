//! One mission on a roadmap: which of its points matter, and what the automaton does on its words.

use nalgebra::Point2;

use super::roadmap::{Edge, Roadmap};
use super::search::Found;
use super::words::{Relations, WordId, Words};
use super::{ExactPlan, Infeasible};
use crate::alphabet::Letter;
use crate::automaton::Task;
use crate::plan::{Cost, Path};
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
    /// For each node its segment to the start, if there is one: a suffix may pass there.
    home_edges: Vec<Option<Edge>>,
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
        let start_node = roadmap.nodes.len() as u32;
        let mut home_edges = vec![None; roadmap.nodes.len()];
        for e in &start_edges {
            home_edges[e.to as usize] = Some(Edge {
                to: start_node,
                length: e.length,
                word: e.back,
                back: e.word,
            });
        }
        let mut mission = Self {
            roadmap,
            task,
            weight,
            start,
            start_letter,
            start_edges,
            home_edges,
            active,
            relations: Relations::new(&task.nba),
        };
        mission.prepare(&words);
        match roadmap.halt.is_due() {
            true => Err(Infeasible::Halted),
            false => Ok(mission),
        }
    }

    /// The best plan: each of the best on the roadmap is refined.
    pub(super) fn plan(&self) -> Result<ExactPlan, Infeasible> {
        let (map, config) = (self.roadmap.workspace, &self.roadmap.config);
        let shortener = Shortener::with_inset(map, self.task, self.weight, config.refined_inset);
        let mut best: Option<(Path, Cost)> = None;
        let mut keep = |plan: (Path, Cost)| {
            if best.as_ref().is_none_or(|b| plan.1.total < b.1.total) {
                best = Some(plan);
            }
        };
        for found in self.search()? {
            let mut chain = self.chain(&found);
            // What the roadmap gives stands on its own.
            shortener.realise(&chain).into_iter().for_each(&mut keep);
            if self.roadmap.halt.is_due() {
                continue;
            }
            shortener.improve(&mut chain, config.sweeps);
            let refined = shortener.realise(&chain);
            refined
                .filter(|(path, _)| shortener.is_firm_path(path))
                .into_iter()
                .for_each(&mut keep);
        }
        let best = best.ok_or(Infeasible::Stutter)?;
        let (path, cost) = match config.sweeps {
            0 => best,
            _ => self.look_around(&shortener, best),
        };
        Ok(ExactPlan::new(path, cost))
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
            if self.roadmap.halt.is_due() {
                return;
            }
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
        let home = self.home_edges.get(node as usize).and_then(Option::as_ref);
        let home = home.filter(|_| self.active[node as usize]);
        row.iter()
            .filter(|e| self.active[e.to as usize])
            .chain(home)
    }

    pub(super) fn is_active(&self, node: u32) -> bool {
        self.active.get(node as usize).copied().unwrap_or(true)
    }
}
