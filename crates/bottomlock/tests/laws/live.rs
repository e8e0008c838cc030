//! A live navigator: faults of the inertial sensors are values, and a push that is refused changes nothing.

use crate::common::*;
use bottomlock::mechanisation::ImuFault;
use proptest::prelude::*;

const MS: i64 = 1_000_000;

fn live(method: &str, options: &Options) -> LiveNavigator {
    live_within(0, method, options)
}

fn live_within(horizon_ns: i64, method: &str, options: &Options) -> LiveNavigator {
    let aiding = Method::named(method).unwrap().aiding;
    let (start, model) = (NavState::at_rest(0), Model::table_2());
    LiveNavigator::new(start, &janus(), aiding, &model, options, horizon_ns).unwrap()
}

fn depth(time_ns: i64, depth_m: f64, sd_m: f64) -> Event {
    Event::from(DepthSample { time_ns, depth_m, sd_m })
}

/// Everything that can be seen of a navigator, as text, which prints every bit that counts; NaN equals NaN.
fn seen(navigator: &LiveNavigator) -> String {
    format!("{navigator:?}")
}

fn quiet(navigator: &mut LiveNavigator, event: &Event) -> Result<Option<ImuFault>, NavError> {
    let mut fault = None;
    navigator.push(event, &mut |notice: &Notice| {
        if let Finding::Rejected { time_ns, fault: why } = &notice.finding
            && *time_ns == event.time_ns()
        {
            fault = Some(*why);
        }
    })?;
    Ok(fault)
}

/// The navigator ends in the very bits of one that was given the good readings and told of the gap; the bad reading is a
/// value with its reason, and its 10 ms of 1000 m/s² move nothing: bridged over 20 ms, the heave is uncertain by a
/// further 1 cm/s and the yaw by 2 mrad.
#[test]
fn one_bad_reading_is_rejected_and_bridged() {
    let options = Options::default();
    let mut with_it = live("ins", &options);
    let mut without = live("ins", &options);
    for k in 0..100 {
        let fault = quiet(&mut with_it, &imu(k * 10 * MS, if k == 50 { 1000.0 } else { 0.0 })).unwrap();
        assert_eq!(fault.is_some(), k == 50);
        if let Some(fault) = fault {
            assert_eq!(
                fault.to_string(),
                "specific force x is 1000 m/s², beyond the full scale of 100 m/s²: is it in mg or cm/s²?"
            );
            assert_eq!(with_it.navigator().state().time_ns, 490 * MS);
        } else {
            quiet(&mut without, &imu(k * 10 * MS, 0.0)).unwrap();
        }
    }
    assert_eq!(with_it.imu_faults(), &[1, 0, 0, 0, 0]);
    let (one, other) = (with_it.navigator(), without.navigator());
    assert_eq!(one.state(), other.state());
    let further = one.covariance() - other.covariance();
    let sd = |state: usize| further[(state, state)].sqrt();
    assert!((sd(8) - 0.01).abs() < 1e-4, "heave: {}", sd(8));
    assert!((sd(5) - 0.002).abs() < 1e-5, "yaw: {}", sd(5));
}

/// An hour without readings is refused with both times, the gap, the limit and what to do; or inflated where it is short
/// enough.
#[test]
fn a_gap_is_refused_or_inflated() {
    let mut navigator = live("tc", &Options::default());
    quiet(&mut navigator, &imu(0, 0.0)).unwrap();
    let before = seen(&navigator);
    let error = quiet(&mut navigator, &imu(3_600_000 * MS, 0.0))
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "imu time 3600000000000 ns comes 3600.000000 s after the last good reading at 0 ns, expected at most \
         imu_limits.max_gap_s = 1 s: start again from a fix, or bridge the gap with imu_limits.gap = \"inflate\""
    );
    assert_eq!(seen(&navigator), before);

    let mut options = Options::default();
    options.imu_limits.gap = LongGap::Inflate;
    let mut inflating = live("tc", &options);
    quiet(&mut inflating, &imu(0, 0.0)).unwrap();
    assert!(matches!(
        quiet(&mut inflating, &imu(3_600_000 * MS, 0.0)),
        Err(NavError::ImuGapTooLong { .. })
    ));
    quiet(&mut inflating, &imu(4_000 * MS, 0.0)).unwrap();
    assert_eq!(inflating.imu_faults(), &[0, 0, 0, 0, 1]);
    let down_sd = inflating.navigator().covariance()[(8, 8)].sqrt();
    assert!((down_sd - 2.0).abs() < 2e-2, "0.5 m/s² over 4 s: {down_sd}");
}

/// What used to raise after it had moved the position by 1e303 m, and what did not raise at all.
#[test]
fn absurd_readings_move_nothing() {
    let mut navigator = live("tc", &Options::default());
    quiet(&mut navigator, &imu(0, 0.0)).unwrap();
    let state = navigator.navigator().state();
    for force in [1e308, -1e308, 1e300] {
        assert!(quiet(&mut navigator, &imu(MS, force)).is_err());
        assert_eq!(navigator.navigator().state(), state);
    }
    for (k, force) in [-1e6, 1e6, 100.0].into_iter().enumerate() {
        let fault = quiet(&mut navigator, &imu((k as i64 + 2) * MS, force)).unwrap();
        assert!(fault.is_some(), "{force}");
        assert_eq!(navigator.navigator().state(), state);
    }
    // A rejected reading has had its time.
    assert!(matches!(
        quiet(&mut navigator, &imu(4 * MS, 100.0)),
        Err(NavError::TimeNotIncreasing { .. })
    ));
    assert_eq!(navigator.late_events()[0], 1);
    quiet(&mut navigator, &imu(5 * MS, 0.0)).unwrap();
    assert!(navigator.navigator().covariance().iter().all(|entry| entry.is_finite()));
}

/// Finite numbers that no instrument has are refused as they come, so that they cannot wait for the next reading and spoil it.
#[test]
fn absurd_measurements_are_refused() {
    let options = Options {
        gate: Gate::Off,
        ..Options::default()
    };
    for method in METHODS {
        let mut navigator = live(method.name, &options);
        quiet(&mut navigator, &imu(0, 0.0)).unwrap();
        for time_ns in [0, 3 * MS] {
            let ping = |velocity, sd| {
                let valid = (0..4).collect();
                Event::Beams(BeamSample {
                    time_ns,
                    velocity_mps: [velocity; MAX_BEAMS],
                    sd_mps: [sd; MAX_BEAMS],
                    valid,
                })
            };
            let bad = [
                depth(time_ns, 1.0, 1e300),
                depth(time_ns, 1.0, 1e-200),
                depth(time_ns, 1e308, 1.0),
                depth(i64::MAX, 1.0, 1.0),
                ping(1e200, 0.1),
                ping(0.0, 1e-170),
                Event::from(HeadingSample {
                    time_ns,
                    yaw_rad: 0.1,
                    sd_rad: 1e200,
                }),
            ];
            for event in bad {
                let before = seen(&navigator);
                let error = quiet(&mut navigator, &event);
                assert!(error.is_err(), "{} {event:?}", method.name);
                assert_eq!(seen(&navigator), before, "{} {event:?}", method.name);
            }
        }
        quiet(&mut navigator, &imu(10 * MS, 0.0)).unwrap();
    }
}

/// An update that leaves no estimate is undone, now or waiting, and what waits can be dropped.
#[test]
fn an_update_that_leaves_no_estimate_is_undone() {
    let options = Options {
        gate: Gate::Off,
        ..Options::default()
    };
    let mut navigator = live("tc", &options);
    quiet(&mut navigator, &imu(0, 0.0)).unwrap();
    let before = seen(&navigator);
    assert!(matches!(
        quiet(&mut navigator, &depth(0, 1e11, 1.0)),
        Err(NavError::Implausible { .. })
    ));
    assert_eq!(seen(&navigator), before);

    quiet(&mut navigator, &depth(3 * MS, 2.0, 1.0)).unwrap();
    quiet(
        &mut navigator,
        &Event::from(GpsSample {
            time_ns: 4 * MS,
            position_t_m: Vec3::new(1e11, 0.0, 0.0),
            position_sd_m: [1.0; 3],
            velocity: None,
        }),
    )
    .unwrap();
    let before = seen(&navigator);
    let mut reports = 0;
    for _ in 0..2 {
        assert!(navigator.push(&imu(10 * MS, 0.0), &mut |_| reports += 1).is_err());
        assert_eq!(seen(&navigator), before);
    }
    assert_eq!(reports, 0, "reports of what was undone");
    assert_eq!(navigator.discard_waiting(), 2);
    quiet(&mut navigator, &imu(10 * MS, 0.0)).unwrap();
}

/// Noise and start that no instrument has are refused at once.
#[test]
fn absurd_models_are_refused() {
    let start = |change: fn(&mut Model, &mut NavState)| {
        let (mut model, mut state) = (Model::table_2(), NavState::at_rest(0));
        change(&mut model, &mut state);
        let aiding = Method::named("tc").unwrap().aiding;
        LiveNavigator::new(state, &janus(), aiding, &model, &Options::default(), 0)
    };
    assert!(start(|_, _| {}).is_ok());
    assert!(start(|model, _| model.imu.accel_noise_mps_rts = 1e200).is_err());
    assert!(start(|model, _| model.initial.position_sd_m[0] = 1e200).is_err());
    assert!(start(|model, _| model.environment.gravity_mps2 = 1e300).is_err());
    assert!(start(|_, state| state.position_t_m = Vec3::new(1e300, 0.0, 0.0)).is_err());
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -12.0_f64..12.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(0.0), 1 => Just(1e300),
        1 => Just(1e15), 1 => Just(1e-160), 1 => Just(-120.0), 1 => 1e5_f64..1e13
    ]
}

fn event() -> impl Strategy<Value = Event> {
    let time = prop_oneof![12 => (-1_i64..400).prop_map(|k| k * 10 * MS), 1 => Just(i64::MAX), 1 => Just(i64::MIN), 1 => Just(7_000_000 * MS)];
    (0_usize..8, time, prop::array::uniform6(number()), 0_usize..16).prop_map(|(kind, time_ns, x, bits)| {
        let (a, b) = ([x[0], x[1], x[2]], [x[3], x[4], x[5]]);
        match kind {
            0..=2 => Event::Imu(ImuSample {
                time_ns,
                rate_p_radps: Vec3::from_array(a),
                force_p_mps2: Vec3::from_array(b),
            }),
            3 => Event::Beams(BeamSample {
                time_ns,
                velocity_mps: [x[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0],
                sd_mps: [x[4]; MAX_BEAMS],
                valid: (0..4).filter(|k| bits & (1 << k) != 0).collect(),
            }),
            4 => depth(time_ns, x[0], x[1]),
            5 => Event::from(VelocitySample {
                time_ns,
                velocity_p_mps: Vec3::from_array(a),
                cov_m2ps2: Matrix3::from_diagonal(&b.into()),
            }),
            6 => Event::from(GpsSample {
                time_ns,
                position_t_m: Vec3::from_array(a),
                position_sd_m: b,
                velocity: None,
            }),
            _ => Event::from(HeadingSample {
                time_ns,
                yaw_rad: x[0],
                sd_rad: x[1],
            }),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// The law: a push that is refused leaves every bit as it was but the count of late events; one that is taken leaves
    /// numbers. A navigator that is never given what the other refuses ends in the same bits.
    #[test]
    fn a_refused_push_changes_nothing(
        events in prop::collection::vec(event(), 1..40), index in 0_usize..METHODS.len(), every_step in any::<bool>(),
        inflate in any::<bool>(), gate in any::<bool>(), horizon_ns in prop_oneof![Just(0), Just(500 * MS), Just(10_000 * MS)],
    ) {
        let mut options = Options { covariance_period_ns: if every_step { 0 } else { 100_000_000 }, ..Options::default() };
        if inflate { options.imu_limits.gap = LongGap::Inflate; }
        if !gate { options.gate = Gate::Off; }
        let mut navigator = live_within(horizon_ns, METHODS[index].name, &options);
        let mut spared = navigator.clone();
        for event in &events {
            let before = (seen(&navigator), *navigator.late_events());
            match quiet(&mut navigator, event) {
                Ok(fault) => prop_assert_eq!(quiet(&mut spared, event), Ok(fault)),
                Err(NavError::TimeNotIncreasing { .. } | NavError::TooLate { .. }) => {
                    let late: u64 = navigator.late_events().iter().sum();
                    prop_assert_eq!(late, before.1.iter().sum::<u64>() + 1);
                }
                Err(_) => prop_assert_eq!(&seen(&navigator), &before.0),
            }
            prop_assert!(navigator.navigator().state().validate().is_ok());
            let covariance = navigator.navigator().covariance();
            prop_assert!((0..DIM * DIM).all(|k| covariance[(k / DIM, k % DIM)].is_finite()));
        }
        prop_assert_eq!(navigator.navigator().state(), spared.navigator().state());
        prop_assert_eq!(navigator.navigator().covariance(), spared.navigator().covariance());
        prop_assert_eq!(navigator.imu_faults(), spared.imu_faults());
    }
}
