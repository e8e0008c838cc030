//! Hand-worked ranks and directions, two roads to Φ, and refusals.

use nalgebra::{DMatrix, DVector, Vector3};

use super::history::{of_filter, of_paper};
use super::paper::{Sensors, Sign};
use super::rank::{MIN_GAP, Observability, gramian, growing_windows, observe, rows};
use super::{Aiding, Epochs, SensorSet, System, full, paper};
use crate::aiding::registry::{Levers, Sensor, SensorKind};
use crate::dvl::geometry::{BeamGeometry, BeamMask, Janus};
use crate::error::NavError;
use crate::frames::Vec3;
use crate::model::Model;
use crate::simulation::truth::Truth;

#[path = "turn_for_tests.rs"]
mod turn;

use self::turn::Turn;

const GRAVITY: f64 = 9.8125;
const SECOND_NS: i64 = 1_000_000_000;

fn model() -> Model {
    let mut model = Model::table_2();
    model.environment.gravity_mps2 = GRAVITY;
    model.environment.earth_rate_radps = 0.0;
    model
}

fn janus() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 0.35).unwrap()
}

fn beams(count: usize) -> Aiding {
    Aiding {
        beams: BeamMask::all(count),
        ..Aiding::default()
    }
}

fn whole(system: &System) -> Observability {
    observe(system, system.epochs.len(), None).unwrap()
}

fn inertial(turn: &Turn, aiding: &Aiding) -> System {
    full::systems(
        &turn.truth(),
        &janus(),
        &model(),
        &[*aiding],
        false,
        Epochs::Every(SECOND_NS),
    )
    .unwrap()
    .remove(0)
}

fn paper_dvl(turn: &Turn, sign: Sign) -> System {
    let sensors = Sensors {
        velocity: Some(sign),
        depth: false,
    };
    paper::system(&turn.truth(), &model(), &sensors, SECOND_NS).unwrap()
}

/// At rest by hand (2015, Eq. 29): z bias of the gyro, yaw, and each tilt with the accelerometer bias that hides it.
#[test]
fn at_rest_four_directions_are_hidden() {
    let turn = Turn::new(0.0, 0.0, 60, 50);
    let found = whole(&paper_dvl(&turn, Sign::Printed));
    assert_eq!((found.rank, found.decided), (8, true));
    assert!(found.gap > 1e8, "{}", found.gap);
    let expected = [
        [(3, 1.0), (7, -GRAVITY)],
        [(4, 1.0), (6, GRAVITY)],
        [(5, 1.0), (5, 1.0)],
        [(11, 1.0), (11, 1.0)],
    ];
    for (row, entries) in expected.iter().enumerate() {
        let mut wanted = DVector::<f64>::zeros(12);
        entries.iter().for_each(|&(k, value)| wanted[k] = value);
        let error = (found.basis.row(row).transpose() - wanted).amax();
        assert!(error < 1e-9, "row {row}: {}", found.basis.row(row));
    }
}

/// Turning does not help while it is constant: 8 for both cases with the consistent sign, 9 with the printed one (erratum E10).
#[test]
fn a_constant_turn_hides_a_family() {
    let rate = 1_f64.to_radians();
    let (still, moving) = (Turn::new(rate, 0.0, 120, 50), Turn::new(rate, 10.0, 120, 50));
    for sign in [Sign::Printed, Sign::Consistent] {
        assert_eq!(whole(&paper_dvl(&still, sign)).rank, 8);
    }
    assert_eq!(whole(&paper_dvl(&moving, Sign::Printed)).rank, 9);
    assert_eq!(whole(&paper_dvl(&moving, Sign::Consistent)).rank, 8);
}

/// The paper's closed form and the filter's model by Magnus' expansion are one model in two sets of coordinates.
#[test]
fn closed_form_and_expansion_agree() {
    let turn = Turn::new(0.05, 3.0, 40, 50);
    let truth = turn.truth();
    let sensors = Sensors {
        velocity: Some(Sign::Consistent),
        depth: true,
    };
    let paper = paper::system(&truth, &model(), &sensors, SECOND_NS).unwrap();
    let aiding = Aiding {
        sensors: SensorSet::from_iter([Sensor::Velocity, Sensor::Depth]),
        ..Aiding::default()
    };
    let ours = inertial(&turn, &aiding);
    // Filter from paper at t₀: v_p = Rᵀ(δv − ρ × v), biases with the other sign.
    let start = truth.attitude(0).matrix();
    let velocity_t = start * Vector3::from(truth.velocity_p_mps[0]);
    let mut change = DMatrix::<f64>::zeros(15, 15);
    change.view_mut((0, 0), (3, 3)).fill_with_identity();
    change.view_mut((3, 6), (3, 3)).fill_with_identity();
    change.view_mut((6, 3), (3, 3)).copy_from(&start.transpose());
    change
        .view_mut((6, 6), (3, 3))
        .copy_from(&(start.transpose() * crate::frames::skew(&velocity_t)));
    for k in 9..15 {
        change[(k, k)] = -1.0;
    }
    let (a, b) = (rows(&paper), rows(&ours) * change);
    let error = (&a - &b).amax() / a.amax();
    assert!(error < 1e-12, "{error}");
    assert_eq!(whole(&paper).rank, whole(&ours).rank);
}

/// Directions of the basis give no reading over the window, and the Gramian agrees that they do not.
#[test]
fn hidden_directions_read_zero() {
    let system = inertial(&Turn::new(0.05, 3.0, 60, 50), &beams(2));
    let found = whole(&system);
    let (stack, gram) = (rows(&system), gramian(&system));
    assert!(found.rank < 12);
    for row in found.basis.row_iter() {
        // In scaled states every column of the stack has length 1 or less.
        let size = row.component_div(&found.scales.transpose()).norm();
        let output = (&stack * row.transpose()).norm();
        assert!(output <= 1e-8 * size, "{output} of {size}");
        let energy = (row * &gram * row.transpose())[(0, 0)];
        assert!(energy.abs() <= 1e-12 * size * size, "{energy} of {size}");
    }
}

/// Minutes for seconds, kilometres for metres, micro-g: no scaling of the states moves a rank.
#[test]
fn scaling_moves_no_rank() {
    let system = inertial(&Turn::new(0.05, 3.0, 60, 50), &beams(3));
    let rank = whole(&system).rank;
    for factors in [
        [1e3; 15],
        std::array::from_fn(|k| [1e-3, 57.3, 60.0, 9.8, 3600.0][k / 3]),
        std::array::from_fn(|k| if k % 2 == 0 { 1e-2 } else { 1e2 }),
    ] {
        let found = observe(&system, system.epochs.len(), Some(&factors)).unwrap();
        assert_eq!(found.rank, rank);
        assert!(found.gap >= MIN_GAP);
    }
}

/// Full rank has an empty basis and no panic.
#[test]
fn full_rank_has_no_basis() {
    let aiding = Aiding {
        sensors: SensorSet::from_iter([Sensor::GpsPosition, Sensor::GpsVelocity, Sensor::Attitude]),
        ..Aiding::default()
    };
    let found = whole(&inertial(&Turn::new(0.05, 3.0, 60, 50), &aiding));
    assert_eq!((found.rank, found.basis.nrows(), found.decided), (15, 0, true));
}

/// Covariance analysis: unobservable states keep their deviation, observable ones lose most of it.
#[test]
fn hidden_directions_keep_their_deviation() {
    let turn = Turn::new(0.05, 3.0, 60, 50);
    let (truth, geometry, aiding) = (turn.truth(), janus(), beams(4));
    let mut quiet = model();
    quiet.imu.accel_noise_mps_rts = 0.0;
    quiet.imu.gyro_noise_rad_rts = 0.0;
    quiet.imu.accel_bias_walk_mps2_rts = 0.0;
    quiet.imu.gyro_bias_walk_radps_rts = 0.0;
    let history = of_filter(&truth, &geometry, &quiet, &aiding, false, Epochs::Every(SECOND_NS)).unwrap();
    let last = &history.covariance[history.covariance.len() - 1];
    let first = quiet.initial_covariance(false);
    // Yaw is unobservable (and grows with the gyro's bias), heave is not.
    assert!(last[(5, 5)] >= first[(5, 5)], "{}", last[(5, 5)]);
    assert!(last[(8, 8)] < 0.1 * first[(8, 8)]);
    let sensors = Sensors {
        velocity: Some(Sign::Consistent),
        depth: false,
    };
    let paper = of_paper(&truth, &quiet, &sensors, SECOND_NS).unwrap();
    // Without process noise the information along a direction that is never read stays what it was: uᵀP⁻¹u.
    let system = paper_dvl(&turn, Sign::Consistent);
    let information = |p: &DMatrix<f64>, u: &DVector<f64>| {
        let scale = p.map_diagonal(|x| 1.0 / x.sqrt());
        let unit = DMatrix::from_fn(12, 12, |i, j| p[(i, j)] * scale[i] * scale[j]);
        let v = u.component_mul(&scale);
        v.dot(&unit.cholesky().unwrap().solve(&v))
    };
    let initial = DMatrix::from_diagonal(&DVector::from_iterator(
        12,
        [6..9, 3..6, 9..12, 12..15].into_iter().flatten().map(|k| first[(k, k)]),
    ));
    for row in whole(&system).basis.row_iter() {
        let u = row.transpose();
        let (before, after) = (
            information(&initial, &u),
            information(&paper.covariance[60], &(&system.epochs[60].transition * &u)),
        );
        assert!((after / before - 1.0).abs() < 1e-5, "{before} {after}");
    }
    let heave = DVector::from_fn(12, |k, _| f64::from(u8::from(k == 2)));
    let after = information(&paper.covariance[60], &(&system.epochs[60].transition * &heave));
    assert!(after > 10.0 * information(&initial, &heave));
}

/// What makes no sense is refused in words, and nothing panics.
#[test]
fn refusals() {
    let turn = Turn::new(0.0, 1.0, 10, 10);
    let (truth, geometry, model) = (turn.truth(), janus(), model());
    let judge = |truth: &Truth<'_>, aiding: &Aiding, period| {
        full::systems(truth, &geometry, &model, &[*aiding], true, Epochs::Every(period))
            .map(|systems| whole(&systems[0]))
    };
    let empty = judge(&truth, &Aiding::default(), SECOND_NS);
    assert!(matches!(
        empty,
        Err(NavError::WrongCount {
            field: "aiding sensors",
            ..
        })
    ));
    let fifth = Aiding {
        beams: [4].into_iter().collect(),
        ..Aiding::default()
    };
    assert!(matches!(
        judge(&truth, &fifth, SECOND_NS),
        Err(NavError::BadBeam { beam: 5, .. })
    ));
    let once = judge(&truth, &beams(4), 60 * SECOND_NS);
    assert!(matches!(
        once,
        Err(NavError::WrongCount {
            field: "epochs of the window",
            got: 1,
            ..
        })
    ));
    assert!(judge(&truth.part(0..1), &beams(4), SECOND_NS).is_err());
    assert!(matches!(
        judge(&truth, &beams(4), 0),
        Err(NavError::OutOfRange { field: "period_ns", .. })
    ));
    assert!(judge(&truth, &beams(4), i64::MAX).is_err());
    assert!(judge(&truth, &beams(4), 1).is_ok(), "every sample, at once");
    let long = Turn::new(0.0, 1.0, 600, 10);
    let many = judge(&long.truth(), &beams(4), 1);
    assert!(matches!(many, Err(NavError::WrongCount { got: 5001, .. })));
    let mut broken = Turn::new(0.0, 1.0, 10, 10);
    broken.velocity[7][1] = f64::NAN;
    assert!(matches!(
        judge(&broken.truth(), &beams(4), SECOND_NS),
        Err(NavError::NotFinite { .. })
    ));
    let none = Sensors {
        velocity: None,
        depth: false,
    };
    assert!(paper::system(&truth, &model, &none, SECOND_NS).is_err());
    let system = &full::systems(&truth, &geometry, &model, &[beams(4)], true, Epochs::Every(SECOND_NS)).unwrap()[0];
    assert!(observe(system, 1, None).is_err());
    assert!(observe(system, 12, None).is_err());
    assert!(observe(system, 11, Some(&[1.0])).is_err());
    assert!(observe(system, 11, Some(&[-1.0; 20])).is_err());
}

/// Rows that read nothing are refused rather than given a rank of zero and a gap of nothing.
#[test]
fn rows_of_zeros_are_refused() {
    let mut system = inertial(&Turn::new(0.0, 1.0, 10, 10), &beams(1));
    for epoch in &mut system.epochs {
        epoch.rows.fill(0.0);
    }
    assert!(matches!(
        observe(&system, 11, None),
        Err(NavError::OutOfRange {
            field: "norm of the stacked rows",
            ..
        })
    ));
}

/// A schedule on which everything is heard is the period; silence at first has rank zero, and what is heard later counts.
#[test]
fn schedules() {
    let turn = Turn::new(0.05, 2.0, 20, 10);
    let (truth, geometry, model) = (turn.truth(), janus(), model());
    let set = Aiding {
        sensors: SensorSet::from_iter([Sensor::Depth]),
        ..beams(4)
    };
    let judge = |heard: &[(i64, Aiding)]| {
        full::systems(&truth, &geometry, &model, &[set], true, Epochs::Scheduled(heard)).map(|mut all| all.remove(0))
    };
    let always: Vec<(i64, Aiding)> = (0..=20).map(|k| (k * SECOND_NS, set)).collect();
    let periodic = full::systems(&truth, &geometry, &model, &[set], true, Epochs::Every(SECOND_NS)).unwrap();
    assert_eq!(judge(&always).unwrap(), periodic[0]);
    // Beams alone, and only from 10 s on: what the set has and the schedule has not reads nothing.
    let late: Vec<(i64, Aiding)> = always
        .iter()
        .map(|&(time_ns, _)| {
            let heard = if time_ns < 10 * SECOND_NS {
                Aiding::default()
            } else {
                beams(4)
            };
            (time_ns, heard)
        })
        .collect();
    let system = judge(&late).unwrap();
    let steps = growing_windows(&system, None).unwrap();
    assert_eq!(steps.len(), 20);
    assert!(steps[..8].iter().all(|step| step.rank == 0 && step.decided));
    let alone = full::systems(&truth, &geometry, &model, &[beams(4)], true, Epochs::Every(SECOND_NS)).unwrap();
    assert_eq!(steps[19].rank, whole(&alone[0]).rank);
    // A silent schedule, times that fall, times outside, one epoch.
    let silent: Vec<(i64, Aiding)> = (0..5).map(|k| (k * SECOND_NS, Aiding::default())).collect();
    assert!(observe(&judge(&silent).unwrap(), 5, None).is_err());
    assert!(matches!(
        judge(&[always[3], always[2]]),
        Err(NavError::TimeNotIncreasing { .. })
    ));
    assert!(matches!(
        judge(&[(0, set), (1, set), (2, set)]),
        Err(NavError::TimeNotIncreasing { .. })
    ));
    assert!(matches!(
        judge(&[(-1, set), (0, set)]),
        Err(NavError::OutsideTruth { stream: "schedule", .. })
    ));
    assert!(matches!(judge(&always[..1]), Err(NavError::WrongCount { got: 1, .. })));
    let bent = Aiding {
        levers: Levers::default().with(SensorKind::Gps, Vec3::new(0.0, f64::NAN, 0.0)),
        ..set
    };
    assert!(bent.validate(&geometry).is_err());
    assert!(
        Aiding {
            levers: Levers::default().with(SensorKind::Depth, Vec3::new(1.0, 1.0, 1.0)),
            ..Aiding::default()
        }
        .is_empty()
    );
}
