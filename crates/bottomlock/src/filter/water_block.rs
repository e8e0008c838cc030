//! The further states of [`crate::aiding::water`] as one more block of the filter: their covariance and that with the error state.

use nalgebra::{Cholesky, Const, SMatrix};

use crate::aiding::water::{HEAVE, WATER, WaterCovariance, WaterPrior, WaterRow, WaterVector, inject};
use crate::error_model::Interval;
use crate::layout::{ATTITUDE, DIM};
use crate::mechanisation::{EarthTerms, Kinematics};

/// Number of epochs that a learned variance looks back on.
const MEMORY_EPOCHS: f64 = 200.0;

/// Estimates of the further states with their covariances.
#[derive(Debug, Clone, PartialEq)]
pub struct WaterBlock {
    prior: WaterPrior,
    estimate: WaterVector,
    /// Variances in the long run; those of s and h are learned.
    variance: WaterVector,
    /// Epochs that the variances of s and h stand for.
    epochs: WaterVector,
    /// Time since the last epoch of each, s.
    since_s: WaterVector,
    /// What the turn made of each at the last epoch, m/s.
    turning_mps: WaterVector,
    own: WaterCovariance,
    /// E[δx δwᵀ].
    cross: SMatrix<f64, DIM, WATER>,
    restarts: u64,
}

impl WaterBlock {
    /// The block at the start, known no better than its prior and independent of the error state.
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
            own: WaterCovariance::from_diagonal(&variance),
            cross: SMatrix::zeros(),
            restarts: 0,
        }
    }

    /// The same prior, with all that was learned forgotten.
    #[must_use]
    pub fn restarted(&self) -> Self {
        Self {
            restarts: self.restarts + 1,
            ..Self::new(&self.prior)
        }
    }

    /// How often the assumptions failed against the measurements and were begun anew.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// The estimate.
    #[must_use]
    pub fn estimate(&self) -> &WaterVector {
        &self.estimate
    }

    /// Variances in the long run: the prior's, and what was learned of s and h.
    #[must_use]
    pub fn variance(&self) -> &WaterVector {
        &self.variance
    }

    /// Its covariance.
    #[must_use]
    pub fn covariance(&self) -> &WaterCovariance {
        &self.own
    }

    /// The block over an interval of the error state, which has come to `end` (before it is emptied).
    pub(crate) fn propagate(&mut self, interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms) {
        interval.carry(&mut self.cross.data.0, end, earth);
        let decay = self.prior.decay(interval.duration_s());
        self.since_s.add_scalar_mut(interval.duration_s());
        for k in 0..WATER {
            let left = decay[k];
            self.estimate[k] *= left;
            self.cross.column_mut(k).scale_mut(left);
            self.own.column_mut(k).scale_mut(left);
            self.own.row_mut(k).scale_mut(left);
            self.own[(k, k)] += (1.0 - left * left) * self.variance[k];
        }
    }

    /// Widens the slip of a row by what the turn leaves in doubt.
    ///
    /// Sway settles to −k ω_z a second or two after the turn: as much as the turn has changed by since the last epoch may not be
    /// there yet. Heave takes part of k ω_y while the vehicle pitches: all of it is in doubt.
    pub(crate) fn begin_epoch(&mut self, row: &WaterRow) {
        let slip = row.slip;
        let doubt_mps = if slip == HEAVE {
            row.turning_mps
        } else {
            row.turning_mps - self.turning_mps[slip]
        };
        self.turning_mps[slip] = row.turning_mps;
        self.own[(slip, slip)] += doubt_mps * doubt_mps;
    }

    /// Learns the variance of a slip from its row's innovation of variance S, squared and normalised.
    ///
    /// Of S the part q is what the slip has gained since the last epoch. A step of Fisher's scoring on the likelihood of q: an
    /// epoch counts for (q/S)², so one where S is far above q says nothing and changes nothing. What the gate rejects counts as
    /// much as what just passes, so that no single outlier decides.
    pub(crate) fn end_epoch(&mut self, row: &WaterRow, s: f64, normalised: Option<f64>) {
        let slip = row.slip;
        let left = self.prior.decay(self.since_s[slip])[slip];
        self.since_s[slip] = 0.0;
        let Some(normalised) = normalised else { return };
        let share = ((1.0 - left * left) * self.variance[slip] / s).min(1.0);
        let memory = self.prior.slip_epochs.max(MEMORY_EPOCHS);
        self.epochs[slip] = (self.epochs[slip] + share * share).min(memory);
        self.variance[slip] *= 1.0 + share * (normalised - 1.0) / self.epochs[slip];
    }

    /// E[δx nᵀ] and the variance of n of a row whose further states count as noise; and E[δw nᵀ].
    pub(crate) fn as_noise(&self, row: &WaterRow) -> (SMatrix<f64, DIM, 1>, f64, WaterVector) {
        let shared = self.own * row.by_water;
        (
            self.cross * row.by_water,
            row.by_water.dot(&shared) + row.variance,
            shared,
        )
    }

    /// Follows an update of the error state and returns the gain; `shared` is E[δw nᵀ].
    pub(crate) fn follow<const M: usize>(
        &mut self,
        update: &Update<'_, M>,
        shared: &SMatrix<f64, WATER, M>,
    ) -> SMatrix<f64, WATER, M> {
        let own_cross = self.cross.transpose() * update.h.transpose() + shared;
        let own_gain = update.factor.solve(&own_cross.transpose()).transpose();
        // Joseph's form in S: an error of a gain enters squared.
        let turned = update.s * own_gain.transpose();
        self.cross += update.gain * (turned - own_cross.transpose()) - update.cross_covariance * own_gain.transpose();
        let half = own_gain * (turned * 0.5 - own_cross.transpose());
        self.own += half + half.transpose();
        let yaw_rad = (update.gain.row(ATTITUDE + 2) * update.z)[0];
        inject(&mut self.estimate, yaw_rad, &(own_gain * update.z));
        own_gain
    }

    /// What is left of each state after `duration_s`.
    pub(crate) fn decay(&self, duration_s: f64) -> WaterVector {
        self.prior.decay(duration_s)
    }

    /// E[δx δwᵀ].
    pub(crate) fn cross(&self) -> &SMatrix<f64, DIM, WATER> {
        &self.cross
    }
}

/// What the error state's own update has worked out.
pub(crate) struct Update<'a, const M: usize> {
    /// Innovation.
    pub(crate) z: &'a SMatrix<f64, M, 1>,
    /// Jacobian.
    pub(crate) h: &'a SMatrix<f64, M, DIM>,
    /// Covariance of the innovation.
    pub(crate) s: &'a SMatrix<f64, M, M>,
    /// The same, factored.
    pub(crate) factor: &'a Cholesky<f64, Const<M>>,
    /// E[δx zᵀ].
    pub(crate) cross_covariance: &'a SMatrix<f64, DIM, M>,
    /// Reach times S⁻¹.
    pub(crate) gain: &'a SMatrix<f64, DIM, M>,
}

#[cfg(test)]
#[path = "water_block_tests.rs"]
mod tests;
