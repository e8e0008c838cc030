//! Witnesses of F, G and the propagation: finite differences of the nonlinear model, dense products, Van Loan, lanes.

use nalgebra::{SMatrix, Vector3};
use proptest::prelude::*;

use super::*;
use crate::earth::Environment;
use crate::frames::{Rot, Vec3};
use crate::imu::derivatives;
use crate::lane::{Lanes, WIDEST, on_every_level};
use crate::state::{Covariance, ErrorVector, NavState};
use fearless_simd::{Simd, f64x4, f64x8};

type Dense = SMatrix<f64, DIM, DIM>;

fn dense(rows: [[f64; DIM]; DIM]) -> Dense {
    Dense::from_fn(|i, j| rows[i][j])
}

fn state(pitch: f64, roll: f64, yaw: f64, velocity: [f64; 3]) -> NavState {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(roll, pitch, yaw);
    state.velocity_p_mps = Vec3::from_array(velocity);
    state.accel_bias_p_mps2 = Vec3::new(0.01, -0.02, 0.03);
    state.gyro_bias_p_radps = Vec3::new(1e-4, 2e-4, -3e-4);
    state
}

/// Rate of the error δx = x ⊖ x̂ when truth and estimate both follow the nonlinear mechanisation.
fn error_rate(
    estimate: &NavState,
    error: &ErrorVector,
    rate: [f64; 3],
    force: [f64; 3],
    earth: &EarthTerms,
) -> ErrorVector {
    let mut truth = *estimate;
    truth.inject(error);
    let flow = |s: &NavState| {
        let inertial = Inertial {
            rate_p_radps: std::array::from_fn(|i| rate[i] - s.gyro_bias_p_radps.0[i]),
            force_p_mps2: std::array::from_fn(|i| force[i] - s.accel_bias_p_mps2.0[i]),
        };
        let kinematics = s.kinematics();
        let (r, w, v) = derivatives(&kinematics, &inertial, earth);
        (
            Vector3::from(r),
            s.attitude_t_p.matrix() * Vector3::from(w),
            Vector3::from(v),
        )
    };
    let ((r1, w1, v1), (r0, w0, v0)) = (flow(&truth), flow(estimate));
    let mut out = ErrorVector::zeros();
    out.fixed_rows_mut::<3>(POSITION).copy_from(&(r1 - r0));
    // Exp(ρ) = R R̂ᵀ turns with ω_tp(true) − Exp(ρ) ω_tp(estimate), both in the tangent frame.
    let rho = Vector3::new(error[3], error[4], error[5]);
    let relative = w1 - Rot::<(), ()>::exp(rho).matrix() * w0;
    // ρ̇ = J⁻¹ relative; J⁻¹ = I − [ρ×]/2 to first order, exact in the central difference's limit.
    let spin = relative - 0.5 * rho.cross(&relative);
    out.fixed_rows_mut::<3>(ATTITUDE).copy_from(&spin);
    out.fixed_rows_mut::<3>(VELOCITY).copy_from(&(v1 - v0));
    out
}

fn check_f(pitch: f64, roll: f64, yaw: f64, velocity: [f64; 3], rate: [f64; 3], force: [f64; 3]) {
    let earth = EarthTerms::from(&Environment::normal(0.57, 0.0));
    let estimate = state(pitch, roll, yaw, velocity);
    let inertial = Inertial {
        rate_p_radps: std::array::from_fn(|i| rate[i] - estimate.gyro_bias_p_radps.0[i]),
        force_p_mps2: std::array::from_fn(|i| force[i] - estimate.accel_bias_p_mps2.0[i]),
    };
    let f = dense(Coefficients::at(&estimate.kinematics(), &inertial, &earth).dense(&earth));
    for j in 0..DIM {
        let step = 1e-5;
        let mut error = ErrorVector::zeros();
        error[j] = step;
        let difference = (error_rate(&estimate, &error, rate, force, &earth)
            - error_rate(&estimate, &-error, rate, force, &earth))
            / (2.0 * step);
        let gap = (difference - f.column(j)).amax();
        assert!(gap < 1e-6, "column {j}: {gap}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    /// F against central differences of the nonlinear mechanisation at any attitude.
    #[test]
    fn f_is_the_derivative(pitch in -1.57..1.57, roll in -3.1..3.1, yaw in -3.1..3.1,
                           u in -5.0..5.0, v in -2.0..2.0, w in -2.0..2.0, p in -0.5..0.5, r in -0.5..0.5) {
        check_f(pitch, roll, yaw, [u, v, w], [p, 0.1, r], [0.3, -0.2, -9.7]);
    }
}

/// The vertical is no special place for a misalignment vector.
#[test]
fn f_is_the_derivative_near_the_vertical() {
    for pitch in [89.9_f64, -89.9] {
        check_f(
            pitch.to_radians(),
            0.4,
            -1.0,
            [2.0, 0.3, -0.1],
            [0.1, 0.2, -0.3],
            [0.3, -0.2, -9.7],
        );
    }
}

/// G against the derivative by the noise: gyro noise acts like minus a gyro bias on ρ and v, accelerometer noise likewise.
#[test]
fn noise_enters_like_the_biases() {
    let earth = EarthTerms::from(&Environment::normal(0.57, 0.0));
    let estimate = state(0.3, -0.2, 1.0, [2.0, 0.1, -0.3]);
    let inertial = Inertial {
        rate_p_radps: [0.01, 0.02, 0.05],
        force_p_mps2: [0.1, 0.2, -9.8],
    };
    let coefficients = Coefficients::at(&estimate.kinematics(), &inertial, &earth);
    let f = dense(coefficients.dense(&earth));
    let noise = ProcessNoise {
        accel: 2.0,
        gyro: 3.0,
        accel_bias: 5.0,
        gyro_bias: 7.0,
        dvl_bias: 11.0,
        dvl_scale: 13.0,
    };
    // G of Eq. 10: white noise enters through the bias columns of F, random walks through the identity.
    let mut g = SMatrix::<f64, DIM, 17>::zeros();
    g.fixed_view_mut::<DIM, 3>(0, 0)
        .copy_from(&f.fixed_view::<DIM, 3>(0, ACCEL_BIAS));
    g.fixed_view_mut::<DIM, 3>(0, 3)
        .copy_from(&f.fixed_view::<DIM, 3>(0, GYRO_BIAS));
    g.fixed_view_mut::<11, 11>(ACCEL_BIAS, 6).fill_with_identity();
    let density = [
        2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 5.0, 5.0, 5.0, 7.0, 7.0, 7.0, 11.0, 11.0, 11.0, 11.0, 13.0,
    ];
    let expected = g * SMatrix::<f64, 17, 17>::from_diagonal(&density.into()) * g.transpose();
    assert!((dense(dense_noise(&coefficients, &noise)) - expected).amax() < 1e-12);
}

fn sample_interval(second: bool) -> (Interval<f64>, EarthTerms, Coefficients<f64>) {
    let earth = EarthTerms::from(&Environment::normal(0.57, 0.0));
    let inertial = Inertial {
        rate_p_radps: [0.01, 0.02, 0.05],
        force_p_mps2: [0.1, 0.2, -9.8],
    };
    let mut interval = Interval::default();
    let steps = if second { 15 } else { 1 };
    let coefficients = Coefficients::at(&state(0.3, -0.2, 1.0, [2.0, 0.1, -0.3]).kinematics(), &inertial, &earth);
    interval.start(coefficients);
    for _ in 0..steps {
        interval.extend(coefficients, 1.0 / 150.0);
    }
    (interval, earth, coefficients)
}

fn sample_covariance() -> Covariance {
    let a = Covariance::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin() * 0.1);
    a * a.transpose() + Covariance::identity() * 0.01
}

const NOISE: ProcessNoise = ProcessNoise {
    accel: 1.4e-6,
    gyro: 1e-8,
    accel_bias: 1e-10,
    gyro_bias: 2e-13,
    dvl_bias: 2.5e-9,
    dvl_scale: 2.5e-9,
};

/// The structured product equals the dense one, for both orders, and its result is exactly symmetric.
#[test]
fn structured_equals_dense() {
    for second in [false, true] {
        let (mut interval, earth, coefficients) = sample_interval(second);
        let duration = interval.duration_s();
        let f = dense(coefficients.dense(&earth)) * duration;
        let mut phi = Dense::identity() + f;
        if second {
            phi += f * f * 0.5;
        }
        assert!((dense(interval.dense_transition(&earth, second)) - phi).amax() < 1e-15);
        let q = dense(dense_noise(&coefficients, &NOISE)) * duration;
        let p = sample_covariance();
        let expected = phi * (p + q * 0.5) * phi.transpose() + q * 0.5;
        let mut structured = p;
        interval.propagate(&mut structured.data.0, &NOISE, &earth, second);
        assert!((structured - expected).amax() < 1e-15 * expected.amax().max(1.0) * 10.0);
        assert_eq!(structured, structured.transpose());
        assert_eq!(interval.duration_s(), 0.0);
    }
}

/// Van Loan's identity: the exact Qd solves F Qd + Qd Fᵀ + Q = Φ Q Φᵀ. The trapezoid's local error is of third order, so a
/// step half as long must leave an eighth of the residual.
#[test]
fn trapezoidal_noise_satisfies_van_loan_to_its_order() {
    let (_, earth, coefficients) = sample_interval(true);
    let f = dense(coefficients.dense(&earth));
    let q = dense(dense_noise(&coefficients, &NOISE));
    let residual = |duration: f64| {
        let phi = (f * duration).exp();
        let qd = (phi * q * phi.transpose() + q) * (0.5 * duration);
        (f * qd + qd * f.transpose() + q - phi * q * phi.transpose()).amax() / q.amax()
    };
    let (long, short) = (residual(0.1), residual(0.05));
    assert!(long < 1e-2, "{long}");
    assert!(
        (7.0..9.0).contains(&(long / short)),
        "third order expected: {long} {short}"
    );
}

/// Averaged second order at 10 Hz is closer to the exact exponential than first order at 150 Hz.
#[test]
fn second_order_at_10_hz_beats_first_order_at_150_hz() {
    let (interval, earth, coefficients) = sample_interval(true);
    let exact = (dense(coefficients.dense(&earth)) * 0.1).exp();
    let second = dense(interval.dense_transition(&earth, true));
    let (one, _, _) = sample_interval(false);
    let first = dense(one.dense_transition(&earth, false)).pow(15);
    let (good, poor) = ((second - exact).amax(), (first - exact).amax());
    assert!(good < poor, "second order {good}, first order {poor}");
}

fn flown(k: usize, earth: &EarthTerms) -> Interval<f64> {
    let kinematics = state(0.3 + 0.1 * k as f64, 0.2, 1.0, [2.0, 0.1 * k as f64, 0.0]).kinematics();
    let inertial = Inertial {
        rate_p_radps: [0.01, 0.02, 0.05 * k as f64],
        force_p_mps2: [0.1, 0.2, -9.8],
    };
    let mut interval = Interval::default();
    interval.extend(Coefficients::at(&kinematics, &inertial, earth), 0.1);
    interval
}

fn side_by_side<S: Simd, T: Lanes<S>>(simd: S) {
    let earth = EarthTerms::from(&Environment::normal(0.57, 0.0));
    let flown: [Interval<f64>; WIDEST] = std::array::from_fn(|k| flown(k, &earth));
    for second in [false, true] {
        let start = sample_covariance();
        let mut lanes: Interval<T> = Interval::gather(simd, &flown.each_ref());
        let zero = T::gather(simd, |_| 0.0);
        let mut p = start.data.0.map(|column| column.map(|value| zero.splat(value)));
        lanes.propagate(&mut p, &NOISE, &earth, second);
        for k in 0..T::COUNT {
            let (mut scalar, mut columns) = (start, start);
            flown[k].clone().propagate(&mut scalar.data.0, &NOISE, &earth, second);
            flown[k]
                .clone()
                .propagate_one(&mut columns.data.0, &NOISE, &earth, second);
            for i in 0..DIM {
                for j in 0..DIM {
                    assert_eq!(p[i][j].get(k).to_bits(), scalar.data.0[i][j].to_bits());
                    assert_eq!(columns.data.0[i][j].to_bits(), scalar.data.0[i][j].to_bits());
                }
            }
        }
    }
}

/// Covariances side by side, and one covariance with its columns side by side, give the bits of scalar ones.
#[test]
fn lanes_equal_scalars_bit_for_bit() {
    on_every_level!(simd => side_by_side::<_, f64x4<_>>(simd));
    on_every_level!(simd => side_by_side::<_, f64x8<_>>(simd));
}
