//! The motion through the water as pseudo-measurements: a torpedo-shaped vehicle has little sway and heave relative to the water,
//! and the water moves with a current.
//!
//! With R platform to tangent, c the current and ω_tp the angular rate, the velocity relative to the water is v − Rᵀc, and
//!
//! - sway through the water is −k ω_z + s: the vehicle turns about a pivot k ahead of its origin;
//! - heave through the water is w + h: the trim w that balances weight, buoyancy and shape, and h the rest.
//!
//! c, k, w, s and h are estimated with the other states. c, w, s and h are Gauss–Markov processes: a slip that lasts for many
//! epochs is then one piece of evidence and not one per epoch. There is no current along the vertical.
//!
//! # Error of the current
//! c = Exp([ρ_D e_D×]) ĉ + δc, with ρ_D the misalignment about the vertical: the current is expressed
//! along the estimated north. A rotation of vehicle and current together about the vertical changes no measurement, so no
//! measurement may reduce the uncertainty of yaw. With the plain difference each change of ĉ would count as information on yaw.
//! The drift of the estimated north with the gyro bias is smaller than the random walk of the current and is neglected.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::aiding::Motion;
use crate::aiding::further::Process;
use crate::error::{NavError, require_magnitude, require_non_negative, require_positive};
use crate::frames::skew;
use crate::layout::{ATTITUDE, DIM, GYRO_BIAS, VELOCITY};

/// Number of further states.
pub const WATER: usize = 6;
/// First index of the current, north and east, m/s.
pub const CURRENT: usize = 0;
/// Index of the sway gain k, m.
pub const GAIN: usize = 2;
/// Index of the trim w, m/s.
pub const TRIM: usize = 3;
/// Index of the sway slip s, m/s.
pub const SWAY: usize = 4;
/// Index of the heave slip h, m/s.
pub const HEAVE: usize = 5;

/// One number for each further state.
pub type WaterVector = SVector<f64, WATER>;
/// Covariance of the further states.
pub type WaterCovariance = SMatrix<f64, WATER, WATER>;

/// Bound of speeds, m/s, and of the sway gain, m. A million gives an assumption no weight; the squares of larger numbers
/// swamp the covariance.
const LARGEST: f64 = 1e7;
/// What is expected of them.
const WEIGHTLESS: &str = "less than 1e7: 1e6 already gives the assumption no weight";

/// Prior of the motion through the water; 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WaterPrior {
    /// Current along north and along east, m/s.
    pub current_sd_mps: f64,
    /// Correlation time of the current, s.
    pub current_time_s: f64,
    /// k, m.
    pub sway_gain_m: f64,
    /// Uncertainty of k, m.
    pub sway_gain_sd_m: f64,
    /// w, m/s.
    pub trim_sd_mps: f64,
    /// Correlation time of w, s.
    pub trim_time_s: f64,
    /// s and h, m/s.
    pub slip_sd_mps: f64,
    /// Correlation time of s and h, s.
    pub slip_time_s: f64,
}

impl Default for WaterPrior {
    /// A torpedo of 3 m at 2 m/s; the physics behind each number stands in `docs/methods/sway_current.md`.
    fn default() -> Self {
        Self {
            current_sd_mps: 0.3,
            current_time_s: 1800.0,
            sway_gain_m: 0.6,
            sway_gain_sd_m: 0.3,
            trim_sd_mps: 0.03,
            trim_time_s: 3600.0,
            slip_sd_mps: 0.02,
            slip_time_s: 5.0,
        }
    }
}

impl WaterPrior {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        crate::error::require_finite("options.water.sway_gain_m", 0, &[self.sway_gain_m])?;
        require_non_negative("options.water.current_sd_mps", self.current_sd_mps)?;
        require_non_negative("options.water.sway_gain_sd_m", self.sway_gain_sd_m)?;
        require_positive("options.water.current_time_s", self.current_time_s)?;
        require_non_negative("options.water.trim_sd_mps", self.trim_sd_mps)?;
        require_positive("options.water.trim_time_s", self.trim_time_s)?;
        require_positive("options.water.slip_sd_mps", self.slip_sd_mps)?;
        require_positive("options.water.slip_time_s", self.slip_time_s)?;
        let bounded = [
            ("options.water.current_sd_mps", self.current_sd_mps),
            ("options.water.sway_gain_m", self.sway_gain_m),
            ("options.water.sway_gain_sd_m", self.sway_gain_sd_m),
            ("options.water.trim_sd_mps", self.trim_sd_mps),
            ("options.water.slip_sd_mps", self.slip_sd_mps),
        ];
        for (field, value) in bounded {
            require_magnitude(field, &[value], LARGEST, WEIGHTLESS)?;
        }
        Ok(())
    }

    /// The water states before anything is learnt of slip and current.
    #[must_use]
    pub fn processes(&self) -> [Process; WATER] {
        let current = Process::lasting(self.current_sd_mps, self.current_time_s);
        let slip = Process::lasting(self.slip_sd_mps, self.slip_time_s);
        let gain = Process {
            mean: self.sway_gain_m,
            ..Process::constant(self.sway_gain_sd_m)
        };
        let trim = Process::lasting(self.trim_sd_mps, self.trim_time_s);
        [current, current, gain, trim, slip, slip]
    }
}

/// Turns a horizontal velocity, north and east, with the yaw that is corrected.
pub(super) fn turn(velocity: &mut [f64], yaw_rad: f64) {
    let (sin, cos) = yaw_rad.sin_cos();
    let (north, east) = (velocity[0], velocity[1]);
    velocity[0] = north * cos - east * sin;
    velocity[1] = north * sin + east * cos;
}

/// An assumption as one row: 0 = expected + H_x δx + H_w δw + n.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaterRow {
    /// The slip state of the row.
    pub slip: usize,
    /// k times the rate that goes with the row, m/s: ω_z for sway, ω_y for heave.
    pub turning_mps: f64,
    /// Zero minus the expected slip, m/s.
    pub residual: f64,
    /// H_x: by the error state.
    pub by_state: SVector<f64, DIM>,
    /// H_w: by the further states.
    pub by_water: WaterVector,
    /// Variance of n, (m/s)²: the gyro's noise through k.
    pub variance: f64,
}

/// The row "sway through the water is −k ω_z + s".
#[must_use]
pub fn sway_row(motion: &Motion<'_>, water: &WaterVector) -> WaterRow {
    let mut row = slip_row(motion, water, &Vector3::y(), SWAY);
    let (gain, turn) = (water[GAIN], Vector3::z());
    row.turning_mps = gain * turn.dot(&motion.rate_tp());
    row.residual -= row.turning_mps;
    let by_misalignment = motion.rate_by_misalignment().transpose() * turn * gain;
    for k in 0..3 {
        row.by_state[ATTITUDE + k] += by_misalignment[k];
        row.by_state[GYRO_BIAS + k] -= turn[k] * gain;
    }
    row.by_water[GAIN] = turn.dot(&motion.rate_tp());
    row.variance = gain * gain * motion.gyro_variance;
    row
}

/// The row "heave through the water is w + h".
#[must_use]
pub fn heave_row(motion: &Motion<'_>, water: &WaterVector) -> WaterRow {
    let mut row = slip_row(motion, water, &Vector3::z(), HEAVE);
    row.turning_mps = water[GAIN] * motion.rate_tp().y;
    row.residual += water[TRIM];
    row.by_water[TRIM] = -1.0;
    row
}

/// `axis · (v − Rᵀc) − slip = 0`.
fn slip_row(motion: &Motion<'_>, water: &WaterVector, axis: &Vector3<f64>, slip: usize) -> WaterRow {
    let along = SpeedThroughWater::along(axis, motion, water);
    let mut by_water = along.by_water;
    by_water[slip] = -1.0;
    WaterRow {
        slip,
        turning_mps: 0.0,
        residual: water[slip] - along.speed_mps,
        by_state: along.by_state,
        by_water,
        variance: 0.0,
    }
}

/// Component of the velocity relative to the water along an axis of the platform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpeedThroughWater {
    /// `axis · (v − Rᵀc)`, m/s.
    pub(super) speed_mps: f64,
    /// By the error state.
    pub(super) by_state: SVector<f64, DIM>,
    /// By the water states.
    pub(super) by_water: WaterVector,
}

impl SpeedThroughWater {
    /// Along an axis, with the current of the water states.
    pub(super) fn along(axis: &Vector3<f64>, motion: &Motion<'_>, water: &WaterVector) -> Self {
        let axis_t = motion.rotation() * axis;
        let level = &motion.level;
        let current_t = level.rotation_t_n * Vector3::new(water[CURRENT], water[CURRENT + 1], 0.0);
        let mut along = Self {
            speed_mps: axis.dot(&motion.state.velocity_p_mps.0) - axis_t.dot(&current_t),
            by_state: SVector::zeros(),
            by_water: WaterVector::zeros(),
        };
        along.by_state.fixed_rows_mut::<3>(VELOCITY).copy_from(axis);
        // R = Exp([ρ×]) R̂ gives Rᵀc = R̂ᵀ(c + [c×]ρ); the part about the vertical belongs to the current's own error.
        let (turned, down_t) = (skew(&current_t) * axis_t, level.down_t());
        along
            .by_state
            .fixed_rows_mut::<3>(ATTITUDE)
            .copy_from(&(turned - down_t * down_t.dot(&turned)));
        let axis_n = level.rotation_t_n.tr_mul(&axis_t);
        along.by_water[CURRENT] = -axis_n.x;
        along.by_water[CURRENT + 1] = -axis_n.y;
        along
    }
}

#[cfg(test)]
#[path = "water_tests.rs"]
pub(super) mod tests;
