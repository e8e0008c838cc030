//! What is pushed into a navigator. A push that is refused changes nothing but the count of late readings.

use bottomlock::aiding::acoustic_position::AcousticPositionSample;
use bottomlock::aiding::thrust::ThrustSample;
use bottomlock::frames::Rot;
use bottomlock::mechanisation::ImuSample;
use bottomlock::navigator::events::{
    AttitudeSample, DepthSample, Event, GpsSample, GpsVelocity, HeadingSample, VelocitySample, WaterSample,
};
use nalgebra::Matrix3;

use crate::calls::{Outcome, Status, call};
use crate::navigator::Navigator;
use crate::pointers::{at, given, numbers, ping, values, vector};

/// Takes events one after another; reports are those of this push, also where it ends with an error.
fn push(navigator: &Navigator, events: impl Iterator<Item = Event>, taken: &mut usize) -> Outcome<()> {
    let mut held = navigator.locked()?;
    let held = &mut *held;
    held.notices.clear();
    for event in events {
        let notices = &mut held.notices;
        held.live.push(&event, &mut |notice| notices.push(notice.clone()))?;
        *taken += 1;
    }
    Ok(())
}

/// Takes the event of a sample for a navigator.
macro_rules! push_one {
    ($navigator:expr, $sample:expr) => {
        call!(status, {
            let navigator = at("navigator", $navigator)?;
            push(navigator, std::iter::once(Event::from($sample)), &mut 0)
        })
    };
}

/// An inertial reading: angular rate relative to inertial space and specific force in the platform frame, 3 numbers each, rad/s
/// and m/s^2; at rest and level force_p_mps2 is (0, 0, -9.8).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_imu(
    navigator: *mut Navigator,
    time_ns: i64,
    omega_p_radps: *const f64,
    force_p_mps2: *const f64,
) -> Status {
    push_one! { navigator, Event::Imu(ImuSample {
        time_ns,
        rate_p_radps: vector("omega_p_radps", omega_p_radps)?,
        force_p_mps2: vector("force_p_mps2", force_p_mps2)?,
    }) }
}

/// Many inertial readings: `count` times, and as many rows of 3 numbers each. An error refuses the reading that it names and those
/// after it; `taken` is the number of those before it, and may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_imu_block(
    navigator: *mut Navigator,
    count: usize,
    time_ns: *const i64,
    omega_p_radps: *const f64,
    force_p_mps2: *const f64,
    taken: *mut usize,
) -> Status {
    let mut number = 0;
    let outcome = call!(status, {
        let (navigator, times, rates, forces) = (
            at("navigator", navigator)?,
            values("time_ns", time_ns, count)?,
            values("omega_p_radps", omega_p_radps.cast::<[f64; 3]>(), count)?,
            values("force_p_mps2", force_p_mps2.cast::<[f64; 3]>(), count)?,
        );
        let readings = ImuSample::of_columns(times, rates, forces);
        push(navigator, readings.map(Event::Imu), &mut number)
    });
    // SAFETY: as the header asks; NULL is allowed.
    if let Some(taken) = unsafe { taken.as_mut() } {
        *taken = number;
    }
    outcome
}

/// A ping: velocity along each beam, m/s, 1 for a valid beam and 0 for a lost one, and the standard deviations, m/s; `beams` numbers
/// each. A beam reads positive when the vehicle moves along it; entries of lost beams may be NaN.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_beams(
    navigator: *mut Navigator,
    time_ns: i64,
    beams: usize,
    velocity_mps: *const f64,
    valid: *const u8,
    sd_mps: *const f64,
) -> Status {
    push_one!(navigator, {
        let expected = at("navigator", navigator)?.beams;
        Event::Beams(ping(time_ns, expected, beams, (velocity_mps, valid, sd_mps))?)
    })
}

/// Beams that the water returned, as `bl_push_beams` and with its sign. `range_m` leads from the transducer along the beam to the
/// middle of the cell, m. For options with "water_track".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_water_track(
    navigator: *mut Navigator,
    time_ns: i64,
    beams: usize,
    velocity_mps: *const f64,
    valid: *const u8,
    sd_mps: *const f64,
    range_m: f64,
) -> Status {
    push_one!(navigator, {
        let expected = at("navigator", navigator)?.beams;
        let ping = ping(time_ns, expected, beams, (velocity_mps, valid, sd_mps))?;
        Event::WaterTrack(WaterSample { ping, range_m })
    })
}

/// A velocity solved by the instrument: 3 numbers in the platform frame, m/s, with its covariance, 3 by 3, (m/s)^2.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_velocity(
    navigator: *mut Navigator,
    time_ns: i64,
    velocity_p_mps: *const f64,
    cov_m2ps2: *const f64,
) -> Status {
    push_one! { navigator, VelocitySample {
        time_ns,
        velocity_p_mps: vector("velocity_p_mps", velocity_p_mps)?,
        cov_m2ps2: Matrix3::from_row_slice(&numbers::<9>("cov_m2ps2", cov_m2ps2)?),
    } }
}

/// A depth below the origin of the tangent frame, with its standard deviation, m.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_depth(navigator: *mut Navigator, time_ns: i64, depth_m: f64, sd_m: f64) -> Status {
    push_one! { navigator, DepthSample { time_ns, depth_m, sd_m } }
}

/// Speed through the water along surge, sway and heave, 3 numbers, m/s, that the vehicle's drives say, 0 along an axis that is not
/// driven, with the white noise of each, 1 sigma. For options of "thrust".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_thrust(
    navigator: *mut Navigator,
    time_ns: i64,
    speed_p_mps: *const f64,
    sd_mps: f64,
) -> Status {
    push_one! { navigator, ThrustSample { time_ns, speed_p_mps: vector("speed_p_mps", speed_p_mps)?, sd_mps } }
}

/// An attitude, 4 numbers, scalar first, with the standard deviations of its Euler angles, rad.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_attitude(
    navigator: *mut Navigator,
    time_ns: i64,
    attitude_t_p: *const f64,
    roll_pitch_sd_rad: f64,
    yaw_sd_rad: f64,
) -> Status {
    push_one! { navigator, AttitudeSample {
        time_ns,
        attitude_t_p: Rot::from_unit_wxyz("attitude_t_p", numbers("attitude_t_p", attitude_t_p)?)?,
        roll_pitch_sd_rad,
        yaw_sd_rad,
    } }
}

/// A yaw angle alone, with its standard deviation, rad.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_heading(navigator: *mut Navigator, time_ns: i64, yaw_rad: f64, sd_rad: f64) -> Status {
    push_one! { navigator, HeadingSample { time_ns, yaw_rad, sd_rad } }
}

/// A GPS position and velocity in the tangent frame with their standard deviations, 3 numbers each, m and m/s; velocity and its
/// standard deviations are NULL for a position alone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_gps(
    navigator: *mut Navigator,
    time_ns: i64,
    position_t_m: *const f64,
    position_sd_m: *const f64,
    velocity_t_mps: *const f64,
    velocity_sd_mps: *const f64,
) -> Status {
    let with_velocity = !(velocity_t_mps.is_null() && velocity_sd_mps.is_null());
    push_one! { navigator, GpsSample {
        velocity: match with_velocity {
            true => Some(GpsVelocity {
                velocity_t_mps: vector("velocity_t_mps", velocity_t_mps)?,
                sd_mps: numbers("velocity_sd_mps", velocity_sd_mps)?,
            }),
            false => None,
        },
        time_ns,
        position_t_m: vector("position_t_m", position_t_m)?,
        position_sd_m: numbers("position_sd_m", position_sd_m)?,
    } }
}

/// An acoustic position fix (USBL, LBL) of the transponder in the tangent frame, 3 numbers, m, with its standard deviations, 3
/// numbers; NULL for those of the model at the fix's slant range.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_push_acoustic_position(
    navigator: *mut Navigator,
    time_ns: i64,
    position_t_m: *const f64,
    sd_m: *const f64,
) -> Status {
    push_one!(navigator, {
        let model = &at("navigator", navigator)?.sensors.acoustic_position;
        AcousticPositionSample::new(
            time_ns,
            vector("position_t_m", position_t_m)?,
            given(sd_m.cast()),
            model,
        )
    })
}
