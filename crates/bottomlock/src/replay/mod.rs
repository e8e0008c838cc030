//! A recorded log through the event loop: all methods side by side on the same events, in order of validity.
//!
//! # Asynchronous streams
//! Sensors measure when they measure. The log is merged by time of validity, so nothing in it is late: a reading that reached the
//! host late stands where it was valid. Between two inertial readings the [`crate::navigator::Navigator`] splits the strapdown step at
//! the measurement's own time, with the readings interpolated (instantaneous sampling) or held (averaged sampling).
//!
//! Rows before the start or after the last good inertial reading are not used; [`Unused`] counts them. Inertial readings are
//! checked as a live navigator checks them; [`ImuFaults`] has those that are rejected.

mod imu_screen;
mod innovations;
mod log;
mod log_feed;
mod ping;
mod sensor_record;

use crate::aiding::calibration::{CalibrationCovariance, CalibrationVector};
use crate::dvl::geometry::BeamGeometry;
use crate::error::{NavError, require_rising};
use crate::filter::current::CurrentEstimate;
use crate::filter::filter_group::width;
use crate::filter::options::Options;
use crate::layout::DIM;
use crate::model::Model;
use crate::navigator::Method;
use crate::navigator::run_events::run_events;
use crate::state::{Covariance, NavState};
use crate::stop::Stop;
use crate::workers::Workers;

use self::imu_screen::ScreenedImu;
pub use self::imu_screen::{BridgedInterval, ImuFaults, RejectedReading, rejected_readings};
pub use self::innovations::InnovationRecord;
use self::log::IMU;
pub use self::log::{Log, Unused};
use self::log_feed::{LogFeed, MethodReplay};
pub use self::ping::{FIX_STATUS, FixStatus, PingRecord};
pub use self::sensor_record::{SensorRecord, SensorRecords};
pub use crate::navigator::events::{STREAM_NAMES, STREAMS};

/// Inputs of a replay.
#[derive(Debug, Clone, Copy)]
pub struct Replay<'a> {
    /// The log.
    pub log: Log<'a>,
    /// The beams.
    pub geometry: &'a BeamGeometry,
    /// Sensor errors assumed by the filter.
    pub model: &'a Model,
    /// Filter options.
    pub options: &'a Options,
    /// State at the start.
    pub start: NavState,
    /// Covariance at the start; the model's without.
    pub covariance: Option<&'a Covariance>,
    /// Aiding methods; each has the valid beams of the log only, the reference method too.
    pub methods: &'a [Method],
    /// Times at which states are recorded, ns, rising; the first inertial reading at or after each counts.
    pub sample_time_ns: &'a [i64],
    /// Whether every method is smoothed too.
    pub smooth: bool,
    /// Whether covariances are kept beside the standard deviations.
    pub covariances: bool,
    /// Whether the innovations of all measurements are recorded.
    pub innovations: bool,
    /// Rows of each stream that are predicted and not used; empty for none. The innovations of these are recorded.
    pub withheld: [&'a [bool]; STREAMS],
}

/// Estimates at the samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Estimate at each sample.
    pub states: Vec<NavState>,
    /// Standard deviation of each error state there.
    pub sd: Vec<[f64; DIM]>,
    /// Covariance there; empty if it was not requested.
    pub covariances: Vec<Covariance>,
}

impl Series {
    fn push(&mut self, state: NavState, covariance: &Covariance, keep_covariance: bool) {
        self.states.push(state);
        // Rounding may make a zero variance slightly negative if the log determines a state completely.
        self.sd
            .push(std::array::from_fn(|k| covariance[(k, k)].max(0.0).sqrt()));
        if keep_covariance {
            self.covariances.push(*covariance);
        }
    }
}

/// Result of one method.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    /// The filter's estimate at each sample.
    pub filtered: Series,
    /// The smoothed estimate at each sample; empty if it was not requested.
    pub smoothed: Series,
    /// A record for each ping of the log.
    pub pings: Vec<PingRecord>,
    /// What was made of the measurements of each sensor.
    pub sensors: SensorRecords,
    /// Largest estimate of each block of slow errors at a sample, in sigmas of its prior ([`crate::filter::Eskf::slow_errors`]).
    pub slow_errors: Vec<(&'static str, f64)>,
    /// Innovations of all measurements, in order, if they were requested, and of those that are withheld.
    pub innovations: Vec<InnovationRecord>,
    /// Estimates of the DVL's mounting and clock at each sample, as numbers, with their covariance; empty where they are
    /// taken as stated. They are constants, so those of the last sample are the smoothed ones of every sample.
    pub calibrations: Vec<(CalibrationVector, CalibrationCovariance)>,
    /// Estimated error of the attitude reference in roll, pitch and yaw with its standard deviation, rad, at each sample; empty where
    /// it is not estimated.
    pub attitude_errors: Vec<[(f64, f64); 3]>,
    /// Estimated current, north and east, with its covariance, m/s, at each sample; `None` where it is not estimated.
    pub currents: Vec<Option<CurrentEstimate>>,
    /// Bytes that the smoother's tape took.
    pub tape_bytes: usize,
}

/// Result of a replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// A track for each method, in their order.
    pub tracks: Vec<Track>,
    /// Rows that moved no filter.
    pub unused: Unused,
    /// Faults of the inertial readings.
    pub imu_faults: ImuFaults,
}

/// Runs every method over the log, on `threads` threads; the bits do not depend on their number.
///
/// Each method ends as a [`crate::navigator::Navigator`] does that is fed the same events one by one, bit for bit.
///
/// # Errors
/// [`NavError::InRow`] for a row that is not valid; [`NavError::WrongCount`] for a log without an inertial reading after the
/// start, and for flags that are not one a row; [`NavError::OutsideLog`] or [`NavError::TimeNotIncreasing`] for sample times; [`NavError::InMethod`] for an error
/// of a method, and for a method without a smoother if smoothing is requested.
pub fn replay(request: &Replay<'_>, threads: usize) -> Result<Replayed, NavError> {
    replay_until(request, threads, &Stop::new())
}

/// As [`replay`], until its end or until `stop` asks for an early one.
///
/// # Errors
/// As [`replay`]; [`NavError::Interrupted`] where the end was asked for.
pub fn replay_until(request: &Replay<'_>, threads: usize, stop: &Stop) -> Result<Replayed, NavError> {
    let (log, start_ns) = (&request.log, request.start.time_ns);
    log.validate(request.geometry, request.model.environment.gravity_mps2)?;
    innovations::require_flags(log, request)?;
    let screened = ScreenedImu::new(log.imu, start_ns, request.model, request.options)?;
    let last_ns = match screened.imu.last() {
        Some(last) if last.time_ns >= start_ns => last.time_ns,
        _ => {
            return Err(NavError::WrongCount {
                field: "good imu rows at or after the start",
                got: 0,
                expected: "1 or more".into(),
            });
        }
    };
    // Samples after the last good reading are not reached.
    check_samples(
        request.sample_time_ns,
        start_ns,
        log.imu.last().map_or(last_ns, |last| last.time_ns),
    )?;
    let good = Replay {
        log: Log {
            imu: &screened.imu,
            ..*log
        },
        ..*request
    };
    let workers = Workers::new(threads)?;
    let methods = request.methods.iter().map(|method| MethodReplay::new(&good, method));
    let mut groups = groups(methods.collect::<Result<_, _>>()?, workers.threads());
    let tracks = workers.each(&mut groups, |_, methods| {
        let mut feed = LogFeed::new(&good, &screened.faults, std::mem::take(methods));
        run_events(&mut [&mut feed], stop)
            .into_iter()
            .collect::<Result<(), _>>()?;
        feed.into_tracks(stop).into_iter().collect::<Result<Vec<_>, _>>()
    })?;
    let mut unused = log.unused(start_ns, last_ns);
    unused.rejected[IMU] = screened.faults.rejected.len();
    // A rejected reading is not also one after the end.
    unused.after_end[IMU] = 0;
    Ok(Replayed {
        tracks: tracks.into_iter().flatten().collect(),
        unused,
        imu_faults: screened.faults,
    })
}

/// Methods in groups that go side by side: one for each thread, as far as lanes are filled.
fn groups(mut methods: Vec<MethodReplay>, threads: usize) -> Vec<Vec<MethodReplay>> {
    let filled = methods
        .iter_mut()
        .map(MethodReplay::filters)
        .sum::<usize>()
        .div_ceil(width());
    let size = methods.len().div_ceil(threads.min(filled).max(1)).max(1);
    let mut groups = Vec::new();
    while !methods.is_empty() {
        let rest = methods.split_off(size.min(methods.len()));
        groups.push(std::mem::replace(&mut methods, rest));
    }
    groups
}

fn check_samples(sample_time_ns: &[i64], first_ns: i64, last_ns: i64) -> Result<(), NavError> {
    require_rising("sample", sample_time_ns)?;
    match sample_time_ns.iter().find(|&&t| t < first_ns || t > last_ns) {
        None => Ok(()),
        Some(&time_ns) => Err(NavError::OutsideLog {
            time_ns,
            first_ns,
            last_ns,
        }),
    }
}

#[cfg(test)]
pub(crate) mod tests;
