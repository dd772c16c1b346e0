//! What a result does not depend on is not computed.

use super::{Constant, Extent, Op, Program};

impl Program {
    /// Leaves out operations and inputs whose values the output does not depend on, with their buffers' memory and
    /// their weights.
    ///
    /// Architectures have such parts, and weight files their tensors: nothing leads back from an automaton's pool
    /// node, which a StateNet computes in every layer, and its last layer's transitions end nowhere.
    /// Whole buffers are looked at, so an operation stays if anything in the buffer that it writes is read.
    pub fn prune(&mut self) {
        let Some(output) = self.output else { return };
        let mut needed = vec![false; self.buffers.len()];
        needed[output.buffer.index()] = true;
        // Backwards, as operations read what stands before them.
        let mut stays: Vec<bool> = self
            .ops
            .iter()
            .rev()
            .map(|op| {
                let stays = needed[op.writes().index()];
                if stays {
                    op.reads().iter().for_each(|b| needed[b.index()] = true);
                }
                stays
            })
            .collect();
        self.ops.retain(|_| stays.pop() == Some(true));
        self.inputs.retain(|input| needed[input.at.buffer.index()]);
        for (buffer, needed) in self.buffers.iter_mut().zip(&needed) {
            if !needed {
                buffer.rows = Extent::Fixed(0);
            }
        }
        let mut used = vec![false; self.constants.len()];
        for id in self.ops.iter().flat_map(Op::constants) {
            used[id.index()] = true;
        }
        for (values, used) in self.constants.iter_mut().zip(used) {
            if !used {
                *values = Constant::default();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::nn::program::{Activation, Extent, GraphSize, Matrix, Op, Program, Source};

    fn linear(program: &mut Program, x: Matrix, columns: usize) -> Matrix {
        let weight = program.constant(vec![1.0; x.columns * 16]);
        let bias = program.constant(vec![0.0; columns]);
        let y = program.matrix(Extent::States, columns);
        program.push(Op::Linear {
            x,
            second: None,
            weight,
            bias,
            activation: Activation::None,
            y,
        });
        y
    }

    #[test]
    fn what_the_output_does_not_need_is_left_out() {
        let mut program = Program::default();
        let inputs = [0, 1].map(|_| program.matrix(Extent::States, 3));
        for x in inputs {
            program.input(Source::StateFeatures, x);
        }
        let [used, unused] = inputs.map(|x| linear(&mut program, x, 4));
        // Read by something that nobody reads.
        linear(&mut program, unused, 4);
        linear(&mut program, used, 4);
        program.output = Some(linear(&mut program, used, 1));
        program.prune();
        program.check();
        let written: Vec<u32> = program.ops.iter().map(|op| op.writes().0).collect();
        assert_eq!(written, [2, 6]);
        assert_eq!(program.inputs.len(), 1);
        let size = GraphSize {
            states: 5,
            transitions: 0,
        };
        let room: Vec<usize> = program.buffers.iter().map(|b| b.len(size)).collect();
        assert_eq!(room, [15, 0, 20, 0, 0, 0, 5]);
        let held: Vec<bool> = program.constants.iter().map(|c| !c.is_empty()).collect();
        assert_eq!(
            held,
            [
                true, true, false, false, false, false, false, false, true, true
            ]
        );
    }
}
