//! Every reading's numbers are checked before a filter sees them: what is measured is finite, every sigma positive.

use super::attitude::AttitudeSample;
use super::gps::{GpsSample, GpsVelocity};
use super::heading::HeadingSample;
use super::sensor::Reading;
use super::velocity::VelocitySample;
use crate::testing::*;

#[test]
fn scalars() {
    let depth = DepthSample {
        time_ns: 7,
        depth_m: 20.0,
        sd_m: 0.1,
    };
    assert_refused(
        &depth,
        Reading::validate,
        &[("depth_m", |r| r.depth_m = f64::NAN), ("sd_m", |r| r.sd_m = 0.0)],
    );
    let heading = HeadingSample {
        time_ns: 7,
        yaw_rad: 1.0,
        sd_rad: 0.02,
    };
    assert_refused(
        &heading,
        Reading::validate,
        &[
            ("yaw_rad", |r| r.yaw_rad = f64::INFINITY),
            ("sd_rad", |r| r.sd_rad = -0.1),
        ],
    );
    let thrust = ThrustSample {
        time_ns: 7,
        speed_p_mps: Vec3::new(-2.0, 0.0, 0.1),
        sd_mps: 0.01,
    };
    assert_refused(
        &thrust,
        Reading::validate,
        &[
            ("thrust speed_p_mps", |r| r.speed_p_mps.0.y = f64::NAN),
            ("number of revolutions", |r| r.speed_p_mps.0.x = -1500.0),
            ("thrust sd_mps", |r| r.sd_mps = 0.0),
        ],
    );
}

#[test]
fn attitudes() {
    let attitude = AttitudeSample {
        time_ns: 7,
        attitude_t_p: Rot::from_euler_rad(0.1, 0.2, 0.3),
        roll_pitch_sd_rad: 0.01,
        yaw_sd_rad: 0.02,
    };
    assert_refused(
        &attitude,
        Reading::validate,
        &[
            ("attitude_t_p", |r| {
                r.attitude_t_p = Rot::from_euler_rad(f64::NAN, 0.0, 0.0)
            }),
            ("roll_pitch_sd_rad", |r| r.roll_pitch_sd_rad = 0.0),
            ("yaw_sd_rad", |r| r.yaw_sd_rad = f64::NAN),
        ],
    );
}

#[test]
fn vectors() {
    let gps = GpsSample {
        time_ns: 7,
        position_t_m: Vec3::new(1.0, 2.0, 3.0),
        position_sd_m: [1.0; 3],
        velocity: Some(GpsVelocity {
            velocity_t_mps: Vec3::new(1.0, 0.0, 0.0),
            sd_mps: [0.1; 3],
        }),
    };
    assert_refused(
        &gps,
        Reading::validate,
        &[
            ("position_t_m", |r| r.position_t_m = Vec3::new(1.0, f64::NAN, 3.0)),
            ("gps sd", |r| r.position_sd_m[2] = 0.0),
            ("velocity_t_mps", |r| {
                r.velocity.as_mut().unwrap().velocity_t_mps = Vec3::new(f64::NAN, 0.0, 0.0)
            }),
            ("gps sd", |r| r.velocity.as_mut().unwrap().sd_mps[1] = -1.0),
        ],
    );
    let velocity = VelocitySample {
        time_ns: 7,
        velocity_p_mps: Vec3::new(2.0, 0.0, 0.0),
        cov_m2ps2: Matrix3::identity(),
    };
    assert_refused(
        &velocity,
        Reading::validate,
        &[
            ("velocity_p_mps", |r| r.velocity_p_mps = Vec3::new(f64::NAN, 0.0, 0.0)),
            ("velocity_p_mps", |r| r.velocity_p_mps = Vec3::new(1e4, 0.0, 0.0)),
            ("cov_m2ps2", |r| r.cov_m2ps2[(0, 1)] = f64::NAN),
            ("cov_m2ps2", |r| r.cov_m2ps2[(1, 1)] = 0.0),
        ],
    );
}
