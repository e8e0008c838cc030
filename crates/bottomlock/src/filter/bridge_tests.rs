//! The law of a bridged interval, by hand.

use super::*;
use crate::testing::*;

/// By hand: 2 s at 0.5 m/s² and 0.1 rad/s are 0.5 (m/s)²/s and 0.02 rad²/s; 10 s and a nanosecond are too long.
#[test]
fn densities_and_the_longest_gap() {
    let limits = ImuLimits::default();
    let noise = BridgeNoise::between(1_000_000_000, 3_000_000_000, &limits).unwrap();
    assert!(
        (noise.accel - 0.5).abs() < 1e-15 && (noise.gyro - 0.02).abs() < 1e-15,
        "{noise:?}"
    );
    assert!(BridgeNoise::between(0, 10_000_000_000, &limits).is_ok());
    let error = BridgeNoise::between(0, 10_000_000_001, &limits)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("10000000001 ns") && error.contains("10.000000 s or less"),
        "{error}"
    );
    // The ends of time lie further apart than an int64 counts.
    assert!(BridgeNoise::between(i64::MIN, i64::MAX, &limits).is_err());
}

/// A vehicle at rest without any other uncertainty, after 2 s without readings, at both rates of the covariance: velocity
/// σ_f T = 1 m/s, attitude σ_ω T = 0.2 rad, position σ_f T²/√2 = √2 m down, where no tilt reaches. The noise of the model
/// counts again afterwards.
#[test]
fn uncertainty_after_two_seconds() {
    let mut model = Model::table_2();
    model.imu = crate::model::ImuModel::default();
    model.initial = crate::model::InitialModel::default();
    model.environment.earth_rate_radps = 0.0;
    for covariance_period_ns in [0, 100_000_000] {
        let options = Options {
            covariance_period_ns,
            ..Options::default()
        };
        let mut filter = Eskf::new(NavState::at_rest(0), &model, &options).unwrap();
        let at = |time_ns| imu(time_ns, [0.0; 3], [0.0, 0.0, -model.environment.gravity_mps2]);
        filter.predict(&at(0), &at(10_000_000)).unwrap();
        let further = BridgeNoise::between(10_000_000, 2_010_000_000, &options.imu_limits).unwrap();
        let own = filter.begin_bridge(&further);
        filter.predict(&at(10_000_000), &at(2_010_000_000)).unwrap();
        filter.end_bridge(own);
        let sd = |k: usize| filter.covariance()[(k, k)].sqrt();
        assert!((sd(VELOCITY + 2) - 1.0).abs() < 1e-12, "{}", sd(VELOCITY + 2));
        assert!((sd(ATTITUDE) - 0.2).abs() < 1e-12 && (sd(ATTITUDE + 2) - 0.2).abs() < 1e-12);
        assert!(
            (sd(POSITION + 2) - 2.0_f64.sqrt()).abs() < 1e-12,
            "{}",
            sd(POSITION + 2)
        );
        // A tilt of σ_ω T/√2 at the start turns gravity: g σ_ω T²/√2 of velocity beside σ_f T, and no less.
        let tilted = (0.2_f64.powi(2) / 2.0 * (2.0 * model.environment.gravity_mps2).powi(2) + 1.0).sqrt();
        assert!((sd(VELOCITY) - tilted).abs() < 1e-9, "{} {tilted}", sd(VELOCITY));
        let before = filter.covariance()[(VELOCITY + 2, VELOCITY + 2)];
        filter.predict(&at(2_010_000_000), &at(2_020_000_000)).unwrap();
        assert_eq!(
            filter.covariance()[(VELOCITY + 2, VELOCITY + 2)],
            before,
            "noise of the gap goes on"
        );
    }
}
