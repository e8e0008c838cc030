//! Which rejected beams may show an error of the filter.

use super::*;
use crate::testing::*;

fn at_rest() -> Navigator {
    let geometry = BeamGeometry::janus(Janus::X, 0.35).unwrap();
    let (start, model, options) = (NavState::at_rest(0), Model::table_2(), Options::default());
    Navigator::new(start, geometry, BeamAiding::Tight, &model, &options).unwrap()
}

fn beams<const N: usize>(indices: [usize; N]) -> BeamMask {
    indices.into_iter().collect()
}

/// Beams that have been accepted may show five sigma; any error where one of them has not, and where four of a
/// Janus, of which one is redundant, all disagree with the filter. What screening leaves agrees with it.
#[test]
fn beams_that_have_been_accepted_count_to_five_sigma() {
    let mut navigator = at_rest();
    let mut admissible = |confirmed: BeamMask, ping: BeamMask, left: BeamMask| {
        navigator.confirmed = confirmed;
        navigator.is_confirmed(ping, left)
    };
    let (any, five_sigma) = (false, true);
    let (none, pair, three, four) = (BeamMask::NONE, beams([0, 1]), beams([0, 1, 2]), BeamMask::all(4));
    for ping in [pair, three, four] {
        for left in [none, beams([0]), ping] {
            assert_eq!(admissible(none, ping, left), any, "never accepted");
            assert_eq!(admissible(beams([0, 2, 3]), ping, left), any, "beam 2 never accepted");
        }
    }
    for ping in [pair, three] {
        for left in [none, beams([0]), ping] {
            assert_eq!(admissible(four, ping, left), five_sigma, "no beam is redundant");
        }
    }
    assert_eq!(
        admissible(four, four, pair),
        five_sigma,
        "two beams agree with the filter"
    );
    assert_eq!(
        admissible(four, four, none),
        any,
        "each beam alone contradicts the filter"
    );
    assert_eq!(
        admissible(four, four, four),
        any,
        "the beams together contradict the filter"
    );
}

/// At rest, a ping a second: the beams of accepted pings are confirmed, and one that is rejected is not.
#[test]
fn accepted_beams_are_confirmed() {
    let mut navigator = at_rest();
    let sample = |time_ns: i64| {
        Event::Imu(imu(
            time_ns,
            [0.0; 3],
            [0.0, 0.0, -Model::table_2().environment.gravity_mps2],
        ))
    };
    navigator.push(&sample(0), &mut |_: &UpdateReport| ()).unwrap();
    let mut confirmed = Vec::new();
    for (second, beam_4_mps) in [(1, 3.0), (2, 0.0)] {
        let mut ping = ping_of(second * 1_000_000_000, [0.0; MAX_BEAMS], 0.04, BeamMask::all(4));
        ping.velocity_mps[3] = beam_4_mps;
        navigator.push(&Event::Beams(ping), &mut |_: &UpdateReport| ()).unwrap();
        navigator
            .push(&sample(second * 1_000_000_000), &mut |_: &UpdateReport| ())
            .unwrap();
        confirmed.push(navigator.confirmed);
    }
    assert_eq!(confirmed, [beams([0, 1, 2]), BeamMask::all(4)]);
}

/// A lasting mean of the innovations of other methods may be their assumption's.
#[test]
fn methods_that_assume_nothing_are_tested_for_errors_that_last() {
    let without = |exact: bool| -> Vec<_> {
        let assumes_nothing = |aiding| {
            let mut navigator = at_rest();
            navigator.aiding = aiding;
            navigator.options.assumptions.exact_virtual_beams = exact;
            navigator.assumes_nothing()
        };
        let methods = METHODS.iter().filter(|method| assumes_nothing(method.aiding));
        methods.map(|method| method.name).collect()
    };
    assert_eq!(without(false), ["lc", "tc", "info", "sway_current"]);
    assert_eq!(without(true), ["lc", "tc", "vb", "info", "sway_current"]);
}

/// Accelerometers that are 0.05 m/s² off from the tenth second on, pings at 5 Hz, a depth a second: at a ping it is charged, by a
/// method that assumes nothing, and never at a depth.
#[test]
fn an_error_that_lasts_is_charged_at_pings() {
    for (name, is_charged) in [("tc", true), ("lc", true), ("nsv", false)] {
        let mut navigator = at_rest();
        navigator.aiding = Method::named(name).unwrap().aiding;
        let gravity_mps2 = Model::table_2().environment.gravity_mps2;
        let (mut rejections, mut charged) = (0, Vec::new());
        for k in 0..800_i64 {
            let time_ns = k * 50_000_000;
            let force = [if k < 200 { 0.0 } else { 0.05 }, 0.0, -gravity_mps2];
            let reading = imu(time_ns, [0.0; 3], force);
            let ping = ping_of(time_ns, [0.0; MAX_BEAMS], 0.04, BeamMask::all(4));
            let depth = DepthSample {
                time_ns,
                depth_m: 0.0,
                sd_m: 1.0,
            };
            let mut events = vec![Event::Imu(reading)];
            events.extend((k % 4 == 0).then_some(Event::Beams(ping)));
            events.extend((k % 20 == 0).then_some(Event::from(depth)));
            for event in events {
                let mut note = |report: &UpdateReport| {
                    rejections += usize::from(report.verdict == Verdict::Rejected);
                    charged.extend(report.inflation.map(|_| report.sensor));
                };
                navigator.push(&event, &mut note).unwrap();
            }
        }
        assert_eq!(rejections, 0, "{name}");
        assert_eq!(!charged.is_empty(), is_charged, "{name}: {charged:?}");
        assert!(charged.iter().all(|&sensor| sensor == Sensor::Beams), "{charged:?}");
    }
}
