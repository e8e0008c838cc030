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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 3² over 4 and 1 over 0.25; a frozen state and states outside the range do not count, and a negative variance has none.
    #[test]
    fn by_hand() {
        let mut covariance = Covariance::identity();
        (covariance[(2, 2)], covariance[(3, 3)], covariance[(4, 4)]) = (4.0, 0.25, 0.0);
        let mut error = ErrorVector::repeat(100.0);
        (error[2], error[3]) = (3.0, 1.0);
        assert_eq!(nees(&covariance, &error, 2, 5), Some(2.25 + 4.0));
        assert_eq!(nees(&covariance, &error, 4, 5), Some(0.0));
        (covariance[(2, 3)], covariance[(3, 2)]) = (1.5, 1.5);
        assert_eq!(nees(&covariance, &error, 2, 5), None);
    }

    proptest! {
        /// Against a dense inverse of the states of the range.
        #[test]
        fn dense(numbers in prop::collection::vec(-1.0_f64..1.0, DIM * DIM), errors in prop::collection::vec(-3.0_f64..3.0, DIM),
                 from in 0..DIM, length in 1..=DIM) {
            let to = (from + length).min(DIM);
            let root = Covariance::from_iterator(numbers);
            let covariance = root * root.transpose() + Covariance::identity() * 0.1;
            let error = ErrorVector::from_iterator(errors);
            let block = covariance.view((from, from), (to - from, to - from)).into_owned();
            let x = error.rows(from, to - from).into_owned();
            let expected = x.dot(&(block.try_inverse().unwrap() * &x));
            prop_assert!((nees(&covariance, &error, from, to).unwrap() / expected - 1.0).abs() < 1e-9);
        }
    }
}
