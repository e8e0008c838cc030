//! The strapdown step by hand, and in lanes.

use super::*;
use crate::earth::{Earth, EarthModel, Environment, in_lanes};
use crate::simd::{Lanes, Simd, f64x4, f64x8, on_one_level, scatter};
use crate::testing::*;

fn still_earth() -> EarthTerms<f64> {
    EarthTerms {
        rate_t: [0.0; 3],
        gravity_t: [0.0, 0.0, 9.8],
        gradient_t: None,
    }
}

/// Hand-worked: at rest the accelerometer reads −g and nothing moves.
#[test]
fn rest_stays_at_rest() {
    let mut kinematics = Kinematics::new([0.0; 3], [1.0, 0.0, 0.0, 0.0], [0.0; 3]);
    let inertial = Inertial {
        rate_p_radps: [0.0; 3],
        force_p_mps2: [0.0, 0.0, -9.8],
    };
    for _ in 0..1000 {
        kinematics.step(&inertial, &inertial, 0.01, &still_earth());
    }
    assert!(kinematics.velocity_p_mps.iter().all(|v| v.abs() < 1e-12));
    assert!(kinematics.position_t_m.iter().all(|r| r.abs() < 1e-12));
}

/// A steady turn: centripetal force u·r to starboard brings the vehicle back to its start after one circle; the
/// trapezoid leaves (r·dt)²/12 of the way, 2.1 µm.
#[test]
fn steady_turn_closes_the_circle() {
    let (speed, rate, steps) = (2.0, 0.05, 20_000);
    let dt = 2.0 * std::f64::consts::PI / rate / f64::from(steps);
    let mut kinematics = Kinematics::new([0.0; 3], [1.0, 0.0, 0.0, 0.0], [speed, 0.0, 0.0]);
    let inertial = Inertial {
        rate_p_radps: [0.0, 0.0, rate],
        force_p_mps2: [0.0, speed * rate, -9.8],
    };
    for step in 0..steps {
        if step == steps / 2 {
            // Across the circle, 2 u/r to starboard.
            assert!((kinematics.position_t_m[1] - 2.0 * speed / rate).abs() < 2.1e-6);
        }
        kinematics.step(&inertial, &inertial, dt, &still_earth());
    }
    assert!(
        kinematics.position_t_m.iter().all(|r| r.abs() < 2.1e-6),
        "{:?}",
        kinematics.position_t_m
    );
    assert!((kinematics.velocity_p_mps[0] - speed).abs() < 1e-9);
}

/// Large rotations leave the series and stay right: half a turn about z, and both sides of the limit.
#[test]
fn exponential_of_any_angle() {
    let q = quaternion_exp([0.0, 0.0, std::f64::consts::PI]);
    assert!(q[0].abs() < 1e-15 && (q[3] - 1.0).abs() < 1e-15);
    for angle in [1e-9, 0.01, 0.19999, 0.2, 0.200_01, 0.9, 6.0] {
        let q = quaternion_exp([0.0, angle, 0.0]);
        let (sine, cosine) = (0.5_f64 * angle).sin_cos();
        assert!((q[0] - cosine).abs() < 2e-16 && (q[2] - sine).abs() < 2e-16, "{angle}");
    }
}

/// The quaternion stays a unit quaternion over a million steps, without a root.
#[test]
fn attitude_keeps_its_norm() {
    let earth = EarthTerms::from(&Environment::normal(0.57, 0.0));
    let mut kinematics = Kinematics::new([0.0; 3], [0.6, 0.1, -0.3, 0.7], [1.0, 0.0, 0.0]);
    let inertial = Inertial {
        rate_p_radps: [0.3, -0.2, 0.5],
        force_p_mps2: [0.1, 0.2, -9.8],
    };
    for _ in 0..1_000_000 {
        kinematics.step(&inertial, &inertial, 1.0 / 150.0, &earth);
    }
    assert!((squared_norm(kinematics.attitude_t_p) - 1.0).abs() < 1e-15);
}

fn turning<S: Simd, T: Lanes<S>>(simd: S) {
    let earth = Earth::from(&Environment::normal(0.57, 0.0).on(EarthModel::Ellipsoid)).terms([3e4, -4e4, 200.0]);
    // The last lane turns so fast that it leaves the series; its neighbours must not notice.
    let rate = |k: usize| [0.01 * k as f64, -0.02, if k + 1 == T::COUNT { 200.0 } else { 0.05 }];
    let force = |k: usize| [0.1, 0.02 * k as f64, -9.8];
    let zero = T::gather(simd, |_| 0.0);
    let mut lanes = Kinematics::new(
        [zero; 3],
        [1.0, 0.1, 0.0, -0.3].map(|q| zero.splat(q)),
        [2.0, 0.0, 0.1].map(|v| zero.splat(v)),
    );
    let inertial = Inertial {
        rate_p_radps: std::array::from_fn(|i| T::gather(simd, |k| rate(k)[i])),
        force_p_mps2: std::array::from_fn(|i| T::gather(simd, |k| force(k)[i])),
    };
    for _ in 0..50 {
        lanes.step(&inertial, &inertial, 1.0 / 150.0, &in_lanes(&earth, zero));
    }
    for k in 0..T::COUNT {
        let mut one = Kinematics::new([0.0; 3], [1.0, 0.1, 0.0, -0.3], [2.0, 0.0, 0.1]);
        let inertial = Inertial {
            rate_p_radps: rate(k),
            force_p_mps2: force(k),
        };
        for _ in 0..50 {
            one.step(&inertial, &inertial, 1.0 / 150.0, &earth);
        }
        let own: [f64; KINEMATICS] = scatter(&lanes.to_array(), k);
        assert_eq!(own.map(f64::to_bits), one.to_array().map(f64::to_bits), "lane {k}");
    }
}

/// Filters side by side give the bits of scalar filters; with other vectors too, by the tests of filter groups.
#[test]
fn lanes_equal_scalars_bit_for_bit() {
    on_one_level!(simd => turning::<_, f64x4<_>>(simd));
    on_one_level!(simd => turning::<_, f64x8<_>>(simd));
}

/// A rate that changes linearly, whose direction moves: one step of 0.1 s against a thousand steps that need no coning term.
///
/// The term is 2e-4 rad here; with the other sign the step would be wrong by twice as much.
#[test]
fn coning_of_a_linear_rate() {
    let (first, last, duration) = ([0.5, 0.0, 0.2], [0.0, 0.6, -0.1], 0.1);
    let at = |part: f64| Inertial {
        rate_p_radps: std::array::from_fn(|i| first[i] * (1.0 - part) + last[i] * part),
        force_p_mps2: [0.0, 0.0, -9.8],
    };
    let start = Kinematics::new([0.0; 3], [0.6, 0.1, -0.3, 0.7], [1.0, 0.0, 0.0]);
    let (mut coarse, mut fine) = (start, start);
    coarse.step(&at(0.0), &at(1.0), duration, &still_earth());
    for n in 0..1000 {
        let (from, to) = (f64::from(n) / 1000.0, f64::from(n + 1) / 1000.0);
        fine.step(&at(from), &at(to), duration / 1000.0, &still_earth());
    }
    let gap = (0..4).fold(0.0_f64, |most, i| {
        most.max((coarse.attitude_t_p[i] - fine.attitude_t_p[i]).abs())
    });
    assert!(gap < 1e-6, "{gap}");
}

/// Fixed to the Earth the gyros read its rate and the accelerometers minus gravity: nothing moves, whatever the attitude.
#[test]
fn what_is_fixed_to_the_earth_stays() {
    let earth = EarthTerms {
        rate_t: [3e-3, 1e-3, -2e-3],
        gravity_t: [0.0, 0.0, 9.8],
        gradient_t: None,
    };
    for attitude_t_p in [[1.0, 0.0, 0.0, 0.0], [0.5, -0.5, 0.5, 0.5], [0.8, 0.0, 0.0, 0.6]] {
        let start = Kinematics::new([0.0; 3], attitude_t_p, [0.0; 3]);
        let inertial = Inertial {
            rate_p_radps: tmul(&start.rotation_t_p, earth.rate_t),
            force_p_mps2: tmul(&start.rotation_t_p, [0.0, 0.0, -9.8]),
        };
        let mut kinematics = start;
        for _ in 0..1000 {
            kinematics.step(&inertial, &inertial, 0.01, &earth);
        }
        let moved = kinematics.to_array().into_iter().zip(start.to_array());
        assert!(moved.map(|(now, then)| (now - then).abs()).fold(0.0, f64::max) < 1e-9);
    }
}

/// Without force but gravity's, 10 m/s to the north over an Earth that turns by w about the vertical: −2ω × v is −20 w to the east.
#[test]
fn coriolis_by_hand() {
    let (turn, dt) = (1e-3, 0.01);
    let earth = EarthTerms {
        rate_t: [0.0, 0.0, turn],
        gravity_t: [0.0, 0.0, 9.8],
        gradient_t: None,
    };
    let mut kinematics = Kinematics::new([0.0; 3], [1.0, 0.0, 0.0, 0.0], [10.0, 0.0, 0.0]);
    let inertial = Inertial {
        rate_p_radps: [0.0, 0.0, turn],
        force_p_mps2: [0.0, 0.0, -9.8],
    };
    kinematics.step(&inertial, &inertial, dt, &earth);
    let east = -20.0 * turn * dt;
    assert!((kinematics.velocity_t_mps[1] - east).abs() < 1e-3 * east.abs());
    assert!((kinematics.velocity_t_mps[0] - 10.0).abs() < 1e-8 && kinematics.velocity_t_mps[2].abs() < 1e-12);
    assert!((kinematics.position_t_m[1] - 0.5 * east * dt).abs() < 1e-3 * (east * dt).abs());
}

/// A quarter of the way between two samples.
#[test]
fn a_sample_between_two() {
    let sample = |time_ns, rate: [f64; 3], force: [f64; 3]| imu(time_ns, rate, force);
    let start = sample(1000, [0.0, 4.0, -8.0], [8.0, 0.0, 4.0]);
    let end = sample(5000, [4.0, 0.0, 0.0], [0.0, 4.0, 8.0]);
    let expected = sample(2000, [1.0, 3.0, -6.0], [6.0, 1.0, 5.0]);
    assert_eq!(ImuSample::between(&start, &end, 2000), expected);
    assert_eq!(ImuSample::between(&start, &end, 5000), end);
}
