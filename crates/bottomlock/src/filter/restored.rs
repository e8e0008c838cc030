//! Checks of a filter that was read from bytes.

use super::Eskf;
use crate::error::{NavError, require_finite, require_finite_squares, require_non_negative};
use crate::mechanisation::Kinematics;

/// Largest difference of an attitude's quaternion from norm 1, and of what follows from it, relative.
const ROUNDING: f64 = 1e-6;

impl Eskf {
    /// Checks that a filter read from bytes is one that can have been saved: numbers finite, covariance symmetric with no
    /// negative variance, quaternion of norm 1.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.check_motion()?;
        self.check_covariance()?;
        let time_ns = self.state.time_ns;
        require_finite("last angular rate", time_ns, self.last_rate_p_radps.as_slice())?;
        require_non_negative("last step", self.last_step_s)?;
        require_non_negative("covariance interval", self.interval.duration_s())?;
        require_non_negative("covariance_period_s", self.settings.covariance_period_s)?;
        self.settings.earth.check_restored(time_ns)?;
        require_finite("gravity of the place", time_ns, &self.earth.to_array())?;
        let noise = &self.settings.noise;
        let densities = [
            ("accelerometer noise", noise.accel),
            ("gyro noise", noise.gyro),
            ("accelerometer bias walk", noise.accel_bias),
            ("gyro bias walk", noise.gyro_bias),
            ("beam bias walk", noise.dvl_bias),
            ("scale factor walk", noise.dvl_scale),
        ];
        densities
            .into_iter()
            .try_for_each(|(field, value)| require_non_negative(field, value))?;
        self.evidence.check_restored(time_ns)?;
        self.lasting.check_restored(time_ns)?;
        self.extensions.further().check_restored(time_ns)?;
        if let Some(change) = &self.extensions.change {
            change.check_restored(time_ns)?;
        }
        if let Some(inertial) = &self.extensions.inertial {
            inertial.check_restored(time_ns)?;
        }
        if let Some(warm_up) = &self.extensions.warm_up {
            warm_up.check_restored()?;
        }
        self.extensions
            .water
            .as_ref()
            .map_or(Ok(()), |water| water.check_restored(time_ns))
    }

    fn check_motion(&self) -> Result<(), NavError> {
        let (state, own, time_ns) = (&self.state, &self.kinematics, self.state.time_ns);
        state.validate()?;
        let biases = [state.accel_bias_p_mps2, state.gyro_bias_p_radps];
        biases
            .iter()
            .try_for_each(|bias| require_finite("inertial bias", time_ns, &bias.to_array()))?;
        require_finite("beam bias", time_ns, state.dvl_bias_mps.as_slice())?;
        require_finite("scale factor", time_ns, &[state.dvl_scale_factor])?;
        require_finite("position", time_ns, &own.position_t_m)?;
        require_finite("velocity", time_ns, &own.velocity_p_mps)?;
        let norm = own.attitude_t_p.iter().map(|q| q * q).sum::<f64>().sqrt();
        if !((norm - 1.0).abs() <= ROUNDING) {
            return Err(NavError::OutOfRange {
                field: "attitude norm",
                value: norm,
                expected: "1 within 1e-6 (unit quaternion)",
            });
        }
        let derived = Kinematics::new(own.position_t_m, own.attitude_t_p, own.velocity_p_mps);
        let limit = ROUNDING * own.velocity_p_mps.iter().fold(1.0, |most: f64, v| most.max(v.abs()));
        let numbers = own.to_array().into_iter().zip(derived.to_array());
        let far = numbers
            .map(|(own, derived)| (own - derived).abs())
            .fold(0.0, |a: f64, b| if a <= b || b.is_nan() { b } else { a });
        if far <= limit {
            return Ok(());
        }
        Err(NavError::OutOfRange {
            field: "rotation or velocity",
            value: far,
            expected: "what follows from attitude and velocity",
        })
    }

    fn check_covariance(&self) -> Result<(), NavError> {
        let (covariance, time_ns) = (self.covariance(), self.state.time_ns);
        require_finite_squares("covariance", time_ns, self.covariance.as_slice())?;
        require_finite_squares("covariance", time_ns, covariance.as_slice())?;
        let is_symmetric = (covariance - covariance.transpose()).amax() <= ROUNDING * covariance.amax();
        // Rounding may leave the variance of a state that is known completely below zero.
        let least = -ROUNDING * covariance.diagonal().amax();
        if is_symmetric && covariance.diagonal().iter().all(|&variance| variance >= least) {
            return Ok(());
        }
        Err(NavError::NotPositiveDefinite {
            matrix: "state covariance",
            time_ns,
        })
    }
}
