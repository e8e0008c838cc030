//! What the kernel costs: compare by ratio within one run.
//!
//! `predict/structured` against `predict/dense` is the house's bar (at least 4 times); both work on the same data, first order at
//! every step.

// Helpers outside `#[test]` functions fail loudly too.
#![allow(clippy::unwrap_used)]

use std::hint::black_box;

use bottomlock::aiding::{beam_terms, tightly_coupled};
use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
use bottomlock::dvl::partial::{Assumptions, BeamNoise, PartialMethod, fix_estimator};
use bottomlock::error_model::{Coefficients, Interval, ProcessNoise, dense_noise};
use bottomlock::filter::Eskf;
use bottomlock::filter::filter_group::{FilterSpan, predict_together};
use bottomlock::filter::nees::nees;
use bottomlock::filter::options::Options;
use bottomlock::filter::report::Sensor;
use bottomlock::frames::Vec3;
use bottomlock::layout::{ATTITUDE, DIM};
use bottomlock::mechanisation::{EarthTerms, ImuSample, Inertial, Kinematics};
use bottomlock::model::*;
use bottomlock::navigator::Method;
use bottomlock::simulation::batch::{Batch, run_batch};
use bottomlock::simulation::schedule::Schedule;
use bottomlock::simulation::sensor_errors::RunKey;
use bottomlock::simulation::sensor_streams::simulate;
use bottomlock::simulation::truth::Truth;
use bottomlock::state::{ErrorVector, NavState};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, SMatrix};

type Dense = SMatrix<f64, DIM, DIM>;
const DT: f64 = 1.0 / 150.0;

fn moving() -> (Kinematics<f64>, Inertial<f64>, EarthTerms<f64>, ProcessNoise) {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, -0.03, 0.01);
    let inertial = Inertial {
        rate_p_radps: [0.001, 0.002, 0.05],
        force_p_mps2: [0.01, 0.1, -9.79],
    };
    (
        state.kinematics(),
        inertial,
        EarthTerms::from(&Model::table_2().environment),
        Model::table_2().process_noise(true),
    )
}

fn predict(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("predict");
    let (kinematics, inertial, earth, noise) = moving();
    let start = Model::table_2().initial_covariance(true);

    group.bench_function("structured", |bencher| {
        let (mut p, mut k) = (start, kinematics);
        let mut interval = Interval::begin(&k, &earth, false);
        bencher.iter(|| {
            let before = k;
            k.step(&inertial, &inertial, DT, &earth);
            interval.extend(&before, &k, &inertial, &inertial, DT, &earth);
            interval.propagate(&mut p.data.0, &k, &noise, &earth);
            black_box(&p);
        });
    });
    group.bench_function("dense", |bencher| {
        let (mut p, mut k) = (start, kinematics);
        bencher.iter(|| {
            k.step(&inertial, &inertial, DT, &earth);
            let c = Coefficients::at(&k, &inertial, &earth);
            let f = c.dense(&earth);
            let q = dense_noise(&c, &noise);
            let phi = Dense::from_fn(|i, j| f64::from(u8::from(i == j)) + DT * f[i][j]);
            let q = Dense::from_fn(|i, j| 0.5 * DT * q[i][j]);
            p = phi * (p + q) * phi.transpose() + q;
            black_box(&p);
        });
    });
    group.bench_function("structured_10_hz", |bencher| {
        let mut filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &Options::default()).unwrap();
        let sample = |time_ns| ImuSample {
            time_ns,
            rate_p_radps: Vec3::from_array(inertial.rate_p_radps),
            force_p_mps2: Vec3::from_array(inertial.force_p_mps2),
        };
        let mut time_ns = 0;
        bencher.iter(|| {
            filter.predict(&sample(time_ns), &sample(time_ns + 6_666_667)).unwrap();
            time_ns += 6_666_667;
        });
    });
    group.finish();
}

fn update(criterion: &mut Criterion) {
    let geometry = BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap();
    let mut group = criterion.benchmark_group("update");
    for beams in 1..=4 {
        let ping = BeamSample {
            time_ns: 0,
            velocity_mps: [0.01; MAX_BEAMS],
            sd_mps: [0.042; MAX_BEAMS],
            valid: BeamMask::all(beams),
        };
        let filter = Eskf::new(NavState::at_rest(0), &Model::table_2(), &Options::default()).unwrap();
        group.bench_function(format!("tight_{beams}"), |bencher| {
            bencher.iter(|| {
                let mut filter = filter.clone();
                let innovation =
                    filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping));
                black_box(filter.update(&innovation, Sensor::Beams).unwrap());
            });
        });
        // The update by itself, on one filter: of noise so large that a million of them hardly change the covariance.
        let mut innovation = filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping));
        innovation.noise *= 1e8;
        group.bench_function(format!("alone_{beams}"), |bencher| {
            let mut filter = filter.clone();
            bencher.iter(|| black_box(filter.update(black_box(&innovation), Sensor::Beams).unwrap()));
        });
    }
    group.finish();
}

/// The solutions of a ping.
fn solve(criterion: &mut Criterion) {
    let geometry = BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap();
    let mut group = criterion.benchmark_group("solve");
    let (noise, prior) = (BeamNoise::identity() * 0.0018, Matrix3::<f64>::identity() * 0.01);
    for (name, method) in [
        ("vb", PartialMethod::VirtualBeam),
        ("nsv", PartialMethod::NullifiedSway),
        ("plcf", PartialMethod::PartialLoose),
        ("vhv", PartialMethod::VirtualHeave),
        ("elc", PartialMethod::Selector),
        ("info", PartialMethod::Information),
    ] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                fix_estimator(
                    method,
                    &geometry,
                    BeamMask::all(2),
                    &noise,
                    Some(&prior),
                    &Assumptions::default(),
                )
                .unwrap()
            });
        });
    }
    for beams in [1, 3, 4] {
        let (valid, assumptions) = (BeamMask::all(beams), Assumptions::default());
        group.bench_function(format!("elc_{beams}"), |bencher| {
            bencher.iter(|| {
                fix_estimator(
                    PartialMethod::Selector,
                    &geometry,
                    valid,
                    &noise,
                    Some(&prior),
                    &assumptions,
                )
                .unwrap()
            });
        });
    }
    group.finish();
}

/// What a recorded sample costs most: normalised squares of the whole error, and of misalignment and velocity.
fn record(criterion: &mut Criterion) {
    let (covariance, error) = (Model::table_2().initial_covariance(true), ErrorVector::repeat(1e-3));
    let mut group = criterion.benchmark_group("nees");
    // The methods of a run side by side.
    let estimates = [(&covariance, &error); 8];
    group.bench_function("whole", |bencher| {
        bencher.iter(|| nees::<DIM>(black_box(&estimates), 0..DIM));
    });
    group.bench_function("velocity_attitude", |bencher| {
        bencher.iter(|| nees::<8>(black_box(&estimates), ATTITUDE..ATTITUDE + 6));
    });
    group.finish();
}

/// A hundred steps, runs side by side; divide by runs × 100 for the cost of a run-step.
fn together(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("together");
    let (_, inertial, ..) = moving();
    let stream: Vec<_> = (0..=100)
        .map(|k| ImuSample {
            time_ns: k * 6_666_667,
            rate_p_radps: Vec3::from_array(inertial.rate_p_radps),
            force_p_mps2: Vec3::from_array(inertial.force_p_mps2),
        })
        .collect();
    for (name, covariance_period_ns) in [("every_step", 0), ("10_hz", 100_000_000)] {
        let options = Options {
            covariance_period_ns,
            ..Options::default()
        };
        let one = Eskf::new(NavState::at_rest(0), &Model::table_2(), &options).unwrap();
        for runs in [1, 4, 8, 32] {
            let streams = vec![stream.clone(); runs];
            group.throughput(Throughput::Elements(100 * runs as u64));
            group.bench_function(format!("{name}/{runs}"), |bencher| {
                let start = || vec![one.clone(); runs];
                let predict = |filters: &mut Vec<Eskf>| {
                    let pairs = filters.iter_mut().zip(&streams);
                    let mut spans: Vec<_> = pairs.map(|(filter, stream)| FilterSpan::new(filter, stream)).collect();
                    predict_together(&mut spans);
                };
                bencher.iter_batched_ref(start, predict, BatchSize::SmallInput);
            });
        }
    }
    group.finish();
}

/// A straight minute at 150 Hz, with a ping a second.
struct Minute {
    time_ns: Vec<i64>,
    zero: Vec<[f64; 3]>,
    attitude: Vec<[f64; 4]>,
    velocity: Vec<[f64; 3]>,
    force: Vec<[f64; 3]>,
    dvl_time_ns: Vec<i64>,
    beam_valid: Vec<BeamMask>,
}

impl Minute {
    fn new() -> Self {
        let count = 60 * 150 + 1;
        let seconds: Vec<i64> = (1..60).map(|k| k * 1_000_000_000).collect();
        Self {
            time_ns: (0..count as i64).map(|k| k * 1_000_000_000 / 150).collect(),
            zero: vec![[0.0; 3]; count],
            attitude: vec![[1.0, 0.0, 0.0, 0.0]; count],
            velocity: vec![[2.0, 0.0, 0.0]; count],
            force: vec![[0.0, 0.0, -9.79]; count],
            beam_valid: vec![BeamMask::all(2); seconds.len()],
            dvl_time_ns: seconds,
        }
    }

    fn truth(&self) -> Truth<'_> {
        Truth {
            time_ns: &self.time_ns,
            position_t_m: &self.zero,
            attitude_t_p: &self.attitude,
            velocity_p_mps: &self.velocity,
            omega_p_radps: &self.zero,
            force_p_mps2: &self.force,
        }
    }

    fn schedule(&self) -> Schedule<'_> {
        Schedule {
            dvl_time_ns: &self.dvl_time_ns,
            beam_valid: &self.beam_valid,
            ..Schedule::default()
        }
    }
}

fn runs(criterion: &mut Criterion) {
    let (minute, geometry, model) = (
        Minute::new(),
        BeamGeometry::janus(Janus::X, 20_f64.to_radians()).unwrap(),
        Model::table_2(),
    );
    let (truth, schedule, options) = (minute.truth(), minute.schedule(), Options::default());
    let steps = (minute.time_ns.len() - 1) as u64;
    let mut group = criterion.benchmark_group("run");
    group.throughput(Throughput::Elements(steps));
    let key = RunKey {
        seed: 1,
        trajectory: 2,
        run: 3,
    };
    group.bench_function("sensors", |bencher| {
        bencher.iter(|| simulate(&truth, &geometry, &model, &model, &schedule, &options, &key).unwrap());
    });
    // Without methods a batch draws its sensors and does nothing else.
    for names in [
        &[][..],
        &["tc"],
        &["ins", "lc", "tc", "elc"],
        &["ins", "lc", "tc", "vb", "nsv", "plcf", "vhv", "elc"],
    ] {
        let methods: Vec<_> = names.iter().map(|name| Method::named(name).unwrap()).collect();
        let batch = Batch {
            truth,
            geometry: &geometry,
            simulated: &model,
            assumed: &model,
            options: &options,
            schedules: &[schedule],
            sample_time_ns: &minute.dvl_time_ns,
            methods: &methods,
            seed: 1,
            trajectory_key: 2,
            first_run: 0,
            runs: 8,
        };
        group.throughput(Throughput::Elements(8 * methods.len().max(1) as u64 * steps));
        group.bench_function(format!("eight_of_{}_methods", methods.len()), |bencher| {
            bencher.iter(|| run_batch(&batch, 1).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, predict, update, solve, record, together, runs);
criterion_main!(benches);
