//! Mounting and clock of the DVL ([`crate::aiding::calibration`]) as states beside the error state.
//!
//! They are constants: nothing is added to their variance.

use nalgebra::SMatrix;

use super::mean_change::MeanChange;
use crate::aiding::calibration::{Calibration, CalibrationPrior, CalibrationVector, MotionChange};
use crate::error::{NavError, require_finite};
use crate::layout::DIM;
use crate::mechanisation::Kinematics;

/// Estimates of mounting and clock.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct CalibrationBlock {
    prior: CalibrationPrior,
    estimate: Calibration,
    change: MeanChange,
}

impl CalibrationBlock {
    /// The states at their prior; `None` where nothing is unknown.
    pub(super) fn new(prior: &CalibrationPrior, kinematics: &Kinematics<f64>) -> Option<Self> {
        (!prior.is_off()).then(|| Self {
            prior: *prior,
            estimate: Calibration::default(),
            change: MeanChange::new(prior.clock_sd_s, kinematics),
        })
    }

    /// The same prior again, at a state.
    pub(super) fn restarted(&self, kinematics: &Kinematics<f64>) -> Option<Self> {
        Self::new(&self.prior, kinematics)
    }

    /// Variances of the prior.
    pub(super) fn prior_variance(&self) -> CalibrationVector {
        self.prior.variance()
    }

    /// Checks states that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.prior.validate()?;
        require_finite("calibration", time_ns, self.estimate.numbers().as_slice())?;
        self.change.check_restored(time_ns)
    }

    /// The state has been corrected.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        self.change.begin(kinematics);
    }

    /// How the motion changes; `velocity_by_state` are the rows of F for the velocity.
    pub(super) fn motion_change(&self, velocity_by_state: SMatrix<f64, 3, DIM>) -> MotionChange {
        self.change.motion_change(velocity_by_state)
    }

    /// The motion has gone on for `duration_s`, to `end`.
    pub(super) fn extend(&mut self, duration_s: f64, end: &Kinematics<f64>) {
        self.change.extend(duration_s, end);
    }

    /// Adds an error to the estimates.
    pub(super) fn inject(&mut self, error: &CalibrationVector) {
        self.estimate.inject(error);
    }

    /// The estimates.
    pub(super) fn estimate(&self) -> &Calibration {
        &self.estimate
    }
}

#[cfg(test)]
#[path = "calibration_tests.rs"]
mod tests;
