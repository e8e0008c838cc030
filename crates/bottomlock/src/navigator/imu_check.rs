//! The check of inertial readings that come from outside: range, clipping, stuck values, gaps.
//!
//! A reading that is rejected moves nothing: the next good one carries the interval, whose further uncertainty is that of
//! `filter/bridge.rs`. So does the first good one after a gap in time longer than the limit, where the options ask for it.
//!
//! Readings of a simulation without noise are equal for minutes, and those of a real instrument never are. Equal readings
//! therefore count as stuck only where the model has noise of both gyros and accelerometers, and where the options say after
//! how many.

use serde::{Deserialize, Serialize};

use crate::error::NavError;
use crate::filter::{BridgeNoise, seconds_between};
use crate::mechanisation::{IMU_FAULTS, ImuFault, ImuLimits, ImuSample, LongGap};
use crate::model::ImuModel;

/// The place of inflated gaps in [`IMU_FAULTS`].
const INFLATED: usize = 3;

/// Longest step of which no doubt is possible, ns: readings within their full scale change little in it.
const PLAIN_STEP_NS: i64 = 1_000_000_000;

/// The check, and what it has seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ImuCheck {
    limits: ImuLimits,
    /// The last reading, good or not.
    last: Option<ImuSample>,
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
        self.last.map_or(Ok(()), |last| last.validate())
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
        self.limits.range_fault(sample).or_else(|| self.stuck(sample))
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
        self.is_bridging = fault.is_some();
        self.last = Some(*sample);
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

#[cfg(test)]
#[path = "imu_check_tests.rs"]
mod tests;
