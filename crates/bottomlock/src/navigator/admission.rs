//! What a navigator checks of an event before it takes it, and what waits in it.

use super::Navigator;
use crate::error::NavError;
use crate::navigator::events::Event;
use crate::navigator::measurable::require_measurable;

impl Navigator {
    /// Checks the numbers of an event and that its time comes after the filter's and the last one of its stream, that at
    /// `seen_ns` included; counts it where it is late.
    ///
    /// # Errors
    /// As [`Navigator::push`].
    pub(crate) fn admit(&mut self, event: &Event, seen_ns: Option<i64>) -> Result<(), NavError> {
        event.validate(&self.geometry)?;
        let (time_ns, (stream, index)) = (event.time_ns(), event.stream());
        let now_ns = self.filters.measurements_only.time_ns();
        let repeated_ns = self.last_ns[index]
            .max(seen_ns)
            .filter(|&previous_ns| time_ns <= previous_ns);
        if let Some(previous_ns) = repeated_ns.or((time_ns < now_ns).then_some(now_ns)) {
            self.late_events[index] += 1;
            return Err(NavError::TimeNotIncreasing {
                stream,
                time_ns,
                previous_ns,
            });
        }
        Ok(())
    }

    /// Time of the last inertial reading, or of the start.
    pub(crate) fn good_ns(&self) -> i64 {
        self.last_imu
            .map_or_else(|| self.filters.measurements_only.time_ns(), |last| last.time_ns)
    }

    /// Whether a measurement is one that waits for the next inertial reading: it is not of the time of the last one.
    pub(crate) fn keeps_waiting(&self, event: &Event) -> bool {
        self.last_imu.is_none_or(|last| last.time_ns != event.time_ns())
    }

    /// Whether a measurement waits for an inertial reading at this time.
    pub(crate) fn has_waiting_until(&self, time_ns: i64) -> bool {
        self.waiting.front().is_some_and(|event| event.time_ns() <= time_ns)
    }

    /// Drops the measurements that wait, and returns how many.
    pub(crate) fn discard_waiting(&mut self) -> usize {
        let count = self.waiting.len();
        self.waiting.clear();
        count
    }

    /// As [`require_measurable`], for the filter on the measurements alone.
    pub(crate) fn require_measurable(&self, event: &Event) -> Result<(), NavError> {
        require_measurable(event, &self.filters.measurements_only, &self.options.levers)
    }
}
