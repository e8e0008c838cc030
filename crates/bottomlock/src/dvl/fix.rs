//! Velocity fix from one ping.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::geometry::{BeamGeometry, BeamMask, BeamSample};
use super::partial::{Assumptions, BeamNoise, Component, FixEstimator, PartialMethod, Reason, fix_estimator};
use super::velocity::{HEAVE_SLOT, SLOTS, VIRTUAL_SLOT};
use crate::error::{NavError, require_finite, require_finite_squares};
use crate::frames::{Platform, Vec3};

/// Prior velocity of an INS with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityPrior {
    /// Velocity over ground, platform frame, m/s.
    pub velocity_p_mps: Vec3<Platform>,
    /// Covariance of the velocity, (m/s)².
    pub cov_m2ps2: Matrix3<f64>,
}

/// A velocity from one ping.
#[derive(Debug, Clone, PartialEq)]
pub struct VelocityFix {
    /// Velocity over ground, platform frame, m/s; zero along unobserved directions.
    pub velocity_p_mps: Vec3<Platform>,
    /// Gain and covariance of the fix, with the status of each component.
    pub estimator: FixEstimator,
    /// The beams that were used.
    pub beams: BeamMask,
}

/// Outcome of one ping.
#[derive(Debug, Clone, PartialEq)]
pub enum FixOutcome {
    /// Every component is solved.
    Fix(VelocityFix),
    /// At least one component is not solved; see [`FixEstimator::components`].
    Unobservable(VelocityFix),
    /// No beam is valid.
    TooFewBeams,
    /// The method needs a prior.
    PriorRequired,
}

/// Angular rate and prior velocity at a ping.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PingContext {
    /// Angular rate ω_tp, platform frame, rad/s, for the lever arms.
    pub omega_tp_p_radps: Vector3<f64>,
    /// Prior velocity, for the methods that use one.
    pub prior: Option<VelocityPrior>,
}

/// Solves one ping for the platform velocity.
///
/// # Errors
/// [`NavError::BadBeam`] for a valid beam without a finite velocity or a positive standard deviation; otherwise as
/// [`fix_estimator`].
///
/// # Source
/// Tal et al. 2017, Eqs. (15)–(17): lever arms and sound speed are removed from the readings before the least squares.
///
/// ```
/// use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus};
/// use bottomlock::dvl::fix::{FixOutcome, PingContext, solve};
/// use bottomlock::dvl::partial::{Assumptions, PartialMethod};
/// let geometry = BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap();
/// let mut ping = BeamSample { time_ns: 0, velocity_mps: [0.0; 8], sd_mps: [0.042; 8], valid: BeamMask::all(2) };
/// for beam in 0..2 {
///     ping.velocity_mps[beam] = 2.0 * geometry.direction_p(beam).x; // surge of 2 m/s
/// }
/// let outcome = solve(PartialMethod::PartialLoose, &geometry, &ping, &PingContext::default(), &Assumptions::default()).unwrap();
/// let FixOutcome::Unobservable(fix) = outcome else { panic!("beams 1 and 2 determine surge alone") };
/// assert!(fix.estimator.is_solved(0) && !fix.estimator.is_solved(1));
/// assert!((fix.velocity_p_mps.0.x - 2.0).abs() < 1e-12);
/// ```
pub fn solve(
    method: PartialMethod,
    geometry: &BeamGeometry,
    ping: &BeamSample,
    context: &PingContext,
    assumptions: &Assumptions,
) -> Result<FixOutcome, NavError> {
    ping.validate(geometry)?;
    require_finite("omega_tp_p_radps", ping.time_ns, context.omega_tp_p_radps.as_slice())?;
    if let Some(prior) = &context.prior {
        require_finite("prior velocity_p_mps", ping.time_ns, &prior.velocity_p_mps.to_array())?;
    }
    let scale = 1.0 / geometry.sound_speed_scale();
    let mut noise = BeamNoise::zeros();
    let mut values = SMatrix::<f64, SLOTS, 1>::zeros();
    for beam in ping.valid.iter() {
        noise[(beam, beam)] = (ping.sd_mps[beam] * scale).powi(2);
        let lever = context.omega_tp_p_radps.cross(geometry.lever_arm_p_m(beam));
        values[beam] = ping.velocity_mps[beam] * scale - geometry.direction_p(beam).dot(&lever);
    }
    let prior_cov = context.prior.as_ref().map(|prior| &prior.cov_m2ps2);
    let estimator = fix_estimator(method, geometry, ping.valid, &noise, prior_cov, assumptions)?;
    if let Some(prior) = &context.prior {
        let velocity = prior.velocity_p_mps.0;
        for (index, beam) in estimator.virtual_beams.iter().enumerate() {
            if let Some(beam) = beam {
                values[VIRTUAL_SLOT + index] = geometry.direction_p(*beam).dot(&velocity);
            }
        }
        values[HEAVE_SLOT] = velocity.z;
    }
    match estimator.components[0] {
        Component::Unobservable(Reason::NoBeams) => return Ok(FixOutcome::TooFewBeams),
        Component::Unobservable(Reason::PriorRequired) => return Ok(FixOutcome::PriorRequired),
        _ => {}
    }
    let velocity = estimator.gain * values;
    require_finite("solved velocity_p_mps", ping.time_ns, velocity.as_slice())?;
    require_finite_squares("solved cov_m2ps2", ping.time_ns, estimator.covariance.as_slice())?;
    let complete = (0..3).all(|k| estimator.is_solved(k));
    let fix = VelocityFix {
        velocity_p_mps: velocity.into(),
        estimator,
        beams: ping.valid,
    };
    Ok(if complete {
        FixOutcome::Fix(fix)
    } else {
        FixOutcome::Unobservable(fix)
    })
}
