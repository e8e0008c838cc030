//! Mounting and clock of the DVL as unknowns: what they do to the readings of the beams.
//!
//! The stated mounting is off by a rotation: a beam points along Exp([ψ×]) b, with ψ in the platform's axes. The stamps are
//! off by τ, which is to be added to them: a reading stamped t was taken at t + τ. To first order in τ, with the mean
//! acceleration a = dv/dt and the mean angular acceleration α of the platform's axes,
//!
//! ```text
//! y(t) = b · [(1 + SF) (v + τ a) + (ω + τ α) × l] + bias + noise
//! ∂y/∂ψ = b × u,   u = (1 + SF) (v + τ a) + (ω + τ α) × l
//! ∂y/∂τ = b · [(1 + SF) a + α × l]
//! ∂y/∂x = H + τ H_v F_v    (a depends on the state as F says)
//! ```
//!
//! ψ about the velocity itself is not seen, nor any ψ at rest, nor τ at constant velocity: such an unknown keeps its prior.
//! The scale factor is a state of the 20.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::aiding::Motion;
use crate::aiding::beams::{BeamTerms, beam_terms};
use crate::aiding::further::{FurtherRows, Process, Processes, block};
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error::{NavError, require_magnitude, require_non_negative};
use crate::frames::{Platform, Rot, Vec3};
use crate::layout::{DIM, VELOCITY};

/// Number of unknowns: three of the mounting (rad, about the platform's forward, right and down axes), then the clock (s).
pub const CALIBRATION: usize = 4;
/// Index of the clock.
pub const CLOCK: usize = 3;

/// An error or variance of each unknown.
pub type CalibrationVector = SVector<f64, CALIBRATION>;
/// Their covariance.
pub type CalibrationCovariance = SMatrix<f64, CALIBRATION, CALIBRATION>;

/// Largest σ of a mounting angle, rad: the model is of first order in the error of an update.
const LARGEST_MOUNTING_SD_RAD: f64 = 0.6;
/// Largest σ of a clock, s: the model is of first order in it.
const LARGEST_CLOCK_SD_S: f64 = 2.0;

/// What is known of mounting and clock beforehand, 1 sigma; an unknown of zero is none.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CalibrationPrior {
    /// Rotation from the stated mounting about forward, right and down, rad.
    pub mounting_sd_rad: [f64; 3],
    /// Time to add to the stamps, s.
    pub clock_sd_s: f64,
}

impl CalibrationPrior {
    /// Returns true if nothing is unknown.
    #[must_use]
    pub fn is_off(&self) -> bool {
        *self == Self::default()
    }

    /// Mounting and clock.
    pub(crate) fn processes(&self) -> Processes {
        let sds = self.mounting_sd_rad.into_iter().chain([self.clock_sd_s]);
        (block::CALIBRATION, sds.map(Process::constant).collect())
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let (mounting, clock) = ("options.calibration.mounting_sd_rad", "options.calibration.clock_sd_s");
        self.mounting_sd_rad
            .iter()
            .try_for_each(|&sd_rad| require_non_negative(mounting, sd_rad))?;
        require_non_negative(clock, self.clock_sd_s)?;
        let small = "at most 0.6 rad: is it in degrees?";
        require_magnitude(mounting, &self.mounting_sd_rad, LARGEST_MOUNTING_SD_RAD, small)?;
        let short = "at most 2 s: is it in milliseconds?";
        require_magnitude(clock, &[self.clock_sd_s], LARGEST_CLOCK_SD_S, short)
    }
}

/// Estimates of mounting and clock.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Calibration {
    /// From the stated mounting to the estimated one, in the platform's axes: Exp([ψ×]).
    pub mounting: Rot<Platform, Platform>,
    /// Time to add to the stamps, s.
    pub clock_s: f64,
}

impl Default for Calibration {
    /// As stated.
    fn default() -> Self {
        Self {
            mounting: Rot::identity(),
            clock_s: 0.0,
        }
    }
}

impl Calibration {
    /// Of [`Calibration::numbers`].
    #[must_use]
    pub fn of(numbers: &CalibrationVector) -> Self {
        Self {
            mounting: Rot::exp(numbers.fixed_rows::<3>(0).into_owned()),
            clock_s: numbers[CLOCK],
        }
    }

    /// Adds an error: Exp([δψ×]) before the mounting, δτ to the clock.
    pub fn inject(&mut self, error: &CalibrationVector) {
        self.mounting = Rot::<Platform, Platform>::exp(error.fixed_rows::<3>(0).into_owned()) * self.mounting;
        self.clock_s += error[CLOCK];
    }

    /// The estimates as numbers: the rotation vector of the mounting, rad, and the clock, s.
    #[must_use]
    pub fn numbers(&self) -> CalibrationVector {
        let [forward, right, down]: [f64; 3] = self.mounting.log().into();
        CalibrationVector::from([forward, right, down, self.clock_s])
    }
}

/// How the motion changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionChange {
    /// Rate of change of the velocity's components in the platform frame, m/s².
    pub acceleration_p_mps2: Vector3<f64>,
    /// That of the angular rate's, rad/s².
    pub angular_acceleration_p_radps2: Vector3<f64>,
    /// The rows of F for the velocity, by the error state.
    pub velocity_by_state: SMatrix<f64, 3, DIM>,
}

/// [`beam_terms`] of a DVL with estimated mounting and clock, with the Jacobian by both.
#[must_use]
pub fn calibrated_beam_terms(
    motion: &Motion<'_>,
    change: &MotionChange,
    geometry: &BeamGeometry,
    calibration: &Calibration,
    ping: &BeamSample,
) -> BeamTerms {
    let geometry = &geometry.clone().turned(calibration.mounting);
    let clock_s = calibration.clock_s;
    let mut state = *motion.state;
    state.velocity_p_mps = state.velocity_p_mps + Vec3::from(change.acceleration_p_mps2 * clock_s);
    let then = Motion {
        state: &state,
        rate_ip_p_radps: motion.rate_ip_p_radps + change.angular_acceleration_p_radps2 * clock_s,
        ..*motion
    };
    let mut terms = beam_terms(&then, geometry, ping);
    let by_velocity = terms.jacobian.fixed_columns::<3>(VELOCITY).into_owned();
    terms.jacobian += by_velocity * change.velocity_by_state * clock_s;
    let scale = 1.0 + state.dvl_scale_factor;
    let rate_tp = then.rate_tp();
    let mut rows = Box::new(FurtherRows::zeros());
    for beam in ping.valid.iter() {
        let (direction, lever) = (geometry.direction_p(beam), geometry.lever_arm_p_m(beam));
        let at_transducer = state.velocity_p_mps.0 * scale + rate_tp.cross(lever);
        let changing = change.acceleration_p_mps2 * scale + change.angular_acceleration_p_radps2.cross(lever);
        let mut row = rows.row_mut(beam);
        row.fixed_columns_mut::<3>(block::CALIBRATION.first)
            .copy_from(&direction.cross(&at_transducer).transpose());
        row[block::CALIBRATION.first + CLOCK] = direction.dot(&changing);
    }
    terms.by_further = Some(rows);
    terms
}

#[cfg(test)]
#[path = "calibration_tests.rs"]
mod tests;
