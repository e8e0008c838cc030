//! A fix at a start whose yaw is wrong by a right angle, the path by differences of the exact one, and what is not repeated.

use crate::aiding::Motion;
use nalgebra::SMatrix;

use super::*;
use crate::aiding::depth::depth;
use crate::aiding::position::position;
use crate::aiding::velocity::velocity;
use crate::earth::EarthModel;
use crate::filter::gate::Gate;
use crate::filter::options::Options;
use crate::filter::report::Sensor;
use crate::frames::{Rot, Tangent, Vec3};
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::state::{Covariance, NavState};

const WAY_M: f64 = 20.0;

/// After 10 s to the estimated north at 2 m/s, with a yaw uncertain by `yaw_sd_rad` all the while.
fn filter(yaw_sd_rad: f64) -> Eskf {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(WAY_M / 10.0, 0.0, 0.0);
    let mut model = Model::table_2();
    model.environment.earth_rate_radps = 0.0;
    let options = Options {
        gate: Gate::Off,
        ..Options::default()
    };
    let mut filter = Eskf::new(state, &model, &options).unwrap();
    let mut covariance = Covariance::identity() * 1e-14;
    for i in 0..3 {
        covariance[(POSITION + i, POSITION + i)] = 0.01;
        covariance[(ATTITUDE + i, ATTITUDE + i)] = 1e-8;
        covariance[(VELOCITY + i, VELOCITY + i)] = 1e-6;
    }
    covariance[YAW] = yaw_sd_rad * yaw_sd_rad;
    filter.set_covariance(&covariance).unwrap();
    let sample = |k: i64| ImuSample {
        time_ns: k * 100_000_000,
        rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
        force_p_mps2: Vec3::new(0.0, 0.0, -filter.settings.earth.gravity_mps2),
    };
    let samples: Vec<_> = (0..=100).map(sample).collect();
    samples
        .windows(2)
        .for_each(|pair| filter.predict(&pair[0], &pair[1]).unwrap());
    filter
}

/// The fix at the end of a way that was turned by `yaw_rad`.
fn fix(filter: &mut Eskf, yaw_rad: f64) -> Innovation {
    let end_t = Vec3::new(WAY_M * yaw_rad.cos(), WAY_M * yaw_rad.sin(), 0.0);
    filter.propagate_covariance();
    position(&Motion::still(&filter.state()), &end_t, &[0.1; 3], &Vec3::zeros())
}

/// One fix tells a yaw of 60° or 90° from the way to it as far as its noise allows, with the position at the fix; the first
/// linearisation alone, tan instead of the angle at 60° with tenths of the way left, is off by many times its claim.
#[test]
fn a_large_yaw_is_found_by_one_fix() {
    for angle_rad in [60_f64, -60.0, 90.0, -90.0].map(f64::to_radians) {
        let mut filter = filter(angle_rad.abs());
        let innovation = fix(&mut filter, angle_rad);
        let first = filter.explained_by(&innovation).unwrap().error;
        let once = along(
            &innovation,
            CorrectedPath {
                by_position: None,
                by_misalignment: filter.path_by_misalignment(&first, 1.0),
                offset_t_m: Vector3::zeros(),
            },
        );
        let once = filter.explained_by(&once).unwrap();
        assert!((once.error[YAW.0] - angle_rad).abs() > 5.0 * once.yaw_variance.sqrt());

        assert!(filter.update(&innovation, Sensor::GpsPosition).unwrap().was_used());
        let (state, sd_rad) = (filter.state(), filter.covariance()[YAW].sqrt());
        let left_rad = state.attitude_t_p.to_euler_rad()[2] - angle_rad;
        assert!(left_rad.abs() < sd_rad, "{angle_rad}: {left_rad} {sd_rad}");
        assert!(sd_rad < 0.02);
        let fix_t = Vector3::new(WAY_M * angle_rad.cos(), WAY_M * angle_rad.sin(), 0.0);
        assert!((state.position_t_m.0 - fix_t).norm() < 0.1);
    }
}

/// A fix that does not move the yaw from the first linearisation to the next has its bits, and so has an outlier, which only
/// a yaw beyond what is plausible would explain.
#[test]
fn what_does_not_move_the_yaw_and_what_is_no_yaw_is_linearised_once() {
    for (sd_deg, angle_deg) in [(1.0_f64, 1.0_f64), (20.0, 90.0)] {
        let mut filter = filter(sd_deg.to_radians());
        let innovation = fix(&mut filter, angle_deg.to_radians());
        let first = filter.explained_by(&innovation).unwrap().error;
        let share = filter.share_of_way(&filter.covariance);
        let by_misalignment = filter.path_by_misalignment(&first, share);
        let offset_t_m = Vector3::zeros();
        let mut found = innovation.clone();
        filter.linearise_at_corrected_path(&mut found);
        let once = along(
            &innovation,
            CorrectedPath {
                by_position: None,
                by_misalignment,
                offset_t_m,
            },
        );
        assert_eq!(found, once, "{sd_deg}");
    }
}

/// A and B by central differences of the exact path, with 0.4 of δr on it: 0.6 δr + Exp(ρ) (p̂ + 0.4 δr − ρ × p̂) − p̂.
#[test]
fn the_path_is_the_tangent_of_the_exact_one() {
    let mut filter = filter(0.5);
    fix(&mut filter, 0.0);
    let (linear_t, rho) = (Vector3::new(3.0, 12.0, -1.0), Vector3::new(0.1, -0.2, 0.9));
    let mut error = ErrorVector::zeros();
    error.fixed_rows_mut::<3>(POSITION).copy_from(&linear_t);
    error.fixed_rows_mut::<3>(ATTITUDE).copy_from(&rho);
    let way_t = way_by_yaw(&filter.covariance);
    assert!((way_t - Vector3::new(WAY_M, 0.0, 0.0)).norm() < 0.01, "{way_t}");
    let exact = |linear_t: &Vector3<f64>, rho: &Vector3<f64>| {
        let end_t = Rot::<Tangent, Tangent>::exp(*rho).matrix() * (way_t + linear_t * 0.4 - rho.cross(&way_t));
        linear_t * 0.6 + end_t - way_t
    };
    let path = filter.path_at(&error, 0.4);
    let by_position = path.by_position.unwrap();
    for axis in 0..3 {
        let step = Vector3::ith(axis, 1e-5);
        let by_rho = (exact(&linear_t, &(rho + step)) - exact(&linear_t, &(rho - step))) / 2e-5;
        assert!((path.by_misalignment.column(axis) - by_rho).norm() < 1e-6);
        let by_linear = (exact(&(linear_t + step), &rho) - exact(&(linear_t - step), &rho)) / 2e-5;
        assert!((by_position.column(axis) - by_linear).norm() < 1e-6);
    }
    let linearised_t = by_position * linear_t + path.by_misalignment * rho + path.offset_t_m;
    assert!((linearised_t - exact(&linear_t, &rho)).norm() < 1e-9);

    // The axis of a depth since the last fix has its own way alone.
    let state = filter.state();
    let at_depth = depth(&Motion::still(&state), state.position_t_m.0.z, 0.02, &Vec3::zeros());
    assert!(filter.update(&at_depth, Sensor::Depth).unwrap().was_used());
    let (path, first) = (filter.path_at(&error, 1.0), filter.path_by_misalignment(&error, 1.0));
    assert_eq!(path.by_misalignment.row(2), first.row(2));
    assert_eq!(path.by_position.unwrap().row(2), RowVector3::new(0.0, 0.0, 1.0));
    assert_eq!(path.offset_t_m.z, 0.0);
}

/// By hand: σ 100 m and 1 m/s north, which are one error, and yaw 0.2 rad. A velocity that is 1 m/s off corrects the north by 100 m, and
/// with it 20 m of east become the yaw's; of 0.03 m/s it is 0.6 m, less than a tenth of the 8 m that the east has.
#[test]
fn a_velocity_that_corrects_the_path_turns_it_by_the_yaw() {
    for (gained_mps, east_m2) in [(1.0, 64.0 + 400.0), (0.03, 64.0)] {
        let after = after_velocity(gained_mps, 0.0).covariance();
        let (east, by_yaw) = (POSITION + 1, if gained_mps > 0.5 { 0.04 * 100.0 } else { 0.0 });
        assert!(
            (after[(east, east)] / east_m2 - 1.0).abs() < 1e-4,
            "{}",
            after[(east, east)]
        );
        assert!((after[(east, YAW.0)] - by_yaw).abs() < 1e-3, "{}", after[(east, YAW.0)]);
    }
}

/// By hand: where the same velocity corrects the yaw by 0.1 rad too, the 100 m are turned by it, and the yaw that is left, of 0.03 rad²,
/// moves their end.
#[test]
fn a_correction_of_the_yaw_turns_that_of_the_path() {
    let (before, filter) = (filter(0.2).state().position_t_m.0, after_velocity(1.0, 0.1));
    let end_t_m = [100.0 * 0.1_f64.cos(), 100.0 * 0.1_f64.sin()];
    let gained_t_m = filter.state().position_t_m.0 - before;
    assert!((gained_t_m.x - end_t_m[0]).abs() < 1e-3, "{gained_t_m}");
    assert!((gained_t_m.y - end_t_m[1]).abs() < 1e-3, "{gained_t_m}");
    let after = filter.covariance();
    assert!((after[(POSITION, YAW.0)] + 0.03 * end_t_m[1]).abs() < 1e-3);
    assert!((after[(POSITION + 1, YAW.0)] - 0.03 * end_t_m[0]).abs() < 1e-3);
}

/// After a velocity that is so much off, with σ 100 m and 1 m/s north, which are one error, 8 m to the other sides and a yaw of 0.2 rad,
/// which the velocity corrects by `yaw_by_ahead` rad of each m/s.
fn after_velocity(gained_mps: f64, yaw_by_ahead: f64) -> Eskf {
    let mut filter = filter(0.2);
    let mut covariance = Covariance::identity() * 1e-12;
    let (north, ahead) = (POSITION, VELOCITY);
    for (k, sd) in [
        (north, 100.0),
        (POSITION + 1, 8.0),
        (POSITION + 2, 8.0),
        (ahead, 1.0),
        (YAW.0, 0.2),
    ] {
        covariance[(k, k)] = sd * sd;
    }
    let one = 1.0 - 1e-9;
    for (i, j, value) in [
        (north, ahead, 100.0 * one),
        (ahead, YAW.0, yaw_by_ahead * one),
        (north, YAW.0, 100.0 * yaw_by_ahead * one),
    ] {
        (covariance[(i, j)], covariance[(j, i)]) = (value, value);
    }
    filter.set_covariance(&covariance).unwrap();
    let velocity_mps = filter.state().velocity_p_mps.0 + Vector3::new(gained_mps, 0.0, 0.0);
    let velocity_mps = Vec3::from_array(velocity_mps.into());
    let innovation = velocity(&filter.state(), &velocity_mps, &(Matrix3::identity() * 1e-6));
    assert!(filter.update(&innovation, Sensor::Velocity).unwrap().was_used());
    filter
}

/// With a yaw that is certain, and so without any way by it, an update is finite and turns nothing.
#[test]
fn a_certain_yaw_stays() {
    let mut filter = filter(0.5);
    for k in 0..crate::layout::DIM {
        (filter.covariance[(k, YAW.0)], filter.covariance[(YAW.0, k)]) = (0.0, 0.0);
    }
    let innovation = fix(&mut filter, 1.5);
    filter.covariance[YAW] = 0.0;
    let mut found = innovation.clone();
    filter.linearise_at_corrected_path(&mut found);
    assert!(found.residual.iter().all(|x| x.is_finite()));
    let rows: SMatrix<f64, 3, 3> = found.jacobian.fixed_view::<3, 3>(0, ATTITUDE).into();
    assert!(rows.iter().all(|x| x.is_finite()));
    assert_eq!(found.residual, innovation.residual);
    assert_eq!(way_by_yaw(&filter.covariance), Vector3::zeros());
}

/// δr ← A δr + B ρ + c: P becomes M P Mᵀ with A and B in the rows of the position, and an error follows.
#[test]
fn a_move_is_a_change_of_coordinates() {
    let mut filter = filter(0.1);
    let root = Covariance::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
    let p = root * root.transpose() + Covariance::identity();
    let p = (p + p.transpose()) * 0.5;
    filter.set_covariance(&p).unwrap();
    let by = Matrix3::new(0.0, 2.0, -1.0, 0.5, 0.0, 3.0, 5.0, 0.25, 0.0);
    let mut m = Covariance::identity();
    let turned = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 2.0);
    m.fixed_view_mut::<3, 3>(POSITION, POSITION).copy_from(&turned);
    m.fixed_view_mut::<3, 3>(POSITION, ATTITUDE).copy_from(&by);
    let before = ErrorVector::from_fn(|k, _| k as f64 + 1.0);
    let mut error = before;
    let offset_t_m = Vector3::new(7.0, 8.0, 9.0);
    let path = CorrectedPath {
        by_position: Some(turned),
        by_misalignment: by,
        offset_t_m,
    };
    filter.move_to_corrected_path(&path, &mut error);
    assert!((filter.covariance - m * p * m.transpose()).amax() < 1e-10);
    let mut expected = m * before;
    let mut position = expected.fixed_rows_mut::<3>(POSITION);
    position += offset_t_m;
    assert!((error - expected).amax() < 1e-12);
}

/// B is −[δr̂×]; after a depth its third row is that of the way since, and time is counted from the depth whatever the epoch.
#[test]
fn path_by_misalignment_by_hand() {
    let mut filter = filter(0.1);
    filter.state.time_ns = 100_000_000_000;
    let mut correction = ErrorVector::zeros();
    correction
        .fixed_rows_mut::<3>(POSITION)
        .copy_from(&Vector3::new(1.0, 2.0, 3.0));
    let gained_p = Vector3::new(0.5, -1.0, 0.25);
    correction.fixed_rows_mut::<3>(VELOCITY).copy_from(&gained_p);
    (filter.measured.position_ns, filter.measured.depth_ns) = (97_000_000_000, 97_000_000_000);
    let plain = -skew(&Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(filter.path_by_misalignment(&correction, 1.0), plain);
    filter.measured.depth_ns = 98_000_000_000;
    let way_t = filter.state().attitude_t_p.matrix() * gained_p * 2.0;
    let mut expected = plain;
    expected.set_row(2, &-skew(&way_t).row(2));
    assert!((filter.path_by_misalignment(&correction, 1.0) - expected).amax() < 1e-12);
}

/// A yaw that moves the position by ρ e_D × p̂: 4 m to the north and 3 m to the east it moves by −3 and 4 times ρ.
#[test]
fn the_way_by_hand() {
    let mut filter = filter(0.5);
    filter.covariance[(POSITION, YAW.0)] = -3.0 * filter.covariance[YAW];
    filter.covariance[(POSITION + 1, YAW.0)] = 4.0 * filter.covariance[YAW];
    assert!((way_by_yaw(&filter.covariance) - Vector3::new(4.0, 3.0, 0.0)).norm() < 1e-12);
}

/// The first terms of the series where the closed form has no digits left: I + [ρ×]/2.
#[test]
fn the_left_jacobian_of_a_small_turn() {
    for size in [1e-12, 1e-8, 0.99e-4, 1.01e-4] {
        let rho = Vector3::new(0.6, 0.0, -0.8) * size;
        let turned = (left_jacobian(&rho) - Matrix3::identity()) / size;
        assert!((turned - skew(&rho) * (0.5 / size)).amax() < 1e-4, "{size}");
    }
}

/// 100 km east of the origin on the ellipsoid, with a depth that is known to 1 cm and 300 m of uncertainty about the place.
fn far_east() -> Eskf {
    let mut state = NavState::at_rest(0);
    state.position_t_m = Vec3::new(0.0, 1e5, 0.0);
    let mut model = Model::table_2();
    model.environment.earth = EarthModel::Ellipsoid;
    let mut filter = Eskf::new(state, &model, &Options::default()).unwrap();
    let down_t = filter.settings.earth.level(&state.position_t_m).down_t();
    let mut covariance = Covariance::identity() * 1e-12;
    let mut along_level = Matrix3::identity();
    along_level.set_row(
        2,
        &RowVector3::new(-down_t.x / down_t.z, -down_t.y / down_t.z, 1.0 / down_t.z),
    );
    let place = along_level * Matrix3::from_diagonal(&Vector3::new(9e4, 9e4, 1e-4)) * along_level.transpose();
    covariance.fixed_view_mut::<3, 3>(POSITION, POSITION).copy_from(&place);
    filter.set_covariance(&covariance).unwrap();
    filter.measured.depth_ns = 1;
    filter
}

/// By hand: 1 km along the level at the estimate is 1e6 / (2 · 6.378e6) = 78 mm above the sea's curve, which the corrected state is not,
/// and the axis of the depth has turned by 157 µrad there: 47 mm for each σ of 300 m, which the depth's variance is not either.
#[test]
fn a_correction_of_a_kilometre_keeps_the_depth() {
    for (north_m, east_m) in [(1000.0, 0.0), (0.0, -1000.0)] {
        let mut filter = far_east();
        let before = filter.settings.earth.level(&filter.state().position_t_m);
        let down_t = before.down_t();
        let mut error = ErrorVector::zeros();
        let level_t = Vector3::new(north_m, east_m, -(down_t.x * north_m + down_t.y * east_m) / down_t.z);
        error.fixed_rows_mut::<3>(POSITION).copy_from(&level_t);
        let old = filter.covariance;
        filter.follow_corrected_path(&mut error, 1.0);
        let lower_m = error[POSITION + 2] - level_t.z;
        assert!((lower_m - 0.0785).abs() < 1e-3, "{lower_m}");
        let mut corrected = filter.state();
        corrected.inject(&error);
        let after = filter.settings.earth.level(&corrected.position_t_m);
        assert!((after.depth_m - before.depth_m).abs() < 1e-6);
        let variance = |covariance: &Covariance, down_t: Vector3<f64>| {
            (down_t.transpose() * covariance.fixed_view::<3, 3>(POSITION, POSITION) * down_t)
                .x
                .sqrt()
        };
        let sd_m = variance(&filter.covariance, after.down_t());
        assert!((sd_m - 0.01).abs() < 1e-6, "{sd_m}");
        assert!(variance(&old, after.down_t()) > 0.045);
    }
}

/// A, B and c where a depth is known, by central differences of d(r̂ + e) = d(r̂) + D·δr + b, for a fix and for another update.
#[test]
fn the_path_below_a_curved_sea_is_the_tangent_of_the_exact_one() {
    let mut filter = far_east();
    filter.covariance[YAW] = 0.01;
    (
        filter.covariance[(POSITION, YAW.0)],
        filter.covariance[(POSITION + 1, YAW.0)],
    ) = (-20.0, 5.0);
    filter.state.time_ns = 2_000_000_000;
    let mut error = ErrorVector::zeros();
    error
        .fixed_rows_mut::<3>(POSITION)
        .copy_from(&Vector3::new(700.0, -400.0, 8.0));
    error
        .fixed_rows_mut::<3>(ATTITUDE)
        .copy_from(&Vector3::new(0.01, -0.02, 0.05));
    error
        .fixed_rows_mut::<3>(VELOCITY)
        .copy_from(&Vector3::new(1.0, -3.0, 0.2));
    let earth = filter.settings.earth;
    let here_t_m = filter.state().position_t_m;
    let by_heave = filter.heave_by_misalignment(&error);
    let before = earth.level(&here_t_m);
    for path in [filter.path_at(&error, 1.0), filter.first_path(&error, 1.0)] {
        let by_position = path.by_position.unwrap();
        let end = |error: &ErrorVector| {
            by_position * error.fixed_rows::<3>(POSITION)
                + path.by_misalignment * error.fixed_rows::<3>(ATTITUDE)
                + path.offset_t_m
        };
        let left = |error: &ErrorVector| {
            let mut there_t_m = here_t_m;
            there_t_m.0 += end(error);
            let known_m =
                before.down_t().dot(&error.fixed_rows::<3>(POSITION)) + (by_heave * error.fixed_rows::<3>(ATTITUDE)).x;
            earth.level(&there_t_m).depth_m - before.depth_m - known_m
        };
        assert!(left(&error).abs() < 1e-6, "{}", left(&error));
        for (k, step) in (POSITION..POSITION + 3)
            .map(|k| (k, 1.0))
            .chain((ATTITUDE..ATTITUDE + 3).map(|k| (k, 1e-3)))
        {
            let mut by = ErrorVector::zeros();
            by[k] = step;
            let slope = (left(&(error + by)) - left(&(error - by))) / (2.0 * step);
            assert!(slope.abs() < 1e-5, "{k}: {slope}");
        }
    }
}
