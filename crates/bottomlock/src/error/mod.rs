//! Errors of the kernel: bad input and failed factorisations.
//!
//! Lost beams, rejected measurements and unobservable axes are values, never errors.

mod checks;
pub(crate) mod setting;
mod words;

use thiserror::Error;

pub use self::checks::require_time;
pub(crate) use self::checks::{
    UNIT, require_angle_sd, require_finite, require_finite_squares, require_magnitude, require_non_negative,
    require_plausible, require_positive, require_rising,
};
pub use self::words::internal;
use self::words::{before, near, shown};

/// An error of the kernel, for bad input or for a numerical failure.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NavError {
    /// A number is NaN or infinite.
    #[error("{field} at {time_ns} ns is not finite, expected a number: a missing value is often written as NaN")]
    NotFinite {
        /// Name of the quantity.
        field: &'static str,
        /// Time of validity, ns.
        time_ns: i64,
    },
    /// A number is beyond anything in navigation.
    #[error(
        "{field} at {time_ns} ns is {value:e}, expected less than {LARGEST:e} in SI units: a filler for a missing value?"
    )]
    TooLarge {
        /// Name of the quantity.
        field: &'static str,
        /// Time of validity, ns.
        time_ns: i64,
        /// Value given.
        value: f64,
    },
    /// A time is beyond the span in which differences of times are computed.
    #[error(
        "{stream} time {time_ns} ns lies more than 146 years from 0, \
         expected integer nanoseconds: a negative time read as unsigned, or scaled twice?"
    )]
    TimeOutOfSpan {
        /// Name of the stream.
        stream: &'static str,
        /// Time given, ns.
        time_ns: i64,
    },
    /// A parameter lies outside its range.
    #[error("{field} is {}, expected {expected}", shown(*value))]
    OutOfRange {
        /// Name of the parameter.
        field: &'static str,
        /// Value given.
        value: f64,
        /// Range expected, with the likely mistake.
        expected: &'static str,
    },
    /// A setting is unknown, missing, of another type or not valid.
    #[error(
        "{key} {found}{}{expected}{}{hint}",
        before(", expected ", expected),
        before("; ", hint)
    )]
    Setting {
        /// Path of its key.
        key: String,
        /// What was found there.
        found: String,
        /// What was expected; empty where that is plain.
        expected: String,
        /// The likely mistake; empty for none.
        hint: String,
    },
    /// A beam flagged valid has a bad velocity or standard deviation, or does not exist.
    #[error("beam {beam} at {time_ns} ns is flagged valid but its {field} is {}, expected {expected}", shown(*value))]
    BadBeam {
        /// Beam number, counted from 1.
        beam: usize,
        /// Time of validity, ns.
        time_ns: i64,
        /// Name of the quantity.
        field: &'static str,
        /// Value given.
        value: f64,
        /// Value expected, with the likely mistake.
        expected: &'static str,
    },
    /// A list has the wrong length.
    #[error("{field}: got {got}, expected {expected}")]
    WrongCount {
        /// Name of the list.
        field: &'static str,
        /// Length given.
        got: usize,
        /// Length expected.
        expected: String,
    },
    /// A time does not increase.
    #[error(
        "{stream} time {time_ns} ns does not come after {previous_ns} ns, expected increasing times within a stream"
    )]
    TimeNotIncreasing {
        /// Name of the stream.
        stream: &'static str,
        /// Time that does not increase, ns.
        time_ns: i64,
        /// Time before it, ns.
        previous_ns: i64,
    },
    /// Nothing was read by the inertial sensors for longer than the limit.
    #[error(
        "imu time {time_ns} ns comes {gap_s:.6} s after the last good reading at {last_ns} ns, expected at most \
         imu_limits.max_gap_s = {limit_s} s: start again from a fix, or bridge the gap with imu_limits.gap = \"inflate\""
    )]
    ImuGap {
        /// Time of the reading after the gap, ns.
        time_ns: i64,
        /// Time of the last good reading, or of the start, ns.
        last_ns: i64,
        /// Length of the gap, s.
        gap_s: f64,
        /// The limit, s.
        limit_s: f64,
    },
    /// The attitude would be unknown after a gap between inertial readings.
    #[error(
        "imu time {time_ns} ns comes {gap_s:.6} s after the last good reading at {last_ns} ns, too long to bridge: with \
         imu_limits.gap_rate_sd_radps the attitude is unknown by more than 1 rad, expected {longest_s:.6} s or less: start \
         again from a fix"
    )]
    ImuGapTooLong {
        /// Time of the reading after the gap, ns.
        time_ns: i64,
        /// Time of the last good reading, or of the start, ns.
        last_ns: i64,
        /// Length of the gap, s.
        gap_s: f64,
        /// Longest gap that can be bridged, s.
        longest_s: f64,
    },
    /// A measurement lies too far ahead of the inertial readings to belong to them.
    #[error(
        "{stream} time {time_ns} ns lies {ahead_s:.6} s ahead of the navigator at {now_ns} ns, expected at most {limit_s} s: \
         all streams count nanoseconds from the same origin"
    )]
    TooFarAhead {
        /// Name of the stream.
        stream: &'static str,
        /// Time of the measurement, ns.
        time_ns: i64,
        /// Time of the navigator, ns.
        now_ns: i64,
        /// How far it lies ahead, s.
        ahead_s: f64,
        /// The limit, s.
        limit_s: f64,
    },
    /// A reading lies further behind than the horizon, so that it cannot be put in its place.
    #[error(
        "{stream} time {time_ns} ns lies {behind_s:.6} s behind the navigator at {now_ns} ns, expected at most {reach_s} s, \
         horizon_ns: allow for the latency by a longer horizon (up to 10 s), and count all times on one clock"
    )]
    TooLate {
        /// Name of the stream.
        stream: &'static str,
        /// Time of validity, ns.
        time_ns: i64,
        /// Time of the navigator, ns.
        now_ns: i64,
        /// How far it lies behind, s.
        behind_s: f64,
        /// How far it may, s.
        reach_s: f64,
    },
    /// The variance of a measurement is finite and positive, or would be, but no instrument has it.
    #[error("the variance of {stream} at {time_ns} ns is {value:e}, expected 1e-30 to 1e24: the unit is SI")]
    NoVariance {
        /// Name of the stream.
        stream: &'static str,
        /// Time of validity, ns.
        time_ns: i64,
        /// Its value, in the square of the measurement's unit.
        value: f64,
    },
    /// A number is finite, but no vehicle or instrument has it.
    #[error("{field} at {time_ns} ns is {value:e}, expected a number of at most {limit:e}{hint}")]
    Implausible {
        /// Name of the quantity.
        field: &'static str,
        /// Time of validity, ns.
        time_ns: i64,
        /// Its value.
        value: f64,
        /// Largest value expected.
        limit: f64,
        /// The likely mistake, or what to do.
        hint: &'static str,
    },
    /// A beam direction is not a unit vector.
    #[error("direction of beam {beam} has norm {norm}, expected 1 within 1e-6: divide the vector by its norm")]
    NotUnit {
        /// Beam number, counted from 1.
        beam: usize,
        /// Norm of the direction.
        norm: f64,
    },
    /// A covariance is not symmetric and positive definite.
    #[error(
        "{matrix} at {time_ns} ns is not positive definite, \
         expected positive variances and correlations between -1 and 1"
    )]
    NotPositiveDefinite {
        /// Name of the matrix.
        matrix: &'static str,
        /// Time of validity, ns.
        time_ns: i64,
    },
    /// An epoch lies outside the truth.
    #[error(
        "{stream} epoch {time_ns} ns lies outside the truth ({first_ns} to {last_ns} ns): \
         both must count nanoseconds from the same origin"
    )]
    OutsideTruth {
        /// Name of the schedule.
        stream: &'static str,
        /// Epoch outside the truth, ns.
        time_ns: i64,
        /// Time of the first truth sample, ns.
        first_ns: i64,
        /// Time of the last truth sample, ns.
        last_ns: i64,
    },
    /// A name is unknown.
    #[error("unknown {what} '{name}', expected one of {expected}{}", near(name, expected))]
    UnknownName {
        /// Kind of the name, such as "method".
        what: &'static str,
        /// Name given.
        name: String,
        /// Names that are known.
        expected: &'static str,
    },
    /// An error in one row of a log.
    #[error("{stream} row {row}: {source}")]
    InRow {
        /// Name of the stream.
        stream: &'static str,
        /// Row, counted from 0.
        row: usize,
        /// Error in the row.
        #[source]
        source: Box<NavError>,
    },
    /// An error of one method during a replay.
    #[error("method {method}: {source}")]
    InMethod {
        /// Method name.
        method: &'static str,
        /// Error of the method.
        #[source]
        source: Box<NavError>,
    },
    /// A sample time lies outside the log.
    #[error("sample time {time_ns} ns lies outside the replay ({first_ns} to {last_ns} ns, start to last imu row)")]
    OutsideLog {
        /// Sample time outside the log, ns.
        time_ns: i64,
        /// Time of the start, ns.
        first_ns: i64,
        /// Time of the last IMU row, ns.
        last_ns: i64,
    },
    /// Bytes that are no saved object, or a damaged one.
    #[error("{what} not restored: {fault}")]
    NotRestored {
        /// The object expected.
        what: &'static str,
        /// What is wrong with the bytes.
        fault: String,
    },
    /// A truth does not begin where the one before it ended.
    #[error("truth begins at {time_ns} ns, expected {expected_ns} ns: its first sample is the last of the call before")]
    NotContinued {
        /// Time of the first sample, ns.
        time_ns: i64,
        /// Time expected, ns.
        expected_ns: i64,
    },
    /// A closed loop that has failed is called again.
    #[error("this closed loop has failed and cannot go on, start a new one; the failure was: {source}")]
    AfterFailure {
        /// The failure.
        #[source]
        source: Box<NavError>,
    },
    /// A method from outside the kernel failed, or what it returned is no measurement.
    #[error("{method} at {time_ns} ns: {fault}")]
    OwnMethod {
        /// Its name.
        method: &'static str,
        /// Time of the ping, ns.
        time_ns: i64,
        /// What went wrong.
        fault: String,
    },
    /// The caller asked for an early end ([`crate::Stop`]).
    #[error("interrupted: the caller asked for an early end")]
    Interrupted,
    /// An error in one method of one run of a batch.
    #[error("run {run}, method {method}: {source}")]
    InRun {
        /// Run number.
        run: u64,
        /// Method name.
        method: &'static str,
        /// Error of the method.
        #[source]
        source: Box<NavError>,
    },
}

/// What no quantity of navigation reaches in SI units; squares of it, and their products, are still numbers.
pub const LARGEST: f64 = 1e12;

/// Half the range of the times, 2⁶² ns: the difference of two such times is an integer too.
const SPAN_NS: u64 = 1 << 62;

impl NavError {
    /// The key or field that it is about; empty where it is about none.
    #[must_use]
    pub fn key(&self) -> &str {
        match self {
            Self::Setting { key, .. } => key,
            Self::NotFinite { field, .. }
            | Self::TooLarge { field, .. }
            | Self::OutOfRange { field, .. }
            | Self::BadBeam { field, .. }
            | Self::WrongCount { field, .. }
            | Self::Implausible { field, .. } => field,
            Self::UnknownName { what, .. } => what,
            Self::InRow { source, .. } | Self::InMethod { source, .. } | Self::InRun { source, .. } => source.key(),
            _ => "",
        }
    }

    /// The message of an error of numbers that have no time.
    #[must_use]
    pub fn timeless(&self) -> String {
        self.to_string().replace(" at 0 ns", "")
    }

    /// What was expected; empty where the message alone says it.
    #[must_use]
    pub fn expected(&self) -> &str {
        match self {
            Self::Setting { expected, .. } | Self::WrongCount { expected, .. } => expected,
            Self::OutOfRange { expected, .. } | Self::BadBeam { expected, .. } => expected,
            Self::InRow { source, .. } | Self::InMethod { source, .. } | Self::InRun { source, .. } => {
                source.expected()
            }
            _ => "",
        }
    }

    /// What to do, or the likely mistake; empty where the message alone says it.
    #[must_use]
    pub fn hint(&self) -> &str {
        match self {
            Self::Setting { hint, .. } => hint,
            _ => "",
        }
    }
}

#[cfg(test)]
mod tests;
