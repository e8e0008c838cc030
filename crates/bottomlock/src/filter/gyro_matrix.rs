//! Scale factors and misalignments of the gyros, considered: a matrix M of constants that the filter does not estimate.
//!
//! A reading of the gyros has M ω too much, with ω the rate of the platform: a scale factor on M's diagonal, and beside it what
//! an axis sees of the turns about another (Groves 2013, sect. 4.4.2). Over an interval M ω is a bias of the gyros. With the
//! column Ψ by which Φ carries such a bias into the other states, and the turn θ of the platform over the duration T,
//!
//! ```text
//! δx⁺ = Φ δx + B m,   B = Ψ ⊗ (θ / T)ᵀ,   m the rows of M
//! P⁺ = Φ P Φᵀ + Q + B Y + Yᵀ Bᵀ,   Y = X_mᵀ + ½ C_m Bᵀ,   X_m = Φ E[δx mᵀ],   E[δx fᵀ] += B E[m fᵀ]
//! ```
//!
//! for every further state f. So a turn and the same turn back leave nothing behind, and a spiral adds up. An update changes the
//! covariances with m as it does with any state, but has no gain for m (Schmidt 1966, a considered state): the turns of a dive do
//! not show which part of an attitude error M has caused.

use std::ops::Range;

use nalgebra::{SMatrix, Vector3};

use crate::aiding::further::{GYRO_MATRIX, Process, Processes, block};
use crate::error::{NavError, require_non_negative};
use crate::error_model::Interval;
use crate::frames::{Platform, Rot, Tangent};
use crate::layout::{DIM, GYRO_BIAS};
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::model::ImuModel;
use crate::state::Covariance;

/// The states of M among the further ones.
pub(super) const MATRIX: Range<usize> = block::GYRO_MATRIX.range();

/// What is known of M, and the attitude at the start of the interval.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct GyroMatrix {
    scale_sd: f64,
    misalignment_sd_rad: f64,
    start_t_p: Rot<Tangent, Platform>,
}

/// What M adds over an interval, factored: B = Ψ ⊗ (θ / T)ᵀ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    /// Ψ.
    by_bias: SMatrix<f64, DIM, 3>,
    /// θ / T, rad/s.
    rate_p_radps: Vector3<f64>,
}

impl GyroMatrix {
    /// M at its prior; `None` where nothing is unknown.
    pub(super) fn new(imu: &ImuModel, kinematics: &Kinematics<f64>) -> Option<Self> {
        let is_known = imu.gyro_scale_sd == 0.0 && imu.gyro_misalignment_sd_rad == 0.0;
        (!is_known).then(|| Self {
            scale_sd: imu.gyro_scale_sd,
            misalignment_sd_rad: imu.gyro_misalignment_sd_rad,
            start_t_p: Rot::from_quaternion_wxyz(kinematics.attitude_t_p),
        })
    }

    /// The matrix by rows.
    pub(super) fn processes(&self) -> Processes {
        let sd = |k: usize| {
            if k / 3 == k % 3 {
                self.scale_sd
            } else {
                self.misalignment_sd_rad
            }
        };
        (
            block::GYRO_MATRIX,
            (0..GYRO_MATRIX).map(|k| Process::constant(sd(k))).collect(),
        )
    }

    /// An interval begins, since the state has been corrected or the covariance has been propagated.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        self.start_t_p = Rot::from_quaternion_wxyz(kinematics.attitude_t_p);
    }

    /// What M adds over an interval that ends at `end`.
    pub(super) fn turned(&self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) -> Turned {
        let mut by_bias = SMatrix::from_fn(|i, k| f64::from(u8::from(i == GYRO_BIAS + k)));
        interval.carry(&mut by_bias.data.0, end, earth);
        by_bias.fixed_rows_mut::<3>(GYRO_BIAS).fill(0.0);
        let turn: Rot<Platform, Platform> = self.start_t_p.inverse() * Rot::from_quaternion_wxyz(end.attitude_t_p);
        Turned {
            by_bias,
            rate_p_radps: turn.log() / interval.duration_s(),
        }
    }

    /// Checks numbers that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self) -> Result<(), NavError> {
        require_non_negative("scale factor of gyros", self.scale_sd)?;
        require_non_negative("misalignment of gyros", self.misalignment_sd_rad)
    }
}

impl Turned {
    /// B, for a smoother.
    pub(super) fn by_matrix(&self) -> SMatrix<f64, DIM, GYRO_MATRIX> {
        SMatrix::from_fn(|i, k| self.by_bias[(i, k / 3)] * self.rate_p_radps[k % 3])
    }

    /// B m fᵀ of covariances of M with further states, a column each.
    pub(super) fn times<const N: usize>(&self, covariance: &SMatrix<f64, GYRO_MATRIX, N>) -> SMatrix<f64, DIM, N> {
        let rates =
            SMatrix::<f64, 3, N>::from_fn(|i, n| self.rate_p_radps.dot(&covariance.fixed_view::<3, 1>(3 * i, n)));
        self.by_bias * rates
    }

    /// B Y + Yᵀ Bᵀ, with X_m before B C_m is added to it.
    pub(super) fn added(
        &self,
        cross: &SMatrix<f64, DIM, GYRO_MATRIX>,
        own: &SMatrix<f64, GYRO_MATRIX, GYRO_MATRIX>,
    ) -> Covariance {
        let y = cross.transpose() + self.times(own).transpose() * 0.5;
        let half = self.times(&y);
        half + half.transpose()
    }
}

#[cfg(test)]
#[path = "gyro_matrix_tests.rs"]
mod tests;
