//! The arithmetic of an update over whole columns of 20, four elements at a time in the vectors of the machine.
//!
//! Every element is worked out by the same operations in the same order on every machine, without fused multiply–add.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f64x4};
use nalgebra::SMatrix;

use crate::lane::level;
use crate::layout::DIM;
use crate::state::Covariance;

const WIDTH: usize = 4;
const VECTORS: usize = DIM / WIDTH;

/// A column of 20.
type Column<S> = [f64x4<S>; VECTORS];

#[inline(always)]
fn load<S: Simd>(simd: S, column: &[f64; DIM]) -> Column<S> {
    let mut out = [f64x4::simd_from(simd, 0.0); VECTORS];
    for (vector, part) in out.iter_mut().zip(column.chunks_exact(WIDTH)) {
        *vector = f64x4::from_slice(simd, part);
    }
    out
}

#[inline(always)]
fn store<S: Simd>(column: &Column<S>, into: &mut [f64; DIM]) {
    for (vector, part) in column.iter().zip(into.chunks_exact_mut(WIDTH)) {
        vector.store_slice(part);
    }
}

/// y ← y + a x.
#[inline(always)]
fn add_scaled<S: Simd>(y: &mut Column<S>, a: f64, x: &Column<S>) {
    for k in 0..VECTORS {
        y[k] += x[k] * a;
    }
}

#[inline(always)]
fn divided<S: Simd>(column: Column<S>, divisor: f64) -> Column<S> {
    let mut out = column;
    for part in &mut out {
        *part /= divisor;
    }
    out
}

/// A Bᵀ with B of few rows, as columns; columns of A that B does not reach are left out.
#[inline(always)]
fn times_transposed<S: Simd, const M: usize>(
    simd: S,
    a: &[[f64; DIM]; DIM],
    b: &SMatrix<f64, M, DIM>,
) -> SMatrix<f64, DIM, M> {
    let mut sums = [[f64x4::simd_from(simd, 0.0); VECTORS]; M];
    for k in 0..DIM {
        let column = load(simd, &a[k]);
        for m in 0..M {
            if b[(m, k)] != 0.0 {
                add_scaled(&mut sums[m], b[(m, k)], &column);
            }
        }
    }
    let mut out = SMatrix::zeros();
    for m in 0..M {
        store(&sums[m], &mut out.data.0[m]);
    }
    out
}

/// P Hᵀ.
pub(super) fn reach<const M: usize>(p: &Covariance, h: &SMatrix<f64, M, DIM>) -> SMatrix<f64, DIM, M> {
    dispatch!(level(), simd => times_transposed(simd, &p.data.0, h))
}

/// X S⁻¹ with S = L Lᵀ.
pub(super) fn gain<const M: usize>(reach: &SMatrix<f64, DIM, M>, l: &SMatrix<f64, M, M>) -> SMatrix<f64, DIM, M> {
    dispatch!(level(), simd => solve(simd, reach, l))
}

#[inline(always)]
fn solve<S: Simd, const M: usize>(
    simd: S,
    reach: &SMatrix<f64, DIM, M>,
    l: &SMatrix<f64, M, M>,
) -> SMatrix<f64, DIM, M> {
    let mut x = [[f64x4::simd_from(simd, 0.0); VECTORS]; M];
    for i in 0..M {
        let mut own = load(simd, &reach.data.0[i]);
        for k in 0..i {
            add_scaled(&mut own, -l[(i, k)], &x[k]);
        }
        x[i] = divided(own, l[(i, i)]);
    }
    for i in (0..M).rev() {
        let mut own = x[i];
        for k in i + 1..M {
            add_scaled(&mut own, -l[(k, i)], &x[k]);
        }
        x[i] = divided(own, l[(i, i)]);
    }
    let mut out = SMatrix::zeros();
    for i in 0..M {
        store(&x[i], &mut out.data.0[i]);
    }
    out
}

/// Joseph's form (I − K H) P (I − K H)ᵀ + K R Kᵀ, its products expanded to rank M; not symmetric to the last bit.
pub(super) fn joseph<const M: usize>(
    p: &Covariance,
    ph: &SMatrix<f64, DIM, M>,
    gain: &SMatrix<f64, DIM, M>,
    h: &SMatrix<f64, M, DIM>,
    r: &SMatrix<f64, M, M>,
) -> Covariance {
    dispatch!(level(), simd => expanded(simd, p, ph, gain, h, r))
}

#[inline(always)]
fn expanded<S: Simd, const M: usize>(
    simd: S,
    p: &Covariance,
    ph: &SMatrix<f64, DIM, M>,
    gain: &SMatrix<f64, DIM, M>,
    h: &SMatrix<f64, M, DIM>,
    r: &SMatrix<f64, M, M>,
) -> Covariance {
    let zero = f64x4::simd_from(simd, 0.0);
    let (mut k, mut k_r) = ([[zero; VECTORS]; M], [[zero; VECTORS]; M]);
    for m in 0..M {
        k[m] = load(simd, &gain.data.0[m]);
    }
    for m in 0..M {
        for n in 0..M {
            add_scaled(&mut k_r[m], r[(n, m)], &k[n]);
        }
    }
    // (I − K H) P, column by column.
    let mut left = *p;
    for (j, column) in left.data.0.iter_mut().enumerate() {
        let mut own = load(simd, column);
        for m in 0..M {
            add_scaled(&mut own, -ph[(j, m)], &k[m]);
        }
        store(&own, column);
    }
    // Less (I − K H) P Hᵀ Kᵀ, plus K R Kᵀ.
    let left_h = times_transposed(simd, &left.data.0, h);
    let mut rest = [[zero; VECTORS]; M];
    for m in 0..M {
        rest[m] = load(simd, &left_h.data.0[m]);
    }
    for (j, column) in left.data.0.iter_mut().enumerate() {
        let mut own = load(simd, column);
        for m in 0..M {
            add_scaled(&mut own, -gain[(j, m)], &rest[m]);
        }
        for m in 0..M {
            add_scaled(&mut own, gain[(j, m)], &k_r[m]);
        }
        store(&own, column);
    }
    left
}

/// The mean of a matrix and its transpose.
pub(super) fn symmetric(matrix: &Covariance) -> Covariance {
    let mut out = *matrix;
    for j in 0..DIM {
        for i in 0..j {
            let mean = (matrix[(i, j)] + matrix[(j, i)]) * 0.5;
            out[(i, j)] = mean;
            out[(j, i)] = mean;
        }
    }
    out
}

/// True where Cholesky's factorisation exists; states without variance are left out.
///
/// Scaling to unit diagonal keeps metres and radians per second from hiding each other.
pub(super) fn is_positive_definite(covariance: &Covariance) -> bool {
    dispatch!(level(), simd => factorises(simd, covariance))
}

#[inline(always)]
fn factorises<S: Simd>(simd: S, covariance: &Covariance) -> bool {
    let mut scale = [0.0; DIM];
    for k in 0..DIM {
        let variance = covariance[(k, k)];
        if variance > 0.0 {
            scale[k] = variance.sqrt().recip();
        } else if variance != 0.0 || covariance.column(k).amax() != 0.0 {
            return false;
        }
    }
    let scales = load(simd, &scale);
    let zero = f64x4::simd_from(simd, 0.0);
    let mut factor = [[zero; VECTORS]; DIM];
    for j in 0..DIM {
        if scale[j] == 0.0 {
            continue;
        }
        // The elements above the diagonal come out as zeros but for rounding, and nobody reads them.
        let mut own = load(simd, &covariance.data.0[j]);
        for k in 0..VECTORS {
            own[k] *= scales[k] * scale[j];
        }
        for column in &factor[..j] {
            add_scaled(&mut own, -column[j / WIDTH][j % WIDTH], column);
        }
        let pivot = own[j / WIDTH][j % WIDTH];
        if !(pivot > 0.0) {
            return false;
        }
        factor[j] = divided(own, pivot.sqrt());
    }
    true
}

#[cfg(test)]
#[path = "correct_tests.rs"]
mod tests;
