//! Normalised estimation error squared (NEES).

use crate::layout::DIM;
use crate::simd::{Simd, with_vectors};
use crate::state::{Covariance, ErrorVector};

/// Normalised estimation error squared δxᵀP⁻¹δx over the states `from..to`; `None` if P is not positive definite there.
///
/// Frozen states (zero variance) are left out.
#[must_use]
pub fn nees(covariance: &Covariance, error: &ErrorVector, from: usize, to: usize) -> Option<f64> {
    with_vectors!(simd => normalised_square(simd, covariance, error, from, to))
}

/// As [`nees`], with the operations of nalgebra's Cholesky factorisation in the same order over columns of fixed
/// length.
#[inline]
fn normalised_square<S: Simd>(
    _simd: S,
    covariance: &Covariance,
    error: &ErrorVector,
    from: usize,
    to: usize,
) -> Option<f64> {
    // Zero for states that are frozen or outside the range, where the matrix is the identity.
    let mut scale = [0.0; DIM];
    let mut scaled = ErrorVector::zeros();
    for i in (from..to).filter(|&i| covariance[(i, i)] > 0.0) {
        scale[i] = covariance[(i, i)].sqrt().recip();
        scaled[i] = error[i] * scale[i];
    }
    let mut factor = Covariance::identity();
    let columns = &mut factor.data.0;
    let mut whitened = scaled;
    for j in (from..to).filter(|&j| scale[j] > 0.0) {
        let mut column = [0.0; DIM];
        for i in 0..DIM {
            column[i] = covariance.data.0[j][i] * scale[i] * scale[j];
        }
        for earlier in &columns[from..j] {
            let multiple = -earlier[j];
            for i in 0..DIM {
                column[i] += multiple * earlier[i];
            }
        }
        if !(column[j] > 0.0) {
            return None;
        }
        let pivot = column[j].sqrt();
        column[..j].fill(0.0);
        column[j] = 0.0;
        let value = whitened[j] / pivot;
        for i in 0..DIM {
            column[i] /= pivot;
            whitened[i] += -value * column[i];
        }
        column[j] = pivot;
        whitened[j] = value;
        columns[j] = column;
    }
    let mut solved = whitened;
    for j in (from..to).rev() {
        let known = factor.view_range(j + 1.., j).dot(&solved.rows_range(j + 1..));
        solved[j] = (solved[j] - known) / factor[(j, j)];
    }
    Some(scaled.dot(&solved))
}
