//! One filter on the measurements, optionally with a second filter that also assumes constraints on the motion.
//!
//! A wrong assumption makes a filter overconfident in a wrong velocity, and its gate would then reject correct beams.
//! The constrained filter therefore has no gate for measurements: it applies exactly the rows that the filter on the
//! measurements alone accepted. Where these contradict it several times in a row, it starts again from the other one.

use crate::aiding::sensor::Quantity;
use crate::aiding::water::{SWAY, WaterRow, WaterVector, heave_row, sway_row};
use crate::aiding::{Innovation, Motion};
use crate::error::NavError;
use crate::filter::Eskf;
use crate::filter::charge::Charge;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::filter::slip_test::Alarm;
use crate::filter::tape::Tape;
use crate::filter::thrust::SpeedStates;
use crate::filter::water_block::WaterBlock;
use crate::mechanisation::ImuSample;

/// An assumption as a row, by the motion and the water states.
type RowOf = fn(&Motion<'_>, &WaterVector) -> WaterRow;
/// The assumptions in the order in which they are applied.
const ROWS: [(Sensor, RowOf); 2] = [(Sensor::Heave, heave_row), (Sensor::Sway, sway_row)];
/// Measurements contradict the assumptions, whichever it is.
const BOTH_LARGER: [Option<Alarm>; 2] = [Some(Alarm::Larger); 2];

/// The one or two filters of a navigator.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct DualFilter {
    /// The filter on the measurements alone.
    pub(crate) measurements_only: Eskf,
    /// The filter with assumptions on the motion through the water.
    constrained: Option<Box<Eskf>>,
    /// Consecutive measurements of each sensor that the constrained filter finds implausible and the other one does not.
    implausible: [u32; Sensor::COUNT],
}

impl DualFilter {
    /// One filter, and a constrained one where `water` is given.
    pub(crate) fn new(filter: Eskf, water: Option<WaterBlock>) -> Self {
        let mut filters = Self {
            measurements_only: filter,
            constrained: None,
            implausible: [0; Sensor::COUNT],
        };
        water.into_iter().for_each(|water| filters.start_constrained(water));
        filters
    }

    /// Starts the constrained filter from the estimate on the measurements alone, and from what these tell of the current, where
    /// they do.
    pub(crate) fn start_constrained(&mut self, water: WaterBlock) {
        let mut filter = Box::new(self.measurements_only.clone());
        if filter.water().is_some() {
            filter.set_slips(water);
        } else {
            filter.set_water(Some(water));
        }
        self.constrained = Some(filter);
        self.implausible = [0; Sensor::COUNT];
    }

    /// Restarts the constrained filter from the estimate on the measurements alone and from the prior of the water
    /// states.
    fn restart_constrained(&mut self) {
        if let Some(water) = self.constrained_water().map(WaterBlock::restarted) {
            self.start_constrained(water);
        }
    }

    /// Restarts the constrained filter with a wider slip where there was an alarm, of sway and of heave.
    fn widen_slip(&mut self, alarms: [Option<Alarm>; 2]) {
        if let Some(water) = self.constrained_water().map(|water| water.widened(alarms)) {
            self.start_constrained(water);
        }
    }

    /// The water states of the constrained filter, where it exists.
    pub(crate) fn constrained_water(&self) -> Option<&WaterBlock> {
        self.constrained.as_ref()?.water()
    }

    /// The filter whose estimate is reported: the constrained one where it exists.
    pub(crate) fn best(&self) -> &Eskf {
        self.constrained.as_deref().unwrap_or(&self.measurements_only)
    }

    /// Leaves that filter alone, to predict with.
    pub(crate) fn keep_best(&mut self) {
        if let Some(filter) = self.constrained.take() {
            self.measurements_only = *filter;
        }
    }

    /// All filters.
    pub(crate) fn each(&self) -> impl Iterator<Item = &Eskf> {
        std::iter::once(&self.measurements_only).chain(self.constrained.as_deref())
    }

    /// All filters.
    pub(crate) fn each_mut(&mut self) -> impl Iterator<Item = &mut Eskf> {
        std::iter::once(&mut self.measurements_only).chain(self.constrained.as_deref_mut())
    }

    /// Checks filters that were read from bytes.
    ///
    /// # Errors
    /// As [`Eskf::check_restored`].
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.each().try_for_each(Eskf::check_restored)
    }

    /// Propagates every filter over one IMU interval; as [`Eskf::predict`].
    pub(crate) fn predict(&mut self, start: &ImuSample, end: &ImuSample) -> Result<(), NavError> {
        self.measurements_only.predict(start, end)?;
        self.constrained
            .as_mut()
            .map_or(Ok(()), |filter| filter.predict(start, end))
    }

    /// Sets the angular rate of every filter before the first step; as [`Eskf::note_rate`].
    pub(crate) fn note_rate(&mut self, sample: &ImuSample) {
        self.measurements_only.note_rate(sample);
        if let Some(filter) = &mut self.constrained {
            filter.note_rate(sample);
        }
    }

    /// Starts the tape of every filter for a smoother.
    pub(crate) fn begin_tape(&mut self) {
        self.measurements_only.begin_tape();
        if let Some(filter) = &mut self.constrained {
            filter.begin_tape();
        }
    }

    /// Records a sample on every tape; a restarted constrained filter continues the tape of the filter it started from.
    pub(crate) fn record_sample(&mut self) {
        self.measurements_only.record_sample();
        if let Some(filter) = &mut self.constrained {
            filter.record_sample();
        }
    }

    /// Takes the tape of the filter whose estimate is reported.
    pub(crate) fn take_tape(&mut self) -> Option<Tape> {
        match &mut self.constrained {
            Some(filter) => filter.take_tape(),
            None => self.measurements_only.take_tape(),
        }
    }

    /// Sets the time between two IMU samples of every filter; as [`Eskf::note_interval`].
    pub(crate) fn note_interval(&mut self, interval_s: f64) {
        self.measurements_only.note_interval(interval_s);
        if let Some(filter) = &mut self.constrained {
            filter.note_interval(interval_s);
        }
    }

    /// Updates every filter with a measurement, each with its own innovation.
    ///
    /// The report is that of the filter on the measurements alone.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub(crate) fn update(
        &mut self,
        sensor: Sensor,
        innovation_of: &dyn Fn(&Eskf) -> Innovation,
    ) -> Result<UpdateReport, NavError> {
        let report = self
            .measurements_only
            .update(&innovation_of(&self.measurements_only), sensor)?;
        if let Some(filter) = &mut self.constrained {
            let innovation = innovation_of(filter);
            let is_plausible = filter.update_with_verdict(&innovation, sensor, report.verdict)?;
            // A wrong scale says nothing of sway and heave.
            let is_plausible = is_plausible || SpeedStates::of(sensor).is_some();
            let count = &mut self.implausible[sensor as usize];
            *count = if is_plausible { 0 } else { *count + 1 };
            if *count > 0 && *count == filter.rejections_allowed() {
                self.widen_slip(BOTH_LARGER);
            }
        }
        Ok(report)
    }

    /// [`DualFilter::update`], once more where the rejection completes a run that makes states uncertain.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub(crate) fn update_or_inflate(
        &mut self,
        sensor: Sensor,
        innovation_of: &dyn Fn(&Eskf) -> Innovation,
    ) -> Result<UpdateReport, NavError> {
        if matches!(sensor.quantity(), Some(Quantity::Velocity | Quantity::Position)) {
            self.each_mut().for_each(Eskf::widen_heave);
        }
        let mut report = self.update(sensor, innovation_of)?;
        if report.verdict != Verdict::Rejected {
            self.measurements_only.note_accepted(sensor);
            if sensor == Sensor::Velocity
                && let Some(charge) = self.charge_lasting()
            {
                charge.note_in(&mut report);
            }
            return Ok(report);
        }
        let rejected = innovation_of(&self.measurements_only);
        let is_confirmed = sensor == Sensor::Velocity && self.measurements_only.has_velocity();
        let Some(charge) = self.note_rejected(&rejected, sensor, is_confirmed)? else {
            return Ok(report);
        };
        let mut report = self.update(sensor, innovation_of)?;
        charge.note_in(&mut report);
        Ok(report)
    }

    /// Charges every filter with an error that lasts, as [`Eskf::charge_lasting`].
    pub(crate) fn charge_lasting(&mut self) -> Option<Charge> {
        let charge = self.measurements_only.charge_lasting()?;
        if let Some(filter) = &mut self.constrained {
            filter.charge(&charge);
        }
        Some(charge)
    }

    /// Begins the test for an error that lasts anew, after innovations that a method's assumption is part of.
    pub(crate) fn forget_lasting(&mut self) {
        self.measurements_only.forget_lasting();
    }

    /// Counts a rejection by the filter on the measurements alone, as [`Eskf::note_rejected`]; returns what has become uncertain where
    /// the reading is to be tested again.
    ///
    /// Where all inertial states have become uncertain the constrained filter starts again: its covariance was too small as well.
    pub(crate) fn note_rejected(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
        is_confirmed: bool,
    ) -> Result<Option<Charge>, NavError> {
        let noted = self.measurements_only.note_rejected(innovation, sensor, is_confirmed)?;
        let Some(charge) = noted else { return Ok(None) };
        if charge.is_of_all {
            self.restart_constrained();
        } else if let Some(filter) = &mut self.constrained {
            filter.charge(&charge);
        }
        Ok(charge.factor.is_some().then_some(charge))
    }

    /// Returns true if the filter on the measurements alone excludes the velocity of the constrained one.
    ///
    /// Correct assumptions only reduce the covariance, so the two velocities then differ by no more than the covariance
    /// of the filter on the measurements alone allows.
    fn assumptions_failed(&self) -> bool {
        self.constrained
            .as_ref()
            .is_some_and(|constrained| self.measurements_only.excludes_velocity_of(constrained))
    }

    /// Applies the assumptions on sway and heave through the water to the constrained filter, each with its own gate.
    ///
    /// An alarm of the slip's test restarts the constrained filter from the other one, with a wider slip.
    ///
    /// # Errors
    /// As [`Eskf::assume`].
    pub(crate) fn assume(&mut self, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        if self.assumptions_failed() {
            self.widen_slip(BOTH_LARGER);
        }
        let Some(filter) = &mut self.constrained else {
            return Ok(());
        };
        filter.prepare_for_water(None);
        let mut outcomes = [None; 2];
        for (sensor, row_of) in ROWS {
            let Some(water) = filter.current_at_vehicle().map(|at| at.water) else {
                return Ok(());
            };
            let row = filter.with_motion(|motion| row_of(motion, &water));
            let outcome = filter.assume(&row, sensor)?;
            report(&outcome);
            outcomes[row.slip - SWAY] = Some(outcome);
        }
        let [Some(sway), Some(heave)] = outcomes else {
            return Ok(());
        };
        let alarms = filter.test_slips(&[sway, heave]);
        if alarms.iter().any(Option::is_some) {
            self.widen_slip(alarms);
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "dual_filter_tests.rs"]
mod tests;
