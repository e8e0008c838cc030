//! Rejected input of the observability analysis, and measurement schedules.

use super::paper::Sensors;
use super::rank::{growing_windows, observe};
use super::tests::{SECOND_NS, Turn, beams, inertial, janus, model, whole};
use super::{Aiding, Epochs, SensorSet, full, paper};
use crate::aiding::registry::{Levers, Sensor, SensorKind};
use crate::error::NavError;
use crate::frames::Vec3;
use crate::simulation::truth::Truth;
use crate::stop::Stop;

/// The message of a refusal.
fn refusal<T>(result: Result<T, NavError>) -> String {
    result.err().map_or_else(String::new, |error| error.to_string())
}

/// Invalid input is rejected with its field, and never panics.
#[test]
fn invalid_input_is_rejected() {
    let turn = Turn::new(0.0, 1.0, 10, 10);
    let (truth, geometry, model) = (turn.truth(), janus(), model());
    let judge = |truth: &Truth<'_>, aiding: &Aiding, period| {
        full::systems(truth, &geometry, &model, &[*aiding], true, Epochs::Every(period))
            .map(|systems| whole(&systems[0]))
    };
    let fifth = Aiding {
        beams: [4].into_iter().collect(),
        ..Aiding::default()
    };
    let long = Turn::new(0.0, 1.0, 600, 10);
    let mut broken = Turn::new(0.0, 1.0, 10, 10);
    broken.velocity[7][1] = f64::NAN;
    for (words, result) in [
        ("aiding sensors", judge(&truth, &Aiding::default(), SECOND_NS)),
        ("beam 5", judge(&truth, &fifth, SECOND_NS)),
        ("epochs of the window: got 1", judge(&truth, &beams(4), 60 * SECOND_NS)),
        ("", judge(&truth, &beams(4), i64::MAX)),
        ("epochs of the window: got 5001", judge(&long.truth(), &beams(4), 1)),
        ("", judge(&truth.slice(0..1), &beams(4), SECOND_NS)),
        ("period_ns", judge(&truth, &beams(4), 0)),
        ("not finite", judge(&broken.truth(), &beams(4), SECOND_NS)),
    ] {
        assert!(result.is_err(), "{words}");
        let text = refusal(result);
        assert!(text.contains(words), "{text} has no {words}");
    }
    assert!(judge(&truth, &beams(4), 1).is_ok(), "every sample, at once");
    let none = Sensors {
        velocity: None,
        depth: false,
    };
    assert!(paper::system(&truth, &model, &none, SECOND_NS).is_err());
    let system = &full::systems(&truth, &geometry, &model, &[beams(4)], true, Epochs::Every(SECOND_NS)).unwrap()[0];
    for (epochs, scale) in [
        (1, None),
        (12, None),
        (11, Some(&[1.0][..])),
        (11, Some(&[-1.0; 20][..])),
    ] {
        assert!(observe(system, epochs, scale).is_err(), "{epochs} {scale:?}");
    }
}

/// Rows that are all zero are rejected, since no rank can be decided from them.
#[test]
fn rows_of_zeros_are_rejected() {
    let mut system = inertial(&Turn::new(0.0, 1.0, 10, 10), &beams(1));
    for epoch in &mut system.epochs {
        epoch.rows.fill(0.0);
    }
    assert!(refusal(observe(&system, 11, None)).starts_with("norm of the stacked rows"));
}

/// A schedule with all sensors at the period equals the period; before the first reading the rank is zero.
#[test]
fn a_schedule_selects_sensors_by_epoch() {
    let turn = Turn::new(0.05, 2.0, 20, 10);
    let (truth, geometry, model) = (turn.truth(), janus(), model());
    let set = Aiding {
        sensors: SensorSet::from_iter([Sensor::Depth]),
        ..beams(4)
    };
    let system_of = |scheduled: &[(i64, Aiding)]| {
        full::systems(&truth, &geometry, &model, &[set], true, Epochs::Scheduled(scheduled))
            .map(|mut all| all.remove(0))
    };
    let always: Vec<(i64, Aiding)> = (0..=20).map(|k| (k * SECOND_NS, set)).collect();
    let periodic = full::systems(&truth, &geometry, &model, &[set], true, Epochs::Every(SECOND_NS)).unwrap();
    assert_eq!(system_of(&always).unwrap(), periodic[0]);
    // Beams alone, from 10 s on: sensors of the set that are not in the schedule give no reading.
    let late: Vec<(i64, Aiding)> = always
        .iter()
        .map(|&(time_ns, _)| {
            let sensors = if time_ns < 10 * SECOND_NS {
                Aiding::default()
            } else {
                beams(4)
            };
            (time_ns, sensors)
        })
        .collect();
    let system = system_of(&late).unwrap();
    let steps = growing_windows(&system, None, &Stop::new()).unwrap();
    assert_eq!(steps.len(), 20);
    assert!(steps[..8].iter().all(|step| step.rank == 0 && step.decided));
    let alone = full::systems(&truth, &geometry, &model, &[beams(4)], true, Epochs::Every(SECOND_NS)).unwrap();
    assert_eq!(steps[19].rank, whole(&alone[0]).rank);
    // No reading, decreasing times, times within one sample, times outside the truth, one epoch, a bad lever arm.
    let empty: Vec<(i64, Aiding)> = (0..5).map(|k| (k * SECOND_NS, Aiding::default())).collect();
    assert!(observe(&system_of(&empty).unwrap(), 5, None).is_err());
    for (words, scheduled) in [
        ("does not come after", &[always[3], always[2]][..]),
        ("does not come after", &[(0, set), (1, set), (2, set)]),
        ("schedule", &[(-1, set), (0, set)]),
        ("got 1", &always[..1]),
    ] {
        let text = refusal(system_of(scheduled));
        assert!(text.contains(words), "{text} has no {words}");
    }
    let invalid = Aiding {
        levers: Levers::default().with(SensorKind::Gps, Vec3::new(0.0, f64::NAN, 0.0)),
        ..set
    };
    assert!(invalid.validate(&geometry).is_err());
    assert!(
        Aiding {
            levers: Levers::default().with(SensorKind::Depth, Vec3::new(1.0, 1.0, 1.0)),
            ..Aiding::default()
        }
        .is_empty()
    );
}
