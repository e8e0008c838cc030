//! Late data: what a push tells, what is refused, and what stays as it was.

use bottomlock::filter::report::Verdict;
use bottomlock::navigator::{Snapshot, Standing};

use crate::common::arrivals::{MS, Reported, outcome};
use crate::common::*;

fn depth(time_ns: i64, depth_m: f64) -> Event {
    Event::from(DepthSample {
        time_ns,
        depth_m,
        sd_m: 1.0,
    })
}

/// A navigator that has taken a reading every 10 ms for a while.
fn under_way(method: &str, options: &Options, horizon_ns: i64, seconds: i64) -> LiveNavigator {
    let (start, aiding, model) = (
        NavState::at_rest(0),
        Method::named(method).unwrap().aiding,
        Model::table_2(),
    );
    let mut navigator = LiveNavigator::new(start, &janus(), aiding, &model, options, horizon_ns).unwrap();
    for k in 0..=100 * seconds {
        navigator.push(&imu(k * 10 * MS, 0.0), &mut |_| {}).unwrap();
    }
    navigator
}

fn notices(navigator: &mut LiveNavigator, event: &Event) -> Vec<Notice> {
    let mut all = Vec::new();
    navigator.push(event, &mut |notice| all.push(notice.clone())).unwrap();
    all
}

/// One nanosecond decides; what is refused is counted and changes nothing, and the words say by how much it is late.
#[test]
fn beyond_the_horizon_is_refused_and_counted() {
    let mut navigator = under_way("tc", &Options::default(), 500 * MS, 3);
    let before = outcome(&navigator);
    let error = navigator
        .push(&depth(2_500 * MS - 1, 0.5), &mut |_| {})
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "depth time 2499999999 ns lies 0.500000 s behind the navigator at 3000000000 ns, expected at most 0.5 s, horizon_ns: \
         allow for the latency by a longer horizon (up to 10 s), and count all times on one clock"
    );
    assert_eq!(navigator.late_events()[3], 1);
    assert_eq!(before, outcome(&navigator));
    assert_eq!(notices(&mut navigator, &depth(2_500 * MS, 0.5)).len(), 1);
    assert_eq!(navigator.late_events()[3], 1);
    let mut none = under_way("tc", &Options::default(), 0, 1);
    assert!(matches!(
        none.push(&depth(1_000 * MS - 1, 0.5), &mut |_| {}),
        Err(NavError::TooLate { .. })
    ));
    assert!(none.push(&depth(1_000 * MS, 0.5), &mut |_| {}).is_ok());
}

/// Within the horizon, but before the start: nothing was known then.
#[test]
fn before_the_start_is_refused() {
    let mut navigator = under_way("tc", &Options::default(), 10_000 * MS, 1);
    assert!(matches!(
        navigator.push(&depth(-1, 0.0), &mut |_| {}),
        Err(NavError::TimeNotIncreasing { previous_ns: 0, .. })
    ));
    assert!(navigator.push(&depth(0, 0.0), &mut |_| {}).is_ok());
}

/// A horizon is at most ten seconds, and not negative.
#[test]
fn a_horizon_has_bounds() {
    let model = Model::table_2();
    for (horizon_ns, is_good) in [(0, true), (10_000 * MS, true), (-1, false), (10_000 * MS + 1, false)] {
        let aiding = METHODS[2].aiding;
        let made = LiveNavigator::new(
            NavState::at_rest(0),
            &janus(),
            aiding,
            &model,
            &Options::default(),
            horizon_ns,
        );
        assert_eq!(made.is_ok(), is_good, "{horizon_ns}");
    }
}

/// A late depth changes the reports after it, which come marked; one that changes no number comes not at all.
#[test]
fn reports_that_changed_come_again() {
    let mut navigator = under_way("ins", &Options::default(), 2_000 * MS, 2);
    let reported = notices(&mut navigator, &depth(1_900 * MS, 1.0));
    assert!(matches!(
        &reported[..],
        [Notice {
            standing: Standing::New,
            ..
        }]
    ));
    let reported = notices(&mut navigator, &depth(1_400 * MS, 2.0));
    let seen: Vec<_> = reported.iter().map(|notice| (notice.standing, times(notice))).collect();
    assert_eq!(seen, [(Standing::New, 1_400 * MS), (Standing::Revised, 1_900 * MS)]);
    // Later than every other: nothing else changes.
    assert_eq!(notices(&mut navigator, &depth(1_950 * MS, 2.0)).len(), 1);
}

fn times(notice: &Notice) -> i64 {
    match &notice.finding {
        Finding::Update(report) => report.time_ns,
        Finding::Rejected { time_ns, .. } => *time_ns,
    }
}

/// An inertial reading that is not after every other is refused and counted, whatever the horizon; it changes nothing.
#[test]
fn a_late_reading_is_refused_and_counted() {
    let mut navigator = under_way("tc", &Options::default(), 2_000 * MS, 1);
    // A rejected reading counts as the newest, too.
    assert_eq!(notices(&mut navigator, &imu(1_010 * MS, 1e6)).len(), 1);
    let before = outcome(&navigator);
    for (count, time_ns) in [(1, 1_010 * MS), (2, 1_005 * MS), (3, 995 * MS)] {
        let error = navigator.push(&imu(time_ns, 0.5), &mut |_| {}).unwrap_err();
        assert!(
            matches!(
                error,
                NavError::TimeNotIncreasing {
                    stream: "imu",
                    previous_ns: 1_010_000_000,
                    ..
                }
            ),
            "{error}"
        );
        assert_eq!(navigator.late_events()[0], count);
        assert_eq!(outcome(&navigator), before);
    }
}

/// Of two measurements of a stream at one time the same one counts, whichever came first; the other is counted as late.
#[test]
fn of_two_at_one_time_contents_decide() {
    let fix = |x| {
        Event::from(GpsSample {
            time_ns: 1_000 * MS,
            position_t_m: Vec3::new(x, 0.0, 0.0),
            position_sd_m: [1.0; 3],
            velocity: Some(GpsVelocity {
                velocity_t_mps: Vec3::new(x, 0.0, 0.0),
                sd_mps: [0.1; 3],
            }),
        })
    };
    let pairs = [(depth(1_000 * MS, 0.25), depth(1_000 * MS, 0.5)), (fix(0.5), fix(0.25))];
    for (one, other) in pairs {
        // At the last reading, behind it, and ahead of it.
        for seconds in [1, 2, 0] {
            let ended = [[one, other], [other, one]].map(|order| {
                let mut navigator = under_way("tc", &Options::default(), 2_000 * MS, 0);
                let mut reported = Reported::default();
                for k in 1..=100 * seconds {
                    navigator.push(&imu(k * 10 * MS, 0.0), &mut |_| {}).unwrap();
                }
                let refused = order.map(|event| navigator.push(&event, &mut |notice| reported.note(notice)).is_err());
                assert!(!refused[0]);
                if seconds == 0 {
                    for k in 1..=120 {
                        navigator
                            .push(&imu(k * 10 * MS, 0.0), &mut |notice| reported.note(notice))
                            .unwrap();
                    }
                }
                assert_eq!(navigator.late_events().iter().sum::<u64>(), 1);
                (outcome(&navigator), reported.text(), refused[1])
            });
            assert_eq!(ended[0].0, ended[1].0);
            assert_eq!(ended[0].1, ended[1].1);
            assert_ne!(ended[0].2, ended[1].2, "one of the two orders refuses its second");
        }
    }
    // The very same twice.
    let mut navigator = under_way("tc", &Options::default(), 2_000 * MS, 1);
    navigator.push(&depth(500 * MS, 0.25), &mut |_| {}).unwrap();
    assert!(matches!(
        navigator.push(&depth(500 * MS, 0.25), &mut |_| {}),
        Err(NavError::TimeNotIncreasing {
            time_ns: 500_000_000,
            previous_ns: 500_000_000,
            ..
        })
    ));
}

/// A late push whose replay fails, at once or at a later event, changes nothing, and the same goes on.
#[test]
fn a_late_push_that_fails_changes_nothing() {
    let options = Options {
        gate: Gate::Off,
        ..Options::default()
    };
    for method in ["tc", "sway_current"] {
        let mut navigator = under_way(method, &options, 2_000 * MS, 1);
        navigator.push(&depth(900 * MS, 0.5), &mut |_| {}).unwrap();
        let before = format!("{navigator:?}");
        for bad in [depth(500 * MS, 1e11), depth(500 * MS, 1e300)] {
            let mut reported = 0;
            assert!(navigator.push(&bad, &mut |_| reported += 1).is_err(), "{bad:?}");
            assert!(format!("{navigator:?}") == before && reported == 0, "{bad:?}");
        }
        assert_eq!(notices(&mut navigator, &depth(500 * MS, 0.5)).len(), 2);
    }
}

/// A depth that the gate rejects is accepted in the end, as late ones before it lead the estimate there.
#[test]
fn a_verdict_may_change() {
    let mut navigator = under_way("ins", &Options::default(), 2_000 * MS, 2);
    let verdict = |notice: &Notice| match &notice.finding {
        Finding::Update(report) if times(notice) == 1_900 * MS => Some((notice.standing, report.verdict)),
        _ => None,
    };
    notices(&mut navigator, &depth(500 * MS, 0.0));
    let reported = notices(&mut navigator, &depth(1_900 * MS, 6.0));
    assert_eq!(verdict(&reported[0]), Some((Standing::New, Verdict::Rejected)));
    let mut last = None;
    for (k, depth_m) in [(10, 3.5), (12, 4.0), (14, 4.5)] {
        let reported = notices(&mut navigator, &depth(k * 100 * MS, depth_m));
        last = reported.iter().find_map(verdict).or(last);
    }
    assert_eq!(last, Some((Standing::Revised, Verdict::Accepted)));
}

/// What waits is dropped on request, behind a rejected reading too, and what was fed is not.
#[test]
fn what_waits_can_be_dropped() {
    let mut navigator = under_way("tc", &Options::default(), 2_000 * MS, 1);
    for event in [
        depth(995 * MS, 0.5),
        depth(1_005 * MS, 0.5),
        imu(1_010 * MS, 1e6),
        depth(1_015 * MS, 0.5),
    ] {
        navigator.push(&event, &mut |_| {}).unwrap();
    }
    assert_eq!(navigator.discard_waiting(), 2);
    assert_eq!(navigator.discard_waiting(), 0);
    let reported = notices(&mut navigator, &imu(1_020 * MS, 0.0));
    assert!(reported.is_empty(), "{reported:?}");
    assert_eq!(notices(&mut navigator, &depth(990 * MS, 0.5)).len(), 2);
}

/// A new covariance is not gone back behind.
#[test]
fn a_new_covariance_begins_anew() {
    let mut navigator = under_way("tc", &Options::default(), 2_000 * MS, 1);
    navigator.push(&depth(1_005 * MS, 0.5), &mut |_| {}).unwrap();
    let covariance = navigator.navigator().covariance() * 2.0;
    navigator.set_covariance(&covariance).unwrap();
    assert!(matches!(
        navigator.push(&depth(1_000 * MS, 0.5), &mut |_| {}),
        Err(NavError::TooLate { .. })
    ));
    assert_eq!(notices(&mut navigator, &imu(1_010 * MS, 0.0)).len(), 1);
    assert_eq!(notices(&mut navigator, &depth(1_001 * MS, 0.5)).len(), 2);
}

/// At absurd rates the horizon shrinks, and a reading that never becomes good fills no memory; measurements that wait are
/// refused when they are too many.
#[test]
fn memory_has_bounds() {
    let mut options = Options::default();
    options.imu_limits.gap = LongGap::Inflate;
    let mut navigator = under_way("ins", &options, 10_000 * MS, 1);
    // 20 kHz for five seconds.
    for k in 1..=100_000 {
        navigator.push(&imu(1_000 * MS + k * 50_000, 0.0), &mut |_| {}).unwrap();
    }
    let full = size(&navigator);
    assert!(matches!(
        navigator.push(&depth(2_000 * MS, 0.5), &mut |_| {}),
        Err(NavError::TooLate { .. })
    ));
    assert!(navigator.push(&depth(5_000 * MS, 0.5), &mut |_| {}).is_ok());
    for k in 1..=100_000 {
        navigator.push(&imu(6_000 * MS + k * 50_000, 1e6), &mut |_| {}).unwrap();
    }
    assert!(size(&navigator) <= full + 10_000, "{} after {full}", size(&navigator));
    let refused = (1..=20_000).find_map(|k| navigator.push(&depth(11_000 * MS + k, 0.5), &mut |_| {}).err());
    let words = refused.unwrap().to_string();
    assert!(
        words.contains("measurements that wait is 16384") && words.contains("discard_waiting()"),
        "{words}"
    );
}

/// Length of the saved bytes.
fn size(navigator: &LiveNavigator) -> usize {
    let snapshot = Snapshot {
        live: navigator.clone(),
        sensors: Model::table_2().sensors,
    };
    snapshot.to_bytes().unwrap().len()
}

/// A ping whose beams are all lost, and one with NaN where a beam is lost, are the same, reported twice.
#[test]
fn lost_beams_are_no_change() {
    let ping = |time_ns, beams: std::ops::Range<usize>| {
        Event::Beams(BeamSample {
            time_ns,
            velocity_mps: [f64::NAN; MAX_BEAMS].map(|x: f64| if beams.is_empty() { x } else { 0.0 }),
            sd_mps: [0.042; MAX_BEAMS],
            valid: beams.clone().collect(),
        })
    };
    let mut navigator = under_way("tc", &Options::default(), 2_000 * MS, 1);
    notices(&mut navigator, &ping(400 * MS, 0..3));
    // A ping without beams changes nothing, so it alone is reported.
    let reported = notices(&mut navigator, &ping(300 * MS, 0..0));
    assert!(reported.iter().all(|notice| times(notice) == 300 * MS), "{reported:?}");
}
