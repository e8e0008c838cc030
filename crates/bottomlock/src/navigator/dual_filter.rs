//! One filter, or two side by side: one on the measurements alone and one that also makes assumptions.
//!
//! An assumption that is wrong makes a filter sure of a wrong velocity, and its gate then locks the beams out. So the filter
//! with assumptions has no gate for measurements: it takes what the filter without them takes, neither more nor less.

use crate::aiding::Innovation;
use crate::aiding::water::{heave_row, sway_row};
use crate::error::NavError;
use crate::filter::Eskf;
use crate::filter::report::{Sensor, UpdateReport};
use crate::filter::tape::Tape;
use crate::filter::water_block::WaterBlock;
use crate::mechanisation::ImuSample;

/// The filters of a navigator.
#[derive(Debug, Clone)]
pub(crate) struct DualFilter {
    /// The filter on the measurements alone.
    pub(crate) measurements_only: Eskf,
    /// The filter with assumptions.
    constrained: Option<Box<Eskf>>,
}

impl DualFilter {
    /// One filter; a second one where there are further states.
    pub(crate) fn new(filter: Eskf, water: Option<WaterBlock>) -> Self {
        let mut filters = Self {
            measurements_only: filter,
            constrained: None,
        };
        water.into_iter().for_each(|water| filters.start_constrained(water));
        filters
    }

    /// Begins the assumptions: the filter with them starts from the one without.
    pub(crate) fn start_constrained(&mut self, water: WaterBlock) {
        self.constrained = Some(Box::new(self.measurements_only.clone().with_water(Some(water))));
    }

    /// Begins the assumptions again from the measurements alone and from the prior.
    fn restart_constrained(&mut self) {
        if let Some(water) = self.best().water().map(WaterBlock::restarted) {
            self.start_constrained(water);
        }
    }

    /// The filter that knows most.
    pub(crate) fn best(&self) -> &Eskf {
        self.constrained.as_deref().unwrap_or(&self.measurements_only)
    }

    /// Every filter.
    pub(crate) fn each_mut(&mut self) -> impl Iterator<Item = &mut Eskf> {
        std::iter::once(&mut self.measurements_only).chain(self.constrained.as_deref_mut())
    }

    pub(crate) fn predict(&mut self, start: &ImuSample, end: &ImuSample) -> Result<(), NavError> {
        self.measurements_only.predict(start, end)?;
        self.constrained
            .as_mut()
            .map_or(Ok(()), |filter| filter.predict(start, end))
    }

    pub(crate) fn note_rate(&mut self, sample: &ImuSample) {
        self.measurements_only.note_rate(sample);
        if let Some(filter) = &mut self.constrained {
            filter.note_rate(sample);
        }
    }

    /// Begins tapes for a smoother.
    pub(crate) fn begin_tape(&mut self) {
        self.measurements_only.begin_tape();
        if let Some(filter) = &mut self.constrained {
            filter.begin_tape();
        }
    }

    /// Marks a sample on the tapes: assumptions that begin anew take over the tape of the filter without them.
    pub(crate) fn record_sample(&mut self) {
        self.measurements_only.record_sample();
        if let Some(filter) = &mut self.constrained {
            filter.record_sample();
        }
    }

    /// Takes the tape of the filter that knows most.
    pub(crate) fn take_tape(&mut self) -> Option<Tape> {
        match &mut self.constrained {
            Some(filter) => filter.take_tape(),
            None => self.measurements_only.take_tape(),
        }
    }

    pub(crate) fn note_interval(&mut self, interval_s: f64) {
        self.measurements_only.note_interval(interval_s);
        if let Some(filter) = &mut self.constrained {
            filter.note_interval(interval_s);
        }
    }

    /// A measurement, with the innovation as each filter sees it; the report is that of the filter on measurements alone.
    pub(crate) fn update(
        &mut self,
        sensor: Sensor,
        innovation_of: impl Fn(&Eskf) -> Innovation,
    ) -> Result<UpdateReport, NavError> {
        let report = self
            .measurements_only
            .update(&innovation_of(&self.measurements_only), sensor)?;
        if report.inflation.is_some() {
            // What was assumed rests on a state that was wrong.
            self.restart_constrained();
        } else if let Some(filter) = &mut self.constrained {
            let innovation = innovation_of(filter);
            filter.follow(&innovation, sensor, report.verdict)?;
        }
        Ok(report)
    }

    /// True where the measurements alone exclude the velocity with assumptions.
    ///
    /// What right assumptions add makes the covariance smaller, so the two velocities differ by less than the covariance of the
    /// measurements alone allows.
    fn assumptions_failed(&self) -> bool {
        self.constrained
            .as_ref()
            .is_some_and(|constrained| self.measurements_only.excludes_velocity_of(constrained))
    }

    /// Sway and heave through the water, each with a gate of its own; their variances are learned at full lock.
    pub(crate) fn assume(&mut self, full_lock: bool, report: &mut impl FnMut(&UpdateReport)) -> Result<(), NavError> {
        if self.assumptions_failed() {
            self.restart_constrained();
        }
        let Some(filter) = &mut self.constrained else {
            return Ok(());
        };
        for sensor in [Sensor::Heave, Sensor::Sway] {
            let Some(water) = filter.water().map(|block| *block.estimate()) else {
                return Ok(());
            };
            let row = filter.with_motion(|motion| match sensor {
                Sensor::Heave => heave_row(motion, &water),
                _ => sway_row(motion, &water),
            });
            report(&filter.assume(&row, sensor, full_lock)?);
        }
        Ok(())
    }
}
