//! Columns of 20 as the vectors of the machine: five of four elements.
//!
//! Sums of products are fused, on every machine and in the same order, so that the bits do not depend on its vectors.

use fearless_simd::f64x4;
use fearless_simd::prelude::*;

use crate::layout::DIM;

pub(super) const WIDTH: usize = 4;
pub(super) const VECTORS: usize = DIM / WIDTH;

/// A column of 20.
pub(super) type Column<S> = [f64x4<S>; VECTORS];

#[inline(always)]
pub(super) fn zero<S: Simd>(simd: S) -> Column<S> {
    [f64x4::simd_from(simd, 0.0); VECTORS]
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

#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, column: &[f64; DIM]) -> Column<S> {
    let mut out = zero(simd);
    for v in 0..VECTORS {
        out[v] = load_part(simd, column, v);
    }
    out
}

#[inline(always)]
pub(super) fn store<S: Simd>(column: &Column<S>, into: &mut [f64; DIM]) {
    for v in 0..VECTORS {
        store_part(column[v], into, v);
    }
}

/// y ← y + a x.
#[inline(always)]
pub(super) fn add_scaled<S: Simd>(y: &mut Column<S>, a: f64, x: &Column<S>) {
    for v in 0..VECTORS {
        y[v] = x[v].mul_add_precise(a, y[v]);
    }
}

/// a x.
#[inline(always)]
pub(super) fn scaled<S: Simd>(a: f64, x: &Column<S>) -> Column<S> {
    let mut out = *x;
    for part in &mut out {
        *part *= a;
    }
    out
}

/// The transpose of four columns of four.
#[inline(always)]
pub(super) fn transposed<S: Simd>(block: [f64x4<S>; WIDTH]) -> [f64x4<S>; WIDTH] {
    let (even_low, even_high) = (block[0].zip_low(block[2]), block[0].zip_high(block[2]));
    let (odd_low, odd_high) = (block[1].zip_low(block[3]), block[1].zip_high(block[3]));
    [
        even_low.zip_low(odd_low),
        even_low.zip_high(odd_low),
        even_high.zip_low(odd_high),
        even_high.zip_high(odd_high),
    ]
}
