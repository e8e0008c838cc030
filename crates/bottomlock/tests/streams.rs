//! Sensor streams: offsets and independent random numbers.

// Helpers outside `#[test]` functions panic on failure too.
#![allow(clippy::unwrap_used)]

mod common;

use bottomlock::aiding::registry::SensorKind;
use bottomlock::dvl::geometry::BeamMask;
use bottomlock::navigator::events::{AttitudeSample, DepthSample, GpsSample};
use bottomlock::simulation::schedule::Schedule;

use common::{Epochs, Turn, draw};

/// A depth or yaw offset changes its own reading by that offset, and no other stream.
#[test]
fn offsets_change_their_own_reading_alone() {
    let (turn, epochs) = (Turn::new(8, 0.05), Epochs::new(8));
    let (depth, yaw) = (vec![0.5; epochs.depth.len()], vec![0.1; epochs.magnetometer.len()]);
    let off = epochs.schedule().with(SensorKind::Depth, &epochs.depth, &depth).with(
        SensorKind::Attitude,
        &epochs.magnetometer,
        &yaw,
    );
    let drawn = |schedule: &Schedule<'_>| draw(&turn, schedule, 1, 2, 3);
    let (ideal, moved) = (drawn(&epochs.schedule()).unwrap(), drawn(&off).unwrap());
    for (a, b) in ideal.of::<DepthSample>().zip(moved.of::<DepthSample>()) {
        assert!((b.depth_m - a.depth_m - 0.5).abs() < 1e-12);
    }
    for (a, b) in ideal.of::<AttitudeSample>().zip(moved.of::<AttitudeSample>()) {
        let [roll, pitch, turned] = b.attitude_t_p.to_euler_rad();
        let [roll_0, pitch_0, yaw_0] = a.attitude_t_p.to_euler_rad();
        let apart = [roll - roll_0, pitch - pitch_0, turned - yaw_0 - 0.1];
        assert!(apart.iter().all(|angle| angle.abs() < 1e-12), "{apart:?}");
    }
    assert!(
        ideal.imu == moved.imu
            && ideal.of::<GpsSample>().eq(moved.of::<GpsSample>())
            && ideal.scale_factor == moved.scale_factor
    );
    let short = epochs.schedule().with(SensorKind::Depth, &epochs.depth, &depth[1..]);
    assert!(drawn(&short).unwrap_err().to_string().contains("depth_offset_m"));
}

/// A sensor that is off, or a lost beam, does not change the random numbers of the others.
#[test]
fn streams_are_independent() {
    let (turn, mut epochs) = (Turn::new(5, 0.05), Epochs::new(5));
    let all = draw(&turn, &epochs.schedule(), 1, 2, 3).unwrap();
    epochs.depth.clear();
    epochs.masks = vec![BeamMask::NONE; epochs.dvl.len()];
    let fewer = draw(&turn, &epochs.schedule(), 1, 2, 3).unwrap();
    assert_eq!(all.imu, fewer.imu);
    assert!(all.of::<AttitudeSample>().eq(fewer.of::<AttitudeSample>()));
    for (a, b) in all.pings.iter().zip(&fewer.pings) {
        assert_eq!(a.velocity_mps[..4], b.velocity_mps[..4]);
    }
}
