//! Scale factors, misalignments and g-sensitivity of the inertial sensors, considered: constants m that the filter does not estimate.
//!
//! The gyros read M ω + G f too much, with ω the rate of the platform and f the specific force: a scale factor on M's diagonal,
//! beside it what an axis sees of the turns about another, and in G what it sees of forces; an accelerometer reads s f too much
//! along its axis (Groves 2013, sect. 4.4), with f less that of a level vehicle at rest: what a sensor reads too much then is its
//! bias, as sheets and the start of a dive know it. Over an interval these are biases of the sensors. With the columns Ψ by which Φ carries
//! such biases into the other states, and the means u of ω and f over the duration T,
//!
//! ```text
//! δx⁺ = Φ δx + B m,   B m = Ψ (s f, M ω + G f),   ω = θ / T,   f = Rᵀ ((v⁺ − v) / T − g + ω_ie × (v⁺ + v)) + |g| e_z
//! P⁺ = Φ P Φᵀ + Q + B Y + Yᵀ Bᵀ,   Y = X_mᵀ + ½ C_m Bᵀ,   X_m = Φ E[δx mᵀ],   E[δx fᵀ] += B E[m fᵀ]
//! ```
//!
//! for every further state f. So a turn and the same turn back leave nothing behind, and a spiral adds up. An update changes the
//! covariances with m as it does with any state, but has no gain for m (Schmidt 1966, a considered state): the turns of a dive do
//! not show which part of an attitude error M has caused.

use std::ops::Range;

use nalgebra::{SMatrix, SVector, Vector3};

use crate::aiding::further::{CONSIDERED, Process, Processes, block};
use crate::error::{NavError, require_finite, require_non_negative};
use crate::error_model::Interval;
use crate::frames::{Platform, Rot, Tangent};
use crate::layout::{ACCEL_BIAS, DIM};
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::model::ImuModel;
use crate::state::Covariance;

/// The states m among the further ones: M and G by rows, then s.
pub(super) const MATRIX: Range<usize> = block::GYRO_MATRIX.first..block::MOTION.first;

/// The bias (of accelerometers, then gyros) that element k of m makes, and of which component of ω and f.
const fn element(k: usize) -> (usize, usize) {
    match k {
        0..9 => (3 + k / 3, k % 3),
        9..18 => (k / 3, 3 + k % 3),
        _ => (k - 18, k - 15),
    }
}

/// What is known of m, and the motion at the start of the interval.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct ImuMatrix {
    /// Standard deviations of M's diagonal, of what is beside it, of G and of s.
    sd: [f64; 4],
    start_t_p: Rot<Tangent, Platform>,
    start_velocity_t_mps: [f64; 3],
}

/// What m adds over an interval, factored.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    /// Ψ.
    by_bias: SMatrix<f64, DIM, 6>,
    /// ω, rad/s, and f, less that of a level vehicle, m/s².
    means: SVector<f64, 6>,
}

impl ImuMatrix {
    /// m at its prior; `None` where nothing is unknown.
    pub(super) fn new(imu: &ImuModel, kinematics: &Kinematics<f64>) -> Option<Self> {
        let sd = [
            imu.gyro_scale_sd,
            imu.gyro_misalignment_sd_rad,
            imu.gyro_g_sensitivity_sd_radps_per_mps2,
            imu.accel_scale_sd,
        ];
        (sd != [0.0; 4]).then(|| Self {
            sd,
            start_t_p: Rot::from_quaternion_wxyz(kinematics.attitude_t_p),
            start_velocity_t_mps: kinematics.velocity_t_mps,
        })
    }

    /// M and G by rows, and s.
    pub(super) fn processes(&self) -> [Processes; 3] {
        let [scale, other, by_force, accel] = self.sd.map(Process::constant);
        let gyro = |k| if k / 3 == k % 3 { scale } else { other };
        [
            (block::GYRO_MATRIX, (0..9).map(gyro).collect()),
            (block::GYRO_BY_FORCE, vec![by_force; 9]),
            (block::ACCEL_SCALE, vec![accel; 3]),
        ]
    }

    /// An interval begins, since the state has been corrected or the covariance has been propagated.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        self.start_t_p = Rot::from_quaternion_wxyz(kinematics.attitude_t_p);
        self.start_velocity_t_mps = kinematics.velocity_t_mps;
    }

    /// What m adds over an interval that ends at `end`.
    pub(super) fn turned(&self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) -> Turned {
        let mut by_bias = SMatrix::from_fn(|i, k| f64::from(u8::from(i == ACCEL_BIAS + k)));
        interval.carry(&mut by_bias.data.0, end, earth);
        by_bias.fixed_rows_mut::<6>(ACCEL_BIAS).fill(0.0);
        let duration_s = interval.duration_s();
        let turn: Rot<Platform, Platform> = self.start_t_p.inverse() * Rot::from_quaternion_wxyz(end.attitude_t_p);
        let angle = turn.log();
        let [before, after] = [self.start_velocity_t_mps, end.velocity_t_mps].map(Vector3::from);
        let force_t = (after - before) / duration_s - Vector3::from(earth.gravity_t)
            + Vector3::from(earth.rate_t).cross(&(after + before));
        let force_p = (self.start_t_p * Rot::<Platform, Platform>::exp(angle * 0.5))
            .matrix()
            .tr_mul(&force_t);
        let mut means = SVector::<f64, 6>::zeros();
        means.fixed_rows_mut::<3>(0).copy_from(&(angle / duration_s));
        let weight = Vector3::z() * Vector3::from(earth.gravity_t).norm();
        means.fixed_rows_mut::<3>(3).copy_from(&(force_p + weight));
        Turned { by_bias, means }
    }

    /// Checks numbers that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        let name = "scale factors, misalignments and g-sensitivity";
        self.sd.iter().try_for_each(|&sd| require_non_negative(name, sd))?;
        require_finite(
            "velocity at the start of an interval",
            time_ns,
            &self.start_velocity_t_mps,
        )
    }
}

impl Turned {
    /// B, for a smoother.
    pub(super) fn by_matrix(&self) -> SMatrix<f64, DIM, CONSIDERED> {
        let (bias, mean) = (|k| element(k).0, |k| self.means[element(k).1]);
        SMatrix::from_fn(|i, k| self.by_bias[(i, bias(k))] * mean(k))
    }

    /// B E[m f] of a further state, by its covariances with the elements of m that are unknown.
    pub(super) fn times(&self, unknown: &[usize], covariance: impl Fn(usize) -> f64) -> SVector<f64, DIM> {
        let mut biases = SVector::<f64, 6>::zeros();
        for &k in unknown {
            let (bias, mean) = element(k);
            biases[bias] += self.means[mean] * covariance(k);
        }
        self.by_bias * biases
    }

    /// B Y + Yᵀ Bᵀ, with X_m before B C_m is added to it, of the elements of m that are unknown.
    pub(super) fn added(
        &self,
        unknown: &[usize],
        cross: &SMatrix<f64, DIM, CONSIDERED>,
        own: &SMatrix<f64, CONSIDERED, CONSIDERED>,
    ) -> Covariance {
        let mut biases = SMatrix::<f64, DIM, 6>::zeros();
        for &k in unknown {
            let (bias, mean) = element(k);
            let y = cross.column(k) + self.times(unknown, |j| own[(j, k)]) * 0.5;
            biases.column_mut(bias).axpy(self.means[mean], &y, 1.0);
        }
        let half = self.by_bias * biases.transpose();
        half + half.transpose()
    }
}

#[cfg(test)]
#[path = "imu_matrix_tests.rs"]
mod tests;
