//! The law of late data: any order in which measurements arrive within the horizon ends in the bits of the log in order of validity.

use bottomlock::navigator::Snapshot;
use bottomlock::navigator::events::STREAMS;
use bottomlock::replay::{Log, Replay, replay};
use proptest::prelude::*;

use crate::common::arrivals::{self, Case, MS, Reported, outcome};
use crate::common::*;

/// How many random arrivals: more with `BOTTOMLOCK_LONG` and `BOTTOMLOCK_DEEP`, as `make test-long` and `test-deep` set them.
fn cases() -> u32 {
    let asked = |name| std::env::var_os(name).is_some();
    if asked("BOTTOMLOCK_DEEP") {
        10_000
    } else if asked("BOTTOMLOCK_LONG") {
        1_500
    } else {
        130
    }
}

fn live(case: &Case, horizon_ns: i64) -> LiveNavigator {
    let (start, aiding) = (NavState::at_rest(0), case.method.aiding);
    LiveNavigator::new(start, &janus(), aiding, &case.model, &case.options, horizon_ns).unwrap()
}

fn pushed(navigator: &mut LiveNavigator, events: &[Event], reported: &mut Reported) -> Result<(), NavError> {
    let mut tell = |notice: &Notice| reported.note(notice);
    events.iter().try_for_each(|event| navigator.push(event, &mut tell))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases()))]

    /// The law, against two oracles: the log pushed in order, with no horizon, and the replay of the log.
    #[test]
    fn any_arrival_ends_in_the_bits_of_the_ordered_log(
        seed in any::<u64>(), index in 0..METHODS.len(), horizon_ms in prop_oneof![Just(300_i64), Just(900), Just(2_000), Just(10_000)],
    ) {
        let case = Case::new(seed, &METHODS[index]);
        let (mut ordered, mut reported) = (live(&case, 0), Reported::default());
        pushed(&mut ordered, &case.log, &mut reported).unwrap();

        let (mut shuffled, mut reported_late) = (live(&case, horizon_ms * MS), Reported::default());
        let arrival = case.arrival(seed, horizon_ms * MS);
        let (before, after) = arrival.split_at(arrival.len() / 2);
        pushed(&mut shuffled, before, &mut reported_late).unwrap();
        // Saved and restored half-way, as one that goes on; the other goes on by itself.
        let sensors = case.model.sensors;
        let bytes = Snapshot { live: shuffled.clone(), sensors }.to_bytes().unwrap();
        let mut restored = Snapshot::from_bytes(&bytes).unwrap().live;
        prop_assert_eq!(outcome(&restored), outcome(&shuffled));
        let mut reported_restored = reported_late.clone();
        pushed(&mut shuffled, after, &mut reported_late).unwrap();

        prop_assert_eq!(outcome(&shuffled), outcome(&ordered));
        prop_assert_eq!(reported_late.text(), reported.text());
        prop_assert_eq!(shuffled.late_events(), &[0; STREAMS]);
        // Of many, a quarter: that one goes on costs as much as the law itself.
        if cases() < 1_000 || seed % 4 == 0 {
            pushed(&mut restored, after, &mut reported_restored).unwrap();
            prop_assert_eq!(outcome(&restored), outcome(&ordered));
            prop_assert_eq!(reported_restored.text(), reported.text());
        }

        let last_ns = ordered.navigator().state().time_ns;
        let out = replay(&Replay {
            log: Log { imu: &case.imu, pings: &case.pings, sensors: case.sensors.each_ref().map(Vec::as_slice), water_track: &case.water_track },
            geometry: &janus(),
            model: &case.model,
            options: &case.options,
            start: NavState::at_rest(0),
            covariance: None,
            methods: &[*case.method],
            sample_time_ns: &[last_ns],
            smooth: false,
            covariances: true,
            innovations: false,
            withheld: Default::default(),
        }, 1).unwrap();
        let filtered = &out.tracks[0].filtered;
        prop_assert_eq!(&filtered.states[0], &shuffled.navigator().state());
        prop_assert_eq!(&filtered.covariances[0], &shuffled.navigator().covariance());
        prop_assert_eq!(&out.imu_faults.counts, shuffled.imu_faults());
    }
}

#[test]
fn cases_have_what_they_are_for() {
    arrivals::check_cases();
}
