//! Navigation state, error injection, and the error between two states.

use nalgebra::{SMatrix, SVector, Vector3, Vector4};

use crate::error::{NavError, require_finite, require_time};
use crate::frames::{Platform, Rot, Tangent, Vec3};
use crate::layout;
use crate::layout::DIM;

/// The error state vector δx = true − estimate (Eqs. 1 and 8), in the order of [`crate::layout`].
pub type ErrorVector = SVector<f64, DIM>;
/// Covariance of the error state, 20×20, SI units.
pub type Covariance = SMatrix<f64, DIM, DIM>;

/// The navigation state.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NavState {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position, tangent frame, m.
    pub position_t_m: Vec3<Tangent>,
    /// Attitude, platform to tangent.
    pub attitude_t_p: Rot<Tangent, Platform>,
    /// Velocity over ground, platform frame, m/s.
    pub velocity_p_mps: Vec3<Platform>,
    /// Accelerometer bias, m/s².
    pub accel_bias_p_mps2: Vec3<Platform>,
    /// Gyro bias, rad/s.
    pub gyro_bias_p_radps: Vec3<Platform>,
    /// Bias of each of the first four DVL beams, m/s.
    pub dvl_bias_mps: Vector4<f64>,
    /// DVL scale factor error.
    pub dvl_scale_factor: f64,
}

impl NavState {
    /// A state at rest at the origin, level, heading north, with zero biases.
    #[must_use]
    pub fn at_rest(time_ns: i64) -> Self {
        Self {
            time_ns,
            position_t_m: Vec3::zeros(),
            attitude_t_p: Rot::identity(),
            velocity_p_mps: Vec3::zeros(),
            accel_bias_p_mps2: Vec3::zeros(),
            gyro_bias_p_radps: Vec3::zeros(),
            dvl_bias_mps: Vector4::zeros(),
            dvl_scale_factor: 0.0,
        }
    }

    /// Checks that every number is finite.
    ///
    /// # Errors
    /// [`NavError::NotFinite`], which names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let time = self.time_ns;
        require_time("state", time)?;
        require_finite("state position_t_m", time, &self.position_t_m.to_array())?;
        require_finite("state attitude_t_p", time, &self.attitude_t_p.to_quaternion_wxyz())?;
        require_finite("state velocity_p_mps", time, &self.velocity_p_mps.to_array())?;
        require_finite("state accel_bias_p_mps2", time, &self.accel_bias_p_mps2.to_array())?;
        require_finite("state gyro_bias_p_radps", time, &self.gyro_bias_p_radps.to_array())?;
        require_finite("state dvl_bias_mps", time, self.dvl_bias_mps.as_slice())?;
        require_finite("state dvl_scale_factor", time, &[self.dvl_scale_factor])
    }

    /// Adds an error to the state: x = x̂ + δx, with R = Exp([ρ×]) R̂ for the attitude (Eq. 1).
    pub fn inject(&mut self, error: &ErrorVector) {
        let block = |start: usize| Vector3::new(error[start], error[start + 1], error[start + 2]);
        self.position_t_m.0 += block(layout::POSITION);
        self.attitude_t_p = Rot::<Tangent, Tangent>::exp(block(layout::ATTITUDE)) * self.attitude_t_p;
        self.velocity_p_mps.0 += block(layout::VELOCITY);
        self.accel_bias_p_mps2.0 += block(layout::ACCEL_BIAS);
        self.gyro_bias_p_radps.0 += block(layout::GYRO_BIAS);
        self.dvl_bias_mps += error.fixed_rows::<4>(layout::DVL_BIAS);
        self.dvl_scale_factor += error[layout::DVL_SCALE];
    }

    /// Error of `estimate` with respect to this true state, true minus estimate: the inverse of [`NavState::inject`].
    #[must_use]
    pub fn error_of(&self, estimate: &Self) -> ErrorVector {
        let mut error = ErrorVector::zeros();
        let rho = (self.attitude_t_p * estimate.attitude_t_p.inverse()).log();
        let vectors = [
            (layout::POSITION, (self.position_t_m - estimate.position_t_m).0),
            (layout::ATTITUDE, rho),
            (layout::VELOCITY, (self.velocity_p_mps - estimate.velocity_p_mps).0),
            (
                layout::ACCEL_BIAS,
                (self.accel_bias_p_mps2 - estimate.accel_bias_p_mps2).0,
            ),
            (
                layout::GYRO_BIAS,
                (self.gyro_bias_p_radps - estimate.gyro_bias_p_radps).0,
            ),
        ];
        for (start, vector) in vectors {
            error.fixed_rows_mut::<3>(start).copy_from(&vector);
        }
        error
            .fixed_rows_mut::<4>(layout::DVL_BIAS)
            .copy_from(&(self.dvl_bias_mps - estimate.dvl_bias_mps));
        error[layout::DVL_SCALE] = self.dvl_scale_factor - estimate.dvl_scale_factor;
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `error_of` inverts `inject`, also at pitch angles near ±90°.
    #[test]
    fn inject_inverts_error_of() {
        for pitch in [0.2, 1.569, -1.569] {
            let mut state = NavState::at_rest(0);
            state.attitude_t_p = Rot::from_euler_rad(0.3, pitch, -2.0);
            let truth_error = ErrorVector::from_fn(|i, _| 0.01 * (i as f64 - 7.0));
            let mut truth = state;
            truth.inject(&truth_error);
            assert!((truth.error_of(&state) - truth_error).norm() < 1e-14);
        }
    }

    /// The error for a NaN names its field.
    #[test]
    fn validate_names_the_field() {
        let mut state = NavState::at_rest(5);
        state.velocity_p_mps = Vec3::new(0.0, f64::NAN, 0.0);
        assert_eq!(
            state.validate(),
            Err(NavError::NotFinite {
                field: "state velocity_p_mps",
                time_ns: 5
            })
        );
    }
}
