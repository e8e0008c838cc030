//! Tests of the partial-beam methods: closed forms of the papers, unsolvable cases, invariances over random geometries.

use crate::testing::*;
use proptest::prelude::*;

use super::fix::*;
use super::partial::*;

pub(super) const SIGMA: [f64; 4] = [0.042, 0.05, 0.03, 0.06];

pub(super) fn janus() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap()
}

pub(super) fn ping(values: &[f64], valid: &[usize]) -> BeamSample {
    let mut ping = ping_of(0, [f64::NAN; MAX_BEAMS], f64::NAN, valid.iter().copied().collect());
    for &beam in valid {
        ping.velocity_mps[beam] = values[beam];
        ping.sd_mps[beam] = SIGMA[beam];
    }
    ping
}

pub(super) fn prior() -> VelocityPrior {
    let a = Matrix3::new(0.2, 0.03, -0.01, 0.0, 0.3, 0.05, 0.02, 0.0, 0.15);
    VelocityPrior {
        velocity_p_mps: Vec3::new(1.9, 0.07, -0.04),
        cov_m2ps2: a * a.transpose(),
    }
}

fn fix(method: PartialMethod, valid: &[usize], assumptions: &Assumptions) -> VelocityFix {
    let context = PingContext {
        prior: Some(prior()),
        ..Default::default()
    };
    match solve(
        method,
        &janus(),
        &ping(&[0.55, -0.45, 0.2, 0.3], valid),
        &context,
        assumptions,
    )
    .unwrap()
    {
        FixOutcome::Fix(fix) | FixOutcome::Unobservable(fix) => fix,
        other => panic!("no fix: {other:?}"),
    }
}

/// Eqs. 25, 28 (with the whole P) and 30 for beams 1 and 2: the inverse of the square matrix.
#[test]
fn virtual_beam_closed_form() {
    let assumptions = Assumptions {
        virtual_beam_factor: 1.7,
        ..Default::default()
    };
    let fix = fix(PartialMethod::VirtualBeam, &[0, 1], &assumptions);
    let geometry = janus();
    let b3 = geometry.direction_p(2);
    let a = Matrix3::from_rows(&[
        geometry.direction_p(0).transpose(),
        geometry.direction_p(1).transpose(),
        b3.transpose(),
    ]);
    let inverse = a.try_inverse().unwrap();
    let expected = inverse * Vector3::new(0.55, -0.45, b3.dot(&prior().velocity_p_mps.0));
    let sigma3 = 1.7 * (b3.dot(&(prior().cov_m2ps2 * b3))).sqrt();
    let r = Matrix3::from_diagonal(&Vector3::new(SIGMA[0].powi(2), SIGMA[1].powi(2), sigma3.powi(2)));
    assert!((fix.velocity_p_mps.0 - expected).amax() < 1e-12);
    assert!((fix.estimator.covariance - inverse * r * inverse.transpose()).amax() < 1e-12);
}

/// Eqs. 33 and 35 for beams 1 and 2; the row of variance ε adds a term known in closed form.
#[test]
fn nullified_sway_closed_form() {
    let fix = fix(
        PartialMethod::NullifiedSway,
        &[0, 1],
        &Assumptions {
            nullified_sway_var_m2ps2: 1e-6,
            ..Default::default()
        },
    );
    let (b1, b2) = (*janus().direction_p(0), *janus().direction_p(1));
    let determinant = b1.x * b2.z - b1.z * b2.x;
    let solve = |y1: f64, y2: f64| {
        (
            (b2.z * y1 - b1.z * y2) / determinant,
            (b1.x * y2 - b2.x * y1) / determinant,
        )
    };
    let (u, w) = solve(0.55, -0.45);
    assert!((fix.velocity_p_mps.0 - Vector3::new(u, 0.0, w)).amax() < 1e-12);
    let ((u1, w1), (u2, w2), (us, ws)) = (solve(1.0, 0.0), solve(0.0, 1.0), solve(-b1.y, -b2.y));
    let (s1, s2) = (SIGMA[0].powi(2), SIGMA[1].powi(2));
    let printed = [
        (0, 0, u1 * u1 * s1 + u2 * u2 * s2),
        (2, 2, w1 * w1 * s1 + w2 * w2 * s2),
        (0, 2, u1 * w1 * s1 + u2 * w2 * s2),
    ];
    let sway_terms = [us * us, ws * ws, us * ws];
    for ((i, j, value), extra) in printed.into_iter().zip(sway_terms) {
        assert!((fix.estimator.covariance[(i, j)] - value - 1e-6 * extra).abs() < 1e-12);
    }
    assert!((fix.estimator.covariance[(1, 1)] - 1e-6).abs() < 1e-15);
}

/// Eqs. 40 and 41 for beams 1 and 2.
#[test]
fn partial_loose_closed_form() {
    let fix = fix(PartialMethod::PartialLoose, &[0, 1], &Assumptions::default());
    let b11 = janus().direction_p(0).x;
    assert!((fix.velocity_p_mps.0.x - 1.0 / (2.0 * b11)).abs() < 1e-12);
    let expected = (SIGMA[0].powi(2) + SIGMA[1].powi(2)) / (4.0 * b11 * b11);
    assert!((fix.estimator.covariance[(0, 0)] - expected).abs() < 1e-12);
    assert_eq!(
        fix.estimator.components[1],
        Component::Unobservable(Reason::OutsideRowSpace)
    );
}

/// Eq. 45 and Eq. 46 with the plus sign (erratum E1) for beams 1 and 2.
#[test]
fn virtual_heave_closed_form() {
    let fix = fix(PartialMethod::VirtualHeave, &[0, 1], &Assumptions::default());
    let b1 = *janus().direction_p(0);
    let v = 0.1 / (2.0 * b1.y) - b1.z / b1.y * -0.04;
    assert!((fix.velocity_p_mps.0.y - v).abs() < 1e-12);
    let own = (SIGMA[0].powi(2) + SIGMA[1].powi(2)) / (4.0 * b1.y * b1.y);
    let heave = (b1.z / b1.y).powi(2) * prior().cov_m2ps2[(2, 2)];
    assert!((fix.estimator.covariance[(1, 1)] - own - heave).abs() < 1e-12);
    assert_eq!(fix.estimator.components[2], Component::Unobservable(Reason::PriorOnly));
}

/// Erratum E3: the axis that each pair of an x-Janus determines without an extra row; erratum E2: pairs for which NSV
/// is singular.
#[test]
fn pairs_of_the_x_janus() {
    for (pair, solved, nsv) in [
        ([0, 1], 0, true),
        ([2, 3], 0, true),
        ([0, 3], 1, false),
        ([1, 2], 1, false),
        ([0, 2], 2, true),
        ([1, 3], 2, true),
    ] {
        let plcf = fix(PartialMethod::PartialLoose, &pair, &Assumptions::default());
        for k in 0..3 {
            assert_eq!(plcf.estimator.is_solved(k), k == solved, "pair {pair:?}, axis {k}");
        }
        let nullified = fix(PartialMethod::NullifiedSway, &pair, &Assumptions::default());
        assert_eq!((0..3).all(|k| nullified.estimator.is_solved(k)), nsv, "pair {pair:?}");
        if !nsv {
            assert_eq!(
                nullified.estimator.components,
                [Component::Unobservable(Reason::ConstraintSingular); 3]
            );
        }
    }
}

/// The selector takes the smallest variance per axis: ε makes that NSV for the sway (erratum E4); surge is the same for
/// all.
#[test]
fn selector_equals_nullified_sway() {
    let fix = fix(PartialMethod::Selector, &[0, 1], &Assumptions::default());
    assert_eq!(fix.estimator.sources[1], PartialMethod::NullifiedSway);
    assert!((fix.estimator.covariance[(0, 1)]).abs() < 1e-300, "Eq. 49 is diagonal");
    assert!(fix.velocity_p_mps.0.y.abs() < 1e-12);
}

/// One beam: VB adds two virtual beams; the other methods return the reason why they cannot solve.
#[test]
fn one_beam() {
    let vb = fix(PartialMethod::VirtualBeam, &[1], &Assumptions::default());
    assert!((0..3).all(|k| vb.estimator.is_solved(k)));
    assert_eq!(
        vb.estimator.virtual_beams,
        [Some(3), Some(0)],
        "the opposite beam first, then of equals the lowest number"
    );
    let nsv = fix(PartialMethod::NullifiedSway, &[1], &Assumptions::default());
    assert_eq!(
        nsv.estimator.components,
        [Component::Unobservable(Reason::OutsideRowSpace); 3]
    );
    assert_eq!(
        fix(PartialMethod::Information, &[1], &Assumptions::default())
            .estimator
            .solution
            .rank,
        1
    );
}

/// The outcome names a missing beam or a missing prior.
#[test]
fn no_beam_or_no_prior() {
    let empty = ping(&[], &[]);
    let context = PingContext::default();
    let outcome = solve(
        PartialMethod::VirtualBeam,
        &janus(),
        &empty,
        &context,
        &Assumptions::default(),
    )
    .unwrap();
    assert_eq!(outcome, FixOutcome::TooFewBeams);
    let two = ping(&[0.1, 0.2], &[0, 1]);
    let outcome = solve(
        PartialMethod::VirtualBeam,
        &janus(),
        &two,
        &context,
        &Assumptions::default(),
    )
    .unwrap();
    assert_eq!(outcome, FixOutcome::PriorRequired);
}

fn direction() -> impl Strategy<Value = Vector3<f64>> {
    (0.1_f64..0.8, -3.1_f64..3.1)
        .prop_map(|(tilt, azimuth)| Vector3::new(azimuth.cos() * tilt.sin(), azimuth.sin() * tilt.sin(), tilt.cos()))
}

const ALL: [PartialMethod; 8] = [
    PartialMethod::LeastSquares,
    PartialMethod::VirtualBeam,
    PartialMethod::NullifiedSway,
    PartialMethod::PartialLoose,
    PartialMethod::VirtualHeave,
    PartialMethod::Selector,
    PartialMethod::Information,
    PartialMethod::WeakSway,
];

fn outcome_of(method: PartialMethod, geometry: &BeamGeometry, ping: &BeamSample, prior: VelocityPrior) -> FixOutcome {
    let context = PingContext {
        prior: Some(prior),
        ..Default::default()
    };
    solve(method, geometry, ping, &context, &Assumptions::default()).unwrap()
}

fn velocity_of(outcome: &FixOutcome) -> Option<&VelocityFix> {
    match outcome {
        FixOutcome::Fix(fix) | FixOutcome::Unobservable(fix) => Some(fix),
        _ => None,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// For any geometry, mask and values: a finite fix with positive variances, or a reason, and never a panic.
    #[test]
    fn never_panics(directions in prop::collection::vec(direction(), 1..=MAX_BEAMS), bits in 0_usize..256,
                    values in prop::array::uniform8(-50.0_f64..50.0)) {
        let tagged: Vec<_> = directions.iter().map(|d| Vec3::from(*d)).collect();
        let geometry = BeamGeometry::from_directions(&tagged).unwrap();
        let valid: BeamMask = (0..directions.len()).filter(|k| bits & (1 << k) != 0).collect();
        let ping = BeamSample { time_ns: 0, velocity_mps: values, sd_mps: [0.05; MAX_BEAMS], valid };
        for method in ALL {
            if let Some(fix) = velocity_of(&outcome_of(method, &geometry, &ping, prior())) {
                prop_assert!(fix.velocity_p_mps.is_finite());
                for k in 0..3 {
                    prop_assert!(!fix.estimator.is_solved(k) || fix.estimator.covariance[(k, k)] > 0.0);
                }
            }
        }
    }

    /// Renumbering the beams does not change the fix; VB is left out, since its virtual beam depends on the numbers.
    #[test]
    fn renumbering_changes_nothing(bits in 1_usize..16, values in prop::array::uniform4(-3.0_f64..3.0), shift in 1_usize..4) {
        let order: Vec<usize> = (0..4).map(|k| (k + shift) % 4).collect();
        let geometry = janus();
        let renumbered: Vec<_> = order.iter().map(|&k| Vec3::from(*geometry.direction_p(k))).collect();
        let renumbered = BeamGeometry::from_directions(&renumbered).unwrap();
        let sample = |order: &[usize]| {
            let mut ping = BeamSample { time_ns: 0, velocity_mps: [0.0; 8], sd_mps: [1.0; 8],
                valid: (0..4).filter(|&k| bits & (1 << order[k]) != 0).collect() };
            for k in 0..4 {
                (ping.velocity_mps[k], ping.sd_mps[k]) = (values[order[k]], SIGMA[order[k]]);
            }
            ping
        };
        for method in ALL.into_iter().filter(|m| !matches!(m, PartialMethod::VirtualBeam | PartialMethod::Selector)) {
            let (one, two) = (outcome_of(method, &geometry, &sample(&[0, 1, 2, 3]), prior()),
                              outcome_of(method, &renumbered, &sample(&order), prior()));
            let (one, two) = (velocity_of(&one).unwrap(), velocity_of(&two).unwrap());
            prop_assert_eq!(one.estimator.components, two.estimator.components);
            prop_assert!((one.velocity_p_mps.0 - two.velocity_p_mps.0).amax() < 1e-10);
            prop_assert!((one.estimator.covariance - two.estimator.covariance).amax() < 1e-10);
        }
    }

    /// Rotating mounting and prior rotates the fix (methods without platform axes).
    #[test]
    fn rotating_the_mounting_rotates_the_fix(bits in 1_usize..16, values in prop::array::uniform4(-3.0_f64..3.0),
                                          angle in prop::array::uniform3(-3.0_f64..3.0)) {
        let rotation = Rot::<Platform, crate::frames::Dvl>::exp(Vector3::from(angle));
        let matrix = rotation.matrix();
        let valid: Vec<usize> = (0..4).filter(|k| bits & (1 << k) != 0).collect();
        let sample = ping(&values, &valid);
        let rotated_prior = VelocityPrior {
            velocity_p_mps: Vec3::from(matrix * prior().velocity_p_mps.0),
            cov_m2ps2: matrix * prior().cov_m2ps2 * matrix.transpose(),
        };
        for method in [PartialMethod::LeastSquares, PartialMethod::VirtualBeam, PartialMethod::Information] {
            let (one, two) = (outcome_of(method, &janus(), &sample, prior()),
                              outcome_of(method, &janus().mounted(rotation), &sample, rotated_prior));
            let (one, two) = (velocity_of(&one).unwrap(), velocity_of(&two).unwrap());
            prop_assert!((matrix * one.velocity_p_mps.0 - two.velocity_p_mps.0).amax() < 1e-9);
            prop_assert!((matrix * one.estimator.covariance * matrix.transpose() - two.estimator.covariance).amax() < 1e-9);
        }
    }
}

/// By hand: five pings a second share the row of a second, one a second keeps it, and so do rarer ones and the first.
#[test]
fn pings_within_a_second_share_the_weak_sway() {
    let given = Assumptions::default();
    let variance = |interval_s| given.of_ping(interval_s).weak_sway_var_m2ps2;
    assert_eq!(variance(Some(0.2)), 10.0);
    assert_eq!(variance(Some(1.0)), 2.0);
    assert_eq!(variance(Some(3.0)), 2.0);
    assert_eq!(variance(None), 2.0);
    let others = Assumptions {
        weak_sway_var_m2ps2: 2.0,
        ..given.of_ping(Some(0.2))
    };
    assert_eq!(others, given);
}
