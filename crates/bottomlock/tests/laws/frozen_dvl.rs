//! The 15-state filter and the 20-state filter with frozen DVL states.

use crate::common::*;
use bottomlock::aiding::{beam_terms, tightly_coupled};
use bottomlock::error_model::{Coefficients, dense_noise};
use bottomlock::mechanisation::{EarthTerms, Inertial};

type P15 = SMatrix<f64, 15, 15>;

/// F and G Q Gᵀ of the 15 states.
fn f_and_q(model: &Model, state: &NavState, sample: &ImuSample) -> (P15, P15) {
    let earth = EarthTerms::from(&model.environment);
    let inertial = Inertial {
        rate_p_radps: (sample.rate_p_radps - state.gyro_bias_p_radps).to_array(),
        force_p_mps2: (sample.force_p_mps2 - state.accel_bias_p_mps2).to_array(),
    };
    let c = Coefficients::at(&state.kinematics(), &inertial, &earth);
    let f = c.dense(&earth);
    let q = dense_noise(&c, &model.process_noise(false));
    (P15::from_fn(|i, j| f[i][j]), P15::from_fn(|i, j| q[i][j]))
}

/// The covariance after a first-order step with trapezoidal process noise.
fn propagated(p: &P15, model: &Model, start: (&NavState, &ImuSample), end: (&NavState, &ImuSample)) -> P15 {
    let dt = (end.1.time_ns - start.1.time_ns) as f64 * 1e-9;
    let ((f0, q0), (f1, q1)) = (f_and_q(model, start.0, start.1), f_and_q(model, end.0, end.1));
    let phi = P15::identity() + (f0 + f1) * (0.5 * dt);
    let q = (q0 + q1) * (0.25 * dt);
    phi * (p + q) * phi.transpose() + q
}

/// Fails unless the first 15 states of `twenty` have the covariance `p`, to 1e-7 of the standard deviations.
fn assert_equal_covariances(twenty: &Covariance, p: &P15, step: usize) {
    let scaled = |a: f64, i: usize, j: usize| a / (twenty[(i, i)] * twenty[(j, j)]).sqrt();
    for i in 0..15 {
        for j in 0..15 {
            let difference = scaled(twenty[(i, j)], i, j) - scaled(p[(i, j)], i, j);
            assert!(difference.abs() < 1e-7, "step {step}, {i},{j}");
        }
    }
}

/// The dense 15-state filter equals the 20-state filter with frozen DVL states.
#[test]
fn fifteen_states_are_twenty_with_frozen_dvl() {
    let (turn, model, geometry) = (Turn::new(4, 0.05), Model::table_2(), janus());
    let epochs = Epochs::new(4);
    let options = Options {
        estimate_dvl: false,
        covariance_period_ns: 0,
        gate: Gate::Off,
        robust: None,
        ..Options::default()
    };
    let streams = draw(&turn, &epochs.schedule(), 3, 0, 0).unwrap();
    let mut navigator = Navigator::new(streams.initial, geometry.clone(), BeamAiding::Tight, &model, &options).unwrap();
    let mut p: P15 = model.initial_covariance(false).fixed_view::<15, 15>(0, 0).into_owned();
    for (k, imu) in streams.imu.iter().enumerate() {
        let before = navigator.state();
        navigator.push(&Event::Imu(*imu), &mut |_| {}).unwrap();
        if k == 0 {
            continue;
        }
        p = propagated(&p, &model, (&before, &streams.imu[k - 1]), (&navigator.state(), imu));
        if k % 150 == 0 {
            let ping = BeamSample {
                time_ns: imu.time_ns,
                valid: BeamMask::all(2),
                ..streams.pings[0]
            };
            let inn = {
                let mut filter = navigator.clone();
                let filter = filter.filter_mut();
                filter.with_motion(|motion| tightly_coupled(&beam_terms(motion, &geometry, &ping), &ping))
            };
            let before = navigator.state();
            navigator.push(&Event::Beams(ping), &mut |_| {}).unwrap();
            let h = inn.jacobian.fixed_view::<2, 15>(0, 0).into_owned();
            let r = inn.noise.fixed_view::<2, 2>(0, 0).into_owned();
            let s = h * p * h.transpose() + r;
            let gain = p * h.transpose() * s.try_inverse().unwrap();
            let delta = gain * inn.residual.fixed_rows::<2>(0);
            p = (P15::identity() - gain * h) * p;
            let moved = navigator.state().error_of(&before);
            let expected = SVector::<f64, 15>::from_fn(|i, _| delta[i]);
            assert!((moved.fixed_rows::<15>(0) - expected).amax() < 1e-9 * expected.amax());
        }
        let twenty = navigator.covariance();
        assert_equal_covariances(&twenty, &p, k);
        assert_eq!(twenty.fixed_columns::<5>(15).amax(), 0.0, "frozen");
    }
}
