//! Fills a program's input buffers from an encoded mission.

use super::program::{Extent, GraphSize, Input, Matrix, Source};
use crate::encoding::{AutomatonGraph, MapTensor};

/// An encoded mission: what one run of a program reads.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// The map at the program's resolution.
    pub map: &'a MapTensor,
    /// The automaton.
    pub graph: &'a AutomatonGraph,
    /// What [`Source::Given`] refers to; models have no such inputs.
    pub given: &'a [&'a [f32]],
}

impl Inputs<'_> {
    /// The number of nodes.
    #[must_use]
    pub fn size(&self) -> GraphSize {
        GraphSize {
            states: self.graph.states.len(),
            transitions: self.graph.transitions(),
        }
    }

    /// Writes one input into its buffer. Channels and columns that the mission does not use are 0.
    pub fn fill(&self, input: &Input, buffer: &mut [f32]) {
        let mut rows = Rows {
            buffer,
            at: input.at,
            size: self.size(),
        };
        match input.source {
            Source::Given(k) => {
                let mut lines = self.given[k].chunks_exact(input.at.columns.max(1));
                rows.each(|_, row| {
                    if let Some(line) = lines.next() {
                        row.copy_from_slice(line);
                    }
                });
            }
            Source::Constant(value) => rows.each(|_, row| row.fill(value)),
            Source::StateFeatures => rows.each(|i, row| row.copy_from_slice(&self.graph.states[i])),
            Source::Literals => self.literals(&mut rows),
            Source::Planes => self.planes(&mut rows),
            Source::Masks => self.masks(&mut rows),
            Source::Ways => self.ways(&mut rows),
            Source::Raster => rows.each(|i, row| self.channel(i, row)),
            Source::Regions => rows.each(|i, row| self.channel(i + 1, row)),
            Source::Obstacles => rows.each(|_, row| self.status(row, |s| s.max(0.0))),
            Source::Start => rows.each(|_, row| self.status(row, |s| (-s).max(0.0))),
            Source::AnyRegion => rows.each(|_, row| self.any_region(row)),
        }
    }

    fn literals(&self, rows: &mut Rows<'_>) {
        let regions = self.graph.regions;
        rows.each(|i, row| {
            row.fill(0.0);
            let literals = &self.graph.literals[i * regions..(i + 1) * regions];
            for (to, &literal) in row.iter_mut().zip(literals) {
                *to = f32::from(literal);
            }
        });
    }

    fn channel(&self, channel: usize, row: &mut [f32]) {
        match self.map.values.chunks_exact(row.len()).nth(channel) {
            Some(values) => row.copy_from_slice(values),
            None => row.fill(0.0),
        }
    }

    fn status(&self, row: &mut [f32], part: impl Fn(f32) -> f32) {
        for (to, &status) in row.iter_mut().zip(self.map.status()) {
            *to = part(status);
        }
    }

    fn any_region(&self, row: &mut [f32]) {
        row.fill(0.0);
        for channel in self.map.region_channels().chunks_exact(row.len()) {
            for (to, &from) in row.iter_mut().zip(channel) {
                *to = to.max(from);
            }
        }
    }

    /// The ways between regions, then those from and to the start; channels that no region has are 0.
    fn ways(&self, rows: &mut Rows<'_>) {
        let used = self.map.regions + 1;
        let last = rows.at.rows.rows(rows.size) - 1;
        rows.each(|i, row| {
            row.fill(0.0);
            let from = if i == last { used - 1 } else { i };
            if i != last && i + 1 >= used {
                return;
            }
            let Some(lengths) = self.map.ways.chunks_exact(used).nth(from) else {
                return;
            };
            row[..used - 1].copy_from_slice(&lengths[..used - 1]);
            row[last] = lengths[used - 1];
        });
    }

    /// The region channels and the start, averaged over blocks of cells.
    fn masks(&self, rows: &mut Rows<'_>) {
        let fine = self.map.resolution;
        let last = rows.at.rows.rows(rows.size) - 1;
        rows.each(|i, row| {
            row.fill(0.0);
            let coarse = row.len().isqrt();
            let block = fine / coarse;
            let weight = 1.0 / (block * block) as f32;
            if i == last {
                let (x, y) = self.start();
                row[x / block * coarse + y / block] = weight;
                return;
            }
            let Some(channel) = self.map.region_channels().chunks_exact(fine * fine).nth(i) else {
                return;
            };
            for (x, line) in channel.chunks_exact(fine).enumerate() {
                for (to, cells) in row[x / block * coarse..]
                    .iter_mut()
                    .zip(line.chunks_exact(block))
                {
                    *to += cells.iter().sum::<f32>() * weight;
                }
            }
        });
    }

    /// x, y, both relative to the start's cell, and the distance to it; centres of cells, the
    /// frame's side being 1.
    fn planes(&self, rows: &mut Rows<'_>) {
        let fine = self.map.resolution as f32;
        let (i, j) = self.start();
        let (start_x, start_y) = ((i as f32 + 0.5) / fine, (j as f32 + 0.5) / fine);
        rows.each(|plane, row| {
            let side = row.len().isqrt();
            for (cell, to) in row.iter_mut().enumerate() {
                let x = ((cell / side) as f32 + 0.5) / side as f32;
                let y = ((cell % side) as f32 + 0.5) / side as f32;
                let (dx, dy) = (x - start_x, y - start_y);
                *to = match plane {
                    0 => x,
                    1 => y,
                    2 => dx,
                    3 => dy,
                    _ => (dx * dx + dy * dy).sqrt(),
                };
            }
        });
    }

    /// The start's cell.
    fn start(&self) -> (usize, usize) {
        let side = self.map.resolution.max(1);
        let cell = self.map.status().iter().position(|&s| s < 0.0).unwrap_or(0);
        (cell / side, cell % side)
    }
}

/// The rows of the matrix that an input fills.
struct Rows<'a> {
    buffer: &'a mut [f32],
    at: Matrix,
    size: GraphSize,
}

impl Rows<'_> {
    fn each(&mut self, mut fill: impl FnMut(usize, &mut [f32])) {
        let Matrix {
            offset,
            columns,
            stride,
            rows,
            ..
        } = self.at;
        debug_assert!(matches!(rows, Extent::Fixed(_)) || offset < stride.max(1));
        for i in 0..rows.rows(self.size) {
            let begin = offset + i * stride;
            fill(i, &mut self.buffer[begin..begin + columns]);
        }
    }
}
