//! When the constrained filter starts again, what it takes from the measurements, and that nothing leaves one of the two out.

use super::*;
use crate::aiding::water::HEAVE;
use crate::aiding::water_track::WaterSample;
use crate::filter::tape::Step;
use crate::testing::*;

/// σ of each axis of the velocity, m/s.
const SD: f64 = 0.1;
/// Rejections in a row after which the constrained filter starts again.
const ALLOWED: u32 = 3;

fn filter(velocity_mps: [f64; 3]) -> Eskf {
    let mut model = Model::table_2();
    model.environment.earth_rate_radps = 0.0;
    model.initial.velocity_sd_mps = [SD; 3];
    model.initial.attitude_sd_rad = [1e-3; 3];
    let options = Options {
        inflate_after_rejections: ALLOWED,
        ..Options::default()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::from_array(velocity_mps);
    Eskf::new(state, &model, &options).unwrap()
}

/// Two filters, of which the constrained one has another velocity.
fn filters(constrained_mps: [f64; 3], prior: &WaterPrior) -> DualFilter {
    let mut filters = DualFilter::new(filter([0.0; 3]), Some(WaterBlock::new(prior)));
    filters.constrained = Some(Box::new(
        filter(constrained_mps).with_water(Some(WaterBlock::new(prior))),
    ));
    filters
}

/// Variances of the water states in the long run.
fn slip_variance(filters: &DualFilter) -> [f64; WATER] {
    let water = filters.best().water().unwrap();
    water.processes().map(|process| process.variance)
}

/// Alarms and restarts of the constrained filter.
fn starts(filters: &DualFilter) -> [u64; 2] {
    let water = filters.best().water().unwrap();
    [water.alarms(), water.restarts()]
}

/// Surge, measured with σ of 1 m/s: off by so much from the filter on the measurements alone and from the constrained one.
fn surge(alone_mps: f64, constrained_mps: f64) -> impl Fn(&Eskf) -> Innovation {
    move |filter: &Eskf| {
        let is_alone = filter.water().is_none();
        velocity_rows(&[if is_alone { alone_mps } else { constrained_mps }], 1.0)
    }
}

/// Leads both through what a vehicle at rest reads, every tenth of a second.
fn rest(filters: &mut DualFilter, seconds: i64) {
    let start_ns = filters.best().time_ns();
    let sample = |k: i64| {
        imu(
            start_ns + k * 100_000_000,
            [0.0; 3],
            [0.0, 0.0, -filters.best().gravity_mps2()],
        )
    };
    let samples: Vec<_> = (0..=10 * seconds).map(sample).collect();
    for pair in samples.windows(2) {
        filters.predict(&pair[0], &pair[1]).unwrap();
    }
}

/// The velocity that the assumptions lead to is excluded at 30.665, 5.54 σ along an axis: the constrained filter then starts
/// from the other one, with both slips at those of an unknown vehicle.
#[test]
fn a_failed_assumption_is_widened() {
    for (sigmas, fails) in [(5.4, false), (5.7, true)] {
        let mut filters = filters([sigmas * SD, 0.0, 0.0], &WaterPrior::default());
        let mut sensors = Vec::new();
        filters.assume(&mut |report| sensors.push(report.sensor)).unwrap();
        assert_eq!(starts(&filters), [u64::from(fails); 2], "{sigmas} sigma");
        assert_eq!(sensors, [Sensor::Heave, Sensor::Sway]);
        let variance = if fails { 0.3 * 0.3 } else { 0.02 * 0.02 };
        for slip in [SWAY, HEAVE] {
            assert!((slip_variance(&filters)[slip] - variance).abs() < 1e-12);
        }
        let surge_mps = filters.best().velocity().0.x;
        let expected = if fails { 0.0 } else { sigmas * SD };
        assert!((surge_mps - expected).abs() < 1e-3, "{surge_mps}");
        assert_eq!(filters.measurements_only.velocity().0, Vector3::zeros());
    }
}

/// The third implausible measurement in a row starts the constrained filter again, with both slips wider, and the count too. One
/// that is plausible, or that the filter on the measurements alone rejects, begins the count anew.
#[test]
fn the_last_rejection_that_is_allowed_starts_it_again() {
    let (good, bad, wild) = ((0.0, 0.0), (0.0, 10.0), (10.0, 10.0));
    let cases: [(&[(f64, f64)], u64); 7] = [
        (&[bad, bad], 0),
        (&[bad, bad, bad], 1),
        (&[bad, bad, good, bad, bad], 0),
        (&[bad, bad, wild, bad, bad], 0),
        (&[bad, good, bad, bad, bad], 1),
        (&[bad, bad, bad, bad, bad], 1),
        (&[bad, bad, bad, bad, bad, bad], 2),
    ];
    for (errors, expected) in cases {
        let mut filters = filters([0.0; 3], &WaterPrior::default());
        for (alone, constrained) in errors {
            let report = filters.update(Sensor::Velocity, &surge(*alone, *constrained)).unwrap();
            assert_eq!(report.residual[0], *alone);
        }
        assert_eq!(starts(&filters), [expected; 2], "{errors:?}");
        if expected > 0 {
            let variance = slip_variance(&filters)[HEAVE];
            assert!(variance > 0.08, "{variance}");
        }
    }
}

/// A plausible reading of one sensor is no word on those of another.
#[test]
fn each_sensor_has_a_count() {
    let mut filters = filters([0.0; 3], &WaterPrior::default());
    for k in 0..ALLOWED {
        assert_eq!(starts(&filters), [0; 2], "{k}");
        filters.update(Sensor::Velocity, &surge(0.0, 10.0)).unwrap();
        filters.update(Sensor::GpsVelocity, &surge(0.0, 0.0)).unwrap();
    }
    assert_eq!(starts(&filters), [1; 2]);
}

/// Without a limit nothing starts again.
#[test]
fn no_rejection_counts_without_a_limit() {
    let options = Options {
        inflate_after_rejections: 0,
        ..Options::default()
    };
    let filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
    let mut filters = DualFilter::new(filter, Some(WaterBlock::new(&options.water)));
    for constrained in [10.0, 10.0, 0.0, 10.0, 0.0] {
        filters.update(Sensor::Velocity, &surge(0.0, constrained)).unwrap();
    }
    assert_eq!(starts(&filters), [0; 2]);
}

/// Each filter has its own innovation, and the rows that the filter on the measurements alone accepts: 10 m/s, of which
/// 0.01/1.01 is taken.
#[test]
fn the_verdict_is_that_of_the_measurements_alone() {
    for (alone, constrained, expected) in [
        (0.0, 10.0, Some([0.0, 10.0])),
        (1.0, 0.0, Some([1.0, 0.0])),
        (10.0, 0.0, None),
    ] {
        let mut filters = filters([0.0; 3], &WaterPrior::default());
        let report = filters.update(Sensor::Velocity, &surge(alone, constrained)).unwrap();
        assert_eq!(report.was_used(), expected.is_some());
        let gain = SD * SD / (1.0 + SD * SD);
        for (filter, moved) in filters.each().zip(expected.unwrap_or([0.0; 2])) {
            assert!((filter.velocity().0.x - gain * moved).abs() < 1e-12);
            let left = if expected.is_some() { 1.0 - gain } else { 1.0 };
            let variance = filter.covariance()[(VELOCITY, VELOCITY)];
            assert!((variance / (SD * SD * left) - 1.0).abs() < 1e-9);
        }
    }
}

/// The third rejection in a row inflates the filter on the measurements alone, which then takes the measurement, and starts the
/// constrained one from it; nothing contradicted the assumptions. An accepted measurement begins the count anew.
#[test]
fn an_inflation_starts_the_constrained_filter_again() {
    let (good, wild) = (surge(0.0, 0.0), surge(10.0, 10.0));
    for interrupted in [false, true] {
        let mut filters = filters([0.0; 3], &WaterPrior::default());
        let mut push = |innovation_of: &dyn Fn(&Eskf) -> Innovation| {
            filters.update_or_inflate(Sensor::Velocity, &innovation_of).unwrap()
        };
        for _ in 1..ALLOWED {
            let report = push(&wild);
            assert_eq!((report.verdict, report.inflation), (Verdict::Rejected, None));
        }
        if interrupted {
            assert_eq!(push(&good).verdict, Verdict::Accepted);
        }
        let report = push(&wild);
        assert_eq!(report.inflation.is_some(), !interrupted);
        let verdict = if interrupted {
            Verdict::Rejected
        } else {
            Verdict::Accepted
        };
        assert_eq!(report.verdict, verdict);
        assert_eq!(starts(&filters), [0, u64::from(!interrupted)]);
        let [alone, constrained] = [&filters.measurements_only, filters.best()].map(|filter| filter.velocity());
        assert_eq!(alone, constrained);
        assert_eq!(alone.0.x > 1.0, !interrupted);
    }
}

/// A slip of 1 m/s for which nothing allows, a ping a second: its test gives the alarm, and that slip alone is widened.
#[test]
fn an_alarm_widens_its_slip() {
    let certain = WaterPrior {
        current_sd_mps: 0.0,
        sway_gain_m: 0.0,
        sway_gain_sd_m: 0.0,
        trim_sd_mps: 0.0,
        ..WaterPrior::default()
    };
    for (axis, slip) in [(1, SWAY), (2, HEAVE)] {
        let mut velocity_mps = [0.0; 3];
        velocity_mps[axis] = 1.0;
        let mut filters = DualFilter::new(filter(velocity_mps), Some(WaterBlock::new(&certain)));
        let mut pings = 0;
        while starts(&filters) == [0; 2] {
            rest(&mut filters, 1);
            filters.assume(&mut |_| {}).unwrap();
            pings += 1;
            assert!(pings < 10, "no alarm");
        }
        assert!(pings > 1);
        assert_eq!(starts(&filters), [1; 2]);
        let variance = slip_variance(&filters);
        assert!(variance[slip] > 0.08, "{variance:?}");
        assert!((variance[SWAY + HEAVE - slip] - 4e-4).abs() < 1e-12, "{variance:?}");
        // It starts from the filter on the measurements alone.
        assert_eq!(filters.best().velocity(), filters.measurements_only.velocity());
    }
}

/// With one filter there is nothing to assume, to restart or to widen.
#[test]
fn one_filter_has_no_assumptions() {
    let mut filters = DualFilter::new(filter([0.0; 3]), None);
    filters.assume(&mut |report| panic!("{report:?}")).unwrap();
    filters.restart_constrained();
    filters.widen_slip(BOTH_LARGER);
    assert_eq!((filters.each().count(), filters.each_mut().count()), (1, 1));
    filters.begin_tape();
    filters.record_sample();
    filters.keep_best();
    let tape = filters.take_tape().unwrap();
    assert_eq!(tape.steps.len(), 1);
}

/// What is done to the filters is done to both; the constrained one is reported.
#[test]
fn both_filters_are_led() {
    let mut filters = filters([0.3, 0.0, 0.0], &WaterPrior::default());
    assert_eq!((filters.each().count(), filters.each_mut().count()), (2, 2));
    let turning = imu(0, [0.0, 0.0, 0.2], [0.0; 3]);
    filters.note_rate(&turning);
    filters.note_interval(0.02);
    filters.begin_tape();
    for filter in filters.each() {
        let (rate, variance) = filter.with_motion(|motion| (motion.rate_ip_p_radps.z, motion.gyro_variance));
        assert_eq!(rate, 0.2);
        assert!(variance > 0.0);
    }
    rest(&mut filters, 1);
    filters.record_sample();
    for filter in filters.each_mut() {
        assert_eq!(filter.time_ns(), 1_000_000_000);
        assert!(matches!(
            filter.take_tape().unwrap().steps.last(),
            Some(Step::Sample { .. })
        ));
    }
    filters.begin_tape();
    filters.measurements_only.record_sample();
    assert!(
        filters.take_tape().unwrap().steps.is_empty(),
        "that of the constrained one"
    );
    let best = filters.best().state();
    assert!((best.velocity_p_mps.0.x - 0.3).abs() < 1e-6);
    filters.keep_best();
    assert_eq!((filters.each().count(), filters.best().state()), (1, best));
}

/// The constrained filter continues the tape of the filter it starts from.
#[test]
fn a_filter_that_starts_again_continues_the_tape() {
    let mut filters = filters([0.0; 3], &WaterPrior::default());
    filters.begin_tape();
    rest(&mut filters, 1);
    filters.record_sample();
    filters.restart_constrained();
    let own = filters.take_tape().unwrap();
    assert_eq!(Some(own), filters.measurements_only.take_tape());
}

/// Either filter that was read from bytes is checked.
#[test]
fn both_restored_filters_are_checked() {
    assert_eq!(filters([0.0; 3], &WaterPrior::default()).check_restored(), Ok(()));
    for faulty in [0, 1] {
        let mut filters = filters([0.0; 3], &WaterPrior::default());
        filters.each_mut().nth(faulty).unwrap().note_interval(f64::NAN);
        assert!(filters.check_restored().is_err(), "{faulty}");
    }
}

/// Water track tells both filters of one current: a constrained filter that starts again keeps it and its covariance, with the
/// slips as they were widened, and independent of all else.
#[test]
fn a_constrained_filter_starts_with_the_measured_current() {
    let prior = WaterPrior::default();
    let alone = filter([2.0, 0.0, 0.0]).with_water(Some(WaterBlock::new(&prior)));
    let mut filters = DualFilter::new(alone, Some(WaterBlock::new(&prior)));
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let ping = ping_at(&geometry, [1.7, -0.2, 0.0], 0.02);
    let innovation_of = |filter: &Eskf| filter.water_track_innovation(&geometry, &WaterSample { ping, range_m: 0.0 });
    filters.update(Sensor::WaterTrack, &innovation_of).unwrap();
    let measured = |filter: &Eskf| {
        let estimate = filter.water_states().unwrap().estimate;
        let covariance = filter.water_covariance().unwrap().fixed_view::<2, 2>(0, 0).into_owned();
        ([estimate[CURRENT], estimate[CURRENT + 1]], covariance)
    };
    let known = measured(&filters.measurements_only);
    assert!(
        (known.0[0] - 0.27).abs() < 0.03 && (known.0[1] - 0.18).abs() < 0.03,
        "{:?}",
        known.0
    );
    let wider = WaterBlock::new(&prior).widened([Some(Alarm::Larger), None]);
    filters.start_constrained(wider.clone());
    assert_eq!(measured(filters.best()), known);
    let block = filters.constrained_water().unwrap();
    let slip_mps = filters.best().water_states().unwrap().estimate[SWAY];
    assert_eq!((slip_mps, block.alarms()), (0.0, 1));
    let whole = filters.best().water_covariance().unwrap();
    assert_eq!(whole[(SWAY, SWAY)], wider.processes()[SWAY].variance);
    assert_eq!(whole.row(SWAY).iter().filter(|&&number| number != 0.0).count(), 1);
}

/// One filter that estimates the current makes no assumption: an inflation starts no second one.
#[test]
fn a_measured_current_is_no_assumption() {
    let water = WaterBlock::new(&WaterPrior::default());
    let mut filters = DualFilter::new(filter([0.0; 3]).with_water(Some(water)), None);
    let mut push = || filters.update_or_inflate(Sensor::Velocity, &surge(10.0, 10.0)).unwrap();
    let inflations: Vec<_> = (0..ALLOWED).map(|_| push().inflation.is_some()).collect();
    assert_eq!(inflations, [false, false, true]);
    assert!(filters.constrained_water().is_none() && filters.each().count() == 1);
}

/// Velocities 1.5 σ to one side, a second apart: once their mean contradicts the filter on the measurements alone both become
/// uncertain by the same, and the constrained one goes on.
#[test]
fn an_error_that_lasts_is_charged_to_both_filters() {
    let mut filters = filters([0.0; 3], &WaterPrior::default());
    let variance = |filter: &Eskf| filter.covariance()[(VELOCITY, VELOCITY)];
    let variances = |filters: &DualFilter| filters.each().map(variance).collect::<Vec<_>>();
    let charge = (0..60).find_map(|_| {
        rest(&mut filters, 1);
        filters.update(Sensor::Velocity, &surge(1.5, 0.0)).unwrap();
        let before = variances(&filters);
        filters.charge_lasting().map(|charge| (charge, before))
    });
    let (charge, before) = charge.unwrap();
    let after = variances(&filters);
    let grown = (charge.factor.unwrap() - 1.0) * before[0];
    for k in 0..2 {
        assert!(((after[k] - before[k]) / grown - 1.0).abs() < 1e-9, "filter {k}");
    }
    assert_eq!(starts(&filters), [0, 0]);
}
