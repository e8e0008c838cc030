//! Navigators with the check of their inertial readings, fed in the order of time of validity.
//!
//! A clone is a checkpoint: whatever is fed after it gives the bits that it gave before. No measurement waits inside; those
//! ahead of the inertial readings wait in [`super::history::History`].

use serde::{Deserialize, Serialize};

use super::event_loop::Navigator;
use super::imu_check::{ImuCheck, Judged};
use super::notice::Finding;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::navigator::events::Event;

/// Navigators and the check of their inertial readings.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Checked {
    pub(super) navigator: Navigator,
    pub(super) check: ImuCheck,
}

impl Checked {
    pub(super) fn new(navigator: Navigator, model: &Model, options: &Options) -> Self {
        let check = ImuCheck::new(&options.imu_limits, &model.imu);
        Self { navigator, check }
    }

    /// Time of the last good inertial reading, ns; `None` before the first.
    pub(super) fn good_ns(&self) -> Option<i64> {
        self.navigator.last_imu().map(|last| last.time_ns)
    }

    /// Time of the last inertial reading, good or not, ns.
    pub(super) fn seen_ns(&self) -> Option<i64> {
        self.check.last_ns()
    }

    /// Time of the estimate, ns.
    pub(super) fn now_ns(&self) -> i64 {
        self.navigator.good_ns()
    }

    /// Whether everything that it has been fed comes before an event, in the order of a log.
    pub(super) fn is_before(&self, event: &Event) -> bool {
        let time_ns = event.time_ns();
        let fed_ns = match event {
            Event::Imu(_) => self.seen_ns(),
            _ => self.good_ns(),
        };
        fed_ns.map_or(time_ns >= self.now_ns(), |fed_ns| time_ns > fed_ns)
    }

    /// Whether nothing can be wrong with the reading that comes next; what is not plain is judged.
    #[inline]
    pub(super) fn is_plain(&self, sample: &ImuSample) -> bool {
        self.check.is_plain(sample, self.now_ns())
    }

    /// Takes a reading that is plain, when no measurement waits for it. Nothing can fail (`filter/plausible.rs`) where the
    /// motion is plausible.
    ///
    /// # Errors
    /// As [`Navigator::push`].
    #[inline]
    pub(super) fn take_plain(&mut self, sample: &ImuSample) -> Result<(), NavError> {
        self.navigator.push(&Event::Imu(*sample), &mut |_| {})?;
        self.check.note_fault(sample, None);
        Ok(())
    }

    /// Takes a plain reading, and those after it as long as they are plain too and no measurement comes between: until one is
    /// at `until_ns` or later, which is the last. All are predicted at once, with the bits of one by one; `run` is room for
    /// them. Returns how many come after the first.
    ///
    /// Readings go one by one before the first, and near the bounds of an estimate, which are looked at before each.
    ///
    /// # Errors
    /// As [`Checked::take_plain`]. It is then spoilt.
    pub(super) fn take_plain_run<'a>(
        &mut self,
        first: &ImuSample,
        after: impl Iterator<Item = &'a Event>,
        until_ns: i64,
        run: &mut Vec<ImuSample>,
    ) -> Result<usize, NavError> {
        let Some(last) = self
            .navigator
            .last_imu()
            .filter(|_| self.navigator.is_far_from_bounds())
        else {
            return self.take_plain(first).map(|()| 0);
        };
        run.clear();
        run.extend([last, *first]);
        self.check.note_fault(first, None);
        let mut last_ns = first.time_ns;
        for event in after {
            match event {
                Event::Imu(sample) if last_ns < until_ns && self.check.is_plain(sample, last_ns) => {
                    self.check.note_fault(sample, None);
                    last_ns = sample.time_ns;
                    run.push(*sample);
                }
                _ => break,
            }
        }
        self.navigator.push_readings(run)?;
        Ok(run.len() - 2)
    }

    /// Judges the reading that comes next.
    ///
    /// # Errors
    /// As [`ImuCheck::judge`].
    pub(super) fn judge(&self, sample: &ImuSample) -> Result<Judged, NavError> {
        self.check.judge(sample, self.now_ns())
    }

    /// Takes a reading that was judged; a good one with the measurements before it, in the order of a log.
    ///
    /// # Errors
    /// As [`Navigator::push_bridging`]; [`NavError::Implausible`] where it leaves no estimate. It is then spoilt.
    pub(super) fn take<'a>(
        &mut self,
        sample: &ImuSample,
        judged: &Judged,
        measurements: impl Iterator<Item = &'a Event>,
        found: &mut Vec<Finding>,
    ) -> Result<(), NavError> {
        let good_ns = self.now_ns();
        match judged {
            Judged::Rejected(fault) => found.push(Finding::Rejected {
                time_ns: sample.time_ns,
                fault: *fault,
            }),
            Judged::Good(bridge) => {
                for event in measurements {
                    self.aid(event, found)?;
                }
                self.navigator
                    .push_bridging(sample, bridge.as_ref(), &mut |done| found.push(update(done)))?;
                self.navigator.require_plausible()?;
            }
        }
        self.check.note(sample, good_ns, judged);
        Ok(())
    }

    /// Takes a measurement that is not before the last good reading.
    ///
    /// # Errors
    /// As [`Navigator::push`]; [`NavError::Implausible`] where it leaves no estimate. It is then spoilt.
    pub(super) fn aid(&mut self, event: &Event, found: &mut Vec<Finding>) -> Result<(), NavError> {
        self.navigator.require_measurable(event)?;
        self.navigator.push(event, &mut |done| found.push(update(done)))?;
        self.navigator.require_plausible()
    }

    /// Checks one that was read from bytes: its filters apart, which `restored.rs` checks.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self) -> Result<(), NavError> {
        self.check.check_restored()?;
        self.navigator.require_plausible_settings()?;
        self.navigator.require_plausible()
    }
}

fn update(report: &crate::filter::report::UpdateReport) -> Finding {
    Finding::Update(Box::new(*report))
}
