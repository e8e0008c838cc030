//! The check of inertial readings that come from outside: range, clipping, stuck values, jumps, gaps.
//!
//! A reading that is rejected moves nothing: the next good one carries the interval, whose further uncertainty is that of
//! `filter/bridge.rs`. So does the first good one after a gap in time longer than the limit, where the options ask for it.
//!
//! Readings of a simulation without noise are equal for minutes, and those of a real instrument never are. Equal readings
//! therefore count as stuck only where the model has noise of both gyros and accelerometers, and where the options say after
//! how many.
//!
//! A reading that departs from the last good one faster than any vehicle turns or is pushed, and by far more than readings
//! usually change, is a bit that flipped or a line that was cut. After two of them the next one is taken: the vehicle was hit.

use serde::{Deserialize, Serialize};

use crate::error::{NavError, require_non_negative};
use crate::filter::{BridgeNoise, seconds_between};
use crate::mechanisation::{IMU_FAULTS, ImuFault, ImuLimits, ImuSample, LongGap, Quantity};
use crate::model::ImuModel;

/// The place of inflated gaps in [`IMU_FAULTS`].
const INFLATED: usize = 4;

/// Longest step of which no doubt is possible, ns: readings within their full scale change little in it.
const PLAIN_STEP_NS: i64 = 1_000_000_000;

/// Change of the angular rate, rad/s², and of the specific force, m/s³, that no vehicle exceeds.
const FASTEST_CHANGE: [f64; 2] = [50.0, 300.0];
/// The same over the usual change between readings: vibration is no jump.
const USUAL: f64 = 15.0;
/// Readings in a row that jump.
const MOST_JUMPS: u32 = 2;
/// Weight of a reading in the usual change.
const MEMORY: f64 = 0.01;

/// The check, and what it has seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ImuCheck {
    limits: ImuLimits,
    /// The last reading, good or not.
    last: Option<ImuSample>,
    /// The last good one.
    good: Option<ImuSample>,
    /// Usual change of rate and force between good readings; `None` before the second.
    usual: Option<[f64; 2]>,
    /// How many readings in a row have jumped.
    jumped: u32,
    /// How many readings in a row are equal to the last one, itself included.
    equal: u32,
    /// Whether readings were rejected since the last good one.
    is_bridging: bool,
    counts: [u64; IMU_FAULTS.len()],
}

/// What becomes of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Judged {
    /// It is used; after an interval that is bridged, with the noise of that interval.
    Good(Option<BridgeNoise>),
    /// It is rejected.
    Rejected(ImuFault),
}

impl ImuCheck {
    /// A check by the limits of the options, for an instrument of the model.
    pub(crate) fn new(limits: &ImuLimits, model: &ImuModel) -> Self {
        let has_noise = model.accel_noise_mps_rts > 0.0 && model.gyro_noise_rad_rts > 0.0;
        Self {
            limits: ImuLimits {
                stuck_after: if has_noise { limits.stuck_after } else { 0 },
                ..*limits
            },
            last: None,
            good: None,
            usual: None,
            jumped: 0,
            equal: 0,
            is_bridging: false,
            counts: [0; IMU_FAULTS.len()],
        }
    }

    /// Checks the numbers of a check read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(crate) fn check_restored(&self) -> Result<(), NavError> {
        self.limits.validate()?;
        let mut readings = [self.last, self.good].into_iter().flatten();
        readings.try_for_each(|reading| reading.validate())?;
        let mut usual = self.usual.into_iter().flatten();
        usual.try_for_each(|change| require_non_negative("usual change of inertial readings", change))
    }

    /// Time of the last reading, good or not, ns.
    pub(crate) fn last_ns(&self) -> Option<i64> {
        self.last.map(|last| last.time_ns)
    }

    /// How many readings were rejected and gaps inflated, in the order of [`IMU_FAULTS`].
    pub(crate) fn counts(&self) -> &[u64; IMU_FAULTS.len()] {
        &self.counts
    }

    /// Whether a reading is good without any doubt: of a finite value within range, not stuck, shortly after a good one. What is
    /// not is judged.
    #[inline]
    pub(crate) fn is_plain(&self, sample: &ImuSample, good_ns: i64) -> bool {
        let step_ns = sample.time_ns.saturating_sub(good_ns);
        !self.is_bridging
            && step_ns > 0
            && step_ns <= PLAIN_STEP_NS
            && step_ns as f64 * 1e-9 <= self.limits.max_gap_s
            && self.limits.is_in_range(sample)
            && self.stuck(sample).is_none()
            && self.jump(sample).is_none()
    }

    /// Judges a reading, `good_ns` being the time of the last good one or of the start; changes nothing.
    ///
    /// # Errors
    /// [`NavError::ImuGap`] or [`NavError::ImuGapTooLong`] for a gap that is not bridged.
    pub(crate) fn judge(&self, sample: &ImuSample, good_ns: i64) -> Result<Judged, NavError> {
        let is_long = self.is_long(sample, good_ns);
        if is_long && self.limits.gap == LongGap::Refuse {
            return Err(NavError::ImuGap {
                time_ns: sample.time_ns,
                last_ns: good_ns,
                gap_s: seconds_between(good_ns, sample.time_ns),
                limit_s: self.limits.max_gap_s,
            });
        }
        if let Some(fault) = self.fault(sample) {
            return Ok(Judged::Rejected(fault));
        }
        if !is_long && !self.is_bridging {
            return Ok(Judged::Good(None));
        }
        BridgeNoise::between(good_ns, sample.time_ns, &self.limits).map(|noise| Judged::Good(Some(noise)))
    }

    /// What is wrong with a reading, whatever the gap before it.
    pub(crate) fn fault(&self, sample: &ImuSample) -> Option<ImuFault> {
        let fault = self.limits.range_fault(sample).or_else(|| self.stuck(sample));
        fault.or_else(|| self.jump(sample))
    }

    /// Takes note of a reading that was judged and taken.
    pub(crate) fn note(&mut self, sample: &ImuSample, good_ns: i64, judged: &Judged) {
        match judged {
            Judged::Rejected(fault) => self.note_fault(sample, Some(fault)),
            Judged::Good(_) => {
                self.counts[INFLATED] += u64::from(self.is_long(sample, good_ns));
                self.note_fault(sample, None);
            }
        }
    }

    /// Takes note of a reading and of what is wrong with it.
    #[inline]
    pub(crate) fn note_fault(&mut self, sample: &ImuSample, fault: Option<&ImuFault>) {
        if self.limits.stuck_after > 0 {
            self.equal = self.equal_with(sample);
        }
        if let Some(fault) = fault {
            self.counts[fault.kind()] += 1;
        }
        match fault {
            None => self.note_change(sample),
            Some(ImuFault::Jump { .. }) => self.jumped += 1,
            Some(_) => {}
        }
        self.is_bridging = fault.is_some();
        self.last = Some(*sample);
    }

    /// Takes note of how a good reading has changed, as far as a vehicle changes.
    #[inline]
    fn note_change(&mut self, sample: &ImuSample) {
        if let Some(good) = &self.good {
            let change = change(sample, good);
            let limit = self.largest_change(good, sample);
            let usual = self.usual.get_or_insert([0, 1].map(|k| change[k].min(limit[k])));
            for k in 0..2 {
                usual[k] += MEMORY * (change[k].min(limit[k]) - usual[k]);
            }
        }
        (self.good, self.jumped) = (Some(*sample), 0);
    }

    /// Largest change of rate and force from the last good reading that is no jump.
    #[inline]
    fn largest_change(&self, good: &ImuSample, sample: &ImuSample) -> [f64; 2] {
        let step_s = seconds_between(good.time_ns, sample.time_ns);
        let usual = self.usual.unwrap_or_default();
        [0, 1].map(|k| (FASTEST_CHANGE[k] * step_s).max(USUAL * usual[k]))
    }

    #[inline]
    fn jump(&self, sample: &ImuSample) -> Option<ImuFault> {
        let good = self.good.as_ref()?;
        let (change, limit) = (change(sample, good), self.largest_change(good, sample));
        let jumps = [0, 1].map(|k| change[k] > limit[k]);
        if !(jumps[0] || jumps[1]) || self.usual.is_none() || self.jumped >= MOST_JUMPS {
            return None;
        }
        let (quantity, change) = if jumps[1] {
            (Quantity::Force, change[1])
        } else {
            (Quantity::Rate, change[0])
        };
        let step_s = seconds_between(good.time_ns, sample.time_ns);
        Some(ImuFault::Jump {
            quantity,
            change,
            step_s,
        })
    }

    fn is_long(&self, sample: &ImuSample, good_ns: i64) -> bool {
        seconds_between(good_ns, sample.time_ns) > self.limits.max_gap_s
    }

    #[inline]
    fn stuck(&self, sample: &ImuSample) -> Option<ImuFault> {
        let readings = match self.limits.stuck_after {
            0 => return None,
            _ => self.equal_with(sample),
        };
        (readings >= self.limits.stuck_after).then_some(ImuFault::Stuck { readings })
    }

    /// How many readings in a row are equal with this one.
    fn equal_with(&self, sample: &ImuSample) -> u32 {
        let is_equal =
            |last: ImuSample| last.rate_p_radps == sample.rate_p_radps && last.force_p_mps2 == sample.force_p_mps2;
        if self.last.is_some_and(is_equal) {
            self.equal.saturating_add(1)
        } else {
            1
        }
    }
}

/// Largest change on an axis from another reading, of the angular rate, rad/s, and of the specific force, m/s².
#[inline]
fn change(sample: &ImuSample, from: &ImuSample) -> [f64; 2] {
    [
        (sample.rate_p_radps - from.rate_p_radps).0.amax(),
        (sample.force_p_mps2 - from.force_p_mps2).0.amax(),
    ]
}

#[cfg(test)]
#[path = "imu_check_tests.rs"]
mod tests;
