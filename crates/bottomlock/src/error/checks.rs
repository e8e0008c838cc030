//! Checks of numbers, each with an error that names the field.

use std::f64::consts::PI;

use super::{LARGEST, NavError, SPAN_NS};

/// The likely mistake where a number is implausible.
pub(crate) const UNIT: &str = ": the unit is SI";

/// Checks that every number in a slice is finite and less than [`LARGEST`].
///
/// # Errors
/// [`NavError::NotFinite`] or [`NavError::TooLarge`], which names the field and the time.
pub(crate) fn require_finite(field: &'static str, time_ns: i64, values: &[f64]) -> Result<(), NavError> {
    require_below(LARGEST, field, time_ns, values)
}

/// The same for variances and covariances, which are squares.
///
/// # Errors
/// As [`require_finite`].
pub(crate) fn require_finite_squares(field: &'static str, time_ns: i64, values: &[f64]) -> Result<(), NavError> {
    require_below(LARGEST * LARGEST, field, time_ns, values)
}

fn require_below(limit: f64, field: &'static str, time_ns: i64, values: &[f64]) -> Result<(), NavError> {
    match values.iter().find(|value| !(value.abs() < limit)) {
        None => Ok(()),
        Some(value) if value.is_finite() => Err(NavError::TooLarge {
            field,
            time_ns,
            value: *value,
        }),
        Some(_) => Err(NavError::NotFinite { field, time_ns }),
    }
}

/// Checks the magnitude of every number.
///
/// # Errors
/// [`NavError::OutOfRange`], which names the field and what was expected.
pub(crate) fn require_magnitude(
    field: &'static str,
    values: &[f64],
    bound: f64,
    expected: &'static str,
) -> Result<(), NavError> {
    match values.iter().find(|value| !(value.abs() < bound)) {
        None => Ok(()),
        Some(&value) => Err(NavError::OutOfRange { field, value, expected }),
    }
}

/// Checks that every number is one that a vehicle or instrument can have; `hint` is the likely mistake, or what to do.
///
/// # Errors
/// [`NavError::Implausible`], which names the field and the first number beyond the limit, or that is none.
pub(crate) fn require_plausible(
    field: &'static str,
    time_ns: i64,
    values: &[f64],
    limit: f64,
    hint: &'static str,
) -> Result<(), NavError> {
    match values.iter().find(|value| !(value.abs() <= limit)) {
        None => Ok(()),
        Some(&value) => Err(NavError::Implausible {
            field,
            time_ns,
            value,
            limit,
            hint,
        }),
    }
}

/// Checks 1 sigma of an angle: positive, and at most half a turn.
///
/// # Errors
/// [`NavError::OutOfRange`] or [`NavError::Implausible`], which names the field.
pub(crate) fn require_angle_sd(field: &'static str, time_ns: i64, sd_rad: f64) -> Result<(), NavError> {
    require_positive(field, sd_rad)?;
    require_plausible(field, time_ns, &[sd_rad], PI, " rad, half a turn: is it in degrees?")
}

/// Checks that a time is one of which differences can be taken.
///
/// # Errors
/// [`NavError::TimeOutOfSpan`], which names the stream.
pub fn require_time(stream: &'static str, time_ns: i64) -> Result<(), NavError> {
    if time_ns.unsigned_abs() < SPAN_NS {
        Ok(())
    } else {
        Err(NavError::TimeOutOfSpan { stream, time_ns })
    }
}

/// Checks that the times of a stream rise.
///
/// # Errors
/// [`NavError::TimeNotIncreasing`], which names the stream and the first time that does not.
pub(crate) fn require_rising(stream: &'static str, times_ns: &[i64]) -> Result<(), NavError> {
    match times_ns.windows(2).find(|pair| pair[1] <= pair[0]) {
        None => Ok(()),
        Some(pair) => Err(NavError::TimeNotIncreasing {
            stream,
            time_ns: pair[1],
            previous_ns: pair[0],
        }),
    }
}

/// Checks that a standard deviation or variance is finite, not negative and less than [`LARGEST`].
///
/// # Errors
/// [`NavError::OutOfRange`], which names the field.
pub(crate) fn require_non_negative(field: &'static str, value: f64) -> Result<(), NavError> {
    require_in_range(field, value, value >= 0.0, "a finite number >= 0")
}

/// Checks that a standard deviation or variance is finite, positive and less than [`LARGEST`].
///
/// # Errors
/// [`NavError::OutOfRange`], which names the field.
pub(crate) fn require_positive(field: &'static str, value: f64) -> Result<(), NavError> {
    require_in_range(field, value, value > 0.0, "a finite number > 0")
}

fn require_in_range(field: &'static str, value: f64, is_inside: bool, expected: &'static str) -> Result<(), NavError> {
    let expected = match value {
        _ if !is_inside || value.is_infinite() => expected,
        _ if value < LARGEST => return Ok(()),
        _ => "less than 1e12 in SI units: a filler for a missing value?",
    };
    Err(NavError::OutOfRange { field, value, expected })
}
