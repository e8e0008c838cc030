//! A withheld measurement is predicted as the first after an outage, and the filters are those without it.

use crate::replay::tests::Recording;
use crate::replay::{InnovationRecord, Replay, STREAMS, Track};
use crate::testing::*;

const END_NS: i64 = 8_000_000_000;
const DEPTH: usize = 3;

fn track(recording: &Recording, withheld: [&[bool]; STREAMS], method: &Method) -> Track {
    track_with(recording, withheld, method, &Options::default())
}

fn track_with(recording: &Recording, withheld: [&[bool]; STREAMS], method: &Method, options: &Options) -> Track {
    let request = Replay {
        innovations: true,
        withheld,
        methods: &[*method],
        ..recording.replay(options, &[END_NS])
    };
    replay(&request, 1).unwrap().tracks.remove(0)
}

fn of(track: &Track, sensor: Sensor) -> Vec<&InnovationRecord> {
    (track.innovations.iter())
        .filter(|record| record.sensor == sensor)
        .collect()
}

/// With pings 3 to 5 withheld each has the bits of the first ping after an outage from ping 3 on, and the end is that of a
/// log without them.
#[test]
fn a_withheld_ping_is_the_first_after_an_outage() {
    let recording = steady_turn(8);
    let flags: Vec<bool> = (0..recording.pings.len()).map(|k| (3..6).contains(&k)).collect();
    let mut withheld: [&[bool]; STREAMS] = Default::default();
    withheld[1] = &flags;
    for method in METHODS
        .iter()
        .filter(|method| ["tc", "sway_current"].contains(&method.name))
    {
        let all = track(&recording, withheld, method);
        let found = of(&all, Sensor::Beams).into_iter().filter(|record| record.is_withheld);
        assert_eq!(found.clone().count(), 3);
        for (k, record) in (3..6).zip(found.filter(|_| method.name == "tc")) {
            let mut shorter = steady_turn(8);
            shorter.pings = (0..3).chain([k]).map(|ping| recording.pings[ping]).collect();
            let used = track(&shorter, Default::default(), method);
            let first = of(&used, Sensor::Beams)[3].clone();
            let expected = InnovationRecord {
                is_withheld: true,
                ..first
            };
            assert_eq!(*record, expected, "ping {k}");
        }
        let mut without = steady_turn(8);
        without.pings = (0..recording.pings.len())
            .filter(|&k| !flags[k])
            .map(|k| recording.pings[k])
            .collect();
        let without = track(&without, Default::default(), method);
        assert_eq!(all.filtered, without.filtered, "{}", method.name);
    }
}

/// The prediction of a method is that of its estimate: a small slip makes the variance of withheld beams smaller than on the
/// measurements alone, and without weight it leaves it as it is.
#[test]
fn a_method_with_assumptions_predicts_with_them() {
    let recording = steady_turn(8);
    // Beams 1 and 2 leave the sway unobserved.
    let mut lost = steady_turn(8);
    let half: Vec<bool> = (0..recording.pings.len())
        .map(|k| k + 2 > recording.pings.len())
        .collect();
    lost.pings.iter_mut().take(recording.pings.len() - 1).for_each(|ping| {
        ping.valid = [0, 1].into_iter().collect();
    });
    lost.pings.last_mut().unwrap().valid = crate::dvl::geometry::BeamMask::all(4);
    let mut withheld: [&[bool]; STREAMS] = Default::default();
    withheld[1] = &half;
    let variances = |name: &str, slip_sd_mps: f64| {
        let mut options = Options::default();
        options.water.slip_sd_mps = slip_sd_mps;
        options.water.current_sd_mps = if slip_sd_mps > 1.0 { 1e6 } else { 1e-3 };
        let method = METHODS.iter().find(|method| method.name == name).unwrap();
        let all = track_with(&lost, withheld, method, &options);
        let record = of(&all, Sensor::Beams)
            .into_iter()
            .find(|record| record.is_withheld)
            .unwrap()
            .clone();
        assert_eq!(record.rows, 4);
        [record.numbers[14], record.numbers[19]]
    };
    let (alone, assumed, weightless) = (
        variances("tc", 0.01),
        variances("sway_current", 0.01),
        variances("sway_current", 1e6),
    );
    for k in 0..2 {
        assert!(assumed[k] < 0.9 * alone[k], "{assumed:?} {alone:?}");
        assert!(
            (weightless[k] / alone[k] - 1.0).abs() < 1e-6,
            "{weightless:?} {alone:?}"
        );
    }
}

/// A record has the ping's own innovation and the square of its standard deviation; depths are recorded too, and a withheld
/// depth does not correct the filter.
#[test]
fn records_are_those_of_the_updates() {
    let recording = steady_turn(8);
    let tc = METHODS.iter().find(|method| method.name == "tc").unwrap();
    let plain = track(&recording, Default::default(), tc);
    let beams = of(&plain, Sensor::Beams);
    assert_eq!(beams.len(), recording.pings.len());
    for (record, ping) in beams.iter().zip(&plain.pings) {
        let valid: Vec<usize> = (0..4).filter(|&beam| !ping.innovation_mps[beam].is_nan()).collect();
        assert_eq!(valid.len(), record.rows);
        for (row, &beam) in valid.iter().enumerate() {
            assert_eq!(record.numbers[row], ping.innovation_mps[beam]);
            let variance = record.numbers[record.rows * (row + 1) + row];
            assert_eq!(variance.sqrt(), ping.innovation_sd_mps[beam]);
        }
    }
    let depths = recording.sensors[DEPTH - 2].len();
    assert_eq!(of(&plain, Sensor::Depth).len(), depths);
    let flags = vec![true; depths];
    let mut withheld: [&[bool]; STREAMS] = Default::default();
    withheld[DEPTH] = &flags;
    let unaided = track(&recording, withheld, tc);
    let records = of(&unaided, Sensor::Depth);
    assert_eq!(records.len(), depths);
    let sd_m = |record: &InnovationRecord| record.numbers[1].sqrt();
    assert!(records.iter().all(|record| record.is_withheld));
    assert!(sd_m(records[depths - 1]) > 2.0 * sd_m(of(&plain, Sensor::Depth)[depths - 1]));
}

/// Flags that are not one a row are an error that names the stream.
#[test]
fn flags_are_one_a_row() {
    let recording = steady_turn(3);
    let options = Options::default();
    for (stream, name) in [(1, "dvl"), (0, "imu")] {
        let flags = [true; 2];
        let mut withheld: [&[bool]; STREAMS] = Default::default();
        withheld[stream] = &flags;
        let request = Replay {
            withheld,
            ..recording.replay(&options, &[])
        };
        let error = replay(&request, 1).unwrap_err().to_string();
        assert!(error.starts_with("withheld: got 2") && error.contains(name), "{error}");
    }
}
