//! One navigator, or the consistent selector among several.

use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::filter_group::{FilterSpan, predict_together};
use crate::filter::options::Options;
use crate::filter::report::UpdateReport;
use crate::filter::water_block::WaterBlock;
use crate::filter::{BridgeNoise, Eskf};
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::navigator::dual_filter::DualFilter;
use crate::navigator::event_loop::{BeamAiding, Navigator};
use crate::navigator::events::Event;
use crate::navigator::selector::Bank;
use crate::state::{Covariance, NavState};

/// Which navigator, or set of navigators, a method runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Aiding {
    /// One filter.
    One(BeamAiding),
    /// The consistent selector among [`crate::navigator::SELECTOR_METHODS`].
    Consistent,
}

impl Aiding {
    /// Returns true if each row of an update is a beam, in the order of the beams.
    #[must_use]
    pub fn rows_are_beams(self) -> bool {
        matches!(
            self,
            Self::One(BeamAiding::Tight | BeamAiding::SwayCurrent) | Self::Consistent
        )
    }
}

/// A navigator, or several navigators with a selector.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub enum NavigatorSet {
    /// One filter.
    One(Box<Navigator>),
    /// The consistent selector.
    Consistent(Box<Bank>),
}

impl NavigatorSet {
    /// A navigator set at an initial state.
    ///
    /// # Errors
    /// As [`Navigator::new`].
    pub fn new(
        initial: NavState,
        geometry: &BeamGeometry,
        aiding: Aiding,
        model: &Model,
        options: &Options,
    ) -> Result<Self, NavError> {
        Ok(match aiding {
            Aiding::One(one) => Self::One(Box::new(Navigator::new(
                initial,
                geometry.clone(),
                one,
                model,
                options,
            )?)),
            Aiding::Consistent => Self::Consistent(Box::new(Bank::new(initial, geometry, model, options)?)),
        })
    }

    /// Processes an event, as [`Navigator::push`]; with a selector the reports are those of the filter on the beams
    /// alone.
    ///
    /// # Errors
    /// As [`Navigator::push`].
    pub fn push(&mut self, event: &Event, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        match self {
            Self::One(navigator) => navigator.push(event, report),
            Self::Consistent(bank) => bank.push(event, report),
        }
    }

    /// Pushes good readings after the first, which was pushed before, where nothing was or is measured since: the bits of
    /// [`NavigatorSet::push`] one by one.
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

    /// Time of the last inertial reading, or of the start.
    pub(crate) fn good_ns(&self) -> i64 {
        self.first().good_ns()
    }

    /// As [`Navigator::require_measurable`].
    pub(crate) fn require_measurable(&self, event: &Event) -> Result<(), NavError> {
        self.first().require_measurable(event)
    }

    /// As [`Eskf::require_plausible_motion`], of every filter.
    pub(crate) fn require_plausible_motion(&self) -> Result<(), NavError> {
        self.filters_each().try_for_each(Eskf::require_plausible_motion)
    }

    /// As [`Eskf::is_far_from_bounds`], of every filter.
    pub(crate) fn is_far_from_bounds(&self) -> bool {
        self.filters_each().all(Eskf::is_far_from_bounds)
    }

    /// As [`Eskf::require_plausible`], of every filter.
    pub(crate) fn require_plausible(&self) -> Result<(), NavError> {
        self.filters_each().try_for_each(Eskf::require_plausible)
    }

    /// As [`Eskf::require_plausible_settings`], of every filter.
    pub(crate) fn require_plausible_settings(&self) -> Result<(), NavError> {
        self.filters_each().try_for_each(Eskf::require_plausible_settings)
    }

    /// The navigator on the measurements alone.
    fn first(&self) -> &Navigator {
        match self {
            Self::One(navigator) => navigator,
            Self::Consistent(bank) => &bank.members[0],
        }
    }

    fn filters_each(&self) -> impl Iterator<Item = &Eskf> {
        let navigators = match self {
            Self::One(navigator) => std::slice::from_ref(&**navigator),
            Self::Consistent(bank) => &bank.members,
        };
        navigators.iter().flat_map(Navigator::each_filter)
    }

    /// The navigator whose estimate is reported.
    #[must_use]
    pub fn selected(&self) -> &Navigator {
        match self {
            Self::One(navigator) => navigator,
            Self::Consistent(bank) => &bank.members[bank.selected],
        }
    }

    /// The filters of a single navigator; `None` for a selector, which cannot be smoothed.
    pub(crate) fn filters(&mut self) -> Option<&mut DualFilter> {
        match self {
            Self::One(navigator) => Some(navigator.filters()),
            Self::Consistent(_) => None,
        }
    }

    fn navigators_mut(&mut self) -> &mut [Navigator] {
        match self {
            Self::One(navigator) => std::slice::from_mut(navigator),
            Self::Consistent(bank) => &mut bank.members,
        }
    }

    /// All filters.
    pub(crate) fn filters_mut(&mut self) -> impl Iterator<Item = &mut Eskf> {
        self.navigators_mut().iter_mut().flat_map(Navigator::filters_mut)
    }

    /// Leaves each navigator the filter alone whose estimate it reports, so that its innovations are those of that filter.
    pub(crate) fn keep_best(&mut self) {
        let navigators = self.navigators_mut().iter_mut();
        navigators.for_each(|navigator| navigator.filters().keep_best());
    }

    /// Records that every filter was propagated to `last` without [`NavigatorSet::push`].
    pub(crate) fn has_taken(&mut self, last: &ImuSample) {
        self.navigators_mut()
            .iter_mut()
            .for_each(|navigator| navigator.has_taken(last));
    }

    /// The estimate at the time of the last IMU sample.
    #[must_use]
    pub fn state(&self) -> NavState {
        self.selected().state()
    }

    /// Covariance of the estimate at the time of the last IMU sample.
    #[must_use]
    pub fn covariance(&self) -> Covariance {
        self.selected().covariance()
    }

    /// Current and slip through the water, if the selected navigator estimates them.
    #[must_use]
    pub fn water(&self) -> Option<&WaterBlock> {
        self.selected().water()
    }

    /// Replaces the covariance of every filter.
    ///
    /// # Errors
    /// As [`Navigator::set_covariance`].
    pub fn set_covariance(&mut self, covariance: &Covariance) -> Result<(), NavError> {
        match self {
            Self::One(navigator) => navigator.set_covariance(covariance),
            Self::Consistent(bank) => bank
                .members
                .iter_mut()
                .try_for_each(|member| member.set_covariance(covariance)),
        }
    }
}
