//! What the kernel costs: compare by ratio within one run.
//!
//! `predict/structured` against `predict/dense` is the house's bar (at least 4 times); both work on the same data, first order at
//! every step.

// Helpers outside `#[test]` functions fail loudly too.
#![allow(clippy::unwrap_used)]

use std::hint::black_box;

use bottomlock::aiding::{beam_terms, tightly_coupled};
use bottomlock::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, Janus, MAX_BEAMS};
use bottomlock::dvl::partial::{Assumptions, BeamNoise, Method, plan};
use bottomlock::error_model::{Coefficients, Interval, ProcessNoise, dense_noise};
use bottomlock::filter::Eskf;
use bottomlock::frames::Vec3;
use bottomlock::imu::{EarthTerms, ImuSample, Inertial, Kinematics};
use bottomlock::lane::Four;
use bottomlock::layout::DIM;
use bottomlock::model::*;
use bottomlock::report::Sensor;
use bottomlock::state::NavState;
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, SMatrix};

type Dense = SMatrix<f64, DIM, DIM>;
const DT: f64 = 1.0 / 150.0;

fn moving() -> (Kinematics<f64>, Inertial<f64>, EarthTerms, ProcessNoise) {
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
        bencher.iter(|| {
            k.step(&inertial, &inertial, DT, &earth);
            let mut interval = Interval::default();
            interval.extend(Coefficients::at(&k, &inertial, &earth), DT);
            interval.propagate(&mut p.data.0, &noise, &earth, false);
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
    group.bench_function("four_lanes", |bencher| {
        let mut p: [[Four; DIM]; DIM] = start.data.0.map(|column| column.map(Four::splat));
        let mut k = Kinematics::new(
            [Four::splat(0.0); 3],
            kinematics.attitude_t_p.map(Four::splat),
            kinematics.velocity_p_mps.map(Four::splat),
        );
        let wide = Inertial {
            rate_p_radps: inertial.rate_p_radps.map(Four::splat),
            force_p_mps2: inertial.force_p_mps2.map(Four::splat),
        };
        bencher.iter(|| {
            k.step(&wide, &wide, DT, &earth);
            let mut interval = Interval::default();
            interval.extend(Coefficients::at(&k, &wide, &earth), DT);
            interval.propagate(&mut p, &noise, &earth, false);
            black_box(&p);
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
    }
    group.finish();

    let mut group = criterion.benchmark_group("solve");
    let (noise, prior) = (BeamNoise::identity() * 0.0018, Matrix3::<f64>::identity() * 0.01);
    for (name, method) in [
        ("vb", Method::VirtualBeam),
        ("nsv", Method::NullifiedSway),
        ("plcf", Method::PartialLoose),
        ("vhv", Method::VirtualHeave),
        ("elc", Method::Selector),
        ("info", Method::Information),
    ] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                plan(
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
    group.finish();
}

criterion_group!(benches, predict, update);
criterion_main!(benches);
