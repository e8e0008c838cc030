//! Counts, factors, charges and bounds by hand.

use super::*;
use crate::filter::charge::observed;
use crate::testing::*;

/// By hand: factors 4, 9 and 6 have the geometric mean 6.
#[test]
fn factor_is_the_geometric_mean_over_consecutive_rejections() {
    let mut run = Run::default();
    for (k, factor) in [4.0, 9.0, 6.0].into_iter().enumerate() {
        run.push(k == 1, factor, Vector3::x(), 7 + k as i64, 5);
    }
    assert!((run.factor() - 6.0).abs() < 1e-9);
    assert_eq!((run.explained, run.doubtful, run.since_ns), (2, 1, 7));
}

/// By hand: σ 2 m, noise 0.5 m, 10 m off: 100/(0.25 + 4 f) = 1 gives f = 24.9375.
///
/// Only the depth is inflated, which no other state notices.
#[test]
fn depth_inflates_itself_alone() {
    let mut filter = filter(&Model::table_2());
    let before = filter.covariance();
    let innovation = depth(&Motion::still(&filter.state()), 10.0, 0.5, &Vec3::zeros());
    assert_eq!(noted(&mut filter, &innovation, Sensor::Depth, false), None);
    let factor = noted(&mut filter, &innovation, Sensor::Depth, false).unwrap();
    assert!((factor - 24.9375).abs() < 2e-3, "{factor}");
    let mut expected = before;
    expected[(POSITION + 2, POSITION + 2)] *= factor;
    assert!((filter.covariance() - expected).amax() < 1e-12);
}

/// A position where a velocity was accepted since the first rejection inflates the position alone, else all
/// inertial states.
#[test]
fn position_inflates_all_states_where_no_velocity_aids() {
    for has_velocity in [false, true] {
        let mut filter = filter(&Model::table_2());
        let far = position(
            &Motion::still(&filter.state()),
            &Vec3::new(50.0, 0.0, 0.0),
            &[1.0; 3],
            &Vec3::zeros(),
        );
        let before = filter.covariance();
        assert_eq!(noted(&mut filter, &far, Sensor::AcousticPosition, false), None);
        if has_velocity {
            filter.measured.velocity_ns = Some(0);
        }
        let factor = noted(&mut filter, &far, Sensor::AcousticPosition, false).unwrap();
        let after = filter.covariance();
        assert!(factor > 100.0 && (after[(0, 0)] / before[(0, 0)] / factor - 1.0).abs() < 1e-12);
        let kept = after[(ATTITUDE, ATTITUDE)] == before[(ATTITUDE, ATTITUDE)];
        assert_eq!(kept, has_velocity);
    }
}

/// A velocity that leaves a direction open, so that the filter is beyond its linear range, does not keep the inertial states
/// from being inflated by a position.
#[test]
fn position_inflates_all_states_where_a_direction_is_open() {
    for open_mps in [20.0, 0.05] {
        let mut filter = filter(&Model::table_2());
        let mut covariance = filter.covariance();
        covariance[(VELOCITY + 1, VELOCITY + 1)] = open_mps * open_mps;
        filter.set_covariance(&covariance).unwrap();
        filter.measured.velocity_ns = Some(0);
        assert_eq!(filter.is_beyond_linear_range(), open_mps > 1.0);
        let far = filter.with_motion(|motion| position(motion, &Vec3::new(50.0, 0.0, 0.0), &[1.0; 3], &Vec3::zeros()));
        let factors: [Option<f64>; 2] =
            std::array::from_fn(|_| noted(&mut filter, &far, Sensor::AcousticPosition, false));
        assert!(factors[1].is_some());
        let grown = filter.covariance()[(ATTITUDE, ATTITUDE)] / covariance[(ATTITUDE, ATTITUDE)];
        let expected = if open_mps > 1.0 { 25.0 } else { 1.0 };
        assert!((grown / expected - 1.0).abs() < 1e-9, "{grown}");
    }
}

/// By hand, for a velocity of 0.05 m/s that beams measure and fixes of 1 m, 5 s apart: (5 × 0.05)² + 2 × 1 = 2.0625 m², so that a
/// difference which moves by 3 m is one of the position, 9/2.0625 < 14.2, and one by 12 m is one of the velocity.
#[test]
fn position_that_moves_away_inflates_all_states() {
    for moved_m in [3.0, 12.0] {
        let mut filter = filter(&Model::table_2());
        let mut covariance = filter.covariance();
        for k in VELOCITY..VELOCITY + 3 {
            covariance[(k, k)] = 0.05 * 0.05;
        }
        filter.set_covariance(&covariance).unwrap();
        filter.measured.velocity_ns = Some(5_000_000_000);
        for (time_ns, north_m) in [(0, 50.0), (5_000_000_000, 50.0 + moved_m)] {
            filter.state.time_ns = time_ns;
            let fix = Vec3::new(north_m, 0.0, 0.0);
            let fix = filter.with_motion(|motion| position(motion, &fix, &[1.0; 3], &Vec3::zeros()));
            let factor = noted(&mut filter, &fix, Sensor::AcousticPosition, false);
            assert_eq!(factor.is_some(), time_ns > 0);
        }
        let grown = filter.covariance()[(ATTITUDE, ATTITUDE)] / covariance[(ATTITUDE, ATTITUDE)];
        let expected = if moved_m > 10.0 { 25.0 } else { 1.0 };
        assert!((grown / expected - 1.0).abs() < 1e-9, "{moved_m}: {grown}");
    }
}

/// What the gate rejects at the corrected path counts, though it would pass as it is: a north that tilts the path by the east.
#[test]
fn evidence_is_what_the_gate_has_judged() {
    let mut filter = filter(&Model::table_2());
    let mut covariance = filter.covariance();
    let (north, east, yaw) = (POSITION, POSITION + 1, ATTITUDE + 2);
    for (k, sd) in [(north, 400.0), (east, 10.0), (yaw, 0.2)] {
        covariance[(k, k)] = sd * sd;
    }
    // A yaw that has moved the east moves it the other way once the path is as long as the fix says.
    covariance[(yaw, east)] = 0.98 * 0.2 * 10.0;
    covariance[(east, yaw)] = covariance[(yaw, east)];
    filter.set_covariance(&covariance).unwrap();
    let fix = Vec3::new(-49.0, 25.0, 0.0);
    let fix = filter.with_motion(|motion| position(motion, &fix, &[0.1; 3], &Vec3::zeros()));
    let mut at_path = fix.clone();
    filter.linearise(&mut at_path);
    let nis = |innovation: &Innovation| norm_squared(innovation, &filter.whole_covariance(innovation));
    let limit = filter.plausible.threshold(3);
    assert!(
        nis(&fix) < limit && nis(&at_path) > limit,
        "{} {}",
        nis(&fix),
        nis(&at_path)
    );
    assert_eq!(noted(&mut filter, &fix, Sensor::AcousticPosition, false), None);
    assert!(noted(&mut filter, &fix, Sensor::AcousticPosition, false).is_some());
}

/// A measurement within its gate resets the count, an assumption never counts.
#[test]
fn only_rejections_of_sensors_count() {
    let mut filter = filter(&Model::table_2());
    let at = |filter: &Eskf, depth_m: f64| depth(&Motion::still(&filter.state()), depth_m, 0.5, &Vec3::zeros());
    for depth_m in [10.0, 0.1, 10.0] {
        let innovation = at(&filter, depth_m);
        assert_eq!(noted(&mut filter, &innovation, Sensor::Depth, false), None, "{depth_m}");
        assert_eq!(noted(&mut filter, &innovation, Sensor::Sway, false), None, "{depth_m}");
    }
}

/// Counts a rejection; the factor of a charge after which the reading is tested again.
fn noted(filter: &mut Eskf, innovation: &Innovation, sensor: Sensor, is_confirmed: bool) -> Option<f64> {
    let charge = filter.note_rejected(innovation, sensor, is_confirmed).unwrap();
    charge.and_then(|charge| charge.factor)
}

/// A filter that inflates after two rejections.
fn filter(model: &Model) -> Eskf {
    let options = Options {
        inflate_after_rejections: 2,
        ..Options::default()
    };
    Eskf::new(NavState::at_rest(0), model, &options).unwrap()
}

/// By hand: a velocity 5 m/s off with σ 0.05 m/s on both sides, 25/(0.0025 (1 + f)) = 3 + 25/2500 gives f = 3321. Five sigma of
/// it, 25 of the variance, go to all inertial states, the rest to the velocity alone; but no attitude sigma exceeds 1 rad and no
/// position sigma 1000 km, where a σ of a half then gets a factor of four.
#[test]
fn what_is_not_measured_is_inflated_to_a_bound() {
    let with = |attitude_sd_rad: f64, position_sd_m: f64| {
        let mut model = Model::table_2();
        model.initial.attitude_sd_rad = [attitude_sd_rad; 3];
        model.initial.position_sd_m = [position_sd_m; 3];
        let mut filter = filter(&model);
        let off = Vec3::new(3.0, 4.0, 0.0);
        let innovation = velocity(&filter.state(), &off, &(nalgebra::Matrix3::identity() * 0.0025));
        let before = filter.covariance();
        assert_eq!(noted(&mut filter, &innovation, Sensor::Velocity, false), None);
        let factor = noted(&mut filter, &innovation, Sensor::Velocity, false).unwrap();
        let after = filter.covariance();
        let ratio = |k: usize| after[(k, k)] / before[(k, k)];
        assert!((factor / 3321.0 - 1.0).abs() < 1e-3, "{factor}");
        assert!((ratio(VELOCITY) / factor - 1.0).abs() < 1e-12);
        assert!((ratio(ATTITUDE) / ratio(POSITION) - 1.0).abs() < 1e-12);
        ratio(ATTITUDE)
    };
    for (attitude_sd_rad, position_sd_m, expected) in [(0.02, 2.0, 25.0), (0.5, 2.0, 4.0), (0.02, 5e5, 4.0)] {
        let factor = with(attitude_sd_rad, position_sd_m);
        assert!((factor / expected - 1.0).abs() < 1e-12, "{factor} {expected}");
    }
}

/// By hand: a velocity with σ 0.05 m/s on both sides, of five sigma S = 0.0025 (1 + 25), whose 99.73 % reach to
/// √(0.065 · 14.156) = 0.959 m/s. What is further off does not count at once unless any error is admissible.
#[test]
fn beyond_what_is_admissible_nothing_counts() {
    let inflates = |off_mps: f64, is_confirmed: bool| {
        let mut filter = filter(&Model::table_2());
        let off = Vec3::new(0.6 * off_mps, 0.8 * off_mps, 0.0);
        let innovation = velocity(&filter.state(), &off, &(nalgebra::Matrix3::identity() * 0.0025));
        let factors: [Option<f64>; 6] =
            std::array::from_fn(|_| noted(&mut filter, &innovation, Sensor::Beams, is_confirmed));
        factors.iter().any(Option::is_some)
    };
    assert!(inflates(0.955, true));
    assert!(!inflates(0.965, true));
    assert!(inflates(0.965, false) && inflates(5.0, false));
}

/// Beams that contradict each other are explained by no covariance and never count; beams that agree do, and so do those
/// whose contradiction is within noise and bias: closure e has e²/(4 (0.04² + 0.005²)), 15.8 for 0.32 m/s and 16.8 for 0.33,
/// and the 99.73 % quantile of four degrees of freedom is 16.25.
#[test]
fn only_what_a_covariance_explains_counts() {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let inflates = |error: [f64; 4]| {
        let mut filter = filter(&Model::table_2());
        let mut ping = ping_of(0, [0.0; MAX_BEAMS], 0.04, BeamMask::all(4));
        ping.velocity_mps[..4].copy_from_slice(&error);
        let innovation = filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping));
        let factors: [Option<f64>; 6] = std::array::from_fn(|_| noted(&mut filter, &innovation, Sensor::Beams, false));
        factors.iter().any(Option::is_some)
    };
    assert!(inflates([1.2, -1.2, -1.2, 1.2]), "surge alone");
    assert!(!inflates([1.2, -1.2, 1.2, -1.2]), "closure alone");
    assert!(inflates([1.2 + 0.32, -1.2, -1.2, 1.2]), "surge and a doubtful beam");
    assert!(!inflates([1.2 + 0.33, -1.2, -1.2, 1.2]), "surge and an outlier");
}

/// Errors agree where their difference is at most half their root sum of squares: 1 and 2 do (1 of 1.25), 1 and 2.3 do not (1.69 of
/// 1.57).
#[test]
fn errors_that_agree() {
    let along = |length: f64| Vector3::new(0.6, 0.0, 0.8) * length;
    assert!(agree(&along(1.0), &along(2.0)) && agree(&along(0.2), &along(0.1)));
    assert!(!agree(&along(1.0), &along(2.3)) && !agree(&along(1.0), &along(-1.0)));
}

/// A rejection that disagrees with the one before begins a run.
#[test]
fn rejections_that_disagree_begin_anew() {
    let mut run = Run::default();
    run.push(false, 4.0, Vector3::x(), 7, 5);
    run.push(false, 4.0, -Vector3::x(), 8, 5);
    assert_eq!((run.explained, run.since_ns), (1, 8));
    run.push(false, 4.0, -Vector3::x(), 9, 5);
    assert_eq!((run.explained, run.since_ns), (2, 8));
}

/// Where inflation is off nothing is counted.
#[test]
fn off_is_never() {
    let options = Options {
        inflate_after_rejections: 0,
        ..Options::default()
    };
    let mut off = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    let innovation = depth(&Motion::still(&off.state()), 10.0, 0.5, &Vec3::zeros());
    for _ in 0..3 {
        assert_eq!(noted(&mut off, &innovation, Sensor::Depth, false), None);
    }
    assert_eq!(
        (off.rejections_allowed(), filter(&Model::table_2()).rejections_allowed()),
        (0, 2)
    );
}

/// A depth 10 m off beside a position of 2 m is explained by a bias of 3 m, 100/(4 + 9 + 0.25) = 7.5 of 9, and not without. Once a depth
/// has been taken, bias and position are correlated, and the depth is known to centimetres.
#[test]
fn the_bias_of_a_depth_counts() {
    let with = |bias_sd_m: f64, has_depth: bool, depth_m: f64| {
        let mut model = Model::table_2();
        model.sensors.depth.bias_sd_m = bias_sd_m;
        model.initial.attitude_sd_rad = [1e-3; 3];
        let mut filter = filter(&model);
        let reading =
            |filter: &Eskf, depth_m: f64| depth(&Motion::still(&filter.state()), depth_m, 0.5, &Vec3::zeros());
        if has_depth {
            filter.update(&reading(&filter, 0.0), Sensor::Depth).unwrap();
        }
        let innovation = reading(&filter, depth_m);
        noted(&mut filter, &innovation, Sensor::Depth, false);
        noted(&mut filter, &innovation, Sensor::Depth, false).is_some()
    };
    assert!(!with(3.0, false, 10.0) && with(0.0, false, 10.0));
    assert!(with(3.0, true, 5.0) && !with(3.0, true, 1.0));
}

/// A position of σ 500 km that is off by 5,000 km grows to the bound of 1,000 km alone, a factor of four; at the bound it does not grow.
#[test]
fn a_position_grows_to_its_bound() {
    for (sd_m, expected) in [(5e5, Some(4.0)), (1e6, None)] {
        for has_velocity in [false, true] {
            let mut model = Model::table_2();
            model.initial.position_sd_m = [sd_m; 3];
            let mut filter = filter(&model);
            if has_velocity {
                filter.measured.velocity_ns = Some(0);
            }
            let place = Vec3::new(10.0 * sd_m, 0.0, 0.0);
            let far = position(&Motion::still(&filter.state()), &place, &[1.0; 3], &Vec3::zeros());
            assert_eq!(noted(&mut filter, &far, Sensor::AcousticPosition, false), None);
            let factor = noted(&mut filter, &far, Sensor::AcousticPosition, false);
            assert_eq!(factor.is_some(), expected.is_some());
            if let (Some(factor), Some(expected)) = (factor, expected) {
                assert!((factor / expected - 1.0_f64).abs() < 1e-9, "{factor}");
            }
            let largest = filter.covariance()[(POSITION, POSITION)];
            assert!((largest / 1e12 - 1.0).abs() < 1e-9, "{largest}");
        }
    }
}

/// The states of a block whose columns have half the largest entry.
#[test]
fn states_that_rows_measure() {
    let mut innovation = Innovation {
        rows: 1,
        degrees: 1,
        ..Innovation::empty()
    };
    for (entries, expected) in [
        ([1.8, 0.6, -3.0], [true, false, true]),
        ([0.0, 0.0, 1.0], [false, false, true]),
    ] {
        for (k, entry) in entries.into_iter().enumerate() {
            innovation.jacobian[(0, ATTITUDE + k)] = entry;
        }
        let measured = observed(&innovation, ATTITUDE);
        let indices: Vec<_> = (0..DIM).filter(|&k| measured[k]).collect();
        let expected: Vec<_> = (0..3).filter(|&k| expected[k]).map(|k| ATTITUDE + k).collect();
        assert_eq!(indices, expected);
    }
}

/// A velocity inflates itself by the whole factor, and the biases of the inertial sensors by the indirect one.
#[test]
fn a_velocity_alone_is_measured() {
    let mut filter = filter(&Model::table_2());
    let off = Vec3::new(3.0, 4.0, 0.0);
    let innovation = velocity(&filter.state(), &off, &(nalgebra::Matrix3::identity() * 0.0025));
    let before = filter.covariance();
    noted(&mut filter, &innovation, Sensor::Velocity, false);
    noted(&mut filter, &innovation, Sensor::Velocity, false).unwrap();
    let after = filter.covariance();
    for k in (0..VELOCITY).chain(VELOCITY + 3..DVL_BIAS) {
        assert!((after[(k, k)] / before[(k, k)] - 25.0).abs() < 1e-9, "{k}");
    }
    assert_eq!(after[(DVL_BIAS, DVL_BIAS)], before[(DVL_BIAS, DVL_BIAS)]);
}

/// Runs from bytes are finite.
#[test]
fn restored_runs_are_checked() {
    let good = Evidence::default();
    assert_eq!(good.check_restored(3), Ok(()));
    let faults: [fn(&mut Run); 2] = [|run| run.log_factor = f64::NAN, |run| run.correction.y = f64::INFINITY];
    for change in faults {
        let mut bad = good.clone();
        change(&mut bad.0[Sensor::COUNT - 1]);
        assert!(bad.check_restored(3).is_err());
    }
}
