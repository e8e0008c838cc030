//! Ranges and clipping, by hand.

use super::*;
use crate::testing::*;

fn reading(rate: [f64; 3], force: [f64; 3]) -> ImuSample {
    imu(0, rate, force)
}

/// By hand, at the default full scales of 10 rad/s and 100 m/s²: a converter of 16 bits ends at 32767/32768 of them.
#[test]
fn readings_at_and_beyond_the_full_scale() {
    let limits = ImuLimits::default();
    let kind = |rate: [f64; 3], force: [f64; 3]| limits.range_fault(&reading(rate, force)).map(|fault| fault.kind());
    let level = [0.0, 0.0, -9.8];
    assert_eq!(kind([0.0; 3], level), None);
    assert_eq!(kind([9.98, -9.98, 0.0], [0.0, 99.8, -99.8]), None);
    assert_eq!(kind([0.0; 3], [0.0, 100.0 * 32_767.0 / 32_768.0, 0.0]), Some(1));
    assert_eq!(kind([0.0, -10.0, 0.0], level), Some(1));
    assert!(!limits.is_in_range(&reading([0.0; 3], [0.0, CLIPPED_FROM * limits.max_force_mps2, 0.0])));
    assert_eq!(kind([0.0; 3], [1000.0, 0.0, -9.8]), Some(0));
    assert_eq!(kind([0.0, 0.0, -10.02], level), Some(0));
}

/// Of several axes the one that is furthest beyond is named.
#[test]
fn the_worst_axis_is_named() {
    let fault = ImuLimits::default()
        .range_fault(&reading([20.0, 0.0, 0.0], [0.0, -1000.0, 100.0]))
        .unwrap();
    assert_eq!(
        fault.to_string(),
        "specific force y is -1000 m/s², beyond the full scale of 100 m/s²: is it in mg or cm/s²?"
    );
    let clipped = ImuLimits::default()
        .range_fault(&reading([0.0, 0.0, 10.0], [0.0; 3]))
        .unwrap();
    assert_eq!(
        clipped.to_string(),
        "angular rate z is 10 rad/s, clipped at the full scale of 10 rad/s"
    );
}
