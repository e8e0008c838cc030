//! One step of the covariance: P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2 (Groves 2013, Eq. 3.46).
//!
//! With several filters, one column is taken at a time, a filter in each lane. With one filter, as many neighbouring columns
//! are taken at a time as fill a vector (`Strip`). The formula is the same.
//!
//! All of it must be inlined into code compiled for the machine's vectors, closures too: with those alone left to the compiler,
//! `compare_filters` takes 1.9 times as long at `one`, and 2.9 times at `methods 8`.

use std::ops::Range;

use super::noise::HalfNoise;
use super::transition::{Parts, Transition};
use crate::layout::{ATTITUDE, DIM, DYNAMIC, POSITION, VELOCITY};
use crate::simd::{Lane, Simd, Strip, Strips, V3};

/// A symmetric covariance of one filter (as nalgebra stores it) or of several side by side.
pub type Matrix<T> = [[T; DIM]; DIM];

/// P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2, exactly symmetric once [`complete`] has mirrored the dynamic rows.
///
/// (Φ P) Φᵀ is taken on and above the diagonal alone. The products go by blocks of three rows, whose coefficients stay in registers
/// over all columns.
#[inline(always)]
pub(super) fn propagate<S: Simd, T: Strips<S>>(
    simd: S,
    p: &mut Matrix<T>,
    phi: &impl Transition<T>,
    first: &HalfNoise<T>,
    second: &HalfNoise<T>,
) {
    first.add_to(p);
    let wide = DYNAMIC.next_multiple_of(<T::Wide as Strip<S, T>>::WIDTH);
    multiply::<S, T, T::Wide>(simd, p, phi, 0..wide);
    multiply::<S, T, T::Rest>(simd, p, phi, wide..DIM);
    multiply_transposed::<S, T, T::Wide>(simd, p, phi);
    second.add_to_upper(p);
    for i in 0..DYNAMIC {
        for k in 0..i {
            p[i][k] = p[k][i];
        }
    }
}

/// P ← Φ P in place: position and velocity go before the misalignment, which they read, and the columns of the dynamic states before
/// the others, in which they may read the rows of the biases.
#[inline(always)]
fn multiply<S: Simd, T: Strips<S>, W: Strip<S, T>>(
    simd: S,
    p: &mut Matrix<T>,
    phi: &impl Transition<T>,
    range: Range<usize>,
) {
    for j in range.clone().step_by(W::WIDTH) {
        let image = phi.position(&columns::<S, T, W>(simd, p, j));
        put::<S, T, W>(p, POSITION, j, image);
    }
    for j in range.clone().step_by(W::WIDTH) {
        let image = phi.velocity(&columns::<S, T, W>(simd, p, j));
        put::<S, T, W>(p, VELOCITY, j, image);
    }
    for j in range.step_by(W::WIDTH) {
        let image = phi.attitude(&columns::<S, T, W>(simd, p, j));
        put::<S, T, W>(p, ATTITUDE, j, image);
    }
}

/// P ← P Φᵀ, row by row in place, on and above the diagonal. A block reads nothing that those before it have written.
///
/// The first row has one element there; by itself it leaves whole strips of the others.
#[inline(always)]
fn multiply_transposed<S: Simd, T: Strips<S>, W: Strip<S, T>>(simd: S, p: &mut Matrix<T>, phi: &impl Transition<T>) {
    p[0][0] = phi.position(&Parts::from_fn(
        #[inline(always)]
        |l| p[0][l],
    ))[0];
    T::turn_matrix(simd, p);
    for i in strips::<S, T, W>(POSITION) {
        let image = phi.position(&rows::<S, T, W>(simd, p, i));
        put_upper::<S, T, W>(p, POSITION, i, image);
    }
    for i in strips::<S, T, W>(VELOCITY) {
        let image = phi.velocity(&rows::<S, T, W>(simd, p, i));
        put_upper::<S, T, W>(p, VELOCITY, i, image);
    }
    for i in strips::<S, T, W>(ATTITUDE) {
        let image = phi.attitude(&rows::<S, T, W>(simd, p, i));
        put_upper::<S, T, W>(p, ATTITUDE, i, image);
    }
}

/// Where strips of the dynamic states after the first begin that hold `from` and those after it.
#[inline(always)]
fn strips<S: Simd, T: Lane, W: Strip<S, T>>(from: usize) -> impl Iterator<Item = usize> {
    let skipped = from.saturating_sub(1) / W::WIDTH;
    (1 + skipped * W::WIDTH..DYNAMIC).step_by(W::WIDTH)
}

/// Mirrors what the rows of the dynamic states have of the others.
#[inline(always)]
pub(crate) fn complete<T: Lane>(p: &mut Matrix<T>) {
    for i in 0..DYNAMIC {
        for k in DYNAMIC..DIM {
            p[k][i] = p[i][k];
        }
    }
}

/// What a transition reads of the strip of columns from j on.
#[inline(always)]
fn columns<S: Simd, T: Lane, W: Strip<S, T>>(simd: S, p: &Matrix<T>, j: usize) -> Parts<W> {
    Parts::from_fn(
        #[inline(always)]
        |l| {
            if l < DYNAMIC {
                W::take(simd, &p[l][j..])
            } else {
                W::turned(simd, p, j, l)
            }
        },
    )
}

/// What a transition reads of the strip of rows from i on.
#[inline(always)]
fn rows<S: Simd, T: Lane, W: Strip<S, T>>(simd: S, p: &Matrix<T>, i: usize) -> Parts<W> {
    Parts::from_fn(
        #[inline(always)]
        |l| W::turned(simd, p, i, l),
    )
}

/// Writes three rows of a strip of columns, from j on.
#[inline(always)]
fn put<S: Simd, T: Lane, W: Strip<S, T>>(p: &mut Matrix<T>, from: usize, j: usize, image: V3<W>) {
    for k in 0..3 {
        image[k].put(&mut p[from + k][j..]);
    }
}

/// The same as far as they reach the diagonal.
#[inline(always)]
fn put_upper<S: Simd, T: Lane, W: Strip<S, T>>(p: &mut Matrix<T>, from: usize, j: usize, image: V3<W>) {
    for k in 0..3 {
        if from + k < j + W::WIDTH {
            image[k].put(&mut p[from + k][j..]);
        }
    }
}
