//! Columns of 20 as the vectors of the machine.
//!
//! Sums of products are fused, on every machine and in the same order, so that the bits do not depend on its vectors.

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, f64x8};

use super::{columns_of_four, plus};
use crate::layout::DIM;

/// Width of the blocks that are transposed and factored.
pub(crate) const WIDTH: usize = 4;
pub(crate) const VECTORS: usize = DIM / WIDTH;
/// Width of the widest vectors.
pub(crate) const WIDE: usize = 8;

/// A column of 20: two of the widest vectors and the rest.
#[derive(Clone, Copy)]
pub(crate) struct Column<S: Simd> {
    wide: [f64x8<S>; 2],
    rest: f64x4<S>,
}

impl<S: Simd> Column<S> {
    #[inline(always)]
    pub(crate) fn zero(simd: S) -> Self {
        Self {
            wide: [f64x8::simd_from(simd, 0.0); 2],
            rest: f64x4::simd_from(simd, 0.0),
        }
    }

    #[inline(always)]
    pub(crate) fn load(simd: S, column: &[f64; DIM]) -> Self {
        Self {
            wide: [
                f64x8::from_slice(simd, &column[..WIDE]),
                f64x8::from_slice(simd, &column[WIDE..2 * WIDE]),
            ],
            rest: f64x4::from_slice(simd, &column[2 * WIDE..]),
        }
    }

    #[inline(always)]
    pub(crate) fn store(&self, into: &mut [f64; DIM]) {
        self.wide[0].store_slice(&mut into[..WIDE]);
        self.wide[1].store_slice(&mut into[WIDE..2 * WIDE]);
        self.rest.store_slice(&mut into[2 * WIDE..]);
    }

    /// This plus a x.
    #[inline(always)]
    pub(crate) fn plus(self, a: f64, x: &Self) -> Self {
        Self {
            wide: [plus(self.wide[0], a, x.wide[0]), plus(self.wide[1], a, x.wide[1])],
            rest: plus(self.rest, a, x.rest),
        }
    }

    /// a times this.
    #[inline(always)]
    pub(crate) fn times(self, a: f64) -> Self {
        Self {
            wide: [self.wide[0] * a, self.wide[1] * a],
            rest: self.rest * a,
        }
    }
}

/// Elements `4 v..4 v + 4` of a column.
#[inline(always)]
pub(crate) fn load_part<S: Simd>(simd: S, column: &[f64; DIM], v: usize) -> f64x4<S> {
    f64x4::from_slice(simd, &column[v * WIDTH..(v + 1) * WIDTH])
}

/// The inverse of [`load_part`].
#[inline(always)]
pub(crate) fn store_part<S: Simd>(part: f64x4<S>, column: &mut [f64; DIM], v: usize) {
    part.store_slice(&mut column[v * WIDTH..(v + 1) * WIDTH]);
}

/// The mean of a matrix of columns and its transpose, which is symmetric.
#[inline(always)]
pub(crate) fn make_symmetric<S: Simd>(simd: S, matrix: &mut [[f64; DIM]; DIM]) {
    for b in 0..VECTORS {
        for v in b..VECTORS {
            let above = columns_of_four(block(simd, matrix, v, b));
            let mut below = block(simd, matrix, b, v);
            for q in 0..WIDTH {
                below[q] = (below[q] + above[q]) * 0.5;
                store_part(below[q], &mut matrix[WIDTH * b + q], v);
            }
            let mirrored = columns_of_four(below);
            for q in 0..WIDTH {
                store_part(mirrored[q], &mut matrix[WIDTH * v + q], b);
            }
        }
    }
}

/// Rows `4 v..4 v + 4` of the columns `4 b..4 b + 4`.
#[inline(always)]
fn block<S: Simd>(simd: S, matrix: &[[f64; DIM]; DIM], b: usize, v: usize) -> [f64x4<S>; WIDTH] {
    let mut out = [f64x4::simd_from(simd, 0.0); WIDTH];
    for q in 0..WIDTH {
        out[q] = load_part(simd, &matrix[WIDTH * b + q], v);
    }
    out
}

/// The same number in four lanes.
#[inline(always)]
pub(crate) fn four<S: Simd>(simd: S, value: f64) -> f64x4<S> {
    f64x4::simd_from(simd, value)
}

/// Four numbers from a place in a slice on.
#[inline(always)]
pub(crate) fn load_four<S: Simd>(simd: S, from: &[f64], at: usize) -> f64x4<S> {
    f64x4::from_slice(simd, &from[at..at + WIDTH])
}

/// True where four numbers are zero.
#[inline(always)]
pub(crate) fn are_zero<S: Simd>(four: f64x4<S>) -> bool {
    four.simd_eq(0.0).all_true()
}
