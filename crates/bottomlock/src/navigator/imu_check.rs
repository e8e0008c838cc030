//! The check of inertial readings that come from outside: range, clipping, stuck values, jumps, gaps.
//!
//! A reading that is rejected moves nothing: the next good one carries the interval, whose further uncertainty is that of
//! `filter/bridge.rs`. So does the first good one after a gap in time longer than the limit, where the options ask for it.
//!
//! Readings of a simulation without noise are equal for minutes, and those of a real instrument never are. Equal readings
//! therefore count as stuck only where the model has noise of both gyros and accelerometers, and where the options say after
//! how many: on all axes, or on one whose readings seldom repeat.
//!
//! A reading that departs from the last good one faster than any vehicle turns or is pushed, and by far more than readings
//! usually change, is a bit that flipped or a line that was cut. After two of them the next one is taken: the vehicle was hit.

use serde::{Deserialize, Serialize};

use crate::error::{NavError, require_non_negative};
use crate::filter::{BridgeNoise, seconds_between};
use crate::mechanisation::{IMU_FAULTS, ImuFault, ImuLimits, ImuSample, LongGap, Quantity};
use crate::model::ImuModel;

use super::imu_course::{AXES, Course, MEMORY, change, changes};

/// The place of inflated gaps in [`IMU_FAULTS`].
const INFLATED: usize = 4;

/// Longest step of which no doubt is possible, ns: readings within their full scale change little in it.
const PLAIN_STEP_NS: i64 = 1_000_000_000;

/// Readings in a row that jump.
const MOST_JUMPS: u32 = 2;
/// Part of the last readings of an axis that repeat the one before, from which on it may stand still by itself.
const REPEATS: f64 = 0.5;

/// The check, and what it has seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ImuCheck {
    limits: ImuLimits,
    /// The last reading, good or not.
    last: Option<ImuSample>,
    /// How the good ones go on.
    course: Course,
    /// How many readings in a row have jumped.
    jumped: u32,
    /// How many readings in a row are equal to the last one on each axis, itself included.
    equal: [u32; AXES],
    /// Part of the readings that repeat the one before on each axis.
    repeats: [f64; AXES],
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
            course: Course::default(),
            jumped: 0,
            equal: [0; AXES],
            repeats: [REPEATS; AXES],
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
        self.last.iter().try_for_each(ImuSample::validate)?;
        let mut repeats = self.repeats.into_iter();
        repeats.try_for_each(|part| require_non_negative("part of inertial readings that repeat", part))?;
        self.course.check_restored()
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
            && self.course.is_usual(sample)
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
        let noise = if is_long || self.is_bridging {
            Some(BridgeNoise::between(good_ns, sample.time_ns, &self.limits)?)
        } else {
            self.course.missing(sample, &self.limits)
        };
        let doubted = self.course.doubted(sample);
        Ok(Judged::Good(noise.into_iter().chain(doubted).reduce(BridgeNoise::max)))
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
            for (part, equal) in self.repeats.iter_mut().zip(self.equal) {
                if equal < self.limits.stuck_after {
                    *part += MEMORY * (f64::from(u8::from(equal > 1)) - *part);
                }
            }
        }
        if let Some(fault) = fault {
            self.counts[fault.kind()] += 1;
        }
        match fault {
            None => {
                self.course.note(sample);
                self.jumped = 0;
            }
            Some(ImuFault::Jump { .. }) => self.jumped += 1,
            Some(_) => {}
        }
        self.is_bridging = fault.is_some();
        self.last = Some(*sample);
    }

    #[inline]
    fn jump(&self, sample: &ImuSample) -> Option<ImuFault> {
        let good = self.course.good.as_ref()?;
        let (change, limit) = (change(sample, good), self.course.largest_change(good, sample));
        let jumps = [0, 1].map(|k| change[k] > limit[k]);
        if !(jumps[0] || jumps[1]) || self.course.usual.is_none() || self.jumped >= MOST_JUMPS {
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
        let limit = self.limits.stuck_after;
        if limit == 0 {
            return None;
        }
        let equal = self.equal_with(sample);
        let seldom = (0..AXES).filter(|&axis| self.repeats[axis] < REPEATS);
        let alone = seldom.map(|axis| equal[axis]).max();
        let readings = equal.into_iter().min().max(alone)?;
        (readings >= limit).then_some(ImuFault::Stuck { readings })
    }

    /// How many readings in a row are equal with this one on each axis.
    fn equal_with(&self, sample: &ImuSample) -> [u32; AXES] {
        let Some(last) = &self.last else {
            return [1; AXES];
        };
        let (changes, mut equal) = (changes(sample, last), self.equal);
        for (equal, change) in equal.iter_mut().zip(changes) {
            *equal = if change == 0.0 { equal.saturating_add(1) } else { 1 };
        }
        equal
    }
}

#[cfg(test)]
#[path = "imu_check_tests.rs"]
mod tests;
