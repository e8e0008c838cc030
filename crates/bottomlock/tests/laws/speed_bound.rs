//! The bound on the speed: it acts beyond the linear range alone, and on nothing where it is off.

use crate::common::*;
use bottomlock::aiding::speed_bound::SpeedBound;
use bottomlock::filter::report::{Sensor, UpdateReport};
use bottomlock::layout::VELOCITY;

/// A straight run on one beam, pings `late_ns` after an inertial reading; the reports, and the velocity's largest variance
/// at the end.
fn straight(sd_mps: f64, late_ns: i64) -> (Vec<UpdateReport>, f64) {
    let (turn, epochs) = (Turn::new(150, 0.001), Epochs::new(150));
    let options = Options {
        speed_bound: SpeedBound { sd_mps, time_s: 60.0 },
        ..Options::default()
    };
    let streams = draw(&turn, &epochs.schedule(), 3, 0, 0).unwrap();
    let model = Model::table_2();
    let mut navigator = Navigator::new(streams.initial, janus(), BeamAiding::Tight, &model, &options).unwrap();
    let mut reports = Vec::new();
    let mut pings = streams.pings.iter().peekable();
    for imu in &streams.imu {
        navigator
            .push(&Event::Imu(*imu), &mut |report| reports.push(*report))
            .unwrap();
        while let Some(ping) = pings.next_if(|ping| ping.time_ns <= imu.time_ns) {
            let mut ping = *ping;
            ping.valid = BeamMask::all(1);
            ping.time_ns = imu.time_ns + late_ns;
            navigator
                .push(&Event::Beams(ping), &mut |report| reports.push(*report))
                .unwrap();
        }
    }
    let p = navigator.covariance();
    let largest = (VELOCITY..VELOCITY + 3).map(|k| p[(k, k)]).fold(0.0, f64::max);
    (reports, largest)
}

/// Without the bound the velocity grows without limit and no report is its own; with it, it acts only beyond the linear
/// range, and the velocity stays known to a few times σ.
#[test]
fn the_bound_acts_beyond_the_linear_range_alone() {
    let (free, wide) = straight(0.0, 0);
    assert!(free.iter().all(|report| report.sensor != Sensor::Speed));
    assert!(wide > 4.0 * 9.0, "{wide}");
    let (bounded, narrow) = straight(3.0, 0);
    let own: Vec<_> = bounded.iter().filter(|report| report.sensor == Sensor::Speed).collect();
    assert!(!own.is_empty() && own.iter().all(|report| report.is_beyond_linear_range));
    let pings = bounded.iter().filter(|report| report.sensor == Sensor::Beams).count();
    assert!(own.len() < pings, "{} of {pings}", own.len());
    assert!(narrow < 16.0, "{narrow}");
}

/// A ping between two inertial readings waits for the later one; its bound is that of a ping at a reading.
#[test]
fn a_ping_between_readings_is_bounded_as_well() {
    let ((at, _), (between, narrow)) = (straight(3.0, 0), straight(3.0, 1_000_000));
    let bounds = |reports: &[UpdateReport]| reports.iter().filter(|report| report.sensor == Sensor::Speed).count();
    assert!(bounds(&between).abs_diff(bounds(&at)) <= 1);
    assert!(narrow < 16.0, "{narrow}");
}
