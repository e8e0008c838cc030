//! Normalised estimation error squared: how far the error is from what the covariance says.

use crate::layout::DIM;
use crate::simd::{Simd, with_vectors};
use crate::state::{Covariance, ErrorVector};

/// Normalised estimation error squared over the states `from..to`; `None` where P is not positive definite there.
///
/// Frozen states (zero variance) are left out.
#[must_use]
pub fn nees(covariance: &Covariance, error: &ErrorVector, from: usize, to: usize) -> Option<f64> {
    with_vectors!(simd => normalised_square(simd, covariance, error, from, to))
}

/// [`nees`]: nalgebra's Cholesky operations in nalgebra's order, over columns of a length that the compiler knows.
#[inline(always)]
fn normalised_square<S: Simd>(
    _simd: S,
    covariance: &Covariance,
    error: &ErrorVector,
    from: usize,
    to: usize,
) -> Option<f64> {
    // Zero for a frozen state and outside, where the matrix is the identity.
    let mut scale = [0.0; DIM];
    let mut part = ErrorVector::zeros();
    for i in (from..to).filter(|&i| covariance[(i, i)] > 0.0) {
        scale[i] = covariance[(i, i)].sqrt().recip();
        part[i] = error[i] * scale[i];
    }
    let mut factor = Covariance::identity();
    let columns = &mut factor.data.0;
    let mut whitened = part;
    for j in (from..to).filter(|&j| scale[j] > 0.0) {
        let mut own = [0.0; DIM];
        for i in 0..DIM {
            own[i] = covariance.data.0[j][i] * scale[i] * scale[j];
        }
        for earlier in &columns[from..j] {
            let share = -earlier[j];
            for i in 0..DIM {
                own[i] += share * earlier[i];
            }
        }
        if !(own[j] > 0.0) {
            return None;
        }
        let pivot = own[j].sqrt();
        own[..j].fill(0.0);
        own[j] = 0.0;
        let value = whitened[j] / pivot;
        for i in 0..DIM {
            own[i] /= pivot;
            whitened[i] += -value * own[i];
        }
        own[j] = pivot;
        whitened[j] = value;
        columns[j] = own;
    }
    let mut solved = whitened;
    for j in (from..to).rev() {
        let known = factor.view_range(j + 1.., j).dot(&solved.rows_range(j + 1..));
        solved[j] = (solved[j] - known) / factor[(j, j)];
    }
    Some(part.dot(&solved))
}
