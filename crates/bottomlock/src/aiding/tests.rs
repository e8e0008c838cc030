//! Every H against central differences of its own residual, also at pitch ±89.9°.

use super::acoustic_position::AcousticPositionSample;
use super::gps::gps_velocity;
use super::sensor::Reading;
use super::*;
use crate::testing::*;

const EARTH: [f64; 3] = [6.1e-5, 0.0, -4.0e-5];
const RATE: [f64; 3] = [0.1, -0.2, 0.3];

fn state(pitch_deg: f64) -> NavState {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.4, pitch_deg.to_radians(), -1.1);
    state.velocity_p_mps = Vec3::new(2.0, 0.2, -0.1);
    state.position_t_m = Vec3::new(10.0, -5.0, 30.0);
    state.gyro_bias_p_radps = Vec3::new(1e-3, 2e-3, -1e-3);
    state.dvl_bias_mps = nalgebra::Vector4::new(0.01, -0.02, 0.0, 0.005);
    state.dvl_scale_factor = 0.02;
    state
}

fn motion_of(state: &NavState) -> Motion<'_> {
    Motion {
        rate_ip_p_radps: Vector3::from(RATE) - state.gyro_bias_p_radps.0,
        earth_rate_t_radps: Vector3::from(EARTH),
        gyro_variance: 1e-6,
        ..Motion::still(state)
    }
}

/// H = −∂residual/∂x̂: central differences of the residual when the estimate moves.
fn check_at(name: &str, pitch: f64, residual_of: impl Fn(&Motion<'_>) -> Innovation) {
    let center = state(pitch);
    let at = |error: &ErrorVector| {
        let mut moved = center;
        moved.inject(error);
        residual_of(&motion_of(&moved))
    };
    let stated = at(&ErrorVector::zeros()).jacobian;
    let allowed = 1e-6 * stated.amax().max(1.0);
    assert_slopes(&format!("{name} at pitch {pitch}"), &stated, [1e-5, allowed], |error| {
        at(error).residual
    });
}

fn check(name: &str, residual_of: impl Fn(&Motion<'_>) -> Innovation) {
    for pitch in [0.0, 12.0, -70.0, 89.9, -89.9] {
        check_at(name, pitch, &residual_of);
    }
}

fn geometry() -> BeamGeometry {
    let levers = [[1.0, 0.1, 0.2], [0.9, 0.1, 0.2], [0.9, -0.1, 0.2], [1.0, -0.1, 0.3]].map(Vec3::from_array);
    BeamGeometry::janus(Janus::X, 0.35)
        .unwrap()
        .with_lever_arms(&levers)
        .unwrap()
}

fn ping(valid: BeamMask) -> BeamSample {
    ping_of(0, [0.5, -0.4, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0], 0.042, valid)
}

#[test]
fn tightly_coupled_jacobian() {
    let sample = ping(BeamMask::all(4));
    check("tc", |motion| {
        tightly_coupled(&beam_terms(motion, &geometry(), &sample), &sample)
    });
}

/// The gain is a constant of the measurement, and 1/(1+SF) multiplies a residual that vanishes at the expected readings, so the
/// derivative is taken there.
#[test]
fn loosely_coupled_jacobian() {
    for method in [
        PartialMethod::NullifiedSway,
        PartialMethod::PartialLoose,
        PartialMethod::Information,
        PartialMethod::WeakSway,
    ] {
        let noise = BeamNoise::identity() * 0.002;
        let valid = [0, 1].into_iter().collect();
        let fixed = fix_estimator(method, &geometry(), valid, &noise, None, &Assumptions::default()).unwrap();
        for pitch in [0.0, 89.9] {
            let center = state(pitch);
            let mut sample = ping(valid);
            let expected = beam_terms(&motion_of(&center), &geometry(), &sample).residual;
            (0..4).for_each(|beam| sample.velocity_mps[beam] -= expected[beam]);
            check_at("elc", pitch, |motion| {
                let terms = beam_terms(motion, &geometry(), &sample);
                loosely_coupled(motion.state, &geometry(), &terms, &fixed, InformationPort::Axes, None)
            });
        }
    }
}

#[test]
fn velocity_jacobian() {
    check("velocity", |motion| {
        velocity(motion.state, &Vec3::new(2.0, 0.0, 0.0), &Matrix3::identity())
    });
}

#[test]
fn depth_jacobian() {
    check("depth", |motion| depth(motion, 31.0, 0.02, &Vec3::new(0.7, 0.2, -0.1)));
}

#[test]
fn gps_jacobians() {
    let lever = Vec3::new(0.5, 0.1, -0.4);
    check("gps position", |motion| {
        position(motion, &Vec3::zeros(), &[2.0; 3], &lever)
    });
    check("gps velocity", |motion| {
        gps_velocity(motion, &Vec3::zeros(), &[0.1; 3], &lever)
    });
}

/// Of an acoustic fix with its lever arm; on end, pitch ±90°, as anywhere.
#[test]
fn acoustic_position_jacobian() {
    let lever = Vec3::new(0.8, -0.3, 0.6);
    let fix = AcousticPositionSample {
        time_ns: 0,
        position_t_m: Vec3::new(12.0, -4.0, 31.0),
        sd_m: [1.0; 3],
    };
    let residual_of = |motion: &Motion<'_>| fix.innovation(Sensor::AcousticPosition, motion, &lever);
    check("acoustic position", residual_of);
    check_at("acoustic position", 90.0, residual_of);
    check_at("acoustic position", -90.0, residual_of);
}

/// The rotation residual is linear in ρ at the truth; yaw alone is a derivative of Euler's angle, steep near the vertical.
#[test]
fn attitude_jacobians() {
    for pitch in [0.0, 12.0, 89.9, -89.9] {
        let center = state(pitch);
        let turned = |rho: &Vector3<f64>| {
            let (mut moved, mut error) = (center, ErrorVector::zeros());
            error.fixed_rows_mut::<3>(ATTITUDE).copy_from(rho);
            moved.inject(&error);
            moved
        };
        let at = |rho: &Vector3<f64>| attitude(&Motion::still(&turned(rho)), &center.attitude_t_p, 0.02, 0.1);
        let stated = at(&Vector3::zeros()).jacobian.fixed_columns::<3>(ATTITUDE).into_owned();
        assert_slopes(&format!("attitude, {pitch}"), &stated, [1e-5, 1e-6], |rho| {
            at(rho).residual
        });
        let yaw = center.attitude_t_p.to_euler_rad()[2];
        let at = |rho: &Vector3<f64>| heading(&Motion::still(&turned(rho)), yaw, 0.1);
        let stated = at(&Vector3::zeros()).jacobian.fixed_columns::<3>(ATTITUDE).into_owned();
        let allowed = 2e-5 * stated.amax().max(1.0);
        assert_slopes(&format!("yaw, {pitch}"), &stated, [1e-8, allowed], |rho| {
            at(rho).residual
        });
    }
}

/// The least noise of the tilt of an attitude reading: roll times cos(pitch), and towards the vertical, where its direction is
/// itself uncertain, roll times the reading's own error of 0.05 rad.
#[test]
fn the_tilt_of_an_attitude_is_never_without_noise() {
    for (pitch_deg, least) in [
        (0.0_f64, 0.03),
        (60.0, 0.015),
        (86.0, 0.03 * 86_f64.to_radians().cos()),
        (88.0, 0.03 * 0.05),
        (-90.0, 0.03 * 0.05),
    ] {
        let center = state(pitch_deg);
        let noise = attitude(&Motion::still(&center), &center.attitude_t_p, 0.03, 0.04).noise;
        let tilt = noise.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigenvalues();
        assert!(
            (tilt.min().sqrt() / least - 1.0).abs() < 1e-9,
            "pitch {pitch_deg}: {tilt}"
        );
        assert!((tilt.max().sqrt() / 0.03 - 1.0).abs() < 1e-9);
        let yaw = 0.04_f64.powi(2) + (0.03 * pitch_deg.to_radians().sin()).powi(2);
        assert!((noise[(2, 2)] / yaw - 1.0).abs() < 1e-9);
    }
}

/// Yaw means nothing on end: no row, no error.
#[test]
fn heading_on_end_is_no_measurement() {
    assert_eq!(heading(&Motion::still(&state(90.0)), 0.3, 0.1).rows, 0);
}

/// On the ellipsoid, 50 km from the origin: depth, heading and attitude by differences, whose level turns with the position.
#[test]
fn rows_at_a_place_are_derivatives() {
    let earth = Earth::from(&Environment::normal(1.2, 0.0).on(EarthModel::Ellipsoid));
    let mut center = state(12.0);
    center.position_t_m = Vec3::new(30e3, -40e3, 250.0);
    let motion_at = |state: &NavState| earth.level(&state.position_t_m);
    let measured = motion_at(&center).rotation_n_t() * center.attitude_t_p;
    let yaw = measured.to_euler_rad()[2];
    let readings = |motion: &Motion<'_>| {
        [
            depth(motion, 100.0, 0.02, &Vec3::new(0.7, 0.2, -0.1)),
            heading(motion, yaw, 0.01),
            attitude(motion, &measured, 0.02, 0.1),
        ]
    };
    let at = |error: &ErrorVector| {
        let mut moved = center;
        moved.inject(error);
        let level = motion_at(&moved);
        readings(&Motion {
            level,
            ..motion_of(&moved)
        })
    };
    let reference = at(&ErrorVector::zeros());
    assert!(reference[1].residual[0].abs() < 1e-12 && reference[2].residual.amax() < 1e-12);
    for (columns, step, allowed) in [
        (POSITION..POSITION + 3, 20.0, 1e-11),
        (ATTITUDE..ATTITUDE + 3, 1e-5, 1e-6),
    ] {
        for j in columns {
            let mut error = ErrorVector::zeros();
            error[j] = step;
            let (ahead, behind) = (at(&error), at(&-error));
            for (k, one) in reference.iter().enumerate() {
                let slope = (behind[k].residual - ahead[k].residual) / (2.0 * step);
                let gap = (slope - one.jacobian.column(j)).amax();
                // The depth's own rounding is 1e-9 m.
                let allowed = if k == 0 { 1e-6_f64.max(allowed) } else { allowed };
                assert!(gap < allowed, "sensor {k}, column {j}: {gap}");
            }
        }
    }
    assert!(reference[1].jacobian.fixed_view::<1, 3>(0, POSITION).norm() > 1e-7);
}
