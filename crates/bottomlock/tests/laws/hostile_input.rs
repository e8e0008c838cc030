//! Input out of order, bad beams, and random events: errors or finite states, never a panic.

use crate::common::*;
use proptest::prelude::*;

/// Times that do not increase are rejected, and the navigator is unchanged.
#[test]
fn times_that_do_not_increase_are_rejected() {
    let imu = |time_ns| imu(time_ns, 0.0);
    let mut navigator = tight(&Options::default());
    navigator.push(&imu(10), &mut |_| {}).unwrap();
    navigator.push(&imu(20), &mut |_| {}).unwrap();
    let state = navigator.state();
    for bad in [20, 15] {
        assert!(matches!(
            navigator.push(&imu(bad), &mut |_| {}),
            Err(NavError::TimeNotIncreasing { stream: "imu", .. })
        ));
    }
    let depth = |time_ns| {
        Event::from(DepthSample {
            time_ns,
            depth_m: 1.0,
            sd_m: 0.1,
        })
    };
    assert!(
        navigator.push(&depth(19), &mut |_| {}).is_err(),
        "before the filter's time"
    );
    assert_eq!(navigator.state(), state);
    navigator.push(&depth(25), &mut |_| {}).unwrap();
    assert!(navigator.push(&depth(25), &mut |_| {}).is_err(), "twice at one time");
    navigator.push(&imu(30), &mut |_| {}).unwrap();
}

/// The gate per row rejects a bad beam and accepts a good one.
#[test]
fn gate_per_row_rejects_the_bad_beam() {
    let options = Options {
        gate: Gate::PerRow,
        robust: None,
        ..Options::default()
    };
    let mut navigator = tight(&options);
    navigator.push(&imu(1, 0.0), &mut |_| {}).unwrap();
    let mut velocity_mps = [0.0; MAX_BEAMS];
    velocity_mps[1] = 5.0;
    let ping = BeamSample {
        time_ns: 1,
        velocity_mps,
        sd_mps: [0.042; MAX_BEAMS],
        valid: BeamMask::all(2),
    };
    let mut verdicts = vec![];
    navigator
        .push(&Event::Beams(ping), &mut |report| verdicts.push(report.verdict))
        .unwrap();
    assert_eq!(
        verdicts,
        vec![bottomlock::filter::report::Verdict::AcceptedInPart { rejected_rows: 2 }]
    );
    assert!(navigator.state().velocity_p_mps.0.norm() < 0.01);
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![6 => -10.0_f64..10.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(0.0), 1 => Just(1e300), 1 => Just(-1e-300)]
}

fn event() -> impl Strategy<Value = Event> {
    (0_usize..7, -1_i64..400, prop::array::uniform9(number()), 0_usize..256).prop_map(|(kind, tenth, x, bits)| {
        let time_ns = tenth * 10_000_000;
        let (a, b) = ([x[0], x[1], x[2]], [x[3], x[4], x[5]]);
        match kind {
            0 | 1 => Event::Imu(ImuSample {
                time_ns,
                rate_p_radps: Vec3::from_array(a),
                force_p_mps2: Vec3::from_array(b),
            }),
            2 => Event::Beams(BeamSample {
                time_ns,
                velocity_mps: [x[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0],
                sd_mps: [x[4]; MAX_BEAMS],
                valid: (0..MAX_BEAMS).filter(|k| bits & (1 << k) != 0).collect(),
            }),
            3 => Event::from(DepthSample {
                time_ns,
                depth_m: x[0],
                sd_m: x[1],
            }),
            4 => Event::from(VelocitySample {
                time_ns,
                velocity_p_mps: Vec3::from_array(a),
                cov_m2ps2: Matrix3::from_diagonal(&b.into()),
            }),
            5 => Event::from(GpsSample {
                time_ns,
                position_t_m: Vec3::from_array(a),
                position_sd_m: b,
                velocity: Some(GpsVelocity {
                    velocity_t_mps: Vec3::from_array(a),
                    sd_mps: b,
                }),
            }),
            _ if bits % 2 == 0 => Event::from(HeadingSample {
                time_ns,
                yaw_rad: x[0],
                sd_rad: x[1],
            }),
            _ => Event::from(AttitudeSample {
                time_ns,
                attitude_t_p: Rot::from_quaternion_wxyz([x[0], x[1], x[2], x[3]]),
                roll_pitch_sd_rad: x[4],
                yaw_sd_rad: x[5],
            }),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]

    /// Any sequence of events gives a finite state or an error, and never a panic.
    #[test]
    fn hostile_input_never_panics(events in prop::collection::vec(event(), 1..40), index in 0_usize..METHODS.len(), slow in any::<bool>()) {
        let options = Options { covariance_period_ns: if slow { 100_000_000 } else { 0 }, ..Options::default() };
        let mut navigator = Navigator::new(NavState::at_rest(0), janus(), METHODS[index].aiding, &Model::table_2(), &options).unwrap();
        for event in &events {
            let failed = navigator.push(event, &mut |_| {}).is_err();
            let finite = navigator.state().validate().is_ok();
            prop_assert!(finite || failed, "NaN without an error");
            if !finite {
                break;
            }
        }
    }

    /// After any sequence of valid updates P is symmetric, bit for bit, with a positive diagonal.
    #[test]
    fn covariance_stays_symmetric(masks in prop::collection::vec(0_usize..16, 1..30), index in 0_usize..METHODS.len()) {
        let mut navigator = Navigator::new(NavState::at_rest(0), janus(), METHODS[index].aiding, &Model::table_2(), &Options::default()).unwrap();
        for (k, mask) in masks.iter().enumerate() {
            let time_ns = (k as i64 + 1) * 100_000_000;
            let imu = ImuSample { time_ns, rate_p_radps: Vec3::new(0.01, 0.0, 0.05), force_p_mps2: Vec3::new(0.0, 0.1, -9.8) };
            navigator.push(&Event::Imu(imu), &mut |_| {}).unwrap();
            let valid = (0..4).filter(|b| mask & (1 << b) != 0).collect();
            let ping = BeamSample { time_ns, velocity_mps: [0.01; MAX_BEAMS], sd_mps: [0.042; MAX_BEAMS], valid };
            navigator.push(&Event::Beams(ping), &mut |_| {}).unwrap();
            let p: Covariance = navigator.covariance();
            prop_assert_eq!(p, p.transpose());
            prop_assert!((0..DIM).all(|i| p[(i, i)] > 0.0));
        }
    }
}
