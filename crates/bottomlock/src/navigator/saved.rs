//! A navigator as bytes: all that it needs to go on as if it had never stopped, bit for bit.

use serde::{Deserialize, Serialize};

use super::checked::Checked;
use super::events::{Event, STREAMS};
use super::first_readings::FirstReadings;
use super::history::{History, order};
use super::live::{LiveNavigator, require_horizon};
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
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// The navigator: its filters, counts of late events, and what it has taken within the horizon.
    pub live: LiveNavigator,
    /// Errors of the sensors.
    pub sensors: SensorModels,
}

/// What is saved: the oldest checkpoint and the events after it, from which all the rest is made again.
#[derive(Serialize, Deserialize)]
struct Saved {
    oldest: Checked,
    events: Vec<Event>,
    horizon_ns: i64,
    first: FirstReadings,
    late_events: [u64; STREAMS],
    sensors: SensorModels,
}

impl Snapshot {
    /// The snapshot as bytes.
    ///
    /// # Errors
    /// As `Kind::seal`.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NavError> {
        let (live, history) = (&self.live, &self.live.history);
        NAVIGATOR.seal(&Saved {
            oldest: Checked::clone(&history.checkpoints[0]),
            events: history.events.iter().copied().collect(),
            horizon_ns: history.horizon_ns,
            first: live.first,
            late_events: live.late_events,
            sensors: self.sensors,
        })
    }

    /// A snapshot from bytes.
    ///
    /// # Errors
    /// [`NavError::NotRestored`] for bytes that are damaged, cut short, of another format or no navigator, and the error of
    /// a number that no navigator has.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NavError> {
        let saved: Saved = NAVIGATOR.open(bytes)?;
        saved.check()?;
        let mut history = History::new(saved.oldest, saved.horizon_ns);
        history.events = saved.events.into();
        let replayed = history.replay(&history.checkpoints[0], 0, 0)?;
        Ok(Self {
            live: LiveNavigator {
                now: history.settle(replayed, &mut |_| {}),
                history,
                first: saved.first,
                late_events: saved.late_events,
            },
            sensors: saved.sensors,
        })
    }
}

impl Saved {
    fn check(&self) -> Result<(), NavError> {
        self.sensors.validate()?;
        self.first.check_restored()?;
        require_horizon(self.horizon_ns)?;
        self.oldest.check_restored()?;
        self.oldest.navigator.check_restored()?;
        let geometry = self.oldest.navigator.geometry();
        self.events.iter().try_for_each(|event| event.validate(geometry))?;
        if !self.events.is_sorted_by(|one, next| order(one, next).is_lt()) {
            return Err(refusal("its events are not in the order of their times"));
        }
        Ok(())
    }
}

fn refusal(fault: &str) -> NavError {
    NavError::NotRestored {
        what: NAVIGATOR.name,
        fault: fault.into(),
    }
}

#[cfg(test)]
#[path = "saved_tests.rs"]
mod tests;
