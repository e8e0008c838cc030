//! States as plain numbers, and attitudes as angles.

use bottomlock::NavError;
use bottomlock::frames::{Platform, Rot, Tangent, Vec3};
use bottomlock::settings::read;
use bottomlock::state::NavState;
use nalgebra::Vector4;
use serde::{Deserialize, Deserializer, Serialize};

use crate::calls::{Outcome, Status, call};
use crate::pointers::{numbers, put};
use crate::settings::Settings;

/// A navigation state. SI units; `_t` is the tangent frame north-east-down, `_p` the platform frame forward-right-down.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[repr(C)]
pub struct State {
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

impl From<&NavState> for State {
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

impl Default for State {
    fn default() -> Self {
        bl_state_at_rest(0)
    }
}

impl Settings for State {
    const NAME: &'static str = "start";

    fn read<'de, D: Deserializer<'de, Error = serde_json::Error>>(source: D) -> Result<Self, NavError> {
        read(Self::NAME, source)
    }
}

impl State {
    /// The kernel's; `name` is that of the state in messages.
    pub(crate) fn to_kernel(self, name: &str) -> Outcome<NavState> {
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

/// A state at rest at the origin, level, heading north, with zero biases.
#[unsafe(no_mangle)]
pub extern "C" fn bl_state_at_rest(time_ns: i64) -> State {
    State::from(&NavState::at_rest(time_ns))
}

/// The attitude of roll, pitch and yaw (z-y-x), rad, as a quaternion, 4 numbers, scalar first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_attitude_from_euler(
    roll_rad: f64,
    pitch_rad: f64,
    yaw_rad: f64,
    attitude_t_p: *mut f64,
) -> Status {
    call!(status, {
        let turned = Rot::<Tangent, Platform>::from_euler_rad(roll_rad, pitch_rad, yaw_rad).to_quaternion_wxyz();
        // The norm tells angles that are not finite.
        Rot::<Tangent, Platform>::from_unit_wxyz("attitude of roll, pitch and yaw", turned)?;
        put("attitude_t_p", attitude_t_p.cast(), turned)
    })
}

/// Roll, pitch and yaw (z-y-x), 3 numbers, rad, of an attitude, 4 numbers, scalar first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_euler_from_attitude(attitude_t_p: *const f64, roll_pitch_yaw_rad: *mut f64) -> Status {
    call!(status, {
        let given = Rot::<Tangent, Platform>::from_unit_wxyz("attitude_t_p", numbers("attitude_t_p", attitude_t_p)?)?;
        put("roll_pitch_yaw_rad", roll_pitch_yaw_rad.cast(), given.to_euler_rad())
    })
}
