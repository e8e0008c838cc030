//! Terms of the beams and the methods' rows worked by hand, on three beams along the axes of the platform: beam k measures
//! component k.

use nalgebra::{Matrix3, Vector3, Vector4};

use super::*;
use crate::dvl::partial::{Assumptions, Component, PartialMethod, fix_estimator};
use crate::frames::Vec3;
use crate::testing::*;

const VELOCITY_P_MPS: [f64; 3] = [2.0, 0.5, -0.25];

fn geometry() -> BeamGeometry {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from_array);
    BeamGeometry::from_directions(&axes).unwrap()
}

fn state() -> NavState {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::from_array(VELOCITY_P_MPS);
    state
}

fn motion_of(state: &NavState) -> Motion<'_> {
    Motion {
        gyro_variance: 0.04,
        ..Motion::still(state)
    }
}

fn ping(beams: &[usize]) -> BeamSample {
    BeamSample {
        time_ns: 0,
        velocity_mps: [2.5, 1.5, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0],
        sd_mps: [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
        valid: beams.iter().copied().collect(),
    }
}

/// A clock of sound 25 % too fast divides reading and noise; the lever arms share the noise of the gyro.
#[test]
fn terms_of_beams_by_hand() {
    let levers = [[0.0, 2.0, 0.0], [1.0, 0.0, 3.0], [0.0, 1.0, 0.0]].map(Vec3::from_array);
    let geometry = geometry()
        .with_lever_arms(&levers)
        .unwrap()
        .with_sound_speed_scale(1.25)
        .unwrap();
    let mut state = state();
    state.dvl_scale_factor = 0.5;
    state.dvl_bias_mps = Vector4::new(0.01, 0.02, 0.03, 0.0);
    let terms = beam_terms(&motion_of(&state), &geometry, &ping(&[0, 1, 2]));
    let expected = [2.5 / 1.25 - 3.01, 1.5 / 1.25 - 0.77, -0.5 / 1.25 + 0.375 - 0.03];
    // Lever arm times direction: (0, 0, -2), (-3, 0, 1), (1, 0, 0).
    let arms = [[0.0, 0.0, -2.0], [-3.0, 0.0, 1.0], [1.0, 0.0, 0.0]].map(Vector3::from);
    for beam in 0..3 {
        assert!((terms.residual[beam] - expected[beam]).abs() < 1e-15, "{beam}");
        let row = terms.jacobian.row(beam);
        for k in 0..3 {
            assert_eq!(row[VELOCITY + k], if k == beam { 1.5 } else { 0.0 });
            assert_eq!(row[GYRO_BIAS + k], -arms[beam][k]);
        }
        for k in 0..BIASED_BEAMS {
            assert_eq!(row[DVL_BIAS + k], f64::from(k == beam));
        }
        assert_eq!(row[DVL_SCALE], VELOCITY_P_MPS[beam]);
        for other in 0..3 {
            let own = if beam == other {
                (0.1 * (beam as f64 + 1.0) / 1.25).powi(2)
            } else {
                0.0
            };
            let expected = own + 0.04 * arms[beam].dot(&arms[other]);
            assert!((terms.noise[(beam, other)] - expected).abs() < 1e-15, "{beam}, {other}");
        }
    }
}

/// The rows of a method with the beams of surge and heave; z and H stand on the velocity alone.
fn rows_of(
    method: PartialMethod,
    beams: &[usize],
    port: InformationPort,
    p_xv: Option<&SMatrix<f64, DIM, 3>>,
) -> (Innovation, FixEstimator) {
    let state = state();
    let terms = beam_terms(&motion_of(&state), &geometry(), &ping(beams));
    let prior = Matrix3::from_diagonal(&Vector3::new(1.0, 4.0, 9.0));
    let valid = beams.iter().copied().collect();
    let plan = fix_estimator(
        method,
        &geometry(),
        valid,
        &terms.noise,
        Some(&prior),
        &Assumptions::default(),
    )
    .unwrap();
    let innovation = loosely_coupled(&state, &geometry(), &terms, &plan, port, p_xv);
    (innovation, plan)
}

fn velocity_block(innovation: &Innovation) -> Matrix3<f64> {
    innovation.jacobian.fixed_view::<3, 3>(0, VELOCITY).into()
}

/// Surge and heave from their beams; sway is said to be zero, with the variance 1e-3.
#[test]
fn nullified_sway_by_hand() {
    let (row, _) = rows_of(PartialMethod::NullifiedSway, &[0, 2], InformationPort::Axes, None);
    assert_eq!((row.rows, row.degrees), (3, 3));
    assert!((row.residual.fixed_rows::<3>(0) - Vector3::new(0.5, -0.5, -0.25)).amax() < 1e-12);
    assert!((velocity_block(&row) - Matrix3::identity()).amax() < 1e-12);
    let noise: Matrix3<f64> = row.noise.fixed_view::<3, 3>(0, 0).into();
    assert!((noise - Matrix3::from_diagonal(&Vector3::new(0.01, 1e-3, 0.09))).amax() < 1e-12);
    assert!(row.cross.is_none());
}

/// Partial coupling leaves sway out, so that heave is the second row.
#[test]
fn partial_loose_by_hand() {
    let (row, plan) = rows_of(PartialMethod::PartialLoose, &[0, 2], InformationPort::Axes, None);
    assert_eq!((row.rows, row.degrees), (2, 2));
    assert_eq!(
        plan.components.map(|component| component == Component::Solved),
        [true, false, true]
    );
    assert!((row.residual.fixed_rows::<3>(0) - Vector3::new(0.5, -0.25, 0.0)).amax() < 1e-12);
    let expected = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
    assert!((velocity_block(&row) - expected).amax() < 1e-12);
    let noise: Matrix3<f64> = row.noise.fixed_view::<3, 3>(0, 0).into();
    assert!((noise - Matrix3::from_diagonal(&Vector3::new(0.01, 0.09, 0.0))).amax() < 1e-12);
}

/// The virtual beam repeats the prior's sway: its residual is zero, and its noise minus the prior's own error (Eq. 26).
#[test]
fn virtual_beam_by_hand() {
    let p_xv = SMatrix::<f64, DIM, 3>::from_fn(|k, axis| (k as f64 + 1.0) * [1.0, 10.0, 100.0][axis]);
    for (beams, missing) in [([0, 2].as_slice(), vec![1]), (&[1], vec![0, 2])] {
        let (row, plan) = rows_of(PartialMethod::VirtualBeam, beams, InformationPort::Axes, Some(&p_xv));
        assert_eq!(
            plan.virtual_beams.iter().flatten().copied().collect::<Vec<_>>(),
            missing
        );
        assert!((velocity_block(&row) - Matrix3::identity()).amax() < 1e-12);
        let (cross, noise) = (row.cross.unwrap(), row.correlated_noise.unwrap());
        for axis in 0..3 {
            let repeats = missing.contains(&axis);
            let z = [0.5, 1.0, -0.25][axis];
            assert!((row.residual[axis] - if repeats { 0.0 } else { z }).abs() < 1e-12);
            let expected = p_xv.column(axis) * if repeats { -1.0 } else { 0.0 };
            assert!((cross.column(axis) - expected).amax() < 1e-9, "{beams:?}, {axis}");
            for column in 0..DIM {
                let is_own = repeats && column == VELOCITY + axis;
                let expected = if is_own { -1.0 } else { 0.0 };
                assert!((noise.by_state[(axis, column)] - expected).abs() < 1e-12);
            }
        }
    }
}

/// The information form passes the observed axes; in full the others too, of a variance so large that they count for nothing and
/// give no degree of freedom.
#[test]
fn information_by_hand() {
    for (beams, unobserved) in [([0, 2].as_slice(), vec![1]), (&[1], vec![0, 2])] {
        let rank = beams.len();
        let (observed, _) = rows_of(PartialMethod::Information, beams, InformationPort::Axes, None);
        assert_eq!((observed.rows, observed.degrees), (rank, rank));
        let (full, _) = rows_of(PartialMethod::Information, beams, InformationPort::Full, None);
        assert_eq!((full.rows, full.degrees), (3, rank));
        for row in 0..rank {
            assert_eq!(full.residual[row], observed.residual[row]);
            assert_eq!(full.jacobian.row(row), observed.jacobian.row(row));
            let axis = beams
                .iter()
                .position(|&k| full.jacobian[(row, VELOCITY + k)].abs() > 0.5)
                .unwrap();
            let sd = 0.1 * (beams[axis] as f64 + 1.0);
            assert!((full.noise[(row, row)] - sd * sd).abs() < 1e-12);
        }
        let mut seen = Matrix3::<f64>::zeros();
        for row in rank..3 {
            assert_eq!(full.residual[row], 0.0);
            assert_eq!(full.noise[(row, row)], 1e12);
            let axis: Vector3<f64> = full.jacobian.fixed_view::<1, 3>(row, VELOCITY).transpose();
            seen += axis * axis.transpose();
        }
        let expected = Matrix3::from_fn(|i, j| f64::from(i == j && unobserved.contains(&i)));
        assert!((seen - expected).amax() < 1e-12);
    }
}

/// Fixed beyond the beams by a weak row: sway from the filter's own, against its variance.
#[test]
fn weak_sway_by_hand() {
    let (row, _) = rows_of(PartialMethod::WeakSway, &[0, 2], InformationPort::Axes, None);
    let of_sway = (0..3).find(|&k| row.jacobian[(k, VELOCITY + 1)].abs() > 0.5).unwrap();
    let sign = row.jacobian[(of_sway, VELOCITY + 1)];
    assert!((row.residual[of_sway] + 0.5 * sign).abs() < 1e-12);
    assert!((row.noise[(of_sway, of_sway)] - 2.0).abs() < 1e-9);
}
