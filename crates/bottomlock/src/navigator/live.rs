//! A navigator that is fed from outside, one event at a time: inertial readings in order, measurements in any order within its
//! horizon.
//!
//! It checks what campaigns need not check, since their readings are simulated: the ranges of the inertial readings and the
//! gaps between them, numbers that no instrument has, and that the estimate stays one. A push that is refused changes
//! nothing: neither the estimate and its covariance, nor the measurements that wait, nor any count but that of late events.
//!
//! Whatever the order in which measurements arrive, it ends in the bits of the log in order of the times of validity (`history.rs`, `late.rs`).

use super::checked::Checked;
use super::history::{History, LONGEST_HORIZON_NS, MOST_WAITING};
use super::imu_check::Judged;
use super::late::Replayed;
use super::notice::Notice;
use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::filter::seconds_between;
use crate::frames::Vec3;
use crate::mechanisation::IMU_FAULTS;
use crate::model::Model;
use crate::navigator::events::{Event, STREAMS};
use crate::navigator::first_readings::FirstReadings;
use crate::navigator::{BeamAiding, Navigator};
use crate::state::{Covariance, NavState};

/// How far a measurement may lie ahead of the navigator, s: longer than any latency that inertial readings are held back for.
const MOST_AHEAD_S: f64 = 3600.0;

/// A navigator set with the checks of a live one, and what it needs to put late events in their places.
#[derive(Debug, Clone)]
pub struct LiveNavigator {
    pub(super) now: Checked,
    pub(super) history: History,
    /// In the order of arrival: units do not depend on what comes late.
    pub(super) first: FirstReadings,
    pub(super) late_events: [u64; STREAMS],
}

impl LiveNavigator {
    /// A live navigator at an initial state, with the horizon within which late events are put in their places, ns; 0 for
    /// events that do not come late.
    ///
    /// # Errors
    /// As [`Navigator::new`]; [`NavError::Implausible`] for a state, noise or environment that is none;
    /// [`NavError::OutOfRange`] for a horizon that is negative or longer than 10 s.
    pub fn new(
        initial: NavState,
        geometry: &BeamGeometry,
        aiding: BeamAiding,
        model: &Model,
        options: &Options,
        horizon_ns: i64,
    ) -> Result<Self, NavError> {
        require_horizon(horizon_ns)?;
        let navigator = Navigator::new(initial, geometry.clone(), aiding, model, options)?;
        navigator.require_plausible_settings()?;
        navigator.require_plausible()?;
        let now = Checked::new(navigator, model, options);
        Ok(Self {
            history: History::new(now.clone(), horizon_ns),
            now,
            first: FirstReadings::default(),
            late_events: [0; STREAMS],
        })
    }

    /// Replaces the covariance of every filter. Events before the estimate's time are then too late, whatever the horizon.
    ///
    /// # Errors
    /// As [`Navigator::set_covariance`]; [`NavError::Implausible`]. The covariance is then as before.
    pub fn set_covariance(&mut self, covariance: &Covariance) -> Result<(), NavError> {
        let mut changed = self.now.clone();
        changed.navigator.set_covariance(covariance)?;
        changed.navigator.require_plausible()?;
        self.history.begin_again(&changed);
        self.now = changed;
        Ok(())
    }

    /// The navigator, for its estimates.
    #[must_use]
    pub fn navigator(&self) -> &Navigator {
        &self.now.navigator
    }

    /// How late an event may be, ns.
    #[must_use]
    pub fn horizon_ns(&self) -> i64 {
        self.history.horizon_ns
    }

    /// How many events of each stream came too late, or second at their time, and were not used, in the order of
    /// [`STREAM_NAMES`](crate::navigator::events::STREAM_NAMES).
    #[must_use]
    pub fn late_events(&self) -> &[u64; STREAMS] {
        &self.late_events
    }

    /// How many inertial readings were rejected and gaps inflated, in the order of [`IMU_FAULTS`].
    #[must_use]
    pub fn imu_faults(&self) -> &[u64; IMU_FAULTS.len()] {
        self.now.check.counts()
    }

    /// Drops the measurements that wait for the next inertial reading, and returns how many.
    pub fn discard_waiting(&mut self) -> usize {
        self.history.discard_waiting(&self.now)
    }

    /// Takes an event; `tell` is called with every update that it completes or changes, and with an inertial reading that is
    /// rejected.
    ///
    /// # Errors
    /// [`NavError`] for bad numbers, for a time beyond the horizon, far ahead, or taken in its stream, for a gap between
    /// inertial readings, and where the numerics fail. Nothing is changed then, apart from the count of late events, and
    /// nothing is reported.
    pub fn push(&mut self, event: &Event, tell: &mut dyn FnMut(&Notice)) -> Result<(), NavError> {
        if let Event::Imu(sample) = event
            && self.first.has_units()
            && self.now.is_plain(sample)
            && !self.history.has_waiting_until(sample.time_ns, self.now.now_ns())
        {
            // Almost every event.
            self.now.navigator.require_plausible_motion()?;
            self.history.keep_if_due(&self.now);
            self.now.take_plain(sample)?;
            self.history.note(sample);
            return Ok(());
        }
        event.validate(self.navigator().geometry())?;
        let stream = event.stream().1;
        if let Err(late) = self.history.admit(event, &self.now) {
            self.late_events[stream] += 1;
            return Err(late);
        }
        self.now.navigator.require_plausible_motion()?;
        let filter = self.navigator().filter();
        let down_p = filter.state().attitude_t_p.inverse() * Vec3::new(0.0, 0.0, 1.0);
        let first = self.first.with(event, filter.gravity_mps2(), Some(&down_p))?;
        if self.waits(event) {
            self.require_room(event)?;
            self.now.navigator.require_measurable(event)?;
            let (_, replaced) = self.history.insert(event);
            self.late_events[stream] += u64::from(replaced.is_some());
        } else if let Event::Imu(sample) = event
            && let judged @ Judged::Rejected(_) = self.now.judge(sample)?
        {
            // Nothing moves, so nothing is tried on a copy.
            let mut found = Vec::new();
            self.now.take(sample, &judged, std::iter::empty(), &mut found)?;
            self.history.insert(event);
            self.history.tell_new(found, tell);
            self.history.forget(&self.now);
        } else {
            let (place, replaced) = self.history.insert(event);
            match self.replay(event, place, replaced.is_some()) {
                Ok(replayed) => {
                    self.now = self.history.settle(replayed, tell);
                    self.late_events[stream] += u64::from(replaced.is_some());
                }
                Err(error) => {
                    self.history.take_back(place, replaced);
                    return Err(error);
                }
            }
        }
        self.first = first;
        Ok(())
    }

    /// Whether an event is a measurement after the last good inertial reading.
    fn waits(&self, event: &Event) -> bool {
        !matches!(event, Event::Imu(_)) && Some(event.time_ns()) > self.now.good_ns()
    }

    /// Replays from now on where an event is the newest that counts, and else from the checkpoint before it.
    fn replay(&self, event: &Event, place: usize, has_replaced: bool) -> Result<Replayed, NavError> {
        let (history, now) = (&self.history, &self.now);
        let good_ns = now.good_ns();
        let is_newest = match event {
            Event::Imu(_) => true,
            _ => Some(event.time_ns()) == good_ns && history.first_after(good_ns) == place + 1,
        };
        if is_newest && !has_replaced {
            let first = place.min(history.first_after(good_ns));
            return history.replay(now, history.checkpoints.len() - 1, first);
        }
        let number = history.checkpoint_before(event);
        let checkpoint = &history.checkpoints[number];
        history.replay(checkpoint, number, history.first_after(checkpoint.good_ns()))
    }

    /// Checks that a measurement may wait.
    fn require_room(&self, event: &Event) -> Result<(), NavError> {
        let (stream, time_ns, now_ns) = (event.stream().0, event.time_ns(), self.now.now_ns());
        let ahead_s = seconds_between(now_ns, time_ns);
        if ahead_s > MOST_AHEAD_S {
            return Err(NavError::TooFarAhead {
                stream,
                time_ns,
                now_ns,
                ahead_s,
                limit_s: MOST_AHEAD_S,
            });
        }
        let waiting = self.history.waiting(&self.now);
        if waiting >= MOST_WAITING {
            return Err(NavError::OutOfRange {
                field: "number of measurements that wait",
                value: waiting as f64,
                expected: "less: push the inertial readings that they wait for, or call discard_waiting()",
            });
        }
        Ok(())
    }
}

/// Checks a horizon.
///
/// # Errors
/// [`NavError::OutOfRange`].
pub(super) fn require_horizon(horizon_ns: i64) -> Result<(), NavError> {
    if (0..=LONGEST_HORIZON_NS).contains(&horizon_ns) {
        return Ok(());
    }
    Err(NavError::OutOfRange {
        field: "horizon_ns",
        value: horizon_ns as f64,
        expected: "0 to 10000000000 ns, ten seconds",
    })
}
