//! Φ P Φᵀ of one filter: rows of its covariance, and then columns, lie in the lanes of vectors.
//!
//! A row of twenty is three vectors: `near` has states 1 to 8; `far` has state 0 and then states 9 to 15; `log` has the last four.
//! State 0 stands apart so that the others with dynamics fill a vector: on and below the diagonal its own row has one element, and
//! that alone is worked out as a single number.

use fearless_simd::prelude::*;
use fearless_simd::{f64x8, mask64x8};

use super::transition::{Parts, Spread};
use crate::layout::{DVL_BIAS, DYNAMIC};
use crate::simd::{columns_of_eight, symmetric_of_eight};

/// States in `near`.
pub(super) const NEAR: usize = DYNAMIC - 1;
/// States in `log`.
pub(super) const LOG: usize = 4;
/// Rows that a transition reads: those of the dynamic states and of the inertial biases.
pub(super) const READ: usize = DVL_BIAS;

/// Φ P Φᵀ in the dynamic states, and of the steady states with them; without state 0 but in its own row.
pub(super) struct Turned<S: Simd> {
    /// The dynamic states with each other, row by row.
    pub(super) near: [f64x8<S>; DYNAMIC],
    /// State 0 with itself.
    pub(super) first: f64,
    /// Row k: inertial bias k with the dynamic states.
    pub(super) biases: [f64x8<S>; READ - DYNAMIC],
}

/// An array of what follows from each row that a transition reads; written out, since a loop keeps vectors in memory.
macro_rules! each_row {
    ($i:ident => $row:expr) => {
        each_row!(@ $i $row; 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14)
    };
    (@ $i:ident $row:expr; $($k:literal)*) => {
        [$({ const $i: usize = $k; $row }),*]
    };
}
pub(super) use each_row;

/// (Φ P) Φᵀ from the rows of Φ P; the same operations on every element as [`super::Partitioned::sandwich`].
#[inline(always)]
pub(super) fn turned<S: Simd>(
    simd: S,
    near: &[f64x8<S>; DYNAMIC],
    far: &[f64x8<S>; DYNAMIC],
    phi: &impl Spread,
) -> Turned<S> {
    // Columns below row 0.
    let own = columns_of_eight([near[1], near[2], near[3], near[4], near[5], near[6], near[7], near[8]]);
    let other = columns_of_eight([far[1], far[2], far[3], far[4], far[5], far[6], far[7], far[8]]);
    // Rows side by side, right on and below the diagonal.
    let image = phi.apply_over(&[
        other[0], own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7], other[1], other[2], other[3],
        other[4], other[5], other[6],
    ]);
    let [a, b, c, d, e, f, g, h] = symmetric_of_eight(
        simd,
        [
            image[1], image[2], image[3], image[4], image[5], image[6], image[7], image[8],
        ],
    );
    // Of row 0, its element on the diagonal.
    let (x, y) = (near[0].as_array(), far[0].as_array());
    let row = Parts {
        r: [y[0], x[0], x[1]],
        rho: [x[2], x[3], x[4]],
        v: [x[5], x[6], x[7]],
        ba: [y[1], y[2], y[3]],
        bg: [y[4], y[5], y[6]],
    };
    Turned {
        near: [image[0], a, b, c, d, e, f, g, h],
        first: phi.position(&row)[0],
        biases: [other[1], other[2], other[3], other[4], other[5], other[6]],
    }
}

/// A mask of lanes by its bits.
#[inline(always)]
pub(super) fn lanes<S: Simd>(simd: S, bits: u64) -> mask64x8<S> {
    mask64x8::from_bitmask(simd, bits)
}
