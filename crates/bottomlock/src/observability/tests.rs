//! Ranks and unobservable directions by hand, and two independent computations of Φ.

use super::history::{of_filter, of_paper};
use super::paper::{Sensors, Sign};
use super::rank::{MIN_GAP, Observability, gramian, observe, rows};
use super::{Aiding, Epochs, SensorSet, System, full, paper};
use crate::simulation::truth::Truth;
use crate::stop::Stop;
use crate::testing::*;

const GRAVITY: f64 = 9.8125;
pub(super) const SECOND_NS: i64 = 1_000_000_000;

/// A level turn at constant yaw rate and surge from heading north, without Earth rate.
pub(super) struct Turn {
    pub(super) time_ns: Vec<i64>,
    pub(super) position: Vec<[f64; 3]>,
    pub(super) attitude: Vec<[f64; 4]>,
    pub(super) velocity: Vec<[f64; 3]>,
    pub(super) omega: Vec<[f64; 3]>,
    pub(super) force: Vec<[f64; 3]>,
}

impl Turn {
    pub(super) fn new(rate: f64, speed: f64, seconds: i64, rate_hz: i64) -> Self {
        let count = seconds * rate_hz + 1;
        let time_ns: Vec<i64> = (0..count).map(|k| k * SECOND_NS / rate_hz).collect();
        let at = |t: &i64| *t as f64 * 1e-9;
        let position = |t: f64| {
            if rate == 0.0 {
                [speed * t, 0.0, 0.0]
            } else {
                let radius = speed / rate;
                [radius * (rate * t).sin(), radius * (1.0 - (rate * t).cos()), 0.0]
            }
        };
        Self {
            position: time_ns.iter().map(|t| position(at(t))).collect(),
            attitude: time_ns
                .iter()
                .map(|t| Rot::<Tangent, Platform>::from_euler_rad(0.0, 0.0, rate * at(t)).to_quaternion_wxyz())
                .collect(),
            velocity: vec![[speed, 0.0, 0.0]; count as usize],
            omega: vec![[0.0, 0.0, rate]; count as usize],
            force: vec![[0.0, rate * speed, -GRAVITY]; count as usize],
            time_ns,
        }
    }

    pub(super) fn truth(&self) -> Truth<'_> {
        Truth {
            time_ns: &self.time_ns,
            position_t_m: &self.position,
            attitude_t_p: &self.attitude,
            velocity_p_mps: &self.velocity,
            omega_p_radps: &self.omega,
            force_p_mps2: &self.force,
        }
    }
}

pub(super) fn model() -> Model {
    let mut model = Model::table_2();
    model.environment.gravity_mps2 = GRAVITY;
    model.environment.earth_rate_radps = 0.0;
    model
}

pub(super) fn janus() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 0.35).unwrap()
}

pub(super) fn beams(count: usize) -> Aiding {
    Aiding {
        beams: BeamMask::all(count),
        ..Aiding::default()
    }
}

pub(super) fn whole(system: &System) -> Observability {
    observe(system, system.epochs.len(), None).unwrap()
}

pub(super) fn inertial(turn: &Turn, aiding: &Aiding) -> System {
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

/// At rest by hand (2015, Eq. 29): z gyro bias, yaw, and each tilt combined with the accelerometer bias that cancels
/// it.
#[test]
fn at_rest_four_directions_are_unobservable() {
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

/// A constant turn leaves rank 8, at rest and at speed, with the consistent sign; at speed 9 with the printed one
/// (erratum E10).
#[test]
fn a_constant_turn_has_rank_eight() {
    let rate = 1_f64.to_radians();
    let (still, moving) = (Turn::new(rate, 0.0, 120, 50), Turn::new(rate, 10.0, 120, 50));
    for sign in [Sign::Printed, Sign::Consistent] {
        assert_eq!(whole(&paper_dvl(&still, sign)).rank, 8);
    }
    assert_eq!(whole(&paper_dvl(&moving, Sign::Printed)).rank, 9);
    assert_eq!(whole(&paper_dvl(&moving, Sign::Consistent)).rank, 8);
}

/// The closed form of the paper and the Magnus expansion of the filter's model agree after a change of coordinates.
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

/// Unobservable directions give zero readings over the window, and zero energy in the Gramian.
#[test]
fn unobservable_directions_read_zero() {
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

/// Other units of the states do not change a rank.
#[test]
fn scaling_does_not_change_a_rank() {
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

/// With full rank the basis is empty.
#[test]
fn full_rank_has_no_basis() {
    let aiding = Aiding {
        sensors: SensorSet::from_iter([Sensor::GpsPosition, Sensor::GpsVelocity, Sensor::Attitude]),
        ..Aiding::default()
    };
    let found = whole(&inertial(&Turn::new(0.05, 3.0, 60, 50), &aiding));
    assert_eq!((found.rank, found.basis.nrows(), found.decided), (15, 0, true));
}

/// Covariance analysis: an unobservable direction keeps its deviation, an observable one loses most of it.
#[test]
fn unobservable_directions_keep_their_deviation() {
    let turn = Turn::new(0.05, 3.0, 60, 50);
    let (truth, geometry, aiding) = (turn.truth(), janus(), beams(4));
    let mut quiet = model();
    quiet.imu.accel_noise_mps_rts = 0.0;
    quiet.imu.gyro_noise_rad_rts = 0.0;
    quiet.imu.accel_bias_walk_mps2_rts = 0.0;
    quiet.imu.gyro_bias_walk_radps_rts = 0.0;
    let history = of_filter(
        &truth,
        &geometry,
        &quiet,
        &aiding,
        false,
        Epochs::Every(SECOND_NS),
        &Stop::new(),
    )
    .unwrap();
    let last = &history.covariance[history.covariance.len() - 1];
    let first = quiet.initial_covariance(false);
    // Yaw is unobservable, so its deviation grows with the gyro bias; heave is observable.
    assert!(last[(5, 5)] >= first[(5, 5)], "{}", last[(5, 5)]);
    assert!(last[(8, 8)] < 0.1 * first[(8, 8)]);
    let sensors = Sensors {
        velocity: Some(Sign::Consistent),
        depth: false,
    };
    let paper = of_paper(&truth, &quiet, &sensors, SECOND_NS, &Stop::new()).unwrap();
    // Without process noise the information uᵀP⁻¹u along an unobservable direction is constant.
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
