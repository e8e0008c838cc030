//! Mounting and clock of the DVL ([`crate::aiding::calibration`]) as states beside the error state.
//!
//! They are constants: nothing is added to their variance. In an update their errors c count as noise of the beams that is
//! correlated with the error state, n = D_c δc + white noise, so that the arithmetic of the 20 states is that of any update;
//! the gain of c itself follows from E[δc zᵀ], as for the other states beside the 20.

use nalgebra::{SMatrix, SVector};

use super::mean_change::MeanChange;
use super::water_block::Update;
use crate::aiding::Innovation;
use crate::aiding::calibration::{
    CALIBRATION, Calibration, CalibrationCovariance, CalibrationPrior, CalibrationRows, CalibrationVector, MotionChange,
};
use crate::aiding::water::{WATER, WaterVector};
use crate::aiding::{CorrectedPath, CorrelatedNoise, MAX_ROWS};
use crate::error::{NavError, require_finite, require_finite_squares};
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};

/// Estimates of mounting and clock with their covariances.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct CalibrationBlock {
    prior: CalibrationPrior,
    estimate: Calibration,
    covariance: CalibrationCovariance,
    /// E[δx δcᵀ].
    cross: SMatrix<f64, DIM, CALIBRATION>,
    /// E[δb δc], with the bias of the depth sensor; zero without it.
    depth_bias: CalibrationVector,
    /// E[δw δcᵀ], with the water states; zero without them.
    water: SMatrix<f64, WATER, CALIBRATION>,
    change: MeanChange,
}

impl CalibrationBlock {
    /// The states at their prior; `None` where nothing is unknown.
    pub(super) fn new(prior: &CalibrationPrior, kinematics: &Kinematics<f64>) -> Option<Self> {
        (!prior.is_off()).then(|| Self {
            prior: *prior,
            estimate: Calibration::default(),
            covariance: CalibrationCovariance::from_diagonal(&prior.variance()),
            cross: SMatrix::zeros(),
            depth_bias: CalibrationVector::zeros(),
            water: SMatrix::zeros(),
            change: MeanChange::new(prior.clock_sd_s, kinematics),
        })
    }

    /// The same prior again, at a state.
    pub(super) fn restarted(&self, kinematics: &Kinematics<f64>) -> Option<Self> {
        Self::new(&self.prior, kinematics)
    }

    /// Checks states that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.prior.validate()?;
        require_finite("calibration", time_ns, self.estimate.numbers().as_slice())?;
        require_finite_squares("calibration covariance", time_ns, self.covariance.as_slice())?;
        require_finite_squares("calibration covariance", time_ns, self.cross.as_slice())?;
        require_finite_squares("calibration covariance", time_ns, self.depth_bias.as_slice())?;
        require_finite_squares("calibration covariance", time_ns, self.water.as_slice())?;
        self.change.check_restored(time_ns)
    }

    /// Becomes independent of the water states, which start anew.
    pub(super) fn start_water(&mut self) {
        self.water = SMatrix::zeros();
    }

    /// The state has been corrected.
    pub(super) fn begin_interval(&mut self, kinematics: &Kinematics<f64>) {
        self.change.begin(kinematics);
    }

    /// How the motion changes; `velocity_by_state` are the rows of F for the velocity.
    pub(super) fn motion_change(&self, velocity_by_state: SMatrix<f64, 3, DIM>) -> MotionChange {
        MotionChange {
            acceleration_p_mps2: self.change.acceleration_p_mps2,
            angular_acceleration_p_radps2: self.change.angular_acceleration_p_radps2,
            velocity_by_state,
        }
    }

    /// Adds what mounting and clock add to the noise of rows with the Jacobian `rows`.
    pub(super) fn add_to(&self, innovation: &mut Innovation, rows: &CalibrationRows) {
        let x = self.cross * rows.transpose();
        innovation.noise += rows * self.covariance * rows.transpose();
        let noise = innovation
            .correlated_noise
            .get_or_insert_with(|| Box::new(CorrelatedNoise::default()));
        let half = noise.by_state * x;
        innovation.noise += half + half.transpose();
        noise.by_calibration = *rows;
        *innovation
            .cross
            .get_or_insert_with(|| Box::new(SMatrix::zeros()))
            .as_mut() += x;
    }

    /// H E[δx nᵀ] and its transpose, and the covariance of n, by mounting and clock: what they add to S.
    pub(super) fn added_to_innovation(
        &self,
        jacobian: &SMatrix<f64, MAX_ROWS, DIM>,
        rows: &CalibrationRows,
    ) -> SMatrix<f64, MAX_ROWS, MAX_ROWS> {
        let half = jacobian * self.cross * rows.transpose();
        rows * self.covariance * rows.transpose() + half + half.transpose()
    }

    /// Propagates over an interval of the error state that ends at `end`; the other states beside it decay by factors.
    pub(super) fn propagate(
        &mut self,
        interval: &Interval,
        end: &Kinematics<f64>,
        earth: &EarthTerms,
        bias_decay: f64,
        water_decay: &WaterVector,
    ) {
        interval.carry(&mut self.cross.data.0, end, earth);
        self.depth_bias *= bias_decay;
        for k in 0..WATER {
            self.water.row_mut(k).scale_mut(water_decay[k]);
        }
        self.change.extend(interval.duration_s(), end);
    }

    /// E[z δcᵀ] of an innovation before its update.
    pub(super) fn innovation_cross<const M: usize>(&self, innovation: &Innovation) -> SMatrix<f64, M, CALIBRATION> {
        let mut cross = innovation.jacobian.fixed_rows::<M>(0) * self.cross;
        if let Some(noise) = &innovation.correlated_noise {
            cross += noise.by_state.fixed_rows::<M>(0) * self.cross
                + noise.by_water.fixed_rows::<M>(0) * self.water
                + noise.by_depth_bias.fixed_rows::<M>(0) * self.depth_bias.transpose()
                + noise.by_calibration.fixed_rows::<M>(0) * self.covariance;
        }
        cross
    }

    /// E[δw nᵀ] and E[δb nᵀ] by mounting and clock in an innovation.
    pub(super) fn noise_cross<const M: usize>(
        &self,
        innovation: &Innovation,
    ) -> (SMatrix<f64, WATER, M>, SVector<f64, M>) {
        let Some(noise) = &innovation.correlated_noise else {
            return (SMatrix::zeros(), SVector::zeros());
        };
        let rows = noise.by_calibration.fixed_rows::<M>(0);
        (self.water * rows.transpose(), rows * self.depth_bias)
    }

    /// Updates with an update of the error state, where `x` is E[z δcᵀ] before, and with the gains of the other states beside
    /// it; returns the gain, transposed.
    pub(super) fn update<const M: usize>(
        &mut self,
        update: &Update<'_, M>,
        x: &SMatrix<f64, M, CALIBRATION>,
        water_gain: Option<&SMatrix<f64, WATER, M>>,
        bias_gain: Option<&SVector<f64, M>>,
    ) -> SMatrix<f64, M, CALIBRATION> {
        let gain = if update.corrects_position_alone {
            SMatrix::zeros()
        } else {
            update.factor.solve(x)
        };
        // Joseph's form in S: an error of a gain enters squared.
        let s_gain = update.s * gain;
        self.cross += update.gain * (s_gain - x) - update.cross_covariance * gain;
        let half = gain.transpose() * (s_gain * 0.5 - x);
        self.covariance += half + half.transpose();
        // The gains of the others are optimal, or zero with this one.
        if let Some(water_gain) = water_gain {
            self.water -= water_gain * x;
        }
        if let Some(bias_gain) = bias_gain {
            self.depth_bias -= x.transpose() * bias_gain;
        }
        self.estimate.inject(&(gain.transpose() * update.z));
        gain
    }

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        path.move_rows(&mut self.cross);
    }

    /// The estimates.
    pub(super) fn estimate(&self) -> &Calibration {
        &self.estimate
    }

    /// Covariance of their errors.
    pub(super) fn covariance(&self) -> &CalibrationCovariance {
        &self.covariance
    }

    /// E[δx δcᵀ].
    pub(super) fn cross(&self) -> &SMatrix<f64, DIM, CALIBRATION> {
        &self.cross
    }

    /// E[δb δc].
    pub(super) fn cross_with_depth_bias(&self) -> &CalibrationVector {
        &self.depth_bias
    }

    /// E[δw δcᵀ].
    pub(super) fn cross_with_water(&self) -> &SMatrix<f64, WATER, CALIBRATION> {
        &self.water
    }
}

#[cfg(test)]
#[path = "calibration_tests.rs"]
mod tests;
