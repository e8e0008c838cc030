//! Test for a positive definite covariance: every pivot of its factorisation L D Lᵀ is positive.
//!
//! States of different units need no scaling to unit diagonal, since scaling multiplies each pivot and its rounding
//! errors by the same positive number. Whether the factorisation succeeds depends on the smallest eigenvalue of the
//! *scaled* matrix, whichever matrix is factorised (Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed.,
//! theorem 10.7, after Demmel).
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 1.2 times as long at `methods 8`, and 1.6 times at
//! `methods_10hz 8`.

use crate::layout::DIM;
use crate::simd::{Simd, VECTORS, WIDTH, f64x4, four, load_part, plus, with_vectors};
use crate::state::Covariance;

/// Returns true if the factorisation of a symmetric matrix exists; frozen states (zero rows) are left out.
pub(super) fn is_positive_definite(covariance: &Covariance) -> bool {
    with_vectors!(simd => factorises(simd, &covariance.data.0))
}

/// As [`is_positive_definite`], within a SIMD dispatch; only elements on and below the diagonal are read.
#[inline(always)]
pub(super) fn factorises<S: Simd>(simd: S, matrix: &[[f64; DIM]; DIM]) -> bool {
    let Some(a) = panel::<S, 0>(simd, matrix, []) else {
        return false;
    };
    let Some(b) = panel::<S, 1>(simd, matrix, [&a]) else {
        return false;
    };
    let Some(c) = panel::<S, 2>(simd, matrix, [&a, &b]) else {
        return false;
    };
    let Some(d) = panel::<S, 3>(simd, matrix, [&a, &b, &c]) else {
        return false;
    };
    panel::<S, 4>(simd, matrix, [&a, &b, &c, &d]).is_some()
}

/// Four columns of the factors; elements above the diagonal are undefined.
struct Panel<S: Simd> {
    minus_l: [[f64x4<S>; VECTORS]; WIDTH],
    l_d: [[f64x4<S>; VECTORS]; WIDTH],
}

/// The columns `4 B..4 B + 4`, from the panels before them; `None` if a pivot is not positive.
#[inline(always)]
fn panel<S: Simd, const B: usize>(simd: S, matrix: &[[f64; DIM]; DIM], before: [&Panel<S>; B]) -> Option<Panel<S>> {
    let zero = [four(simd, 0.0); VECTORS];
    let mut own = [zero; WIDTH];
    for q in 0..WIDTH {
        for v in B..VECTORS {
            own[q][v] = load_part(simd, &matrix[WIDTH * B + q], v);
        }
    }
    for panel in before {
        for k in 0..WIDTH {
            for q in 0..WIDTH {
                let multiple = panel.l_d[k][B][q];
                for v in B..VECTORS {
                    own[q][v] = plus(own[q][v], multiple, panel.minus_l[k][v]);
                }
            }
        }
    }
    let mut minus_l = own;
    for q in 0..WIDTH {
        let pivot = own[q][B][q];
        // Products with the reciprocal cost one division per pivot.
        let mut inverse = four(simd, -1.0) / pivot;
        if !(pivot > 0.0) {
            if !is_frozen(matrix, WIDTH * B + q) {
                return None;
            }
            own[q] = zero;
            inverse = four(simd, 0.0);
        }
        for v in B..VECTORS {
            minus_l[q][v] = own[q][v] * inverse;
        }
        for later in q + 1..WIDTH {
            let multiple = own[q][B][later];
            for v in B..VECTORS {
                own[later][v] = plus(own[later][v], multiple, minus_l[q][v]);
            }
        }
    }
    Some(Panel { minus_l, l_d: own })
}

/// Returns true for a frozen state, whose row and column are zero.
fn is_frozen(matrix: &[[f64; DIM]; DIM], state: usize) -> bool {
    matrix[state][state..].iter().all(|element| *element == 0.0)
        && matrix[..state].iter().all(|column| column[state] == 0.0)
}

#[cfg(test)]
#[path = "definite_tests.rs"]
mod tests;
