//! Updates with the verdict of another filter, and when a filter's covariance excludes another's velocity.

use super::*;
use crate::testing::*;

/// σ of each axis of the velocity, m/s.
const SD: f64 = 0.5;

/// A filter at a speed, with the deviation of its velocity and of its attitude.
fn filter(gate: Gate, speed_mps: f64, attitude_sd_rad: f64) -> Eskf {
    let mut model = Model::table_2();
    model.initial.velocity_sd_mps = [SD; 3];
    model.initial.attitude_sd_rad = [attitude_sd_rad; 3];
    let options = Options {
        gate,
        ..Options::default()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(speed_mps, 0.0, 0.0);
    Eskf::new(state, &model, &options).unwrap()
}

const JOINT: Gate = Gate::Joint;

/// Surge and sway, off by so many σ of the innovation.
fn measured(sigmas: [f64; 2]) -> Innovation {
    velocity_rows(&sigmas.map(|sigma| sigma * SD * 2_f64.sqrt()), SD * SD)
}

/// Rows that the other filter accepted are used, whatever the own gate says, and no others; the gate is there again afterwards.
#[test]
fn the_verdict_is_the_others() {
    let wild = measured([10.0, 8.0]);
    let moved = |verdict| {
        let mut filter = filter(JOINT, 2.0, 1e-3);
        let is_plausible = filter.update_with_verdict(&wild, Sensor::Beams, verdict).unwrap();
        let variances = [0, 1].map(|k| filter.covariance()[(VELOCITY + k, VELOCITY + k)] / (SD * SD));
        let report = filter.update(&wild, Sensor::Beams).unwrap();
        assert_eq!(report.verdict, Verdict::Rejected);
        (is_plausible, variances)
    };
    let close = |got: [f64; 2], expected: [f64; 2]| (0..2).all(|k| (got[k] - expected[k]).abs() < 1e-9);
    let (is_plausible, variances) = moved(Verdict::Accepted);
    assert!(!is_plausible && close(variances, [0.5, 0.5]), "{variances:?}");
    let (is_plausible, variances) = moved(Verdict::AcceptedInPart { rejected_rows: 0b10 });
    assert!(!is_plausible && close(variances, [0.5, 1.0]), "{variances:?}");
    let (is_plausible, variances) = moved(Verdict::AcceptedInPart { rejected_rows: 0b01 });
    assert!(!is_plausible && close(variances, [1.0, 0.5]), "{variances:?}");
    for verdict in [Verdict::Rejected, Verdict::NoInformation, Verdict::Withheld] {
        assert!(close(moved(verdict).1, [1.0, 1.0]));
    }
}

/// Plausible is what lies within the gate of 99.73 % with as many degrees as rows were used, 11.83 of two: also of a filter whose
/// gate is off.
#[test]
fn plausible_is_within_the_joint_gate() {
    for gate in [JOINT, Gate::Off, Gate::PerRow] {
        for (squares, is_plausible) in [(11.7, true), (12.0, false)] {
            let each = (squares / 2.0_f64).sqrt();
            let mut filter = filter(gate, 2.0, 1e-3);
            let outcome = filter.update_with_verdict(&measured([each; 2]), Sensor::Beams, Verdict::Accepted);
            assert_eq!(outcome, Ok(is_plausible), "{gate:?}, {squares}");
        }
    }
}

/// 30.665 is 5.54 σ along an axis. With its gate off a filter excludes nothing, nor beyond the linear range.
#[test]
fn a_velocity_is_excluded_beyond_the_bound() {
    let excludes = |gate, attitude_sd_rad, sigmas: f64| {
        let other = filter(JOINT, 2.0 + sigmas * SD, 1e-3);
        filter(gate, 2.0, attitude_sd_rad).excludes_velocity_of(&other)
    };
    assert_eq!(
        [0.0, 5.5, 5.6, -5.6].map(|sigmas| excludes(JOINT, 1e-3, sigmas)),
        [false, false, true, true]
    );
    assert!(excludes(Gate::PerRow, 1e-3, 6.0) && !excludes(Gate::Off, 1e-3, 6.0));
    let lost = filter(JOINT, 2.0, 1.0);
    assert!(lost.is_beyond_linear_range() && !excludes(JOINT, 1.0, 6.0));
}

/// The covariance as an update will find it.
#[test]
fn the_covariance_is_propagated() {
    let mut filter = filter(JOINT, 2.0, 1e-3);
    crate::filter::level_turn::advance(&mut filter, 25);
    let expected = filter.covariance();
    assert_eq!(filter.propagated_covariance(), expected);
    assert!(expected[(0, 0)] > Model::table_2().initial_covariance(true)[(0, 0)]);
}
