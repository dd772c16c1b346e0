//! What a mission's networks are given, sent to the device once.
//!
//! Networks of one mission mostly see the same map and the same automaton. The edges of an
//! automaton have one buffer for all of them; inputs that another network was given already are
//! copied from there on the device.

use wgpu::{Buffer, CommandEncoder, Device, Queue};

use super::layout::storage;
use super::lower::EdgeOffsets;
use crate::nn::inputs::Inputs;
use crate::nn::program::{Edges, Input};

/// The edges of one automaton on the device.
#[derive(Debug)]
pub(super) struct EdgeBuffer {
    pub(super) buffer: Buffer,
    pub(super) offsets: EdgeOffsets,
    capacity: usize,
}

/// The edge buffers of a device; there are as many as missions have different automata.
#[derive(Debug, Default)]
pub(super) struct EdgeBuffers(Vec<EdgeBuffer>);

impl EdgeBuffers {
    /// Uploads the edges that a mission's networks need; returns for each network the number of
    /// its buffer.
    pub(super) fn upload(
        &mut self,
        device: &Device,
        queue: &Queue,
        inputs: &[Inputs<'_>],
        sent: &mut u64,
    ) -> Vec<usize> {
        let mut numbers: Vec<usize> = Vec::with_capacity(inputs.len());
        let mut used = 0;
        for (k, input) in inputs.iter().enumerate() {
            let same = inputs[..k]
                .iter()
                .position(|earlier| std::ptr::eq(earlier.graph, input.graph));
            numbers.push(match same {
                Some(earlier) => numbers[earlier],
                None => {
                    let (words, offsets) = edge_words(input);
                    self.place(device, used, words.len()).offsets = offsets;
                    queue.write_buffer(&self.0[used].buffer, 0, bytemuck::cast_slice(&words));
                    *sent += 4 * words.len() as u64;
                    used += 1;
                    used - 1
                }
            });
        }
        numbers
    }

    /// The buffer of this number.
    pub(super) fn get(&self, number: usize) -> &EdgeBuffer {
        &self.0[number]
    }

    /// The buffer of this number, with room for so many words. (They come in order.)
    fn place(&mut self, device: &Device, number: usize, words: usize) -> &mut EdgeBuffer {
        if self.0.get(number).is_none_or(|b| b.capacity < words) {
            // Half as much again spares the next, slightly larger automaton a new start.
            let capacity = words + words / 2;
            self.0.truncate(number);
            self.0.push(EdgeBuffer {
                buffer: storage(device, "edges", capacity),
                offsets: EdgeOffsets::default(),
                capacity,
            });
        }
        &mut self.0[number]
    }
}

/// The edges of all types one after the other, and where each type's begin.
fn edge_words(inputs: &Inputs<'_>) -> (Vec<u32>, EdgeOffsets) {
    let (mut words, mut offsets) = (Vec::new(), EdgeOffsets::default());
    for edges in Edges::ALL {
        let list = edges.incoming(inputs.graph);
        offsets.0[edges as usize] = (
            words.len() as u32,
            (words.len() + list.offsets.len()) as u32,
        );
        words.extend(list.offsets);
        words.extend(list.sources);
    }
    (words, offsets)
}

/// A contiguous input that is on the device.
struct Sent<'a> {
    inputs: Inputs<'a>,
    input: &'a Input,
    rows: usize,
    buffer: Buffer,
}

/// The inputs of one mission that were sent so far.
#[derive(Default)]
pub(super) struct Uploads<'a> {
    sent: Vec<Sent<'a>>,
    copies: Vec<(Buffer, u64, Buffer, u64, u64)>,
    staging: Vec<f32>,
    /// Bytes that were sent.
    pub(super) bytes: u64,
}

impl<'a> Uploads<'a> {
    /// Fills the inputs of a program that lie in one buffer, which holds `len` values.
    pub(super) fn fill(
        &mut self,
        queue: &Queue,
        inputs: &Inputs<'a>,
        list: &[&'a Input],
        buffer: &Buffer,
        len: usize,
    ) {
        let rows = |input: &Input| input.at.rows.rows(inputs.size());
        let whole = |input: &Input| input.at.stride == input.at.columns || rows(input) <= 1;
        if !list.iter().all(|input| whole(input)) {
            // Blocks of columns go together with what stands between them.
            self.staging.clear();
            self.staging.resize(len, 0.0);
            for input in list {
                inputs.fill(input, &mut self.staging);
            }
            self.send(queue, buffer, 0..len);
            return;
        }
        for &input in list {
            let rows = rows(input);
            let values = rows * input.at.columns;
            let (at, bytes) = (4 * input.at.offset as u64, 4 * values as u64);
            if values == 0 {
                continue;
            }
            if let Some(sent) = self.sent.iter().find(|s| s.is(inputs, input, rows))
                && sent.buffer != *buffer
            {
                let from = 4 * sent.input.at.offset as u64;
                self.copies
                    .push((sent.buffer.clone(), from, buffer.clone(), at, bytes));
                continue;
            }
            let range = input.at.offset..input.at.offset + values;
            self.staging.resize(self.staging.len().max(range.end), 0.0);
            inputs.fill(input, &mut self.staging);
            self.send(queue, buffer, range);
            self.sent.push(Sent {
                inputs: *inputs,
                input,
                rows,
                buffer: buffer.clone(),
            });
        }
    }

    fn send(&mut self, queue: &Queue, buffer: &Buffer, range: std::ops::Range<usize>) {
        let bytes: &[u8] = bytemuck::cast_slice(&self.staging[range.clone()]);
        queue.write_buffer(buffer, 4 * range.start as u64, bytes);
        self.bytes += bytes.len() as u64;
    }

    /// Records the copies from one network's inputs to another's.
    pub(super) fn record(&self, encoder: &mut CommandEncoder) {
        for (from, at, to, there, bytes) in &self.copies {
            encoder.copy_buffer_to_buffer(from, *at, to, *there, *bytes);
        }
    }
}

impl Sent<'_> {
    /// Whether these are the very values that `input` asks for.
    fn is(&self, inputs: &Inputs<'_>, input: &Input, rows: usize) -> bool {
        std::ptr::eq(self.inputs.map, inputs.map)
            && std::ptr::eq(self.inputs.graph, inputs.graph)
            && std::ptr::eq(self.inputs.given, inputs.given)
            && self.input.source == input.source
            && (self.rows, self.input.at.columns) == (rows, input.at.columns)
    }
}
