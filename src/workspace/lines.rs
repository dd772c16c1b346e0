//! The borders of obstacles and bounds as straight lines that meet at common points only.
//!
//! Borders may overlap, cross, and touch up to rounding. Points closer than the snapping distance
//! become one, lines run through every point that close to them, and crossings become points: the
//! idea of snap rounding (J. D. Hobby, "Practical segment intersection with finite precision output",
//! 1999), with the tolerance of the map in the place of a pixel.

use nalgebra::Point2;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::index::BoxIndex;
use super::{Bounds, Polygon};

/// Lines between numbered points; no two share more than an end.
pub(super) struct Lines {
    pub(super) points: Points,
    /// Each once, lower number first, sorted.
    pub(super) edges: Vec<[u32; 2]>,
}

/// Points no two of which are closer than a snapping distance.
#[derive(Clone, Debug)]
pub(super) struct Points {
    pub(super) at: Vec<Point2<f64>>,
    buckets: FxHashMap<[i64; 2], SmallVec<[u32; 2]>>,
    snap: f64,
}

impl Points {
    pub(super) fn new(snap: f64) -> Self {
        Self {
            at: Vec::new(),
            buckets: FxHashMap::default(),
            snap,
        }
    }

    fn bucket(&self, p: Point2<f64>) -> [i64; 2] {
        let cell = |x: f64| (x / (2.0 * self.snap)).floor() as i64;
        [cell(p.x), cell(p.y)]
    }

    /// The point within the snapping distance of `p`, if there is one; the nearest of several.
    pub(super) fn find(&self, p: Point2<f64>) -> Option<u32> {
        // Four buckets at most; a little more than the distance, since rounding must not hide one.
        let reach = nalgebra::Vector2::repeat(1.01 * self.snap);
        let ([x0, y0], [x1, y1]) = (self.bucket(p - reach), self.bucket(p + reach));
        let around = (x0..=x1).flat_map(|x| (y0..=y1).map(move |y| [x, y]));
        let distance = |&i: &u32| (self.at[i as usize] - p).norm_squared();
        around
            .filter_map(|key| self.buckets.get(&key))
            .flatten()
            .copied()
            .filter(|i| distance(i) <= self.snap * self.snap)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
    }

    /// The number of `p`, or of the point that it snaps to.
    pub(super) fn add(&mut self, p: Point2<f64>) -> u32 {
        if let Some(known) = self.find(p) {
            return known;
        }
        let number = self.at.len() as u32;
        // The triangulation refuses numbers too small to be multiplied.
        let plain = |x: f64| if x.abs() < 1e-30 { 0.0 } else { x };
        self.at.push(Point2::new(plain(p.x), plain(p.y)));
        self.buckets.entry(self.bucket(p)).or_default().push(number);
        number
    }
}

/// Arranges the borders of the bounds and of the polygons, as far as they lie in the bounds.
pub(super) fn arrange<'a>(
    bounds: &Bounds,
    polygons: impl Iterator<Item = &'a Polygon>,
    snap: f64,
) -> Lines {
    let mut points = Points::new(snap);
    let (min, max) = (bounds.min, bounds.max);
    let corners = [
        min,
        Point2::new(max.x, min.y),
        max,
        Point2::new(min.x, max.y),
    ]
    .map(|p| points.add(p));
    let mut lines: Vec<[u32; 2]> = (0..4).map(|i| [corners[i], corners[(i + 1) % 4]]).collect();
    for (a, b) in polygons.flat_map(Polygon::edges) {
        if let Some((a, b)) = clip(bounds, a, b) {
            let ends = [points.add(a), points.add(b)];
            lines.push([ends[0].min(ends[1]), ends[0].max(ends[1])]);
        }
    }
    lines.retain(|[a, b]| a != b);
    lines.sort_unstable();
    lines.dedup();
    let splits = splits(&lines, &mut points);
    let mut edges = Vec::with_capacity(lines.len());
    for (&[a, b], mut on) in lines.iter().zip(splits) {
        on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut from = a;
        for to in on.into_iter().map(|(_, i)| i).chain([b]) {
            if from != to {
                edges.push([from.min(to), from.max(to)]);
                from = to;
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    Lines { points, edges }
}

/// For each line the points that divide it, with their place along it.
fn splits(lines: &[[u32; 2]], points: &mut Points) -> Vec<SmallVec<[(f64, u32); 2]>> {
    let ends = |i: usize, points: &Points| lines[i].map(|p| points.at[p as usize]);
    let boxes: Vec<_> = (0..lines.len())
        .map(|i| {
            let [a, b] = ends(i, points);
            (a.inf(&b), a.sup(&b))
        })
        .collect();
    let index = BoxIndex::new(boxes.into_iter(), points.snap);
    let mut splits: Vec<SmallVec<[(f64, u32); 2]>> = vec![SmallVec::new(); lines.len()];
    let touch = |splits: &mut Vec<SmallVec<[(f64, u32); 2]>>, points: &Points, w: u32| {
        let p = points.at[w as usize];
        for i in index.at(p) {
            let [a, b] = ends(i, points);
            let t = (p - a).dot(&(b - a)) / (b - a).norm_squared();
            let near = (a + (b - a) * t - p).norm() <= points.snap;
            if near && t > 0.0 && t < 1.0 && !lines[i].contains(&w) {
                splits[i].push((t, w));
            }
        }
    };
    for w in 0..points.at.len() as u32 {
        touch(&mut splits, points, w);
    }
    let first_new = points.at.len() as u32;
    for i in 0..lines.len() {
        let [a, b] = ends(i, points);
        for j in index.near(a, b).filter(|&j| j > i) {
            let [c, d] = ends(j, points);
            if let Some(p) = crossing(a, b, c, d) {
                let w = points.add(p);
                // A crossing at a known point is where a line runs through it already.
                if w < first_new {
                    touch(&mut splits, points, w);
                }
            }
        }
    }
    for w in first_new..points.at.len() as u32 {
        touch(&mut splits, points, w);
    }
    for on in &mut splits {
        on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        on.dedup_by_key(|s| s.1);
    }
    splits
}

/// Where two segments cross, each from one side of the other to the other side.
fn crossing(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>, d: Point2<f64>) -> Option<Point2<f64>> {
    let (s, t) = ((b - a).perp(&(c - a)), (b - a).perp(&(d - a)));
    let (u, v) = ((d - c).perp(&(a - c)), (d - c).perp(&(b - c)));
    (s * t < 0.0 && u * v < 0.0).then(|| c + (d - c) * (s / (s - t)))
}

/// The part of a segment within the bounds (Liang and Barsky's clipping); `None` if there is none.
fn clip(bounds: &Bounds, a: Point2<f64>, b: Point2<f64>) -> Option<(Point2<f64>, Point2<f64>)> {
    if bounds.contains(a) && bounds.contains(b) {
        return Some((a, b));
    }
    let d = b - a;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let (mut first, mut last) = (a, b);
    for axis in 0..2 {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        if d[axis] == 0.0 {
            if a[axis] < low || a[axis] > high {
                return None;
            }
            continue;
        }
        let (near, far) = if d[axis] > 0.0 {
            (low, high)
        } else {
            (high, low)
        };
        let (s, t) = ((near - a[axis]) / d[axis], (far - a[axis]) / d[axis]);
        if s > enter {
            enter = s;
            first = a + d * s;
            first[axis] = near;
        }
        if t < leave {
            leave = t;
            last = a + d * t;
            last[axis] = far;
        }
    }
    (enter <= leave).then(|| (bounds.clip(first), bounds.clip(last)))
}
