//! What the water states become, and what is measured and tested of the slip.

use super::*;
use crate::aiding::further::FurtherVector;
use crate::aiding::water::sway_row;
use crate::filter::level_turn::advance;
use crate::testing::*;

fn filter() -> Eskf {
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    let block = WaterBlock::new(&every_step().water);
    Eskf::new(state, &Model::table_2(), &every_step())
        .unwrap()
        .with_water(Some(block))
}

/// Fraction of each error that is left after a time.
fn left(duration_s: f64) -> WaterVector {
    every_step()
        .water
        .processes()
        .map(|process| process.left(duration_s))
        .into()
}

fn row(filter: &Eskf) -> WaterRow {
    let water = filter.water_states().unwrap().estimate;
    filter.with_motion(|motion| sway_row(motion, &water))
}

/// The covariance of the current about true north against that of the numerical differences of [`inject`], by the
/// misalignment about the vertical and the states of the current; with all three correlated after beams and assumptions.
#[test]
fn covariance_of_the_current_has_the_error_of_the_heading() {
    let mut filter = filter();
    for _ in 0..3 {
        advance(&mut filter, 100);
        let assumed = row(&filter);
        filter.assume(&assumed, Sensor::Sway).unwrap();
    }
    let mut moved = FurtherVector::zeros();
    let estimate = filter.water_states().unwrap().estimate;
    moved[block::WATER.first + CURRENT] = 0.2 - estimate[CURRENT];
    moved[block::WATER.first + CURRENT + 1] = -0.5 - estimate[CURRENT + 1];
    filter.extensions.further.as_mut().unwrap().inject(0.0, &moved);
    let (p, estimate) = (filter.joint_covariance(), filter.water_states().unwrap().estimate);
    let states = [ATTITUDE + 2, DIM + CURRENT, DIM + CURRENT + 1];
    let by_state = DMatrix::from_fn(2, 3, |i, j| {
        let moved = |step: f64| {
            let (mut water, mut error) = (Water::common(&estimate), WaterVector::zeros());
            if j > 0 {
                error[CURRENT + j - 1] = step;
            }
            water.inject(if j == 0 { step } else { 0.0 }, &error, &LayerVector::zeros());
            water.estimate[CURRENT + i]
        };
        (moved(1e-6) - moved(-1e-6)) / 2e-6
    });
    let part = DMatrix::from_fn(3, 3, |i, j| p[(states[i], states[j])]);
    let expected = &by_state * part * by_state.transpose();
    let found = filter.current().unwrap().1;
    assert!((DMatrix::from_fn(2, 2, |i, j| found[(i, j)]) - expected).amax() < 1e-10);
    assert_eq!(filter.with_water(None).current(), None);
}

/// Between epochs the water states decay with their correlations, and each variance tends to its steady state.
#[test]
fn water_states_decay() {
    let mut filter = filter();
    advance(&mut filter, 100);
    let assumed = row(&filter);
    filter.assume(&assumed, Sensor::Sway).unwrap();
    let before = filter.extensions.further().clone();
    advance(&mut filter, 1);
    filter.propagated_covariance();
    let after = filter.extensions.further();
    let decay = left(0.01);
    // Φ is the identity for biases; `carried_columns_are_dense_products` checks the other states.
    for i in crate::layout::ACCEL_BIAS..DIM {
        for k in 0..WATER {
            let at = (i, block::WATER.first + k);
            assert!((after.cross()[at] - before.cross()[at] * decay[k]).abs() < 1e-18);
        }
    }
    for k in 0..WATER {
        let variance = every_step().water.processes()[k].variance;
        let at = (block::WATER.first + k, block::WATER.first + k);
        let expected = before.covariance()[at] * decay[k] * decay[k] + (1.0 - decay[k] * decay[k]) * variance;
        assert!((after.covariance()[at] / expected - 1.0).abs() < 1e-14);
    }
}

/// By hand: the first alarm widens to what is assumed of an unknown vehicle, the next doubles the deviation, and the time grows
/// fourfold where the slip lasts beyond it; a wide slip is not narrowed.
#[test]
fn alarms_widen_by_hand() {
    let mut slip = Slip::of(&WaterPrior::default());
    let mut after = |alarm| {
        slip.widen(alarm);
        (slip.sd_mps, slip.time_s)
    };
    assert_eq!(after(Alarm::Larger), (0.3, 60.0));
    assert_eq!(after(Alarm::Lasting(32.0)), (0.6, 60.0));
    assert_eq!(after(Alarm::Lasting(128.0)), (1.2, 240.0));
    (0..20).for_each(|_| _ = after(Alarm::Lasting(1e5)));
    assert_eq!(after(Alarm::Larger), (10.0, 3600.0));
    let weightless = Slip {
        sd_mps: 1e6,
        time_s: 1e5,
    };
    let mut slip = weightless;
    slip.widen(Alarm::Lasting(1e6));
    assert_eq!(slip, weightless);
}

/// Numbers from bytes are finite, or named.
#[test]
fn restored_numbers_are_checked() {
    let good = WaterBlock::new(&WaterPrior::default());
    let faults: [Fault<WaterBlock>; 5] = [
        ("", |block| block.prior.slip_time_s = 0.0),
        ("", |block| block.since_s = f64::NAN),
        ("", |block| block.turning_mps[4] = f64::NAN),
        ("", |block| block.slips[0].sd_mps = 0.0),
        ("", |block| block.slips[1].time_s = f64::NAN),
    ];
    assert_refused(&good, |one| one.check_restored(3), &faults);
}

/// A block that starts again has its prior and the slip as assumed, and counts; an alarm widens the slip it names alone.
#[test]
fn a_restart_forgets_all_but_the_slip() {
    let fresh = WaterBlock::new(&WaterPrior::default());
    let anew = fresh.restarted();
    let counts = |block: &WaterBlock| (block.restarts(), block.alarms());
    assert_eq!(
        (counts(&anew), counts(&fresh), counts(&anew.restarted())),
        ((1, 0), (0, 0), (2, 0))
    );
    assert_eq!(anew.processes(), fresh.processes());
    let wide = fresh.widened([Some(Alarm::Larger), None]);
    assert_eq!((counts(&wide), wide.slip_time_s()[1]), ((1, 1), fresh.slip_time_s()[1]));
    let (slip, usual) = (wide.processes(), fresh.processes());
    assert!(slip[SWAY].variance > usual[SWAY].variance && slip[SWAY].time_s > usual[SWAY].time_s);
    assert_eq!(slip[HEAVE], usual[HEAVE]);
    assert_eq!(wide.restarted().processes(), slip);
    assert!(slip[SWAY].left(1.0) > usual[SWAY].left(1.0));
}

/// Estimates decay with their correlation times.
#[test]
fn estimates_decay() {
    let mut filter = filter();
    let water = WaterVector::from([0.3, -0.2, 0.5, 0.02, 0.01, -0.03]);
    let mut moved = FurtherVector::zeros();
    let before = filter.water_states().unwrap().estimate;
    moved
        .fixed_rows_mut::<WATER>(block::WATER.first)
        .copy_from(&(water - before));
    filter.extensions.further.as_mut().unwrap().inject(0.0, &moved);
    advance(&mut filter, 101);
    filter.propagated_covariance();
    let expected = water.component_mul(&left(1.01));
    assert!((filter.water_states().unwrap().estimate - expected).amax() < 1e-12);
}
