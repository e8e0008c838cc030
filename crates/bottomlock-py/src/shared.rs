//! What several threads of Python may use.

use std::sync::Mutex;

use bottomlock::{NavError, Stop};

use crate::calls::{detached, interruptible};
use crate::prelude::*;

/// A value whose calls go one after another, each whole.
///
/// The lock is taken and released without the GIL, so that a thread that waits for it keeps no other from running. A panic under
/// the lock leaves the value as broken, and every later call says so.
pub struct Shared<S> {
    inner: Mutex<S>,
    /// What every call says after an internal error.
    broken: &'static str,
}

impl<S: Send> Shared<S> {
    pub fn new(inner: S, broken: &'static str) -> Self {
        Self {
            inner: Mutex::new(inner),
            broken,
        }
    }

    /// A call that takes no time to speak of, as [`detached`].
    pub fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut S) -> Result<T, NavError> + Send,
    ) -> PyResult<T> {
        self.whole(detached(py, || self.locked(work))?)
    }

    /// A call that may take long, as [`interruptible`]; an end that is asked for while it waits changes nothing.
    pub fn with_long<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut S, &Stop) -> Result<T, NavError> + Send,
    ) -> PyResult<T> {
        let work = |stop: &Stop| {
            self.locked(|inner| {
                stop.check()?;
                work(inner, stop)
            })
        };
        self.whole(interruptible(py, None, work)?)
    }

    /// None after a panic.
    fn locked<T>(&self, work: impl FnOnce(&mut S) -> Result<T, NavError>) -> Result<Option<T>, NavError> {
        self.inner.lock().ok().map(|mut inner| work(&mut inner)).transpose()
    }

    fn whole<T>(&self, outcome: Option<T>) -> PyResult<T> {
        outcome.ok_or_else(|| invalid(self.broken))
    }
}
