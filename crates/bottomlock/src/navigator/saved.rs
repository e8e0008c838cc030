//! A navigator as bytes: all that it needs to go on as if it had never stopped, bit for bit.

use serde::{Deserialize, Serialize};

use super::event_loop::Navigator;
use super::live::LiveNavigator;
use super::navigator_set::NavigatorSet;
use super::selector::SELECTOR_METHODS;
use crate::aiding::registry::SensorModels;
use crate::error::NavError;
use crate::saved::Kind;

const NAVIGATOR: Kind = Kind {
    mark: *b"BLNAV\r\n\x1a",
    name: "navigator",
};

/// A navigator with the models that its samples are made with.
///
/// A clone in memory costs some microseconds; the bytes outlive the process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Snapshot {
    /// The navigators: filters, measurements that wait, counts of late events, what was seen of the inertial readings.
    pub live: LiveNavigator,
    /// Errors of the sensors.
    pub sensors: SensorModels,
}

impl Snapshot {
    /// The snapshot as bytes.
    ///
    /// # Errors
    /// As `Kind::seal`.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NavError> {
        NAVIGATOR.seal(self)
    }

    /// A snapshot from bytes.
    ///
    /// # Errors
    /// [`NavError::NotRestored`] for bytes that are damaged, cut short, of another format or no navigator, and the error of
    /// a number that no navigator has.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NavError> {
        let snapshot: Self = NAVIGATOR.open(bytes)?;
        snapshot.check()?;
        Ok(snapshot)
    }

    fn check(&self) -> Result<(), NavError> {
        self.sensors.validate()?;
        self.live.check_restored()?;
        match self.live.navigators() {
            NavigatorSet::One(navigator) => navigator.check_restored(),
            NavigatorSet::Consistent(bank) => {
                let members = bank.members.iter().map(Navigator::aiding);
                if !members.eq(SELECTOR_METHODS.map(|(_, aiding)| aiding)) || bank.selected >= bank.members.len() {
                    return Err(NavError::NotRestored {
                        what: NAVIGATOR.name,
                        fault: "its filters are not those of the selector".into(),
                    });
                }
                bank.members.iter().try_for_each(Navigator::check_restored)
            }
        }
    }
}

#[cfg(test)]
#[path = "saved_tests.rs"]
mod tests;
