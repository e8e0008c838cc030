//! The water states of [`crate::aiding::water`] as a block of the filter: the slip as assumed and tested.

use super::slip_test::{Alarm, SlipTest};
use crate::aiding::current_layers::{Layers, LayersPrior};
use crate::aiding::further::Process;
use crate::aiding::water::{CURRENT, HEAVE, SWAY, WATER, WaterPrior, WaterRow, WaterVector};
use crate::error::{NavError, require_finite, require_positive};

/// Slip of a vehicle of which nothing is known, m/s and s: that of one that is moved sideways for minutes by thrusters (the preset
/// `hovering`). The first alarm widens at least to it.
const UNKNOWN_MPS: f64 = 0.3;
const UNKNOWN_S: f64 = 60.0;
/// An alarm multiplies the standard deviation and, for a slip that lasts, the time constant.
const LARGER: f64 = 2.0;
const LONGER: f64 = 4.0;
/// Bounds that alarms do not exceed, m/s and s: beyond them an assumption has no weight.
const LARGEST_MPS: f64 = 10.0;
const LONGEST_S: f64 = 3600.0;

/// What is known of the water states beside their estimates.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WaterBlock {
    prior: WaterPrior,
    /// The current by depth, where it is measured.
    layers: Option<Layers>,
    /// Time since the last test, s.
    since_s: f64,
    /// Slip due to the angular rate at the last epoch, m/s.
    turning_mps: WaterVector,
    /// Slip in sway and heave as assumed: at the prior or wider, and the test of both.
    slips: [Slip; 2],
    test: SlipTest,
    restarts: u64,
    alarms: u64,
}

/// Standard deviation, m/s, and time constant, s, of a slip.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
struct Slip {
    sd_mps: f64,
    time_s: f64,
}

impl Slip {
    fn of(prior: &WaterPrior) -> Self {
        Self {
            sd_mps: prior.slip_sd_mps,
            time_s: prior.slip_time_s,
        }
    }

    /// Widens it after an alarm, which shows that the vehicle is not the one assumed.
    fn widen(&mut self, alarm: Alarm) {
        let lasts = matches!(alarm, Alarm::Lasting(window_s) if window_s > self.time_s);
        let longer_s = if lasts { self.time_s * LONGER } else { self.time_s };
        self.sd_mps = self.sd_mps.max((self.sd_mps * LARGER).clamp(UNKNOWN_MPS, LARGEST_MPS));
        self.time_s = self.time_s.max(longer_s.clamp(UNKNOWN_S, LONGEST_S));
    }
}

impl WaterBlock {
    /// The block at its prior.
    #[must_use]
    pub fn new(prior: &WaterPrior) -> Self {
        let slip = Slip::of(prior);
        Self {
            prior: *prior,
            layers: None,
            since_s: 0.0,
            turning_mps: WaterVector::zeros(),
            slips: [slip; 2],
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

    /// A block at the same prior with the slip as it is assumed now, with one more restart counted.
    #[must_use]
    pub fn restarted(&self) -> Self {
        Self {
            slips: self.slips,
            restarts: self.restarts + 1,
            alarms: self.alarms,
            ..Self::new(&self.prior)
        }
    }

    /// [`WaterBlock::restarted`], with a wider slip where there was an alarm, of sway and of heave.
    pub(crate) fn widened(&self, alarms: [Option<Alarm>; 2]) -> Self {
        let mut anew = self.restarted();
        anew.alarms += 1;
        for (slip, alarm) in anew.slips.iter_mut().zip(alarms) {
            alarm.into_iter().for_each(|alarm| slip.widen(alarm));
        }
        anew
    }

    /// The same with the layers of another block.
    pub(super) fn with_layers_of(self, other: &Self) -> Self {
        Self {
            layers: other.layers.clone(),
            ..self
        }
    }

    /// Checks a block that was read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.prior.validate()?;
        require_finite("slip due to the rate", time_ns, self.turning_mps.as_slice())?;
        require_finite("time since the slip was tested", time_ns, &[self.since_s])?;
        self.slips.iter().try_for_each(|slip| {
            require_positive("slip", slip.sd_mps)?;
            require_positive("slip time", slip.time_s)
        })?;
        (self.layers.as_ref()).map_or(Ok(()), Layers::check_restored)?;
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
        self.slips.map(|slip| slip.time_s)
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

    /// Time has passed.
    pub(super) fn wait(&mut self, duration_s: f64) {
        self.since_s += duration_s;
        self.layers.iter_mut().for_each(|layers| layers.wait(duration_s));
    }

    /// The water states: those of the prior, with what the tests show of the slip in sway and heave and of the current.
    #[must_use]
    pub fn processes(&self) -> [Process; WATER] {
        let mut processes = self.prior.processes();
        let layers = self.layers.as_ref().map(Layers::prior);
        let time_s = layers.map_or(self.prior.current_time_s, |prior| prior.mean_time_s);
        let time_s = self.test.current_time_s(time_s);
        for axis in 0..2 {
            processes[CURRENT + axis].time_s = time_s;
            processes[SWAY + axis] = Process::lasting(self.slips[axis].sd_mps, self.slips[axis].time_s);
        }
        processes
    }

    /// Returns the uncertainty of a row's slip due to the angular rate, (m/s)², which is to be added to its variance.
    ///
    /// Sway settles to −k ω_z one or two seconds after a change of yaw rate, so the change since the last epoch is
    /// uncertain. Heave takes only a part of k ω_y while the vehicle pitches, so all of it is uncertain.
    pub(super) fn begin_epoch(&mut self, row: &WaterRow) -> f64 {
        let before_mps = std::mem::replace(&mut self.turning_mps[row.slip], row.turning_mps);
        let settled_mps = if row.slip == HEAVE { 0.0 } else { before_mps };
        (row.turning_mps - settled_mps).powi(2)
    }

    /// Tests the slips by the normalised innovations of the rows of a ping, of sway and of heave.
    pub(crate) fn test(&mut self, normalised: [f64; 2]) -> [Option<Alarm>; 2] {
        let since_s = std::mem::replace(&mut self.since_s, 0.0);
        self.test.take(normalised, since_s)
    }
}

#[cfg(test)]
#[path = "water_block_tests.rs"]
mod tests;
