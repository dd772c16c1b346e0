//! Building a library: many subtrees grown together (`transfer-planning.md`, III-B, Alg. 2 and 3).
//!
//! Every group of subtasks with the same starting endpoint has a subtree. Its product knows only what
//! the group's subtasks allow: the step from the starting state to a terminal state, and that state's
//! self-loop. So every path that is extracted satisfies its subtask by construction.
//!
//! Exclusion (III-B.2): a terminal endpoint has no outgoing edges. Letters of the group's terminal
//! endpoints are taken out of the self-loop, so that a skill ends where it first could.

use std::sync::Arc;
use std::time::Instant;

use rand::RngExt;
use rayon::prelude::*;

use super::budget::Budget;
use super::library::{Library, Offer};
use super::places::{PlaceId, Places};
use super::skill::Skill;
use super::subtasks::{Equivalence, Subtask, SubtaskGraph, loops};
use crate::alphabet::LetterSet;
use crate::automaton::{Distances, Nba, StateId, Task, Transition};
use crate::guidance::{Guidance, Heatmap};
use crate::planner::{Aim, GuidanceError, Guide, NodeId, Sampler, Settings, Stop, Tree, View};
use crate::random::{Random, choose, generator};
use crate::system::{Spot, TransitionSystem};

/// Samples between two looks at the stop flag and the observer; drawn from the same trees.
const BATCH: u64 = 32;

/// The starting state of a subtree's own small automaton.
const BEGIN: StateId = StateId(0);

/// How a library is built.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildSettings {
    /// The seed of every random choice.
    pub seed: u64,
    /// Sampled places (each is offered to every subtree), at most.
    pub samples: u64,
    /// Product states of all subtrees together, at most (`n_max` of Alg. 2).
    pub nodes: u64,
    /// Seconds to build for; `None` for no limit. The library then depends on the machine.
    pub time_limit: Option<f64>,
    /// Settings of the trees and of guided sampling.
    pub search: Settings,
}

impl Default for BuildSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            samples: 2_000,
            nodes: 4_000_000,
            time_limit: None,
            search: Settings::default(),
        }
    }
}

/// Where new places are looked for while a library is built.
#[derive(Clone, Debug)]
pub enum BuildSampler {
    /// A place that one move from a random node of a random subtree leads to (III-B.1).
    Uniform,
    /// As a heatmap predicts, between a node and a terminal endpoint of its subtree.
    Guided(Heatmap),
}

/// How far a running build is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildProgress {
    /// Places sampled so far.
    pub samples: u64,
    /// Product states of all subtrees.
    pub nodes: u64,
    /// Subtasks with a path.
    pub found: usize,
    /// Subtasks.
    pub subtasks: usize,
}

/// What a build made.
#[derive(Clone, Debug)]
pub struct Built {
    /// The skills.
    pub library: Library,
    /// Subtasks of the graph that ask for a path.
    pub subtasks: usize,
    /// Those for which one was found.
    pub found: usize,
    /// Subtrees that were grown.
    pub subtrees: usize,
    /// Places sampled.
    pub samples: u64,
    /// Product states of all subtrees.
    pub nodes: u64,
}

/// Builds a library from a mission's subtasks (Alg. 2).
///
/// # Errors
/// A heatmap that is not a square of finite values.
pub fn build(
    system: &dyn TransitionSystem,
    start: Spot,
    task: &Task,
    sampler: &BuildSampler,
    settings: &BuildSettings,
    stop: &Stop,
    observe: &mut dyn FnMut(BuildProgress),
) -> Result<Built, GuidanceError> {
    let began = Instant::now();
    let places = Places::new(system, start);
    let home = places.home(system);
    let graph = SubtaskGraph::new(&task.nba, &places, home, Equivalence::Match);
    let budget = Budget::new(stop, began, settings.time_limit);
    let groups = group(&task.nba, &places, &graph, &budget);
    let context = Context {
        system,
        places: &places,
        search: &settings.search,
    };
    let mut trees: Vec<Subtree<'_>> = groups
        .iter()
        .take_while(|_| !budget.is_over())
        .map(|g| Subtree::new(context, g, start, sampler))
        .collect::<Result<_, _>>()?;
    let mut random = generator(settings.seed, 0);
    let mut progress = BuildProgress {
        samples: 0,
        nodes: 0,
        found: 0,
        subtasks: graph.subtasks.iter().filter(|s| asks_for_path(s)).count(),
    };
    while !trees.is_empty() && progress.samples < settings.samples && !budget.is_over() {
        let count = BATCH.min(settings.samples - progress.samples);
        let batch: Vec<Spot> = (0..count)
            .filter_map(|_| sample(&trees, &mut random))
            .collect();
        // Of tens of thousands of trees those that are late are left as they are.
        trees
            .par_iter_mut()
            .filter(|_| !budget.is_over())
            .for_each(|tree| batch.iter().for_each(|&spot| tree.take(spot)));
        progress.samples += count;
        progress.nodes = trees.iter().map(|t| t.tree.len() as u64).sum();
        progress.found = trees.iter().map(Subtree::found).sum();
        observe(progress);
        if progress.nodes >= settings.nodes {
            break;
        }
    }
    let mut library = Library::new(system);
    for tree in &trees {
        for skill in tree.skills() {
            if library.offer(system, skill) == Offer::Kept {
                log::debug!("{} skills", library.skills().len());
            }
        }
    }
    Ok(Built {
        library,
        subtasks: progress.subtasks,
        found: progress.found,
        subtrees: trees.len(),
        samples: progress.samples,
        nodes: progress.nodes,
    })
}

/// The subtasks with one starting endpoint, as a task of its own.
struct Group {
    from: PlaceId,
    /// The terminal places, each with its state in the group's automaton.
    terminals: Vec<(PlaceId, StateId)>,
    task: Task,
}

/// Stays, and subtasks that end outside of regions, need no path.
fn asks_for_path(subtask: &Subtask) -> bool {
    let (from, to) = (subtask.from.position, subtask.to.position);
    from.place != to.place && !to.outside
}

/// Divides subtasks by their starting endpoints (III-B). Where the time is over, those that come last are left out.
fn group(nba: &Nba, places: &Places, graph: &SubtaskGraph, budget: &Budget) -> Vec<Group> {
    let mut sorted: Vec<&Subtask> = graph.subtasks.iter().filter(|s| asks_for_path(s)).collect();
    let key = |s: &Subtask| (s.from.position.place, s.from.state);
    let labels = loops(nba);
    sorted.sort_by_key(|s| (key(s), s.to));
    sorted
        .chunk_by(|a, b| key(a) == key(b))
        .take_while(|_| !budget.is_over())
        .map(|subtasks| Group::new(nba, places, &labels, subtasks))
        .collect()
}

impl Group {
    fn new(nba: &Nba, places: &Places, labels: &[LetterSet], subtasks: &[&Subtask]) -> Self {
        let from = subtasks[0].from.position.place;
        let mut states: Vec<StateId> = subtasks.iter().map(|s| s.to.state).collect();
        states.sort_unstable();
        states.dedup();
        let number = |q: StateId| {
            let i = states.partition_point(|&s| s < q);
            StateId(i as u32 + 1)
        };
        let mut terminals: Vec<(PlaceId, StateId)> = subtasks
            .iter()
            .map(|s| (s.to.position.place, number(s.to.state)))
            .collect();
        terminals.sort_unstable();
        terminals.dedup();
        let task = small_task(nba, places, labels, (from, &states), &terminals);
        Self {
            from,
            terminals,
            task,
        }
    }
}

/// The automaton of a group: begin → each terminal state, waiting there, and done.
fn small_task(
    nba: &Nba,
    places: &Places,
    labels: &[LetterSet],
    (from, states): (PlaceId, &[StateId]),
    terminals: &[(PlaceId, StateId)],
) -> Task {
    let done = StateId(states.len() as u32 + 1);
    let mut first = nba.alphabet.none();
    first.insert(places.spot(from).letter);
    let mut transitions = vec![Vec::new(); states.len() + 2];
    for (i, q) in states.iter().enumerate() {
        let here = StateId(i as u32 + 1);
        transitions[0].push(Transition {
            target: here,
            guard: first.clone(),
        });
        let mut ends = nba.alphabet.none();
        for &(place, _) in terminals.iter().filter(|&&(_, q)| q == here) {
            ends.insert(places.spot(place).letter);
        }
        let mut wait = labels[q.index()].clone();
        wait.subtract(&ends);
        let row = &mut transitions[here.index()];
        for (target, guard) in [(here, wait), (done, ends)] {
            if !guard.is_empty() {
                row.push(Transition { target, guard });
            }
        }
    }
    let small = Nba {
        alphabet: Arc::clone(&nba.alphabet),
        initial: vec![BEGIN],
        accepting: (0..states.len() + 2).map(|i| i == done.index()).collect(),
        transitions,
    };
    Task {
        distances: Distances::new(&small),
        feasible: vec![done],
        formula: None,
        nba: small,
    }
}

/// What all subtrees share.
#[derive(Clone, Copy)]
struct Context<'a> {
    system: &'a dyn TransitionSystem,
    places: &'a Places,
    search: &'a Settings,
}

/// A subtree 𝒯_k with its group.
struct Subtree<'a> {
    context: Context<'a>,
    group: &'a Group,
    tree: Tree<'a>,
    sampler: Option<Sampler>,
}

impl<'a> Subtree<'a> {
    fn new(
        context: Context<'a>,
        group: &'a Group,
        start: Spot,
        sampler: &BuildSampler,
    ) -> Result<Self, GuidanceError> {
        let home = context.places.region(context.system, &start);
        let root = match home == Some(group.from) {
            true => start,
            false => context.places.spot(group.from),
        };
        let sampler = match sampler {
            BuildSampler::Uniform => None,
            BuildSampler::Guided(heatmap) => {
                let states = group.task.nba.len();
                let guidance = Guidance {
                    heatmap: heatmap.clone(),
                    states: vec![1.0; states],
                };
                Some(Sampler::Guided(Arc::new(Guide::new(&guidance, states)?)))
            }
        };
        Ok(Self {
            tree: Tree::new(context.system, &group.task.nba, root, &[BEGIN]),
            context,
            group,
            sampler,
        })
    }

    /// Lines 4 to 11 for this subtree: Extend, Rewire, ConnectRoots.
    fn take(&mut self, spot: Spot) {
        let Context {
            system,
            places,
            search,
        } = self.context;
        let place = places.region(system, &spot);
        if place == Some(self.group.from) {
            // A skill may begin at any point of its region.
            self.tree.add_root(spot, BEGIN, 0.0);
        }
        let anchor = self.tree.nearest(spot.at);
        let near = search.near(self.tree.site_count(), system.bounds().side());
        if self.tree.extend(spot, near, &[anchor]).is_some() && place.is_none() {
            self.connect_roots(spot);
        }
    }

    /// ConnectRoots (Alg. 3): from the new place to the terminal endpoints that it can reach.
    fn connect_roots(&mut self, spot: Spot) {
        let Some(site) = self.tree.site_at(spot.at) else {
            return;
        };
        for &(place, state) in &self.group.terminals {
            let end = self.context.places.spot(place);
            let nodes = self.tree.at_site(site);
            let Some(&(_, node)) = nodes.iter().find(|&&(q, _)| q == state) else {
                continue;
            };
            let waits = self.group.task.nba.guard(state, state);
            if waits.is_some_and(|g| g.contains(spot.letter))
                && self.context.system.step(&spot, &end)
            {
                let length = self.context.system.distance(spot.at, end.at);
                let there = self.tree.site_for(end);
                self.tree.hop(node, there, state, length);
            }
        }
    }

    /// The cheapest node at a terminal endpoint.
    fn end(&self, place: PlaceId, state: StateId) -> Option<NodeId> {
        let Context { system, places, .. } = self.context;
        let letter = places.spot(place).letter;
        let there = |&&n: &&NodeId| {
            let spot = self.tree.spot(n);
            spot.letter == letter && places.region(system, &spot) == Some(place)
        };
        let nodes = self.tree.in_state(state).iter().filter(there);
        let cost = |n: &&NodeId| self.tree.cost(**n);
        nodes
            .min_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.cmp(b)))
            .copied()
    }

    fn found(&self) -> usize {
        let ends = self.group.terminals.iter();
        ends.filter(|&&(place, state)| self.end(place, state).is_some())
            .count()
    }

    /// One path for each terminal endpoint that was reached (III-B.5).
    fn skills(&self) -> Vec<Skill> {
        let ends = self.group.terminals.iter();
        ends.filter_map(|&(place, state)| self.end(place, state))
            .filter_map(|node| self.extract(node))
            .collect()
    }

    fn extract(&self, node: NodeId) -> Option<Skill> {
        let system = self.context.system;
        let points = self.tree.path(node);
        let mut path: Vec<Spot> = points.iter().filter_map(|w| system.settle(w.at)).collect();
        path.dedup_by(|b, a| a.at == b.at);
        polish(system, &mut path);
        (path.len() >= 2).then(|| Skill::from_spots(system, path))
    }
}

/// Sample (III-B.1): a random subtree proposes a place.
fn sample(trees: &[Subtree<'_>], random: &mut Random) -> Option<Spot> {
    let subtree = choose(random, trees)?;
    let system = subtree.context.system;
    if let Some(sampler) = &subtree.sampler {
        let view = View {
            system,
            task: &subtree.group.task,
            settings: subtree.context.search,
            tree: &subtree.tree,
            aim: Aim::Prefix { reached: true },
        };
        return system.settle(sampler.draw(&view, random)?.at);
    }
    one_move_away(system, &subtree.tree, random)
}

/// A place that one move from a random node leads to; anywhere, if places are infinitely many.
pub(crate) fn one_move_away(
    system: &dyn TransitionSystem,
    tree: &Tree<'_>,
    random: &mut Random,
) -> Option<Spot> {
    let node = NodeId(random.random_range(0..tree.len() as u32));
    let mut near = Vec::new();
    if system.neighbours(&tree.spot(node), &mut near) {
        return choose(random, &near).copied();
    }
    system.settle(system.sample_free(random))
}

/// Leaves out waypoints that are not needed, and in a continuous map draws the ends to the borders of
/// their regions, twice since one allows more of the other.
pub(crate) fn polish(system: &dyn TransitionSystem, path: &mut Vec<Spot>) {
    shortcut(system, path);
    if system.reads_waypoints() {
        return;
    }
    for _ in 0..2 {
        draw_in_end(system, path);
        path.reverse();
        draw_in_end(system, path);
        path.reverse();
        shortcut(system, path);
    }
}

/// Leaves out a waypoint where the robot can move on directly without being longer on its way. Moves
/// never pass letters that are not those of their ends, so nothing new is seen.
fn shortcut(system: &dyn TransitionSystem, path: &mut Vec<Spot>) {
    let mut i = 0;
    while i + 2 < path.len() {
        let (a, b, c) = (path[i], path[i + 1], path[i + 2]);
        let around = system.distance(a.at, b.at) + system.distance(b.at, c.at);
        let direct = system.distance(a.at, c.at);
        // A waypoint in a region is a visit: it stays.
        let visit = !system.alphabet().props(b.letter).is_empty();
        if !visit && direct <= around * (1.0 + 1e-12) && system.step(&a, &c) {
            path.remove(i + 1);
            i = i.saturating_sub(1);
        } else {
            i += 1;
        }
    }
}

/// Moves the last waypoint back along its leg to where its region begins.
fn draw_in_end(system: &dyn TransitionSystem, path: &mut [Spot]) {
    let [.., before, last] = path else { return };
    if system.alphabet().props(last.letter).is_empty() || before.letter == last.letter {
        return;
    }
    let leg = last.at - before.at;
    let inside = |t: f64| {
        let spot = system.settle(before.at + leg * t)?;
        (spot.letter == last.letter).then_some(spot)
    };
    let (mut low, mut high) = (0.0, 1.0);
    // Forty halvings resolve a leg to less than the map's tolerance.
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        match inside(middle) {
            Some(_) => high = middle,
            None => low = middle,
        }
    }
    // A little inside, so that the end is not a matter of rounding.
    let nudge = 1e-6 * system.bounds().side() / leg.norm().max(f64::MIN_POSITIVE);
    if let Some(spot) = inside((high + nudge).min(1.0))
        && system.step(before, &spot)
    {
        *last = spot;
    }
}
