//! The water states of [`crate::aiding::water`] as a block of the filter: estimates, and the estimated variances of the slip.

use crate::aiding::water::{HEAVE, WaterPrior, WaterRow, WaterVector, inject};
use crate::error::{NavError, require_finite};

/// Memory of an estimated slip variance, epochs.
const MEMORY_EPOCHS: f64 = 200.0;

/// Estimates of the water states.
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
    restarts: u64,
}

impl WaterBlock {
    /// The block at its prior.
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
            .try_for_each(|vector| require_finite("water states", time_ns, vector.as_slice()))
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

    /// Propagates the estimates over `duration_s`, of which each keeps the fraction `left`.
    pub(super) fn propagate(&mut self, duration_s: f64, left: &WaterVector) {
        self.since_s.add_scalar_mut(duration_s);
        self.estimate.component_mul_assign(left);
    }

    /// Returns the uncertainty of a row's slip due to the angular rate, (m/s)², which is to be added to its variance.
    ///
    /// Sway settles to −k ω_z one or two seconds after a change of yaw rate, so the change since the last epoch is
    /// uncertain. Heave takes only a part of k ω_y while the vehicle pitches, so all of it is uncertain.
    pub(super) fn begin_epoch(&mut self, row: &WaterRow) -> f64 {
        let slip = row.slip;
        let uncertainty_mps = if slip == HEAVE {
            row.turning_mps
        } else {
            row.turning_mps - self.turning_mps[slip]
        };
        self.turning_mps[slip] = row.turning_mps;
        uncertainty_mps * uncertainty_mps
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

    /// Adds an error to the estimates, with the yaw that is corrected.
    pub(super) fn inject(&mut self, yaw_rad: f64, error: &WaterVector) {
        inject(&mut self.estimate, yaw_rad, error);
    }

    /// Factor by which each state decays over `duration_s`.
    pub(crate) fn decay(&self, duration_s: f64) -> WaterVector {
        self.prior.decay(duration_s)
    }
}

#[cfg(test)]
#[path = "water_block_tests.rs"]
mod tests;
