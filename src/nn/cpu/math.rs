//! Elementary functions that give the same bits on every platform.

use crate::nn::program::Activation;

/// The slope of leaky ReLU below zero, in activations and in attention alike.
pub const LEAKY_SLOPE: f32 = 0.2;

/// `e^x` to about 1e-7 relative, by additions and multiplications alone.
///
/// Range reduction to `|r| <= ln 2 / 2` and the Taylor polynomial of degree 7, whose remainder is
/// below 1e-8 there. Arguments are clamped to the range in which the result is a normal number.
#[inline(always)]
#[must_use]
pub fn exp(x: f32) -> f32 {
    // Adding and taking away 1.5·2²³ rounds to the nearest integer.
    const ROUND: f32 = 12_582_912.0;
    // ln 2 in two parts, the first of few enough bits that its multiples are exact.
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-87.0, 88.0);
    let n = (x * std::f32::consts::LOG2_E + ROUND) - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    let p = 1.0 / 5040.0;
    let p = p * r + 1.0 / 720.0;
    let p = p * r + 1.0 / 120.0;
    let p = p * r + 1.0 / 24.0;
    let p = p * r + 1.0 / 6.0;
    let p = p * r + 0.5;
    let p = p * r + 1.0;
    let p = p * r + 1.0;
    p * f32::from_bits(((n as i32 + 127) as u32) << 23)
}

/// `1 / (1 + e⁻ˣ)`.
#[inline(always)]
#[must_use]
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Leaky ReLU.
#[inline(always)]
#[must_use]
pub fn leaky_relu(x: f32) -> f32 {
    // For a slope below 1 the larger of the two, without a branch.
    x.max(LEAKY_SLOPE * x)
}

/// Writes `activation(value + other + bias)` for each value, `other` being there or not.
#[inline(always)]
pub(super) fn finish_into(
    to: &mut [f32],
    values: &[f32],
    other: Option<&[f32]>,
    bias: f32,
    activation: Activation,
) {
    match activation {
        Activation::None => each(to, values, other, |v| v + bias),
        Activation::Relu => each(to, values, other, |v| (v + bias).max(0.0)),
        Activation::LeakyRelu => each(to, values, other, |v| leaky_relu(v + bias)),
        Activation::Sigmoid => each(to, values, other, |v| sigmoid(v + bias)),
    }
}

#[inline(always)]
fn each(to: &mut [f32], values: &[f32], other: Option<&[f32]>, f: impl Fn(f32) -> f32) {
    match other {
        None => to.iter_mut().zip(values).for_each(|(to, &v)| *to = f(v)),
        Some(other) => to
            .iter_mut()
            .zip(values)
            .zip(other)
            .for_each(|((to, &v), &o)| *to = f(v + o)),
    }
}

/// Adds `bias` to each value and applies the activation.
#[inline(always)]
pub fn finish(values: &mut [f32], bias: f32, activation: Activation) {
    match activation {
        Activation::None => values.iter_mut().for_each(|v| *v += bias),
        Activation::Relu => values.iter_mut().for_each(|v| *v = (*v + bias).max(0.0)),
        Activation::LeakyRelu => values.iter_mut().for_each(|v| *v = leaky_relu(*v + bias)),
        Activation::Sigmoid => values.iter_mut().for_each(|v| *v = sigmoid(*v + bias)),
    }
}

/// Applies the activation to `value`.
#[inline]
#[must_use]
pub fn activate(value: f32, activation: Activation) -> f32 {
    match activation {
        Activation::None => value,
        Activation::Relu => value.max(0.0),
        Activation::LeakyRelu => leaky_relu(value),
        Activation::Sigmoid => sigmoid(value),
    }
}

/// `Σ a·b`, in eight running sums so that it is the same everywhere and still fast.
#[inline(always)]
#[must_use]
pub fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for ((sum, x), y) in sums.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f32>() + rest
}

/// `Σ a`, in eight running sums like [`dot`].
#[must_use]
pub fn sum(a: &[f32]) -> f32 {
    let mut sums = [0.0; 8];
    let a8 = a.chunks_exact(8);
    let rest: f32 = a8.remainder().iter().sum();
    for x in a8 {
        sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
    }
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_and_sigmoid_are_accurate() {
        for k in -8000..8000 {
            let x = k as f32 * 0.01;
            let exact = f64::from(x).exp();
            assert!((f64::from(exp(x)) / exact - 1.0).abs() < 3e-7, "e^{x}");
            let exact = 1.0 / (1.0 + (-f64::from(x)).exp());
            assert!((f64::from(sigmoid(x)) - exact).abs() < 2e-7, "sigmoid {x}");
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(sigmoid(1e30), 1.0);
    }

    #[test]
    fn dot_of_any_length() {
        for n in 0..20 {
            let a: Vec<f32> = (0..n).map(|i| i as f32).collect();
            assert_eq!(dot(&a, &a), (0..n).map(|i| (i * i) as f32).sum::<f32>());
        }
    }
}
