//! Columns of 20 as the vectors of the machine.
//!
//! Sums of products are fused, on every machine and in the same order, so that the bits do not depend on its vectors.

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, f64x8};

use crate::layout::DIM;
use crate::simd::plus;

/// Width of the blocks that are transposed and factored.
pub(super) const WIDTH: usize = 4;
pub(super) const VECTORS: usize = DIM / WIDTH;
/// Width of the widest vectors.
pub(super) const WIDE: usize = 8;

/// A column of 20: two of the widest vectors and the rest.
#[derive(Clone, Copy)]
pub(super) struct Column<S: Simd> {
    wide: [f64x8<S>; 2],
    rest: f64x4<S>,
}

impl<S: Simd> Column<S> {
    #[inline(always)]
    pub(super) fn zero(simd: S) -> Self {
        Self {
            wide: [f64x8::simd_from(simd, 0.0); 2],
            rest: f64x4::simd_from(simd, 0.0),
        }
    }

    #[inline(always)]
    pub(super) fn load(simd: S, column: &[f64; DIM]) -> Self {
        Self {
            wide: [
                f64x8::from_slice(simd, &column[..WIDE]),
                f64x8::from_slice(simd, &column[WIDE..2 * WIDE]),
            ],
            rest: f64x4::from_slice(simd, &column[2 * WIDE..]),
        }
    }

    #[inline(always)]
    pub(super) fn store(&self, into: &mut [f64; DIM]) {
        self.wide[0].store_slice(&mut into[..WIDE]);
        self.wide[1].store_slice(&mut into[WIDE..2 * WIDE]);
        self.rest.store_slice(&mut into[2 * WIDE..]);
    }

    /// This plus a x.
    #[inline(always)]
    pub(super) fn plus(self, a: f64, x: &Self) -> Self {
        Self {
            wide: [plus(self.wide[0], a, x.wide[0]), plus(self.wide[1], a, x.wide[1])],
            rest: plus(self.rest, a, x.rest),
        }
    }

    /// a times this.
    #[inline(always)]
    pub(super) fn times(self, a: f64) -> Self {
        Self {
            wide: [self.wide[0] * a, self.wide[1] * a],
            rest: self.rest * a,
        }
    }
}

/// Elements `4 v..4 v + 4` of a column.
#[inline(always)]
pub(super) fn load_part<S: Simd>(simd: S, column: &[f64; DIM], v: usize) -> f64x4<S> {
    f64x4::from_slice(simd, &column[v * WIDTH..(v + 1) * WIDTH])
}

#[inline(always)]
pub(super) fn store_part<S: Simd>(part: f64x4<S>, column: &mut [f64; DIM], v: usize) {
    part.store_slice(&mut column[v * WIDTH..(v + 1) * WIDTH]);
}
