//! Graph layers.

use crate::nn::config::POOL_WIDTH;
use crate::nn::program::{Activation, Edges, Extent, Map, Matrix, Op, Program, Sign, Source};
use crate::nn::weights::{EdgeWeights, TensorSource};

/// Coordinate planes beside what the automaton looks at.
pub(super) const PLANES: usize = 5;

/// A number or a view for each node type.
#[derive(Clone, Copy, Debug)]
pub(super) struct PerType<T> {
    pub(super) state: T,
    pub(super) transition: T,
    pub(super) pool: T,
}

impl<T: Copy> PerType<T> {
    pub(super) fn same(value: T) -> Self {
        Self {
            state: value,
            transition: value,
            pool: value,
        }
    }
}

/// Features as the encoding gives them: 3, `labels` and the pool's constant.
pub(super) fn plain_widths(labels: usize) -> PerType<usize> {
    PerType {
        state: 3,
        transition: labels,
        pool: POOL_WIDTH,
    }
}

/// The input of a graph layer: for each node type its own features, and what it gathers along
/// each type of edges, so that one linear layer over both finishes the node type.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerInput {
    own: PerType<Matrix>,
    gathered: PerType<Matrix>,
    reverse: bool,
}

impl LayerInput {
    pub(super) fn new(program: &mut Program, widths: PerType<usize>, reverse: bool) -> Self {
        let ways = if reverse { 2 } else { 1 };
        let PerType {
            state,
            transition,
            pool,
        } = widths;
        let mut per_type = |state, transition, pool| PerType {
            state: program.matrix(Extent::States, state),
            transition: program.matrix(Extent::Transitions, transition),
            pool: program.matrix(Extent::Fixed(1), pool),
        };
        Self {
            own: per_type(state, transition, pool),
            gathered: per_type(ways * transition, ways * state, state + transition),
            reverse,
        }
    }

    /// Where the nodes' own features stand.
    pub(super) fn own(&self) -> PerType<Matrix> {
        self.own
    }

    /// Fills the features that the encoding gives.
    pub(super) fn plain(&self, program: &mut Program, labels: usize) {
        let own = self.own();
        program.input(Source::StateFeatures, own.state.columns(0, 3));
        program.input(Source::Literals, own.transition.columns(0, labels));
        program.input(Source::Constant(0.5), own.pool.columns(0, POOL_WIDTH));
    }

    /// One graph layer; its results, as wide as `to`, go there.
    pub(super) fn layer(
        &self,
        source: &mut TensorSource<'_>,
        program: &mut Program,
        prefix: &str,
        activation: Activation,
        to: PerType<Matrix>,
    ) {
        let Self {
            own,
            gathered,
            reverse,
        } = *self;
        let edge = |name, edges, from| Edge { name, edges, from };
        let mut to_state = vec![edge(
            "transition_to_state",
            Edges::TransitionToState,
            own.transition,
        )];
        let mut to_transition = vec![edge(
            "state_to_transition",
            Edges::StateToTransition,
            own.state,
        )];
        if reverse {
            to_state.push(edge(
                "transition_to_source",
                Edges::TransitionToSource,
                own.transition,
            ));
            to_transition.push(edge(
                "target_to_transition",
                Edges::TargetToTransition,
                own.state,
            ));
        }
        let to_pool = [
            edge("state_to_pool", Edges::StateToPool, own.state),
            edge(
                "transition_to_pool",
                Edges::TransitionToPool,
                own.transition,
            ),
        ];
        let mut finish =
            |loop_name: &str, own: Matrix, edges: &[Edge], gathered: Matrix, y: Matrix| {
                let names: Vec<String> = std::iter::once(loop_name)
                    .chain(edges.iter().map(|e| e.name))
                    .map(|name| format!("{prefix}.{name}"))
                    .collect();
                let sources = std::iter::once(own).chain(edges.iter().map(|e| e.from));
                let weights: Vec<EdgeWeights<'_>> = names
                    .iter()
                    .zip(sources)
                    .map(|(name, from)| EdgeWeights {
                        name,
                        source: from.columns,
                        target: own.columns,
                    })
                    .collect();
                let (weight, bias, attention) = source.gat(program, &weights, y.columns);
                let mut column = 0;
                // A node's own loop needs no attention: it is the first, and gathers nothing.
                for (edge, &attention) in edges.iter().zip(&attention[1..]) {
                    let y = gathered.columns(column, edge.from.columns);
                    column += edge.from.columns;
                    program.push(Op::Gat {
                        source: edge.from,
                        target: own,
                        attention,
                        edges: edge.edges,
                        y,
                    });
                }
                let (x, second) = (own, Some(gathered));
                program.push(Op::Linear {
                    x,
                    second,
                    weight,
                    bias,
                    activation,
                    y,
                });
            };
        finish("state_self", own.state, &to_state, gathered.state, to.state);
        finish(
            "transition_self",
            own.transition,
            &to_transition,
            gathered.transition,
            to.transition,
        );
        finish("pool_self", own.pool, &to_pool, gathered.pool, to.pool);
    }
}

/// One edge type that ends in the node type at hand.
struct Edge {
    name: &'static str,
    edges: Edges,
    from: Matrix,
}

/// A stack of graph layers `graph.0`, `graph.1`, …; returns the nodes after each.
pub(super) fn stack(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    input: LayerInput,
    widths: &[usize],
) -> Vec<PerType<Matrix>> {
    let mut input = input;
    let mut after = Vec::new();
    for (k, &out) in widths.iter().enumerate() {
        let next = (k + 1 < widths.len())
            .then(|| LayerInput::new(program, PerType::same(out), input.reverse));
        let to = next.map_or_else(
            || PerType {
                state: program.matrix(Extent::States, out),
                transition: program.matrix(Extent::Transitions, out),
                pool: program.matrix(Extent::Fixed(1), out),
            },
            |next| next.own(),
        );
        input.layer(source, program, &format!("graph.{k}"), Activation::Relu, to);
        after.push(to);
        input = next.unwrap_or(input);
    }
    after
}

/// The graph feature: mean over states, mean over transitions, pool node, side by side.
pub(super) fn graph_feature(program: &mut Program, nodes: PerType<Matrix>) -> Matrix {
    let width = nodes.pool.columns;
    let feature = program.matrix(Extent::Fixed(1), 3 * width);
    program.push(Op::MeanRows {
        x: nodes.state,
        y: feature.columns(0, width),
    });
    program.push(Op::MeanRows {
        x: nodes.transition,
        y: feature.columns(width, width),
    });
    program.push(Op::CopyRows {
        x: nodes.pool,
        y: feature.columns(2 * width, width),
    });
    feature
}

/// The input of the first graph layer when nodes look at the map: what stands under the regions
/// that a transition needs and forbids, and at the start (`docs/networks.md`, Looking at the map).
///
/// The last [`PLANES`] channels of `features` are filled here.
pub(super) fn look(
    program: &mut Program,
    features: Map,
    labels: usize,
    reverse: bool,
) -> LayerInput {
    let planes = features.channels(features.channels - PLANES, PLANES);
    program.input(Source::Planes, planes.as_matrix());
    let mask = program.map(labels + 1, features.height, features.width);
    program.input(Source::Masks, mask.as_matrix());
    let looked = features.channels;
    let rows = program.matrix(Extent::Fixed(labels + 1), looked);
    program.push(Op::RegionMean {
        x: features,
        mask,
        y: rows,
    });
    see(program, rows, labels, reverse)
}

/// The input of the first graph layer when nodes see a row for each region and one for the start: transitions the means of
/// those that they need and forbid, the others that of the start.
pub(super) fn see(program: &mut Program, rows: Matrix, labels: usize, reverse: bool) -> LayerInput {
    let looked = rows.columns;
    let (regions, here) = (rows.rows(0, labels), rows.rows(labels, 1));
    let plain = plain_widths(labels);
    let widths = PerType {
        state: plain.state + looked,
        transition: plain.transition + 2 * looked,
        pool: plain.pool + looked,
    };
    let input = LayerInput::new(program, widths, reverse);
    input.plain(program, labels);
    let own = input.own();
    program.push(Op::RepeatRow {
        x: here,
        y: own.state.columns(plain.state, looked),
    });
    program.push(Op::RepeatRow {
        x: here,
        y: own.pool.columns(plain.pool, looked),
    });
    // The literals once more by themselves: an operation does not read the buffer that it writes.
    let literals = program.matrix(Extent::Transitions, labels);
    program.input(Source::Literals, literals);
    for (k, sign) in [Sign::Positive, Sign::Negative].into_iter().enumerate() {
        let y = own
            .transition
            .columns(plain.transition + k * looked, looked);
        program.push(Op::SignMean {
            literals,
            x: regions,
            sign,
            y,
        });
    }
    input
}
