//! The water states of [`crate::aiding::water`] as a block of the filter: estimate, covariance, and covariance with the
//! error state.

use nalgebra::{Cholesky, Const, Matrix2, SMatrix, Vector2};

use crate::aiding::CorrectedPath;
use crate::aiding::water::{CURRENT, HEAVE, WATER, WaterCovariance, WaterPrior, WaterRow, WaterVector, inject};
use crate::error::{NavError, require_finite, require_finite_squares};
use crate::error_model::Interval;
use crate::layout::{ATTITUDE, DIM};
use crate::mechanisation::{EarthTerms, Kinematics};
use crate::state::Covariance;

/// Memory of an estimated slip variance, epochs.
const MEMORY_EPOCHS: f64 = 200.0;

/// Estimates of the water states with their covariances.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WaterBlock {
    prior: WaterPrior,
    estimate: WaterVector,
    /// Steady-state variances; those of the slip in sway and heave are estimated.
    variance: WaterVector,
    /// Number of epochs behind the estimated slip variances.
    epochs: WaterVector,
    /// Time since the last epoch of each state, s.
    since_s: WaterVector,
    /// Slip due to the angular rate at the last epoch, m/s.
    turning_mps: WaterVector,
    covariance: WaterCovariance,
    /// E[δx δwᵀ].
    cross: SMatrix<f64, DIM, WATER>,
    restarts: u64,
}

impl WaterBlock {
    /// The block at its prior, independent of the error state.
    #[must_use]
    pub fn new(prior: &WaterPrior) -> Self {
        let variance = prior.variance();
        Self {
            prior: *prior,
            estimate: prior.mean(),
            variance,
            epochs: WaterVector::repeat(prior.slip_epochs),
            since_s: WaterVector::zeros(),
            turning_mps: WaterVector::zeros(),
            covariance: WaterCovariance::from_diagonal(&variance),
            cross: SMatrix::zeros(),
            restarts: 0,
        }
    }

    /// A block at the same prior, without the estimated variances, with one more restart counted.
    #[must_use]
    pub fn restarted(&self) -> Self {
        Self {
            restarts: self.restarts + 1,
            ..Self::new(&self.prior)
        }
    }

    /// Checks a block that was read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.prior.validate()?;
        let vectors = [
            &self.estimate,
            &self.variance,
            &self.epochs,
            &self.since_s,
            &self.turning_mps,
        ];
        vectors
            .into_iter()
            .try_for_each(|vector| require_finite("water states", time_ns, vector.as_slice()))?;
        require_finite_squares("water covariance", time_ns, self.covariance.as_slice())?;
        require_finite_squares("water covariance", time_ns, self.cross.as_slice())
    }

    /// Number of restarts after the measurements contradicted the assumptions.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Estimate of the water states, SI units.
    #[must_use]
    pub fn estimate(&self) -> &WaterVector {
        &self.estimate
    }

    /// Steady-state variances: those of the prior, and the estimated ones of the slip in sway and heave.
    #[must_use]
    pub fn variance(&self) -> &WaterVector {
        &self.variance
    }

    /// Covariance of the water states.
    #[must_use]
    pub fn covariance(&self) -> &WaterCovariance {
        &self.covariance
    }

    /// Covariance of the current, north and east of true north, (m/s)²; `covariance` is that of the error state.
    ///
    /// c − ĉ = ρ_D e_D × ĉ + δc, to first order.
    pub(crate) fn current_covariance(&self, covariance: &Covariance) -> Matrix2<f64> {
        let by_yaw = Vector2::new(-self.estimate[CURRENT + 1], self.estimate[CURRENT]);
        let yaw_cross = by_yaw * self.cross.fixed_view::<1, 2>(ATTITUDE + 2, CURRENT);
        self.covariance.fixed_view::<2, 2>(CURRENT, CURRENT)
            + by_yaw * covariance[(ATTITUDE + 2, ATTITUDE + 2)] * by_yaw.transpose()
            + yaw_cross
            + yaw_cross.transpose()
    }

    /// Propagates the block over an interval of the error state that ends at `end`.
    pub(crate) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms) {
        interval.carry(&mut self.cross.data.0, end, earth);
        let decay = self.prior.decay(interval.duration_s());
        self.since_s.add_scalar_mut(interval.duration_s());
        for k in 0..WATER {
            let left = decay[k];
            self.estimate[k] *= left;
            self.cross.column_mut(k).scale_mut(left);
            self.covariance.column_mut(k).scale_mut(left);
            self.covariance.row_mut(k).scale_mut(left);
            self.covariance[(k, k)] += (1.0 - left * left) * self.variance[k];
        }
    }

    /// Adds the uncertainty due to the angular rate to the variance of a row's slip.
    ///
    /// Sway settles to −k ω_z one or two seconds after a change of yaw rate, so the change since the last epoch is
    /// uncertain. Heave takes only a part of k ω_y while the vehicle pitches, so all of it is uncertain.
    pub(crate) fn begin_epoch(&mut self, row: &WaterRow) {
        let slip = row.slip;
        let uncertainty_mps = if slip == HEAVE {
            row.turning_mps
        } else {
            row.turning_mps - self.turning_mps[slip]
        };
        self.turning_mps[slip] = row.turning_mps;
        self.covariance[(slip, slip)] += uncertainty_mps * uncertainty_mps;
    }

    /// Updates the estimated variance of a slip with the normalised squared innovation of its row, of variance `s`.
    ///
    /// The slip has added q to S since the last epoch. One step of Fisher scoring on the likelihood of q weights an
    /// epoch by (q/S)², so an epoch with S far above q changes nothing. A rejected innovation counts as one at the
    /// threshold, so a single outlier has a bounded effect.
    pub(crate) fn end_epoch(&mut self, row: &WaterRow, s: f64, normalised: Option<f64>) {
        let slip = row.slip;
        let left = self.prior.decay(self.since_s[slip])[slip];
        self.since_s[slip] = 0.0;
        let Some(normalised) = normalised else { return };
        let fraction = ((1.0 - left * left) * self.variance[slip] / s).min(1.0);
        let memory = self.prior.slip_epochs.max(MEMORY_EPOCHS);
        self.epochs[slip] = (self.epochs[slip] + fraction * fraction).min(memory);
        self.variance[slip] *= 1.0 + fraction * (normalised - 1.0) / self.epochs[slip];
    }

    /// The water states of a row as noise n: E[δx nᵀ], the variance of n, and E[δw nᵀ].
    pub(crate) fn as_noise(&self, row: &WaterRow) -> (SMatrix<f64, DIM, 1>, f64, WaterVector) {
        let water_cross = self.covariance * row.by_water;
        (
            self.cross * row.by_water,
            row.by_water.dot(&water_cross) + row.variance,
            water_cross,
        )
    }

    /// Updates the block with an update of the error state, and returns its gain; `water_cross` is E[δw nᵀ].
    pub(crate) fn update<const M: usize>(
        &mut self,
        update: &Update<'_, M>,
        water_cross: &SMatrix<f64, WATER, M>,
    ) -> SMatrix<f64, WATER, M> {
        // X_w = E[δw zᵀ] and the gain K_w.
        let x_w = self.cross.transpose() * update.h.transpose() + water_cross;
        let gain = if update.corrects_position_alone {
            SMatrix::zeros()
        } else {
            update.factor.solve(&x_w.transpose()).transpose()
        };
        // Joseph's form in S: an error of a gain enters squared.
        let s_gain = update.s * gain.transpose();
        self.cross += update.gain * (s_gain - x_w.transpose()) - update.cross_covariance * gain.transpose();
        let half = gain * (s_gain * 0.5 - x_w.transpose());
        self.covariance += half + half.transpose();
        let yaw_rad = (update.gain.row(ATTITUDE + 2) * update.z)[0];
        inject(&mut self.estimate, yaw_rad, &(gain * update.z));
        gain
    }

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(crate) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        path.move_rows(&mut self.cross);
    }

    /// Factor by which each state decays over `duration_s`.
    pub(crate) fn decay(&self, duration_s: f64) -> WaterVector {
        self.prior.decay(duration_s)
    }

    /// E[δx δwᵀ], error state by water states.
    pub(crate) fn cross(&self) -> &SMatrix<f64, DIM, WATER> {
        &self.cross
    }
}

/// Matrices of the error state's update.
pub(crate) struct Update<'a, const M: usize> {
    /// Innovation.
    pub(crate) z: &'a SMatrix<f64, M, 1>,
    /// Jacobian.
    pub(crate) h: &'a SMatrix<f64, M, DIM>,
    /// Innovation covariance.
    pub(crate) s: &'a SMatrix<f64, M, M>,
    /// Cholesky factor of the innovation covariance.
    pub(crate) factor: &'a Cholesky<f64, Const<M>>,
    /// E[δx zᵀ].
    pub(crate) cross_covariance: &'a SMatrix<f64, DIM, M>,
    /// Gain K = E[δx zᵀ] S⁻¹.
    pub(crate) gain: &'a SMatrix<f64, DIM, M>,
    /// True where the measurement corrects no other state than the position.
    pub(crate) corrects_position_alone: bool,
}

#[cfg(test)]
#[path = "water_block_tests.rs"]
mod tests;
