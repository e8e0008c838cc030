//! Rows of vectors turned into columns.

use fearless_simd::prelude::*;
use fearless_simd::{f64x4, f64x8};

/// Columns of four rows.
#[inline(always)]
pub(crate) fn columns_of_four<S: Simd>([a, b, c, d]: [f64x4<S>; 4]) -> [f64x4<S>; 4] {
    let (ac, bd) = ((a.zip_low(c), a.zip_high(c)), (b.zip_low(d), b.zip_high(d)));
    [
        ac.0.zip_low(bd.0),
        ac.0.zip_high(bd.0),
        ac.1.zip_low(bd.1),
        ac.1.zip_high(bd.1),
    ]
}

/// Columns of eight rows.
#[inline(always)]
pub(crate) fn columns_of_eight<S: Simd>(rows: [f64x8<S>; 8]) -> [f64x8<S>; 8] {
    halfway(halfway(halfway(rows)))
}

/// Like a pack of cards, thrice for a transposed matrix.
#[inline(always)]
fn halfway<S: Simd>([a, b, c, d, e, f, g, h]: [f64x8<S>; 8]) -> [f64x8<S>; 8] {
    [
        a.zip_low(e),
        a.zip_high(e),
        b.zip_low(f),
        b.zip_high(f),
        c.zip_low(g),
        c.zip_high(g),
        d.zip_low(h),
        d.zip_high(h),
    ]
}
