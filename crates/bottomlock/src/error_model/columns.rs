//! P ← Φ P Φᵀ of one filter, four columns and then four rows of its covariance in the lanes of vectors.

use fearless_simd::f64x4;
use fearless_simd::prelude::*;

use super::ProcessNoise;
use super::interval::Span;
use super::transition::Spread;
use crate::imu::{EarthTerms, Kinematics};
use crate::layout::{DIM, DVL_BIAS, DYNAMIC};

/// Elements side by side.
const WIDTH: usize = 4;
const CHUNKS: usize = DIM / WIDTH;
/// Dynamic rows that fill whole vectors; one is left over.
const WHOLE: usize = DYNAMIC / WIDTH;
const LEFT: usize = DYNAMIC - 1;

/// [`Span::propagate`] on a whole matrix, bit for bit.
#[inline(always)]
pub(super) fn propagate<S: Simd, I>(
    simd: S,
    interval: &mut I,
    p: &mut [[f64; DIM]; DIM],
    end: &Kinematics<f64>,
    noise: &ProcessNoise,
    earth: &EarthTerms,
) where
    for<'a> I: Span<f64, Phi<'a>: Spread> + 'a,
{
    interval.first_noise(noise).add_to_dense(p);
    sandwich(simd, p, &interval.transition(end, earth));
    interval.second_noise(end, noise).add_to_dense(p);
    interval.empty(end);
}

/// The same operations on every element as [`super::Partitioned::sandwich`].
#[inline(always)]
fn sandwich<S: Simd>(simd: S, p: &mut [[f64; DIM]; DIM], phi: &impl Spread) {
    let zero = f64x4::simd_from(simd, 0.0);
    // Rows of Φ P, four elements at a time; P is symmetric, so they stand in a row of the storage.
    let (mut x, mut rows) = ([[zero; DIM]; CHUNKS], [[zero; DYNAMIC]; CHUNKS]);
    for c in 0..CHUNKS {
        for i in 0..DVL_BIAS {
            x[c][i] = f64x4::from_slice(simd, &p[i][c * WIDTH..(c + 1) * WIDTH]);
        }
    }
    phi.apply_over(&x, &mut rows);
    // Its columns.
    let mut columns = [[zero; WHOLE]; DIM];
    for c in 0..CHUNKS {
        for b in 0..WHOLE {
            let block = [
                rows[c][4 * b],
                rows[c][4 * b + 1],
                rows[c][4 * b + 2],
                rows[c][4 * b + 3],
            ];
            for (k, column) in transposed(block).into_iter().enumerate() {
                columns[c * WIDTH + k][b] = column;
            }
        }
    }
    let mut left = [0.0; DIM];
    for c in 0..CHUNKS {
        rows[c][LEFT].store_slice(&mut left[c * WIDTH..(c + 1) * WIDTH]);
    }
    // With the steady states that is all.
    for i in 0..DYNAMIC {
        for c in DYNAMIC / WIDTH..CHUNKS {
            rows[c][i].store_slice(&mut p[i][c * WIDTH..(c + 1) * WIDTH]);
        }
    }
    for j in DYNAMIC..DIM {
        for b in 0..WHOLE {
            columns[j][b].store_slice(&mut p[j][b * WIDTH..(b + 1) * WIDTH]);
        }
        p[j][LEFT] = left[j];
    }
    // (Φ P) Φᵀ by rows, right on and below the diagonal.
    let (mut x, mut image) = ([[zero; DIM]; WHOLE], [[zero; DYNAMIC]; WHOLE]);
    for b in 0..WHOLE {
        for j in 0..DVL_BIAS {
            x[b][j] = columns[j][b];
        }
    }
    phi.apply_over(&x, &mut image);
    for b in 0..WHOLE {
        for k in 0..DYNAMIC {
            image[b][k].store_slice(&mut p[k][b * WIDTH..(b + 1) * WIDTH]);
        }
    }
    let image = phi.apply(&left);
    for k in 0..DYNAMIC {
        p[k][LEFT] = image[k];
        for i in 0..k {
            p[k][i] = p[i][k];
        }
    }
}

#[inline(always)]
fn transposed<S: Simd>([a, b, c, d]: [f64x4<S>; 4]) -> [f64x4<S>; 4] {
    let (ac, bd) = ((a.zip_low(c), a.zip_high(c)), (b.zip_low(d), b.zip_high(d)));
    [
        ac.0.zip_low(bd.0),
        ac.0.zip_high(bd.0),
        ac.1.zip_low(bd.1),
        ac.1.zip_high(bd.1),
    ]
}
