//! Means and maxima.

use super::views::{Mat, MatMut, Planes, PlanesMut};
use crate::nn::program::Window;

/// The largest value under the window; padding never wins.
pub fn max_pool2d(x: Planes<'_>, window: Window, y: PlanesMut<'_>) {
    let Window {
        kernel,
        stride,
        padding,
    } = window;
    let span = |o: usize, size: usize| {
        (o * stride).saturating_sub(padding)
            ..(o * stride + kernel).saturating_sub(padding).min(size)
    };
    let mut out = y.data.iter_mut();
    for channel in 0..y.channels {
        let plane = x.channel(channel);
        for oy in 0..y.height {
            for ox in 0..y.width {
                let mut best = f32::NEG_INFINITY;
                for iy in span(oy, x.height) {
                    for &value in &plane[iy * x.width..][span(ox, x.width)] {
                        best = best.max(value);
                    }
                }
                if let Some(to) = out.next() {
                    *to = best;
                }
            }
        }
    }
}

/// The mean over all cells of each channel.
pub fn global_mean_pool(x: Planes<'_>, mut y: MatMut<'_>) {
    let scale = 1.0 / (x.height * x.width) as f32;
    for (channel, to) in y.row(0).iter_mut().enumerate() {
        *to = super::math::sum(x.channel(channel)) * scale;
    }
}

/// The mean of the rows; zero without rows.
pub fn mean_rows(x: Mat<'_>, mut y: MatMut<'_>) {
    let mean = y.row(0);
    mean.fill(0.0);
    for i in 0..x.rows {
        mean.iter_mut().zip(x.row(i)).for_each(|(sum, v)| *sum += v);
    }
    let scale = 1.0 / x.rows.max(1) as f32;
    mean.iter_mut().for_each(|v| *v *= scale);
}
