//! Charges by hand: of an attitude reference, and of water track.

use super::*;
use crate::aiding::water_track::WaterSample;
use crate::testing::*;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// With an attitude reference of 1° of offset, 2° of walk in 100 s and 0.2° of noise in each angle.
fn with_reference() -> Eskf {
    let mut model = Model::table_2();
    model.initial.attitude_sd_rad = [DEGREE; 3];
    model.sensors.magnetometer = MagnetometerModel {
        yaw_sd_rad: 0.2 * DEGREE,
        roll_pitch_sd_rad: 0.2 * DEGREE,
        yaw_offset_sd_rad: SlowSd(DEGREE),
        roll_pitch_offset_sd_rad: SlowSd(DEGREE),
        yaw_walk_sd_rad: SlowSd(2.0 * DEGREE),
        roll_pitch_walk_sd_rad: SlowSd(2.0 * DEGREE),
        walk_time_s: WalkTime(100.0),
        ..MagnetometerModel::default()
    };
    let options = Options {
        inflate_after_rejections: 2,
        ..Options::default()
    };
    Eskf::new(NavState::at_rest(0), &model, &options).unwrap()
}

/// A reading of that reference, off by so many degrees.
fn reference(filter: &Eskf, roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> Innovation {
    let [roll, pitch, yaw] = [roll_deg, pitch_deg, yaw_deg].map(|angle| angle * DEGREE);
    let reading = Rot::from_euler_rad(roll, pitch, yaw);
    filter.with_motion(|motion| attitude(motion, &reading, 0.2 * DEGREE, 0.2 * DEGREE))
}

/// The covariance and the variances of the further states that two rejected readings add, (°)², and their charge.
fn added(filter: &mut Eskf, angles_deg: [f64; 3]) -> (Covariance, FurtherVector, Charge) {
    let before = (filter.covariance(), filter.extensions.further().covariance().diagonal());
    let [roll, pitch, yaw] = angles_deg;
    let reading = reference(filter, roll, pitch, yaw);
    assert_eq!(filter.note_rejected(&reading, Sensor::Attitude, false), Ok(None));
    let charge = filter
        .note_rejected(&reading, Sensor::Attitude, false)
        .unwrap()
        .unwrap();
    let further = filter.extensions.further().covariance().diagonal();
    let unit = DEGREE * DEGREE;
    (
        (filter.covariance() - before.0) / unit,
        (further - before.1) / unit,
        charge,
    )
}

/// A yaw that is off by 9°, where a reading was taken before: within five sigma, 10°, all of it is charged to the reference's walk, which
/// changes, and the inertial states and the errors of roll and pitch are left as they are.
#[test]
fn a_slow_error_is_charged_first_and_on_its_axis() {
    for (angles_deg, axes) in [
        ([0.0, 0.0, 9.0], 2..3),
        ([9.0, 0.0, 0.0], 0..2),
        ([9.0, 0.0, 9.0], 0..3),
    ] {
        let mut filter = with_reference();
        let first = reference(&filter, 0.0, 0.0, 0.0);
        filter.update(&first, Sensor::Attitude).unwrap();
        let (inertial, further, charge) = added(&mut filter, angles_deg);
        assert_eq!(inertial, Covariance::zeros());
        assert_eq!(charge.to_sensor, 1.0);
        let grown = charge.factor.unwrap() - 1.0;
        for axis in 0..3 {
            let expected = if axes.contains(&axis) { grown } else { 0.0 };
            let [offset, walk] = [0, 3].map(|first| further[block::ATTITUDE_ERROR.first + first + axis]);
            assert_eq!(offset, 0.0);
            assert!(
                (walk - 4.0 * expected).abs() < 1e-9 * grown,
                "{angles_deg:?} {axis}: {walk}"
            );
        }
    }
}

/// Pitched by 20°, where a wrong roll would explain a yaw too, but only one three times as wrong, the yaw alone is charged.
#[test]
fn the_axis_that_has_to_be_less_wrong_is_charged() {
    let mut filter = with_reference();
    filter.kinematics.attitude_t_p =
        Rot::<Tangent, Platform>::from_euler_rad(0.0, 20.0 * DEGREE, 0.0).to_quaternion_wxyz();
    let (inertial, further, _) = added(&mut filter, [0.0, 20.0, 60.0]);
    assert!(inertial[(ATTITUDE + 2, ATTITUDE + 2)] > 1.0);
    assert_eq!(
        inertial.fixed_view::<2, 2>(ATTITUDE, ATTITUDE),
        nalgebra::Matrix2::zeros()
    );
    assert_eq!(
        further.fixed_rows::<2>(block::ATTITUDE_ERROR.first),
        nalgebra::Vector2::zeros()
    );
}

/// Beyond five sigma the inertial states have their part: of a first reading by 1 of 5 (°)², all of which is unshared. After a thousand
/// readings the reference's error tells the yaw to its noise, so that hardly anything is unshared.
#[test]
fn what_is_shared_is_not_charged() {
    let mut fresh = with_reference();
    let (inertial, further, charge) = added(&mut fresh, [0.0, 0.0, 60.0]);
    let grown = charge.factor.unwrap() - 1.0;
    let yaw = ATTITUDE + 2;
    assert!((inertial[(yaw, yaw)] / grown - 1.0).abs() < 1e-9);
    assert!((further[block::ATTITUDE_ERROR.first + 5] / grown - 4.0).abs() < 1e-9);
    assert!((charge.to_sensor - 0.8).abs() < 1e-9);
    assert_eq!((inertial[(ATTITUDE, ATTITUDE)], charge.is_of_all), (0.0, false));

    let mut known = with_reference();
    let reading = reference(&known, 0.0, 0.0, 0.0);
    for _ in 0..1000 {
        known.update(&reading, Sensor::Attitude).unwrap();
    }
    let shared = known.covariance()[(yaw, yaw)] / DEGREE / DEGREE;
    assert!((shared - 5.0 / 6.0).abs() < 1e-3, "{shared}");
    let (inertial, _, charge) = added(&mut known, [0.0, 0.0, 60.0]);
    let share = inertial[(yaw, yaw)] / (charge.factor.unwrap() - 1.0);
    assert!((share / (0.04 / 1000.0) - 1.0).abs() < 0.01, "{share}");
    assert!(charge.to_sensor > 0.9999);
}

/// The charge of one filter in another is the same.
#[test]
fn a_charge_is_added_as_it_is() {
    let mut one = with_reference();
    let mut other = one.clone();
    let (inertial, further, charge) = added(&mut one, [0.0, 0.0, 60.0]);
    let before = (other.covariance(), other.extensions.further().covariance().diagonal());
    other.charge(&charge);
    let after = (other.covariance(), other.extensions.further().covariance().diagonal());
    let unit = DEGREE * DEGREE;
    assert!(((after.0 - before.0) / unit - inertial).amax() < 1e-9);
    assert!(((after.1 - before.1) / unit - further).amax() < 1e-9);
}

/// A current that is 5 m/s off what the prior of 0.3 m/s allows locks nothing out: the second reading of water track is charged to it and
/// then taken, and the velocity stays what it is.
#[test]
fn water_track_is_taken_again() {
    let options = Options {
        inflate_after_rejections: 2,
        ..Options::default()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.0, 0.0);
    let filter = Eskf::new(state, &Model::table_2(), &options).unwrap();
    let mut filter = filter.with_water(Some(WaterBlock::new(&WaterPrior::default())));
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let ping = ping_at(&geometry, [2.0, 5.0, 0.0], 0.02);
    let sample = WaterSample { ping, range_m: 0.0 };
    let mut charges = Vec::new();
    for _ in 0..2 {
        let innovation = filter.water_track_innovation(&geometry, &sample);
        let report = filter.update(&innovation, Sensor::WaterTrack).unwrap();
        assert_eq!(report.verdict, Verdict::Rejected);
        charges.extend(filter.note_rejected(&innovation, Sensor::WaterTrack, false).unwrap());
    }
    let [charge] = charges.as_slice() else {
        panic!("{charges:?}")
    };
    assert!(charge.to_sensor == 1.0 && charge.factor.is_some_and(|factor| factor > 30.0));
    let innovation = filter.water_track_innovation(&geometry, &sample);
    assert!(filter.update(&innovation, Sensor::WaterTrack).unwrap().was_used());
    let east_mps = filter.water_states().unwrap().estimate[CURRENT + 1];
    assert!((east_mps + 5.0).abs() < 0.2, "{east_mps}");
    assert!((filter.velocity().0 - Vector3::new(2.0, 0.0, 0.0)).norm() < 0.1);
}
