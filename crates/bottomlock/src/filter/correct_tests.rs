//! The vectorised arithmetic against nalgebra's.

use super::*;

fn sample(seed: usize) -> Covariance {
    let spread = Covariance::from_fn(|i, j| ((i * 7 + j * 3 + seed) as f64).sin() * 0.3_f64.powi((i % 5) as i32));
    spread * spread.transpose() + Covariance::identity() * 0.01
}

/// Reach, gain and Joseph's form of three correlated rows are those of dense matrices.
#[test]
fn an_update_is_the_dense_update() {
    let p = sample(1);
    let h = SMatrix::<f64, 3, DIM>::from_fn(|i, j| {
        if (i + j) % 3 == 0 {
            0.0
        } else {
            ((i + 2 * j) as f64).cos()
        }
    });
    let r = SMatrix::<f64, 3, 3>::new(0.5, 0.1, 0.0, 0.1, 0.4, -0.1, 0.0, -0.1, 0.3);
    let ph = reach(&p, &h);
    assert!((ph - p * h.transpose()).amax() < 1e-14);
    let s = h * ph + r;
    let k = gain(&ph, &s.cholesky().unwrap().l());
    assert!((k * s - ph).amax() < 1e-12);
    let left = Covariance::identity() - k * h;
    let dense = left * p * left.transpose() + k * r * k.transpose();
    assert!((symmetric(&joseph(&p, &ph, &k, &h, &r)) - dense).amax() < 1e-12);
}

/// A factorisation exists where nalgebra's does: frozen states do not count, and one slightly negative direction does.
#[test]
fn definite_is_what_factorises() {
    let mut p = sample(2);
    assert!(is_positive_definite(&p));
    for k in 15..DIM {
        p.row_mut(k).fill(0.0);
        p.column_mut(k).fill(0.0);
    }
    assert!(is_positive_definite(&p));
    // A frozen state that is correlated with others is no state.
    let mut torn = p;
    torn[(0, 17)] = 1e-3;
    torn[(17, 0)] = 1e-3;
    assert!(!is_positive_definite(&torn));
    let mut eigen = sample(3).symmetric_eigen();
    for (smallest, expected) in [(1e-6, true), (-1e-6, false)] {
        eigen.eigenvalues[7] = smallest;
        let q = eigen.eigenvectors;
        let matrix = symmetric(&(q * Covariance::from_diagonal(&eigen.eigenvalues) * q.transpose()));
        assert_eq!(is_positive_definite(&matrix), expected);
        assert_eq!(matrix.cholesky().is_some(), expected);
    }
    let mut broken = p;
    broken[(3, 3)] = f64::NAN;
    assert!(!is_positive_definite(&broken));
}
