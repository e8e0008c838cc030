//! Fixes by hand on beams along the axes of the platform, and what is checked before one.

use super::fix::*;
use super::partial::*;
use super::partial_tests::{SIGMA, janus, ping, prior};
use crate::testing::*;

/// Beams along the axes of the platform, a lever arm, a turn and a wrong sound speed: what the beams see is taken off by hand.
#[test]
fn lever_arm_and_sound_speed_by_hand() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from_array);
    let geometry = BeamGeometry::from_directions(&axes)
        .and_then(|geometry| geometry.with_lever_arms(&[Vec3::new(1.0, 0.0, 0.0); 3]))
        .and_then(|geometry| geometry.with_sound_speed_scale(1.25))
        .unwrap();
    let context = PingContext {
        omega_tp_p_radps: Vector3::new(0.0, 0.5, 0.25),
        prior: None,
    };
    let ping = ping(&[2.5, 0.5, -1.0], &[0, 1, 2]);
    let outcome = solve(
        PartialMethod::LeastSquares,
        &geometry,
        &ping,
        &context,
        &Assumptions::default(),
    )
    .unwrap();
    let FixOutcome::Fix(fix) = outcome else {
        panic!("{outcome:?}")
    };
    // ω × l = (0, 0.25, −0.5).
    assert!((fix.velocity_p_mps.0 - Vector3::new(2.0, 0.4 - 0.25, -0.8 + 0.5)).amax() < 1e-15);
    let expected = Matrix3::from_diagonal(&Vector3::from_fn(|k, _| (SIGMA[k] / 1.25).powi(2)));
    assert!((fix.estimator.covariance - expected).amax() < 1e-15);
}

/// One beam along an axis: the prior's velocity and covariance across it, n_f² of the latter, with its correlation.
#[test]
fn one_beam_and_a_prior_by_hand() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from_array);
    let geometry = BeamGeometry::from_directions(&axes).unwrap();
    let context = PingContext {
        prior: Some(prior()),
        ..Default::default()
    };
    let assumptions = Assumptions {
        virtual_beam_factor: 2.0,
        ..Default::default()
    };
    let ping = ping(&[0.0, 0.5], &[1]);
    let solved = |method| match solve(method, &geometry, &ping, &context, &assumptions).unwrap() {
        FixOutcome::Fix(fix) => fix,
        other => panic!("no fix: {other:?}"),
    };
    let fix = solved(PartialMethod::VirtualBeam);
    assert!((fix.velocity_p_mps.0 - Vector3::new(1.9, 0.5, -0.04)).amax() < 1e-12);
    let mut expected = prior().cov_m2ps2 * 4.0;
    expected.fill_row(1, 0.0);
    expected.fill_column(1, 0.0);
    expected[(1, 1)] = SIGMA[1].powi(2);
    assert!((fix.estimator.covariance - expected).amax() < 1e-12);

    // The selector hands the virtual beams on; of equal variances it takes the first method's.
    let selected = solved(PartialMethod::Selector).estimator;
    assert_eq!(selected.virtual_beams, fix.estimator.virtual_beams);
    assert_eq!(selected.sources, [PartialMethod::VirtualBeam; 3]);
}

/// Where every beam that exists is valid there is none to virtualise.
#[test]
fn no_beam_is_left_to_virtualise() {
    let pair = BeamGeometry::from_directions(&[Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0)]).unwrap();
    let noise = BeamNoise::identity();
    let prior = Matrix3::identity();
    // A mask of more beams than there are says nothing of those.
    for valid in [BeamMask::all(2), BeamMask::all(MAX_BEAMS)] {
        let method = PartialMethod::VirtualBeam;
        let plan = fix_estimator(method, &pair, valid, &noise, Some(&prior), &Assumptions::default()).unwrap();
        assert_eq!(plan.components, [Component::Unobservable(Reason::OutsideRowSpace); 3]);
        assert_eq!(plan.solution.rank, 2);
    }
}

/// A prior's covariance is symmetric up to rounding and positive definite; assumptions are checked.
#[test]
fn priors_and_assumptions_are_checked() {
    let with = |prior: &Matrix3<f64>, assumptions: &Assumptions| {
        let method = PartialMethod::VirtualBeam;
        fix_estimator(
            method,
            &janus(),
            BeamMask::all(2),
            &BeamNoise::identity(),
            Some(prior),
            assumptions,
        )
    };
    let good = Assumptions::default();
    let mut round = Matrix3::identity() * 4.0;
    round[(0, 1)] = 3e-9;
    assert!(with(&round, &good).is_ok());
    round[(0, 1)] = 5e-9;
    assert!(with(&round, &good).is_err());
    assert!(with(&Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0)), &good).is_err());
    let small = Matrix3::identity() * 1e-3;
    let mut skewed = small;
    skewed[(0, 1)] = 1e-11;
    assert!(with(&small, &good).is_ok() && with(&skewed, &good).is_err());
    let bad = Assumptions {
        virtual_beam_factor: 0.0,
        ..good
    };
    let text = with(&small, &bad).unwrap_err().to_string();
    assert!(text.contains("virtual_beam_factor"), "{text}");
}
