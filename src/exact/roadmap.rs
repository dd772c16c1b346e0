//! The points that shortest mission paths bend at, and the free segments between them.

use nalgebra::{Point2, Vector2};

use super::mission::Mission;
use super::words::{WordId, Words};
use super::{ExactConfig, ExactPlan, Halt, Infeasible};
use crate::alphabet::{Letter, Props};
use crate::automaton::Task;
use crate::shorten::{inward_normal, word_of};
use crate::workspace::{Place, Polygon, Workspace};

/// A point of the roadmap.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) at: Point2<f64>,
    pub(super) letter: Letter,
    /// The regions whose border the point belongs to; empty where every mission may need it.
    pub(super) origin: Props,
    corner: Option<Corner>,
}

/// A convex corner, which paths pass tangentially only: the directions to its neighbours.
#[derive(Clone, Copy, Debug)]
struct Corner {
    before: Vector2<f64>,
    after: Vector2<f64>,
    /// How far a line may pass on the wrong side: points beside borders are a little off, and those of borders
    /// that are in line with each other must see each other.
    slack: f64,
}

/// A free segment to another node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) to: u32,
    pub(super) length: f64,
    /// The word from here to there.
    pub(super) word: WordId,
    /// The word from there to here.
    pub(super) back: WordId,
}

/// The roadmap of a map, to be shared by all missions on it.
#[derive(Clone, Debug)]
pub struct Roadmap<'w> {
    pub(super) workspace: &'w Workspace,
    pub(super) config: ExactConfig,
    pub(super) nodes: Vec<Node>,
    pub(super) edges: Vec<Vec<Edge>>,
    pub(super) words: Words,
    pub(super) halt: Halt<'w>,
}

impl<'w> Roadmap<'w> {
    /// Builds the roadmap for missions over any of the map's regions.
    #[must_use]
    pub fn new(workspace: &'w Workspace, config: ExactConfig) -> Self {
        let all = (0..workspace.regions().len()).fold(Props::EMPTY, Props::with);
        Self::of_regions(workspace, config, all)
    }

    /// Builds the roadmap for missions over `used` regions only; paths may still cross the others.
    #[must_use]
    pub fn of_regions(workspace: &'w Workspace, config: ExactConfig, used: Props) -> Self {
        Self::begin(workspace, config, used, Halt::NEVER)
    }

    /// The same for one search, unless it is ended before.
    pub(super) fn until(
        workspace: &'w Workspace,
        config: ExactConfig,
        used: Props,
        halt: Halt<'w>,
    ) -> Result<Self, Infeasible> {
        let roadmap = Self::begin(workspace, config, used, halt);
        match halt.is_due() {
            true => Err(Infeasible::Halted),
            false => Ok(roadmap),
        }
    }

    fn begin(workspace: &'w Workspace, config: ExactConfig, used: Props, halt: Halt<'w>) -> Self {
        let nodes = Candidates::collect(workspace, &config, used);
        let mut roadmap = Self {
            workspace,
            config,
            edges: vec![Vec::new(); nodes.len()],
            nodes,
            words: Words::default(),
            halt,
        };
        roadmap.connect();
        roadmap
    }

    /// Plans a mission on this roadmap. `weight` is the prefix's share λ of the cost, in `[0, 1]`.
    ///
    /// # Errors
    /// See [`Infeasible`].
    pub fn plan(
        &self,
        start: Point2<f64>,
        task: &Task,
        weight: f64,
    ) -> Result<ExactPlan, Infeasible> {
        Mission::new(self, start, task, weight)?.plan()
    }

    /// The regions of which some part can be reached from `start`, whatever is crossed on the way.
    #[must_use]
    pub fn reachable(&self, start: Point2<f64>) -> Props {
        let mut words = self.words.clone();
        let mut seen = vec![false; self.nodes.len()];
        let mut stack: Vec<u32> = self
            .edges_from(start, &mut words)
            .iter()
            .map(|e| e.to)
            .collect();
        let alphabet = self.workspace.alphabet();
        let mut found = self
            .workspace
            .letter_at(start)
            .map_or(Props::EMPTY, |l| alphabet.props(l));
        while let Some(i) = stack.pop() {
            if std::mem::replace(&mut seen[i as usize], true) {
                continue;
            }
            found.0 |= alphabet.props(self.nodes[i as usize].letter).0;
            stack.extend(self.edges[i as usize].iter().map(|e| e.to));
        }
        found
    }

    /// How many points and how many directed segments the roadmap has.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.nodes.len(), self.edges.iter().map(Vec::len).sum())
    }

    fn connect(&mut self) {
        for i in 0..self.nodes.len() {
            if self.halt.is_due() {
                return;
            }
            for j in 0..i {
                let (a, b) = (&self.nodes[i], &self.nodes[j]);
                if !(a.may_bend_towards(b.at) && b.may_bend_towards(a.at)) {
                    continue;
                }
                let Some(word) = word_of(self.workspace, a.at, b.at) else {
                    continue;
                };
                let length = (b.at - a.at).norm();
                let mut back = word.clone();
                back.reverse();
                let (word, back) = (self.words.intern(&word), self.words.intern(&back));
                let edge = |to, word, back| Edge {
                    to,
                    length,
                    word,
                    back,
                };
                self.edges[i].push(edge(j as u32, word, back));
                self.edges[j].push(edge(i as u32, back, word));
            }
        }
    }

    /// The segments from a point that is not of the roadmap.
    pub(super) fn edges_from(&self, start: Point2<f64>, words: &mut Words) -> Vec<Edge> {
        let mut edges = Vec::new();
        for (i, node) in self.nodes.iter().enumerate() {
            if !node.may_bend_towards(start) {
                continue;
            }
            if let Some(word) = word_of(self.workspace, start, node.at) {
                let mut back = word.clone();
                back.reverse();
                let (word, back) = (words.intern(&word), words.intern(&back));
                edges.push(Edge {
                    to: i as u32,
                    length: (node.at - start).norm(),
                    word,
                    back,
                });
            }
        }
        edges
    }
}

impl Node {
    /// Whether a shortest path that bends here may come from `other`: at a corner only along a
    /// line with all of the corner on one side.
    pub(super) fn may_bend_towards(&self, other: Point2<f64>) -> bool {
        self.corner.is_none_or(|corner| {
            let d = other - self.at;
            let side = |edge: &Vector2<f64>| {
                let (off, slack) = (d.perp(edge), 1e-9 * d.norm() + corner.slack * edge.norm());
                if off.abs() <= slack {
                    0.0
                } else {
                    off.signum()
                }
            };
            side(&corner.before) * side(&corner.after) >= 0.0
        })
    }
}

/// Points beside a corner are so many insets away from it at most.
const LONGEST: f64 = 4.0;

/// Collects nodes, without repetition.
struct Candidates<'w> {
    workspace: &'w Workspace,
    nodes: Vec<Node>,
    /// The distance of border points from their border, in map units.
    inset: f64,
    /// The largest distance between neighbouring border points, in map units.
    spacing: f64,
}

impl<'w> Candidates<'w> {
    fn collect(workspace: &'w Workspace, config: &ExactConfig, used: Props) -> Vec<Node> {
        let side = workspace.bounds().side();
        let mut all = Self {
            workspace,
            nodes: Vec::new(),
            inset: config.inset * side,
            spacing: config.spacing * side,
        };
        for obstacle in workspace.obstacles() {
            all.obstacle_corners(obstacle);
        }
        for i in used.iter() {
            all.border(&workspace.regions()[i].polygon, Props::single(i));
        }
        all.border_crossings(used);
        all.inner_points(used);
        all.nodes
    }

    /// Adds a point, unless it is not free or lies on a region's border; whether it is there now.
    fn add(&mut self, at: Point2<f64>, origin: Props, corner: Option<Corner>) -> bool {
        let Place::Free {
            letter,
            on_boundary: false,
        } = self.workspace.locate(at)
        else {
            return false;
        };
        let close = self.inset / 4.0;
        let same = |n: &&mut Node| n.letter == letter && (n.at - at).norm() < close;
        if let Some(twin) = self.nodes.iter_mut().find(same) {
            // Two reasons for one point: it serves missions that have either.
            if twin.origin.is_empty() || origin.is_empty() {
                twin.origin = Props::EMPTY;
            } else {
                twin.origin.0 |= origin.0;
            }
            if corner.is_none() || twin.corner.is_some() {
                twin.corner = None;
            }
            return true;
        }
        self.nodes.push(Node {
            at,
            letter,
            origin,
            corner,
        });
        true
    }

    fn obstacle_corners(&mut self, obstacle: &Polygon) {
        for (before, at, after) in corners(obstacle) {
            if is_convex(before, at, after) {
                let corner = Corner {
                    before: before - at,
                    after: after - at,
                    slack: 2.0 * LONGEST * self.inset,
                };
                if !self.add(at, Props::EMPTY, Some(corner)) {
                    // A region may have a corner or a side at the same place.
                    let beside = at - mitre(before, at, after) * self.inset;
                    self.add(beside, Props::EMPTY, Some(corner));
                }
            }
        }
    }

    /// Points along a region's border: inside it (to visit it) and outside (to go round it, or to
    /// leave it).
    fn border(&mut self, polygon: &Polygon, origin: Props) {
        for (before, at, after) in corners(polygon) {
            let mitre = mitre(before, at, after) * self.inset;
            self.add(at + mitre, origin, None);
            if is_convex(before, at, after) {
                let corner = Corner {
                    before: before - at,
                    after: after - at,
                    slack: 2.0 * LONGEST * self.inset,
                };
                self.add(at - mitre, origin, Some(corner));
            }
        }
        for (a, b) in polygon.edges() {
            let inward = inward_normal(a, b) * self.inset;
            let pieces = ((b - a).norm() / self.spacing).ceil().max(1.0) as usize;
            for k in 0..pieces {
                let at = a + (b - a) * ((k as f64 + 0.5) / pieces as f64);
                self.add(at + inward, origin, None);
            }
            self.add(a + (b - a) * 0.5 - inward, origin, None);
        }
    }

    /// Points in the four corners where the borders of two regions, or of a region and an
    /// obstacle, cross.
    fn border_crossings(&mut self, used: Props) {
        let regions = self.workspace.regions();
        for i in used.iter() {
            let others = regions[i + 1..]
                .iter()
                .enumerate()
                .filter(|&(k, _)| used.contains(i + 1 + k))
                .map(|(k, r)| (&r.polygon, Props::single(i).with(i + 1 + k)))
                .chain(
                    self.workspace
                        .obstacles()
                        .iter()
                        .map(|o| (o, Props::single(i))),
                );
            let found: Vec<(Crossing, Props)> = others
                .flat_map(|(other, origin)| {
                    crossings(&regions[i].polygon, other).map(move |c| (c, origin))
                })
                .collect();
            for ((p, u, v), origin) in found {
                for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                    let (u, v) = (u * s, v * t);
                    let bisector = (u + v) / (1.0 + u.dot(&v)).max(0.1);
                    self.add(p + bisector * self.inset, origin, None);
                }
            }
        }
    }

    fn inner_points(&mut self, used: Props) {
        let workspace = self.workspace;
        for letter in workspace.alphabet().letters() {
            let props = workspace.alphabet().props(letter);
            let origin = Props(props.0 & used.0);
            if origin.is_empty() && !props.is_empty() {
                continue;
            }
            for cell in workspace.cells(letter) {
                self.add(cell.inner_point(), origin, None);
            }
        }
    }
}

/// The vertices of a polygon with their neighbours along the border.
fn corners(
    polygon: &Polygon,
) -> impl Iterator<Item = (Point2<f64>, Point2<f64>, Point2<f64>)> + '_ {
    let v = polygon.vertices();
    let n = v.len();
    (0..n).map(move |i| (v[(i + n - 1) % n], v[i], v[(i + 1) % n]))
}

fn is_convex(before: Point2<f64>, at: Point2<f64>, after: Point2<f64>) -> bool {
    (at - before).perp(&(after - at)) > 0.0
}

/// From a corner to the point at distance 1 inwards from both of its edges, no longer than [`LONGEST`]
/// where the corner is sharp.
fn mitre(before: Point2<f64>, at: Point2<f64>, after: Point2<f64>) -> Vector2<f64> {
    let (u, v) = (inward_normal(before, at), inward_normal(at, after));
    let sum = (u + v) / (1.0 + u.dot(&v)).max(1e-6);
    let length = sum.norm();
    if length > LONGEST {
        sum * (LONGEST / length)
    } else {
        sum
    }
}

/// A point where two borders cross, and the crossing edges' inward normals.
type Crossing = (Point2<f64>, Vector2<f64>, Vector2<f64>);

/// Where the borders of two polygons cross.
fn crossings<'a>(first: &'a Polygon, second: &'a Polygon) -> impl Iterator<Item = Crossing> + 'a {
    let (min, max) = (second.min(), second.max());
    let apart = first.max().x < min.x
        || first.max().y < min.y
        || max.x < first.min().x
        || max.y < first.min().y;
    let edges = (!apart).then(|| first.edges()).into_iter().flatten();
    edges.flat_map(move |(a, b)| {
        second.edges().filter_map(move |(c, d)| {
            let (s, t) = ((d - c).perp(&(a - c)), (d - c).perp(&(b - c)));
            let (u, v) = ((b - a).perp(&(c - a)), (b - a).perp(&(d - a)));
            let cross = s * t < 0.0 && u * v < 0.0;
            cross.then(|| {
                (
                    a + (b - a) * (s / (s - t)),
                    inward_normal(a, b),
                    inward_normal(c, d),
                )
            })
        })
    })
}
