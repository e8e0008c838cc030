//! Checks of a navigator that was read from bytes.

use super::{BeamAiding, Navigator};
use crate::error::NavError;

impl Navigator {
    /// Checks that a navigator read from bytes is one that can have been saved.
    ///
    /// # Errors
    /// [`NavError`] that names the number, or the filters or measurements that do not fit.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.geometry.validate()?;
        self.options.validate()?;
        self.filters.check_restored()?;
        self.last_imu.map_or(Ok(()), |sample| sample.validate())?;
        let refusal = |fault: &str| {
            Err(NavError::NotRestored {
                what: "navigator",
                fault: fault.into(),
            })
        };
        let has_assumptions = self.filters.constrained_water().is_some();
        let has_current = self.filters.measurements_only.water().is_some();
        if (self.aiding == BeamAiding::SwayCurrent) != has_assumptions || self.options.measures_current() != has_current
        {
            return refusal("its filters are not those of its method");
        }
        if matches!(self.aiding, BeamAiding::Own(own) if !own.is_registered()) {
            return refusal("its method is not a built-in one and not registered here: register it first");
        }
        if !self.waiting.is_empty() {
            return refusal("measurements wait in its filters");
        }
        Ok(())
    }
}
