//! A navigation state as plain numbers, as C's structure and JSON have it.

use nalgebra::Vector4;
use serde::{Deserialize, Serialize};

use crate::error::NavError;
use crate::frames::{Rot, Vec3};
use crate::state::NavState;

/// A navigation state. SI units; `_t` is the tangent frame north-east-down, `_p` the platform frame forward-right-down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[repr(C)]
pub struct PlainState {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position, m.
    pub position_t_m: [f64; 3],
    /// Attitude, platform to tangent: a unit quaternion, scalar first.
    pub attitude_t_p: [f64; 4],
    /// Velocity over ground, m/s.
    pub velocity_p_mps: [f64; 3],
    /// Accelerometer bias, m/s^2.
    pub accel_bias_p_mps2: [f64; 3],
    /// Gyro bias, rad/s.
    pub gyro_bias_p_radps: [f64; 3],
    /// Bias of each of the first four beams, m/s.
    pub dvl_bias_mps: [f64; 4],
    /// Scale factor error of the DVL.
    pub dvl_scale_factor: f64,
}

impl From<&NavState> for PlainState {
    fn from(state: &NavState) -> Self {
        Self {
            time_ns: state.time_ns,
            position_t_m: state.position_t_m.to_array(),
            attitude_t_p: state.attitude_t_p.to_quaternion_wxyz(),
            velocity_p_mps: state.velocity_p_mps.to_array(),
            accel_bias_p_mps2: state.accel_bias_p_mps2.to_array(),
            gyro_bias_p_radps: state.gyro_bias_p_radps.to_array(),
            dvl_bias_mps: state.dvl_bias_mps.into(),
            dvl_scale_factor: state.dvl_scale_factor,
        }
    }
}

impl Default for PlainState {
    fn default() -> Self {
        Self::from(&NavState::at_rest(0))
    }
}

impl PlainState {
    /// The state, whose name in messages is `name`; its numbers are not checked yet.
    ///
    /// # Errors
    /// As [`Rot::from_unit_wxyz`].
    pub fn state(&self, name: &str) -> Result<NavState, NavError> {
        Ok(NavState {
            time_ns: self.time_ns,
            position_t_m: Vec3::from_array(self.position_t_m),
            attitude_t_p: Rot::from_unit_wxyz(&format!("{name}.attitude_t_p"), self.attitude_t_p)?,
            velocity_p_mps: Vec3::from_array(self.velocity_p_mps),
            accel_bias_p_mps2: Vec3::from_array(self.accel_bias_p_mps2),
            gyro_bias_p_radps: Vec3::from_array(self.gyro_bias_p_radps),
            dvl_bias_mps: Vector4::from(self.dvl_bias_mps),
            dvl_scale_factor: self.dvl_scale_factor,
        })
    }
}
