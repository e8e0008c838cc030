//! The covariance over an interval without good inertial readings, or with some that are doubted.
//!
//! The strapdown step from the last good reading to the next one spans the time T between. Over it the reading is unknown by
//! σ_f (specific force) and σ_ω (angular rate) on each axis. The filter takes this as white noise of the densities σ_f² T and
//! σ_ω² T beside that of the model, for the steps of the interval. At its end the velocity is uncertain by a further σ_f T and
//! the attitude by σ_ω T, as by constant errors of these sizes. The noise of an interval counts half at its start and half at
//! its end, so where nothing is measured meanwhile the position is uncertain by σ_f T²/√2, and a constant error would move it
//! by σ_f T²/2: the law never claims less than constant errors do.

use super::Eskf;
use crate::error::NavError;
use crate::error_model::ProcessNoise;
use crate::mechanisation::{ImuLimits, LONGEST_GAP_S};

/// Largest uncertainty of the attitude after a bridged interval, rad; beyond it no linear filter recovers.
const LARGEST_ATTITUDE_SD_RAD: f64 = 1.0;

/// Densities of the further process noise of such an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BridgeNoise {
    /// rad²/s.
    gyro: f64,
    /// (m/s)²/s.
    accel: f64,
}

impl BridgeNoise {
    /// That of the interval between two times.
    ///
    /// # Errors
    /// [`NavError::ImuGapTooLong`] where the attitude would be unknown after it.
    pub(crate) fn between(last_ns: i64, time_ns: i64, limits: &ImuLimits) -> Result<Self, NavError> {
        let gap_s = seconds_between(last_ns, time_ns);
        let longest_s = (LARGEST_ATTITUDE_SD_RAD / limits.gap_rate_sd_radps).min(LONGEST_GAP_S);
        if gap_s > longest_s {
            return Err(NavError::ImuGapTooLong {
                time_ns,
                last_ns,
                gap_s,
                longest_s,
            });
        }
        Ok(Self::of_constant(
            [limits.gap_rate_sd_radps, limits.gap_accel_sd_mps2],
            gap_s,
        ))
    }

    /// As much as that of constant errors of the angular rate, rad/s, and the specific force, m/s², over an interval; of the attitude
    /// up to a radian.
    pub(crate) fn of_constant([rate, force]: [f64; 2], gap_s: f64) -> Self {
        let density = |sd: f64| sd.powi(2) * gap_s;
        Self {
            gyro: density(rate.min(LARGEST_ATTITUDE_SD_RAD / gap_s)),
            accel: density(force),
        }
    }

    /// The larger noise of either.
    pub(crate) fn max(self, other: Self) -> Self {
        Self {
            gyro: self.gyro.max(other.gyro),
            accel: self.accel.max(other.accel),
        }
    }
}

impl Eskf {
    /// Brings the covariance up to date and begins an interval with further noise; returns the noise of the model, for
    /// [`Eskf::end_bridge`].
    pub(crate) fn begin_bridge(&mut self, further: &BridgeNoise) -> ProcessNoise {
        self.propagate_covariance();
        let model = self.settings.noise;
        self.settings.noise.gyro += further.gyro;
        self.settings.noise.accel += further.accel;
        model
    }

    /// Ends the interval at the time of the state.
    pub(crate) fn end_bridge(&mut self, model: ProcessNoise) {
        self.propagate_covariance();
        self.settings.noise = model;
    }
}

/// Seconds from one time to another; times of int64 may lie further apart than an int64 counts.
pub(crate) fn seconds_between(first_ns: i64, last_ns: i64) -> f64 {
    last_ns.saturating_sub(first_ns) as f64 * 1e-9
}

#[cfg(test)]
#[path = "bridge_tests.rs"]
mod tests;
