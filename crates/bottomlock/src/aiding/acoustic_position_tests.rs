//! An acoustic fix worked by hand, laws of its noise, and its simulated readings.

use proptest::prelude::*;

use super::*;
use crate::aiding::sensor::TrueMotion;
use crate::testing::*;

fn model() -> AcousticPositionModel {
    AcousticPositionModel {
        sd_m: 3.0,
        sd_per_range: 0.1,
        transceiver_t_m: Vec3::new(10.0, 22.0, -9.0),
        outlier_fraction: Fraction(0.0),
        outlier_factor: 10.0,
    }
}

fn motion_of(state: &NavState) -> Motion<'_> {
    Motion::still(state)
}

/// Heading east with the transponder 1 m ahead: R l = (0, 1, 0), so z = (10, 22, 31) − (10, 21, 30) = (0, 1, 1); the slant range is
/// 40 m, so σ = √(3² + 4²) = 5 m.
#[test]
fn a_fix_worked_by_hand() {
    let mut state = NavState::at_rest(7);
    state.position_t_m = Vec3::new(10.0, 20.0, 30.0);
    state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let fix = AcousticPositionSample::new(7, Vec3::new(10.0, 22.0, 31.0), None, &model());
    let row = fix.innovation(Sensor::AcousticPosition, &motion_of(&state), &Vec3::new(1.0, 0.0, 0.0));
    assert_eq!((row.rows, row.degrees), (3, 3));
    assert!((row.residual.fixed_rows::<3>(0) - Vector3::new(0.0, 1.0, 1.0)).norm() < 1e-12);
    let noise: Matrix3<f64> = row.noise.fixed_view::<3, 3>(0, 0).into();
    assert!((noise - Matrix3::identity() * 25.0).norm() < 1e-12);
    let by_position: Matrix3<f64> = row.jacobian.fixed_view::<3, 3>(0, POSITION).into();
    assert_eq!(by_position, Matrix3::identity());
    // −[(0, 1, 0)×].
    let by_misalignment: Matrix3<f64> = row.jacobian.fixed_view::<3, 3>(0, ATTITUDE).into();
    let expected = Matrix3::new(0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
    assert!((by_misalignment - expected).norm() < 1e-12);
}

/// A standard deviation that comes with the fix counts as it is.
#[test]
fn a_given_deviation_counts() {
    let fix = AcousticPositionSample::new(0, Vec3::zeros(), Some([1.0, 2.0, 3.0]), &model());
    assert_eq!(fix.sd_m, [1.0, 2.0, 3.0]);
}

/// A fix without noise (no model) or with a number that is not finite is an error.
#[test]
fn bad_fixes_are_named() {
    let text = |fix: AcousticPositionSample| fix.validate().unwrap_err().to_string();
    let unknown = AcousticPositionModel::default();
    let lone = AcousticPositionSample::new(0, Vec3::zeros(), None, &unknown);
    assert_eq!(text(lone), "acoustic_position sd_m is 0, expected a finite number > 0");
    let negative = AcousticPositionSample::new(0, Vec3::zeros(), Some([1.0, -1.0, 1.0]), &model());
    assert_eq!(
        text(negative),
        "acoustic_position sd_m is -1, expected a finite number > 0"
    );
    let nowhere = AcousticPositionSample::new(5, Vec3::new(0.0, f64::NAN, 0.0), Some([1.0; 3]), &model());
    let message = text(nowhere);
    assert!(
        message.starts_with("acoustic_position position_t_m at 5 ns is not finite"),
        "{message}"
    );
}

fn scene(truth: &TrueMotion, models: &SensorModels, draws: usize) -> Vec<AcousticPositionSample> {
    let mut random = [Normals::new([7; 32], 11), Normals::new([7; 32], 12)];
    let scene = Scene {
        time_ns: 0,
        truth,
        level: LocalLevel::of_plane(&truth.position_t_m.into()),
        offset: 0.0,
        lever_p_m: Vec3::new(1.0, 0.0, 0.0),
        actual: models,
        claimed: models,
    };
    let fixes = (0..draws).map(|_| AcousticPositionSample::simulate(&scene, &mut random).unwrap());
    fixes.collect()
}

fn still() -> TrueMotion {
    TrueMotion {
        position_t_m: Vector3::new(300.0, 0.0, 40.0),
        attitude_t_p: Rot::identity(),
        velocity_p_mps: Vector3::zeros(),
        omega_p_radps: Vector3::zeros(),
    }
}

/// Outliers are drawn from a stream of their own: the fixes that are none keep their bits, and the others are as many times off.
#[test]
fn outliers_leave_the_other_fixes_alone() {
    let of = |fraction: f64| {
        let mut models = SensorModels {
            acoustic_position: model(),
            ..SensorModels::default()
        };
        models.acoustic_position.outlier_fraction = Fraction(fraction);
        scene(&still(), &models, 2000)
    };
    let (clean, with, all) = (of(0.0), of(0.25), of(1.0));
    let true_t_m = Vector3::new(301.0, 0.0, 40.0);
    let mut outliers = 0;
    for ((clean, with), all) in clean.iter().zip(&with).zip(&all) {
        let tenfold = true_t_m + (clean.position_t_m.0 - true_t_m) * 10.0;
        assert!((all.position_t_m.0 - tenfold).norm() < 1e-9);
        if with != clean {
            assert_eq!(with, all);
            outliers += 1;
        }
    }
    // Binomial: 500 with a standard deviation of 19.4; five of them either way.
    assert!((403..=597).contains(&outliers), "{outliers}");
}

proptest! {
    /// Moving everything moves nothing: the innovation depends on differences of positions alone.
    #[test]
    fn the_origin_does_not_matter(moved in prop::array::uniform3(-1e3_f64..1e3), fix in prop::array::uniform3(-50.0_f64..50.0),
                                  angles in prop::array::uniform3(-1.5_f64..1.5)) {
        let shift = Vec3::<Tangent>::from_array(moved);
        let innovation = |shift: Vec3<Tangent>| {
            let mut state = NavState::at_rest(0);
            state.position_t_m = Vec3::new(1.0, -2.0, 3.0) + shift;
            state.attitude_t_p = Rot::from_euler_rad(angles[0], angles[1], angles[2]);
            let model = AcousticPositionModel { transceiver_t_m: model().transceiver_t_m + shift, ..model() };
            let sample = AcousticPositionSample::new(0, Vec3::from_array(fix) + shift, None, &model);
            sample.innovation(Sensor::AcousticPosition, &motion_of(&state), &Vec3::new(0.5, -0.2, 0.1))
        };
        let (here, there) = (innovation(Vec3::zeros()), innovation(shift));
        prop_assert!((here.residual - there.residual).norm() < 1e-9);
        prop_assert!((here.noise - there.noise).norm() < 1e-9);
        prop_assert_eq!(here.jacobian, there.jacobian);
    }

    /// The deviation is that of the model at no range, never falls with the range, and ends as its k-fold.
    #[test]
    fn noise_grows_with_the_slant_range(direction in prop::array::uniform3(-1.0_f64..1.0), near in 0.0_f64..1e3, more in 0.0_f64..1e3) {
        let along = Vector3::from(direction);
        prop_assume!(along.norm() > 1e-3);
        let at = |range: f64| model().sd_at_m(&(model().transceiver_t_m + Vec3::from(along.normalize() * range)));
        prop_assert!((at(0.0) - model().sd_m).abs() < 1e-9);
        prop_assert!(at(near + more) >= at(near) - 1e-9);
        prop_assert!((at(1e6) / 1e5 - 1.0).abs() < 1e-3);
    }
}
