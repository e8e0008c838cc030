//! States, and attitudes as angles.

use bottomlock::frames::{Platform, Rot, Tangent};
use bottomlock::plain_state::PlainState;
use bottomlock::state::NavState;

use crate::calls::{Status, call};
use crate::pointers::{numbers, put};
use crate::settings::Settings;

impl Settings for PlainState {
    const NAME: &'static str = "start";
}

/// A state at rest at the origin, level, heading north, with zero biases.
#[unsafe(no_mangle)]
pub extern "C" fn bl_state_at_rest(time_ns: i64) -> PlainState {
    PlainState::from(&NavState::at_rest(time_ns))
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
