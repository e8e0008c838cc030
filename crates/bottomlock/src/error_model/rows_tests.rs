//! Rows in vectors against the covariance in parts, bit for bit, with every kind of vector that the machine has.

use super::*;
use crate::earth::Environment;
use crate::error_model::{Last, Partitioned, Steps};
use crate::frames::Vec3;
use crate::mechanisation::step_block::{Ahead, Biases, STEPS, Wake};
use crate::mechanisation::{ImuSample, Inertial, KINEMATICS, Sampling};
use crate::model::Model;
use crate::simd::on_every_level;

const SAMPLES: usize = 22;

fn earth() -> EarthTerms {
    EarthTerms::from(&Environment::normal(0.57, 12.0))
}

fn start() -> Kinematics<f64> {
    Kinematics::new([4.0, -7.0, 30.0], [0.9, 0.1, -0.2, 0.35], [2.0, -0.3, 0.1])
}

/// Readings at uneven times; once the vehicle turns so fast that its rotation leaves the series.
fn samples() -> Vec<ImuSample> {
    let sample = |k: usize| {
        let x = k as f64;
        let spin = if k == 5 { 90.0 } else { 0.3 };
        ImuSample {
            time_ns: 6_666_667 * k as i64 + [0, 1, -1][k % 3],
            rate_p_radps: Vec3::new(0.02 * x.sin(), spin * x.cos(), -0.1),
            force_p_mps2: Vec3::new(0.3, 0.2 * x.cos(), -9.8 + 0.1 * x.sin()),
        }
    };
    (0..SAMPLES).map(sample).collect()
}

fn biases() -> Biases {
    Biases {
        gyro_p_radps: [1e-4, -2e-4, 3e-5],
        accel_p_mps2: [0.01, 0.0, -0.03],
    }
}

fn corrected(sample: &ImuSample) -> Inertial<f64> {
    let (biases, rate, force) = (biases(), sample.rate_p_radps.to_array(), sample.force_p_mps2.to_array());
    Inertial {
        rate_p_radps: std::array::from_fn(|i| rate[i] - biases.gyro_p_radps[i]),
        force_p_mps2: std::array::from_fn(|i| force[i] - biases.accel_p_mps2[i]),
    }
}

/// Ends of step k of the readings, and its length in seconds.
fn step(k: usize, sampling: Sampling) -> (Inertial<f64>, Inertial<f64>, f64) {
    let samples = samples();
    let last = corrected(&samples[k + 1]);
    let first = match sampling {
        Sampling::Instantaneous => corrected(&samples[k]),
        Sampling::Averaged => last,
    };
    (first, last, (samples[k + 1].time_ns - samples[k].time_ns) as f64 * 1e-9)
}

/// A symmetric matrix without a zero; nothing here needs it to be positive.
fn covariance() -> [[f64; DIM]; DIM] {
    let element =
        |i: usize, j: usize| 1e-3 / (1.0 + (i * j) as f64) + if i == j { 0.7 } else { -1e-4 * (i + j) as f64 };
    std::array::from_fn(|i| std::array::from_fn(|j| element(i.max(j), i.min(j))))
}

fn bits(p: &[[f64; DIM]; DIM]) -> Vec<u64> {
    p.iter().flatten().map(|x| x.to_bits()).collect()
}

fn whole(p: &Partitioned<f64>) -> [[f64; DIM]; DIM] {
    std::array::from_fn(|i| std::array::from_fn(|j| *p.lower(i.max(j), i.min(j))))
}

/// Intervals of `length` steps, one after the other.
fn over_intervals<S: Simd, I: Single>(simd: S, length: usize) {
    let (earth, noise) = (earth(), Model::table_2().process_noise(true));
    let (mut parts, mut p) = (Partitioned::from_fn(0.0, |i, j| covariance()[i][j]), covariance());
    let mut underway = Underway::of(simd, &p);
    let mut kinematics = start();
    let mut interval = I::begin(&kinematics, &step(0, Sampling::Instantaneous).0, &earth);
    for k in 0..SAMPLES - 1 {
        let (first, last, dt_s) = step(k, Sampling::Instantaneous);
        let before = kinematics;
        kinematics.step(&first, &last, dt_s, &earth);
        interval.add(&I::take(&before, &kinematics, &last, &earth), dt_s);
        if (k + 1) % length == 0 {
            let mut own = interval;
            own.propagate(&mut parts, &kinematics, &noise, &earth);
            interval.propagate_rows(simd, &mut underway, &kinematics, &noise, &earth);
        }
        underway.rows.put_into(simd, &mut p);
        assert_eq!(bits(&p), bits(&whole(&parts)), "step {k}");
        for i in 1..DYNAMIC {
            for j in 1..DYNAMIC {
                assert_eq!(underway.rows.at(i, j).to_bits(), p[i][j].to_bits());
            }
        }
    }
}

/// First order at every step, second order over several; also where one interval follows another through a whole matrix.
#[test]
fn rows_equal_parts_bit_for_bit() {
    on_every_level!(simd => over_intervals::<_, Step<f64>>(simd, 1));
    on_every_level!(simd => over_intervals::<_, Step<f64>>(simd, 2));
    on_every_level!(simd => over_intervals::<_, Stretch<f64>>(simd, 4));
}

/// Out of a whole matrix and back nothing changes.
#[test]
fn there_and_back_again() {
    on_every_level!(simd => {
        let mut p = covariance();
        Rows::of(simd, &covariance()).put_into(simd, &mut p);
        assert_eq!(bits(&p), bits(&covariance()));
    });
}

/// Eight steps side by side are the steps one by one, with their covariance; so is a part of eight.
fn side_by_side<S: Simd>(simd: S, sampling: Sampling) {
    let (earth, noise, samples) = (earth(), Model::table_2().process_noise(true), samples());
    let mut kinematics = start();
    let mut interval = Step::begin(&kinematics, &corrected(&samples[0]), &earth);
    let mut parts = Partitioned::from_fn(0.0, |i, j| covariance()[i][j]);
    let (mut rows, mut p) = (Rows::of(simd, &covariance()), covariance());
    let (mut wake, mut last) = (Wake::of(simd, &kinematics), Last::of(simd, &interval));
    let (mut steps, mut ahead, mut attitude) = (Steps::EMPTY, Ahead::EMPTY, kinematics.attitude_t_p);
    for from in (0..SAMPLES - 1).step_by(STEPS) {
        let count = STEPS.min(SAMPLES - 1 - from);
        ahead.read(simd, &samples[from..=from + count], &biases(), sampling, &earth);
        for k in 0..count {
            ahead.turn(k, &mut attitude);
        }
        let Some(course) = wake.follow(simd, &ahead, count, &earth) else {
            unreachable!("all readings are finite");
        };
        steps.take(&course, &mut last, &noise, &earth);
        for k in 0..count {
            let (first, end, dt_s) = step(from + k, sampling);
            let before = kinematics;
            kinematics.step(&first, &end, dt_s, &earth);
            let own: [f64; KINEMATICS] = course.after.to_array().map(|x| x.as_slice()[k]);
            assert_eq!(own.map(f64::to_bits), kinematics.to_array().map(f64::to_bits));
            interval.add(&Step::take(&before, &kinematics, &end, &earth), dt_s);
            let mut columns = [[covariance()[3], covariance()[8]]; 2];
            interval.carry(&mut columns[0], &kinematics, &earth);
            steps.interval(k).carry(&mut columns[1], &kinematics, &earth);
            assert_eq!(columns[0], columns[1]);
            interval.propagate(&mut parts, &kinematics, &noise, &earth);
            steps.propagate(simd, k, &mut rows);
            rows.put_into(simd, &mut p);
            assert_eq!(bits(&p), bits(&whole(&parts)), "step {}", from + k);
        }
    }
}

#[test]
fn steps_side_by_side_equal_steps_one_by_one() {
    for sampling in [Sampling::Instantaneous, Sampling::Averaged] {
        on_every_level!(simd => side_by_side(simd, sampling));
    }
}

/// A course that would run out of numbers is not taken, and what went before stands.
#[test]
fn a_course_into_nowhere_is_none() {
    on_every_level!(simd => {
        let (earth, mut samples) = (earth(), samples());
        samples[6].force_p_mps2 = Vec3::new(f64::NAN, 0.0, 0.0);
        let (mut wake, mut ahead, mut attitude) = (Wake::of(simd, &start()), Ahead::EMPTY, start().attitude_t_p);
        ahead.read(simd, &samples[..=STEPS], &biases(), Sampling::Instantaneous, &earth);
        (0..STEPS).for_each(|k| ahead.turn(k, &mut attitude));
        assert!(wake.follow(simd, &ahead, STEPS, &earth).is_none());
        // Its first five steps need not what the sixth reads.
        assert!(wake.follow(simd, &ahead, 5, &earth).is_some());
    });
}
