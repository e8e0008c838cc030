//! Checks of a navigator that was read from bytes.

use super::{BeamAiding, Navigator};
use crate::error::NavError;

impl Navigator {
    /// How it uses the beams.
    pub(crate) fn aiding(&self) -> BeamAiding {
        self.aiding
    }

    /// Checks that a navigator read from bytes is one that can have been saved.
    ///
    /// # Errors
    /// [`NavError`] that names the number, or the filters or measurements that do not fit.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.geometry.validate()?;
        self.options.validate()?;
        self.filters.check_restored()?;
        self.last_imu.map_or(Ok(()), |sample| sample.validate())?;
        self.waiting
            .iter()
            .try_for_each(|event| event.validate(&self.geometry))?;
        let refusal = |fault: &str| {
            Err(NavError::NotRestored {
                what: "navigator",
                fault: fault.into(),
            })
        };
        if (self.aiding == BeamAiding::SwayCurrent) != self.water().is_some() {
            return refusal("its filters are not those of its method");
        }
        let times_ns: Vec<i64> = self.waiting.iter().map(super::Event::time_ns).collect();
        let now_ns = self.filters.measurements_only.time_ns();
        if !times_ns.is_sorted() || times_ns.first().is_some_and(|&time_ns| time_ns < now_ns) {
            return refusal("measurements that wait are older than the filter");
        }
        Ok(())
    }
}
