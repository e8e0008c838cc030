use super::*;
use crate::navigator::{LiveNavigator, Notice};
use crate::testing::*;

const MS: i64 = 1_000_000;

fn reading(time_ns: i64) -> ImuSample {
    imu(time_ns, [0.0, 0.0, 0.01], [0.0, 0.0, -9.8])
}

fn depth_of(time_ns: i64, depth_m: f64) -> Event {
    Event::from(DepthSample {
        time_ns,
        depth_m,
        sd_m: 1.0,
    })
}

fn depth(time_ns: i64) -> Event {
    depth_of(time_ns, 0.5)
}

fn navigator(options: &Options, horizon_ns: i64) -> LiveNavigator {
    let geometry = BeamGeometry::janus(Janus::X, 0.5).unwrap();
    let aiding = Method::named("ins").unwrap().aiding;
    LiveNavigator::new(
        NavState::at_rest(0),
        &geometry,
        aiding,
        &Model::table_2(),
        options,
        horizon_ns,
    )
    .unwrap()
}

fn notices(navigator: &mut LiveNavigator, event: &Event) -> Vec<Notice> {
    let mut all = Vec::new();
    navigator.push(event, &mut |notice| all.push(notice.clone())).unwrap();
    all
}

/// Wherever the newest reading lies between two checkpoints, the horizon ends to the nanosecond where it should, and what
/// no event can reach is forgotten.
#[test]
fn the_horizon_is_whole_and_the_rest_forgotten() {
    let horizon_ns = 300 * MS;
    let mut navigator = navigator(&Options::default(), horizon_ns);
    for k in 0..=150 {
        let now_ns = k * 10 * MS;
        notices(&mut navigator, &Event::Imu(reading(now_ns)));
        notices(&mut navigator, &depth(now_ns));
        if now_ns > horizon_ns {
            let mut other = navigator.clone();
            assert!(
                other.push(&depth(now_ns - horizon_ns - 1), &mut |_| {}).is_err(),
                "{now_ns}"
            );
            // Its bytes come before those of the depth there.
            let edge = depth_of(now_ns - horizon_ns, 0.0);
            assert_eq!(other.push(&edge, &mut |_| {}), Ok(()), "{now_ns}");
        }
        let history = &navigator.history;
        let oldest = history.checkpoints[0].good_ns();
        assert!(
            history.events.iter().all(|event| Some(event.time_ns()) > oldest),
            "{now_ns}"
        );
        assert!(history.findings.keys().all(|key| Some(key.0) > oldest), "{now_ns}");
        assert!(
            history.checkpoints.len() as i64 <= 2 + horizon_ns / CHECKPOINT_NS,
            "{now_ns}"
        );
    }
}

/// After a replay the checkpoints are where those of an ordered log are, and nowhere else.
#[test]
fn checkpoints_keep_to_their_grid() {
    let (mut late, mut ordered) = (
        navigator(&Options::default(), 2_000 * MS),
        navigator(&Options::default(), 2_000 * MS),
    );
    for k in 0..=110 {
        let now_ns = k * 10 * MS;
        if now_ns == 350 * MS {
            notices(&mut ordered, &depth(now_ns - 5 * MS));
        }
        notices(&mut late, &Event::Imu(reading(now_ns)));
        notices(&mut ordered, &Event::Imu(reading(now_ns)));
    }
    notices(&mut late, &depth(345 * MS));
    let times = |navigator: &LiveNavigator| -> Vec<i64> {
        navigator
            .history
            .checkpoints
            .iter()
            .map(|checkpoint| checkpoint.now_ns())
            .collect()
    };
    assert_eq!(times(&late), [0, 200, 400, 600, 800, 1_000].map(|ms| ms * MS));
    assert_eq!(times(&late), times(&ordered));
    assert_eq!(late.history.due_ns, ordered.history.due_ns);
    for (one, other) in late.history.checkpoints.iter().zip(&ordered.history.checkpoints) {
        assert_eq!(format!("{one:?}"), format!("{other:?}"));
    }
}

/// A measurement a nanosecond after the last reading is not passed over.
#[test]
fn what_waits_since_a_nanosecond_is_fused() {
    let mut navigator = navigator(&Options::default(), 1_000 * MS);
    for k in 0..=150 {
        notices(&mut navigator, &Event::Imu(reading(k * 10 * MS)));
    }
    assert!(notices(&mut navigator, &depth(1_500 * MS + 1)).is_empty());
    assert_eq!(notices(&mut navigator, &Event::Imu(reading(1_510 * MS))).len(), 1);
}

/// A measurement may lie an hour ahead.
#[test]
fn an_hour_ahead_is_the_most() {
    let mut navigator = navigator(&Options::default(), 0);
    notices(&mut navigator, &Event::Imu(reading(0)));
    let hour_ns = 3_600_000 * MS;
    assert!(matches!(
        navigator.push(&depth(hour_ns + 1), &mut |_| {}),
        Err(NavError::TooFarAhead { .. })
    ));
    assert!(notices(&mut navigator, &depth(hour_ns)).is_empty());
}
