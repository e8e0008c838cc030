//! The lock of a navigator, and its whole state.

use std::sync::Mutex;

use bottomlock::navigator::{LiveNavigator, Snapshot};
use pyo3::prelude::*;

use super::Navigator;
use crate::calls::detached;
use crate::errors::invalid;

impl Navigator {
    pub(super) fn of(snapshot: Snapshot) -> Self {
        Self {
            beams: snapshot.live.navigators().selected().geometry().beams(),
            inner: Mutex::new(snapshot.live),
            sensors: snapshot.sensors,
        }
    }

    /// Calls the navigators, when no other thread does.
    ///
    /// The lock is taken and released without the GIL, so that a thread that waits for it keeps no other from running.
    pub(super) fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut LiveNavigator) -> T + Send,
    ) -> PyResult<T> {
        detached(py, || Ok(self.inner.lock().map(|mut inner| work(&mut inner)).ok()))?.ok_or_else(|| {
            invalid("this navigator has met an internal error before: start a new one, or load a saved one")
        })
    }

    pub(super) fn snapshot(&self, py: Python<'_>) -> PyResult<Snapshot> {
        Ok(Snapshot {
            live: self.with(py, |inner| inner.clone())?,
            sensors: self.sensors,
        })
    }
}
