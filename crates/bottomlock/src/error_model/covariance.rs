//! One step of the covariance: P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2 (Groves 2013, Eq. 3.46).

use super::noise::HalfNoise;
use super::transition::{Parts, Transition};
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DVL_BIAS, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};
use crate::simd::{Lane, V3, add};

/// A symmetric covariance of one filter (as nalgebra stores it) or of several side by side.
pub type Matrix<T> = [[T; DIM]; DIM];

/// P⁺ = Φ (P + Q₀ T/2) Φᵀ + Q₁ T/2, exactly symmetric but for the rows of the DVL's states: [`complete`] mirrors those.
///
/// The products are taken by blocks of three rows, whose coefficients stay in registers over all columns.
#[inline(always)]
pub(super) fn propagate<T: Lane>(
    p: &mut Matrix<T>,
    phi: &impl Transition<T>,
    first: &HalfNoise<T>,
    second: &HalfNoise<T>,
) {
    first.add_to(p);
    // Φ P, column by column in place: position and velocity go before the misalignment, which they read.
    for j in 0..DIM {
        let image = phi.position(&column(p, j));
        put(p, POSITION, j, image);
    }
    for j in 0..DIM {
        let image = phi.velocity(&column(p, j));
        put(p, VELOCITY, j, image);
    }
    for j in 0..DIM {
        let image = phi.attitude(&column(p, j));
        put(p, ATTITUDE, j, image);
    }
    // (Φ P) Φᵀ, row by row in place, on and below the diagonal, with its mirror image. A block reads nothing that those before it
    // have written.
    for i in POSITION..DYNAMIC {
        let image = phi.position(&row(p, i));
        mirror(p, i, POSITION, image);
    }
    for i in VELOCITY..DYNAMIC {
        let image = phi.velocity(&row(p, i));
        mirror(p, i, VELOCITY, add(image, second.velocity[i - VELOCITY]));
    }
    for i in ATTITUDE..VELOCITY {
        let mut image = phi.attitude(&row(p, i));
        image[i - ATTITUDE] += second.attitude;
        mirror(p, i, ATTITUDE, image);
    }
    for i in VELOCITY..DYNAMIC {
        let image = phi.attitude(&row(p, i));
        mirror(p, i, ATTITUDE, add(image, second.across[i - VELOCITY]));
    }
    for i in 0..DYNAMIC {
        for k in DYNAMIC..DVL_BIAS {
            p[k][i] = p[i][k];
        }
    }
    second.add_to_steady(p);
}

/// Mirrors what the rows of the dynamic states have of the DVL's states, which no transition reads.
#[inline(always)]
pub(crate) fn complete<T: Lane>(p: &mut Matrix<T>) {
    for i in 0..DYNAMIC {
        for k in DVL_BIAS..DIM {
            p[k][i] = p[i][k];
        }
    }
}

/// What a transition reads of column j.
#[inline(always)]
fn column<T: Lane>(p: &Matrix<T>, j: usize) -> Parts<T> {
    Parts {
        r: three_of_column(p, POSITION, j),
        rho: three_of_column(p, ATTITUDE, j),
        v: three_of_column(p, VELOCITY, j),
        ba: three_of_column(p, ACCEL_BIAS, j),
        bg: three_of_column(p, GYRO_BIAS, j),
    }
}

#[inline(always)]
fn three_of_column<T: Lane>(p: &Matrix<T>, from: usize, j: usize) -> V3<T> {
    [p[from][j], p[from + 1][j], p[from + 2][j]]
}

/// What a transition reads of row i.
#[inline(always)]
fn row<T: Lane>(p: &Matrix<T>, i: usize) -> Parts<T> {
    Parts::of(&p[i])
}

#[inline(always)]
fn put<T: Lane>(p: &mut Matrix<T>, from: usize, j: usize, image: V3<T>) {
    for k in 0..3 {
        p[from + k][j] = image[k];
    }
}

/// Writes three elements of row i, as far as the diagonal, and their mirror images.
#[inline(always)]
fn mirror<T: Lane>(p: &mut Matrix<T>, i: usize, from: usize, image: V3<T>) {
    for k in 0..3 {
        if from + k <= i {
            p[i][from + k] = image[k];
            p[from + k][i] = image[k];
        }
    }
}
