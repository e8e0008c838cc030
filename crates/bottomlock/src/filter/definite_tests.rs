//! The test for a positive definite matrix against nalgebra's factorisation, with scaled and frozen states.

use super::*;
use crate::simd::on_every_level;

/// A random symmetric matrix of unit scale with a given smallest eigenvalue.
fn with_smallest(seed: usize, smallest: f64) -> Covariance {
    let spread = Covariance::from_fn(|i, j| ((i * 7 + j * 3 + seed) as f64 * 1.7).sin());
    let mut eigen = (spread * spread.transpose()).symmetric_eigen();
    for (k, value) in eigen.eigenvalues.iter_mut().enumerate() {
        *value = 0.1 + 0.1 * k as f64;
    }
    eigen.eigenvalues[seed % DIM] = smallest;
    let q = eigen.eigenvectors;
    let matrix = q * Covariance::from_diagonal(&eigen.eigenvalues) * q.transpose();
    (matrix + matrix.transpose()) * 0.5
}

fn frozen(mut matrix: Covariance, states: impl Iterator<Item = usize>) -> Covariance {
    for k in states {
        matrix.row_mut(k).fill(0.0);
        matrix.column_mut(k).fill(0.0);
    }
    matrix
}

fn holds(matrix: &Covariance) -> bool {
    let expected = is_positive_definite(matrix);
    on_every_level(|| assert_eq!(is_positive_definite(matrix), expected));
    expected
}

/// A slightly negative eigenvalue is found in any direction, as by nalgebra.
#[test]
fn definite_is_what_factorises() {
    for seed in 0..2 * DIM {
        for (smallest, expected) in [
            (1e-6, true),
            (1e-12, true),
            (-1e-12, false),
            (-1e-6, false),
            (-1.0, false),
        ] {
            let matrix = with_smallest(seed, smallest);
            assert_eq!(holds(&matrix), expected, "seed {seed}, smallest {smallest}");
            assert_eq!(matrix.cholesky().is_some(), expected);
        }
    }
}

/// The result does not depend on units: variances from 1e-20 to 1e8 in any order give that of unit scale.
#[test]
fn scaling_does_not_change_the_result() {
    for seed in 0..2 * DIM {
        let scale = Covariance::from_fn(|i, j| {
            let exponent = -10.0 + 14.0 * ((i * (2 * seed + 3)) % DIM) as f64 / (DIM - 1) as f64;
            if i == j { 10_f64.powf(exponent) } else { 0.0 }
        });
        for (smallest, expected) in [(1e-6, true), (1e-12, true), (-1e-12, false), (-1e-6, false)] {
            let matrix = scale * with_smallest(seed, smallest) * scale;
            assert_eq!(holds(&matrix), expected, "seed {seed}, smallest {smallest}");
        }
    }
}

/// Frozen states are left out at any index, unless they are correlated with others.
#[test]
fn frozen_states_are_left_out() {
    for states in [vec![15, 16, 17, 18, 19], vec![0], vec![2, 3, 8, 13], (0..DIM).collect()] {
        let matrix = frozen(with_smallest(2, 1e-3), states.iter().copied());
        assert!(holds(&matrix));
        for &state in &states {
            let other = (state + 7) % DIM;
            let mut correlated = matrix;
            correlated[(state, other)] = 1e-3;
            correlated[(other, state)] = 1e-3;
            assert!(!holds(&correlated), "state {state}");
        }
    }
    // The other states must be positive definite.
    let mut matrix = with_smallest(3, 1e-3);
    matrix[(4, 4)] = -1e-9;
    assert!(!holds(&frozen(matrix, 10..DIM)));
}

/// A NaN in any element is rejected.
#[test]
fn nan_is_not_definite() {
    for i in 0..DIM {
        for j in 0..=i {
            let mut broken = with_smallest(1, 1e-3);
            broken[(i, j)] = f64::NAN;
            broken[(j, i)] = f64::NAN;
            assert!(!holds(&broken), "({i}, {j})");
        }
    }
}
