//! What a live navigator has taken within its horizon: checkpoints, the events after the oldest of them in the order of a
//! log, and what was reported of them.
//!
//! The order of a log is that of the times of validity, and at the same time inertial reading, ping, then the sensors as
//! [`super::events::STREAM_NAMES`] lists them. A stream has one event at a time: of two measurements, the one is used whose bytes
//! come first, so that the order of arrival decides nothing. Inertial readings come in order.

use std::cmp::Ordering;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use super::checked::Checked;
use super::notice::{Finding, FindingKey};
use crate::error::NavError;
use crate::filter::seconds_between;
use crate::mechanisation::ImuSample;
use crate::navigator::events::Event;

/// Longest horizon, ns.
pub(super) const LONGEST_HORIZON_NS: i64 = 10_000_000_000;

/// Time from one checkpoint to the next, ns.
const CHECKPOINT_NS: i64 = 200_000_000;

/// Most events that are kept: ten seconds of 3 kHz. Beyond it the horizon is shorter than was asked for.
const MOST_EVENTS: usize = 1 << 15;
/// Most of them that may wait for an inertial reading.
pub(super) const MOST_WAITING: usize = MOST_EVENTS / 2;

/// Checkpoints, events and findings within the horizon.
#[derive(Debug, Clone)]
pub(super) struct History {
    pub(super) horizon_ns: i64,
    /// Never empty, oldest first. Each has been fed all inertial readings up to the last one that it has seen, and all
    /// measurements up to its last good reading.
    pub(super) checkpoints: VecDeque<Arc<Checked>>,
    /// Time of a good reading from which on the next checkpoint is due, ns.
    due_ns: i64,
    /// Events after the oldest checkpoint, in the order of a log; those that wait are the measurements after the last good
    /// reading.
    pub(super) events: VecDeque<Event>,
    /// What was reported last of each event after the oldest checkpoint.
    pub(super) findings: BTreeMap<FindingKey, Finding>,
}

impl History {
    /// A history that begins with a checkpoint.
    pub(super) fn new(oldest: Checked, horizon_ns: i64) -> Self {
        Self {
            horizon_ns,
            due_ns: due_after(&oldest),
            checkpoints: VecDeque::from([Arc::new(oldest)]),
            events: VecDeque::new(),
            findings: BTreeMap::new(),
        }
    }

    /// Checks that an event can be put in its place; `now` being the navigator after all events.
    ///
    /// # Errors
    /// [`NavError::TooLate`] for one beyond the horizon, [`NavError::TimeNotIncreasing`] for one before the start, for one of a
    /// stream that has another at that time, and for an inertial reading that is not after every other.
    pub(super) fn admit(&self, event: &Event, now: &Checked) -> Result<(), NavError> {
        let (time_ns, now_ns, stream) = (event.time_ns(), now.now_ns(), event.stream().0);
        if let (Event::Imu(_), Some(previous_ns)) = (event, now.seen_ns())
            && time_ns <= previous_ns
        {
            return Err(NavError::TimeNotIncreasing {
                stream,
                time_ns,
                previous_ns,
            });
        }
        let oldest = &self.checkpoints[0];
        let is_within = time_ns >= now_ns.saturating_sub(self.horizon_ns);
        if is_within && oldest.is_before(event) {
            return match self.at(event) {
                (index, true) if bytes(event) >= bytes(&self.events[index]) => Err(NavError::TimeNotIncreasing {
                    stream,
                    time_ns,
                    previous_ns: time_ns,
                }),
                _ => Ok(()),
            };
        }
        if is_within && oldest.good_ns().is_none() {
            return Err(NavError::TimeNotIncreasing {
                stream,
                time_ns,
                previous_ns: oldest.now_ns(),
            });
        }
        let reach_ns = if is_within {
            now_ns - oldest.now_ns()
        } else {
            self.horizon_ns
        };
        Err(NavError::TooLate {
            stream,
            time_ns,
            now_ns,
            behind_s: seconds_between(time_ns, now_ns),
            reach_s: seconds_between(0, reach_ns),
        })
    }

    /// The place of an event, and whether another of its stream and time is there.
    fn at(&self, event: &Event) -> (usize, bool) {
        let index = self.events.partition_point(|other| order(other, event).is_lt());
        let is_taken = self.events.get(index).is_some_and(|other| order(other, event).is_eq());
        (index, is_taken)
    }

    /// Puts an event in its place; returns the place, and the event that was there.
    pub(super) fn insert(&mut self, event: &Event) -> (usize, Option<Event>) {
        match self.at(event) {
            (index, true) => (index, Some(std::mem::replace(&mut self.events[index], *event))),
            (index, false) => {
                self.events.insert(index, *event);
                (index, None)
            }
        }
    }

    /// Undoes [`History::insert`].
    pub(super) fn take_back(&mut self, index: usize, replaced: Option<Event>) {
        match replaced {
            Some(event) => self.events[index] = event,
            None => {
                self.events.remove(index);
            }
        }
    }

    /// Takes note of a reading that is newer than every other and that no measurement waits for.
    #[inline]
    pub(super) fn note(&mut self, sample: &ImuSample) {
        let event = Event::Imu(*sample);
        match self.events.back() {
            Some(last) if last.time_ns() >= sample.time_ns => {
                self.insert(&event);
            }
            _ => self.events.push_back(event),
        }
    }

    /// Place of the first event after a time.
    pub(super) fn first_after(&self, time_ns: Option<i64>) -> usize {
        self.events.partition_point(|event| Some(event.time_ns()) <= time_ns)
    }

    /// Whether a measurement after the last reading, which is at `now_ns` and good, waits for one at a time.
    #[inline]
    pub(super) fn has_waiting_until(&self, time_ns: i64, now_ns: i64) -> bool {
        let newest = self.events.iter().rev();
        let waiting = newest.take_while(|event| event.time_ns() > now_ns);
        waiting.into_iter().any(|event| event.time_ns() <= time_ns)
    }

    /// Number of the measurements that wait.
    pub(super) fn waiting(&self, now: &Checked) -> usize {
        self.waiting_places(now).count()
    }

    /// Begins again with a checkpoint, and the measurements that wait.
    pub(super) fn begin_again(&mut self, now: &Checked) {
        let waiting = self.waiting_places(now).map(|place| self.events[place]).collect();
        *self = Self {
            events: waiting,
            ..Self::new(now.clone(), self.horizon_ns)
        };
    }

    /// Drops the measurements that wait, and returns how many.
    pub(super) fn discard_waiting(&mut self, now: &Checked) -> usize {
        let places: Vec<usize> = self.waiting_places(now).collect();
        for &place in places.iter().rev() {
            self.events.remove(place);
        }
        places.len()
    }

    fn waiting_places(&self, now: &Checked) -> impl Iterator<Item = usize> {
        let first = self.first_after(now.good_ns());
        let after = self.events.range(first..).enumerate();
        after.filter_map(move |(k, event)| (!matches!(event, Event::Imu(_))).then_some(first + k))
    }

    /// Keeps a navigator as a checkpoint where one is due, before it takes a good reading.
    #[inline]
    pub(super) fn keep_if_due(&mut self, now: &Checked) {
        if now.now_ns() >= self.due_ns {
            self.keep(Arc::new(now.clone()));
            self.forget(now);
        }
    }

    /// Keeps a checkpoint.
    pub(super) fn keep(&mut self, checkpoint: Arc<Checked>) {
        self.due_ns = due_after(&checkpoint);
        self.checkpoints.push_back(checkpoint);
    }

    /// Number of the newest checkpoint before an event that [`History::admit`] has found one for.
    pub(super) fn checkpoint_before(&self, event: &Event) -> usize {
        let found = self
            .checkpoints
            .iter()
            .rposition(|checkpoint| checkpoint.is_before(event));
        found.unwrap_or(0)
    }

    /// Drops the checkpoints after one of them.
    pub(super) fn return_to(&mut self, checkpoint: usize) {
        self.checkpoints.truncate(checkpoint + 1);
        self.due_ns = due_after(&self.checkpoints[checkpoint]);
    }

    /// Forgets what no event within the horizon can change, and more where there are too many events.
    pub(super) fn forget(&mut self, now: &Checked) {
        let oldest_ns = now.now_ns().saturating_sub(self.horizon_ns);
        while let Some(next) = self.checkpoints.get(1)
            && next.seen_ns() < Some(oldest_ns)
        {
            self.checkpoints.pop_front();
        }
        self.forget_before_checkpoints();
        while self.events.len() > MOST_EVENTS && self.checkpoints.len() > 1 {
            self.checkpoints.pop_front();
            self.forget_before_checkpoints();
        }
        if self.events.len() > MOST_EVENTS {
            self.begin_again(now);
        }
    }

    fn forget_before_checkpoints(&mut self) {
        let oldest = &self.checkpoints[0];
        let good_ns = oldest.good_ns();
        while self
            .events
            .front()
            .is_some_and(|event| Some(event.time_ns()) <= good_ns)
        {
            self.events.pop_front();
        }
        while let Some(entry) = self.findings.first_entry()
            && Some(entry.key().0) <= good_ns
        {
            entry.remove();
        }
    }
}

/// When the next checkpoint is due: on a grid, so that it does not depend on what arrived when.
pub(super) fn due_after(checkpoint: &Checked) -> i64 {
    (checkpoint.now_ns().div_euclid(CHECKPOINT_NS) + 1) * CHECKPOINT_NS
}

/// The order of a log.
pub(super) fn order(one: &Event, other: &Event) -> Ordering {
    let key = |event: &Event| (event.time_ns(), event.stream().1);
    key(one).cmp(&key(other))
}

/// The bytes that decide between two events of a stream and a time.
fn bytes(event: &Event) -> Vec<u8> {
    postcard::to_stdvec(event).unwrap_or_default()
}

#[cfg(test)]
#[path = "history_tests.rs"]
mod tests;
