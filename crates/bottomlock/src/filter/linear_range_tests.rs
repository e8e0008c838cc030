//! The second-order terms by hand and by quadratic forms, and what they do to an update.

use crate::aiding::Motion;
use nalgebra::{SMatrix, Vector3};

use super::*;
use crate::aiding::depth::depth;
use crate::aiding::gps::gps_velocity;
use crate::aiding::position::position;
use crate::filter::options::Options;
use crate::frames::{Rot, Tangent, Vec3};
use crate::layout::DIM;
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::state::{Covariance, NavState};

/// A filter whose velocity is uncertain by `velocity_mps` in every direction and whose misalignment is by `tilt_rad`.
fn filter(tilt_rad: f64, velocity_mps: f64) -> Eskf {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(0.1, -0.2, 0.7);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.1);
    let mut model = Model::table_2();
    model.environment.earth_rate_radps = 0.0;
    let Ok(mut filter) = Eskf::new(state, &model, &Options::default()) else {
        unreachable!("the model of the paper is a good one");
    };
    let mut covariance = Covariance::identity() * 1e-14;
    for i in 0..3 {
        covariance[(POSITION + i, POSITION + i)] = 4.0;
        covariance[(ATTITUDE + i, ATTITUDE + i)] = tilt_rad * tilt_rad;
        covariance[(VELOCITY + i, VELOCITY + i)] = velocity_mps * velocity_mps;
    }
    let Ok(()) = filter.set_covariance(&covariance) else {
        unreachable!("a diagonal is positive definite");
    };
    filter
}

/// Lets time pass at constant velocity on an Earth that does not turn.
fn coast(filter: &mut Eskf, seconds: i64) {
    let state = filter.state();
    let gravity_t = Vector3::new(0.0, 0.0, filter.settings.earth.gravity_mps2);
    let force_p_mps2 = Vec3::from(-(state.attitude_t_p.inverse().matrix() * gravity_t));
    let sample = |k: i64| ImuSample {
        time_ns: state.time_ns + k * 100_000_000,
        rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
        force_p_mps2,
    };
    (1..=10 * seconds).for_each(|k| filter.predict(&sample(k - 1), &sample(k)).unwrap());
}

/// b_z of independent errors: E[b_z²] = σ_ρ² σ_u² twice, whatever the attitude.
#[test]
fn variance_of_the_product_by_hand() {
    let found = filter(0.01, 20.0).vertical_product_variance();
    assert!((found / (2.0 * 0.01 * 0.01 * 20.0 * 20.0) - 1.0).abs() < 1e-12);
}

/// Of 9e4 m² of the horizontal position 1e4 were there when it was last known: the way has eight ninths. An update that leaves less is the
/// new beginning, and so is a fix, however much it leaves.
#[test]
fn the_share_of_the_way() {
    let mut filter = filter(0.01, 1.0);
    let mut covariance = filter.covariance;
    let mut share = |filter: &Eskf, north_m2: f64| {
        covariance[(POSITION, POSITION)] = north_m2;
        filter.share_of_way(&covariance)
    };
    assert_eq!((filter.measured.horizontal_m2, share(&filter, 3.0)), (8.0, 0.0));
    filter.measured.horizontal_m2 = 1e4;
    assert!((share(&filter, 9e4 - 4.0) - 8.0 / 9.0).abs() < 1e-12);
    for (sd_m, most_m2) in [(0.5, 0.5), (1.0, 1.0)] {
        filter
            .set_covariance(&filter.covariance.map(|value| 4.0 * value))
            .unwrap();
        let state = filter.state();
        let innovation = position(&Motion::still(&state), &state.position_t_m, &[sd_m; 3], &Vec3::zeros());
        assert!(filter.update(&innovation, Sensor::GpsPosition).unwrap().was_used());
        let horizontal_m2 = filter.covariance.fixed_view::<2, 2>(POSITION, POSITION).trace();
        assert_eq!(filter.measured.horizontal_m2, horizontal_m2);
        assert!(
            0.8 * most_m2 < horizontal_m2 && horizontal_m2 < most_m2,
            "{horizontal_m2}"
        );
    }
}

/// Correlated errors against the mean over all sign patterns of a factor of their covariance: for a product of two
/// Gaussians the fourth moments of ±1 are too small by 2 Σ l⁴, which is put back.
#[test]
fn variance_of_the_product_of_correlated_errors() {
    let mut filter = filter(0.01, 5.0);
    let spread = SMatrix::<f64, 6, 6>::from_fn(|i, j| ((3 * i + 5 * j) as f64).sin());
    let scale = SMatrix::<f64, 6, 6>::from_diagonal(&SMatrix::from_column_slice(&[0.01, 0.01, 0.01, 5.0, 4.0, 3.0]));
    let joint = scale * spread * spread.transpose() * scale;
    filter
        .covariance
        .fixed_view_mut::<6, 6>(ATTITUDE, ATTITUDE)
        .copy_from(&joint);
    let rotation = filter.rotation();
    let factor = scale * spread;
    let b_z = |e: &SMatrix<f64, 6, 1>| {
        let u = rotation * e.fixed_rows::<3>(3);
        e[0] * u[1] - e[1] * u[0]
    };
    // b_z = eᵀ A e with e = L n: E = tr(B)² + 2 tr(B²) of the symmetric B = Lᵀ A L.
    let mut quadratic = SMatrix::<f64, 6, 6>::zeros();
    for i in 0..6 {
        for j in 0..6 {
            let (a, b) = (factor.column(i).into_owned(), factor.column(j).into_owned());
            quadratic[(i, j)] = 0.5 * (b_z(&(a + b)) - b_z(&a) - b_z(&b));
        }
    }
    let expected = quadratic.trace().powi(2) + 2.0 * (quadratic * quadratic).trace();
    assert!((filter.vertical_product_variance() / expected - 1.0).abs() < 1e-12);
}

/// Beyond the linear range a depth corrects its own axis and leaves level position, velocity, attitude and biases to the bit,
/// however they are correlated with it; within it the same depth corrects them.
#[test]
fn a_depth_beyond_the_range_corrects_its_axis_alone() {
    for (velocity_mps, corrects_alone) in [(20.0, true), (0.05, false)] {
        let mut filter = filter(1e-3, velocity_mps);
        coast(&mut filter, 2);
        let mut with_level = filter.covariance();
        // One error moves the level position by 2 m and the depth by 1 m.
        for (i, j, squared_m) in [(0, 0, 4.0), (0, 2, 2.0), (2, 0, 2.0), (2, 2, 1.0)] {
            with_level[(POSITION + i, POSITION + j)] += squared_m;
        }
        filter.set_covariance(&with_level).unwrap();
        let (before, state) = (filter.covariance(), filter.state());
        let z = state.position_t_m.0.z;
        let report = filter
            .update(
                &depth(&Motion::still(&state), z + 0.5, 0.02, &Vec3::zeros()),
                Sensor::Depth,
            )
            .unwrap();
        assert_eq!(report.is_beyond_linear_range, corrects_alone);
        assert!(report.was_used());
        let (after, corrected) = (filter.covariance(), filter.state());
        assert!((corrected.position_t_m.0.z - z - 0.5).abs() < 0.01);
        assert!(after[DOWN] < 0.02 * 0.02);
        let change = corrected.error_of(&state);
        let moved = change.rows(ATTITUDE, DIM - ATTITUDE).amax();
        assert_eq!(moved < 1e-15, corrects_alone, "{moved}");
        let level = (change[POSITION], after[(POSITION, POSITION)]);
        assert_eq!(
            level == (0.0, before[(POSITION, POSITION)]),
            corrects_alone,
            "{level:?}"
        );
        let size = DIM - ATTITUDE;
        let same = before.view((ATTITUDE, ATTITUDE), (size, size)) == after.view((ATTITUDE, ATTITUDE), (size, size));
        assert_eq!(same, corrects_alone);
    }
}

/// The variance of the depth grows by E[b_z²] Δt² in between, and a rejected depth changes nothing.
#[test]
fn a_rejected_depth_changes_nothing() {
    let mut filter = filter(0.01, 20.0);
    coast(&mut filter, 2);
    let (before, state) = (filter.covariance(), filter.state());
    let product = filter.vertical_product_variance();
    let innovation = depth(&Motion::still(&state), 1000.0, 0.02, &Vec3::zeros());
    let report = filter.update(&innovation, Sensor::Depth).unwrap();
    assert!(!report.was_used());
    let expected = before[DOWN] + 4.0 * product + 0.02 * 0.02;
    assert!((report.covariance[(0, 0)] / expected - 1.0).abs() < 1e-12);
    assert_eq!(filter.covariance(), before);
    assert_eq!(filter.state(), state);
}

/// Standard deviation of the velocity in the tangent frame, m/s: of R̂ δv − [R̂ v̂ ×] ρ.
fn tangent_velocity_sd(filter: &Eskf) -> Vector3<f64> {
    let (rotation, velocity_p) = (filter.rotation(), filter.state().velocity_p_mps.0);
    let mut rows = SMatrix::<f64, 3, DIM>::zeros();
    rows.fixed_view_mut::<3, 3>(0, ATTITUDE)
        .copy_from(&-skew(&(rotation * velocity_p)));
    rows.fixed_view_mut::<3, 3>(0, VELOCITY).copy_from(&rotation);
    (rows * filter.covariance() * rows.transpose())
        .diagonal()
        .map(f64::sqrt)
}

/// After 100 s in which the velocity was lost by tens of m/s, a position fix tells the velocity in the tangent frame to the
/// noise over the time, and nothing of the misalignment; so does a velocity fix.
#[test]
fn a_fix_after_an_outage_is_no_compass() {
    for measures_velocity in [false, true] {
        let mut filter = filter(1e-4, 20.0);
        filter.covariance[(ATTITUDE + 2, ATTITUDE + 2)] = 0.02 * 0.02;
        let start = filter.state();
        let turned: Matrix3<f64> = Rot::<Tangent, Tangent>::exp(Vector3::new(0.0, 0.0, 0.02)).matrix();
        let velocity_p = start.velocity_p_mps.0 + Vector3::new(14.0, -17.0, 3.0);
        let velocity_t = turned * start.attitude_t_p.matrix() * velocity_p;
        coast(&mut filter, 100);
        let before = filter.covariance();
        let report = if measures_velocity {
            let innovation =
                filter.with_motion(|motion| gps_velocity(motion, &Vec3::from(velocity_t), &[0.01; 3], &Vec3::zeros()));
            filter.update(&innovation, Sensor::GpsVelocity).unwrap()
        } else {
            let fix_t = start.position_t_m.0 + velocity_t * 100.0;
            let innovation = position(
                &Motion::still(&filter.state()),
                &Vec3::from(fix_t),
                &[0.1; 3],
                &Vec3::zeros(),
            );
            filter.update(&innovation, Sensor::GpsPosition).unwrap()
        };
        assert!(report.was_used());
        let (after, covariance) = (filter.state(), filter.covariance());
        let sd = tangent_velocity_sd(&filter);
        // Gyro noise has turned the vertical meanwhile, and gravity along it moves the velocity.
        let largest_mps = if measures_velocity { 0.02 } else { 0.5 };
        assert!(sd.amax() < largest_mps, "{sd}");
        for i in 0..3 {
            let k = (ATTITUDE + i, ATTITUDE + i);
            assert!((covariance[k] / before[k]).sqrt() > 0.95);
        }
        assert!(after.error_of(&start)[ATTITUDE + 2].abs() < 2e-3);
    }
}

/// The position of a fix is known to its noise, not to the rotation of the corrected path, and a depth just before it keeps
/// its own axis out of the rotation.
#[test]
fn a_position_fix_after_a_depth_tells_no_tilt() {
    let mut filter = filter(1e-3, 20.0);
    let rotation = filter.rotation();
    let horizontal = Matrix3::from_diagonal(&Vector3::new(400.0, 400.0, 1e-4));
    filter
        .covariance
        .fixed_view_mut::<3, 3>(VELOCITY, VELOCITY)
        .copy_from(&(rotation.transpose() * horizontal * rotation));
    coast(&mut filter, 100);
    let at_depth = filter.state();
    let innovation = depth(
        &Motion::still(&at_depth),
        at_depth.position_t_m.0.z,
        0.02,
        &Vec3::zeros(),
    );
    assert!(filter.update(&innovation, Sensor::Depth).unwrap().was_used());
    coast(&mut filter, 1);
    let before = filter.covariance();
    let state = filter.state();
    let fix_t = Vector3::new(
        state.position_t_m.0.x + 1500.0,
        state.position_t_m.0.y - 1000.0,
        state.position_t_m.0.z,
    );
    let innovation = position(&Motion::still(&state), &Vec3::from(fix_t), &[0.1; 3], &Vec3::zeros());
    assert!(filter.update(&innovation, Sensor::GpsPosition).unwrap().was_used());
    let after = filter.covariance();
    for i in 0..3 {
        assert!(after[(POSITION + i, POSITION + i)].sqrt() < 0.11);
        let k = (ATTITUDE + i, ATTITUDE + i);
        assert!((after[k] / before[k]).sqrt() > 0.95);
    }
}

/// The Jacobian of a velocity fix by the misalignment, at the corrected velocity, against central differences of the
/// exact reading there.
#[test]
fn jacobian_of_a_velocity_fix_at_the_corrected_velocity() {
    let filter = filter(1e-3, 30.0);
    let state = filter.state();
    let reading_t = state.attitude_t_p.matrix() * Vector3::new(20.0, -15.0, 4.0);
    let innovation =
        filter.with_motion(|motion| gps_velocity(motion, &Vec3::from(reading_t), &[1e-3; 3], &Vec3::zeros()));
    let correction = filter.first_correction(&innovation);
    let gained_t = filter.rotation() * correction.fixed_rows::<3>(VELOCITY);
    let mut found = innovation.clone();
    add_by_misalignment(&mut found, &-skew(&gained_t));
    let velocity_p = state.velocity_p_mps.0 + correction.fixed_rows::<3>(VELOCITY);
    for axis in 0..3 {
        let step = 1e-6;
        let at = |sign: f64| {
            let rho = Vector3::ith(axis, sign * step);
            Rot::<Tangent, Tangent>::exp(rho).matrix() * state.attitude_t_p.matrix() * velocity_p
        };
        let numeric = (at(1.0) - at(-1.0)) / (2.0 * step);
        let column = found.jacobian.fixed_view::<3, 1>(0, ATTITUDE + axis).into_owned();
        assert!((column - numeric).amax() < 1e-6, "{column} {numeric}");
    }
}

/// What is learned depends on how long ago, not on when: an epoch of a thousand seconds changes no bit of the covariance.
#[test]
fn the_epoch_does_not_matter() {
    let of = |epoch_ns: i64| {
        let mut filter = filter(0.01, 20.0);
        filter.state.time_ns = epoch_ns;
        filter.measured = Measured::nothing_at(epoch_ns, &filter.covariance);
        coast(&mut filter, 20);
        let innovation = depth(
            &Motion::still(&filter.state()),
            filter.state().position_t_m.0.z,
            0.5,
            &Vec3::zeros(),
        );
        assert!(filter.is_beyond_linear_range());
        filter.update(&innovation, Sensor::Depth).unwrap();
        filter.covariance()
    };
    assert_eq!(of(0), of(1_000_000_000_000));
}

/// By hand, 2.5 s after the last depth: tilts of 0.1 rad and velocities of 10 m/s leave out 2 (0.1 × 10 × 2.5)² m², σ 3.5 m beside the
/// 2 m of P. A depth 12 m off is within three sigma of both and no evidence, as the gate takes it; one 40 m off is evidence.
#[test]
fn a_depth_is_evidence_as_its_gate_takes_it() {
    for (off_m, is_evidence) in [(12.0, false), (40.0, true)] {
        let mut filter = filter(0.1, 10.0);
        filter.inflate_after_rejections = 1;
        filter.state.time_ns = 2_500_000_000;
        let down_m = filter.state().position_t_m.0.z + off_m;
        let mut reading = filter.with_motion(|motion| depth(motion, down_m, 0.1, &Vec3::zeros()));
        let charge = filter.note_rejected(&reading, Sensor::Depth, false).unwrap();
        assert_eq!(charge.is_some(), is_evidence, "{off_m}");
        filter.linearise(&mut reading);
        assert!((filter.left_out_variance(&reading) / 12.5 - 1.0).abs() < 1e-9);
    }
}

/// What F leaves out of gravity that is turned by a tilt is ½ g (ρ_x² + ρ_y²) along the vertical, and half of a product with the yaw,
/// which turns the path.
#[test]
fn gravity_that_is_left_out_by_hand() {
    let gravity_t = Vector3::new(0.0, 0.0, 9.8);
    for rho in [Vector3::new(0.02, -0.01, 0.0), Vector3::new(0.05, 0.03, 0.0)] {
        let turned_t = Rot::<Tangent, Tangent>::exp(-rho).matrix() * gravity_t;
        let left_out_t = turned_t - (gravity_t - rho.cross(&gravity_t));
        let expected = -0.5 * 9.8 * rho.xy().norm_squared();
        assert!((left_out_t.z / expected - 1.0).abs() < 1e-3 && left_out_t.xy().norm() < 0.05 * expected.abs());
    }
}

/// By hand: tilts of 0.05 rad and 10 s are 9.8 / 2 · √8 · 0.0025 · 10 = 0.35 m/s of heave, whether they are added at once or as they
/// grow; of 0.001 rad they are within the linear range. A velocity that is used begins anew.
#[test]
fn heave_is_widened_by_what_is_left_out_since_a_velocity() {
    for at_s in [vec![10], vec![3, 7, 10]] {
        let mut filter = filter(0.05, 0.01);
        let before = filter.covariance;
        for second in at_s {
            filter.state.time_ns = second * 1_000_000_000;
            filter.widen_heave();
        }
        let grown = filter.covariance - before;
        let down_p = filter.rotation().row(2).transpose();
        let heave = 0.5 * filter.gravity_mps2() * 8_f64.sqrt() * 0.0025 * 10.0;
        let velocity = grown.fixed_view::<3, 3>(VELOCITY, VELOCITY).into_owned();
        assert!((velocity - down_p * down_p.transpose() * heave * heave).amax() < 1e-12);
        assert!((grown.norm() - velocity.norm()).abs() < 1e-12);
        filter.measured.velocity_ns = Some(10_000_000_000);
        assert_eq!(filter.left_out_heave_variance(), 0.0);
    }
    let mut level = filter(0.001, 0.01);
    level.state.time_ns = 10_000_000_000;
    let before = level.covariance;
    level.widen_heave();
    assert_eq!(level.covariance, before);
}
