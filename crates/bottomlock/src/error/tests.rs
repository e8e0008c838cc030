use super::*;

fn text(result: Result<(), NavError>) -> String {
    result.unwrap_err().to_string()
}

/// NaN, infinity and fillers are told apart; variances may be the squares of what is allowed.
#[test]
fn numbers_beyond_navigation_are_named() {
    assert_eq!(require_finite("x", 5, &[1.0, -0.99e12]), Ok(()));
    for missing in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(text(require_finite("x", 5, &[0.0, missing])).starts_with("x at 5 ns is not finite"));
    }
    let filler = text(require_finite("x", 5, &[0.0, -1e20]));
    assert_eq!(
        filler,
        "x at 5 ns is -1e20, expected less than 1e12 in SI units: a filler for a missing value?"
    );
    assert_eq!(require_finite_squares("x", 5, &[1e20]), Ok(()));
    assert!(require_finite_squares("x", 5, &[1e30]).is_err());
}

/// A standard deviation is a number between its least value and 1e12.
#[test]
fn deviations_are_in_range() {
    assert_eq!(
        (require_positive("s", 1e-3), require_non_negative("s", 0.0)),
        (Ok(()), Ok(()))
    );
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            text(require_positive("s", value)).ends_with("expected a finite number > 0"),
            "{value}"
        );
    }
    for value in [-1e-300, f64::NAN, f64::NEG_INFINITY] {
        assert!(
            text(require_non_negative("s", value)).ends_with("expected a finite number >= 0"),
            "{value}"
        );
    }
    assert!(text(require_positive("s", 1e36)).contains("a filler"));
    assert!(text(require_non_negative("s", 1e12)).contains("a filler"));
}

/// Of any two accepted times the difference is an integer of 64 bits.
#[test]
fn times_have_a_span() {
    let last = (1_i64 << 62) - 1;
    assert_eq!(
        (require_time("imu", last), require_time("imu", -last)),
        (Ok(()), Ok(()))
    );
    assert!(last.checked_sub(-last).is_some());
    for time_ns in [last + 1, i64::MAX, i64::MIN] {
        assert!(text(require_time("imu", time_ns)).contains("more than 146 years from 0"));
    }
}
