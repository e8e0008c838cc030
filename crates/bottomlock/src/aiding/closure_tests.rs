//! The closure by hand, and as what the velocity leaves of the beams.

use proptest::prelude::*;

use super::*;
use crate::aiding::further::FurtherRows;
use crate::aiding::{InformationPort, RowJacobian};
use crate::testing::*;

/// Terms of beams in these directions, with residuals of 1, 2, 3, … m/s, a bias each and a variance each.
fn terms(directions: &[[f64; 3]], variance: impl Fn(usize, usize) -> f64) -> BeamTerms {
    let mut terms = BeamTerms {
        residual: SVector::from_fn(|beam, _| {
            if beam < directions.len() {
                beam as f64 + 1.0
            } else {
                0.0
            }
        }),
        jacobian: RowJacobian::zeros(),
        noise: SMatrix::zeros(),
        by_further: Some(Box::new(FurtherRows::zeros())),
    };
    for (beam, direction) in directions.iter().enumerate() {
        (0..3).for_each(|k| terms.jacobian[(beam, VELOCITY + k)] = direction[k]);
        if beam < 4 {
            terms.jacobian[(beam, DVL_BIAS + beam)] = 1.0;
        }
        (0..directions.len()).for_each(|other| terms.noise[(beam, other)] = variance(beam, other));
        if let Some(rows) = &mut terms.by_further {
            rows[(beam, 0)] = 10.0 * (beam as f64 + 1.0);
        }
    }
    terms
}

fn with_further() -> Innovation {
    Innovation {
        by_further: Some(Box::new(FurtherRows::zeros())),
        ..Innovation::empty()
    }
}

/// By hand: of a Janus with σ = 0.5 the closure is (z₁ − z₂ + z₃ − z₄)/2σ, up to its sign; of 1, 2, 3, 4 m/s it is −2.
#[test]
fn a_janus_by_hand() {
    let directions = [[1.0, 1.0, 2.0], [1.0, -1.0, 2.0], [-1.0, -1.0, 2.0], [-1.0, 1.0, 2.0]];
    let terms = terms(&directions, |i, j| if i == j { 0.25 } else { 0.0 });
    let mut innovation = with_further();
    push_closure(&mut innovation, &terms, BeamMask::all(4), 3);
    assert_eq!(
        (innovation.rows, innovation.degrees, innovation.noise[(0, 0)]),
        (1, 1, 1.0)
    );
    let sign = innovation.jacobian[(0, DVL_BIAS)].signum();
    assert!((innovation.residual[0] * sign + 2.0).abs() < 1e-12);
    for (beam, expected) in [1.0, -1.0, 1.0, -1.0].into_iter().enumerate() {
        assert!((innovation.jacobian[(0, DVL_BIAS + beam)] * sign - expected).abs() < 1e-12);
    }
    assert!(innovation.jacobian.fixed_view::<1, 3>(0, VELOCITY).amax() < 1e-12);
    let further = innovation.by_further.unwrap();
    assert!((further[(0, 0)] * sign + 20.0).abs() < 1e-11);
}

/// By hand: two beams in one direction with variances 1 and 3 close to their difference over 2, whichever beams they are;
/// beams without redundancy have none.
#[test]
fn two_beams_in_a_line_by_hand() {
    let line = [[0.0; 3], [0.0, 0.0, 1.0], [0.0; 3], [0.0, 0.0, 1.0]];
    let terms = terms(&line, |i, j| {
        f64::from(u8::from(i == j)) * if i == 3 { 3.0 } else { 1.0 }
    });
    let mut innovation = with_further();
    let both: BeamMask = [1, 3].into_iter().collect();
    push_closure(&mut innovation, &terms, both, 1);
    assert_eq!(innovation.rows, 1);
    assert!((innovation.residual[0].abs() - 1.0).abs() < 1e-12, "(4 − 2)/2");
    let mut none = Innovation::empty();
    push_closure(&mut none, &terms, BeamMask::all(1), 1);
    push_closure(&mut none, &terms, BeamMask::NONE, 0);
    assert_eq!(none.rows, 0);
}

proptest! {
    /// For any noise the velocity cancels, the closures are white with variance 1, and none is correlated with the least
    /// squares: NIS of velocity and closure is that of the beams, zᵀR⁻¹z − the part that the velocity explains.
    #[test]
    fn white_and_without_velocity(numbers in prop::collection::vec(-1.0_f64..1.0, 64), beams in 4_usize..=MAX_BEAMS,
                                  tilts in prop::collection::vec(0.2_f64..0.7, MAX_BEAMS)) {
        let directions: Vec<[f64; 3]> = tilts.iter().take(beams).enumerate().map(|(k, tilt)| {
            let azimuth = std::f64::consts::TAU * k as f64 / beams as f64;
            [tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()]
        }).collect();
        let root = SMatrix::<f64, 8, 8>::from_iterator(numbers);
        let noise = root * root.transpose() + SMatrix::identity() * 0.1;
        let terms = terms(&directions, |i, j| noise[(i, j)]);
        let mut innovation = with_further();
        push_closure(&mut innovation, &terms, BeamMask::all(beams), 3);
        prop_assert_eq!(innovation.rows, beams - 3);
        prop_assert!(innovation.jacobian.fixed_columns::<3>(VELOCITY).amax() < 1e-10);

        let r = terms.noise.view((0, 0), (beams, beams)).into_owned().try_inverse().unwrap();
        let b = DMatrix::from_fn(beams, 3, |i, k| directions[i][k]);
        let z = terms.residual.rows(0, beams).into_owned();
        let explained = &b * (b.transpose() * &r * &b).try_inverse().unwrap() * b.transpose() * &r * &z;
        let left = &z - explained;
        let closure = innovation.residual.norm_squared();
        prop_assert!(((left.transpose() * r * left)[0] / closure - 1.0).abs() < 1e-8);
    }
}

/// Appended to the principal axes of all four beams, it leaves them as they are.
#[test]
fn it_stands_after_the_axes() {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let ping = ping_of(0, [0.1; MAX_BEAMS], 0.04, BeamMask::all(4));
    let state = NavState::at_rest(0);
    let directions: Vec<[f64; 3]> = (0..4).map(|beam| (*geometry.direction_p(beam)).into()).collect();
    let terms = terms(&directions, |i, j| f64::from(u8::from(i == j)) * 0.0016);
    let method = PartialMethod::Information;
    let plan = fix_estimator(
        method,
        &geometry,
        ping.valid,
        &terms.noise,
        None,
        &Assumptions::default(),
    )
    .unwrap();
    for (port, before) in [(InformationPort::Axes, 3), (InformationPort::Full, 3)] {
        let axes = crate::aiding::loosely_coupled(&state, &geometry, &terms, &plan, port, None);
        let mut both = axes.clone();
        push_closure(&mut both, &terms, ping.valid, 3);
        assert_eq!((axes.rows, both.rows, both.degrees), (before, 4, 4));
        assert_eq!(both.jacobian.fixed_rows::<3>(0), axes.jacobian.fixed_rows::<3>(0));
        assert_eq!(both.noise.fixed_view::<3, 3>(0, 0), axes.noise.fixed_view::<3, 3>(0, 0));
        assert_eq!(both.noise.fixed_view::<3, 1>(0, 3).amax(), 0.0);
        let velocity: Matrix3<f64> = both.jacobian.fixed_view::<3, 3>(0, VELOCITY).into();
        assert!(velocity.determinant().abs() > 0.9 && both.jacobian.columns(0, ATTITUDE).amax() == 0.0);
        assert_eq!(both.jacobian.ncols(), DIM);
    }
}
