//! What the horizon of a live navigator at rest costs, call by call: medians and 99th percentiles, which no mean shows.
//!
//! `cargo bench -p bottomlock-benches --bench late`. Every row is measured in turn with the others, a second of data each, so
//! that the load of the machine falls on all; compare by ratio.

// Helpers outside `#[test]` functions fail loudly too.
#![allow(clippy::unwrap_used)]

use std::hint::black_box;
use std::time::Instant;

use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
use bottomlock::filter::options::Options;
use bottomlock::frames::Vec3;
use bottomlock::mechanisation::ImuSample;
use bottomlock::model::Model;
use bottomlock::navigator::events::{DepthSample, Event};
use bottomlock::navigator::{LiveNavigator, Method, Navigator};
use bottomlock::state::NavState;

const SECOND: i64 = 1_000_000_000;
/// Readings and pings a second.
const RATE: i64 = 150;
const PINGS: i64 = 5;
const SECONDS: i64 = 300;

/// A navigator, how late its pings are (or its depths, with pings in order), and the times of its calls, ns.
struct Flight {
    name: &'static str,
    navigator: LiveNavigator,
    late_ns: i64,
    has_depths: bool,
    readings: Vec<u64>,
    pings: Vec<u64>,
}

impl Flight {
    fn new(name: &'static str, method: &str, horizon_ns: i64, late_ns: i64) -> Self {
        let (geometry, aiding, options) = (janus(), Method::named(method).unwrap().aiding, Options::default());
        let (start, model) = (NavState::at_rest(0), Model::table_2());
        Self {
            name,
            navigator: LiveNavigator::new(start, &geometry, aiding, &model, &options, horizon_ns).unwrap(),
            late_ns,
            has_depths: false,
            readings: Vec::new(),
            pings: Vec::new(),
        }
    }

    fn with_depths(self) -> Self {
        Self {
            has_depths: true,
            ..self
        }
    }

    fn push(&mut self, event: &Event) -> u64 {
        let begin = Instant::now();
        self.navigator
            .push(event, &mut |notice| {
                black_box(notice);
            })
            .unwrap();
        begin.elapsed().as_nanos() as u64
    }

    fn second(&mut self, second: i64) {
        for k in second * RATE..(second + 1) * RATE {
            let time_ns = k * SECOND / RATE;
            let took = self.push(&reading(time_ns));
            self.readings.push(took);
            if k % (RATE / PINGS) == 0 && time_ns >= self.late_ns {
                let late = if self.has_depths {
                    self.push(&ping(time_ns));
                    depth(time_ns - self.late_ns)
                } else {
                    ping(time_ns - self.late_ns)
                };
                let took = self.push(&late);
                self.pings.push(took);
            }
        }
    }
}

fn janus() -> BeamGeometry {
    BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap()
}

fn reading(time_ns: i64) -> Event {
    Event::Imu(ImuSample {
        time_ns,
        rate_p_radps: Vec3::new(0.0, 0.0, 0.0),
        force_p_mps2: Vec3::new(0.0, 0.0, -Model::table_2().environment.gravity_mps2),
    })
}

fn ping(time_ns: i64) -> Event {
    Event::Beams(BeamSample {
        time_ns,
        velocity_mps: [0.01; MAX_BEAMS],
        sd_mps: [0.042; MAX_BEAMS],
        valid: BeamMask::all(4),
    })
}

fn depth(time_ns: i64) -> Event {
    Event::from(DepthSample {
        time_ns,
        depth_m: 0.01,
        sd_m: 0.1,
    })
}

/// Median and 99th percentile without the first tenth, µs.
fn percentiles(times: &[u64]) -> (f64, f64) {
    let mut times = times[times.len() / 10..].to_vec();
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize] as f64 * 1e-3;
    (at(0.5), at(0.99))
}

fn main() {
    for method in ["tc", "sway_current"] {
        let options = Options::default();
        let aiding = Method::named(method).unwrap().aiding;
        let start = NavState::at_rest(0);
        let mut unchecked = Navigator::new(start, janus(), aiding, &Model::table_2(), &options).unwrap();
        let mut alone = Vec::new();
        let mut flights = [
            Flight::new("horizon 0, in order", method, 0, 0),
            Flight::new("horizon 2 s, in order", method, 2 * SECOND, 0),
            Flight::new("horizon 2 s, 0.3 s late", method, 2 * SECOND, 3 * SECOND / 10),
            Flight::new("horizon 2 s, 2 s late", method, 2 * SECOND, 2 * SECOND),
            Flight::new("its depths 2 s late", method, 2 * SECOND, 2 * SECOND).with_depths(),
        ];
        for second in 0..SECONDS {
            for k in second * RATE..(second + 1) * RATE {
                let event = reading(k * SECOND / RATE);
                let begin = Instant::now();
                unchecked.push(&event, &mut |_| {}).unwrap();
                alone.push(begin.elapsed().as_nanos() as u64);
            }
            flights.iter_mut().for_each(|flight| flight.second(second));
        }
        let mean = |times: &[u64]| times.iter().sum::<u64>() as f64 / times.len() as f64 * 1e-3;
        let (p50, p99) = percentiles(&alone);
        println!("{method}: a call, µs: median, 99 %, (mean)");
        println!(
            "  {:24} reading {p50:7.2}{p99:8.2} ({:.2})",
            "no live checks",
            mean(&alone)
        );
        let (in_order, _) = percentiles(&flights[0].pings);
        for flight in &flights {
            let ((p50, p99), (ping, late)) = (percentiles(&flight.readings), percentiles(&flight.pings));
            println!(
                "  {:24} reading {p50:7.2}{p99:8.2} ({:.2})   ping {ping:7.2}{late:8.2}   x{:.1}",
                flight.name,
                mean(&flight.readings),
                ping / in_order
            );
        }
    }
}
