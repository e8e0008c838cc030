//! What numbers a filter can have, for navigators that are fed from outside.
//!
//! Within these bounds no inertial reading within its full scale can run a filter out of numbers, however long the step, so an
//! estimate that is within them before a reading is finite after it. The bounds lie far beyond any vehicle: what exceeds them
//! is no estimate.

use super::Eskf;
use crate::error::{LARGEST, NavError, UNIT, require_finite, require_finite_squares, require_plausible};
use crate::layout::DIM;

/// Largest coordinate, m: beyond the Moon's orbit.
const LARGEST_POSITION_M: f64 = 1e10;
/// Largest component of the velocity, m/s.
const LARGEST_VELOCITY_MPS: f64 = 1e7;
/// Largest bias or scale factor, SI.
const LARGEST_BIAS: f64 = 1e6;
/// Largest variance or density of noise, SI.
const LARGEST_VARIANCE: f64 = LARGEST * LARGEST;
/// Largest gravity, m/s², and Earth rate, rad/s.
const LARGEST_ENVIRONMENT: f64 = 1e3;

/// What to do where an estimate is none.
const LOST: &str = ": the estimate is lost, start again from a fix";

impl Eskf {
    /// Checks position and velocity, and the variances where the covariance has just been propagated: what inertial readings
    /// change.
    ///
    /// # Errors
    /// [`NavError::Implausible`] that names the quantity.
    #[inline]
    pub(crate) fn require_plausible_motion(&self) -> Result<(), NavError> {
        if self.is_within(1.0) {
            return Ok(());
        }
        self.require_plausible()
    }

    /// Whether position, velocity and variances are so far within their bounds that two seconds of readings, between which
    /// nobody looks, cannot lead out of them and back: not even a force of the largest full scale, 1e6 m/s², does.
    pub(crate) fn is_far_from_bounds(&self) -> bool {
        self.is_within(0.1)
    }

    /// Whether position, velocity and, where it has just been propagated, the diagonal of the covariance are within a part
    /// of their bounds.
    #[inline]
    fn is_within(&self, part: f64) -> bool {
        let motion = &self.kinematics;
        let within = |values: &[f64; 3], limit: f64| values.iter().all(|value| value.abs() <= part * limit);
        let limit = part * LARGEST_VARIANCE;
        (self.interval.duration_s() > 0.0 || (0..DIM).all(|k| self.covariance[(k, k)].abs() <= limit))
            && within(&motion.position_t_m, LARGEST_POSITION_M)
            && within(&motion.velocity_t_mps, LARGEST_VELOCITY_MPS)
    }

    /// Checks every number that an update changes.
    ///
    /// # Errors
    /// [`NavError::Implausible`] or [`NavError::NotFinite`] that names the quantity.
    #[cold]
    pub(crate) fn require_plausible(&self) -> Result<(), NavError> {
        let state = self.state();
        state.validate()?;
        let time_ns = state.time_ns;
        let velocity_t_mps = self.kinematics.velocity_t_mps;
        let groups: [(&'static str, &[f64], f64); 6] = [
            ("state position_t_m", &state.position_t_m.to_array(), LARGEST_POSITION_M),
            ("state velocity_p_mps", &velocity_t_mps, LARGEST_VELOCITY_MPS),
            (
                "state accel_bias_p_mps2",
                &state.accel_bias_p_mps2.to_array(),
                LARGEST_BIAS,
            ),
            (
                "state gyro_bias_p_radps",
                &state.gyro_bias_p_radps.to_array(),
                LARGEST_BIAS,
            ),
            ("state dvl_bias_mps", state.dvl_bias_mps.as_slice(), LARGEST_BIAS),
            ("state dvl_scale_factor", &[state.dvl_scale_factor], LARGEST_BIAS),
        ];
        for (field, values, limit) in groups {
            require_finite(field, time_ns, values)?;
            require_plausible(field, time_ns, values, limit, LOST)?;
        }
        require_finite_squares("covariance", time_ns, self.covariance.as_slice())?;
        let further = self.extensions.further();
        require_finite_squares(
            "covariance of the further states",
            time_ns,
            further.covariance().as_slice(),
        )?;
        require_finite("further states", time_ns, further.estimate().as_slice())
    }

    /// Checks what does not change: noise and environment.
    ///
    /// # Errors
    /// [`NavError::Implausible`] or [`NavError::NotFinite`] that names the quantity.
    pub(crate) fn require_plausible_settings(&self) -> Result<(), NavError> {
        let (noise, earth, time_ns) = (&self.settings.noise, &self.settings.earth, self.state.time_ns);
        let densities = [
            noise.accel,
            noise.gyro,
            noise.accel_bias,
            noise.gyro_bias,
            noise.dvl_bias,
            noise.dvl_scale,
        ];
        let [x, y, z] = earth.rate_t;
        let groups: [(&'static str, &[f64], f64); 2] = [
            ("density of the process noise", &densities, LARGEST_VARIANCE),
            (
                "gravity or Earth rate",
                &[earth.gravity_mps2, x, y, z],
                LARGEST_ENVIRONMENT,
            ),
        ];
        groups
            .into_iter()
            .try_for_each(|(field, values, limit)| require_plausible(field, time_ns, values, limit, UNIT))
    }
}

#[cfg(test)]
#[path = "plausible_tests.rs"]
mod tests;
