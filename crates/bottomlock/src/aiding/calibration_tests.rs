//! Mounting and clock in the beams: by hand, against differences, and what no reading sees.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::aiding::InformationPort;
use crate::error_model::Coefficients;
use crate::mechanisation::{EarthTerms, Inertial};
use crate::testing::*;

const RATE: [f64; 3] = [0.1, -0.2, 0.3];
const FORCE: [f64; 3] = [0.4, -0.3, -9.6];

fn environment() -> Environment {
    Environment::normal(0.57, 0.0)
}

fn still(acceleration: [f64; 3]) -> MotionChange {
    MotionChange {
        acceleration_p_mps2: acceleration.into(),
        angular_acceleration_p_radps2: Vector3::zeros(),
        velocity_by_state: SMatrix::zeros(),
    }
}

fn ping(valid: BeamMask) -> BeamSample {
    ping_of(0, [0.5, -0.4, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0], 0.01, valid)
}

/// The columns of mounting and clock.
fn own(terms: &BeamTerms) -> SMatrix<f64, MAX_ROWS, CALIBRATION> {
    let rows = terms.by_further.as_deref().unwrap();
    rows.fixed_columns::<CALIBRATION>(block::CALIBRATION.first).into_owned()
}

/// 2 m/s ahead and 0.5 m/s² more each second, beams tilted by 30°. Beam 1 points to starboard ahead: turned to starboard by ψ
/// it sees 2 sin 30° sin 45° ψ less, pitched up by ψ it sees 2 cos 30° ψ more, and 0.5 sin 30° cos 45° more each second late.
#[test]
fn by_hand() {
    let geometry = BeamGeometry::janus(Janus::X, PI / 6.0).unwrap();
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let motion = Motion::still(&state);
    let sample = ping(BeamMask::all(4));
    let change = still([0.5, 0.0, 0.0]);
    let terms = calibrated_beam_terms(&motion, &change, &geometry, &Calibration::default(), &sample);
    let rows = own(&terms);
    let root = 0.5_f64.sqrt();
    let expected = [0.0, 2.0 * 0.75_f64.sqrt(), -2.0 * 0.5 * root, 0.5 * 0.5 * root];
    for (k, value) in expected.into_iter().enumerate() {
        assert!((rows[(0, k)] - value).abs() < 1e-15, "{k}: {} of {value}", rows[(0, k)]);
    }
    // 0.1 s late the surge is 2.05 m/s, and turned by 45° to starboard beam 1 looks abeam.
    let estimate = Calibration {
        mounting: Rot::exp(Vector3::new(0.0, 0.0, PI / 4.0)),
        clock_s: 0.1,
    };
    let terms = calibrated_beam_terms(&motion, &change, &geometry, &estimate, &sample);
    assert!((terms.residual[0] - 0.5).abs() < 1e-15);
    assert!((terms.residual[1] - (-0.4 + 2.05 * 0.5)).abs() < 1e-15);
}

fn state(pitch_rad: f64) -> NavState {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.4, pitch_rad, -1.1);
    state.velocity_p_mps = Vec3::new(2.0, 0.2, -0.1);
    state.accel_bias_p_mps2 = Vec3::new(0.01, -0.02, 0.03);
    state.gyro_bias_p_radps = Vec3::new(1e-3, 2e-3, -1e-3);
    state.dvl_bias_mps = nalgebra::Vector4::new(0.01, -0.02, 0.0, 0.005);
    state.dvl_scale_factor = 0.02;
    state
}

/// Terms at a state whose acceleration is that of the inertial readings: dv/dt = f + Rᵀg − (ω_ip + Rᵀω_ie) × v.
fn terms_at(state: &NavState, estimate: &Calibration) -> BeamTerms {
    let environment = environment();
    let earth = EarthTerms::from(&environment);
    let earth_rate: Vector3<f64> = earth.rate_t.into();
    let to_platform = state.attitude_t_p.inverse();
    let in_platform = |vector: Vector3<f64>| (to_platform * Vec3::<Tangent>::from(vector)).0;
    let rate = Vector3::from(RATE) - state.gyro_bias_p_radps.0;
    let force = Vector3::from(FORCE) - state.accel_bias_p_mps2.0;
    let gravity = in_platform(Vector3::new(0.0, 0.0, environment.gravity_mps2));
    let coriolis = (rate + in_platform(earth_rate)).cross(&state.velocity_p_mps.0);
    let inertial = Inertial {
        rate_p_radps: rate.into(),
        force_p_mps2: force.into(),
    };
    let f = Coefficients::at(&state.kinematics(), &inertial, &earth).dense(&earth);
    let change = MotionChange {
        acceleration_p_mps2: force + gravity - coriolis,
        angular_acceleration_p_radps2: Vector3::new(0.02, -0.05, 0.1),
        velocity_by_state: SMatrix::from_fn(|i, j| f[VELOCITY + i][j]),
    };
    let motion = Motion {
        rate_ip_p_radps: rate,
        earth_rate_t_radps: earth_rate,
        gyro_variance: 1e-6,
        ..Motion::still(state)
    };
    let levers = [[1.0, 0.1, 0.2], [0.9, 0.1, 0.2], [0.9, -0.1, 0.2], [1.0, -0.1, 0.3]].map(Vec3::from_array);
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let geometry = geometry
        .mounted(Rot::from_euler_rad(0.1, -0.2, 0.7))
        .with_lever_arms(&levers)
        .unwrap();
    calibrated_beam_terms(&motion, &change, &geometry, estimate, &ping(BeamMask::all(4)))
}

/// H = −∂residual/∂x̂ by the 20 states and by mounting and clock: central differences, also on end.
#[test]
fn jacobians_are_derivatives() {
    let estimate = Calibration {
        mounting: Rot::exp(Vector3::new(0.05, -0.1, 0.2)),
        clock_s: 0.15,
    };
    for pitch in [0.0, -1.2, 1.569, FRAC_PI_2, -FRAC_PI_2] {
        let at = |error: &ErrorVector, by: &CalibrationVector| {
            let (mut state, mut estimate) = (state(pitch), estimate);
            state.inject(error);
            estimate.inject(by);
            terms_at(&state, &estimate)
        };
        let (zero, none, place) = (
            ErrorVector::zeros(),
            CalibrationVector::zeros(),
            format!("pitch {pitch}"),
        );
        let stated = at(&zero, &none);
        assert_slopes(&place, &stated.jacobian, [1e-5, 1e-7], |error| {
            at(error, &none).residual
        });
        assert_slopes(&place, &own(&stated), [1e-5, 1e-7], |by| at(&zero, by).residual);
    }
}

/// A rotation about the velocity is seen by no beam; at rest none is, and at constant velocity no clock.
#[test]
fn what_no_beam_sees() {
    let geometry = BeamGeometry::janus(Janus::Plus, 0.4).unwrap();
    let velocity = Vector3::new(1.5, -0.4, 0.2);
    for speed in [1.0, 0.0] {
        let mut state = NavState::at_rest(0);
        state.velocity_p_mps = Vec3::from(velocity * speed);
        let motion = Motion::still(&state);
        let sample = ping(BeamMask::all(4));
        let terms = calibrated_beam_terms(&motion, &still([0.0; 3]), &geometry, &Calibration::default(), &sample);
        let rows = own(&terms);
        assert_eq!(rows.column(CLOCK).amax(), 0.0);
        let unseen = rows.fixed_columns::<3>(0) * velocity;
        assert!(unseen.amax() < 1e-15);
        assert_eq!(rows.amax() > 0.1, speed > 0.0);
    }
}

/// Rows keep to their beams where some are lost.
#[test]
fn rows_follow_the_beams() {
    let all = terms_at(&state(0.1), &Calibration::default());
    let some: BeamMask = [1, 3].into_iter().collect();
    let mut of_some = all.clone();
    let innovation = crate::aiding::tightly_coupled(&of_some, &ping(some));
    let (rows, picked) = (all.by_further.unwrap(), innovation.by_further.unwrap());
    assert_eq!(picked.row(0), rows.row(1));
    assert_eq!(picked.row(1), rows.row(3));
    assert_eq!(picked.row(2).amax(), 0.0);
    of_some.by_further = None;
    assert!(
        crate::aiding::tightly_coupled(&of_some, &ping(some))
            .by_further
            .is_none()
    );
}

/// The rows of a fix are those of its beams through its gain, also with a scale factor: −∂residual/∂x̂ by mounting and clock.
#[test]
fn a_fix_carries_its_beams() {
    let center = state(0.3);
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let noise = BeamNoise::identity() * 1e-4;
    for (valid, rows) in [(BeamMask::all(4), 3), ([0, 1].into_iter().collect(), 2)] {
        let method = PartialMethod::Information;
        let plan = fix_estimator(method, &geometry, valid, &noise, None, &Assumptions::default()).unwrap();
        let fix = |by: &CalibrationVector| {
            let mut estimate = Calibration::default();
            estimate.inject(by);
            let terms = terms_at(&center, &estimate);
            crate::aiding::loosely_coupled(&center, &geometry, &terms, &plan, InformationPort::Axes, None)
        };
        let stated = fix(&CalibrationVector::zeros());
        assert_eq!(stated.rows, rows);
        let further = stated.by_further.unwrap();
        let stated = further
            .fixed_columns::<CALIBRATION>(block::CALIBRATION.first)
            .into_owned();
        assert_slopes(&format!("{rows} rows"), &stated, [1e-5, 1e-7], |by| fix(by).residual);
    }
}
