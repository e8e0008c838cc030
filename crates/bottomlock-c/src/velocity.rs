//! Velocity of one ping.

use std::ffi::c_char;

use bottomlock::dvl::fix::{PingContext, VelocityPrior, solve};
use bottomlock::dvl::fix_row::{FIX_METHODS, FixRow};
use bottomlock::dvl::partial::PartialMethod;
use bottomlock::frames::Vec3;
use nalgebra::{Matrix3, Vector3};

use crate::calls::{Failure, Outcome, Status, status};
use crate::geometry::Geometry;
use crate::names::hint;
use crate::options::Options;
use crate::pointers::{at, given, ping, put, text};

/// How much of a velocity a ping determines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum Fix {
    /// Surge, sway and heave are solved.
    Complete = 0,
    /// Some of them are; the others are NaN.
    Partial = 1,
    /// None of them is, though there are beams.
    Unobservable = 2,
    /// No beam is valid.
    NoBeams = 3,
    /// The method needs a prior.
    PriorRequired = 4,
}

/// A velocity from one ping.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Velocity {
    /// How much is solved.
    pub fix: Fix,
    /// Surge, sway and heave over ground, platform frame, m/s; NaN for a component that is not solved.
    pub velocity_p_mps: [f64; 3],
    /// Covariance, (m/s)^2; NaN likewise.
    pub cov_m2ps2: [[f64; 3]; 3],
    /// Why a component is not solved: 0 solved, 1 no beams, 2 outside what the beams measure, 3 the assumption does not help, 4 a
    /// prior is required, 5 known from the prior alone.
    pub component: [u8; 3],
    /// Method a component comes from: 1 least_squares, 2 virtual_beam, 3 nullified_sway, 4 partial_loose, 5 virtual_heave,
    /// 6 information, 7 weak_sway; 0 for none.
    pub source: [u8; 3],
    /// Number of independent directions.
    pub rank: u8,
    /// The velocity along what is observed, m/s; zero across it.
    pub observed_velocity_p_mps: [f64; 3],
    /// Its information matrix, (s/m)^2.
    pub information_s2pm2: [[f64; 3]; 3],
}

fn method_of(name: &str) -> Outcome<PartialMethod> {
    let found = FIX_METHODS.iter().find(|(known, _)| *known == name);
    found.map(|(_, method)| *method).ok_or_else(|| {
        let known = FIX_METHODS.map(|(known, _)| known);
        let all = known.join(", ");
        let message = format!(
            "unknown method '{name}', expected one of {all} ({})",
            hint(name, &known)
        );
        Failure::new(Status::UnknownName, message).about("method")
    })
}

impl From<FixRow> for Velocity {
    fn from(row: FixRow) -> Self {
        const FIXES: [Fix; 5] = [
            Fix::Complete,
            Fix::Partial,
            Fix::Unobservable,
            Fix::NoBeams,
            Fix::PriorRequired,
        ];
        Self {
            fix: FIXES[usize::from(row.status)],
            velocity_p_mps: row.velocity_p_mps,
            cov_m2ps2: row.cov_m2ps2,
            component: row.component,
            source: row.source,
            rank: row.rank,
            observed_velocity_p_mps: row.observed_velocity_p_mps,
            information_s2pm2: row.information_s2pm2,
        }
    }
}

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
    velocity: *mut Velocity,
) -> Status {
    status(|| {
        let (geometry, method, prior_velocity, prior_cov, rate, options) = (
            &at("geometry", geometry)?.0,
            method_of(text("method", method)?)?,
            given::<3>(prior_velocity_p_mps),
            given::<9>(prior_cov_m2ps2),
            given::<3>(omega_tp_p_radps),
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
        put("velocity", velocity, FixRow::from(&outcome).into())
    })
}
