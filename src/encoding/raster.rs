//! The map as a tensor.

use nalgebra::Point2;

/// How far from a grid line, in cells, a coordinate still counts as lying on it.
///
/// A polygon that is aligned with the grid would otherwise leak into the neighbouring cells by
/// the rounding of its coordinates; 1e-9 of a cell is far above that and far below any feature.
const ON_LINE: f64 = 1e-9;

/// The geometry of a mission as plain data, in map units.
#[derive(Clone, Debug)]
pub struct MapInput<'a> {
    /// Lowest and highest corner of the workspace.
    pub bounds: [Point2<f64>; 2],
    /// The obstacles' outlines: simple polygons in either direction, convex or not.
    pub obstacles: Vec<&'a [Point2<f64>]>,
    /// The outlines of the regions that the formula names, in channel order.
    pub regions: Vec<&'a [Point2<f64>]>,
    /// Where the robot starts.
    pub start: Point2<f64>,
    /// Lengths of ways in map units, row by row: between the regions, and the start, which is last; empty where no network
    /// reads them. (`docs/networks.md`, Ways.)
    pub ways: Vec<f64>,
}

/// Ways count as at most so many sides of the frame; where none leads, too.
const FARTHEST: f64 = 4.0;

/// The map raster: shape (1 + regions, resolution, resolution), axes (channel, x, y), row-major.
///
/// Channel 0 is the status: −1 in the start's cell, 1 obstacle, 0 free. Channel `1 + i` marks the
/// `i`-th region with 1. A cell is marked when its open square meets the polygon's interior.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapTensor {
    /// Cells per side.
    pub resolution: usize,
    /// How many region channels there are.
    pub regions: usize,
    /// `(1 + regions) · resolution²` values.
    pub values: Vec<f32>,
    /// `(regions + 1)²` lengths in sides of the frame, the start last; none where they are not known.
    pub ways: Vec<f32>,
}

impl MapTensor {
    /// Rasterises a map. The frame is the square of the bounds' longer side at their lower-left
    /// corner; whatever of it lies outside the bounds is obstacle.
    ///
    /// Polygons with fewer than three corners mark nothing. A start outside the frame is drawn
    /// in the nearest cell.
    #[must_use]
    pub fn new(map: &MapInput<'_>, resolution: usize) -> Self {
        let mut tensor = Self::default();
        tensor.fill(map, resolution);
        tensor
    }

    /// As [`Self::new`], into the memory of another raster. With a resolution of 0 nothing is drawn.
    pub fn fill(&mut self, map: &MapInput<'_>, resolution: usize) {
        let cells = resolution * resolution;
        self.resolution = resolution;
        self.regions = map.regions.len();
        self.values.clear();
        let [low, high] = map.bounds;
        let side = (high - low).max();
        let in_sides = |&length: &f64| (length / side).min(FARTHEST) as f32;
        self.ways.clear();
        self.ways.extend(map.ways.iter().map(in_sides));
        if resolution == 0 {
            return;
        }
        let frame = Frame::new(map.bounds, resolution);
        self.values.resize((1 + map.regions.len()) * cells, 0.0);
        let mut filler = Filler::new(resolution);
        let (status, regions) = self.values.split_at_mut(cells);
        for outline in &map.obstacles {
            filler.fill(frame, outline.iter().copied(), status);
        }
        if let Some(outline) = frame.padding(map.bounds) {
            filler.fill(frame, outline.into_iter(), status);
        }
        let [u, v] = frame.to_grid(map.start);
        let last = resolution.saturating_sub(1);
        let cell = |w: f64| (w.floor().max(0.0) as usize).min(last);
        if let Some(at) = status.get_mut(cell(u) * resolution + cell(v)) {
            *at = -1.0;
        }
        for (outline, channel) in map
            .regions
            .iter()
            .zip(regions.chunks_exact_mut(cells.max(1)))
        {
            filler.fill(frame, outline.iter().copied(), channel);
        }
    }

    /// The status channel, `resolution²` values.
    #[must_use]
    pub fn status(&self) -> &[f32] {
        &self.values[..self.resolution * self.resolution]
    }

    /// The region channels, `regions · resolution²` values.
    #[must_use]
    pub fn region_channels(&self) -> &[f32] {
        &self.values[self.resolution * self.resolution..]
    }
}

/// The map between world and grid coordinates.
#[derive(Clone, Copy)]
struct Frame {
    origin: Point2<f64>,
    per_unit: f64,
}

impl Frame {
    fn new([low, high]: [Point2<f64>; 2], resolution: usize) -> Self {
        let side = (high.x - low.x).max(high.y - low.y);
        Self {
            origin: low,
            per_unit: resolution as f64 / side,
        }
    }

    /// Grid coordinates, with values next to a grid line put onto it.
    fn to_grid(self, p: Point2<f64>) -> [f64; 2] {
        [
            (p.x - self.origin.x) * self.per_unit,
            (p.y - self.origin.y) * self.per_unit,
        ]
        .map(|w| {
            let line = w.round();
            if (w - line).abs() <= ON_LINE { line } else { w }
        })
    }

    /// The part of the square frame that lies outside the bounds, as an outline if there is any.
    fn padding(self, [low, high]: [Point2<f64>; 2]) -> Option<[Point2<f64>; 4]> {
        let (width, height) = (high.x - low.x, high.y - low.y);
        let side = width.max(height);
        // One cell wider than the frame, so that rounding of its far edge cannot open a gap.
        let far = side + 1.0 / self.per_unit;
        let (a, b) = if width < side {
            ([width, 0.0], [far, side])
        } else if height < side {
            ([0.0, height], [side, far])
        } else {
            return None;
        };
        let at = |x: f64, y: f64| Point2::new(low.x + x, low.y + y);
        Some([
            at(a[0], a[1]),
            at(b[0], a[1]),
            at(b[0], b[1]),
            at(a[0], b[1]),
        ])
    }
}

/// Marks the cells that polygons meet; keeps its scratch memory between polygons.
///
/// An open cell meets a polygon's interior exactly when a part of the outline runs through the
/// cell, or none does and the cell's centre is inside. So the outline's edges are walked column
/// by column, and the rest is filled by the even-odd rule along the columns' centre lines.
struct Filler {
    side: usize,
    crossings: Vec<(usize, f64)>,
    corners: Vec<[f64; 2]>,
}

impl Filler {
    fn new(side: usize) -> Self {
        Self {
            side,
            crossings: Vec::new(),
            corners: Vec::new(),
        }
    }

    fn fill(
        &mut self,
        frame: Frame,
        outline: impl Iterator<Item = Point2<f64>>,
        channel: &mut [f32],
    ) {
        self.corners.clear();
        self.corners.extend(outline.map(|p| frame.to_grid(p)));
        self.crossings.clear();
        if self.corners.len() < 3 || self.corners.iter().flatten().any(|w| !w.is_finite()) {
            return;
        }
        let mut from = self.corners[self.corners.len() - 1];
        for k in 0..self.corners.len() {
            let to = self.corners[k];
            // Both directions of an edge must give the same numbers.
            let (a, b) = if from <= to { (from, to) } else { (to, from) };
            self.walk(a, b, channel);
            from = to;
        }
        self.fill_inside(channel);
    }

    /// Marks the cells that the edge from `a` to `b` (`a.x <= b.x`) runs through, and notes where
    /// it crosses the columns' centre lines.
    fn walk(&mut self, a: [f64; 2], b: [f64; 2], channel: &mut [f32]) {
        let slope = if b[0] > a[0] {
            (b[1] - a[1]) / (b[0] - a[0])
        } else {
            0.0
        };
        let at = |u: f64| {
            if u <= a[0] {
                a[1]
            } else if u >= b[0] {
                b[1]
            } else {
                a[1] + (u - a[0]) * slope
            }
        };
        for i in cells_met(a[0], b[0], self.side) {
            let left = i as f64;
            // An edge within one column keeps its own ends: a vertical one has no slope.
            let (v0, v1) = if a[0] >= left && b[0] <= left + 1.0 {
                (a[1], b[1])
            } else {
                (at(left), at(left + 1.0))
            };
            for j in cells_met(v0.min(v1), v0.max(v1), self.side) {
                channel[i * self.side + j] = 1.0;
            }
        }
        let centre = |u: f64| ((u - 0.5).ceil().max(0.0) as usize).min(self.side);
        for i in centre(a[0])..centre(b[0]) {
            self.crossings.push((i, at(i as f64 + 0.5)));
        }
    }

    /// Marks the cells whose centres are inside, from the crossings of [`Self::walk`].
    fn fill_inside(&mut self, channel: &mut [f32]) {
        self.crossings
            .sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        for pair in self.crossings.chunks_exact(2) {
            let (i, from, to) = (pair[0].0, pair[0].1, pair[1].1);
            let first = ((from - 0.5).ceil().max(0.0) as usize).min(self.side);
            let end = ((to - 0.5).floor() + 1.0).max(0.0) as usize;
            let end = end.clamp(first, self.side);
            channel[i * self.side + first..i * self.side + end].fill(1.0);
        }
    }
}

/// The cells of one axis whose open interval `(i, i + 1)` meets the interval from `low` to `high`;
/// a single point counts unless it lies on a grid line.
fn cells_met(low: f64, high: f64, side: usize) -> std::ops::Range<usize> {
    let first = (low + ON_LINE).floor().max(0.0) as usize;
    let end = (high - ON_LINE).ceil().max(0.0) as usize;
    first..end.min(side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(xy: &[(f64, f64)]) -> Vec<Point2<f64>> {
        xy.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    fn raster(high: (f64, f64), resolution: usize, obstacle: &[(f64, f64)]) -> MapTensor {
        let outline = points(obstacle);
        let map = MapInput {
            bounds: [Point2::origin(), Point2::new(high.0, high.1)],
            obstacles: vec![&outline],
            regions: Vec::new(),
            start: Point2::origin(),
            ways: Vec::new(),
        };
        MapTensor::new(&map, resolution)
    }

    fn marked(t: &MapTensor) -> Vec<(usize, usize)> {
        let r = t.resolution;
        (0..r * r)
            .filter(|&k| t.values[k] == 1.0)
            .map(|k| (k / r, k % r))
            .collect()
    }

    #[test]
    fn aligned_polygons_do_not_leak() {
        // 0.1 has no exact binary form: the corners are off the grid lines by an ulp or so.
        let t = raster(
            (1.0, 1.0),
            10,
            &[(0.3, 0.6), (0.7, 0.6), (0.7, 0.9), (0.3, 0.9)],
        );
        let expected: Vec<_> = (3..7).flat_map(|i| (6..9).map(move |j| (i, j))).collect();
        assert_eq!(marked(&t), expected);
    }

    #[test]
    fn every_touched_cell_is_marked() {
        let t = raster(
            (1.0, 1.0),
            10,
            &[(0.31, 0.61), (0.32, 0.61), (0.32, 0.62), (0.31, 0.62)],
        );
        assert_eq!(marked(&t), [(3, 6)]);
        // The diagonal through lattice points meets the cells below and on it, not those beside.
        let t = raster((4.0, 4.0), 4, &[(1.0, 0.0), (4.0, 0.0), (4.0, 3.0)]);
        assert_eq!(marked(&t), [(1, 0), (2, 0), (2, 1), (3, 0), (3, 1), (3, 2)]);
    }

    #[test]
    fn concave_outlines_keep_their_notch() {
        let u = [
            (0.0, 0.0),
            (5.0, 0.0),
            (5.0, 5.0),
            (4.0, 5.0),
            (4.0, 1.0),
            (1.0, 1.0),
            (1.0, 5.0),
            (0.0, 5.0),
        ];
        let t = raster((5.0, 5.0), 5, &u);
        assert!(!marked(&t).contains(&(2, 3)));
        assert_eq!(marked(&t).len(), 5 + 4 + 4 - 1); // the start took (0, 0)
    }

    #[test]
    fn padding_is_obstacle_and_start_wins() {
        let t = raster((4.0, 2.0), 4, &[]);
        let expected: Vec<_> = (0..4).flat_map(|i| (2..4).map(move |j| (i, j))).collect();
        assert_eq!(marked(&t), expected);
        assert_eq!(t.values[0], -1.0);
        let t = raster((2.0, 4.0), 4, &[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]);
        assert_eq!(t.values[0], -1.0);
        assert_eq!(marked(&t).len(), 8);
    }

    #[test]
    fn regions_follow_the_status_in_order() {
        let (a, b) = (
            points(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]),
            points(&[(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)]),
        );
        let map = MapInput {
            bounds: [Point2::origin(), Point2::new(2.0, 2.0)],
            obstacles: Vec::new(),
            regions: vec![&a, &b],
            start: Point2::new(1.5, 0.5),
            ways: Vec::new(),
        };
        let t = MapTensor::new(&map, 2);
        assert_eq!(
            t.values,
            [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
        );
    }

    /// Whether an open cell meets a convex polygon, by separating axes.
    fn meets_convex(cell: (usize, usize), polygon: &[Point2<f64>]) -> Option<bool> {
        let (i, j) = (cell.0 as f64, cell.1 as f64);
        let corners = points(&[(i, j), (i + 1.0, j), (i + 1.0, j + 1.0), (i, j + 1.0)]);
        let mut gap = f64::NEG_INFINITY;
        let edges = polygon
            .iter()
            .zip(polygon.iter().cycle().skip(1))
            .map(|(a, b)| b - a);
        let normals = edges.map(|d| nalgebra::Vector2::new(d.y, -d.x).normalize());
        for n in normals.chain([nalgebra::Vector2::x(), nalgebra::Vector2::y()]) {
            let span = |ps: &[Point2<f64>]| {
                ps.iter()
                    .map(|p| p.coords.dot(&n))
                    .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)))
            };
            let ((a0, a1), (b0, b1)) = (span(&corners), span(polygon));
            gap = gap.max(b0 - a1).max(a0 - b1);
        }
        (gap.abs() > 1e-6).then_some(gap < 0.0)
    }

    proptest! {
        #[test]
        fn agrees_with_separating_axes(xy in prop::collection::vec((-2.0f64..18.0, -2.0f64..18.0), 3)) {
            let triangle = points(&xy);
            let area = (triangle[1] - triangle[0]).perp(&(triangle[2] - triangle[0]));
            prop_assume!(area.abs() > 0.01);
            let t = raster((16.0, 16.0), 16, &xy);
            for k in 1..256 {
                if let Some(expected) = meets_convex((k / 16, k % 16), &triangle) {
                    prop_assert_eq!(t.values[k] == 1.0, expected, "cell {:?}", (k / 16, k % 16));
                }
            }
        }

        #[test]
        fn never_panics(xy in prop::collection::vec((any::<f64>(), any::<f64>()), 0..8), high in (any::<f64>(), any::<f64>())) {
            raster(high, 9, &xy);
        }
    }
}
