//! The inertial readings of a log, checked as a live navigator checks them.

use std::borrow::Cow;

use super::log::{IMU, in_row};
use crate::error::NavError;
use crate::filter::options::Options;
use crate::filter::{BridgeNoise, seconds_between};
use crate::mechanisation::{IMU_FAULTS, ImuFault, ImuLimits, ImuSample};
use crate::model::{ImuModel, Model};
use crate::navigator::imu_check::{ImuCheck, Judged};

/// A reading of the log that moved no filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RejectedReading {
    /// Its row.
    pub row: usize,
    /// Its time, ns.
    pub time_ns: i64,
    /// Why.
    pub fault: ImuFault,
}

/// An interval between good readings whose uncertainty was added to the covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BridgedInterval {
    /// Time of the good reading that ends it, ns.
    pub time_ns: i64,
    /// Its length, s.
    pub gap_s: f64,
    pub(super) noise: BridgeNoise,
}

/// Faults of the inertial readings of a log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImuFaults {
    /// Their numbers, in the order of [`IMU_FAULTS`].
    pub counts: [u64; IMU_FAULTS.len()],
    /// Every reading that was rejected.
    pub rejected: Vec<RejectedReading>,
    /// Every interval whose uncertainty was added: after rejected or missing readings, and where an axis departs alone.
    pub bridged: Vec<BridgedInterval>,
}

/// The good readings of a log, and the faults of the others.
pub(super) struct ScreenedImu<'a> {
    pub(super) imu: Cow<'a, [ImuSample]>,
    pub(super) faults: ImuFaults,
}

impl<'a> ScreenedImu<'a> {
    /// Checks the readings from the start on.
    ///
    /// # Errors
    /// [`NavError::InRow`] for a gap that is not bridged.
    pub(super) fn new(imu: &'a [ImuSample], start_ns: i64, model: &Model, options: &Options) -> Result<Self, NavError> {
        let mut check = ImuCheck::new(&options.imu_limits, &model.imu);
        let mut faults = ImuFaults::default();
        let mut good: Option<Vec<ImuSample>> = None;
        let mut good_ns = start_ns;
        let first = imu.partition_point(|sample| sample.time_ns < start_ns);
        for (row, sample) in imu.iter().enumerate().skip(first) {
            let time_ns = sample.time_ns;
            let judged = check.judge(sample, good_ns).map_err(in_row(IMU, row))?;
            check.note(sample, good_ns, &judged);
            if let Judged::Rejected(fault) = judged {
                good.get_or_insert_with(|| imu[..row].to_vec());
                faults.rejected.push(RejectedReading { row, time_ns, fault });
                continue;
            }
            if let Judged::Good(Some(noise)) = judged {
                let gap_s = seconds_between(good_ns, time_ns);
                faults.bridged.push(BridgedInterval { time_ns, gap_s, noise });
            }
            if let Some(good) = &mut good {
                good.push(*sample);
            }
            good_ns = time_ns;
        }
        faults.counts = *check.counts();
        Ok(Self {
            imu: good.map_or(Cow::Borrowed(imu), Cow::Owned),
            faults,
        })
    }
}

/// The readings that are rejected by themselves, whatever the gaps between them: for the alignment before a replay.
#[must_use]
pub fn rejected_readings(imu: &[ImuSample], model: &ImuModel, limits: &ImuLimits) -> Vec<RejectedReading> {
    let mut check = ImuCheck::new(limits, model);
    let fault_of = |(row, sample): (usize, &ImuSample)| {
        let fault = check.fault(sample);
        check.note_fault(sample, fault.as_ref());
        fault.map(|fault| RejectedReading {
            row,
            time_ns: sample.time_ns,
            fault,
        })
    };
    imu.iter().enumerate().filter_map(fault_of).collect()
}

impl ImuFaults {
    /// The row of the log of the good reading with a number.
    pub(super) fn row_of(&self, number: usize) -> usize {
        self.rejected
            .iter()
            .fold(number, |row, rejected| row + usize::from(rejected.row <= row))
    }
}
