//! Considered errors of the inertial sensors: by hand, and against strapdown steps with readings that have them.

use std::f64::consts::{PI, TAU};

use nalgebra::Matrix6;

use super::*;
use crate::filter::level_turn::assert_close;
use crate::filter::tape::transition;
use crate::model::InitialModel;
use crate::testing::*;

const SCALE: f64 = 3e-4;
const MISALIGNMENT: f64 = 1e-3;
const STEP_NS: i64 = 10_000_000;

const BY_FORCE: f64 = 1e-5;
const ACCEL_SCALE: f64 = 1e-3;
/// Scale factors and misalignments of the gyros alone.
const GYROS: [f64; 4] = [SCALE, MISALIGNMENT, 0.0, 0.0];
const ALL: [f64; 4] = [SCALE, MISALIGNMENT, BY_FORCE, ACCEL_SCALE];

/// A filter at 2 m/s that knows everything but the considered errors, on an Earth that does not turn.
fn filter([scale, misalignment, by_force, accel_scale]: [f64; 4], period_ns: i64) -> Eskf {
    let mut model = Model::table_2();
    model.environment = Environment {
        earth_rate_radps: 0.0,
        ..model.environment
    };
    model.imu = ImuModel {
        gyro_scale_sd: scale,
        gyro_misalignment_sd_rad: misalignment,
        gyro_g_sensitivity_sd_radps_per_mps2: by_force,
        accel_scale_sd: accel_scale,
        ..ImuModel::default()
    };
    model.initial = InitialModel {
        position_sd_m: [1e-6; 3],
        attitude_sd_rad: [1e-6; 3],
        velocity_sd_mps: [1e-6; 3],
    };
    let mut start = NavState::at_rest(0);
    start.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let options = Options {
        covariance_period_ns: period_ns,
        estimate_dvl: false,
        ..Options::default()
    };
    Eskf::new(start, &model, &options).unwrap()
}

/// Readings for `steps` steps at a rate about each axis, with what a matrix adds to force and rate, by rate and force.
fn readings(first: i64, steps: i64, rate: [f64; 3], matrix: &Matrix6<f64>) -> Vec<ImuSample> {
    let (rate, force) = (Vector3::from(rate), Vector3::new(0.1, 0.2, -9.6));
    let from_level = force + Vector3::z() * Model::table_2().environment.gravity_mps2;
    let added = matrix * SVector::<f64, 6>::from_fn(|k, _| if k < 3 { rate[k] } else { from_level[k - 3] });
    let sample = |k: i64| ImuSample {
        time_ns: k * STEP_NS,
        rate_p_radps: (rate + added.fixed_rows::<3>(3)).into(),
        force_p_mps2: (force + added.fixed_rows::<3>(0)).into(),
    };
    (first..=first + steps).map(sample).collect()
}

/// Variances of roll, pitch and yaw after turns about the vertical, each an angle in 10 s.
fn after_turns(filter: &mut Eskf, turns: &[f64]) -> [f64; 3] {
    for (first, angle) in (0..).step_by(1000).zip(turns) {
        let samples = readings(first, 1000, [0.0, 0.0, angle / 10.0], &Matrix6::zeros());
        filter.predict_along(&samples).unwrap();
    }
    let covariance = filter.covariance();
    std::array::from_fn(|k| covariance[(ATTITUDE + k, ATTITUDE + k)])
}

/// A turn by θ tilts by δ √(2 − 2 cos θ) about each level axis, and turns the yaw by s θ. A whole turn takes the tilt back,
/// a turn to the other side everything, and two turns to the same side add up.
#[test]
fn turns_by_hand() {
    for period_ns in [0, 100_000_000] {
        for (turns, tilt, yaw) in [
            (&[PI][..], 4.0, PI),
            (&[TAU], 0.0, TAU),
            (&[PI, -PI], 0.0, 0.0),
            (&[PI, PI], 0.0, TAU),
            (&[1.0], 2.0 - 2.0 * 1.0_f64.cos(), 1.0),
        ] {
            let found = after_turns(&mut filter(GYROS, period_ns), turns);
            let expected = [tilt, tilt, (yaw * SCALE / MISALIGNMENT).powi(2)];
            for (found, expected) in found.iter().zip(expected) {
                let error = found / MISALIGNMENT.powi(2) - expected;
                assert!(
                    error.abs() < 2e-3 * (1.0 + expected),
                    "{turns:?}: {error} of {expected}"
                );
            }
        }
    }
}

/// The covariance is that of the differences which each element of m makes in strapdown steps, in any turn, with every pair of
/// position, attitude and velocity.
#[test]
fn covariance_is_that_of_wrong_readings() {
    let tiny = 1e-7;
    let rate = [0.2, -0.1, 0.3];
    let run = |matrix: &Matrix6<f64>| {
        let mut filter = filter(ALL, 100_000_000);
        filter.predict_along(&readings(0, 300, rate, matrix)).unwrap();
        filter
    };
    let right = run(&Matrix6::zeros());
    let mut expected = Covariance::zeros();
    let mut consider = |row: usize, column: usize, sd: f64| {
        let mut matrix = Matrix6::zeros();
        matrix[(row, column)] = tiny;
        let error = right.state().error_of(&run(&matrix).state()) / tiny;
        expected += error * error.transpose() * (sd * sd);
    };
    for axis in 0..3 {
        consider(axis, 3 + axis, ACCEL_SCALE);
        for other in 0..3 {
            consider(3 + axis, other, if axis == other { SCALE } else { MISALIGNMENT });
            consider(3 + axis, 3 + other, BY_FORCE);
        }
    }
    let found = right.covariance();
    for i in (POSITION..VELOCITY + 3).filter(|i| expected[(*i, *i)] > 0.0) {
        for j in POSITION..VELOCITY + 3 {
            let size = (expected[(i, i)] * expected[(j, j)]).sqrt();
            let difference = found[(i, j)] - expected[(i, j)];
            assert!(difference.abs() < 0.01 * size, "({i}, {j}): {difference} of {size}");
        }
    }
}

/// What gravity adds while the vehicle is level is part of the biases: nothing is left to be considered.
#[test]
fn a_level_vehicle_has_its_biases_alone() {
    let gravity = Model::table_2().environment.gravity_mps2;
    let sample = |k: i64| imu(k * STEP_NS, [0.0; 3], [0.0, 0.0, -gravity]);
    let after = |sd: [f64; 4]| {
        let mut own = filter(sd, 100_000_000);
        own.predict_along(&(0..=1000).map(sample).collect::<Vec<_>>()).unwrap();
        own.covariance()
    };
    let added = after([0.0, 0.0, BY_FORCE, ACCEL_SCALE]) - after([0.0; 4]);
    assert!(added.amax() < 1e-12, "{}", added.amax());
}

/// A heading after a turn corrects the yaw and leaves M as unknown as it was; the covariance knows that the yaw's error is M's.
#[test]
fn nothing_is_learnt_of_them() {
    let mut own = filter(GYROS, 0);
    after_turns(&mut own, &[PI]);
    let before = own.extensions.covariance_of::<CONSIDERED>(MATRIX.start);
    let [_, _, yaw] = own.state().attitude_t_p.to_euler_rad();
    let reading = heading(&Motion::still(&own.state()), yaw + 1e-3, 1e-4);
    own.update(&reading, Sensor::Heading).unwrap();
    assert_eq!(own.extensions.covariance_of::<CONSIDERED>(MATRIX.start), before);
    // σ of the yaw is s π before, and with the heading's that of a mean of the two.
    let prior = (SCALE * PI).powi(2);
    let expected = 1.0 / (1.0 / prior + 1e8);
    assert!((own.covariance()[(ATTITUDE + 2, ATTITUDE + 2)] / expected - 1.0).abs() < 0.01);
    assert!(own.extensions.further().cross()[(ATTITUDE + 2, MATRIX.start + 8)].abs() < SCALE.powi(2) * PI * 0.02);
}

/// The transition of a smoother's tape, applied to the covariance of all states before, gives that after.
#[test]
fn a_tape_has_the_same_transition() {
    let mut own = filter(ALL, 10_000_000_000);
    own.predict_along(&readings(0, 300, [0.2, -0.1, 0.3], &Matrix6::zeros()))
        .unwrap();
    own.propagate_covariance();
    let before = own.joint_covariance();
    own.predict_along(&readings(300, 300, [0.1, 0.2, -0.3], &Matrix6::zeros()))
        .unwrap();
    let phi = transition(&own.interval, &own.kinematics, &own.earth, &own.extensions);
    let expected = &phi * before * phi.transpose();
    assert_close(&own.joint_covariance(), &expected, 1e-9, "after a turn");
}
