//! The water states of [`crate::aiding::water`] as a block of the filter: estimates, and the slip as measured and tested.

use super::slip_model::{MeasuredSlip, SlipModel};
use super::slip_test::{Alarm, SlipTest};
use crate::aiding::current_layers::{CurrentAt, Layers, LayersPrior};
use crate::aiding::water::{CURRENT, GAIN, HEAVE, SWAY, TRIM, WaterPrior, WaterRow, WaterVector, inject};
use crate::error::{NavError, require_finite};

/// A prior that counts for as many pseudo-observations is fixed: no alarm widens it.
const FIXED_EPOCHS: f64 = 1e6;

/// Estimates of the water states.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WaterBlock {
    prior: WaterPrior,
    estimate: WaterVector,
    /// The current by depth, where it is measured.
    layers: Option<Layers>,
    /// Steady-state variances; those of the slip in sway and heave are the models'.
    variance: WaterVector,
    /// Time since the last test, s.
    since_s: f64,
    /// Slip due to the angular rate at the last epoch, m/s.
    turning_mps: WaterVector,
    /// Slip in sway and heave, and the tests of it.
    slips: [SlipModel; 2],
    test: SlipTest,
    restarts: u64,
    alarms: u64,
}

impl WaterBlock {
    /// The block at its prior.
    #[must_use]
    pub fn new(prior: &WaterPrior) -> Self {
        let variance = prior.variance();
        let slip = |slip: usize, third: usize| {
            let constants = [CURRENT, CURRENT + 1, third].map(|k| variance[k]);
            SlipModel::new(variance[slip], prior.slip_time_s, prior.slip_epochs, constants)
        };
        Self {
            prior: *prior,
            estimate: prior.mean(),
            layers: None,
            variance,
            since_s: 0.0,
            turning_mps: WaterVector::zeros(),
            slips: [slip(SWAY, GAIN), slip(HEAVE, TRIM)],
            test: SlipTest::new(),
            restarts: 0,
            alarms: 0,
        }
    }

    /// The same with layers of current, unless their prior has none.
    #[must_use]
    pub fn with_layers(mut self, prior: &LayersPrior) -> Self {
        self.layers = Layers::new(prior);
        self
    }

    /// A block at the same prior with what was measured of the slip, with one more restart counted.
    #[must_use]
    pub fn restarted(&self) -> Self {
        let mut anew = Self {
            slips: self.slips.clone(),
            restarts: self.restarts + 1,
            alarms: self.alarms,
            ..Self::new(&self.prior)
        };
        anew.note_slips();
        anew
    }

    /// [`WaterBlock::restarted`], with a wider slip where there was an alarm, of sway and of heave.
    pub(crate) fn widened(&self, alarms: [Option<Alarm>; 2]) -> Self {
        let mut anew = self.restarted();
        anew.alarms += 1;
        for (slip, alarm) in anew.slips.iter_mut().zip(alarms) {
            alarm.into_iter().for_each(|alarm| slip.widen(alarm));
        }
        anew.note_slips();
        anew
    }

    /// The same current, its layers, gain and trim, with the slips of another block at their prior.
    pub(crate) fn with_slips_of(&self, other: &Self) -> Self {
        let mut block = Self {
            estimate: self.estimate,
            layers: self.layers.clone(),
            ..other.clone()
        };
        (block.estimate[SWAY], block.estimate[HEAVE]) = (0.0, 0.0);
        block
    }

    fn note_slips(&mut self) {
        for (k, slip) in self.slips.iter().enumerate() {
            self.variance[SWAY + k] = slip.variance();
        }
    }

    /// Checks a block that was read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.prior.validate()?;
        let vectors = [&self.estimate, &self.variance, &self.turning_mps];
        vectors
            .into_iter()
            .try_for_each(|vector| require_finite("water states", time_ns, vector.as_slice()))?;
        require_finite("time since the slip was tested", time_ns, &[self.since_s])?;
        self.slips.iter().try_for_each(|slip| slip.check_restored(time_ns))?;
        (self.layers.as_ref()).map_or(Ok(()), |layers| layers.check_restored(time_ns))?;
        self.test.check_restored(time_ns)
    }

    /// Number of restarts after the measurements contradicted the assumptions or the filter on them alone was inflated.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Number of alarms that widened the slip.
    #[must_use]
    pub fn alarms(&self) -> u64 {
        self.alarms
    }

    /// Time constants of the slip in sway and heave, s.
    #[must_use]
    pub fn slip_time_s(&self) -> [f64; 2] {
        [0, 1].map(|k| self.slips[k].time_s())
    }

    /// Estimate of the water states, SI units.
    #[must_use]
    pub fn estimate(&self) -> &WaterVector {
        &self.estimate
    }

    /// The current's layers, where there are any.
    #[must_use]
    pub fn layers(&self) -> Option<&Layers> {
        self.layers.as_ref()
    }

    /// The same, to be moved or measured.
    pub(super) fn layers_mut(&mut self) -> Option<&mut Layers> {
        self.layers.as_mut()
    }

    /// The water states with the current at a depth.
    #[must_use]
    pub fn at(&self, depth_m: f64) -> CurrentAt {
        CurrentAt::new(&self.estimate, self.layers.as_ref(), depth_m)
    }

    /// Takes note that the current at a depth was measured.
    pub(super) fn note(&mut self, depth_m: f64) {
        let at = self.at(depth_m);
        self.layers.iter_mut().for_each(|layers| layers.note(&at));
    }

    /// Steady-state variances: those of the prior, and the estimated ones of the slip in sway and heave.
    #[must_use]
    pub fn variance(&self) -> &WaterVector {
        &self.variance
    }

    /// Propagates the estimates over `duration_s`, of which each keeps the fraction `left`.
    pub(super) fn propagate(&mut self, duration_s: f64, left: &WaterVector) {
        self.since_s += duration_s;
        self.slips.iter_mut().for_each(|slip| slip.wait(duration_s));
        self.estimate.component_mul_assign(left);
    }

    /// Returns the uncertainty of a row's slip due to the angular rate, (m/s)², which is to be added to its variance.
    ///
    /// Sway settles to −k ω_z one or two seconds after a change of yaw rate, so the change since the last epoch is
    /// uncertain. Heave takes only a part of k ω_y while the vehicle pitches, so all of it is uncertain.
    pub(super) fn begin_epoch(&mut self, row: &WaterRow) -> f64 {
        let uncertainty_mps = self.turning_of(row);
        self.turning_mps[row.slip] = row.turning_mps;
        uncertainty_mps * uncertainty_mps
    }

    fn turning_of(&self, row: &WaterRow) -> f64 {
        if row.slip == HEAVE {
            row.turning_mps
        } else {
            row.turning_mps - self.turning_mps[row.slip]
        }
    }

    /// Tests the slips by the normalised innovations of the rows of a ping, of sway and of heave.
    pub(crate) fn test(&mut self, normalised: [f64; 2]) -> [Option<Alarm>; 2] {
        let since_s = std::mem::replace(&mut self.since_s, 0.0);
        if self.prior.slip_epochs >= FIXED_EPOCHS {
            return [None; 2];
        }
        self.test.take(normalised, since_s)
    }

    /// Learns the slip from a row at the measured velocity, whose component has this variance, and at the prior's mean
    /// ([`WaterBlock::prior_mean`]).
    pub(crate) fn learn(&mut self, row: &WaterRow, variance_m2ps2: f64) {
        let third = if row.slip == HEAVE { TRIM } else { GAIN };
        let turning_mps = self.turning_of(row);
        self.slips[row.slip - SWAY].learn(&MeasuredSlip {
            measured_mps: -row.residual,
            by: [CURRENT, CURRENT + 1, third].map(|k| -row.by_water[k]),
            variance: variance_m2ps2 + row.variance + turning_mps * turning_mps,
        });
        self.note_slips();
    }

    /// The water states before anything was measured.
    pub(crate) fn prior_mean(&self) -> WaterVector {
        self.prior.mean()
    }

    /// Adds an error to the estimates, with the yaw that is corrected.
    pub(super) fn inject(&mut self, yaw_rad: f64, error: &WaterVector) {
        inject(&mut self.estimate, yaw_rad, error);
    }

    /// Factor by which each state but those of the layers decays over `duration_s`.
    pub(crate) fn decay(&self, duration_s: f64) -> WaterVector {
        let mut left = self.prior.decay(duration_s);
        let layers = self.layers.as_ref().map(Layers::prior);
        let time_s = layers.map_or(self.prior.current_time_s, |prior| prior.mean_time_s);
        let current = (-duration_s / self.test.current_time_s(time_s)).exp();
        (left[CURRENT], left[CURRENT + 1]) = (current, current);
        for (k, slip) in self.slips.iter().enumerate() {
            left[SWAY + k] = (-duration_s / slip.time_s()).exp();
        }
        left
    }
}

#[cfg(test)]
#[path = "water_block_tests.rs"]
mod tests;
