//! Goldens of single operations (`training/goldens_ops.py`): each case as a program of that
//! operation, which any executor can run.

use nngtl::encoding::{AutomatonGraph, MapTensor};
use nngtl::nn::inputs::Inputs;
use nngtl::nn::program::{
    Activation, ConstantId, Edges, Extent, Map, Matrix, Op, Program, Sign, Source, Window,
};
use nngtl::nn::weights::{conv_weights, linear_weights, transposed_weights};
use serde_json::Value;

/// Per square root of the number of products in a sum: five times what f32 sums of such inputs
/// were seen to be off.
const TOLERANCE: f32 = 1e-6;

/// A case: its program, what the program reads, and what PyTorch made of it.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) program: Program,
    pub(crate) given: Vec<Vec<f32>>,
    pub(crate) graph: AutomatonGraph,
    length: usize,
    step: usize,
    golden: Vec<f32>,
    depth: usize,
}

impl Case {
    /// Runs the case and compares.
    pub(crate) fn check(&self, run: &mut dyn FnMut(&Program, &Inputs<'_>) -> Vec<f32>) {
        let given: Vec<&[f32]> = self.given.iter().map(Vec::as_slice).collect();
        let map = MapTensor::default();
        let inputs = Inputs {
            map: &map,
            graph: &self.graph,
            given: &given,
        };
        let y = run(&self.program, &inputs);
        assert_eq!(y.len(), self.length, "{}: number of values", self.name);
        let sample: Vec<f32> = y.iter().copied().step_by(self.step).collect();
        let error = super::difference(&sample, &self.golden);
        let allowed = TOLERANCE * (self.depth as f32).sqrt().max(1.0);
        assert!(
            error <= allowed,
            "{}: off by {error:e}, allowed {allowed:e}",
            self.name
        );
    }
}

/// All cases of all operations.
pub(crate) fn cases() -> Vec<Case> {
    let folder = super::goldens().join("ops");
    let mut names: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    names.sort();
    assert!(
        names.len() >= 14,
        "goldens are missing in {}",
        folder.display()
    );
    names.iter().flat_map(|path| cases_of(path)).collect()
}

fn cases_of(path: &std::path::Path) -> Vec<Case> {
    let op = path.file_stem().unwrap().to_str().unwrap();
    let bytes = std::fs::read(path).unwrap();
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let listed: Vec<Value> =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["cases"]).unwrap();
    let outputs = super::read(path);
    let case = |(number, value): (usize, &Value)| {
        let mut builder = Builder {
            case: value,
            program: Program::default(),
            given: Vec::new(),
        };
        let (output, depth) = builder.op(op);
        builder.program.output = Some(output);
        builder.program.check();
        Case {
            name: format!("{op} {number} {value}"),
            graph: graph(value),
            length: builder.number("length"),
            step: builder.number("step"),
            golden: outputs[&number.to_string()].values.clone(),
            depth,
            program: builder.program,
            given: builder.given,
        }
    };
    listed.iter().enumerate().map(case).collect()
}

/// The numbers of the script's `values`.
fn values(seed: u64, count: usize) -> Vec<f32> {
    let number = |i: u64| {
        let mixed = (i + 1_000_003 * seed).wrapping_mul(2_654_435_761) % (1 << 32);
        let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(2_246_822_519) % (1 << 32);
        ((mixed >> 8) as f64 / f64::from(1 << 24) - 0.5) as f32
    };
    (0..count as u64).map(number).collect()
}

/// The numbers of the script's `whole`.
fn whole(seed: u64, count: usize, below: usize) -> Vec<usize> {
    values(seed, count)
        .iter()
        .map(|&v| ((f64::from(v) + 0.5) * below as f64) as usize)
        .collect()
}

fn graph(case: &Value) -> AutomatonGraph {
    let size = |key: &str| case.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
    let (states, transitions) = (size("states"), size("transitions"));
    let ends = whole(10, transitions, states)
        .into_iter()
        .zip(whole(11, transitions, states));
    AutomatonGraph {
        regions: 0,
        states: vec![[0.0; 3]; states],
        literals: Vec::new(),
        ends: ends.map(|(a, b)| (a as u32, b as u32)).collect(),
    }
}

struct Builder<'a> {
    case: &'a Value,
    program: Program,
    given: Vec<Vec<f32>>,
}

impl Builder<'_> {
    fn number(&self, key: &str) -> usize {
        self.case[key]
            .as_u64()
            .unwrap_or_else(|| panic!("{key} in {}", self.case)) as usize
    }

    fn flag(&self, key: &str) -> bool {
        self.case[key].as_bool().unwrap()
    }

    fn sign(&self) -> (Sign, f32) {
        if self.case["sign"].as_i64() == Some(1) {
            (Sign::Positive, 1.0)
        } else {
            (Sign::Negative, -1.0)
        }
    }

    fn activation(&self) -> Activation {
        match self.case["activation"].as_str().unwrap() {
            "none" => Activation::None,
            "relu" => Activation::Relu,
            "leaky_relu" => Activation::LeakyRelu,
            "sigmoid" => Activation::Sigmoid,
            other => panic!("{other}"),
        }
    }

    fn window(&self) -> Window {
        Window::new(
            self.number("kernel"),
            self.number("stride"),
            self.number("padding"),
        )
    }

    fn constant(&mut self, seed: u64, count: usize) -> ConstantId {
        self.program.constant(values(seed, count))
    }

    /// An input in the middle of a wider buffer, so that offsets and strides count.
    fn matrix(&mut self, rows: Extent, count: usize, columns: usize, numbers: Vec<f32>) -> Matrix {
        assert_eq!(numbers.len(), count * columns);
        let m = self.program.matrix(rows, columns + 3).columns(2, columns);
        self.program.input(Source::Given(self.given.len()), m);
        self.given.push(numbers);
        m
    }

    fn rows(&mut self, seed: u64, rows: usize, columns: usize) -> Matrix {
        self.matrix(
            Extent::Fixed(rows),
            rows,
            columns,
            values(seed, rows * columns),
        )
    }

    fn map(&mut self, numbers: Vec<f32>, channels: usize, height: usize, width: usize) -> Map {
        let map = self
            .program
            .map(channels + 2, height, width)
            .channels(1, channels);
        self.program
            .input(Source::Given(self.given.len()), map.as_matrix());
        self.given.push(numbers);
        map
    }

    fn input_map(&mut self, seed: u64) -> Map {
        let [c, h, w] = ["in", "height", "width"].map(|k| self.number(k));
        self.map(values(seed, c * h * w), c, h, w)
    }

    fn mask(&mut self) -> Map {
        let [labels, h, w] = ["labels", "height", "width"].map(|k| self.number(k));
        let mut numbers: Vec<f32> = values(8, labels * h * w)
            .iter()
            .map(|v| (v - 0.2).max(0.0))
            .collect();
        numbers[..h * w].fill(0.0);
        self.map(numbers, labels, h, w)
    }

    fn literals(&mut self) -> Matrix {
        let [rows, labels] = ["rows", "labels"].map(|k| self.number(k));
        let numbers = whole(9, rows * labels, 3)
            .into_iter()
            .map(|n| n as f32 - 1.0)
            .collect();
        self.matrix(Extent::Fixed(rows), rows, labels, numbers)
    }

    fn output(&mut self, channels: usize, height: usize, width: usize) -> Map {
        self.program
            .map(channels + 1, height, width)
            .channels(1, channels)
    }

    /// Adds the operation; returns its output and how many products a value of it sums up.
    fn op(&mut self, name: &str) -> (Matrix, usize) {
        match name {
            "conv2d" => self.conv2d(),
            "conv_transpose2d" => self.conv_transpose2d(),
            "linear" => self.linear(),
            "gat" => self.gat(),
            _ => self.small(name),
        }
    }

    fn conv2d(&mut self) -> (Matrix, usize) {
        let (x, window, activation, out) = (
            self.input_map(1),
            self.window(),
            self.activation(),
            self.number("out"),
        );
        let depth = x.channels * window.kernel * window.kernel;
        let given = values(2, out * depth);
        let weight = conv_weights(&given, &vec![1.0; out], x.channels, window.kernel);
        let (weight, bias) = (self.program.constant(weight), self.constant(3, out));
        let (height, width) = (window.reduced(x.height), window.reduced(x.width));
        let residual = self
            .flag("residual")
            .then(|| self.map(values(4, out * height * width), out, height, width));
        let y = self.output(out, height, width);
        self.program.push(Op::Conv2d {
            x,
            weight,
            bias,
            window,
            residual,
            activation,
            y,
        });
        (y.as_row(), depth)
    }

    fn conv_transpose2d(&mut self) -> (Matrix, usize) {
        let (x, window, activation, out) = (
            self.input_map(1),
            self.window(),
            self.activation(),
            self.number("out"),
        );
        let given = values(2, x.channels * out * window.kernel * window.kernel);
        let weight = self.program.constant(transposed_weights(
            &given,
            &vec![1.0; out],
            x.channels,
            window,
        ));
        let bias = self.constant(3, out);
        let extra = self.number("extra");
        let y = self.output(
            out,
            window.enlarged(x.height, extra),
            window.enlarged(x.width, extra),
        );
        self.program.push(Op::ConvTranspose2d {
            x,
            weight,
            bias,
            window,
            activation,
            y,
        });
        (y.as_row(), x.channels * window.taps() * window.taps())
    }

    fn linear(&mut self) -> (Matrix, usize) {
        let [rows, inputs, out, more] = ["rows", "in", "out", "second"].map(|k| self.number(k));
        let activation = self.activation();
        let x = self.rows(1, rows, inputs);
        let second = (more > 0).then(|| self.rows(4, rows, more));
        let weight = linear_weights(&values(2, out * (inputs + more)), out);
        let (weight, bias) = (self.program.constant(weight), self.constant(3, out));
        let y = self.program.matrix(Extent::Fixed(rows), out);
        self.program.push(Op::Linear {
            x,
            second,
            weight,
            bias,
            activation,
            y,
        });
        (y, inputs + more)
    }

    fn gat(&mut self) -> (Matrix, usize) {
        use Extent::{Fixed, States, Transitions};
        let (edges, from, to) = match self.case["edges"].as_str().unwrap() {
            "transition_to_state" => (Edges::TransitionToState, Transitions, States),
            "transition_to_source" => (Edges::TransitionToSource, Transitions, States),
            "state_to_transition" => (Edges::StateToTransition, States, Transitions),
            "target_to_transition" => (Edges::TargetToTransition, States, Transitions),
            "state_to_pool" => (Edges::StateToPool, States, Fixed(1)),
            "transition_to_pool" => (Edges::TransitionToPool, Transitions, Fixed(1)),
            other => panic!("{other}"),
        };
        let [inputs, own, out] = ["in", "target", "out"].map(|k| self.number(k));
        let [states, transitions] = ["states", "transitions"].map(|k| self.number(k));
        let count = |e| match e {
            Fixed(n) => n,
            States => states,
            Transitions => transitions,
        };
        let (sources, targets) = (count(from), count(to));
        let source = self.matrix(from, sources, inputs, values(1, sources * inputs));
        let target = self.matrix(to, targets, own, values(7, targets * own));
        let mut attention = Vec::new();
        for (weight, vector, columns) in [(2, 4, inputs), (3, 5, own)] {
            let (weight, vector) = (values(weight, out * columns), values(vector, out));
            attention.extend((0..columns).map(|c| {
                let products = (0..out)
                    .map(|o| f64::from(weight[o * columns + c]) * 8.0 * f64::from(vector[o]));
                products.sum::<f64>() as f32
            }));
        }
        let attention = self.program.constant(attention);
        let gathered = self.program.matrix(to, inputs + 1).columns(1, inputs);
        self.program.push(Op::Gat {
            source,
            target,
            attention,
            edges,
            y: gathered,
        });
        let weight = linear_weights(&values(2, out * inputs), out);
        let (weight, bias) = (self.program.constant(weight), self.constant(6, out));
        let y = self.program.matrix(to, out);
        self.program.push(Op::Linear {
            x: gathered,
            second: None,
            weight,
            bias,
            activation: Activation::None,
            y,
        });
        // Attention sharpens differences of scores, which are sums of two such products.
        (y, 4 * (inputs + own) * out)
    }

    fn small(&mut self, name: &str) -> (Matrix, usize) {
        match name {
            "max_pool2d" => {
                let (x, window) = (self.input_map(1), self.window());
                let y = self.output(
                    x.channels,
                    window.reduced(x.height),
                    window.reduced(x.width),
                );
                self.program.push(Op::MaxPool2d { x, window, y });
                (y.as_row(), 1)
            }
            "global_mean_pool" => {
                let x = self.input_map(1);
                let y = self.program.matrix(Extent::Fixed(1), x.channels);
                self.program.push(Op::GlobalMeanPool { x, y });
                (y, 1)
            }
            "mean_rows" => {
                let [rows, columns] = ["rows", "in"].map(|k| self.number(k));
                let x = self.rows(1, rows, columns);
                let y = self.program.matrix(Extent::Fixed(1), columns);
                self.program.push(Op::MeanRows { x, y });
                (y, 1)
            }
            "sign_mean" => {
                let [rows, labels, columns] = ["rows", "labels", "in"].map(|k| self.number(k));
                let (literals, x, sign) = (
                    self.literals(),
                    self.rows(1, labels, columns),
                    self.sign().0,
                );
                let y = self.program.matrix(Extent::Fixed(rows), columns);
                self.program.push(Op::SignMean {
                    literals,
                    x,
                    sign,
                    y,
                });
                (y, 1)
            }
            "region_form" => {
                let [rows, labels, columns] = ["rows", "labels", "in"].map(|k| self.number(k));
                let (literals, x, sign) =
                    (self.literals(), self.rows(1, rows, columns), self.sign().0);
                let y = self.program.matrix(Extent::Fixed(labels), columns);
                self.program.push(Op::RegionForm {
                    literals,
                    x,
                    sign,
                    y,
                });
                (y, 1)
            }
            "region_mean" => {
                let (x, mask) = (self.input_map(1), self.mask());
                let y = self
                    .program
                    .matrix(Extent::Fixed(mask.channels), x.channels);
                self.program.push(Op::RegionMean { x, mask, y });
                (y, 1)
            }
            "paint" => {
                let [labels, out] = ["labels", "out"].map(|k| self.number(k));
                let (mask, colour) = (self.mask(), self.rows(1, labels, out));
                let y = self.output(out, mask.height, mask.width);
                self.program.push(Op::Paint { mask, colour, y });
                (y.as_row(), labels)
            }
            "upsample" => {
                let x = self.input_map(1);
                let [height, width] = ["to_height", "to_width"].map(|k| self.number(k));
                let y = self.output(x.channels, height, width);
                self.program.push(Op::Upsample { x, y });
                // Positions on the finer grid are rounded by an ulp of some hundred cells.
                (y.as_row(), 100)
            }
            "broadcast" => {
                let [channels, height, width] = ["in", "height", "width"].map(|k| self.number(k));
                let (x, add) = (self.rows(1, 1, channels), self.flag("add"));
                let y = self.map(
                    values(2, channels * height * width),
                    channels,
                    height,
                    width,
                );
                self.program.push(Op::Broadcast { x, add, y });
                (y.as_row(), 1)
            }
            "copy_rows" => {
                let ([rows, columns], repeat) =
                    (["rows", "in"].map(|k| self.number(k)), self.flag("repeat"));
                let x = self.rows(1, if repeat { 1 } else { rows }, columns);
                let y = self.program.matrix(Extent::Fixed(rows), columns);
                self.program.push(if repeat {
                    Op::RepeatRow { x, y }
                } else {
                    Op::CopyRows { x, y }
                });
                (y, 1)
            }
            other => panic!("no case builder for {other}"),
        }
    }
}
