//! Errors of the kernel: bad input and failed factorisations.
//!
//! Lost beams, rejected measurements and unobservable axes are values, never errors.

use thiserror::Error;

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
    /// A parameter lies outside its range.
    #[error("{field} is {value}, expected {expected}")]
    OutOfRange {
        /// Name of the parameter.
        field: &'static str,
        /// Value given.
        value: f64,
        /// Range expected, with the likely mistake.
        expected: &'static str,
    },
    /// A beam flagged valid has a bad velocity or standard deviation, or does not exist.
    #[error("beam {beam} at {time_ns} ns is flagged valid but its {field} is {value}, expected {expected}")]
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
    #[error("unknown {what} '{name}', expected one of {expected}")]
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
    /// A method cannot be smoothed, since it selects among filters.
    #[error("a method that selects among filters cannot be smoothed: smooth the methods it selects from, {instead}")]
    NoSmoother {
        /// Methods to smooth in its place.
        instead: &'static str,
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

/// Checks that every number in a slice is finite.
///
/// # Errors
/// [`NavError::NotFinite`], which names the field and the time.
pub(crate) fn require_finite(field: &'static str, time_ns: i64, values: &[f64]) -> Result<(), NavError> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(NavError::NotFinite { field, time_ns })
    }
}

/// Largest number of a filter that is read from bytes: its sixth power is finite, so that no product in an update overflows.
const LARGEST_RESTORED: f64 = 1e50;

/// Checks the numbers of a filter that is read from bytes: finite, and far from overflow.
///
/// # Errors
/// [`NavError::NotFinite`] or [`NavError::OutOfRange`], which names the field.
pub(crate) fn require_restorable(field: &'static str, time_ns: i64, values: &[f64]) -> Result<(), NavError> {
    require_finite(field, time_ns, values)?;
    match values.iter().find(|value| value.abs() > LARGEST_RESTORED) {
        None => Ok(()),
        Some(&value) => Err(NavError::OutOfRange {
            field,
            value,
            expected: "a number of a saved filter, up to 1e50",
        }),
    }
}

/// Checks that a standard deviation or variance is finite and not negative.
///
/// # Errors
/// [`NavError::OutOfRange`], which names the field.
pub(crate) fn require_non_negative(field: &'static str, value: f64) -> Result<(), NavError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(NavError::OutOfRange {
            field,
            value,
            expected: "a finite number >= 0",
        })
    }
}

/// Checks that a standard deviation or variance is finite and positive.
///
/// # Errors
/// [`NavError::OutOfRange`], which names the field.
pub(crate) fn require_positive(field: &'static str, value: f64) -> Result<(), NavError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(NavError::OutOfRange {
            field,
            value,
            expected: "a finite number > 0",
        })
    }
}
