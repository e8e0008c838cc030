//! A request to end work early, for whoever waits for it.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::NavError;

/// A request to end work early; work that takes long looks at it between blocks of readings.
///
/// Work that is not asked to end has the same results with it as without, bit for bit.
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// No request yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Asks the work to end.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Goes on, unless the end has been requested.
    ///
    /// # Errors
    /// [`NavError::Interrupted`] once it has.
    pub fn check(&self) -> Result<(), NavError> {
        if self.0.load(Ordering::Relaxed) {
            Err(NavError::Interrupted)
        } else {
            Ok(())
        }
    }
}
