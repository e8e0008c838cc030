//! Constants and first-order Gauss–Markov processes as states beside the error state, added to a reading as they are.
//!
//! Most are slow errors of sensors. Readings that scatter by little may all be wrong by much: a depth is known to centimetres
//! from one reading to the next, but tide, density and the sensor's own offset move all of them by decimetres; the yaw of a
//! magnetic attitude reference scatters by a tenth of a degree about a value that iron and declination move by degrees. Taken
//! for white noise such an error is averaged away in the covariance, and not in the world. The others are mean and change of
//! a vehicle's velocity ([`crate::aiding::motion_prior`]), and scale and slip of the speed by its drives
//! ([`crate::aiding::thrust`]). With standard deviation and correlation time (none for a constant) each is estimated:
//!
//! ```text
//! z = reading − expected reading − D_f f̂ = H δx + D_f δf + white noise
//! ```

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{Matrix2, Rotation2};

use crate::aiding::attitude::SlowAngleModel;
use crate::aiding::further::{
    DEPTH_BIAS, DEPTH_WAVE, FIRST_ATTITUDE_DEVIATION, FIRST_ATTITUDE_ERROR, FIRST_CALIBRATION, FIRST_DEPTH_WAVE,
    FIRST_GYRO_MATRIX, FIRST_HEADING_DEVIATION, FIRST_HEADING_ERROR, FIRST_MOTION, FIRST_THRUST, FIRST_WATER,
    FurtherVector,
};
use crate::aiding::registry::SensorModels;
use crate::aiding::thrust::{SCALE, SLIP, ThrustUse};
use crate::error::{NavError, require_finite};
use crate::filter::options::Options;

/// Blocks of such states.
pub(super) const BLOCKS: [Range<usize>; 8] = [
    DEPTH_BIAS..FIRST_DEPTH_WAVE,
    FIRST_DEPTH_WAVE..FIRST_CALIBRATION,
    FIRST_ATTITUDE_ERROR..FIRST_ATTITUDE_DEVIATION,
    FIRST_ATTITUDE_DEVIATION..FIRST_HEADING_ERROR,
    FIRST_HEADING_ERROR..FIRST_HEADING_DEVIATION,
    FIRST_HEADING_DEVIATION..FIRST_GYRO_MATRIX,
    FIRST_MOTION..FIRST_THRUST,
    FIRST_THRUST..FIRST_WATER,
];

/// Their estimates with what is known of them beforehand.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct GaussMarkovStates {
    /// Variance at the start and in the long run.
    variance: FurtherVector,
    /// Inverse of the correlation time, 1/s; 0 for a constant.
    rate_per_s: FurtherVector,
    /// Estimate at the start and, but for constants, in the long run.
    initial: FurtherVector,
    estimate: FurtherVector,
    /// Rate at which the two states of the waves turn into each other, rad/s.
    wave_rate_radps: f64,
}

impl GaussMarkovStates {
    /// The slow errors of the sensors of a model, the motion, and the thrust where the options use it.
    pub(super) fn new(models: &SensorModels, options: &Options) -> Self {
        let motion = &options.motion;
        let (mut variance, mut rate_per_s) = (FurtherVector::zeros(), FurtherVector::zeros());
        let mut initial = FurtherVector::zeros();
        variance[DEPTH_BIAS] = models.depth.bias_sd_m.powi(2);
        rate_per_s[DEPTH_BIAS] = 1.0 / models.depth.bias_time_s.0;
        for wave in FIRST_DEPTH_WAVE..FIRST_CALIBRATION {
            variance[wave] = models.depth.wave_sd_m.0.powi(2);
            rate_per_s[wave] = 1.0 / models.depth.wave_period_s.0;
        }
        let attitude = &models.magnetometer;
        let axes = [attitude.roll_pitch(), attitude.roll_pitch(), attitude.yaw()];
        let mut put = |first: usize, axes: &[SlowAngleModel]| {
            for (k, axis) in axes.iter().enumerate() {
                variance[first + k] = axis.offset_sd_rad.powi(2);
                variance[first + axes.len() + k] = axis.walk_sd_rad.powi(2);
                rate_per_s[first + axes.len() + k] = 1.0 / axis.walk_time_s;
            }
        };
        put(FIRST_ATTITUDE_ERROR, &axes);
        put(FIRST_HEADING_ERROR, &[models.heading.yaw()]);
        for (first, deviation) in [
            (FIRST_ATTITUDE_DEVIATION, attitude.deviation()),
            (FIRST_HEADING_DEVIATION, models.heading.deviation()),
        ] {
            for (k, sd) in deviation.sd_rad().into_iter().enumerate() {
                variance[first + k] = sd.powi(2);
            }
        }
        for axis in 0..3 {
            let (mean, change) = (FIRST_MOTION + axis, FIRST_MOTION + 3 + axis);
            variance[mean] = motion.mean_sd_mps[axis].powi(2);
            rate_per_s[mean] = 1.0 / motion.mean_time_s;
            variance[change] = motion.change_sd_mps[axis].powi(2);
            rate_per_s[change] = 1.0 / motion.change_time_s[axis];
        }
        let thrust = &models.thrust;
        for axis in (0..3).filter(|&axis| options.thrust != ThrustUse::Off && thrust.has(axis)) {
            let (scale, slip) = (FIRST_THRUST + SCALE + axis, FIRST_THRUST + SLIP + axis);
            initial[scale] = 1.0;
            variance[scale] = thrust.scale_sd[axis].powi(2);
            variance[slip] = thrust.slip_sd_mps[axis].powi(2);
            rate_per_s[slip] = 1.0 / thrust.slip_time_s.0;
        }
        Self {
            variance,
            rate_per_s,
            initial,
            estimate: initial,
            wave_rate_radps: TAU / models.depth.wave_period_s.0,
        }
    }

    /// Variance of each state at the start and in the long run; zero for one that is none.
    pub(super) fn variance(&self) -> &FurtherVector {
        &self.variance
    }

    /// Inverse of the correlation time of each state, 1/s; 0 for a constant and for a state that is none of them.
    pub(super) fn rate_per_s(&self) -> &FurtherVector {
        &self.rate_per_s
    }

    /// The blocks of which something is unknown.
    pub(super) fn unknown(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let is_unknown = |block: &Range<usize>| block.clone().any(|k| self.variance[k] > 0.0);
        BLOCKS.into_iter().filter(is_unknown)
    }

    /// The estimates; zero for a state that is none of them.
    pub(super) fn estimate(&self) -> &FurtherVector {
        &self.estimate
    }

    /// How far the estimates are from those at the start.
    pub(super) fn error(&self) -> FurtherVector {
        self.estimate - self.initial
    }

    /// Forgets the estimates.
    pub(super) fn restart(&mut self) {
        self.estimate = self.initial;
    }

    /// Fraction of each error that is left after `duration_s`; 1 for a state that is none.
    pub(super) fn left(&self, duration_s: f64) -> FurtherVector {
        let mut left = FurtherVector::repeat(1.0);
        for k in self.unknown().flatten() {
            left[k] = (-duration_s * self.rate_per_s[k]).exp();
        }
        left
    }

    /// How the two states of the waves turn into each other in `duration_s`; `None` where there are none.
    pub(super) fn wave_turn(&self, duration_s: f64) -> Option<Matrix2<f64>> {
        let has_waves = self.variance[FIRST_DEPTH_WAVE] > 0.0;
        has_waves.then(|| *Rotation2::new(self.wave_rate_radps * duration_s).matrix())
    }

    /// Propagates the estimates over `duration_s`.
    pub(super) fn propagate(&mut self, duration_s: f64, left: &FurtherVector) {
        let change = (self.estimate - self.initial).component_mul(left);
        self.estimate = self.initial + change;
        if let Some(turn) = self.wave_turn(duration_s) {
            let turned = turn * self.estimate.fixed_rows::<DEPTH_WAVE>(FIRST_DEPTH_WAVE);
            self.estimate
                .fixed_rows_mut::<DEPTH_WAVE>(FIRST_DEPTH_WAVE)
                .copy_from(&turned);
        }
    }

    /// Adds an error to the estimates.
    pub(super) fn inject(&mut self, error: &FurtherVector) {
        for k in BLOCKS.into_iter().flatten() {
            self.estimate[k] += error[k];
        }
    }

    /// Checks numbers that were read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        [&self.variance, &self.rate_per_s, &self.initial, &self.estimate]
            .into_iter()
            .try_for_each(|numbers| require_finite("slow errors and motion", time_ns, numbers.as_slice()))?;
        require_finite("rate of waves", time_ns, &[self.wave_rate_radps])
    }
}

#[cfg(test)]
#[path = "gauss_markov_tests.rs"]
mod tests;
