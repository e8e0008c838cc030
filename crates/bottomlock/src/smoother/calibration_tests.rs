//! The smoother with mounting and clock of the DVL among the states: they are constants, so that what the whole log says of
//! them at its beginning is what the filter says at its end. That holds only if the tape has every gain, Jacobian and
//! covariance of them in its place.

use super::*;
use crate::aiding::calibration::{CALIBRATION, CalibrationVector};
use crate::testing::*;

const OWN: usize = DIM;

fn options() -> Options {
    Options {
        calibration: CalibrationPrior {
            mounting_sd_rad: [2e-3, 3e-3, 4e-3],
            clock_sd_s: 0.05,
        },
        ..Options::default()
    }
}

/// Errors of mounting and clock at the first sample of a tape and their covariance, from the whole of it.
fn smoothed_at_first_sample(tape: Tape) -> (CalibrationVector, DMatrix<f64>) {
    let (mut adjoint, mut first) = (None, None);
    for step in tape.steps.into_iter().rev() {
        first = match (&step, &adjoint) {
            (
                Step::Sample {
                    pending, covariance, ..
                },
                Some(adjoint),
            ) => corrected(covariance, adjoint, pending.clone()),
            _ => first,
        };
        adjoint = Adjoint::before(adjoint, &step);
    }
    let (correction, p) = first.unwrap();
    let own = CalibrationVector::from_fn(|k, _| correction[OWN + k]);
    (own, p.view((OWN, OWN), (CALIBRATION, CALIBRATION)).into_owned())
}

#[test]
fn a_constant_is_the_same_at_every_time() {
    let recording = steady_turn(12);
    let mistaken = (recording.geometry.clone()).mounted(Rot::from_euler_rad(1e-3, -2e-3, 3e-3));
    for name in ["tc", "lc", "info", "sway_current"] {
        let method = Method::named(name).unwrap();
        let mut set = Navigator::new(
            recording.start,
            mistaken.clone(),
            method.aiding,
            &recording.model,
            &options(),
        )
        .unwrap();
        set.filters().begin_tape();
        let mut events: Vec<Event> = (recording.imu.iter().copied().map(Event::Imu))
            .chain(recording.pings.iter().copied().map(Event::Beams))
            .chain(recording.sensors.iter().flatten().copied().map(Event::Aiding))
            .collect();
        events.sort_by_key(Event::time_ns);
        let mut at_first = None;
        for event in &events {
            set.push(event, &mut |_| {}).unwrap();
            if at_first.is_none() && event.time_ns() >= 2_000_000_000 && matches!(event, Event::Imu(_)) {
                set.filters().record_sample();
                at_first = set.filter().calibration();
            }
        }
        let (last, covariance) = set.filter().calibration().unwrap();
        let tape = set.filters().take_tape().unwrap();
        let (correction, p) = smoothed_at_first_sample(tape);
        let (mut smoothed, before) = at_first.unwrap();
        let start = smoothed.numbers();
        smoothed.inject(&correction);
        for k in 0..CALIBRATION {
            let sd = before[(k, k)].sqrt();
            // Rotations compose to second order.
            let gap = (smoothed.numbers()[k] - last.numbers()[k]).abs();
            assert!(gap < 5e-3 * sd, "{name}, {k}: {gap} of {sd}");
            for j in 0..CALIBRATION {
                let size = sd * before[(j, j)].sqrt();
                let gap = (p[(k, j)] - covariance[(k, j)]).abs();
                assert!(gap < 1e-6 * size, "{name}, ({k}, {j}): {gap} of {size}");
            }
        }
        assert!((last.numbers() - start).amax() > 1e-6, "{name}");
        let left: f64 = (0..CALIBRATION).map(|k| covariance[(k, k)] / before[(k, k)]).sum();
        assert!(left < 3.99, "{name}: {left} of 4");
    }
}

/// With the states every method is smoothed: at most the filter's covariance, and its own at the end.
#[test]
fn smoothed_covariance_is_at_most_the_filtered_one() {
    let recording = steady_turn(12);
    let options = options();
    let samples: Vec<i64> = (0..=12).map(|k| k * 1_000_000_000).collect();
    let mut request = recording.replay(&options, &samples);
    let methods = ["tc", "lc", "info", "weak_sway", "sway_current"];
    let methods = methods.map(|name| Method::named(name).unwrap());
    request.methods = &methods;
    request.smooth = true;
    for track in replay(&request, 1).unwrap().tracks {
        assert_eq!(track.calibrations.len(), samples.len());
        for (smoothed, filtered) in track.smoothed.covariances.iter().zip(&track.filtered.covariances) {
            let least = (filtered - smoothed).symmetric_eigenvalues().min();
            assert!(least > -1e-9 * filtered.amax(), "{least}");
            assert!(smoothed.symmetric_eigenvalues().min() > -1e-9 * filtered.amax());
        }
        assert_eq!(track.smoothed.states.last(), track.filtered.states.last());
    }
}
