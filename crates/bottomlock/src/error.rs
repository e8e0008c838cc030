//! The errors of the kernel. Lost beams, gated measurements and unobservable axes are values, never errors.

use thiserror::Error;

/// What can go wrong on bad input or in the numerics.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NavError {
    /// A number that must be finite is not.
    #[error("{field} at {time_ns} ns is not finite")]
    NotFinite {
        /// Which quantity.
        field: &'static str,
        /// When.
        time_ns: i64,
    },
    /// A parameter outside its range.
    #[error("{field} is {value}, expected {expected}")]
    OutOfRange {
        /// Which parameter.
        field: &'static str,
        /// What was given.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A beam flagged valid carries no finite velocity or no positive standard deviation.
    #[error("beam {beam} at {time_ns} ns is flagged valid but its {field} is {value}")]
    BadBeam {
        /// Beam number, counted from 1.
        beam: usize,
        /// When.
        time_ns: i64,
        /// Which quantity.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// A wrong number of things.
    #[error("{field}: got {got}, expected {expected}")]
    WrongCount {
        /// Which list.
        field: &'static str,
        /// How many were given.
        got: usize,
        /// What would be right.
        expected: String,
    },
    /// Time did not advance.
    #[error("{stream} time {time_ns} ns does not come after {previous_ns} ns")]
    TimeNotIncreasing {
        /// Which stream.
        stream: &'static str,
        /// The offending time.
        time_ns: i64,
        /// The time before it.
        previous_ns: i64,
    },
    /// A beam direction that is not a unit vector.
    #[error("direction of beam {beam} has norm {norm}, expected 1 within 1e-6")]
    NotUnit {
        /// Beam number, counted from 1.
        beam: usize,
        /// Its norm.
        norm: f64,
    },
    /// A covariance that is not symmetric positive definite.
    #[error("{matrix} at {time_ns} ns is not positive definite")]
    NotPositiveDefinite {
        /// Which matrix.
        matrix: &'static str,
        /// When.
        time_ns: i64,
    },
    /// A truth that does not cover what is asked of it.
    #[error("{stream} epoch {time_ns} ns lies outside the truth ({first_ns} to {last_ns} ns)")]
    OutsideTruth {
        /// Which schedule.
        stream: &'static str,
        /// The offending epoch.
        time_ns: i64,
        /// First truth sample.
        first_ns: i64,
        /// Last truth sample.
        last_ns: i64,
    },
    /// A name that is not known.
    #[error("unknown {what} '{name}', expected one of {expected}")]
    UnknownName {
        /// Kind of thing.
        what: &'static str,
        /// What was given.
        name: String,
        /// What is known.
        expected: &'static str,
    },
    /// An error in one row of a log.
    #[error("{stream} row {row}: {source}")]
    InRow {
        /// Which stream.
        stream: &'static str,
        /// Row, counted from 0.
        row: usize,
        /// What is wrong.
        #[source]
        source: Box<NavError>,
    },
    /// An error of one method that flies along a log.
    #[error("method {method}: {source}")]
    InMethod {
        /// Method name.
        method: &'static str,
        /// What happened.
        #[source]
        source: Box<NavError>,
    },
    /// A sample of a log that the log does not reach.
    #[error("sample time {time_ns} ns lies outside the replay ({first_ns} to {last_ns} ns, start to last imu row)")]
    OutsideLog {
        /// The offending time.
        time_ns: i64,
        /// Start.
        first_ns: i64,
        /// Last inertial reading.
        last_ns: i64,
    },
    /// A method that no smoother can go back over.
    #[error("a choice between filters has no smoother of its own: smooth the methods that it chooses from, {instead}")]
    NoSmoother {
        /// Which methods to smooth in its place.
        instead: &'static str,
    },
    /// An error in one method of one run of a batch.
    #[error("run {run}, method {method}: {source}")]
    InRun {
        /// Run number.
        run: u64,
        /// Method name.
        method: &'static str,
        /// What happened.
        #[source]
        source: Box<NavError>,
    },
}

/// Checks that every number of a slice is finite.
///
/// # Errors
/// [`NavError::NotFinite`] that names the field and the time.
pub(crate) fn require_finite(field: &'static str, time_ns: i64, values: &[f64]) -> Result<(), NavError> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(NavError::NotFinite { field, time_ns })
    }
}

/// Checks that a standard deviation or variance is finite and not negative.
///
/// # Errors
/// [`NavError::OutOfRange`] that names the field.
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
/// [`NavError::OutOfRange`] that names the field.
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
