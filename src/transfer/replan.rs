//! Replanning in a changed environment (`transfer-planning.md`, VI-B): of a plan that new obstacles broke,
//! only the broken segments are planned again, each in the part of the automaton that it used.
//!
//! Corrections of the paper's procedure, which can run for ever: obstacles may hit the suffix and
//! the point where it begins (the suffix is then entered elsewhere); a segment whose sub-automaton
//! admits no path, or whose far end cannot be reached any more, is widened, and in the end the
//! mission is planned anew; a repaired suffix must still pass an accepting state.

mod beyond_repair;
mod run;
mod segment;

use std::sync::Arc;
use std::time::Instant;

use super::rounds::task_along;
use crate::automaton::Task;
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::{Aim, NodeId, Problem, Sampler, Settings, Tree, View};
use crate::random::{Random, generator};
use crate::system::{Leg, Spot, TransitionSystem};

pub use beyond_repair::BeyondRepair;
pub(super) use run::has_run;
use run::with_states;
use segment::SubAutomaton;

/// Samples for one attempt at a segment; most need none beyond the turns of the shortest way.
const SAMPLES: usize = 300;

/// How many ends are tried for a broken segment.
const ATTEMPTS: usize = 4;

/// Turns of the shortest obstacle-free way that are proposed before any sample.
const TURNS: usize = 32;

/// What became of a plan in a changed environment.
#[derive(Clone, Debug)]
pub enum Replanned {
    /// Nothing is in its way.
    Unchanged(Repair),
    /// Its broken segments were replaced.
    Repaired(Repair),
    /// It cannot be repaired, for this reason: the mission must be planned anew.
    Hopeless(BeyondRepair),
}

/// A plan that holds in the changed environment as far as its moves and its automaton run go.
#[derive(Clone, Debug)]
pub struct Repair {
    /// The plan.
    pub path: Path,
    /// Its cost.
    pub cost: Cost,
    /// The task that its automaton states belong to: the problem's, or one of the same formula whose patrols are in the
    /// order in which the plan makes its round.
    pub task: Arc<Task>,
    /// Segments that were replaced.
    pub segments: usize,
    /// Samples that were drawn for them.
    pub samples: u64,
    /// Seconds.
    pub seconds: f64,
}

/// Repairs a plan of this mission for this environment. The plan's automaton states are used if they
/// are a run of the mission's automaton, and are found again if not; where only a patrol's order stands in the
/// way, the mission is translated again, in the plan's.
#[must_use]
pub fn replan(problem: &Problem, plan: &Path, settings: &Settings) -> Replanned {
    let began = Instant::now();
    let other = task_along(problem, plan).map(|task| Problem {
        task,
        ..problem.clone()
    });
    let problem = other.as_ref().unwrap_or(problem);
    let mut repairer = Repairer {
        problem,
        settings,
        random: generator(settings.seed, 0),
        segments: 0,
        samples: 0,
    };
    let path = match repairer.repair(plan) {
        Ok(path) => path,
        Err(why) => return Replanned::Hopeless(why),
    };
    let length = |points: &[Waypoint]| -> f64 {
        let legs = points.windows(2);
        legs.map(|w| problem.system.distance(w[0].at, w[1].at))
            .sum()
    };
    let cost = Cost::new(length(&path.prefix), length(&path.suffix), problem.weight);
    let repair = Repair {
        path,
        cost,
        task: Arc::clone(&problem.task),
        segments: repairer.segments,
        samples: repairer.samples,
        seconds: began.elapsed().as_secs_f64(),
    };
    match repair.segments {
        0 => Replanned::Unchanged(repair),
        _ => Replanned::Repaired(repair),
    }
}

struct Repairer<'a> {
    problem: &'a Problem,
    settings: &'a Settings,
    random: Random,
    segments: usize,
    samples: u64,
}

impl Repairer<'_> {
    fn repair(&mut self, plan: &Path) -> Result<Path, BeyondRepair> {
        let (Some(first), Some(last)) = (plan.prefix.first(), plan.suffix.last()) else {
            return Err(BeyondRepair::Empty);
        };
        // A robot that stands elsewhere needs another prefix, and perhaps another plan.
        let (begins, stands) = (first.at, self.problem.start.at);
        if begins != stands {
            return Err(BeyondRepair::Start { begins, stands });
        }
        if plan.suffix.len() == 1 && self.spot(last).is_none() {
            return Err(BeyondRepair::Stay(last.at));
        }
        let plan = with_states(self.problem, plan).ok_or(BeyondRepair::Word)?;
        if plan.suffix.len() == 1 {
            let prefix = self.repair_part(&plan.prefix, false)?;
            let suffix = plan.suffix;
            return Ok(Path { prefix, suffix });
        }
        let entered = self.enter_elsewhere(plan);
        let (prefix, cycle) = entered.ok_or(BeyondRepair::Loop)?;
        let prefix = self.repair_part(&prefix, false)?;
        let cycle = self.repair_part(&cycle, true)?;
        let accepts = |w: &Waypoint| self.problem.task.nba.is_accepting(w.state);
        if !cycle.iter().any(accepts) {
            return Err(BeyondRepair::Acceptance);
        }
        let suffix = cycle;
        Ok(Path { prefix, suffix })
    }

    /// The plan with the suffix beginning at a point that is still free: the point itself if it is.
    fn enter_elsewhere(&self, plan: Path) -> Option<(Vec<Waypoint>, Vec<Waypoint>)> {
        let (mut prefix, cycle) = (plan.prefix, plan.suffix);
        let open = &cycle[..cycle.len() - 1];
        let first = open.iter().position(|w| self.spot(w).is_some())?;
        prefix.extend(&open[1..first.max(1)]);
        if first > 0 {
            prefix.push(open[first]);
        }
        let mut rotated: Vec<Waypoint> = open[first..].to_vec();
        rotated.extend(&open[..=first]);
        Some((prefix, rotated))
    }

    fn spot(&self, w: &Waypoint) -> Option<Spot> {
        self.problem.system.settle(w.at)
    }

    /// Whether a product step of the plan is still possible.
    fn holds(&self, a: &Waypoint, b: &Waypoint) -> bool {
        let (Some(from), Some(to)) = (self.spot(a), self.spot(b)) else {
            return false;
        };
        let guard = self.problem.task.nba.guard(a.state, b.state);
        guard.is_some_and(|g| g.contains(from.letter)) && self.problem.system.step(&from, &to)
    }

    /// Replaces the broken segments of a prefix, or of a cycle that has to stay accepting.
    fn repair_part(
        &mut self,
        points: &[Waypoint],
        cycle: bool,
    ) -> Result<Vec<Waypoint>, BeyondRepair> {
        let nba = &self.problem.task.nba;
        let last = points.len() - 1;
        let mut done = vec![points[0]];
        let mut i = 0;
        while i < last {
            if self.holds(&points[i], &points[i + 1]) {
                i += 1;
                done.push(points[i]);
                continue;
            }
            // Accepting points that are done, or still to come unharmed, need no second visit here.
            let accepts = |w: &Waypoint| nba.is_accepting(w.state);
            let visited = done.iter().any(accepts);
            let free = |k: &usize| self.spot(&points[*k]).is_some();
            let ends: Vec<usize> = (i + 1..=last).filter(free).take(ATTEMPTS).collect();
            let found = ends.into_iter().find_map(|k| {
                let inside = points[i..=k].iter().any(accepts);
                let later = points[k..].iter().any(accepts);
                let must_accept = cycle && inside && !visited && !later;
                let path = self.connect(&points[i..=k], must_accept)?;
                Some((k, path))
            });
            let (k, path) = found.ok_or(BeyondRepair::Segment(points[i].at))?;
            self.segments += 1;
            done.extend(&path[1..]);
            i = k;
        }
        Ok(done)
    }

    /// A new way from the first to the last of these waypoints, in the sub-automaton B' of their
    /// states. With `accepting` it passes an accepting state.
    fn connect(&mut self, segment: &[Waypoint], accepting: bool) -> Option<Vec<Waypoint>> {
        let system = &*self.problem.system;
        let (from, to) = (segment[0], segment[segment.len() - 1]);
        let (start, end) = (self.spot(&from)?, self.spot(&to)?);
        // No way at all: nothing to search for.
        system.first_leg(start.at, end.at, true)?;
        let small = SubAutomaton::new(&self.problem.task.nba, segment, accepting);
        let mut tree = Tree::new(system, &small.task.nba, start, &[small.first]);
        let mut touched = Vec::new();
        let mut close = |tree: &mut Tree<'_>| -> Option<Vec<Waypoint>> {
            tree.take_touched(&mut touched);
            let node = closing(system, &small, tree, &touched, &end)?;
            Some(small.path(tree, node, &to))
        };
        if let Some(path) = close(&mut tree) {
            return Some(path);
        }
        let mut at = start.at;
        for _ in 0..TURNS {
            let Some(Leg { to: next, .. }) = system.first_leg(at, end.at, true) else {
                break;
            };
            if next == at || next == end.at {
                break;
            }
            at = next;
            self.grow(&mut tree, system.settle(next));
            if let Some(path) = close(&mut tree) {
                return Some(path);
            }
        }
        for _ in 0..SAMPLES {
            self.samples += 1;
            let view = View {
                system,
                task: &small.task,
                settings: self.settings,
                tree: &tree,
                aim: Aim::Reach {
                    at: end.at,
                    state: small.last,
                },
            };
            let drawn = Sampler::Biased.draw(&view, &mut self.random);
            let spot = drawn.and_then(|d| system.settle(d.at));
            self.grow(&mut tree, spot);
            if let Some(path) = close(&mut tree) {
                return Some(path);
            }
        }
        None
    }

    fn grow(&self, tree: &mut Tree<'_>, spot: Option<Spot>) {
        let Some(spot) = spot else { return };
        let anchor = tree.nearest(spot.at);
        let side = self.problem.system.bounds().side();
        let near = self.settings.near(tree.site_count(), side);
        tree.extend(spot, near, &[anchor]);
    }
}

/// The cheapest node that reaches the end of a segment in one product step.
fn closing(
    system: &dyn TransitionSystem,
    small: &SubAutomaton,
    tree: &Tree<'_>,
    touched: &[NodeId],
    end: &Spot,
) -> Option<NodeId> {
    let reaches = |&&node: &&NodeId| {
        let spot = tree.spot(node);
        let guard = small.task.nba.guard(tree.state(node), small.last);
        guard.is_some_and(|g| g.contains(spot.letter)) && system.step(&spot, end)
    };
    let cost = |n: &&NodeId| tree.cost(**n) + system.distance(tree.spot(**n).at, end.at);
    touched
        .iter()
        .filter(reaches)
        .min_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.cmp(b)))
        .copied()
}
