//! The matrix product, from the crate `gemm`, behind checked slices.

use super::views::{Mat, MatMut};

/// Below this many multiply-adds one thread is faster than several (a few tenths of a millisecond
/// of work, against the tens of microseconds that waking threads takes).
const MULTIPLY_ADDS_PER_THREAD: usize = 40_000_000;

/// A matrix operand: element (i, j) is `data[i * row_stride + j * column_stride]`.
#[derive(Clone, Copy, Debug)]
pub struct Operand<'a> {
    /// The values.
    pub data: &'a [f32],
    /// Distance between rows.
    pub row_stride: usize,
    /// Distance between columns.
    pub column_stride: usize,
}

impl<'a> Operand<'a> {
    /// A row-major matrix.
    #[must_use]
    pub fn new(data: &'a [f32], row_stride: usize) -> Self {
        Self {
            data,
            row_stride,
            column_stride: 1,
        }
    }

    /// A view as it stands.
    #[must_use]
    pub fn from_mat(m: Mat<'a>) -> Self {
        Self::new(m.data, m.stride)
    }

    /// The transposed matrix.
    #[must_use]
    pub fn transposed(self) -> Self {
        Self {
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }

    fn holds(&self, rows: usize, columns: usize) -> bool {
        rows == 0
            || columns == 0
            || (rows - 1)
                .checked_mul(self.row_stride)
                .zip((columns - 1).checked_mul(self.column_stride))
                .and_then(|(r, c)| r.checked_add(c))
                .is_some_and(|last| last < self.data.len())
    }
}

/// `y = a · b`, or `y += a · b` with `add`; a is (rows, inner), b (inner, columns).
///
/// # Panics
/// If an operand's slice is shorter than its shape.
pub fn matmul(
    y: MatMut<'_>,
    a: Operand<'_>,
    b: Operand<'_>,
    inner: usize,
    add: bool,
    threads: usize,
) {
    let MatMut {
        data,
        rows,
        columns,
        stride,
    } = y;
    if rows == 0 || columns == 0 {
        return;
    }
    assert!(
        a.holds(rows, inner) && b.holds(inner, columns),
        "a matrix operand is too short"
    );
    assert!(
        columns <= stride || rows == 1,
        "the rows of a result overlap"
    );
    assert!(
        Operand::new(data, stride).holds(rows, columns),
        "a matrix result is too short"
    );
    let work = rows.saturating_mul(columns).saturating_mul(inner);
    let parallelism = match (work / MULTIPLY_ADDS_PER_THREAD).min(threads) {
        0 | 1 => gemm::Parallelism::None,
        n => gemm::Parallelism::Rayon(n),
    };
    let stride_of = |s: usize| isize::try_from(s).expect("a stride is shorter than its slice");
    // With one row (or column) the stride is never used, and may be longer than the slice.
    let clip = |s: usize, n: usize| if n == 1 { 1 } else { stride_of(s) };
    // SAFETY: every element that `gemm` reads or writes has an index below the length of its
    // slice, which the assertions above establish for the last element of each; rows of the
    // result do not overlap, and `data` is borrowed exclusively.
    #[allow(unsafe_code)] // the one place: the crate's interface takes pointers
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            data.as_mut_ptr(),
            1,
            clip(stride, rows),
            add,
            a.data.as_ptr(),
            clip(a.column_stride, inner),
            clip(a.row_stride, rows),
            b.data.as_ptr(),
            clip(b.column_stride, columns),
            clip(b.row_stride, inner),
            1.0,
            1.0,
            false,
            false,
            false,
            parallelism,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strided_product_matches_the_definition() {
        for (m, n, k) in [
            (1, 1, 1),
            (3, 5, 4),
            (7, 1, 9),
            (1, 6, 3),
            (17, 33, 19),
            (2, 3, 0),
        ] {
            let (sa, sb, sy) = (k + 2, n + 1, n + 3);
            let value = |i: usize| ((i * 37 + 11) % 23) as f32 - 11.0;
            let a: Vec<f32> = (0..m * sa).map(value).collect();
            let b: Vec<f32> = (0..k.max(1) * sb).map(|i| value(i + 5)).collect();
            let mut y = vec![0.5; m * sy];
            let out = MatMut {
                data: &mut y,
                rows: m,
                columns: n,
                stride: sy,
            };
            matmul(out, Operand::new(&a, sa), Operand::new(&b, sb), k, true, 1);
            for i in 0..m {
                for j in 0..n {
                    let exact: f32 = (0..k).map(|l| a[i * sa + l] * b[l * sb + j]).sum();
                    assert_eq!(y[i * sy + j], 0.5 + exact);
                }
                assert!(y[i * sy + n..(i + 1) * sy].iter().all(|&v| v == 0.5));
            }
        }
    }

    #[test]
    #[should_panic(expected = "too short")]
    fn short_slices_are_refused() {
        let mut y = [0.0; 4];
        let out = MatMut {
            data: &mut y,
            rows: 2,
            columns: 2,
            stride: 2,
        };
        matmul(
            out,
            Operand::new(&[0.0; 5], 3),
            Operand::new(&[0.0; 6], 2),
            3,
            false,
            1,
        );
    }
}
