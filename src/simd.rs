//! The processor's vector instructions, chosen when the program runs.

use pulp::{Simd, WithSimd};

/// Work that [`vectorised`] runs.
pub(crate) struct Work<F>(pub(crate) F);

impl<R, F: FnMut() -> R> WithSimd for Work<F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> R {
        (self.0)()
    }
}

/// Evaluates an expression with the widest vector instructions that the processor has.
///
/// Compilers use them for what is inlined into the function that they are switched on for, and for
/// nothing else. So the closure must be inlined whatever its size, and must not be called
/// by way of `FnOnce`: that is a function of its own, which is compiled for every processor (a closure that
/// was handed to [`pulp::Arch::dispatch`] itself ran with SSE2).
macro_rules! vectorised {
    ($work:expr) => {
        pulp::Arch::new().dispatch($crate::simd::Work(
            #[inline(always)]
            || $work,
        ))
    };
}

pub(crate) use vectorised;

#[cfg(test)]
mod tests {
    /// Sixteen sums of sixteen products: what vectors are for.
    #[inline(always)]
    fn sums(values: &[f32; 256]) -> [f32; 16] {
        let mut sums = [0.0; 16];
        for line in values.as_chunks::<16>().0 {
            sums.iter_mut().zip(line).for_each(|(sum, v)| *sum += v * v);
        }
        sums
    }

    #[test]
    fn results_are_those_of_plain_code() {
        let values = std::array::from_fn(|i| (i % 7) as f32);
        let mut seen = [0.0; 16];
        let count = vectorised!({
            seen = sums(&values);
            seen.len()
        });
        assert_eq!((seen, count), (sums(&values), 16));
    }
}
