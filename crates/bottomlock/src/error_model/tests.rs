//! Witnesses of F, G and the propagation: finite differences of the nonlinear model, dense products, Van Loan, lanes.

use proptest::prelude::*;

use super::covariance::complete;
use super::*;
use crate::earth::in_lanes;
use crate::mechanisation::derivatives;
use crate::simd::{Lanes, Simd, WIDEST, f64x4, gather, on_one_level};
use crate::testing::*;

type Dense = SMatrix<f64, DIM, DIM>;

fn dense(rows: [[f64; DIM]; DIM]) -> Dense {
    Dense::from_fn(|i, j| rows[i][j])
}

pub(super) fn state(pitch: f64, roll: f64, yaw: f64, velocity: [f64; 3]) -> NavState {
    let mut state = NavState::at_rest(0);
    state.attitude_t_p = Rot::from_euler_rad(roll, pitch, yaw);
    state.velocity_p_mps = Vec3::from_array(velocity);
    state.accel_bias_p_mps2 = Vec3::new(0.01, -0.02, 0.03);
    state.gyro_bias_p_radps = Vec3::new(1e-4, 2e-4, -3e-4);
    state
}

fn real() -> EarthTerms<f64> {
    EarthTerms::from(&Environment::normal(0.57, 0.0))
}

/// Faster than the Earth and about all three axes, so that each of its terms is seen.
fn turning() -> EarthTerms<f64> {
    EarthTerms {
        rate_t: [0.2, -0.3, 0.1],
        gravity_t: [0.0, 0.0, 9.8],
        gradient_t: None,
    }
}

/// Rate of the error δx = x ⊖ x̂ when truth and estimate both follow the nonlinear mechanisation.
fn error_rate(
    estimate: &NavState,
    error: &ErrorVector,
    rate: [f64; 3],
    force: [f64; 3],
    earth: &EarthTerms<f64>,
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
    let earth = turning();
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
    let earth = real();
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

fn sample_coefficients() -> (EarthTerms<f64>, Coefficients<f64>) {
    let earth = real();
    let inertial = Inertial {
        rate_p_radps: [0.01, 0.02, 0.05],
        force_p_mps2: [0.1, 0.2, -9.8],
    };
    let kinematics = state(0.3, -0.2, 1.0, [2.0, 0.1, -0.3]).kinematics();
    (earth, Coefficients::at(&kinematics, &inertial, &earth))
}

pub(super) fn sample_covariance() -> Covariance {
    let a = Covariance::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin() * 0.1);
    a * a.transpose() + Covariance::identity() * 0.01
}

pub(super) const NOISE: ProcessNoise = ProcessNoise {
    accel: 1.4e-6,
    gyro: 1e-8,
    accel_bias: 1e-10,
    gyro_bias: 2e-13,
    dvl_bias: 2.5e-9,
    dvl_scale: 2.5e-9,
};

/// A dive through waves: readings that change fast, of vehicle k, at time `t`, s.
fn wavy(k: usize, t: f64) -> Inertial<f64> {
    let (w, k) = (18.0, k as f64);
    Inertial {
        rate_p_radps: [0.3 * (w * t).sin(), 0.02 * k - 0.2 * (w * t).cos(), 0.05],
        force_p_mps2: [0.3 + 0.1 * k, 2.0 * (w * t).sin(), -9.7 + (w * t).cos()],
    }
}

/// A flight of `steps` steps of `dt_s`: the interval, its end, and the time-ordered product of the steps' own transitions.
pub(super) fn flown(k: usize, steps: usize, dt_s: f64, many_steps: bool) -> (Interval, Kinematics<f64>, Dense) {
    let earth = real();
    let mut kinematics = state(0.3 + 0.1 * k as f64, -0.2, 1.0, [2.0, 0.1 * k as f64, -0.3]).kinematics();
    let mut interval = Interval::begin(&kinematics, &earth, many_steps);
    let mut product = Dense::identity();
    for n in 0..steps {
        let (first, last) = (wavy(k, n as f64 * dt_s), wavy(k, (n + 1) as f64 * dt_s));
        let (before, f0) = (kinematics, Coefficients::at(&kinematics, &first, &earth));
        kinematics.step(&first, &last, dt_s, &earth);
        interval.extend(&before, &kinematics, &first, &last, dt_s, &earth);
        let f1 = Coefficients::at(&kinematics, &last, &earth);
        let f = (dense(f0.dense(&earth)) + dense(f1.dense(&earth))) * (0.5 * dt_s);
        product = (Dense::identity() + f + f * f * 0.5) * product;
    }
    (interval, kinematics, product)
}

/// The largest difference of two transitions in standard deviations of a filter that is at work.
fn gap_in_sigmas(a: &Dense, b: &Dense) -> f64 {
    let sd = |k: usize| [0.1, 1e-3, 1e-2, 5e-3, 1.5e-5, 5e-3, 5e-3][k / 3];
    let scaled = Dense::from_fn(|i, j| (a[(i, j)] - b[(i, j)]) * sd(j) / sd(i));
    scaled.amax()
}

pub(super) fn dense_transition(interval: &Interval, end: &Kinematics<f64>, earth: &EarthTerms<f64>) -> Dense {
    let mut phi = Dense::identity();
    interval.carry(&mut phi.data.0, end, earth);
    phi
}

/// One step: Φ is I + F T with the mean of F at its ends, and the structured product is the dense one, exactly symmetric.
#[test]
fn a_step_is_the_dense_first_order() {
    let dt_s = 1.0 / 150.0;
    let earth = real();
    let (mut interval, end, _) = flown(0, 1, dt_s, false);
    let start = state(0.3, -0.2, 1.0, [2.0, 0.0, -0.3]).kinematics();
    let f0 = Coefficients::at(&start, &wavy(0, 0.0), &earth);
    let f1 = Coefficients::at(&end, &wavy(0, dt_s), &earth);
    let phi = Dense::identity() + (dense(f0.dense(&earth)) + dense(f1.dense(&earth))) * (0.5 * dt_s);
    assert!((dense_transition(&interval, &end, &earth) - phi).amax() < 1e-15);

    // The noise at the means of R and v, half before and half after.
    let mean = Coefficients::scaled_sum(&f0, &f1, 0.5);
    let q = dense(dense_noise(&mean, &NOISE)) * dt_s;
    let p = sample_covariance();
    let expected = phi * (p + q * 0.5) * phi.transpose() + q * 0.5;
    let mut structured = p;
    interval.propagate(&mut structured.data.0, &end, &NOISE, &earth);
    assert!((structured - expected).amax() < 1e-14 * expected.amax().max(1.0));
    assert_eq!(structured, structured.transpose());
    assert_eq!(interval.duration_s(), 0.0);
}

/// With averaged samples the reading jumps from step to step: each step takes its own at both of its ends.
#[test]
fn a_step_takes_its_own_reading() {
    let dt_s = 1.0 / 150.0;
    let earth = real();
    let mut kinematics = state(0.3, -0.2, 1.0, [2.0, 0.0, -0.3]).kinematics();
    let mut interval = Interval::begin(&kinematics, &earth, false);
    let mut expected = Dense::identity();
    for n in 0..3 {
        let (before, own) = (kinematics, wavy(0, 0.4 * f64::from(n)));
        kinematics.step(&own, &own, dt_s, &earth);
        interval.extend(&before, &kinematics, &own, &own, dt_s, &earth);
        for end in [before, kinematics] {
            expected += dense(Coefficients::at(&end, &own, &earth).dense(&earth)) * (0.5 * dt_s);
        }
    }
    assert!((dense_transition(&interval, &kinematics, &earth) - expected).amax() < 1e-15);
}

/// An interval of many steps: its structured product is the dense one, with the noise of each end on its own side.
#[test]
fn many_steps_are_their_dense_transition() {
    let earth = real();
    let (mut interval, end, _) = flown(0, 15, 1.0 / 150.0, true);
    let phi = dense_transition(&interval, &end, &earth);
    let start = state(0.3, -0.2, 1.0, [2.0, 0.0, -0.3]).kinematics();
    let noise_at = |kinematics: &Kinematics<f64>| {
        let coefficients = Coefficients::at(kinematics, &wavy(0, 0.0), &earth);
        dense(dense_noise(&coefficients, &NOISE)) * (0.5 * interval.duration_s())
    };
    let p = sample_covariance();
    let expected = phi * (p + noise_at(&start)) * phi.transpose() + noise_at(&end);
    let mut structured = p;
    interval.propagate(&mut structured.data.0, &end, &NOISE, &earth);
    assert!((structured - expected).amax() < 1e-14 * expected.amax().max(1.0));
    assert_eq!(structured, structured.transpose());
    assert_eq!(interval.duration_s(), 0.0);
}

/// Van Loan's identity: the exact Qd solves F Qd + Qd Fᵀ + Q = Φ Q Φᵀ. The trapezoid's local error is of third order, so a
/// step half as long must leave an eighth of the residual.
#[test]
fn trapezoidal_noise_satisfies_van_loan_to_its_order() {
    let (earth, coefficients) = sample_coefficients();
    let f = dense(coefficients.dense(&earth));
    let q = dense(dense_noise(&coefficients, &NOISE));
    let residual = |duration: f64| {
        let term = |sum: Dense, k| Dense::identity() + f * sum * (duration / f64::from(k));
        let phi = (1..30).rev().fold(Dense::identity(), term);
        let qd = (phi * q * phi.transpose() + q) * (0.5 * duration);
        (f * qd + qd * f.transpose() + q - phi * q * phi.transpose()).amax() / q.amax()
    };
    let (long, short) = (residual(0.1), residual(0.05));
    assert!(long < 1e-2, "{long}");
    let gain = long / short;
    assert!((7.0..9.0).contains(&gain), "third order expected: {long} {short}");
}

/// An interval of many steps against the time-ordered product of 0.1 ms steps, while the platform shakes at 3 Hz: its local error is of third
/// order, so one half as long leaves an eighth; first order at every step of 150 Hz is far worse.
#[test]
fn many_steps_follow_a_shaking_platform() {
    let earth = real();
    let gap = |duration_s: f64| {
        let (interval, end, exact) = flown(0, (duration_s * 1e4).round() as usize, 1e-4, true);
        gap_in_sigmas(&dense_transition(&interval, &end, &earth), &exact)
    };
    let (long, short) = (gap(0.1), gap(0.05));
    assert!(long < 1e-5, "{long}");
    assert!(
        (5.0..12.0).contains(&(long / short)),
        "third order expected: {long} {short}"
    );

    let (_, _, exact) = flown(0, 1000, 1e-4, true);
    let mut first_order = Dense::identity();
    let mut kinematics = state(0.3, -0.2, 1.0, [2.0, 0.0, -0.3]).kinematics();
    for n in 0..15 {
        let at = |n: usize| wavy(0, n as f64 / 150.0);
        let mut step = Interval::begin(&kinematics, &earth, false);
        let before = kinematics;
        kinematics.step(&at(n), &at(n + 1), 1.0 / 150.0, &earth);
        step.extend(&before, &kinematics, &at(n), &at(n + 1), 1.0 / 150.0, &earth);
        first_order = dense_transition(&step, &kinematics, &earth) * first_order;
    }
    let poor = gap_in_sigmas(&first_order, &exact);
    assert!(long < 0.1 * poor, "many steps {long}, first order {poor}");
}

/// At the vertical too: no Euler angles are used. The frame turns by 0.04 rad; a term of second order that were missing would leave
/// 4e-4.
#[test]
fn many_steps_hold_near_the_vertical() {
    let earth = turning();
    let mut kinematics = state(89.9_f64.to_radians(), 0.4, -1.0, [2.0, 0.3, -0.1]).kinematics();
    let reading = wavy(0, 0.0);
    let mut interval = Interval::begin(&kinematics, &earth, true);
    let mut exact = Dense::identity();
    for _ in 0..1000 {
        let (before, f) = (kinematics, Coefficients::at(&kinematics, &reading, &earth));
        kinematics.step(&reading, &reading, 1e-4, &earth);
        interval.extend(&before, &kinematics, &reading, &reading, 1e-4, &earth);
        let f = (dense(f.dense(&earth)) + dense(Coefficients::at(&kinematics, &reading, &earth).dense(&earth))) * 5e-5;
        exact = (Dense::identity() + f + f * f * 0.5) * exact;
    }
    let gap = gap_in_sigmas(&dense_transition(&interval, &kinematics, &earth), &exact);
    assert!(gap < 2e-4, "{gap}");
}

/// Covariances side by side have the bits of each alone.
fn side_by_side<S: Simd, T: Lanes<S>, I: SideBySide<S, T>>(simd: S, many_steps: bool) {
    let earth = super::place_tests::earth().terms([3e4, -4e4, 200.0]);
    let flown: [_; WIDEST] =
        std::array::from_fn(|k| flown(k, if many_steps { 15 } else { 1 }, 1.0 / 150.0, many_steps));
    let start = sample_covariance();
    let start = (start + start.transpose()) * 0.5;
    let mut lanes = I::gathered(simd, &flown.map(|(interval, ..)| interval)).unwrap();
    let ends = flown.map(|(_, end, _)| end.to_array());
    let zero = T::gather(simd, |_| 0.0);
    let mut p: Matrix<T> = std::array::from_fn(|i| std::array::from_fn(|j| zero.splat(start[(i, j)])));
    let ends_side_by_side = Kinematics::from_array(gather(simd, ends.each_ref()));
    lanes.propagate(simd, &mut p, &ends_side_by_side, &NOISE, &in_lanes(&earth, zero));
    complete(&mut p);
    for k in 0..T::COUNT {
        let (mut interval, end, _) = flown[k];
        let mut alone = start;
        interval.propagate(&mut alone.data.0, &end, &NOISE, &earth);
        for i in 0..DIM {
            for j in 0..DIM {
                let bits = [alone[(i, j)], alone[(j, i)]].map(f64::to_bits);
                assert_eq!(bits, [p[i][j].get(k).to_bits(); 2], "lane {k}, element {i} {j}");
            }
        }
    }
}

/// With other vectors too, by the tests of filter groups.
#[test]
fn lanes_equal_scalars_bit_for_bit() {
    on_one_level!(simd => side_by_side::<_, f64x4<_>, FirstOrderInterval<_>>(simd, false));
    on_one_level!(simd => side_by_side::<_, f64x4<_>, SecondOrderInterval<_>>(simd, true));
}

/// The covariance is due at the step whose end is nearest to the period: the fifteenth of 150 Hz in 0.1 s.
#[test]
fn due_at_the_nearest_step() {
    let dt_s = 1.0 / 150.0;
    for many_steps in [false, true] {
        let is_due = |steps: usize| match flown(0, steps, dt_s, many_steps).0 {
            Interval::FirstOrder(interval) => interval.is_due(dt_s, 0.1),
            Interval::SecondOrder(interval) => interval.is_due(dt_s, 0.1),
            Interval::Open => false,
        };
        assert_eq!([1, 14, 15, 16].map(is_due), [false, false, true, true]);
    }
}
