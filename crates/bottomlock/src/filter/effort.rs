//! Forces of the thrusters in a filter: what it knows of drag and mass, and the acceleration that they explain.

use nalgebra::{SMatrix, SVector};

use super::Eskf;
use super::mean_change::MeanChange;
use crate::aiding::Innovation;
use crate::aiding::effort::{EFFORT, EffortModel, EffortSample, SPEED_SCALE, effort};
use crate::aiding::further::FIRST_EFFORT;
use crate::error::NavError;
use crate::frames::{Platform, Vec3};
use crate::mechanisation::Kinematics;

/// Time constant of the mean acceleration, s: a longer one lags behind what thrusters change within seconds.
const ACCELERATION_TIME_S: f64 = 0.1;

/// Mass and drag, and the acceleration.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct EffortBlock {
    model: EffortModel,
    change: MeanChange,
}

impl EffortBlock {
    /// For a model, from a state on.
    pub(super) fn new(model: &EffortModel, kinematics: &Kinematics<f64>) -> Self {
        Self {
            model: *model,
            change: MeanChange::new(ACCELERATION_TIME_S, kinematics),
        }
    }

    /// The same model again, at a state.
    pub(super) fn restarted(&self, kinematics: &Kinematics<f64>) -> Self {
        Self::new(&self.model, kinematics)
    }

    /// The state has been corrected.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        self.change.begin(kinematics);
    }

    /// The motion has gone on for `duration_s`, to `end`.
    pub(super) fn extend(&mut self, duration_s: f64, end: &Kinematics<f64>) {
        self.change.extend(duration_s, end);
    }

    /// Checks a block that was read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.model.require_usable()?;
        self.change.check_restored(time_ns)
    }
}

impl Eskf {
    /// Speed over that by the drag law, slip, m/s, and relative error of mass and added mass, along surge, sway and heave each, with
    /// the covariance of their errors; `None` where they are not estimated.
    #[must_use]
    pub fn effort(&self) -> Option<(SVector<f64, EFFORT>, SMatrix<f64, EFFORT, EFFORT>)> {
        self.extensions.effort.as_ref()?;
        let estimate = self.extensions.processes.estimate();
        Some((
            estimate.fixed_rows::<EFFORT>(FIRST_EFFORT).into_owned(),
            self.extensions.covariance_of(FIRST_EFFORT),
        ))
    }

    /// The innovation of forces along one axis; [`Eskf::prepare_for_thrust`] has gone before.
    pub(super) fn effort_innovation(
        &self,
        axis: usize,
        sample: &EffortSample,
        lever_p_m: &Vec3<Platform>,
    ) -> Innovation {
        let Some(block) = self.extensions.effort.as_deref() else {
            return Innovation::empty();
        };
        let change = block.change.motion_change(self.velocity_by_state());
        let speed_scale = self.extensions.processes.estimate()[FIRST_EFFORT + SPEED_SCALE + axis];
        self.with_motion(|motion| effort(axis, motion, &change, &block.model, sample, &lever_p_m.0, speed_scale))
    }
}

#[cfg(test)]
#[path = "effort_tests.rs"]
mod tests;
