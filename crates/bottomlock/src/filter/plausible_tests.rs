//! Estimates on either side of their bounds, and filters read from bytes with a number that none can have.

use super::*;
use crate::testing::*;

type Change = fn(&mut Eskf);

/// With every further state, on an update that ends an interval.
fn filter() -> Eskf {
    let options = Options {
        calibration: CalibrationPrior {
            mounting_sd_rad: [0.01; 3],
            clock_sd_s: 0.1,
        },
        ..Options::default()
    };
    let mut model = Model::table_2();
    model.sensors.depth.bias_sd_m = 0.3;
    let mut filter = Eskf::new(NavState::at_rest(0), &model, &options)
        .unwrap()
        .with_water(Some(WaterBlock::new(&options.water)));
    let innovation = depth(&Motion::still(&filter.state()), 0.1, 0.02, &Vec3::zeros());
    filter.update(&innovation, Sensor::Depth).unwrap();
    filter
}

/// The bounds themselves are within, what is beyond is not, and a tenth of them is far from them.
#[test]
fn motion_within_its_bounds() {
    let of = |change: Change| {
        let mut filter = filter();
        change(&mut filter);
        (filter.require_plausible_motion().is_ok(), filter.is_far_from_bounds())
    };
    assert_eq!(of(|_| ()), (true, true));
    let at: [Change; 3] = [
        |filter| filter.kinematics.position_t_m[1] = -LARGEST_POSITION_M,
        |filter| filter.kinematics.velocity_t_mps[2] = LARGEST_VELOCITY_MPS,
        |filter| filter.covariance[(7, 7)] = LARGEST_VARIANCE,
    ];
    assert_eq!(at.map(of), [(true, false); 3]);
    let near: [Change; 3] = [
        |filter| filter.kinematics.position_t_m[1] = 0.1 * LARGEST_POSITION_M,
        |filter| filter.kinematics.velocity_t_mps[2] = -0.1 * LARGEST_VELOCITY_MPS,
        |filter| filter.covariance[(7, 7)] = 0.1 * LARGEST_VARIANCE,
    ];
    assert_eq!(near.map(of), [(true, true); 3]);
    let beyond: [Change; 4] = [
        |filter| filter.kinematics.position_t_m[1] = -1.01 * LARGEST_POSITION_M,
        |filter| filter.kinematics.velocity_t_mps[2] = 1.01 * LARGEST_VELOCITY_MPS,
        |filter| filter.covariance[(7, 7)] = 1.01 * LARGEST_VARIANCE,
        |filter| filter.kinematics.position_t_m[0] = f64::NAN,
    ];
    assert_eq!(beyond.map(of), [(false, false); 4]);
    // Within an interval the covariance is that of its start, which has been looked at.
    let mut filter = filter();
    crate::filter::level_turn::advance(&mut filter, 1);
    assert!(filter.interval.duration_s() > 0.0);
    filter.covariance[(7, 7)] = 1.01 * LARGEST_VARIANCE;
    assert!(filter.is_far_from_bounds() && filter.require_plausible().is_err());
}

/// Noise and environment, which do not change.
#[test]
fn settings_within_their_bounds() {
    assert_eq!(filter().require_plausible_settings(), Ok(()));
    let faults: [Change; 4] = [
        |filter| filter.settings.noise.gyro_bias = 1.01 * LARGEST_VARIANCE,
        |filter| filter.settings.noise.dvl_scale = f64::NAN,
        |filter| filter.settings.earth.gravity_mps2 = 1001.0,
        |filter| filter.settings.earth.rate_t[2] = -1001.0,
    ];
    for change in faults {
        let mut filter = filter();
        change(&mut filter);
        assert!(filter.require_plausible_settings().is_err());
    }
}

/// Rounding is relative: to the speed, and to the largest variance.
#[test]
fn restored_filters_are_rounded() {
    let rounded: [Change; 3] = [
        |filter| {
            filter.kinematics =
                crate::mechanisation::Kinematics::new([0.0; 3], [1.0, 0.0, 0.0, 0.0], [100.0, 0.0, 0.0]);
            filter.kinematics.velocity_t_mps[1] += 5e-5;
        },
        |filter| filter.covariance[(12, 15)] += 2e-6,
        |filter| filter.covariance[(19, 19)] = -2e-6,
    ];
    for (number, change) in rounded.into_iter().enumerate() {
        let mut filter = filter();
        change(&mut filter);
        assert_eq!(filter.check_restored(), Ok(()), "{number}");
    }
}

/// Every number of a filter that was read from bytes is looked at.
#[test]
fn restored_filters_are_checked() {
    assert_eq!(filter().check_restored(), Ok(()));
    let faults: [(&str, Change); 19] = [
        ("position", |filter| filter.kinematics.position_t_m[0] = f64::NAN),
        ("velocity", |filter| filter.kinematics.velocity_p_mps[0] = f64::NAN),
        ("attitude", |filter| filter.kinematics.attitude_t_p[0] *= 1.0 + 3e-6),
        ("rotation", |filter| filter.kinematics.rotation_t_p[1][2] += 1e-5),
        ("rotation", |filter| filter.kinematics.rotation_t_p[1][2] = f64::NAN),
        ("rotation", |filter| filter.kinematics.velocity_t_mps[2] -= 1e-5),
        ("accel_bias", |filter| filter.state.accel_bias_p_mps2.0.x = f64::NAN),
        ("dvl_bias", |filter| filter.state.dvl_bias_mps[3] = f64::NAN),
        ("dvl_scale_factor", |filter| filter.state.dvl_scale_factor = f64::NAN),
        ("covariance", |filter| filter.covariance[(3, 3)] = -1.0),
        ("covariance", |filter| filter.covariance[(12, 15)] += 10.0),
        ("covariance", |filter| filter.covariance[(12, 15)] = f64::NAN),
        ("last angular rate", |filter| filter.last_rate_p_radps.z = f64::NAN),
        ("last step", |filter| filter.last_step_s = -0.01),
        ("covariance_period_s", |filter| {
            filter.settings.covariance_period_s = -1.0
        }),
        ("earth rate", |filter| filter.settings.earth.rate_t[1] = f64::NAN),
        ("gravity", |filter| filter.settings.earth.gravity_mps2 = f64::NAN),
        ("gyro noise", |filter| filter.settings.noise.gyro = -1.0),
        ("scale factor walk", |filter| filter.settings.noise.dvl_scale = -1.0),
    ];
    for (words, change) in faults {
        let mut broken = filter();
        change(&mut broken);
        assert!(broken.check_restored().is_err(), "{words} passes");
    }
}
