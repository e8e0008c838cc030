//! A navigator that is fed from outside, one event at a time.
//!
//! It checks what campaigns need not check, since their readings are simulated: the ranges of the inertial readings and the
//! gaps between them, numbers that no instrument has, and that the estimate stays one. A push that is refused changes
//! nothing: neither the estimate and its covariance, nor the measurements that wait, nor any count but that of late events.

use serde::{Deserialize, Serialize};

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::filter::report::UpdateReport;
use crate::filter::seconds_between;
use crate::mechanisation::{IMU_FAULTS, ImuFault, ImuSample};
use crate::model::Model;
use crate::navigator::events::Event;
use crate::navigator::first_readings::FirstReadings;
use crate::navigator::imu_check::{ImuCheck, Judged};
use crate::navigator::{Aiding, NavigatorSet};
use crate::state::{Covariance, NavState};

/// How far a measurement may lie ahead of the navigator, s: longer than any latency that inertial readings are held back for.
const MOST_AHEAD_S: f64 = 3600.0;

/// A navigator set with the checks of a live one.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LiveNavigator {
    navigators: NavigatorSet,
    check: ImuCheck,
    first: FirstReadings,
}

impl LiveNavigator {
    /// A live navigator at an initial state.
    ///
    /// # Errors
    /// As [`NavigatorSet::new`]; [`NavError::Implausible`] for a state, noise or environment that is none.
    pub fn new(
        initial: NavState,
        geometry: &BeamGeometry,
        aiding: Aiding,
        model: &Model,
        options: &Options,
    ) -> Result<Self, NavError> {
        let navigators = NavigatorSet::new(initial, geometry, aiding, model, options)?;
        navigators.require_plausible_settings()?;
        navigators.require_plausible()?;
        Ok(Self {
            navigators,
            check: ImuCheck::new(&options.imu_limits, &model.imu),
            first: FirstReadings::default(),
        })
    }

    /// Replaces the covariance of every filter.
    ///
    /// # Errors
    /// As [`NavigatorSet::set_covariance`]; [`NavError::Implausible`]. The covariance is then as before.
    pub fn set_covariance(&mut self, covariance: &Covariance) -> Result<(), NavError> {
        self.attempt(|navigators, _| navigators.set_covariance(covariance), &mut |_| {})
    }

    /// The navigators, for their estimates.
    #[must_use]
    pub fn navigators(&self) -> &NavigatorSet {
        &self.navigators
    }

    /// Checks that a navigator read from bytes is one that a live one can be: its filters apart, which `restored.rs` checks.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.check.check_restored()?;
        self.first.check_restored()?;
        self.navigators.require_plausible_settings()?;
        self.navigators.require_plausible()
    }

    /// How many inertial readings were rejected and gaps inflated, in the order of [`IMU_FAULTS`].
    #[must_use]
    pub fn imu_faults(&self) -> &[u64; IMU_FAULTS.len()] {
        self.check.counts()
    }

    /// Drops the measurements that wait for the next inertial reading, and returns how many.
    pub fn discard_waiting(&mut self) -> usize {
        self.navigators.discard_waiting()
    }

    /// Takes an event; `report` is called with every measurement that it completes. Returns why an inertial reading was
    /// rejected.
    ///
    /// # Errors
    /// [`NavError`] for bad numbers, for time that does not increase within a stream, lies before the filter's time or far
    /// ahead of it, for a gap between inertial readings, and where the numerics fail. Nothing is changed then, apart from the
    /// count of late events, and nothing is reported.
    pub fn push(
        &mut self,
        event: &Event,
        report: &mut impl FnMut(&UpdateReport),
    ) -> Result<Option<ImuFault>, NavError> {
        if let Event::Imu(sample) = event
            && self.first.has_units()
            && self.check.is_plain(sample, self.navigators.good_ns())
            && !self.navigators.has_waiting_until(sample.time_ns)
        {
            // Almost every event. Nothing can fail (`filter/plausible.rs`).
            self.navigators.require_plausible_motion()?;
            self.navigators.push(event, report)?;
            self.check.note_fault(sample, None);
            return Ok(None);
        }
        let seen_ns = if matches!(event, Event::Imu(_)) {
            self.check.last_ns()
        } else {
            None
        };
        self.navigators.admit(event, seen_ns)?;
        self.navigators.require_plausible_motion()?;
        let first = self.first.with(event)?;
        let fault = match event {
            Event::Imu(sample) => self.push_imu(sample, report)?,
            _ => self.push_measurement(event, report).map(|()| None)?,
        };
        self.first = first;
        Ok(fault)
    }

    fn push_imu(
        &mut self,
        sample: &ImuSample,
        report: &mut impl FnMut(&UpdateReport),
    ) -> Result<Option<ImuFault>, NavError> {
        let good_ns = self.navigators.good_ns();
        let judged = self.check.judge(sample, good_ns)?;
        let fault = match judged {
            Judged::Rejected(fault) => Some(fault),
            Judged::Good(bridge) => {
                self.attempt(
                    |navigators, report| navigators.push_bridging(sample, bridge.as_ref(), &mut |done| report(done)),
                    report,
                )?;
                None
            }
        };
        self.check.note(sample, good_ns, &judged);
        Ok(fault)
    }

    fn push_measurement(&mut self, event: &Event, report: &mut impl FnMut(&UpdateReport)) -> Result<(), NavError> {
        let (now_ns, time_ns) = (self.navigators.good_ns(), event.time_ns());
        let ahead_s = seconds_between(now_ns, time_ns);
        if ahead_s > MOST_AHEAD_S {
            let (stream, limit_s) = (event.stream().0, MOST_AHEAD_S);
            return Err(NavError::TooFarAhead {
                stream,
                time_ns,
                now_ns,
                ahead_s,
                limit_s,
            });
        }
        self.navigators.require_measurable(event)?;
        if self.navigators.keeps_waiting(event) {
            // No estimate changes.
            return self.navigators.push(event, report);
        }
        self.attempt(
            |navigators, report| navigators.push(event, &mut |done| report(done)),
            report,
        )
    }

    /// Does something with the navigators; where it fails, or leaves no estimate, they are as before, and nothing is
    /// reported.
    fn attempt(
        &mut self,
        change: impl FnOnce(&mut NavigatorSet, &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError>,
        report: &mut impl FnMut(&UpdateReport),
    ) -> Result<(), NavError> {
        let before = self.navigators.clone();
        let mut reports = Vec::new();
        let outcome = change(&mut self.navigators, &mut |done| reports.push(*done))
            .and_then(|()| self.navigators.require_plausible());
        match outcome {
            Ok(()) => reports.iter().for_each(report),
            Err(_) => self.navigators = before,
        }
        outcome
    }
}
