//! The Rust candidates of `benches/compare.py`, over the same readings as all others: one line in, one line out.
//!
//! `compare_filters FILE` reads little-endian doubles: the number of steps N and of pings; N + 1 inertial readings (time ns, rate, force);
//! the pings (time ns, four beams); the start (attitude, velocity). A line on the input names a candidate; the answer is its time
//! on a core in nanoseconds, the run-steps that it has done, and the lower triangle of one run's covariance at the end.

// A tool that cannot go on says so and stops.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::cell::Cell;
use std::hint::black_box;
use std::io::BufRead;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use bottomlock::aiding::{beam_terms, tightly_coupled};
use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
use bottomlock::earth::Earth;
use bottomlock::error_model::{Coefficients, CovarianceInterval, FirstOrderInterval, ProcessNoise};
use bottomlock::filter::Eskf;
use bottomlock::filter::filter_group::{FilterSpan, predict_together};
use bottomlock::filter::gate::Gate;
use bottomlock::filter::options::Options;
use bottomlock::filter::report::Sensor;
use bottomlock::frames::{Rot, Vec3};
use bottomlock::mechanisation::{EarthTerms, ImuSample, Inertial, Kinematics};
use bottomlock::model::Model;
use bottomlock::navigator::events::Event;
use bottomlock::navigator::{BeamAiding, Navigator};
use bottomlock::simd::{Lane, Strips};
use bottomlock::state::{Covariance, NavState};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x8};
use nalgebra::SMatrix;

const TENTH_NS: i64 = 100_000_000;
const NOISE_SD_MPS: f64 = 0.042;
const MOST_RUNS: usize = 32;
/// A candidate repeats its work for at least so long.
const LEAST_NS: i128 = 30_000_000;

struct Work {
    imu: Vec<ImuSample>,
    /// A copy for each run of the largest group.
    streams: Vec<Vec<ImuSample>>,
    pings: Vec<BeamSample>,
    start: NavState,
    geometry: BeamGeometry,
    model: Model,
}

impl Work {
    fn read(path: &str) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let mut numbers = bytes
            .chunks_exact(8)
            .map(|eight| f64::from_le_bytes(eight.try_into().unwrap()));
        let mut next = || numbers.next().unwrap();
        let (steps, pings) = (next() as usize, next() as usize);
        let mut imu = Vec::new();
        for _ in 0..=steps {
            imu.push(ImuSample {
                time_ns: next() as i64,
                rate_p_radps: Vec3::new(next(), next(), next()),
                force_p_mps2: Vec3::new(next(), next(), next()),
            });
        }
        let ping = |_| BeamSample {
            time_ns: next() as i64,
            velocity_mps: std::array::from_fn(|beam| if beam < 4 { next() } else { f64::NAN }),
            sd_mps: [NOISE_SD_MPS; MAX_BEAMS],
            valid: BeamMask::all(4),
        };
        let pings = (0..pings).map(ping).collect();
        let mut start = NavState::at_rest(imu[0].time_ns);
        start.attitude_t_p = Rot::from_quaternion_wxyz([next(), next(), next(), next()]);
        start.velocity_p_mps = Vec3::new(next(), next(), next());
        Self {
            streams: vec![imu.clone(); MOST_RUNS],
            imu,
            pings,
            start,
            geometry: BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap(),
            model: Model::table_2(),
        }
    }

    fn options(period_ns: i64) -> Options {
        Options {
            gate: Gate::Off,
            robust: None,
            covariance_period_ns: period_ns,
            ..Options::default()
        }
    }

    /// Runs a candidate.
    fn run(&self, candidate: &str, runs: usize) -> Covariance {
        match candidate {
            "one" => self.one(0),
            "one_10hz" => self.one(TENTH_NS),
            "alone" => self.many(1, 0, &self.streams[..1]),
            "alone_10hz" => self.many(1, TENTH_NS, &self.streams[..1]),
            "methods" => self.many(runs, 0, &self.streams[..1]),
            "methods_10hz" => self.many(runs, TENTH_NS, &self.streams[..1]),
            "many" => self.many(runs, 0, &self.streams[..runs]),
            "many_10hz" => self.many(runs, TENTH_NS, &self.streams[..runs]),
            "dense" => self.dense(),
            _ => panic!("compare_filters: no filter of the name {candidate:?}"),
        }
    }

    /// One run, event by event as in live use.
    fn one(&self, period_ns: i64) -> Covariance {
        let options = Self::options(period_ns);
        let geometry = self.geometry.clone();
        let mut navigator = Navigator::new(self.start, geometry, BeamAiding::Tight, &self.model, &options).unwrap();
        let mut pings = self.pings.iter().peekable();
        for sample in &self.imu {
            navigator.push(&Event::Imu(*sample), &mut |_| {}).unwrap();
            if let Some(ping) = pings.next_if(|ping| ping.time_ns == sample.time_ns) {
                navigator.push(&Event::Beams(*ping), &mut |_| {}).unwrap();
            }
        }
        navigator.covariance()
    }

    /// Many filters side by side, or one alone, led from ping to ping; `streams` are the readings of each, or of all.
    fn many(&self, runs: usize, period_ns: i64, streams: &[Vec<ImuSample>]) -> Covariance {
        let one = Eskf::new(self.start, &self.model, &Self::options(period_ns)).unwrap();
        let mut filters = vec![one; runs];
        let mut from = 0;
        for ping in &self.pings {
            let to = from
                + self.imu[from..]
                    .iter()
                    .position(|sample| sample.time_ns == ping.time_ns)
                    .unwrap();
            self.lead(&mut filters, streams, from, to);
            for filter in &mut filters {
                let innovation =
                    filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &self.geometry, ping), ping));
                filter.update(&innovation, Sensor::Beams).unwrap();
            }
            from = to;
        }
        self.lead(&mut filters, streams, from, self.imu.len() - 1);
        filters[runs - 1].covariance()
    }

    fn lead(&self, filters: &mut [Eskf], streams: &[Vec<ImuSample>], from: usize, to: usize) {
        let pairs = filters.iter_mut().zip(streams.iter().cycle());
        let mut spans: Vec<_> = pairs
            .map(|(filter, stream)| FilterSpan::new(filter, &stream[from..=to]))
            .collect();
        predict_together(&mut spans);
        assert!(spans.iter().all(|span| span.failure.is_none()));
    }

    /// The same filter as textbooks write it, with nalgebra's dense matrices.
    fn dense(&self) -> Covariance {
        type Dense = SMatrix<f64, 20, 20>;
        let earth = EarthTerms::from(&self.model.environment);
        let noise: ProcessNoise = self.model.process_noise(true);
        let mut walks = Dense::zeros();
        for k in 0..3 {
            walks[(9 + k, 9 + k)] = noise.accel_bias;
            walks[(12 + k, 12 + k)] = noise.gyro_bias;
        }
        (15..19).for_each(|k| walks[(k, k)] = noise.dvl_bias);
        walks[(19, 19)] = noise.dvl_scale;
        let mut p = self.model.initial_covariance(true);
        let mut state = self.start;
        let mut kinematics = state.kinematics();
        let mut pings = self.pings.iter().peekable();
        let less_bias = |sample: &ImuSample, state: &NavState| Inertial {
            rate_p_radps: (sample.rate_p_radps - state.gyro_bias_p_radps).to_array(),
            force_p_mps2: (sample.force_p_mps2 - state.accel_bias_p_mps2).to_array(),
        };
        for step in self.imu.windows(2) {
            let dt_s = (step[1].time_ns - step[0].time_ns) as f64 * 1e-9;
            let (first, last) = (less_bias(&step[0], &state), less_bias(&step[1], &state));
            let before = Coefficients::at(&kinematics, &first, &earth);
            kinematics.step(&first, &last, dt_s, &earth);
            let after = Coefficients::at(&kinematics, &last, &earth);
            let (f0, f1) = (before.dense(&earth), after.dense(&earth));
            let mean = Dense::from_fn(|i, j| 0.5 * (f0[i][j] + f1[i][j]));
            let phi = Dense::identity() + mean * dt_s;
            // G stands in F: the columns of the accelerometers' and the gyros' biases, but for the sign.
            let (accel, gyro) = (mean.fixed_columns::<3>(9), mean.fixed_columns::<3>(12));
            let mut density = accel * accel.transpose() * noise.accel + gyro * gyro.transpose() * noise.gyro + walks;
            // R Q Rᵀ is Q for isotropic noise, also where R is the mean of two rotations.
            density
                .fixed_view_mut::<3, 3>(3, 3)
                .copy_from(&(SMatrix::<f64, 3, 3>::identity() * noise.gyro));
            let half = density * (0.5 * dt_s);
            p = phi * (p + half) * phi.transpose() + half;
            let Some(ping) = pings.next_if(|ping| ping.time_ns == step[1].time_ns) else {
                continue;
            };
            state.time_ns = ping.time_ns;
            state.position_t_m = Vec3::from_array(kinematics.position_t_m);
            state.attitude_t_p = Rot::from_quaternion_wxyz(kinematics.attitude_t_p);
            state.velocity_p_mps = Vec3::from_array(kinematics.velocity_p_mps);
            self.dense_update(&mut p, &mut state, ping);
            kinematics = state.kinematics();
        }
        p
    }

    /// The update of the dense filter by the four beams of a ping, in Joseph's form.
    fn dense_update(&self, p: &mut Covariance, state: &mut NavState, ping: &BeamSample) {
        let mut h = SMatrix::<f64, 4, 20>::zeros();
        let mut z = SMatrix::<f64, 4, 1>::zeros();
        for beam in 0..4 {
            let direction = self.geometry.direction_p(beam);
            let along = direction.dot(&state.velocity_p_mps.0);
            (0..3).for_each(|k| h[(beam, 6 + k)] = direction[k] * (1.0 + state.dvl_scale_factor));
            h[(beam, 15 + beam)] = 1.0;
            h[(beam, 19)] = along;
            let expected = along * (1.0 + state.dvl_scale_factor) + state.dvl_bias_mps[beam];
            z[beam] = ping.velocity_mps[beam] - expected;
        }
        let r = SMatrix::<f64, 4, 4>::identity() * NOISE_SD_MPS.powi(2);
        let s = h * *p * h.transpose() + r;
        let gain = *p * h.transpose() * s.try_inverse().unwrap();
        let left = Covariance::identity() - gain * h;
        *p = left * *p * left.transpose() + gain * r * gain.transpose();
        state.inject(&(gain * z));
    }
}

/// A number that counts the additions, multiplications, divisions and roots that it goes through.
#[derive(Clone, Copy)]
struct Counted(f64);

thread_local! {
    static OPERATIONS: Cell<u64> = const { Cell::new(0) };
}

fn counted(value: f64) -> Counted {
    OPERATIONS.set(OPERATIONS.get() + 1);
    Counted(value)
}

macro_rules! counted {
    ($($operator:ident $function:ident $symbol:tt;)*) => {$(
        impl $operator for Counted {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                counted(self.0 $symbol other.0)
            }
        }
    )*};
}

counted! { Add add +; Sub sub -; Mul mul *; }

impl AddAssign for Counted {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Counted {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Lane for Counted {
    fn splat(self, value: f64) -> Self {
        Self(value)
    }
    fn sqrt(self) -> Self {
        counted(self.0.sqrt())
    }
    fn recip(self) -> Self {
        counted(self.0.recip())
    }
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
    fn any_above(self, limit: f64) -> bool {
        self.0 > limit
    }
    fn all_finite(self) -> bool {
        self.0.is_finite()
    }
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        Self(function(self.0))
    }
    fn each(self, value: impl Fn(usize) -> f64) -> Self {
        Self(value(0))
    }
}

impl<S: Simd> Strips<S> for Counted {
    type Wide = Self;
    type Rest = Self;
}

/// Floating-point operations of one step with its covariance, first order.
fn operations_of_a_step(work: &Work) -> u64 {
    let earth = Earth::from(&work.model.environment).terms([Counted(0.0); 3]);
    let noise = work.model.process_noise(true);
    let (start, reading) = (work.start.kinematics(), &work.imu[0]);
    let mut kinematics = Kinematics {
        position_t_m: start.position_t_m.map(Counted),
        attitude_t_p: start.attitude_t_p.map(Counted),
        rotation_t_p: start.rotation_t_p.map(|row| row.map(Counted)),
        velocity_p_mps: start.velocity_p_mps.map(Counted),
        velocity_t_mps: start.velocity_t_mps.map(Counted),
    };
    let inertial = Inertial {
        rate_p_radps: reading.rate_p_radps.to_array().map(Counted),
        force_p_mps2: reading.force_p_mps2.to_array().map(Counted),
    };
    let covariance = work.model.initial_covariance(true);
    let mut p = covariance.data.0.map(|column| column.map(Counted));
    let mut interval = FirstOrderInterval::begin(&kinematics, &earth);
    OPERATIONS.set(0);
    let before = kinematics;
    kinematics.step(&inertial, &inertial, 1.0 / 150.0, &earth);
    interval.extend(&before, &kinematics, &inertial, &inertial, 1.0 / 150.0, &earth);
    dispatch!(Level::new(), simd => interval.propagate(simd, &mut p, &kinematics, &noise, &earth));
    // The bias taken off six readings.
    OPERATIONS.get() + 6
}

/// Multiply–adds of one core: floating-point operations a second, in vectors as wide as the machine's.
#[inline(always)]
fn multiply_adds<S: Simd>(simd: S, rounds: usize) -> f64 {
    let (factor, term) = (
        f64x8::simd_from(simd, black_box(0.999_999)),
        f64x8::simd_from(simd, black_box(1e-7)),
    );
    let mut sums = [f64x8::simd_from(simd, 1.0); 16];
    for _ in 0..rounds {
        for sum in &mut sums {
            *sum = Lane::mul_add(*sum, factor, term);
        }
    }
    sums.iter().map(|sum| sum.as_slice().iter().sum::<f64>()).sum()
}

/// Time that this thread has had on a core, ns.
#[cfg(unix)]
fn on_core_ns() -> i128 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    i128::from(time.tv_sec) * 1_000_000_000 + i128::from(time.tv_nsec)
}

/// Wall-clock time, ns, on systems without a clock per thread.
#[cfg(not(unix))]
fn on_core_ns() -> i128 {
    use std::time::{SystemTime, UNIX_EPOCH};
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as i128
}

fn main() {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| panic!("compare_filters: name the file with the readings"));
    let work = Work::read(&path);
    let steps = work.imu.len() - 1;
    for line in std::io::stdin().lock().lines() {
        let line = line.unwrap();
        let mut words = line.split_whitespace();
        let candidate = words.next().unwrap_or("");
        let runs: usize = words.next().map_or(1, |word| word.parse().unwrap());
        match candidate {
            "flops" => {
                println!("{}", operations_of_a_step(&work));
                continue;
            }
            "peak" => {
                let (rounds, begin) = (2_000_000, on_core_ns());
                black_box(dispatch!(Level::new(), simd => multiply_adds(simd, rounds)));
                let seconds = (on_core_ns() - begin) as f64 * 1e-9;
                println!("{}", 2.0 * 8.0 * 16.0 * rounds as f64 / seconds);
                continue;
            }
            _ => {}
        }
        // Once unmeasured: a run takes a few milliseconds, and caches and predictions are another candidate's.
        let covariance = work.run(candidate, runs);
        let (begin, mut repeats) = (on_core_ns(), 0);
        while repeats == 0 || on_core_ns() - begin < LEAST_NS {
            black_box(work.run(candidate, runs));
            repeats += 1;
        }
        let nanoseconds = on_core_ns() - begin;
        let lower = (0..20).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let numbers: Vec<_> = lower.map(|(i, j)| format!("{:e}", covariance[(i, j)])).collect();
        println!("{nanoseconds} {} {}", repeats * runs * steps, numbers.join(" "));
    }
}
