//! The verdict of the gate on either side of its threshold.

use super::*;
use crate::testing::*;

/// The verdict on a depth whose residual has the given square over its variance; σ of the state is 2 m, of the sensor 0.5 m.
fn verdict(gate: Gate, nis: f64) -> (Verdict, f64) {
    let options = Options {
        gate,
        gate_probability: 0.99,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    let depth_m = (nis * 4.25).sqrt();
    let innovation = depth(&Motion::still(&filter.state()), depth_m, 0.5, &Vec3::zeros());
    let report = filter.update(&innovation, Sensor::Depth).unwrap();
    (report.verdict, report.nis)
}

/// The tabulated 99 % quantile of chi-squared with one degree of freedom, 6.6349, and the three sigma of the papers.
#[test]
fn the_gate_begins_at_its_threshold() {
    for (gate, threshold) in [(Gate::Joint, 6.634_896_6), (Gate::PerRow, 9.0)] {
        for (factor, expected) in [(0.999, Verdict::Accepted), (1.001, Verdict::Rejected)] {
            let (verdict, nis) = verdict(gate, factor * threshold);
            assert_eq!(verdict, expected, "{gate:?}, {factor} of the threshold");
            assert!((nis / (factor * threshold) - 1.0).abs() < 1e-12);
        }
    }
    assert_eq!(verdict(Gate::Off, 1e6).0, Verdict::Accepted);
}

/// Row by row the gate rejects the wild one of three, and the others are used as if it had not been there.
#[test]
fn rows_are_rejected_one_by_one() {
    let options = Options {
        gate: Gate::PerRow,
        ..Options::default()
    };
    let filter = || Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    for wild in 0..3 {
        let residual = |row| if row == wild { 5.0 } else { 0.01 * (row as f64 + 1.0) };
        let innovation = velocity_rows(&[0, 1, 2].map(residual), 0.01);
        let (mut whole, mut others) = (filter(), filter());
        let report = whole.update(&innovation, Sensor::Velocity).unwrap();
        assert_eq!(
            report.verdict,
            Verdict::AcceptedInPart {
                rejected_rows: 1 << wild
            }
        );
        others
            .update(&innovation.select(|row| row != wild), Sensor::Velocity)
            .unwrap();
        assert_eq!(
            (whole.state(), whole.covariance()),
            (others.state(), others.covariance())
        );
        let both = Innovation {
            residual: innovation.residual.map(|_| 5.0),
            ..innovation
        };
        assert_eq!(
            filter().update(&both, Sensor::Velocity).unwrap().verdict,
            Verdict::Rejected
        );
    }
}

/// A velocity in the platform frame is noted, for the coordinates in which the path is linear; nothing else is.
#[test]
fn velocities_of_the_platform_are_noted() {
    let noted = |innovation: &Innovation, sensor| {
        let mut filter = Eskf::new(NavState::at_rest(9), &Model::table_2(), &Options::default()).unwrap();
        assert!(filter.update(innovation, sensor).unwrap().was_used());
        filter.measured.velocity_ns
    };
    let state = NavState::at_rest(9);
    let fix = crate::aiding::velocity::velocity(&state, &Vec3::zeros(), &nalgebra::Matrix3::identity());
    assert_eq!(noted(&fix, Sensor::Velocity), Some(9));
    assert_eq!(noted(&fix, Sensor::Beams), Some(9));
    assert_eq!(
        noted(&depth(&Motion::still(&state), 0.0, 0.5, &Vec3::zeros()), Sensor::Depth),
        None
    );
    let in_tangent_frame = Innovation {
        tangent_rows: TangentRows::Velocity,
        ..fix
    };
    assert_eq!(noted(&in_tangent_frame, Sensor::GpsVelocity), None);
}
