//! F, Φ and covariance where gravity depends on the position.

use super::tests::{NOISE, dense_transition, flown, sample_covariance, state};
use super::*;
use crate::mechanisation::derivatives;
use crate::testing::*;

const FAR: [f64; 3] = [-30e3, 45e3, 900.0];

pub(super) fn earth() -> Earth {
    Earth::from(&Environment::normal(0.8, 0.0).on(EarthModel::Ellipsoid))
}

/// The rows of the velocity, by central differences of v̇ with gravity at the moved place.
#[test]
fn f_is_the_derivative_at_a_place() {
    let mut center = state(0.4, -0.3, 2.0, [2.0, 0.3, -0.1]);
    center.position_t_m = Vec3::from_array(FAR);
    let inertial = Inertial {
        rate_p_radps: [0.1, -0.2, 0.05],
        force_p_mps2: [0.4, -0.1, -9.7],
    };
    let terms = earth().terms(FAR);
    let f = Coefficients::at(&center.kinematics(), &inertial, &terms).dense(&terms);
    let at = |error: &ErrorVector| {
        let mut moved = center;
        moved.inject(error);
        let here = earth().terms(moved.position_t_m.to_array());
        derivatives(&moved.kinematics(), &inertial, &here).2
    };
    for (column, step) in (POSITION..POSITION + 3)
        .map(|j| (j, 20.0))
        .chain((ATTITUDE..ATTITUDE + 3).map(|j| (j, 1e-5)))
    {
        let mut error = ErrorVector::zeros();
        error[column] = step;
        let (ahead, behind) = (at(&error), at(&-error));
        for row in 0..3 {
            let slope = (ahead[row] - behind[row]) / (2.0 * step);
            let allowed = if column < ATTITUDE { 2e-12 } else { 1e-8 };
            assert!((slope - f[VELOCITY + row][column]).abs() < allowed, "{row} {column}");
        }
    }
}

/// With gradient Φ is S Φ₀: its velocity by position is Rᵀ ∂g/∂p T, and its determinant is that of Φ₀.
#[test]
fn phi_with_gradient_is_the_exponential() {
    for many_steps in [false, true] {
        let steps = if many_steps { 15 } else { 1 };
        let (interval, end, _) = flown(1, steps, 1.0 / 150.0, many_steps);
        let with = earth().terms(FAR);
        let mut without = with;
        without.gradient_t = Some([[0.0; 3]; 3]);
        let (phi, plain) = (
            dense_transition(&interval, &end, &with),
            dense_transition(&interval, &end, &without),
        );
        let duration = interval.duration_s();
        let gradient = with.gradient_t.unwrap();
        let expected = mat_mul(&transposed(&end.rotation_t_p), &gradient);
        for i in 0..3 {
            for j in 0..3 {
                let own = phi[(VELOCITY + i, POSITION + j)];
                assert!((own / duration - expected[i][j]).abs() < 1e-18, "{i} {j}");
                assert!(plain[(VELOCITY + i, POSITION + j)] == 0.0);
            }
        }
        // Elsewhere it differs by ∂g/∂p T² and less.
        let mut rest = phi - plain;
        rest.fixed_view_mut::<3, 3>(VELOCITY, POSITION).fill(0.0);
        assert!(rest.amax() < 3e-5 * duration * duration && rest.amax() > 0.0);
        assert!((phi.determinant() / plain.determinant() - 1.0).abs() < 1e-12);
    }
}

/// P with the gradient is Φ P Φᵀ + Q, symmetric to the bit.
#[test]
fn a_covariance_with_gradient_is_the_dense_product() {
    let with = earth().terms(FAR);
    let (interval, end, _) = flown(2, 15, 1.0 / 150.0, true);
    let phi = dense_transition(&interval, &end, &with);
    let start = sample_covariance();
    let start = (start + start.transpose()) * 0.5;
    let (mut noisy, mut quiet) = (start, Covariance::zeros());
    let mut own = interval;
    own.propagate(&mut noisy.data.0, &end, &NOISE, &with);
    let mut own = interval;
    own.propagate(&mut quiet.data.0, &end, &NOISE, &with);
    let dense = phi * start * phi.transpose() + quiet;
    assert!((noisy - dense).amax() < 1e-12 * dense.amax());
    assert_eq!(noisy, noisy.transpose());
}
