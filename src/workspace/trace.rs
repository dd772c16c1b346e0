//! What a straight segment meets: obstacles, and one letter after another.

use nalgebra::{Point2, Vector2};
use smallvec::SmallVec;

use super::index::PolygonIndex;
use super::{Place, Side, Workspace};
use crate::alphabet::{Letter, LetterSet, Props};

/// A piece of a segment along which the letter stays the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Where the piece begins: 0 at the segment's first end, 1 at its last.
    pub start: f64,
    /// The letter along it.
    pub letter: Letter,
}

/// Where a segment cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocked {
    /// The obstacle in the way; `None` if the segment leaves the bounds.
    pub by: Option<usize>,
    /// A point of the segment that is not free.
    pub at: Point2<f64>,
}

/// A crossing or touch of the segment with a polygon's border, as (polygon, parameter in [0, 1]).
type Events = SmallVec<[(u32, f64); 48]>;

/// The segment under test: parameters 0 to 1 run from `a` to `b`.
struct Segment {
    a: Point2<f64>,
    b: Point2<f64>,
    length: f64,
    normal: Vector2<f64>,
}

impl Segment {
    fn new(a: Point2<f64>, b: Point2<f64>) -> Self {
        let d = b - a;
        let length = d.norm();
        let normal = Vector2::new(-d.y, d.x) / length;
        Self {
            a,
            b,
            length,
            normal,
        }
    }

    fn at(&self, t: f64) -> Point2<f64> {
        self.a + (self.b - self.a) * t
    }

    /// A point of the segment just behind the edge `pq` of a polygon, on the inner side, where the two
    /// cross well apart from the ends of the edge.
    fn behind(&self, p: Point2<f64>, q: Point2<f64>, tolerance: f64) -> Option<Point2<f64>> {
        let (dp, dq) = (
            self.normal.dot(&(p - self.a)),
            self.normal.dot(&(q - self.a)),
        );
        let margin = 4.0 * tolerance;
        if dp.min(dq) > -margin || dp.max(dq) < margin {
            return None;
        }
        let cross = p + (q - p) * (dp / (dp - dq));
        let along = self.b - self.a;
        let t = (cross - self.a).dot(&along) / (self.length * self.length);
        // Counter-clockwise, the inner side of an edge lies to its left.
        let off = margin / self.length;
        let t = if dp > 0.0 { t + off } else { t - off };
        (0.0..=1.0).contains(&t).then(|| self.at(t))
    }

    /// The parameters at which the edge `pq` crosses or touches the segment (within `tolerance`).
    fn meets(&self, p: Point2<f64>, q: Point2<f64>, tolerance: f64) -> SmallVec<[f64; 3]> {
        let mut found = SmallVec::new();
        let (dp, dq) = (
            self.normal.dot(&(p - self.a)),
            self.normal.dot(&(q - self.a)),
        );
        if (dp > tolerance && dq > tolerance) || (dp < -tolerance && dq < -tolerance) {
            return found;
        }
        let along =
            |x: Point2<f64>| (x - self.a).dot(&(self.b - self.a)) / (self.length * self.length);
        let slack = tolerance / self.length;
        let mut push = |t: f64| {
            if t >= -slack && t <= 1.0 + slack {
                found.push(t.clamp(0.0, 1.0));
            }
        };
        if dp.abs() <= tolerance {
            push(along(p));
        }
        if dq.abs() <= tolerance {
            push(along(q));
        }
        if (dp < 0.0) != (dq < 0.0) && dp != dq {
            push(along(p + (q - p) * (dp / (dp - dq))));
        }
        found
    }
}

impl Workspace {
    /// Whether the closed segment `ab` stays within the bounds and out of every obstacle.
    #[must_use]
    pub fn is_free_segment(&self, a: Point2<f64>, b: Point2<f64>) -> bool {
        let is_free = |at| free(at, self.locate(at)).is_ok();
        is_free(a) && is_free(b) && self.obstruction(a, b).is_none()
    }

    /// As [`Self::is_free_segment`], for ends that are known to be free.
    #[must_use]
    pub(crate) fn is_free_between(&self, a: Point2<f64>, b: Point2<f64>) -> bool {
        !self.is_obstructed(a, b)
    }

    /// The letters along the segment `ab`, in order, neighbours different. A letter counts where
    /// it holds over positive length: touched borders and corners make none. Along a border it is that of one side: of the free one,
    /// or of that with the fewest regions. That of an end
    /// that lies off all borders counts, however thin the region is there. A segment of no length
    /// has the one letter of its point.
    ///
    /// # Errors
    /// The first obstacle found in the way, or that the segment leaves the bounds.
    pub fn trace(&self, a: Point2<f64>, b: Point2<f64>) -> Result<Vec<Stretch>, Blocked> {
        let ends = [(a, self.locate(a)), (b, self.locate(b))];
        Ok(self.trace_located(ends)?.into_vec())
    }

    /// As [`Self::trace`], for ends of which it is known what is there.
    pub(crate) fn trace_located(
        &self,
        ends: [(Point2<f64>, Place); 2],
    ) -> Result<SmallVec<[Stretch; 4]>, Blocked> {
        let [from, to] = ends.map(|(at, place)| free(at, place));
        let ((base, from), (_, to)) = (from?, to?);
        let [(a, _), (b, _)] = ends;
        if let Some(blocked) = self.obstruction(a, b) {
            return Err(blocked);
        }
        let mut found = self.stretches(a, b, base)?;
        let length = (b - a).norm();
        if length > self.tolerance {
            // Pieces too short to tell from rounding are left out, but not those at ends.
            let share = self.tolerance / length;
            if let Some(letter) = from.filter(|&l| found[0].letter != l) {
                found[0].start = share;
                found.insert(0, Stretch { start: 0.0, letter });
            }
            if let Some(letter) = to.filter(|&l| found[found.len() - 1].letter != l) {
                let start = 1.0 - share;
                found.push(Stretch { start, letter });
            }
        }
        Ok(found)
    }

    /// The transition relation of the paper (`nngtl.md`, II-A): the segment `ab` meets no
    /// obstacle and the letter changes at most once from `a` to `b`, ends included.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use nngtl::workspace::{Bounds, Polygon, Region, Workspace};
    /// let strip = Polygon::rectangle(Point2::new(0.4, 0.0), Point2::new(0.6, 1.0))?;
    /// let regions = vec![Region { name: "strip".into(), polygon: strip }];
    /// let map = Workspace::new(Bounds::unit(), vec![], regions)?;
    /// let (west, mid, east) = (Point2::new(0.1, 0.5), Point2::new(0.5, 0.5), Point2::new(0.9, 0.5));
    /// assert!(map.step(west, mid) && map.step(mid, east));
    /// assert!(!map.step(west, east)); // in and out again: two changes
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn step(&self, a: Point2<f64>, b: Point2<f64>) -> bool {
        match (self.letter_at(a), self.letter_at(b)) {
            (Some(from), Some(to)) => self.step_between(a, from, b, to),
            _ => false,
        }
    }

    /// As [`Self::step`], for ends that are known to be free and to carry these letters.
    #[must_use]
    pub(crate) fn step_between(
        &self,
        a: Point2<f64>,
        from: Letter,
        b: Point2<f64>,
        to: Letter,
    ) -> bool {
        if self.is_obstructed(a, b) {
            return false;
        }
        let Ok(stretches) = self.stretches(a, b, from) else {
            return false;
        };
        let mut changes = 0;
        let mut last = from;
        for letter in stretches.iter().map(|s| s.letter).chain([to]) {
            changes += usize::from(letter != last);
            last = letter;
        }
        changes <= 1
    }

    /// Whether the segment `ab` is free and meets letters of a set alone; its ends are known to be free.
    #[must_use]
    pub(crate) fn passes(&self, a: Point2<f64>, b: Point2<f64>, through: &LetterSet) -> bool {
        let from = self.letter_at(a).filter(|_| !self.is_obstructed(a, b));
        from.is_some_and(|from| self.meets_only(a, b, from, through))
    }

    /// Whether the segment `ab`, which is free, meets letters of a set alone.
    #[must_use]
    pub(crate) fn keeps_to(&self, a: Point2<f64>, b: Point2<f64>, through: &LetterSet) -> bool {
        let from = self.letter_at(a);
        from.is_some_and(|from| self.meets_only(a, b, from, through))
    }

    fn meets_only(
        &self,
        a: Point2<f64>,
        b: Point2<f64>,
        from: Letter,
        through: &LetterSet,
    ) -> bool {
        let stretches = self.stretches(a, b, from);
        stretches.is_ok_and(|found| found.iter().all(|s| through.contains(s.letter)))
    }

    /// The part of the segment `ab` along which the letter has changed once, if it changes again before `b`: as parameters
    /// from 0 at `a` to 1 at `b`. Ends as for [`Self::step_between`].
    #[must_use]
    pub(crate) fn second_letter(
        &self,
        a: Point2<f64>,
        from: Letter,
        b: Point2<f64>,
        to: Letter,
    ) -> Option<[f64; 2]> {
        let stretches = self.stretches(a, b, from).ok()?;
        let end = [Stretch {
            start: 1.0,
            letter: to,
        }];
        let mut rest = stretches
            .iter()
            .chain(&end)
            .skip_while(|s| s.letter == from);
        let second = rest.next()?;
        let third = rest.find(|s| s.letter != second.letter)?;
        Some([second.start, third.start])
    }

    /// The letters along the segment `ab`, without repetition of one that lasts. Ends as for [`Self::step_between`];
    /// obstacles are not looked at.
    #[must_use]
    pub(crate) fn letters_along(
        &self,
        a: Point2<f64>,
        from: Letter,
        b: Point2<f64>,
        to: Letter,
    ) -> Option<SmallVec<[Letter; 8]>> {
        let stretches = self.stretches(a, b, from).ok()?;
        let mut letters = SmallVec::from_slice(&[from]);
        letters.extend(stretches.iter().map(|s| s.letter).chain([to]));
        letters.dedup();
        Some(letters)
    }

    /// Where on the segment `ab` the letter of `b` begins that lasts to its end, as a parameter from 0 at `a` to 1 at `b`. Ends
    /// as for [`Self::step_between`]; `None` where obstacles are in the way.
    #[must_use]
    pub(crate) fn entry(
        &self,
        a: Point2<f64>,
        from: Letter,
        b: Point2<f64>,
        to: Letter,
    ) -> Option<f64> {
        let stretches = self.stretches(a, b, from).ok()?;
        let last = stretches.last()?;
        Some(if last.letter == to { last.start } else { 1.0 })
    }

    /// Whether [`Self::obstruction`] finds something. Most segments that are blocked run right into an
    /// obstacle; the first that is met so ends the search.
    fn is_obstructed(&self, a: Point2<f64>, b: Point2<f64>) -> bool {
        let segment = Segment::new(a, b);
        if segment.length <= self.tolerance {
            return false;
        }
        let mut met = false;
        let hit = self.obstacle_index.edges_near(a, b, |edge| {
            met = true;
            let p = segment.behind(edge.from, edge.to, self.tolerance)?;
            (self.obstacle_side(edge.polygon as usize, p) == Side::Inside).then_some(())
        });
        hit.is_some() || met && self.obstruction(a, b).is_some()
    }

    /// Where an obstacle is in the way between two free points. The bounds are convex, so free
    /// ends suffice for them.
    fn obstruction(&self, a: Point2<f64>, b: Point2<f64>) -> Option<Blocked> {
        let segment = Segment::new(a, b);
        if segment.length <= self.tolerance {
            return None;
        }
        let events = events_along(&self.obstacle_index, &segment, self.tolerance);
        let mut blocked = None;
        for_each_interval(&events, &segment, self.tolerance, |polygon, from, to| {
            if blocked.is_none() {
                blocked = self.blocked_on(&segment, polygon as usize, [from, to], &events);
            }
        });
        blocked
    }

    /// Whether the piece of `segment` between two events of `polygon` runs inside it, or along its
    /// border with another obstacle or the end of the map on the other side: what shares a border
    /// leaves no gap.
    fn blocked_on(
        &self,
        segment: &Segment,
        polygon: usize,
        [from, to]: [f64; 2],
        events: &Events,
    ) -> Option<Blocked> {
        let blocked = |at| {
            let by = Some(polygon);
            Some(Blocked { by, at })
        };
        let middle = segment.at((from + to) / 2.0);
        match self.obstacle_side(polygon, middle) {
            Side::Inside => blocked(middle),
            Side::Outside => None,
            Side::Boundary => {
                // The other side may change wherever another border is met.
                let mut cuts: SmallVec<[f64; 16]> = events.iter().map(|&(_, t)| t).collect();
                cuts.retain(|t| from < *t && *t < to);
                cuts.extend([from, to]);
                cuts.sort_unstable_by(f64::total_cmp);
                let off = segment.normal * self.beside();
                let solid = |p| !self.bounds.contains(p) || self.obstacle_at(p).is_some();
                cuts.windows(2)
                    .filter(|w| (w[1] - w[0]) * segment.length > 2.0 * self.tolerance)
                    .map(|w| segment.at((w[0] + w[1]) / 2.0))
                    .find(|&p| solid(p + off) && solid(p - off))
                    .and_then(blocked)
            }
        }
    }

    /// What a robot sees that moves along borders, at a place of its way: `props`, which hold off these borders, if so it is on one
    /// side, otherwise what is on either side, the least of that. A border that a region shares with a wall or with another region is
    /// no gap between them.
    fn props_beside(&self, segment: &Segment, at: Point2<f64>, props: Props) -> Props {
        let off = segment.normal * self.beside();
        let sides = [at + off, at - off].map(|p| self.props_off_borders(p));
        let free = sides.into_iter().flatten();
        let least = free.min_by_key(|&p| (p != props, p.iter().count(), p.0));
        least.unwrap_or(props)
    }

    /// The letters along a free segment whose first end carries `from`.
    fn stretches(
        &self,
        a: Point2<f64>,
        b: Point2<f64>,
        from: Letter,
    ) -> Result<SmallVec<[Stretch; 4]>, Blocked> {
        let segment = Segment::new(a, b);
        let mut found = SmallVec::new();
        let first = Stretch {
            start: 0.0,
            letter: from,
        };
        if segment.length <= self.tolerance {
            found.push(first);
            return Ok(found);
        }
        let events = events_along(&self.region_index, &segment, self.tolerance);
        if events.is_empty() {
            found.push(first);
            return Ok(found);
        }
        // Regions whose border is not met contain all of the segment or nothing of it.
        let mut base = self.alphabet.props(from);
        let mut inside: SmallVec<[(usize, f64, f64); 8]> = SmallVec::new();
        // Where the segment runs along borders.
        let mut along: SmallVec<[(f64, f64); 4]> = SmallVec::new();
        let mut cuts: SmallVec<[f64; 16]> = SmallVec::from_slice(&[0.0, 1.0]);
        for &(polygon, _) in &events {
            base.0 &= !(1 << polygon);
        }
        for_each_interval(&events, &segment, self.tolerance, |polygon, from, to| {
            let polygon = polygon as usize;
            let middle = segment.at((from + to) / 2.0);
            match self.region_side(polygon, middle) {
                Side::Inside => {
                    inside.push((polygon, from, to));
                    cuts.extend([from, to]);
                }
                Side::Boundary => {
                    along.push((from, to));
                    cuts.extend([from, to]);
                }
                Side::Outside => {}
            }
        });
        if !along.is_empty() {
            // What is beside a border changes where any other is met.
            let walls = events_along(&self.obstacle_index, &segment, self.tolerance);
            cuts.extend(walls.iter().chain(&events).map(|&(_, t)| t));
        }
        cuts.sort_unstable_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            // Borders that coincide up to rounding leave slivers between their events.
            if (pair[1] - pair[0]) * segment.length <= 4.0 * self.tolerance {
                continue;
            }
            let middle = (pair[0] + pair[1]) / 2.0;
            let props = inside
                .iter()
                .filter(|&&(_, from, to)| from < middle && middle < to)
                .fold(base, |props: Props, &(i, ..)| props.with(i));
            let on_border = along.iter().any(|&(from, to)| from < middle && middle < to);
            let props = match on_border {
                true => self.props_beside(&segment, segment.at(middle), props),
                false => props,
            };
            let letter = self.alphabet.letter(props).ok_or(Blocked {
                by: None,
                at: segment.at(middle),
            })?;
            if found.last().is_none_or(|s: &Stretch| s.letter != letter) {
                found.push(Stretch {
                    start: pair[0],
                    letter,
                });
            }
        }
        if found.is_empty() {
            found.push(first);
        }
        Ok(found)
    }
}

/// The letter of a free place, and the same if the place lies off all borders.
fn free(at: Point2<f64>, place: Place) -> Result<(Letter, Option<Letter>), Blocked> {
    match place {
        Place::Outside => Err(Blocked { by: None, at }),
        Place::Obstacle(i) => Err(Blocked { by: Some(i), at }),
        Place::Free {
            letter,
            on_boundary,
        } => Ok((letter, (!on_boundary).then_some(letter))),
    }
}

/// All meetings of the segment with the edges of an index, sorted by polygon and parameter.
fn events_along(index: &PolygonIndex, segment: &Segment, tolerance: f64) -> Events {
    let mut events = Events::new();
    index.edges_near(segment.a, segment.b, |edge| {
        for t in segment.meets(edge.from, edge.to, tolerance) {
            events.push((edge.polygon, t));
        }
        None::<()>
    });
    if events.len() > 1 {
        events.sort_unstable_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)));
    }
    events
}

/// Calls `visit(polygon, from, to)` for each piece of the segment between neighbouring events of
/// one polygon (ends of the segment included) that is longer than the tolerance.
fn for_each_interval(
    events: &Events,
    segment: &Segment,
    tolerance: f64,
    mut visit: impl FnMut(u32, f64, f64),
) {
    for group in events.chunk_by(|x, y| x.0 == y.0) {
        let polygon = group[0].0;
        let mut from = 0.0;
        for to in group.iter().map(|&(_, t)| t).chain([1.0]) {
            if (to - from) * segment.length > 2.0 * tolerance {
                visit(polygon, from, to);
                from = to;
            }
        }
    }
}
