//! Sensor streams: offsets and independent random numbers.

use crate::common::*;
use bottomlock::aiding::beams::DvlOutlierModel;
use bottomlock::aiding::sensor::Fraction;
use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams::{Streams, simulate};

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

/// Of the beams a fraction have a multiple of the noise; the others and every other stream keep their bits, and so does all
/// that the sensor claims.
#[test]
fn beam_outliers_leave_the_other_readings_alone() {
    let (turn, epochs) = (Turn::new(300, 0.05), Epochs::new(300));
    let claimed = Model::table_2();
    let of = |noise: f64, fraction: f64| -> Streams {
        let mut model = claimed;
        model.sensors.dvl.beam_noise_sd_mps *= noise;
        model.sensors.dvl_outliers = DvlOutlierModel {
            outlier_fraction: Fraction(fraction),
            outlier_factor: 8.0,
        };
        let key = RunKey {
            seed: 1,
            trajectory: 2,
            run: 3,
        };
        let (truth, options) = (turn.truth(), Options::default());
        simulate(&truth, &janus(), &model, &claimed, &epochs.schedule(), &options, &key).unwrap()
    };
    let (silent, clean, with, all) = (of(0.0, 0.0), of(1.0, 0.0), of(1.0, 0.25), of(1.0, 1.0));
    let plain = draw(&turn, &epochs.schedule(), 1, 2, 3).unwrap();
    let mut outliers = [0; 4];
    for (k, ping) in with.pings.iter().enumerate() {
        assert_eq!(ping.sd_mps, plain.pings[k].sd_mps);
        assert_eq!(clean.pings[k].velocity_mps[..4], plain.pings[k].velocity_mps[..4]);
        for (beam, count) in outliers.iter_mut().enumerate() {
            let reading = |streams: &Streams| streams.pings[k].velocity_mps[beam];
            let error = |streams: &Streams| reading(streams) - reading(&silent);
            assert!((error(&all) - 8.0 * error(&clean)).abs() < 1e-12);
            if reading(&with) != reading(&clean) {
                assert_eq!(reading(&with).to_bits(), reading(&all).to_bits());
                *count += 1;
            }
        }
    }
    // Binomial for each beam: 75 with a standard deviation of 7.5; five of them either way.
    assert!(outliers.iter().all(|count| (38..=112).contains(count)), "{outliers:?}");
    assert!(with.imu == clean.imu && with.scale_factor == clean.scale_factor && with.sensors == clean.sensors);
}
