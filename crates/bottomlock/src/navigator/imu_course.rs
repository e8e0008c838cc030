//! How good inertial readings go on from one to the next, and what is doubted where they go on otherwise.
//!
//! In a gap that is not refused, of T in place of the usual step s, readings change by what they usually do, u a step: one that goes on
//! for half of the gap and comes back has the area u T²/(4 s), which is taken for two sigma.
//!
//! What moves a vehicle moves it about several axes. An axis that departs alone, faster than a vehicle moves by itself, is taken for a
//! sensor that fails, though it may be a blow. Nobody knows which until the next measurements: as long as the departure lasts, and half a
//! second at most, the interval is uncertain by all of it.

use serde::{Deserialize, Serialize};

use crate::error::{NavError, require_non_negative};
use crate::filter::{BridgeNoise, seconds_between};
use crate::mechanisation::{ImuLimits, ImuSample};

/// Axes of the angular rate, then of the specific force.
pub(super) const AXES: usize = 6;

/// Change of the angular rate, rad/s², and of the specific force, m/s³, that no vehicle exceeds.
const FASTEST_CHANGE: [f64; 2] = [50.0, 300.0];
/// The same over the usual change between readings: vibration is no jump.
const USUAL: f64 = 15.0;
/// Change of the angular rate, rad/s², and of the specific force, m/s³, that vehicles make by themselves, and the same over the
/// usual change. Beyond both an axis departs, and alone where no other one changes by more than `BESIDE` times the usual change. Set on
/// ten recordings of IMUs (59 minutes): of 57 departures 12 are alone, five of these within 32 s. No other recordings were at hand.
const OWN_CHANGE: [f64; 2] = [1.0, 5.0];
const OWN_USUAL: f64 = 10.0;
const BESIDE: f64 = 3.0;
/// Longest time for which a departure is doubted, s: two pings of a slow DVL.
const LONGEST_DOUBT_S: f64 = 0.5;
/// Usual steps from which on readings are missing.
const MISSING: f64 = 2.5;
/// Weight of a reading in what is usual.
pub(super) const MEMORY: f64 = 0.01;

/// Good readings: the last one, what is usual, and what is doubted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Course {
    pub(super) good: Option<ImuSample>,
    /// `None` before the second.
    pub(super) usual: Option<Usual>,
    doubt: Option<Doubt>,
}

/// What good readings usually do from one to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Usual {
    pub(super) step_s: f64,
    /// Of the angular rate and the specific force, on the axis that changes most.
    pub(super) change: [f64; 2],
}

/// A departure of one axis that a measurement has not confirmed yet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Doubt {
    /// The last reading before it.
    before: ImuSample,
    /// Of three axes of the angular rate and three of the specific force.
    axis: u8,
    size: f64,
}

impl Course {
    /// Checks the numbers of one read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self) -> Result<(), NavError> {
        let before = self.doubt.map(|doubt| doubt.before);
        let mut readings = [self.good, before].into_iter().flatten();
        readings.try_for_each(|reading| reading.validate())?;
        if let Some(Doubt { axis, size, .. }) = self.doubt {
            require_non_negative("doubted change of inertial readings", size)?;
            if usize::from(axis) >= AXES {
                return Err(NavError::OutOfRange {
                    field: "axis of inertial readings that is doubted",
                    value: f64::from(axis),
                    expected: "at most 5",
                });
            }
        }
        let mut usual = self
            .usual
            .into_iter()
            .flat_map(|usual| [usual.step_s, usual.change[0], usual.change[1]]);
        usual.try_for_each(|change| require_non_negative("usual change of inertial readings", change))
    }

    /// Whether a reading follows the last good one as they usually do, and nothing is doubted.
    #[inline]
    pub(super) fn is_usual(&self, sample: &ImuSample) -> bool {
        let (Some(good), Some(usual)) = (&self.good, &self.usual) else {
            return true;
        };
        let step_s = seconds_between(good.time_ns, sample.time_ns);
        let (change, limit) = (change(sample, good), usual.own_change(step_s));
        self.doubt.is_none() && step_s <= MISSING * usual.step_s && change[0] <= limit[0] && change[1] <= limit[1]
    }

    /// The noise of the interval from the last good reading in which others are missing.
    pub(super) fn missing(&self, sample: &ImuSample, limits: &ImuLimits) -> Option<BridgeNoise> {
        let (good, usual) = (self.good.as_ref()?, self.usual.as_ref()?);
        let gap_s = seconds_between(good.time_ns, sample.time_ns);
        if gap_s <= MISSING * usual.step_s {
            return None;
        }
        let unseen = [limits.gap_rate_sd_radps, limits.gap_accel_sd_mps2];
        let sd = [0, 1].map(|k| unseen[k].min(usual.change[k] * gap_s / (8.0 * usual.step_s)));
        Some(BridgeNoise::of_constant(sd, gap_s))
    }

    /// The noise of the interval from the last good reading where a departure is doubted: together with that of the intervals since it
    /// began as much as a constant error.
    pub(super) fn doubted(&self, sample: &ImuSample) -> Option<BridgeNoise> {
        let (doubt, good) = (self.doubt_at(sample)?, self.good.as_ref()?);
        let step_s = seconds_between(good.time_ns, sample.time_ns);
        let since_s = seconds_between(doubt.before.time_ns, good.time_ns);
        let mut sd = [0.0; 2];
        sd[usize::from(doubt.axis) / 3] = doubt.size * ((2.0 * since_s + step_s) / step_s).sqrt();
        Some(BridgeNoise::of_constant(sd, step_s))
    }

    /// What is doubted over the interval that ends with a reading.
    fn doubt_at(&self, sample: &ImuSample) -> Option<Doubt> {
        let (good, usual) = (self.good.as_ref()?, self.usual.as_ref()?);
        let changes = changes(sample, good);
        let limit = usual.own_change(seconds_between(good.time_ns, sample.time_ns));
        let place = (0..AXES).find(|&axis| changes[axis] > limit[axis / 3]);
        let is_beside = |other: usize| Some(other) != place && changes[other] > BESIDE * usual.change[other / 3];
        let alone = place.filter(|_| !(0..AXES).any(is_beside));
        let Some((place, axis)) = alone.and_then(|place| Some((place, u8::try_from(place).ok()?))) else {
            return self.doubt;
        };
        let mut doubt = self.doubt.unwrap_or(Doubt {
            before: *good,
            axis,
            size: 0.0,
        });
        if doubt.axis == axis {
            doubt.size = doubt.size.max(changes[place]);
        }
        Some(doubt)
    }

    /// What is still doubted after a good reading: not what is as it was before, nor what has lasted.
    fn doubt_after(&self, sample: &ImuSample) -> Option<Doubt> {
        let doubt = self.doubt_at(sample)?;
        let is_back = changes(sample, &doubt.before)[usize::from(doubt.axis)] <= doubt.size / 2.0;
        let lasts_s = seconds_between(doubt.before.time_ns, sample.time_ns);
        (!is_back && lasts_s < LONGEST_DOUBT_S).then_some(doubt)
    }

    /// Takes note of a good reading, and of how it has changed, as far as a vehicle changes.
    #[inline]
    pub(super) fn note(&mut self, sample: &ImuSample) {
        if let Some(good) = &self.good {
            let (change, limit) = (change(sample, good), self.largest_change(good, sample));
            let change = [0, 1].map(|k| change[k].min(limit[k]));
            let step_s = seconds_between(good.time_ns, sample.time_ns);
            self.doubt = self.doubt_after(sample);
            let usual = self.usual.get_or_insert(Usual { step_s, change });
            usual.step_s += MEMORY * (step_s.min(MISSING * usual.step_s) - usual.step_s);
            for k in 0..2 {
                usual.change[k] += MEMORY * (change[k] - usual.change[k]);
            }
        }
        self.good = Some(*sample);
    }

    /// Largest change of rate and force from the last good reading that is no jump.
    #[inline]
    pub(super) fn largest_change(&self, good: &ImuSample, sample: &ImuSample) -> [f64; 2] {
        let step_s = seconds_between(good.time_ns, sample.time_ns);
        let usual = self.usual.map(|usual| usual.change).unwrap_or_default();
        [0, 1].map(|k| (FASTEST_CHANGE[k] * step_s).max(USUAL * usual[k]))
    }
}

impl Usual {
    /// Largest change of rate and force in a step that a vehicle makes by itself.
    #[inline]
    fn own_change(&self, step_s: f64) -> [f64; 2] {
        [0, 1].map(|k| (OWN_CHANGE[k] * step_s).max(OWN_USUAL * self.change[k]))
    }
}

/// Change of the angular rate, rad/s, and of the specific force, m/s², from another reading on each axis.
#[inline]
pub(super) fn changes(sample: &ImuSample, from: &ImuSample) -> [f64; AXES] {
    let (rate, force) = (
        sample.rate_p_radps - from.rate_p_radps,
        sample.force_p_mps2 - from.force_p_mps2,
    );
    let [rate, force] = [rate.0, force.0].map(|change| change.abs());
    [rate.x, rate.y, rate.z, force.x, force.y, force.z]
}

/// The largest of the three axes of each.
#[inline]
pub(super) fn change(sample: &ImuSample, from: &ImuSample) -> [f64; 2] {
    let [rate_x, rate_y, rate_z, force_x, force_y, force_z] = changes(sample, from);
    [rate_x.max(rate_y).max(rate_z), force_x.max(force_y).max(force_z)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Vec3;

    /// Numbers that no check can have are refused.
    #[test]
    fn numbers_that_are_restored_are_checked() {
        let before = ImuSample {
            time_ns: 0,
            rate_p_radps: Vec3::zeros(),
            force_p_mps2: Vec3::zeros(),
        };
        let course = |axis, size, step_s, change| Course {
            good: Some(before),
            usual: Some(Usual { step_s, change }),
            doubt: Some(Doubt { before, axis, size }),
        };
        assert!(course(5, 1.0, 0.01, [0.0, 0.0]).check_restored().is_ok());
        assert!(course(6, 1.0, 0.01, [0.0, 0.0]).check_restored().is_err());
        assert!(course(5, -1.0, 0.01, [0.0, 0.0]).check_restored().is_err());
        assert!(course(5, 1.0, f64::NAN, [0.0, 0.0]).check_restored().is_err());
        assert!(course(5, 1.0, 0.01, [0.0, -1.0]).check_restored().is_err());
        let unread = ImuSample {
            force_p_mps2: Vec3::new(f64::NAN, 0.0, 0.0),
            ..before
        };
        let mut spoilt = course(5, 1.0, 0.01, [0.0, 0.0]);
        spoilt.doubt = Some(Doubt {
            before: unread,
            axis: 0,
            size: 0.0,
        });
        assert!(spoilt.check_restored().is_err());
    }
}
