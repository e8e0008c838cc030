//! The water states against a Kalman filter on all 26 states, and the estimation of slip variances.

use nalgebra::{DMatrix, DVector, SVector};

use super::*;
use crate::aiding::Innovation;
use crate::aiding::further::FIRST_WATER;
use crate::aiding::water::{CURRENT, WATER, inject, sway_row};
use crate::filter::Eskf;
use crate::filter::gate::Gate;
use crate::filter::level_turn::{advance, assert_close};
use crate::filter::options::Options;
use crate::filter::report::Sensor;
use crate::frames::Vec3;
use crate::layout::{ATTITUDE, DIM};
use crate::model::Model;
use crate::state::NavState;

const ALL: usize = DIM + WATER;

fn options() -> Options {
    Options {
        gate: Gate::Off,
        covariance_period_ns: 0,
        ..Options::default()
    }
}

fn filter() -> Eskf {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    let block = WaterBlock::new(&options().water);
    Eskf::new(state, &Model::table_2(), &options())
        .unwrap()
        .with_water(Some(block))
}

fn joint(filter: &Eskf) -> DMatrix<f64> {
    filter.joint_covariance()
}

fn row(filter: &Eskf) -> WaterRow {
    let water = *filter.water().unwrap().estimate();
    filter.with_motion(|motion| sway_row(motion, &water))
}

/// Alternate assumptions and measurements: covariance and estimate of all 26 states are those of P − P Hᵀ S⁻¹ H P.
#[test]
fn updates_are_the_textbook_updates_of_all_states() {
    let mut filter = filter();
    for round in 0..4 {
        advance(&mut filter, 100);
        let assumed = row(&filter);
        let mut p = joint(&filter);
        // The uncertainty due to the angular rate is added to the slip first.
        let uncertainty = assumed.turning_mps - filter.water().unwrap().turning_mps[assumed.slip];
        p[(DIM + assumed.slip, DIM + assumed.slip)] += uncertainty * uncertainty;
        let h = DVector::from_fn(ALL, |i, _| {
            if i < DIM {
                assumed.by_state[i]
            } else {
                assumed.by_water[i - DIM]
            }
        });
        let s = h.dot(&(&p * &h)) + assumed.variance;
        let gain = &p * &h / s;
        let before = *filter.water().unwrap().estimate();
        let report = filter.assume(&assumed, Sensor::Sway, false).unwrap();
        assert!((report.covariance[(0, 0)] / s - 1.0).abs() < 1e-12);
        check(&joint(&filter), &(&p - &gain * s * gain.transpose()), round);
        let mut expected = before;
        let step = SVector::from_fn(|k, _| gain[DIM + k] * assumed.residual);
        inject(&mut expected, gain[ATTITUDE + 2] * assumed.residual, &step);
        assert!((filter.water().unwrap().estimate() - expected).amax() < 1e-14);

        // A measurement of the sway over ground alone.
        let mut measured = Innovation {
            rows: 1,
            degrees: 1,
            ..Innovation::empty()
        };
        measured.jacobian[(0, crate::layout::VELOCITY + 1)] = 1.0;
        (measured.residual[0], measured.noise[(0, 0)]) = (0.05, 0.01);
        let p = joint(&filter);
        let column = p.column(crate::layout::VELOCITY + 1).into_owned();
        let s = column[crate::layout::VELOCITY + 1] + 0.01;
        filter.update(&measured, Sensor::Velocity).unwrap();
        check(&joint(&filter), &(&p - &column * column.transpose() / s), round);
    }
}

/// The covariance of the current about true north against that of the numerical differences of [`inject`], by the
/// misalignment about the vertical and the states of the current; with all three correlated after beams and assumptions.
#[test]
fn covariance_of_the_current_has_the_error_of_the_heading() {
    let mut filter = filter();
    for _ in 0..3 {
        advance(&mut filter, 100);
        let assumed = row(&filter);
        filter.assume(&assumed, Sensor::Sway, false).unwrap();
    }
    let block = filter.extensions.water.as_mut().unwrap();
    (block.estimate[CURRENT], block.estimate[CURRENT + 1]) = (0.2, -0.5);
    let (p, estimate) = (joint(&filter), *filter.water().unwrap().estimate());
    let states = [ATTITUDE + 2, DIM + CURRENT, DIM + CURRENT + 1];
    let by_state = DMatrix::from_fn(2, 3, |i, j| {
        let moved = |step: f64| {
            let (mut water, mut error) = (estimate, WaterVector::zeros());
            if j > 0 {
                error[CURRENT + j - 1] = step;
            }
            inject(&mut water, if j == 0 { step } else { 0.0 }, &error);
            water[CURRENT + i]
        };
        (moved(1e-6) - moved(-1e-6)) / 2e-6
    });
    let part = DMatrix::from_fn(3, 3, |i, j| p[(states[i], states[j])]);
    let expected = &by_state * part * by_state.transpose();
    let found = filter.current_covariance().unwrap();
    assert!((DMatrix::from_fn(2, 2, |i, j| found[(i, j)]) - expected).amax() < 1e-10);
    assert_eq!(filter.with_water(None).current_covariance(), None);
}

fn check(got: &DMatrix<f64>, expected: &DMatrix<f64>, round: usize) {
    assert_close(got, expected, 1e-10, &format!("round {round}"));
    let sizes = DVector::from_fn(ALL, |i, _| got[(i, i)].sqrt());
    let correlation = DMatrix::from_fn(ALL, ALL, |i, j| got[(i, j)] / sizes[i] / sizes[j]);
    assert!(correlation.symmetric_eigenvalues().min() > -1e-12, "round {round}");
}

/// Between epochs the water states decay with their correlations, and each variance tends to its steady state.
#[test]
fn water_states_decay() {
    let mut filter = filter();
    advance(&mut filter, 100);
    let assumed = row(&filter);
    filter.assume(&assumed, Sensor::Sway, false).unwrap();
    let before = filter.extensions.further().clone();
    advance(&mut filter, 1);
    filter.propagated_covariance();
    let after = filter.extensions.further();
    let decay = options().water.decay(0.01);
    // Φ is the identity for biases; `carried_columns_are_dense_products` checks the other states.
    for i in crate::layout::ACCEL_BIAS..DIM {
        for k in 0..WATER {
            let at = (i, FIRST_WATER + k);
            assert!((after.cross()[at] - before.cross()[at] * decay[k]).abs() < 1e-18);
        }
    }
    for k in 0..WATER {
        let variance = options().water.variance()[k];
        let at = (FIRST_WATER + k, FIRST_WATER + k);
        let expected = before.covariance()[at] * decay[k] * decay[k] + (1.0 - decay[k] * decay[k]) * variance;
        assert!((after.covariance()[at] / expected - 1.0).abs() < 1e-14);
    }
}

/// Small innovations reduce the variance; without an innovation, or with an uninformative one, it stays.
#[test]
fn slip_variance_follows_informative_innovations() {
    let row = row(&filter());
    let mut block = WaterBlock::new(&options().water);
    let start = block.variance()[row.slip];
    let epoch = |block: &mut WaterBlock, s_over_q: f64, normalised: Option<f64>| {
        block.since_s[row.slip] = 1.0;
        let left = options().water.decay(1.0)[row.slip];
        let q = (1.0 - left * left) * block.variance[row.slip];
        block.end_epoch(&row, q * s_over_q, normalised);
    };
    epoch(&mut block, 1.0, None);
    assert_eq!(block.variance()[row.slip], start);
    epoch(&mut block, 1e9, Some(0.0));
    assert!((block.variance()[row.slip] / start - 1.0).abs() < 1e-8);
    (0..500).for_each(|_| epoch(&mut block, 1.0, Some(0.5)));
    assert!(block.variance()[row.slip] < 0.3 * start);
    // Consecutive rejected epochs, each counted as the threshold of 9, increase it again.
    (0..100).for_each(|_| epoch(&mut block, 1.0, Some(9.0)));
    assert!(block.variance()[row.slip] > start);
    assert_eq!(block.restarted().variance()[row.slip], start);
}

/// Numbers from bytes are finite, or named.
#[test]
fn restored_numbers_are_checked() {
    let good = WaterBlock::new(&WaterPrior::default());
    assert_eq!(good.check_restored(3), Ok(()));
    let faults: [fn(&mut WaterBlock); 6] = [
        |block| block.prior.slip_time_s = 0.0,
        |block| block.estimate[0] = f64::NAN,
        |block| block.variance[5] = f64::NAN,
        |block| block.epochs[4] = f64::INFINITY,
        |block| block.since_s[4] = f64::NAN,
        |block| block.turning_mps[4] = f64::NAN,
    ];
    for (number, change) in faults.into_iter().enumerate() {
        let mut bad = good.clone();
        change(&mut bad);
        assert!(bad.check_restored(3).is_err(), "{number}");
    }
}

/// A block that starts again has its prior, nothing of what was learned, and counts.
#[test]
fn a_restart_forgets() {
    let mut learned = WaterBlock::new(&WaterPrior::default());
    learned.variance[5] *= 2.0;
    learned.estimate[0] = 0.3;
    let (anew, fresh) = (learned.restarted(), WaterBlock::new(&WaterPrior::default()));
    assert_eq!(
        (anew.restarts(), fresh.restarts(), anew.restarted().restarts()),
        (1, 0, 2)
    );
    assert_eq!((anew.estimate(), anew.variance()), (fresh.estimate(), fresh.variance()));
}

/// Estimates decay with their correlation times.
#[test]
fn estimates_decay() {
    let mut filter = filter();
    let water = WaterVector::from([0.3, -0.2, 0.5, 0.02, 0.01, -0.03]);
    filter.extensions.water.as_deref_mut().unwrap().estimate = water;
    advance(&mut filter, 101);
    filter.propagated_covariance();
    let expected = water.component_mul(&options().water.decay(1.01));
    assert!((filter.water().unwrap().estimate() - expected).amax() < 1e-12);
}

/// By hand: a slip that makes half of S, whose square is a quarter of what was expected, moves its variance by
/// 1 + 0.5 (0.25 − 1)/(n + 0.25); a slip that is all of S counts as one epoch.
#[test]
fn an_epoch_by_hand() {
    let row = row(&filter());
    for (share, normalised) in [(0.5, 0.25), (1.0, 4.0)] {
        let mut block = WaterBlock::new(&options().water);
        let (start, epochs) = (block.variance[row.slip], block.epochs[row.slip]);
        block.since_s[row.slip] = 2.0;
        let q = (1.0 - (-2.0 * 2.0 / options().water.slip_time_s).exp()) * start;
        block.end_epoch(&row, q / share, Some(normalised));
        let counted = (epochs + share * share).min(options().water.slip_epochs.max(MEMORY_EPOCHS));
        let expected = start * (1.0 + share * (normalised - 1.0) / counted);
        assert!((block.variance[row.slip] / expected - 1.0).abs() < 1e-12);
        assert!((block.epochs[row.slip] - counted).abs() < 1e-12 && block.since_s[row.slip] == 0.0);
    }
}
