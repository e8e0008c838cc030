//! Slow errors of sensors and the motion: by hand, and what they are for.

use super::*;
use crate::filter::level_turn::advance;
use crate::model::ImuModel;
use crate::testing::*;

fn filter_of(change: impl FnOnce(&mut Model)) -> Eskf {
    let mut model = Model::table_2();
    model.initial.attitude_sd_rad = [0.1; 3];
    change(&mut model);
    Eskf::new(NavState::at_rest(0), &model, &every_step()).unwrap()
}

/// At rest with a depth of 2.3 m where 0 is expected: a bias of 0.3 m beside a position of 2 m takes 0.3²/(2² + 0.3² + 0.02²) of it;
/// the next reading is expected with that bias.
#[test]
fn bias_of_a_depth_by_hand() {
    let mut filter = filter_of(|model| {
        model.sensors.depth = DepthModel {
            sd_m: 0.02,
            bias_sd_m: 0.3,
            bias_time_s: TimeConstant(100.0),
            ..DepthModel::default()
        };
        // Within the linear range.
        model.initial.attitude_sd_rad = [1e-3; 3];
    });
    assert_eq!(filter.depth_bias_m(), Some((0.0, 0.3)));
    let innovation = depth(&Motion::still(&filter.state()), 2.3, 0.02, &Vec3::zeros());
    filter.update(&innovation, Sensor::Depth).unwrap();
    let (estimate_m, sd_m) = filter.depth_bias_m().unwrap();
    assert!((estimate_m - 2.3 * 0.09 / (4.0 + 0.09 + 4e-4)).abs() < 1e-12);
    assert!((sd_m.powi(2) - 0.09 * (4.0 + 4e-4) / (4.0 + 0.09 + 4e-4)).abs() < 1e-12);
    let again = depth(&Motion::still(&filter.state()), 2.3, 0.02, &Vec3::zeros());
    let report = filter.update(&again, Sensor::Depth).unwrap();
    assert!((report.residual[0] - (again.residual[0] - estimate_m)).abs() < 1e-12);
}

/// Waves of 0.5 m and a period of 8 s in a depth that is known to a millimetre: what they are now is −e^(−1/2) of it half a period
/// later, e^(−1) of it a period later, and a quarter of a period later nothing; what is not known of them comes back to 0.5 m.
#[test]
fn waves_in_a_depth_by_hand() {
    let mut filter = filter_of(|model| {
        model.imu = ImuModel::default();
        model.initial.position_sd_m = [1e-3; 3];
        model.initial.velocity_sd_mps = [1e-6; 3];
        model.initial.attitude_sd_rad = [1e-6; 3];
        model.sensors.depth = DepthModel {
            sd_m: 1e-3,
            wave_sd_m: SlowSd(0.5),
            wave_period_s: WavePeriod(8.0),
            ..DepthModel::default()
        };
    });
    let reading = depth(&Motion::still(&filter.state()), 0.4, 1e-3, &Vec3::zeros());
    filter.update(&reading, Sensor::Depth).unwrap();
    for (quarter, factor) in (1..=4).zip([0.0, -(-0.5_f64).exp(), 0.0, (-1.0_f64).exp()]) {
        advance(&mut filter, 200);
        filter.propagate_covariance();
        let wave_m = filter.extensions.further().estimate()[block::DEPTH_WAVE.first];
        let variance = filter.extensions.further().covariance()[(block::DEPTH_WAVE.first, block::DEPTH_WAVE.first)];
        let left: f64 = (-f64::from(quarter) / 4.0).exp();
        // In quadrature nothing was known from the start.
        let known = if quarter % 2 == 0 { left * left } else { 0.0 };
        assert!((wave_m - 0.4 * factor).abs() < 1e-4, "{quarter}: {wave_m}");
        assert!((variance - 0.25 * (1.0 - known)).abs() < 1e-4, "{quarter}: {variance}");
    }
}

/// A hundred headings of 0.1 rad at rest, exact but for an offset of 0.03 and a start of 0.1: the yaw goes to
/// 0.1²/(0.1² + 0.03²) of it and stays that uncertain, where white noise would claim a tenth of that.
#[test]
fn an_offset_is_not_averaged_away() {
    let (offset, start, white) = (0.03, 0.1, 0.01);
    let headings = |offset_sd_rad: f64| {
        let mut filter = filter_of(|model| {
            model.sensors.heading = HeadingModel {
                sd_rad: white,
                offset_sd_rad: SlowSd(offset_sd_rad),
                ..HeadingModel::default()
            };
        });
        for _ in 0..100 {
            let reading = heading(&Motion::still(&filter.state()), 0.1, white);
            filter.update(&reading, Sensor::Heading).unwrap();
        }
        filter
    };
    let filter = headings(offset);
    let information = 1.0 / (offset * offset + white * white / 100.0);
    let variance = 1.0 / (1.0 / (start * start) + information);
    let [_, _, yaw] = filter.state().attitude_t_p.to_euler_rad();
    assert!((yaw - 0.1 * variance * information).abs() < 1e-6, "{yaw}");
    assert!((filter.covariance()[(ATTITUDE + 2, ATTITUDE + 2)] / variance - 1.0).abs() < 1e-6);
    let (estimate, sd) = filter.heading_error_rad().unwrap();
    assert!((estimate - 0.1 * offset * offset / (offset * offset + start * start)).abs() < 1e-5);
    assert!(sd < offset);
    let sd_of = |filter: &Eskf| filter.covariance()[(ATTITUDE + 2, ATTITUDE + 2)].sqrt();
    assert!(headings(0.0).heading_error_rad().is_none());
    assert!(sd_of(&headings(0.0)) < 0.1 * sd_of(&filter));
}

/// An attitude that differs in one angle moves the estimated error of that angle alone, in an attitude that is not level:
/// offset and walk share it by their variances.
#[test]
fn each_angle_of_an_attitude_has_its_own_error() {
    let models = MagnetometerModel {
        yaw_sd_rad: 0.01,
        roll_pitch_sd_rad: 0.01,
        yaw_offset_sd_rad: SlowSd(0.04),
        roll_pitch_offset_sd_rad: SlowSd(0.04),
        yaw_walk_sd_rad: SlowSd(0.02),
        roll_pitch_walk_sd_rad: SlowSd(0.02),
        walk_time_s: WalkTime(50.0),
        ..MagnetometerModel::default()
    };
    for angle in 0..3 {
        let mut filter = filter_of(|model| model.sensors.magnetometer = models);
        let own = [0.2, -0.3, 1.0];
        filter.state.attitude_t_p = Rot::from_euler_rad(own[0], own[1], own[2]);
        filter.kinematics = filter.state.kinematics();
        let mut measured = own;
        measured[angle] += 1e-4;
        let reading = Rot::<Tangent, _>::from_euler_rad(measured[0], measured[1], measured[2]);
        let innovation = attitude(&Motion::still(&filter.state()), &reading, 0.01, 0.01);
        filter.update(&innovation, Sensor::Attitude).unwrap();
        let estimate = *filter.extensions.further().estimate();
        let errors = filter.attitude_error_rad().unwrap();
        for other in 0..3 {
            let (value, sd) = errors[other];
            assert!(sd < 0.04_f64.hypot(0.02));
            assert_eq!(value > 1e-5, other == angle, "{angle} {other}: {value}");
        }
        let (offset, walk) = (
            estimate[block::ATTITUDE_ERROR.first + angle],
            estimate[block::ATTITUDE_ERROR.first + 3 + angle],
        );
        assert!((offset / walk - 4.0).abs() < 1e-9);
    }
}

/// An offset stays; a walk decays to nothing, and its variance to the prior's.
#[test]
fn offsets_stay_and_walks_decay() {
    let mut filter = filter_of(|model| {
        model.sensors.heading = HeadingModel {
            sd_rad: 0.01,
            offset_sd_rad: SlowSd(0.03),
            walk_sd_rad: SlowSd(0.03),
            walk_time_s: WalkTime(2.0),
            ..HeadingModel::default()
        };
    });
    let reading = heading(&Motion::still(&filter.state()), 0.1, 0.01);
    filter.update(&reading, Sensor::Heading).unwrap();
    let before = *filter.extensions.further().estimate();
    advance(&mut filter, 401);
    filter.propagated_covariance();
    let after = *filter.extensions.further().estimate();
    assert_eq!(after[block::HEADING_ERROR.first], before[block::HEADING_ERROR.first]);
    let left = after[block::HEADING_ERROR.first + 1] / before[block::HEADING_ERROR.first + 1];
    assert!((left - (-4.01_f64 / 2.0).exp()).abs() < 1e-12, "{left}");
    assert!(before[block::HEADING_ERROR.first] > 0.001);
}

/// Exact yaw but for the deviation, read at rest on the headings of a circle: the filter finds both coefficients of each part,
/// and its estimate of the error is that of its heading.
#[test]
fn a_deviation_is_learnt_on_the_headings_of_a_circle() {
    let coefficients = [0.03, -0.02, 0.01, 0.015];
    let deviation = |yaw: f64| -> f64 {
        let [semi, quad] = [[yaw.cos(), yaw.sin()], [(2.0 * yaw).cos(), (2.0 * yaw).sin()]];
        coefficients[0] * semi[0] + coefficients[1] * semi[1] + coefficients[2] * quad[0] + coefficients[3] * quad[1]
    };
    let mut filter = filter_of(|model| {
        model.sensors.heading = HeadingModel {
            sd_rad: 1e-4,
            semicircular_sd_rad: SlowSd(0.1),
            quadrantal_sd_rad: SlowSd(0.1),
            ..HeadingModel::default()
        };
    });
    for (k, yaw) in (0..24).map(|k| (k, f64::from(k) * std::f64::consts::TAU / 24.0)) {
        filter.state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, yaw);
        filter.kinematics = filter.state.kinematics();
        let reading = heading(&Motion::still(&filter.state()), yaw + deviation(yaw), 1e-4);
        filter.covariance.fill_row(ATTITUDE + 2, 0.0);
        filter.covariance.fill_column(ATTITUDE + 2, 0.0);
        filter.update(&reading, Sensor::Heading).unwrap();
        if k > 12 {
            let (value, sd) = filter.heading_error_rad().unwrap();
            assert!(
                (value - deviation(yaw)).abs() < 5e-4 && sd < 5e-4,
                "{yaw}: {value}, {sd}"
            );
        }
    }
    let estimate = filter.extensions.further().estimate();
    for (k, expected) in coefficients.into_iter().enumerate() {
        assert!(
            (estimate[block::HEADING_DEVIATION.first + k] - expected).abs() < 2e-4,
            "{k}"
        );
    }
    assert!(filter.attitude_error_rad().is_none());
}

/// A vehicle that has gone 2 m/s for long and now does 2.5: the mean follows by little, the change by the most, and without
/// further measurements the velocity goes back to the mean, with the spread of the prior.
#[test]
fn a_velocity_goes_back_to_its_mean() {
    let prior = MotionPrior {
        mean_sd_mps: [1.0, 0.0, 0.0],
        mean_time_s: 1e6,
        change_sd_mps: [0.1, 0.0, 0.0],
        change_time_s: [10.0; 3],
    };
    let mut model = Model::table_2();
    model.initial.velocity_sd_mps = [3.0; 3];
    // The accelerometers say next to nothing.
    model.imu.accel_noise_mps_rts = 1.0;
    let options = Options {
        gate: Gate::Off,
        motion: prior,
        ..Options::default()
    };
    let mut filter = Eskf::new(NavState::at_rest(0), &model, &options).unwrap();
    let surge = |filter: &mut Eskf, speed_mps: Option<f64>| {
        let state = filter.state();
        if let Some(speed_mps) = speed_mps {
            let innovation = velocity_rows(&[speed_mps - state.velocity_p_mps.0.x], 1e-6);
            filter.update(&innovation, Sensor::Velocity).unwrap();
        }
        filter
            .update(&prior.innovation(&filter.state()), Sensor::Motion)
            .unwrap();
        (filter.state().velocity_p_mps.0.x, filter.velocity().1[(0, 0)].sqrt())
    };
    for _ in 0..300 {
        surge(&mut filter, Some(2.0));
        advance(&mut filter, 100);
    }
    let (now, _) = surge(&mut filter, Some(2.1));
    assert!((now - 2.1).abs() < 5e-3, "{now}");
    let mean = filter.extensions.further().estimate()[block::MOTION.first];
    assert!((mean - 2.0).abs() < 0.03, "{mean}");
    for _ in 0..60 {
        advance(&mut filter, 100);
        surge(&mut filter, None);
    }
    let (later, sd) = surge(&mut filter, None);
    // The accelerometers, which feel the level turn, still count for a hundredth of a metre per second.
    assert!((later - mean).abs() < 0.025, "{later} {mean}");
    // The spread of the change, and what is left of the mean's: 0.1² 2 · 10 s / 300 s.
    let expected = (0.01_f64 + 0.01 * 20.0 / 300.0).sqrt();
    assert!((sd / expected - 1.0).abs() < 0.05, "{sd} {expected}");
}

/// A covariance set from outside begins the slow errors anew.
#[test]
fn a_covariance_from_outside_begins_anew() {
    let mut filter = filter_of(|model| model.sensors.heading.offset_sd_rad = SlowSd(0.03));
    let reading = heading(&Motion::still(&filter.state()), 0.1, 0.01);
    filter.update(&reading, Sensor::Heading).unwrap();
    assert!(filter.heading_error_rad().unwrap().0 > 0.0);
    let covariance = filter.covariance();
    filter.set_covariance(&covariance).unwrap();
    assert_eq!(filter.heading_error_rad(), Some((0.0, 0.03)));
}

/// Without a slow error there is no state.
#[test]
fn only_what_is_unknown_is_a_state() {
    let none = filter_of(|_| ());
    assert!(none.extensions.is_empty() && none.attitude_error_rad().is_none());
    assert!(none.heading_error_rad().is_none() && none.depth_bias_m().is_none());
}
