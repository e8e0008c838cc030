//! The bias of the depth sensor against a Kalman filter on all 27 states.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::*;
use crate::aiding::depth::depth;
use crate::aiding::sensor::TimeConstant;
use crate::aiding::water::sway_row;
use crate::filter::Eskf;
use crate::filter::gate::Gate;
use crate::filter::level_turn::{advance, assert_close};
use crate::filter::options::Options;
use crate::filter::report::Sensor;
use crate::filter::water_block::WaterBlock;
use crate::frames::Vec3;
use crate::layout::{ATTITUDE, POSITION, VELOCITY};
use crate::model::Model;
use crate::state::NavState;

const WATER_AT: usize = DIM + 1;
const ALL: usize = WATER_AT + WATER;
const BIAS: DepthModel = DepthModel {
    sd_m: 0.02,
    bias_sd_m: 0.3,
    bias_time_s: TimeConstant(100.0),
};

fn model() -> Model {
    let mut model = Model::table_2();
    model.sensors.depth = BIAS;
    // Within the linear range.
    model.initial.attitude_sd_rad = [1e-3; 3];
    model
}

fn filter() -> Eskf {
    let options = Options {
        gate: Gate::Off,
        covariance_period_ns: 0,
        ..Options::default()
    };
    let mut state = NavState::at_rest(0);
    state.velocity_p_mps = Vec3::new(2.0, 0.1, -0.05);
    Eskf::new(state, &model(), &options)
        .unwrap()
        .with_water(Some(WaterBlock::new(&options.water)))
}

fn bias(filter: &Eskf) -> DepthBias {
    let known = filter.extensions.depth_bias.as_deref().cloned();
    known.or_else(|| DepthBias::new(&BIAS)).unwrap()
}

/// The joint covariance of the error state, the bias and the water states.
fn joint(filter: &Eskf) -> DMatrix<f64> {
    let (p, bias, water) = (filter.covariance(), bias(filter), filter.water().unwrap());
    let upper = |i: usize, j: usize| match (i, j) {
        (i, j) if j < DIM => p[(i, j)],
        (i, DIM) if i < DIM => bias.cross[i],
        (DIM, DIM) => bias.variance_m2,
        (DIM, j) => bias.water[j - WATER_AT],
        (i, j) if i < DIM => water.cross()[(i, j - WATER_AT)],
        (i, j) => water.covariance()[(i - WATER_AT, j - WATER_AT)],
    };
    DMatrix::from_fn(ALL, ALL, |i, j| upper(i.min(j), i.max(j)))
}

fn read(filter: &Eskf, depth_m: f64) -> Innovation {
    depth(&filter.state(), depth_m, BIAS.sd_m, &Vec3::from_array([0.4, 0.1, -0.2]))
}

/// P − P h hᵀP / (hᵀP h + r) of all states.
fn updated(p: &DMatrix<f64>, h: &DVector<f64>, r: f64) -> DMatrix<f64> {
    let column = p * h;
    p - &column * column.transpose() / (h.dot(&column) + r)
}

/// Depths, a velocity and assumptions by turns: the covariance of all states is the textbook's, and so is the estimate.
#[test]
fn updates_are_the_textbook_updates_of_all_states() {
    let mut filter = filter();
    for round in 0..4 {
        advance(&mut filter, 100);
        let (p, before_m) = (joint(&filter), bias(&filter).estimate_m);
        let innovation = read(&filter, 0.7);
        let h = DVector::from_fn(ALL, |i, _| match i {
            i if i < DIM => innovation.jacobian[(0, i)],
            DIM => 1.0,
            _ => 0.0,
        });
        let report = filter.update(&innovation, Sensor::Depth).unwrap();
        assert_close(&joint(&filter), &updated(&p, &h, BIAS.sd_m.powi(2)), 1e-9, "depth");
        let s = h.dot(&(&p * &h)) + BIAS.sd_m.powi(2);
        assert!((report.covariance[(0, 0)] / s - 1.0).abs() < 1e-9, "round {round}");
        let gain = (&p * &h)[DIM] / s;
        let expected_m = before_m + gain * (innovation.residual[0] - before_m);
        assert!((bias(&filter).estimate_m - expected_m).abs() < 1e-12);

        advance(&mut filter, 50);
        let p = joint(&filter);
        let mut measured = Innovation {
            rows: 1,
            degrees: 1,
            ..Innovation::empty()
        };
        measured.jacobian[(0, VELOCITY + 2)] = 1.0;
        (measured.residual[0], measured.noise[(0, 0)]) = (0.05, 0.01);
        let h = DVector::from_fn(ALL, |i, _| f64::from(u8::from(i == VELOCITY + 2)));
        filter.update(&measured, Sensor::Velocity).unwrap();
        assert_close(&joint(&filter), &updated(&p, &h, 0.01), 1e-9, "velocity");

        let water = *filter.water().unwrap().estimate();
        let assumed = filter.with_motion(|motion| sway_row(motion, &water));
        let mut begun = filter.clone();
        begun.extensions.water.as_deref_mut().unwrap().begin_epoch(&assumed);
        let p = joint(&begun);
        let h = DVector::from_fn(ALL, |i, _| match i {
            i if i < DIM => assumed.by_state[i],
            DIM => 0.0,
            i => assumed.by_water[i - WATER_AT],
        });
        filter.assume(&assumed, Sensor::Sway, false).unwrap();
        assert_close(&joint(&filter), &updated(&p, &h, assumed.variance), 1e-9, "assumption");
    }
}

/// A depth corrects the position alone beyond the linear range: the bias keeps its variance, and the covariance is
/// Joseph's form of that gain.
#[test]
fn a_position_alone_leaves_the_bias() {
    let mut filter = filter();
    let mut wide = filter.covariance();
    (VELOCITY..VELOCITY + 3).for_each(|k| wide[(k, k)] = 1e4);
    filter.set_covariance(&wide).unwrap();
    advance(&mut filter, 10);
    assert!(filter.is_beyond_linear_range());
    filter.update(&read(&filter, 0.7), Sensor::Depth).unwrap();
    let known = bias(&filter);
    assert!((known.variance_m2 - BIAS.bias_sd_m.powi(2)).abs() < 1e-15 && known.estimate_m == 0.0);
    // The position has followed the reading, and its error is now minus that of the bias.
    assert!((known.cross[POSITION + 2] / BIAS.bias_sd_m.powi(2) + 1.0).abs() < 0.05);
}

/// Without a depth, or for a sensor without bias, there is no bias; a covariance set from outside begins anew.
#[test]
fn the_bias_begins_with_the_first_depth() {
    let mut with = filter();
    assert_eq!(with.depth_bias_m(), None);
    with.update(&read(&with, 0.1), Sensor::Depth).unwrap();
    assert!(with.depth_bias_m().is_some_and(|(_, sd_m)| sd_m < 0.3));
    let covariance = with.covariance();
    with.set_covariance(&covariance).unwrap();
    assert_eq!(with.depth_bias_m(), None);
    let mut without = Eskf::new(NavState::at_rest(0), &Model::table_2(), &Options::default()).unwrap();
    without.update(&read(&without, 0.1), Sensor::Depth).unwrap();
    assert_eq!(without.depth_bias_m(), None);
}

/// Between measurements the bias and its correlations decay, and its variance tends to the prior's.
#[test]
fn the_bias_decays() {
    let mut filter = filter();
    filter.update(&read(&filter, 0.1), Sensor::Depth).unwrap();
    let before = bias(&filter);
    advance(&mut filter, 99);
    let (after, left) = (bias(&filter), (-0.99_f64 / 100.0).exp());
    let prior = BIAS.bias_sd_m.powi(2);
    let expected = prior + left * left * (before.variance_m2 - prior);
    assert!((after.variance_m2 / expected - 1.0).abs() < 1e-12);
    for k in crate::layout::ACCEL_BIAS..DIM {
        assert!((after.cross[k] - before.cross[k] * left).abs() < 1e-15);
    }
}

/// Its correlation with the water states decays with both, and is none of water states that start anew.
#[test]
fn its_correlation_with_the_water_decays_with_both() {
    let mut filter = filter();
    filter.update(&read(&filter, 0.1), Sensor::Depth).unwrap();
    let own = WaterVector::from([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) * 1e-3;
    filter.extensions.depth_bias.as_deref_mut().unwrap().water = own;
    advance(&mut filter, 100);
    let prior = Options::default().water;
    let expected = own.component_mul(&prior.decay(1.0)) * (-1.0_f64 / 100.0).exp();
    assert!((bias(&filter).water - expected).amax() < 1e-12);
    let anew = filter.with_water(Some(WaterBlock::new(&prior)));
    assert_eq!(bias(&anew).water, WaterVector::zeros());
}

/// At rest with a depth of 2.3 m where 0 is expected: a bias of 0.3 m beside a position of 2 m takes 0.3²/(2² + 0.3² + 0.02²) of it.
#[test]
fn estimate_by_hand() {
    let mut filter = filter();
    let innovation = depth(&filter.state(), 2.3, BIAS.sd_m, &Vec3::zeros());
    filter.update(&innovation, Sensor::Depth).unwrap();
    let (estimate_m, sd_m) = filter.depth_bias_m().unwrap();
    assert!((estimate_m - 2.3 * 0.09 / (4.0 + 0.09 + 4e-4)).abs() < 1e-12);
    assert!((sd_m.powi(2) - 0.09 * (4.0 + 4e-4) / (4.0 + 0.09 + 4e-4)).abs() < 1e-12);
}

/// A move of the path takes the correlation of the position along.
#[test]
fn moves_with_the_path() {
    let mut filter = filter();
    filter.update(&read(&filter, 0.1), Sensor::Depth).unwrap();
    let before = bias(&filter);
    let by = Matrix3::new(0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 5.0, 0.0, 0.0);
    let turned = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 2.0);
    filter.extensions.move_to_corrected_path(&crate::aiding::CorrectedPath {
        by_position: Some(turned),
        by_misalignment: by,
        offset_t_m: Vector3::new(7.0, 8.0, 9.0),
    });
    let (rho, after) = (before.cross.fixed_rows::<3>(ATTITUDE), bias(&filter));
    let expected = turned * before.cross.fixed_rows::<3>(POSITION) + by * rho;
    assert!(rho.amax() > 0.0 && (after.cross.fixed_rows::<3>(POSITION) - expected).amax() < 1e-15);
    assert_eq!(
        after.cross.rows(ATTITUDE, DIM - ATTITUDE),
        before.cross.rows(ATTITUDE, DIM - ATTITUDE)
    );
}

/// Numbers from bytes are finite, or named.
#[test]
fn restored_numbers_are_checked() {
    let good = DepthBias::new(&BIAS).unwrap();
    assert_eq!(good.check_restored(3), Ok(()));
    let faults: [fn(&mut DepthBias); 5] = [
        |bias| bias.model.sd_m = -1.0,
        |bias| bias.estimate_m = f64::NAN,
        |bias| bias.variance_m2 = f64::INFINITY,
        |bias| bias.cross[4] = f64::NAN,
        |bias| bias.water[2] = f64::NAN,
    ];
    for (number, change) in faults.into_iter().enumerate() {
        let mut bad = good.clone();
        change(&mut bad);
        assert!(bad.check_restored(3).is_err(), "{number}");
    }
}
