//! Handing a file's tensors to a model's builder, in the layout that operations ask for.

use std::collections::BTreeSet;

use super::{Fault, Tensor, WeightError, WeightFile};
use crate::nn::cpu::product::{LANES, PANEL};
use crate::nn::program::{ConstantId, Program, Window};

/// What PyTorch adds to variances.
const NORM_EPSILON: f32 = 1e-5;

/// Whether a convolution is followed by a batch norm, and where the norm's tensors stand.
#[derive(Clone, Copy, Debug)]
pub enum Norm<'a> {
    /// A bias and no norm.
    Bias,
    /// No bias, a norm whose tensors have this prefix.
    Batch(&'a str),
}

/// Hands out tensors by name and takes note of all that is missing, mis-shaped or left over.
///
/// A builder is run twice: first on a source that only checks, with empty constants, so that a
/// false configuration costs no memory; then on one that fills.
#[derive(Debug)]
pub struct TensorSource<'a> {
    file: &'a WeightFile<'a>,
    fills: bool,
    used: BTreeSet<String>,
    faults: Vec<Fault>,
}

impl<'a> TensorSource<'a> {
    /// Runs `build` twice, as told above, and returns what it built.
    ///
    /// # Errors
    /// Every tensor that is missing, has another shape, or was not asked for.
    pub fn build<T>(
        file: &'a WeightFile<'a>,
        build: impl Fn(&mut TensorSource<'a>, &mut Program) -> T,
    ) -> Result<(Program, T), WeightError> {
        let new = |fills| Self {
            file,
            fills,
            used: BTreeSet::new(),
            faults: Vec::new(),
        };
        let mut check = new(false);
        build(&mut check, &mut Program::default());
        let left = file
            .tensors
            .keys()
            .filter(|name| !check.used.contains(*name));
        check
            .faults
            .extend(left.map(|name| Fault::Unused(name.clone())));
        let fail = |faults| WeightError {
            file: file.name.clone(),
            faults,
        };
        if !check.faults.is_empty() {
            return Err(fail(check.faults));
        }
        let mut program = Program::default();
        let mut fill = new(true);
        let built = build(&mut fill, &mut program);
        if !fill.faults.is_empty() {
            return Err(fail(fill.faults));
        }
        program.check();
        program.prune();
        Ok((program, built))
    }

    /// The tensor called `name`, or none while checking and when it is at fault.
    fn take(&mut self, name: &str, shape: &[usize]) -> Option<&'a Tensor<'a>> {
        if !self.fills {
            self.used.insert(name.to_owned());
        }
        let fault = match self.file.tensors.get(name) {
            None => Fault::Missing {
                name: name.to_owned(),
                shape: shape.to_vec(),
            },
            Some(tensor) if tensor.shape != shape => Fault::Shape {
                name: name.to_owned(),
                found: tensor.shape.clone(),
                expected: shape.to_vec(),
            },
            Some(tensor) => return self.fills.then_some(tensor),
        };
        self.faults.push(fault);
        None
    }

    /// A tensor as it stands.
    pub fn plain(&mut self, program: &mut Program, name: &str, shape: &[usize]) -> ConstantId {
        let values = self
            .take(name, shape)
            .map_or_else(Vec::new, |t| t.values.to_vec());
        program.constant(values)
    }

    /// Per output channel the factor and the addend of a norm, or 1 and the bias.
    fn affine(&mut self, norm: Norm<'_>, bias: &str, channels: usize) -> (Vec<f32>, Vec<f32>) {
        let none = (Vec::new(), Vec::new());
        match norm {
            Norm::Bias => self
                .take(bias, &[channels])
                .map_or(none, |t| (vec![1.0; channels], t.values.to_vec())),
            Norm::Batch(prefix) => {
                let mut part = |name: &str| self.take(&format!("{prefix}.{name}"), &[channels]);
                let parts = [
                    part("weight"),
                    part("bias"),
                    part("running_mean"),
                    part("running_var"),
                ];
                self.check_variance(prefix);
                let [Some(weight), Some(bias), Some(mean), Some(variance)] = parts else {
                    return none;
                };
                let factor: Vec<f32> = weight
                    .values
                    .iter()
                    .zip(variance.values.iter())
                    .map(|(w, v)| {
                        (f64::from(*w) / (f64::from(*v) + f64::from(NORM_EPSILON)).sqrt()) as f32
                    })
                    .collect();
                let shifted = bias.values.iter().zip(mean.values.iter()).zip(&factor);
                let addend: Vec<f32> = shifted
                    .map(|((b, m), f)| (f64::from(*b) - f64::from(*m) * f64::from(*f)) as f32)
                    .collect();
                if !factor.iter().chain(&addend).all(|f| f.is_finite()) {
                    self.faults.push(Fault::Norm(prefix.to_owned()));
                }
                (factor, addend)
            }
        }
    }

    /// A negative variance would turn into NaN only later, far from its cause.
    fn check_variance(&mut self, prefix: &str) {
        let name = format!("{prefix}.running_var");
        let negative = |t: &Tensor<'_>| t.values.iter().any(|&v| v < 0.0);
        if !self.fills && self.file.tensors.get(&name).is_some_and(negative) {
            self.faults.push(Fault::Variance(name));
        }
    }

    /// A convolution's weights and bias in the layout of the operation, with its norm folded in.
    ///
    /// The tensors are `{name}.weight` and what `norm` says (`{name}.bias` without one).
    pub fn conv(
        &mut self,
        program: &mut Program,
        name: &str,
        norm: Norm<'_>,
        [out, inputs]: [usize; 2],
        kernel: usize,
    ) -> (ConstantId, ConstantId) {
        let weight = self.take(&format!("{name}.weight"), &[out, inputs, kernel, kernel]);
        let (factor, addend) = self.affine(norm, &format!("{name}.bias"), out);
        let values = match weight {
            Some(t) if factor.len() == out => conv_weights(&t.values, &factor, inputs, kernel),
            _ => Vec::new(),
        };
        (program.constant(values), program.constant(addend))
    }

    /// A transposed convolution's weights, one matrix per residue (see
    /// [`Op::ConvTranspose2d`](crate::nn::program::Op::ConvTranspose2d)), and bias, with its norm
    /// folded in.
    pub fn conv_transpose(
        &mut self,
        program: &mut Program,
        name: &str,
        norm: Norm<'_>,
        [out, inputs]: [usize; 2],
        window: Window,
    ) -> (ConstantId, ConstantId) {
        let kernel = window.kernel;
        let weight = self.take(&format!("{name}.weight"), &[inputs, out, kernel, kernel]);
        let (factor, addend) = self.affine(norm, &format!("{name}.bias"), out);
        let values = match weight {
            Some(t) if factor.len() == out => {
                transposed_weights(&t.values, &factor, inputs, window)
            }
            _ => Vec::new(),
        };
        (program.constant(values), program.constant(addend))
    }

    /// A linear layer's weights and bias, in the layout of the operation.
    pub fn linear(
        &mut self,
        program: &mut Program,
        name: &str,
        out: usize,
        inputs: usize,
    ) -> (ConstantId, ConstantId) {
        let weight = self
            .take(&format!("{name}.weight"), &[out, inputs])
            .map_or_else(Vec::new, |t| linear_weights(&t.values, out));
        let weight = program.constant(weight);
        (weight, self.plain(program, &format!("{name}.bias"), &[out]))
    }

    /// The last output of a linear layer alone: weights (1, in) and bias (1).
    pub fn last_row(
        &mut self,
        program: &mut Program,
        name: &str,
        out: usize,
        inputs: usize,
    ) -> (ConstantId, ConstantId) {
        let mut last = |part: &str, shape: &[usize], columns: usize| {
            let values = self
                .take(&format!("{name}.{part}"), shape)
                .map_or(&[][..], |t| &*t.values);
            values[values.len().saturating_sub(columns)..].to_vec()
        };
        let weight = linear_weights(&last("weight", &[out, inputs], inputs), 1);
        let bias = last("bias", &[out], 1);
        (program.constant(weight), program.constant(bias))
    }

    /// Several linear layers whose results are added, as one with the inputs side by side.
    ///
    /// `parts` gives each one's tensor name and input columns; the shared bias is `bias`.
    pub fn summed(
        &mut self,
        program: &mut Program,
        parts: &[(&str, usize)],
        bias: &str,
        out: usize,
    ) -> (ConstantId, ConstantId) {
        let tensors: Vec<_> = parts
            .iter()
            .map(|&(name, inputs)| self.take(name, &[out, inputs]))
            .collect();
        let weight = side_by_side(&tensors, out, 1.0);
        (program.constant(weight), self.plain(program, bias, &[out]))
    }

    /// The edge types that end in one node type of a graph layer, as one linear layer over the
    /// weighted sums side by side: their mean is a factor of the weights.
    ///
    /// Returns the weights, the bias, and for each edge type its attention (`a_src`, `a_dst`,
    /// multiplied with the projections).
    pub fn gat(
        &mut self,
        program: &mut Program,
        types: &[EdgeWeights<'_>],
        out: usize,
    ) -> (ConstantId, ConstantId, Vec<ConstantId>) {
        let share = 1.0 / types.len() as f32;
        let (mut sources, mut attention, mut bias) = (
            Vec::new(),
            Vec::new(),
            vec![0.0; if self.fills { out } else { 0 }],
        );
        for edge in types {
            let mut part =
                |name: &str, shape: &[usize]| self.take(&format!("{}.{name}", edge.name), shape);
            let source = part("src.weight", &[out, edge.source]);
            let target = part("dst.weight", &[out, edge.target]);
            let (to_source, to_target) = (part("att_src", &[out]), part("att_dst", &[out]));
            for (sum, b) in bias
                .iter_mut()
                .zip(part("bias", &[out]).iter().flat_map(|t| t.values.iter()))
            {
                *sum += share * b;
            }
            let mut scores = projected(source, to_source, edge.source);
            scores.extend(projected(target, to_target, edge.target));
            attention.push(program.constant(scores));
            sources.push(source);
        }
        let weight = program.constant(side_by_side(&sources, out, share));
        (weight, program.constant(bias), attention)
    }
}

/// One edge type of a graph layer.
#[derive(Clone, Copy, Debug)]
pub struct EdgeWeights<'a> {
    /// The prefix of its tensors.
    pub name: &'a str,
    /// Columns of the source nodes' features.
    pub source: usize,
    /// Columns of the target nodes' features.
    pub target: usize,
}

/// `attᵀ · weight`: the score of a node as a product with its features before projection.
fn projected(
    weight: Option<&Tensor<'_>>,
    attention: Option<&Tensor<'_>>,
    inputs: usize,
) -> Vec<f32> {
    let (Some(weight), Some(attention)) = (weight, attention) else {
        return Vec::new();
    };
    let mut sums = vec![0.0f64; inputs];
    for (row, &a) in weight
        .values
        .chunks_exact(inputs.max(1))
        .zip(attention.values.iter())
    {
        sums.iter_mut()
            .zip(row)
            .for_each(|(sum, &w)| *sum += f64::from(a) * f64::from(w));
    }
    sums.into_iter().map(|sum| sum as f32).collect()
}

/// Linear layers (out, in) over inputs side by side, times `factor`; empty if one is missing.
fn side_by_side(parts: &[Option<&Tensor<'_>>], out: usize, factor: f32) -> Vec<f32> {
    let Some(parts) = parts.iter().copied().collect::<Option<Vec<_>>>() else {
        return Vec::new();
    };
    let inputs: usize = parts.iter().map(|t| t.values.len() / out.max(1)).sum();
    let mut turned = Turned::new(inputs, out);
    let mut first = 0;
    for tensor in parts {
        first += turned.put(&tensor.values, first, factor);
    }
    turned.values
}

/// PyTorch's weights of a linear layer, (out, in), as (in, ⌈out / 16⌉ · 16): the layout of
/// [`Op::Linear`](crate::nn::program::Op::Linear).
#[must_use]
pub fn linear_weights(weight: &[f32], out: usize) -> Vec<f32> {
    let mut turned = Turned::new(weight.len() / out.max(1), out);
    turned.put(weight, 0, 1.0);
    turned.values
}

/// A linear layer's weights while they are put together.
struct Turned {
    values: Vec<f32>,
    out: usize,
    stride: usize,
}

impl Turned {
    fn new(inputs: usize, out: usize) -> Self {
        let stride = out.next_multiple_of(LANES);
        Self {
            values: vec![0.0; inputs * stride],
            out,
            stride,
        }
    }

    /// Writes weights (out, in) times `factor` for the inputs from `first` on; returns how many.
    fn put(&mut self, weight: &[f32], first: usize, factor: f32) -> usize {
        let inputs = weight.len() / self.out.max(1);
        let Self { out, stride, .. } = *self;
        // Sixteen outputs at a time: their rows are read side by side, lines are written whole.
        for from in (0..out).step_by(LANES) {
            let lanes = LANES.min(out - from);
            let rows = &weight[from * inputs..][..lanes * inputs];
            let lines = self.values[first * stride..].chunks_exact_mut(stride);
            for (k, line) in lines.take(inputs).enumerate() {
                let row = rows[k..].iter().step_by(inputs);
                for (to, &w) in line[from..][..lanes].iter_mut().zip(row) {
                    *to = w * factor;
                }
            }
        }
        inputs
    }
}

/// PyTorch's weights of a convolution, (out, in, kernel, kernel), times a factor per output
/// channel, in panels: the layout of [`Op::Conv2d`](crate::nn::program::Op::Conv2d).
///
/// # Panics
/// If `weight` is shorter than its shape.
#[must_use]
pub fn conv_weights(weight: &[f32], factor: &[f32], inputs: usize, kernel: usize) -> Vec<f32> {
    let depth = inputs * kernel * kernel;
    let mut packed = vec![0.0; factor.len().next_multiple_of(PANEL) * depth];
    let panels = packed.chunks_exact_mut((PANEL * depth).max(1));
    let rows = weight.chunks((PANEL * depth).max(1));
    for ((panel, rows), scales) in panels.zip(rows).zip(factor.chunks(PANEL)) {
        // Eight rows are read side by side, and lanes written whole.
        for (k, lane) in panel.as_chunks_mut::<PANEL>().0.iter_mut().enumerate() {
            let row = rows[k..].iter().step_by(depth);
            for ((to, &w), scale) in lane.iter_mut().zip(row).zip(scales) {
                *to = w * scale;
            }
        }
    }
    packed
}

/// PyTorch's weights of a transposed convolution, (in, out, kernel, kernel), times a factor per
/// output channel, in panels per residue: the layout of
/// [`Op::ConvTranspose2d`](crate::nn::program::Op::ConvTranspose2d).
///
/// # Panics
/// If `weight` is shorter than its shape.
#[must_use]
pub fn transposed_weights(
    weight: &[f32],
    factor: &[f32],
    inputs: usize,
    window: Window,
) -> Vec<f32> {
    let Window {
        kernel,
        stride,
        padding,
    } = window;
    let (taps, out) = (window.taps(), factor.len());
    let (squared, area) = (taps * taps, kernel * kernel);
    let entry = |residue: usize, tap: usize| (residue + padding) % stride + stride * tap;
    let of_panel = inputs * squared * PANEL;
    let of_residue = out.div_ceil(PANEL) * of_panel;
    let mut values = vec![0.0; stride * stride * of_residue];
    // Where each tap of each residue stands in a kernel, if it does, and where it goes.
    let mut moves = Vec::with_capacity(stride * stride * squared);
    for residue in 0..stride * stride {
        for tap in 0..squared {
            let y = entry(residue / stride, tap / taps);
            let x = entry(residue % stride, tap % taps);
            if y < kernel && x < kernel {
                moves.push((y * kernel + x, residue * of_residue + tap * PANEL));
            }
        }
    }
    for (i, kernels) in weight
        .chunks_exact((out * area).max(1))
        .take(inputs)
        .enumerate()
    {
        let panels = kernels.chunks(PANEL * area).zip(factor.chunks(PANEL));
        for (panel, (kernels, scales)) in panels.enumerate() {
            let begin = panel * of_panel + i * squared * PANEL;
            // Eight kernels are read side by side, and lanes written whole.
            for &(from, to) in &moves {
                let row = kernels[from..].iter().step_by(area);
                let lane = &mut values[begin + to..][..PANEL];
                for ((to, &w), scale) in lane.iter_mut().zip(row).zip(scales) {
                    *to = w * scale;
                }
            }
        }
    }
    values
}
