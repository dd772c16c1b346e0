//! Where a point lies with respect to a polygon of many vertices.

use nalgebra::Point2;

use super::polygon::side_of_edges;
use super::{Polygon, Side};

/// Polygons with fewer vertices are tested edge by edge.
const MIN_VERTICES: usize = 48;

/// More bands than this make no difference that can be measured.
const MAX_BANDS: usize = 1024;

/// The edges of a polygon in horizontal bands: a point is tested against those of its band.
#[derive(Clone, Debug)]
pub(super) struct Bands {
    low: f64,
    height: f64,
    /// The edges of each band by the number of their last vertex: `edges[first[b]..first[b + 1]]`,
    /// those that reach furthest to the right first.
    first: Vec<u32>,
    edges: Vec<u32>,
}

impl Bands {
    /// Sorts the edges of a polygon into bands; `None` if it has few.
    pub(super) fn new(polygon: &Polygon, tolerance: f64) -> Option<Self> {
        let v = polygon.vertices();
        let n = v.len();
        if n < MIN_VERTICES {
            return None;
        }
        let count = (n / 4).min(MAX_BANDS);
        let low = polygon.min().y;
        let height = (polygon.max().y - low) / count as f64;
        let mut bands = Self {
            low,
            height,
            first: Vec::new(),
            edges: Vec::new(),
        };
        let mut rows: Vec<Vec<u32>> = vec![Vec::new(); count];
        // Rounding may put a point into the band next to its own.
        let margin = 2.0 * tolerance + 1e-9 * height;
        for i in 0..n {
            let (a, b) = edge(v, i as u32);
            let from = bands.band(a.y.min(b.y) - margin, count);
            let to = bands.band(a.y.max(b.y) + margin, count);
            for row in &mut rows[from..=to] {
                row.push(i as u32);
            }
        }
        let reach = |i: u32| {
            let (a, b) = edge(v, i);
            a.x.max(b.x)
        };
        bands.first.push(0);
        for mut row in rows {
            row.sort_by(|&i, &j| reach(j).total_cmp(&reach(i)));
            bands.edges.extend(row);
            bands.first.push(bands.edges.len() as u32);
        }
        Some(bands)
    }

    fn band(&self, y: f64, count: usize) -> usize {
        (((y - self.low) / self.height).max(0.0) as usize).min(count - 1)
    }

    /// As [`Polygon::side_of`]; `tolerance` is at most that of [`Self::new`].
    pub(super) fn side_of(&self, polygon: &Polygon, p: Point2<f64>, tolerance: f64) -> Side {
        if polygon.is_beyond(p, tolerance) {
            return Side::Outside;
        }
        let band = self.band(p.y, self.first.len() - 1);
        let row = self.first[band] as usize..self.first[band + 1] as usize;
        let v = polygon.vertices();
        // Edges further to the left are neither near nor met by the ray to the right.
        let edges = self.edges[row]
            .iter()
            .map(|&i| edge(v, i))
            .take_while(|(a, b)| a.x.max(b.x) >= p.x - tolerance);
        side_of_edges(edges, p, tolerance)
    }
}

/// The edge that ends at vertex `i`.
fn edge(v: &[Point2<f64>], i: u32) -> (Point2<f64>, Point2<f64>) {
    let i = i as usize;
    (v[if i == 0 { v.len() - 1 } else { i - 1 }], v[i])
}
