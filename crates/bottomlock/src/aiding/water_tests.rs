//! The rows by hand, against differences, and blind to the yaw.

use super::*;
use crate::testing::*;

const EARTH: [f64; 3] = [6.1e-5, 0.0, -4.0e-5];

pub(in crate::aiding) fn motion(state: &NavState, rate_p_radps: [f64; 3]) -> Motion<'_> {
    Motion {
        rate_ip_p_radps: Vector3::from(rate_p_radps) - state.gyro_bias_p_radps.0,
        earth_rate_t_radps: Vector3::from(EARTH),
        gyro_variance: 1e-6,
        ..Motion::still(state)
    }
}

pub(in crate::aiding) fn example(pitch_deg: f64) -> (NavState, WaterVector) {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.4, pitch_deg.to_radians(), -1.1);
    state.velocity_p_mps = Vec3::new(2.0, 0.2, -0.1);
    state.gyro_bias_p_radps = Vec3::new(1e-3, 2e-3, -1e-3);
    (state, WaterVector::from([0.3, -0.2, 0.7, 0.02, -0.01, 0.015]))
}

type RowOf = fn(&Motion<'_>, &WaterVector) -> WaterRow;
const ROWS: [(&str, RowOf); 2] = [("sway", sway_row), ("heave", heave_row)];

/// Hand-worked: heading north at 2 m/s in a current of 0.3 m/s to the east the sway over ground is 0.3; turning to starboard at
/// 0.05 rad/s about a pivot 0.6 m ahead takes 0.03 from it. Heading east, a current of 0.2 m/s to the north pushes to port.
#[test]
fn a_cross_current_and_a_turn_by_hand() {
    let mut state = NavState::at_rest(0);
    let still = |state: &NavState, rate: [f64; 3], water: &WaterVector| {
        let motion = Motion {
            earth_rate_t_radps: Vector3::zeros(),
            ..motion(state, rate)
        };
        sway_row(&motion, water).residual
    };
    let mut water = WaterVector::from([0.0, 0.3, 0.6, 0.0, 0.0, 0.0]);
    state.velocity_p_mps = Vec3::new(2.0, 0.3, 0.0);
    assert!(still(&state, [0.0; 3], &water).abs() < 1e-15);
    state.velocity_p_mps = Vec3::new(2.0, 0.27, 0.0);
    assert!(still(&state, [0.0, 0.0, 0.05], &water).abs() < 1e-15);
    assert!((still(&state, [0.0; 3], &water) - 0.03).abs() < 1e-15);

    state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    state.velocity_p_mps = Vec3::new(2.0, -0.2, 0.0);
    water[CURRENT] = 0.2;
    assert!(still(&state, [0.0; 3], &water).abs() < 1e-15);
}

/// Bow down by 30° a current ahead of 0.4 m/s has a part of 0.2 m/s along the platform's vertical; the trim adds to it.
#[test]
fn heave_by_hand() {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.0, -30.0_f64.to_radians(), 0.0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, -0.2 - 0.014);
    let water = WaterVector::from([0.4, 0.0, 0.6, -0.014, 0.0, 0.0]);
    let row = heave_row(&motion(&state, [0.0; 3]), &water);
    assert!(row.residual.abs() < 1e-15, "{}", row.residual);
}

/// H against central differences when the estimate moves, also where the vehicle stands on end.
#[test]
fn rows_are_the_derivatives() {
    for pitch in [0.0, 12.0, -70.0, 89.9, -89.9, 90.0] {
        let (state, water) = example(pitch);
        for (name, row_of) in ROWS {
            let at = |error: &ErrorVector, by: &WaterVector| {
                let (mut state, mut moved) = (state, Water::common(&water));
                state.inject(error);
                moved.inject(error[ATTITUDE + 2], by, &LayerVector::zeros());
                row_of(&motion(&state, [0.1, -0.2, 0.3]), &moved.estimate)
            };
            let (row, place) = (
                at(&ErrorVector::zeros(), &WaterVector::zeros()),
                format!("{name}, {pitch}"),
            );
            let residual = |row: WaterRow| SVector::from([row.residual]);
            assert_slopes(&place, &row.by_state.transpose(), [1e-5, 1e-9], |error| {
                residual(at(error, &WaterVector::zeros()))
            });
            assert_slopes(&place, &row.by_water.transpose(), [1e-5, 1e-9], |by| {
                residual(at(&ErrorVector::zeros(), by))
            });
        }
    }
}

/// For any estimate of the current, no row has information on yaw beyond the Earth's rotation.
#[test]
fn the_yaw_is_not_learned() {
    for current in [[0.0, 0.0], [0.3, -0.2], [-1.0, 2.0]] {
        let (state, mut water) = example(5.0);
        (water[CURRENT], water[CURRENT + 1]) = (current[0], current[1]);
        for (name, row_of) in ROWS {
            let row = row_of(&motion(&state, [0.1, -0.2, 0.3]), &water);
            assert!(row.by_state[ATTITUDE + 2].abs() < 1e-4, "{name}");
        }
    }
}

/// A state with a correlation time falls to 1/e in it; k is a constant of the vehicle.
#[test]
fn decay_by_hand() {
    let prior = WaterPrior {
        current_time_s: 100.0,
        trim_time_s: 50.0,
        slip_time_s: 25.0,
        ..WaterPrior::default()
    };
    let expected = [-1.0, -1.0, 0.0, -2.0, -4.0, -4.0].map(f64::exp);
    let left = WaterVector::from(prior.processes().map(|process| process.left(100.0)));
    assert!((left - WaterVector::from(expected)).amax() < 1e-15);
}

/// A yaw corrected by a quarter turn turns a current of (3, 1) to (−1, 3), and the errors add to it.
#[test]
fn the_current_turns_with_the_yaw() {
    let mut water = Water::common(&[3.0, 1.0, 0.5, 0.1, 0.2, 0.3].into());
    let error = WaterVector::from([0.25, 0.5, 0.125, 0.0, 0.0, -0.3]);
    water.inject(std::f64::consts::FRAC_PI_2, &error, &LayerVector::zeros());
    let expected = WaterVector::from([-0.75, 3.5, 0.625, 0.1, 0.2, 0.0]);
    assert!((water.estimate - expected).amax() < 1e-15, "{water:?}");
}

/// k times the rate of the turn, whose noise is k² of the gyro's; nothing is left out of the rates but the Earth's.
#[test]
fn turning_by_hand() {
    let state = NavState::at_rest(0);
    let motion = Motion {
        earth_rate_t_radps: Vector3::zeros(),
        ..motion(&state, [0.2, -0.4, 0.8])
    };
    let water = WaterVector::from([0.0, 0.0, 0.5, 0.0, 0.0, 0.0]);
    let (sway, heave) = (sway_row(&motion, &water), heave_row(&motion, &water));
    assert!((sway.turning_mps - 0.4).abs() < 1e-15 && (heave.turning_mps + 0.2).abs() < 1e-15);
    assert!((sway.variance - 0.25e-6).abs() < 1e-20 && heave.variance == 0.0);
    assert_eq!(sway.by_water[GAIN], 0.8);
}
