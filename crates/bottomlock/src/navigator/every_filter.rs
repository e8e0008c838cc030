//! What concerns every filter of a navigator: runs of readings, intervals that are bridged, and bounds of an estimate.

use super::Navigator;
use crate::error::NavError;
use crate::filter::filter_group::{FilterSpan, predict_together};
use crate::filter::report::UpdateReport;
use crate::filter::{BridgeNoise, Eskf};
use crate::mechanisation::ImuSample;
use crate::navigator::events::Event;

impl Navigator {
    /// Pushes good readings after the first, which was pushed before, where nothing was or is measured since: the bits of
    /// [`Navigator::push`] one by one.
    ///
    /// # Errors
    /// As [`Eskf::predict_along`](crate::filter::Eskf::predict_along); the readings are then taken by some filters.
    pub(crate) fn push_readings(&mut self, readings: &[ImuSample]) -> Result<(), NavError> {
        let mut spans: Vec<_> = (self.filters_mut())
            .map(|filter| FilterSpan::new(filter, readings))
            .collect();
        predict_together(&mut spans);
        if let Some((_, error)) = spans.into_iter().find_map(|span| span.failure) {
            return Err(error);
        }
        if let Some(last) = readings.last() {
            self.has_taken(last);
        }
        Ok(())
    }

    /// Pushes an inertial reading after an interval that is bridged, with the noise of that interval; a plain one without.
    ///
    /// # Errors
    /// As [`Navigator::push`].
    pub(crate) fn push_bridging(
        &mut self,
        sample: &ImuSample,
        bridge: Option<&BridgeNoise>,
        report: &mut dyn FnMut(&UpdateReport),
    ) -> Result<(), NavError> {
        let event = Event::Imu(*sample);
        let Some(bridge) = bridge else {
            return self.push(&event, report);
        };
        // Filters that start meanwhile have the noise of the interval too.
        let mut model = None;
        self.filters_mut()
            .for_each(|filter| model = Some(filter.begin_bridge(bridge)));
        let outcome = self.push(&event, report);
        if let Some(model) = model {
            self.filters_mut().for_each(|filter| filter.end_bridge(model));
        }
        outcome
    }

    /// As [`Eskf::require_plausible_motion`], of every filter.
    pub(crate) fn require_plausible_motion(&self) -> Result<(), NavError> {
        self.each_filter().try_for_each(Eskf::require_plausible_motion)
    }

    /// As [`Eskf::is_far_from_bounds`], of every filter.
    pub(crate) fn is_far_from_bounds(&self) -> bool {
        self.each_filter().all(Eskf::is_far_from_bounds)
    }

    /// As [`Eskf::require_plausible`], of every filter.
    pub(crate) fn require_plausible(&self) -> Result<(), NavError> {
        self.each_filter().try_for_each(Eskf::require_plausible)
    }

    /// As [`Eskf::require_plausible_settings`], of every filter.
    pub(crate) fn require_plausible_settings(&self) -> Result<(), NavError> {
        self.each_filter().try_for_each(Eskf::require_plausible_settings)
    }
}
