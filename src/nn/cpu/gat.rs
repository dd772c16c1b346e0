//! Attention over the edges of a graph.

use super::math::{dot, exp, leaky_relu};
use super::views::{Mat, MatMut, Scratch, at_least};
use crate::encoding::Incoming;
use crate::simd::vectorised;

/// Row `t` of `y` is `Σ α x_s` over the incoming edges of target `t`, `α` being the softmax of
/// `leaky_relu(a_src · x_s + a_dst · x_t)`; zero without edges.
///
/// `attention` is `a_src` and then `a_dst`. This is the weighted sum of `GATConv` before its
/// projection, which is linear and so may come after it.
pub fn gat(
    source: Mat<'_>,
    target: Mat<'_>,
    attention: &[f32],
    edges: &Incoming,
    mut y: MatMut<'_>,
    scratch: &mut Scratch,
) {
    vectorised!(attend(
        [source, target],
        attention,
        edges,
        y.reborrow(),
        scratch
    ));
}

#[inline(always)]
fn attend(
    [source, target]: [Mat<'_>; 2],
    attention: &[f32],
    edges: &Incoming,
    mut y: MatMut<'_>,
    scratch: &mut Scratch,
) {
    let (to_source, to_target) = attention.split_at(source.columns);
    let single = edges.offsets.windows(2).all(|w| w[1] - w[0] <= 1);
    let scores = at_least(&mut scratch.tile, source.rows);
    let weights = at_least(&mut scratch.panel, source.rows.max(edges.sources.len()));
    if !single {
        // Without rivals for a target's attention the softmax is 1 whatever the scores are.
        scores
            .iter_mut()
            .enumerate()
            .for_each(|(s, score)| *score = dot(source.row(s), to_source));
    }
    for t in 0..y.rows {
        let incoming = &edges.sources[edges.offsets[t] as usize..edges.offsets[t + 1] as usize];
        let row = y.row(t);
        match incoming {
            [] => row.fill(0.0),
            [s] => row.copy_from_slice(source.row(*s as usize)),
            _ => {
                row.fill(0.0);
                let own = dot(target.row(t), to_target);
                let weights = &mut weights[..incoming.len()];
                softmax(
                    incoming
                        .iter()
                        .map(|&s| leaky_relu(scores[s as usize] + own)),
                    weights,
                );
                for (&s, &weight) in incoming.iter().zip(weights.iter()) {
                    row.iter_mut()
                        .zip(source.row(s as usize))
                        .for_each(|(v, x)| *v += weight * x);
                }
            }
        }
    }
}

/// Writes `e^score / Σ e^score`, computed relative to the largest score.
#[inline(always)]
fn softmax(scores: impl Iterator<Item = f32>, weights: &mut [f32]) {
    let mut largest = f32::NEG_INFINITY;
    for (weight, score) in weights.iter_mut().zip(scores) {
        *weight = score;
        largest = largest.max(score);
    }
    let mut total = 0.0;
    for weight in weights.iter_mut() {
        *weight = exp(*weight - largest);
        total += *weight;
    }
    weights.iter_mut().for_each(|weight| *weight /= total);
}
