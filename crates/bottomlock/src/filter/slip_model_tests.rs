//! The estimate of a slip against dense Gaussian likelihoods and drawn slips.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const PRIOR: (f64, f64) = (4e-4, 5.0);
const CONSTANTS: [f64; 3] = [0.09, 0.09, 0.09];

fn model() -> SlipModel {
    SlipModel::new(PRIOR.0, PRIOR.1, 20.0, CONSTANTS)
}

fn normals(seed: u64) -> impl Iterator<Item = f64> {
    ChaCha8Rng::seed_from_u64(seed).sample_iter(rand_distr::StandardNormal)
}

/// A model that has measured a slip of this deviation and time for `seconds`, five times a second with 2 cm/s of noise, in a
/// current of 0.3 m/s on a heading that is held.
fn learned(sd_mps: f64, time_s: f64, seconds: usize, seed: u64) -> SlipModel {
    let (mut numbers, mut model) = (normals(seed), model());
    let left = (-0.2 / time_s).exp();
    let mut slip = sd_mps * numbers.next().unwrap();
    for _ in 0..5 * seconds {
        slip = left * slip + (1.0 - left * left).sqrt() * sd_mps * numbers.next().unwrap();
        model.wait(0.2);
        model.learn(&MeasuredSlip {
            measured_mps: 0.3 + slip + 0.02 * numbers.next().unwrap(),
            by: [0.6, 0.8, 0.0],
            variance: 4e-4,
        });
    }
    model
}

/// Before anything was measured the slip is the prior's own, bit for bit.
#[test]
fn nothing_measured_is_the_prior() {
    let mut model = model();
    model.wait(100.0);
    assert_eq!((model.variance(), model.time_s()), PRIOR);
}

/// Within 60 s of pings a vehicle's slip is found to a factor, larger and longer or smaller than the prior has it. Median of 15.
#[test]
fn the_slip_is_found_both_ways() {
    for (sd_mps, time_s, low, high) in [(0.3, 20.0, 0.5, 1.7), (0.1, 60.0, 0.4, 1.8), (0.02, 5.0, 0.7, 1.5)] {
        let mut ratios: Vec<f64> = (0..15)
            .map(|seed| learned(sd_mps, time_s, 60, seed).variance().sqrt() / sd_mps)
            .collect();
        ratios.sort_by(f64::total_cmp);
        assert!(ratios[7] > low && ratios[7] < high, "{sd_mps}, {time_s}: {ratios:?}");
    }
    let calm = learned(0.001, 5.0, 120, 3);
    assert!(calm.variance() < 0.3 * PRIOR.0, "{}", calm.variance());
    let long = learned(0.3, 60.0, 300, 4);
    assert!(long.time_s() > 4.0 * PRIOR.1, "{}", long.time_s());
}

/// The likelihood of every node is the Gaussian density of all that was measured, by its dense covariance.
#[test]
fn likelihoods_are_dense_gaussian_densities() {
    let (mut model, mut numbers) = (model(), normals(5));
    let steps = [0.2, 1.0, 0.5, 3.0, 0.2, 0.2];
    let mut rows: Vec<(f64, MeasuredSlip)> = Vec::new();
    let mut at_s = 0.0;
    for (k, step_s) in steps.into_iter().enumerate() {
        at_s += step_s;
        let turn = 0.3 * k as f64;
        let slip = MeasuredSlip {
            measured_mps: 0.05 * numbers.next().unwrap(),
            by: [turn.cos(), turn.sin(), 0.1 * turn],
            variance: 1e-4 * (1.0 + k as f64),
        };
        model.wait(step_s);
        model.learn(&slip);
        rows.push((at_s, slip));
    }
    let count = rows.len();
    let y = DVector::from_fn(count, |k, _| rows[k].1.measured_mps);
    for node in &model.nodes {
        let covariance = DMatrix::from_fn(count, count, |i, j| {
            let ((t, a), (u, b)) = (rows[i], rows[j]);
            let constants: f64 = (0..3).map(|k| CONSTANTS[k] * a.by[k] * b.by[k]).sum();
            let slip = node.variance * (-(t - u).abs() / node.time_s).exp();
            constants + slip + if i == j { a.variance } else { 0.0 }
        });
        let factor = covariance.cholesky().unwrap();
        let dense = -0.5 * (y.dot(&factor.solve(&y)) + factor.determinant().ln());
        // What is measured fades with MEMORY_S, over 5 s here.
        assert!(
            (node.log_likelihood - dense).abs() < 0.02 * dense.abs(),
            "{} {dense}",
            node.log_likelihood
        );
    }
}

/// The prior's own node has the greatest prior, and more so with more weight.
#[test]
fn the_prior_is_most_probable_at_its_centre() {
    let mut model = model();
    model.begin();
    let most = (model.nodes.iter())
        .max_by(|a, b| a.log_prior.total_cmp(&b.log_prior))
        .unwrap();
    assert_eq!((most.variance, most.time_s), PRIOR);
}

/// By hand: the first alarm widens to what is assumed of an unknown vehicle, the next doubles the deviation, and the time grows
/// fourfold where the slip lasts beyond it; a wide slip is not narrowed.
#[test]
fn alarms_widen_by_hand() {
    let mut model = model();
    model.widen(Alarm::Larger);
    assert_eq!((model.variance(), model.time_s()), (0.3 * 0.3, 60.0));
    model.widen(Alarm::Lasting(32.0));
    assert!((model.variance() - 0.36).abs() < 1e-12 && model.time_s() == 60.0);
    model.widen(Alarm::Lasting(128.0));
    assert!((model.variance() - 1.44).abs() < 1e-12 && model.time_s() == 240.0);
    (0..20).for_each(|_| model.widen(Alarm::Lasting(1e5)));
    assert_eq!((model.variance(), model.time_s()), (100.0, 3600.0));
    let mut weightless = SlipModel::new(1e12, 1e5, 20.0, CONSTANTS);
    weightless.widen(Alarm::Lasting(1e6));
    assert_eq!((weightless.variance(), weightless.time_s()), (1e12, 1e5));
}

/// After an alarm the slip is measured anew, and comes down again within ten minutes of complete pings.
#[test]
fn a_false_alarm_is_measured_away() {
    let (mut model, mut numbers) = (model(), normals(8));
    model.widen(Alarm::Larger);
    for _ in 0..3000 {
        model.wait(0.2);
        model.learn(&MeasuredSlip {
            measured_mps: 0.02 * numbers.next().unwrap(),
            by: [1.0, 0.0, 0.0],
            variance: 4e-4,
        });
    }
    assert!(model.variance().sqrt() < 0.25, "{}", model.variance());
}

/// A ping that no slip of the grid explains changes nothing.
#[test]
fn an_outlier_changes_nothing() {
    let mut model = learned(0.02, 5.0, 20, 9);
    let before = (model.variance(), model.time_s());
    model.wait(0.2);
    model.learn(&MeasuredSlip {
        measured_mps: 30.0,
        by: [1.0, 0.0, 0.0],
        variance: 4e-4,
    });
    assert_eq!((model.variance(), model.time_s()), before);
}

/// Numbers from bytes are finite and positive where they must be, or named.
#[test]
fn restored_numbers_are_checked() {
    let good = learned(0.02, 5.0, 2, 1);
    assert_eq!(good.check_restored(3), Ok(()));
    let faults: [fn(&mut SlipModel); 8] = [
        |model| model.variance = 0.0,
        |model| model.time_s = f64::NAN,
        |model| model.centre.0 = -1.0,
        |model| model.weight = f64::INFINITY,
        |model| model.constants[1] = f64::NAN,
        |model| model.since_s = f64::NAN,
        |model| model.nodes[3].covariance[(1, 2)] = f64::NAN,
        |model| model.nodes[4].log_likelihood = f64::NAN,
    ];
    for (number, change) in faults.into_iter().enumerate() {
        let mut bad = good.clone();
        change(&mut bad);
        assert!(bad.check_restored(3).is_err(), "{number}");
    }
}

/// What was measured ten minutes ago has 1/e of its weight.
#[test]
fn weights_fade() {
    let mut model = SlipModel::new(4e-4, 5.0, 20.0, [0.0; SLIP]);
    let slip = |measured_mps: f64| MeasuredSlip {
        measured_mps,
        by: [0.0; SLIP],
        variance: 1e-4,
    };
    model.learn(&slip(0.01));
    let before: Vec<f64> = model.nodes.iter().map(|node| node.log_likelihood).collect();
    model.wait(600.0);
    // An outlier to every node adds nothing.
    model.learn(&slip(1e3));
    for (node, before) in model.nodes.iter().zip(before) {
        assert!((node.log_likelihood - before * (-1.0_f64).exp()).abs() < 1e-12);
    }
}
