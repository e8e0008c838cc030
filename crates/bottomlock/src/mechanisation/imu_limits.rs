//! What an inertial sensor can read, and what is assumed of the motion while it reads nothing.
//!
//! # Ranges
//! A reading beyond the full scale of the instrument on any axis is no measurement. One at the full scale is clipped: the
//! motion was at least as large. Both are rejected whole, since one fault of the instrument seldom spares the other axes.
//!
//! What is assumed of the motion while nothing is read is used in `filter/bridge.rs`.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::ImuSample;
use crate::error::{NavError, require_non_negative};

/// Part of the full scale from which a reading is clipped: the largest number of a converter of ten bits or more lies
/// above it.
const CLIPPED_FROM: f64 = 0.999;
/// Part of the full scale up to which a reading is clipped and not out of range: rounding of scale factors.
const CLIPPED_TO: f64 = 1.001;
/// Largest full scale, in either unit: with it no step can run out of numbers.
const LARGEST_FULL_SCALE: f64 = 1e6;

/// Longest gap that any limit allows, s: eleven days.
pub(crate) const LONGEST_GAP_S: f64 = 1e6;

/// What becomes of a gap between inertial readings that is longer than the limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LongGap {
    /// The reading after it is refused with an error.
    #[default]
    Refuse,
    /// It is bridged, and the covariance inflated.
    Inflate,
}

/// Limits of the inertial readings that come from outside; simulated ones are not checked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuLimits {
    /// Full scale of the angular rate on each axis, rad/s.
    pub max_rate_radps: f64,
    /// Full scale of the specific force on each axis, m/s².
    pub max_force_mps2: f64,
    /// Number of equal readings in a row from which on they are rejected as stuck; 0 for never.
    pub stuck_after: u32,
    /// Longest gap that is bridged, s.
    pub max_gap_s: f64,
    /// What becomes of a longer one.
    pub gap: LongGap,
    /// σ_ω: unknown angular rate while nothing is read, 1 sigma on each axis, rad/s.
    pub gap_rate_sd_radps: f64,
    /// σ_f: unknown specific force while nothing is read, 1 sigma on each axis, m/s².
    pub gap_accel_sd_mps2: f64,
}

impl Default for ImuLimits {
    /// Ten g and 573 °/s, the least of navigation-grade instruments; gaps of up to 1 s; a vehicle that turns by 6 °/s and
    /// accelerates by 0.5 m/s² unseen. Stuck readings are not looked for.
    fn default() -> Self {
        Self {
            max_rate_radps: 10.0,
            max_force_mps2: 100.0,
            stuck_after: 0,
            max_gap_s: 1.0,
            gap: LongGap::Refuse,
            gap_rate_sd_radps: 0.1,
            gap_accel_sd_mps2: 0.5,
        }
    }
}

impl ImuLimits {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let is_full_scale = |value: f64| value > 0.0 && value <= LARGEST_FULL_SCALE;
        let is_gap = |value: f64| value > 0.0 && value <= LONGEST_GAP_S;
        let scale = "a full scale of the data sheet, more than 0 and at most 1e6";
        let checks = [
            (
                "options.imu_limits.max_rate_radps",
                self.max_rate_radps,
                is_full_scale(self.max_rate_radps),
                scale,
            ),
            (
                "options.imu_limits.max_force_mps2",
                self.max_force_mps2,
                is_full_scale(self.max_force_mps2),
                scale,
            ),
            (
                "options.imu_limits.max_gap_s",
                self.max_gap_s,
                is_gap(self.max_gap_s),
                "a number of seconds, more than 0 and at most 1e6",
            ),
            (
                "options.imu_limits.stuck_after",
                f64::from(self.stuck_after),
                self.stuck_after != 1,
                "0 (never), or 2 or more equal readings in a row",
            ),
        ];
        for (field, value, holds, expected) in checks {
            if !holds {
                return Err(NavError::OutOfRange { field, value, expected });
            }
        }
        require_non_negative("options.imu_limits.gap_rate_sd_radps", self.gap_rate_sd_radps)?;
        require_non_negative("options.imu_limits.gap_accel_sd_mps2", self.gap_accel_sd_mps2)
    }

    /// Whether a reading is a number below the full scale on every axis.
    #[inline]
    #[must_use]
    pub fn is_in_range(&self, sample: &ImuSample) -> bool {
        let within = |value: &Vector3<f64>, limit: f64| value.iter().all(|value| value.abs() < CLIPPED_FROM * limit);
        within(&sample.rate_p_radps.0, self.max_rate_radps) && within(&sample.force_p_mps2.0, self.max_force_mps2)
    }

    /// What is wrong with a reading by itself.
    #[must_use]
    pub fn range_fault(&self, sample: &ImuSample) -> Option<ImuFault> {
        if self.is_in_range(sample) {
            return None;
        }
        let rate = sample.rate_p_radps.to_array();
        let force = sample.force_p_mps2.to_array();
        let of = |quantity, values: [f64; 3], limit| (0..3).map(move |axis| (quantity, axis, values[axis], limit));
        let all = of(Quantity::Rate, rate, self.max_rate_radps).chain(of(Quantity::Force, force, self.max_force_mps2));
        let worst = all.max_by(|a, b| (a.2.abs() / a.3).total_cmp(&(b.2.abs() / b.3)));
        worst.map(|(quantity, axis, value, limit)| ImuFault::Range {
            quantity,
            axis,
            value,
            limit,
        })
    }
}

/// What a gyro or an accelerometer measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Angular rate.
    Rate,
    /// Specific force.
    Force,
}

impl Quantity {
    const fn name_and_unit(self) -> (&'static str, &'static str) {
        match self {
            Self::Rate => ("angular rate", "rad/s"),
            Self::Force => ("specific force", "m/s²"),
        }
    }
}

/// Why a reading was rejected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ImuFault {
    /// At or beyond the full scale.
    Range {
        /// What is.
        quantity: Quantity,
        /// On which axis: 0 forward, 1 right, 2 down.
        axis: usize,
        /// The reading, rad/s or m/s².
        value: f64,
        /// The full scale.
        limit: f64,
    },
    /// The same as the readings before it.
    Stuck {
        /// How many of them in a row are equal, this one included.
        readings: u32,
    },
    /// Further from the last good one than any vehicle comes.
    Jump {
        /// What jumped.
        quantity: Quantity,
        /// By how much on the axis where it jumped most, rad/s or m/s².
        change: f64,
        /// In how long, s.
        step_s: f64,
    },
}

/// Names of what is counted, in order.
pub const IMU_FAULTS: [&str; 5] = ["out_of_range", "clipped", "stuck", "jumped", "inflated_gaps"];

impl ImuFault {
    /// Its place in [`IMU_FAULTS`].
    #[must_use]
    pub fn kind(&self) -> usize {
        match self {
            Self::Range { value, limit, .. } => usize::from(value.abs() <= CLIPPED_TO * limit),
            Self::Stuck { .. } => 2,
            Self::Jump { .. } => 3,
        }
    }
}

impl std::fmt::Display for ImuFault {
    fn fmt(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Range {
                quantity,
                axis,
                value,
                limit,
            } => {
                let (name, unit) = quantity.name_and_unit();
                let axis = ["x", "y", "z"][*axis];
                let (what, hint) = match (self.kind(), quantity) {
                    (1, _) => ("clipped at", ""),
                    (_, Quantity::Rate) => ("beyond", ": is it in deg/s?"),
                    (_, Quantity::Force) => ("beyond", ": is it in mg or cm/s²?"),
                };
                write!(
                    text,
                    "{name} {axis} is {value} {unit}, {what} the full scale of {limit} {unit}{hint}"
                )
            }
            Self::Stuck { readings } => write!(text, "{readings} equal readings in a row: stuck"),
            Self::Jump {
                quantity,
                change,
                step_s,
            } => {
                let (name, unit) = quantity.name_and_unit();
                write!(
                    text,
                    "{name} changes by {change:.3} {unit} in {step_s:.3} s, more than any vehicle's: a flipped bit?"
                )
            }
        }
    }
}

#[cfg(test)]
#[path = "imu_limits_tests.rs"]
mod tests;
