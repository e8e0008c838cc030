//! Velocity of one ping.

use std::ffi::c_char;

use bottomlock::dvl::fix::{PingContext, VelocityPrior, solve};
use bottomlock::dvl::fix_row::FixRow;
use bottomlock::dvl::partial::PartialMethod;
use bottomlock::frames::Vec3;
use nalgebra::{Matrix3, Vector3};

use crate::calls::{Failure, Status, call};
use crate::geometry::Geometry;
use crate::options::Options;
use crate::pointers::{at, given, ping, put, text};

/// Velocity of one ping with its covariance, without a navigator.
///
/// `method`: least_squares, virtual_beam, nullified_sway, partial_loose, virtual_heave, selector, information or weak_sway. Beams as
/// in `bl_push_beams`. `prior_velocity_p_mps` (3 numbers) and `prior_cov_m2ps2` (3 by 3) are those of an inertial navigator for the
/// methods that use one, both NULL otherwise. `omega_tp_p_radps` (3 numbers) is the angular rate for the lever arms, NULL for none.
/// `options` has the parameters of the methods, NULL for the default ones. Beams too few for a velocity are no error: `fix` says it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_solve_velocity(
    geometry: *const Geometry,
    method: *const c_char,
    beams: usize,
    velocity_mps: *const f64,
    valid: *const u8,
    sd_mps: *const f64,
    prior_velocity_p_mps: *const f64,
    prior_cov_m2ps2: *const f64,
    omega_tp_p_radps: *const f64,
    options: *const Options,
    velocity: *mut FixRow,
) -> Status {
    call!(status, {
        let (geometry, method, prior_velocity, prior_cov, rate, options) = (
            &at("geometry", geometry)?.0,
            PartialMethod::named(text("method", method)?)?,
            given(prior_velocity_p_mps.cast::<[f64; 3]>()),
            given(prior_cov_m2ps2.cast::<[f64; 9]>()),
            given(omega_tp_p_radps.cast::<[f64; 3]>()),
            options.as_ref().map(|options| options.0).unwrap_or_default(),
        );
        let ping = ping(0, geometry.beams(), beams, (velocity_mps, valid, sd_mps))?;
        let prior = match (prior_velocity, prior_cov) {
            (Some(velocity), Some(cov)) => Some(VelocityPrior {
                velocity_p_mps: Vec3::from_array(velocity),
                cov_m2ps2: Matrix3::from_row_slice(&cov),
            }),
            (None, None) => None,
            _ => {
                return Err(Failure::invalid(
                    "prior_velocity_p_mps and prior_cov_m2ps2 go together: give both or neither",
                ));
            }
        };
        let context = PingContext {
            omega_tp_p_radps: rate.map_or(Vector3::zeros(), Vector3::from),
            prior,
        };
        let outcome = solve(method, geometry, &ping, &context, &options.assumptions)
            .map_err(|error| Failure::timeless(&error))?;
        put("velocity", velocity, FixRow::from(&outcome))
    })
}
