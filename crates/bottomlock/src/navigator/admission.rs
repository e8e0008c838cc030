//! What a navigator checks of an event before it takes it.

use super::Navigator;
use crate::error::NavError;
use crate::navigator::events::Event;
use crate::navigator::measurable::{require_current, require_measurable};

impl Navigator {
    /// Checks the numbers of an event and that its time comes after the filter's and the last one of its stream.
    ///
    /// # Errors
    /// As [`Navigator::push`].
    pub(super) fn admit(&self, event: &Event) -> Result<(), NavError> {
        event.validate(&self.geometry)?;
        require_current(event, &self.filters.measurements_only)?;
        let (time_ns, (stream, index)) = (event.time_ns(), event.stream());
        let now_ns = self.filters.measurements_only.time_ns();
        let repeated_ns = self.last_ns[index].filter(|&previous_ns| time_ns <= previous_ns);
        if let Some(previous_ns) = repeated_ns.or((time_ns < now_ns).then_some(now_ns)) {
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

    /// As [`require_measurable`], for the filter on the measurements alone.
    pub(crate) fn require_measurable(&self, event: &Event) -> Result<(), NavError> {
        require_measurable(event, &self.filters.measurements_only, &self.options.levers)
    }
}
