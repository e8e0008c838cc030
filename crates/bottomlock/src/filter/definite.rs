//! Is a covariance positive definite, apart from states that are frozen?

use nalgebra::SVector;

use crate::error::NavError;
use crate::layout::{DIM, block_name};
use crate::state::Covariance;

/// Cholesky's factorisation with frozen states (zero variance) left out.
fn active_factor(covariance: &Covariance) -> Option<nalgebra::Cholesky<f64, nalgebra::Const<DIM>>> {
    let mut matrix = *covariance;
    for k in 0..DIM {
        if matrix[(k, k)] == 0.0 && matrix.column(k).amax() == 0.0 {
            matrix[(k, k)] = 1.0;
        }
    }
    // Scaling to unit diagonal keeps metres and radians per second from hiding each other.
    let scale = SVector::<f64, DIM>::from_fn(|k, _| {
        if matrix[(k, k)] > 0.0 {
            matrix[(k, k)].sqrt().recip()
        } else {
            0.0
        }
    });
    for j in 0..DIM {
        for i in 0..DIM {
            matrix[(i, j)] *= scale[i] * scale[j];
        }
    }
    matrix.cholesky()
}

/// Checks a covariance; the error names the block with a negative variance, where there is one.
///
/// # Errors
/// [`NavError::NotPositiveDefinite`].
pub(super) fn require_positive_definite(covariance: &Covariance, time_ns: i64) -> Result<(), NavError> {
    if active_factor(covariance).is_some() {
        return Ok(());
    }
    let negative = (0..DIM).find(|&k| covariance[(k, k)] < 0.0);
    Err(NavError::NotPositiveDefinite {
        matrix: negative.map_or("state covariance", block_name),
        time_ns,
    })
}
