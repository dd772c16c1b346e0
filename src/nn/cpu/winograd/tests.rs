use super::super::{conv_transpose2d, conv2d};
use super::*;
use crate::nn::program::{Activation, Constant};
use crate::nn::weights::{conv_weights, transposed_weights};

fn values(count: usize, seed: usize) -> Vec<f32> {
    (0..count)
        .map(|i| ((i * 7919 + seed * 104_729) % 1009) as f32 / 504.5 - 1.0)
        .collect()
}

/// A convolution of some shape, or a transposed one.
#[derive(Clone, Copy, Debug)]
struct Case {
    window: Window,
    transposed: bool,
    channels: [usize; 2],
    size: [usize; 2],
    extra: usize,
    residual: bool,
    threads: usize,
}

/// Planes of a map.
fn planes(data: &[f32], channels: usize, [height, width]: [usize; 2]) -> Planes<'_> {
    Planes {
        data,
        channels,
        height,
        width,
    }
}

fn planes_mut(data: &mut [f32], channels: usize, [height, width]: [usize; 2]) -> PlanesMut<'_> {
    PlanesMut {
        data,
        channels,
        height,
        width,
    }
}

impl Case {
    fn method(&self) -> Winograd {
        let method = match self.transposed {
            true => Winograd::transposed(self.window),
            false => Winograd::conv(self.window),
        };
        method.expect("the window is one of those that have a method")
    }

    /// PyTorch's weights in the layout of the operation.
    fn packed(&self, weight: &[f32]) -> Constant {
        let ([inputs, outs], window) = (self.channels, self.window);
        let scales = vec![1.0; outs];
        Constant::from(match self.transposed {
            true => transposed_weights(weight, &scales, inputs, window),
            false => conv_weights(weight, &scales, inputs, window.kernel),
        })
    }

    fn out(&self, size: usize) -> usize {
        if self.transposed {
            self.window.enlarged(size, self.extra)
        } else {
            self.window.reduced(size)
        }
    }

    /// By the definition, in double precision: every tap of every input goes where it belongs.
    fn expected(&self, x: &[f32], weight: &[f32], bias: &[f32], residual: &[f32]) -> Vec<f64> {
        let ([inputs, outs], [height, width]) = (self.channels, self.size);
        let [rows, columns] = self.size.map(|size| self.out(size));
        let Window {
            kernel,
            stride,
            padding,
        } = self.window;
        let mut y = vec![0.0; outs * rows * columns];
        for (out, y) in y.chunks_exact_mut(rows * columns).enumerate() {
            let mut add =
                |row: usize, column: usize, value: f64| y[row * columns + column] += value;
            for (input, cell) in
                (0..inputs).flat_map(|c| (0..height * width).map(move |at| (c, at)))
            {
                let value = f64::from(x[input * height * width + cell]);
                let (i, j) = (cell / width, cell % width);
                for (ky, kx) in (0..kernel).flat_map(|ky| (0..kernel).map(move |kx| (ky, kx))) {
                    let pair = if self.transposed {
                        input * outs + out
                    } else {
                        out * inputs + input
                    };
                    let product = value * f64::from(weight[(pair * kernel + ky) * kernel + kx]);
                    let place = |at: usize, k: usize, limit: usize| {
                        let to = if self.transposed {
                            (at * stride + k).checked_sub(padding)?
                        } else {
                            let from = (at + padding).checked_sub(k)?;
                            (from % stride == 0).then_some(from / stride)?
                        };
                        (to < limit).then_some(to)
                    };
                    if let (Some(row), Some(column)) = (place(i, ky, rows), place(j, kx, columns)) {
                        add(row, column, product);
                    }
                }
            }
            y.iter_mut().for_each(|v| *v += f64::from(bias[out]));
        }
        y.iter_mut()
            .zip(residual)
            .for_each(|(y, r)| *y += f64::from(*r));
        y.iter().map(|&v| v.max(0.2 * v)).collect()
    }

    /// The same by the method, whether or not it pays.
    fn found(&self, x: &[f32], weight: &[f32], bias: &[f32], residual: &[f32]) -> Vec<f32> {
        let [inputs, outs] = self.channels;
        let [rows, columns] = self.size.map(|size| self.out(size));
        let kernel = Kernel {
            weight: &self.packed(weight),
            bias,
            window: self.window,
            activation: Activation::LeakyRelu,
        };
        let mut scratch = Scratch {
            threads: self.threads,
            ..Scratch::default()
        };
        // Memory that was used before holds anything.
        scratch.panel = vec![f32::NAN; 1000];
        scratch.tile = vec![f32::NAN; 1000];
        let mut y = vec![f32::NAN; outs * rows * columns];
        for _ in 0..2 {
            let y = planes_mut(&mut y, outs, [rows, columns]);
            let residual = self
                .residual
                .then(|| planes(residual, outs, [rows, columns]));
            self.method().run(
                planes(x, inputs, self.size),
                &kernel,
                residual,
                y,
                &mut scratch,
            );
        }
        y
    }

    fn check(&self) {
        let ([inputs, outs], [rows, columns]) =
            (self.channels, self.size.map(|size| self.out(size)));
        let x = values(inputs * self.size[0] * self.size[1], 1);
        let weight = values(inputs * outs * self.window.kernel.pow(2), 2);
        let bias = values(outs, 3);
        let residual = if self.residual {
            values(outs * rows * columns, 4)
        } else {
            Vec::new()
        };
        let expected = self.expected(&x, &weight, &bias, &residual);
        let found = self.found(&x, &weight, &bias, &residual);
        assert_eq!(found.len(), expected.len());
        let terms = (inputs * self.window.kernel.pow(2)) as f64;
        for (at, (&found, expected)) in found.iter().zip(expected).enumerate() {
            let error = (f64::from(found) - expected).abs();
            assert!(
                error < 1e-6 * terms.max(10.0),
                "{self:?} at {at}: {found}, not {expected}"
            );
        }
    }
}

const SIZES: [usize; 7] = [1, 2, 3, 7, 12, 13, 34];

#[test]
fn convolutions_match_the_definition() {
    for (kernel, stride, paddings) in [(4, 2, 0..4), (3, 1, 0..3)] {
        for padding in paddings {
            for (n, (height, width)) in SIZES
                .iter()
                .flat_map(|&h| SIZES.map(|w| (h, w)))
                .enumerate()
            {
                let window = Window::new(kernel, stride, padding);
                if [height, width]
                    .iter()
                    .any(|&size| window.reduced(size) == 0)
                {
                    continue;
                }
                Case {
                    window,
                    transposed: false,
                    channels: [[1, 1], [3, 9], [5, 17]][n % 3],
                    size: [height, width],
                    extra: 0,
                    residual: n % 2 == 0,
                    threads: 1,
                }
                .check();
            }
        }
    }
}

#[test]
fn transposed_convolutions_match_the_definition() {
    for (kernel, stride, padding) in [
        (4, 2, 0),
        (4, 2, 1),
        (4, 2, 2),
        (4, 2, 3),
        (3, 2, 1),
        (5, 3, 1),
        (6, 3, 2),
    ] {
        for (n, (height, width)) in SIZES
            .iter()
            .flat_map(|&h| SIZES.map(|w| (h, w)))
            .enumerate()
        {
            let window = Window::new(kernel, stride, padding);
            let extra = n % 2;
            if [height, width]
                .iter()
                .any(|&size| window.enlarged(size, extra) == 0)
            {
                continue;
            }
            Case {
                window,
                transposed: true,
                channels: [[1, 1], [3, 9], [5, 17]][n % 3],
                size: [height, width],
                extra,
                residual: false,
                threads: 1,
            }
            .check();
        }
    }
}

/// Several strips, depths beyond a block of products, and channels that threads share.
#[test]
fn large_layers_match_the_definition() {
    let case = Case {
        window: Window::new(3, 1, 1),
        transposed: false,
        channels: [150, 70],
        size: [41, 50],
        extra: 0,
        residual: true,
        threads: 1,
    };
    let half = Case {
        window: Window::new(4, 2, 1),
        channels: [75, 70],
        size: [141, 90],
        ..case
    };
    let up = Case {
        transposed: true,
        residual: false,
        channels: [150, 40],
        size: [56, 61],
        ..half
    };
    for case in [case, half, up] {
        let method = case.method();
        let [rows, columns] = case.size.map(|size| method.tiles(case.out(size)));
        let inputs = case.channels[0] * method.stride.pow(2);
        assert!(
            strip(case.channels[1] + inputs, columns + 1, rows) < rows,
            "one strip: {case:?}"
        );
    }
    for threads in [1, 3] {
        for case in [case, half, up] {
            Case { threads, ..case }.check();
        }
    }
}

/// By the operations themselves, which choose the method: the same as by it, whatever the threads, and what they keep is used again.
#[test]
fn operations_choose_the_method_where_it_pays() {
    let down = Case {
        window: Window::new(4, 2, 1),
        transposed: false,
        channels: [64, 128],
        size: [64, 80],
        extra: 0,
        residual: true,
        threads: 1,
    };
    let up = Case {
        transposed: true,
        residual: false,
        channels: [128, 64],
        size: [32, 40],
        ..down
    };
    for case in [down, up] {
        let ([inputs, outs], [rows, columns]) =
            (case.channels, case.size.map(|size| case.out(size)));
        let x = values(inputs * case.size[0] * case.size[1], 1);
        let given = values(inputs * outs * case.window.kernel.pow(2), 2);
        let bias = values(outs, 3);
        let residual = values(outs * rows * columns, 4);
        let expected = case.found(&x, &given, &bias, &residual);
        let kernel = Kernel {
            weight: &case.packed(&given),
            bias: &bias,
            window: case.window,
            activation: Activation::LeakyRelu,
        };
        for threads in [1, 4] {
            let mut scratch = Scratch {
                threads,
                ..Scratch::default()
            };
            let mut data = vec![f32::NAN; outs * rows * columns];
            let y = planes_mut(&mut data, outs, [rows, columns]);
            let chosen = match case.transposed {
                true => Winograd::of_transposed(case.window, inputs, &y),
                false => Winograd::of_conv(case.window, inputs, &y),
            };
            assert!(chosen.is_some(), "it pays for {case:?}");
            let input = planes(&x, inputs, case.size);
            match case.transposed {
                true => conv_transpose2d(input, &kernel, y, &mut scratch),
                false => {
                    let residual = Some(planes(&residual, outs, [rows, columns]));
                    conv2d(input, &kernel, residual, y, &mut scratch);
                }
            }
            assert_eq!(scratch.tiles.len(), threads, "{case:?}");
            assert_eq!(data, expected, "{case:?}, {threads} threads");
        }
    }
}
