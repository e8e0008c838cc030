//! What redundant beams measure beside the velocity: their closure.
//!
//! # Equations
//! m valid beams with directions B (rank r), residuals z = H δx + n and noise R = L Lᵀ. The columns of L⁻¹B span r of m directions;
//! with Q an orthonormal basis of the others, C = QᵀL⁻¹ has C B = 0 and C R Cᵀ = I. The least-squares velocity v̂ = J z has
//! J R Cᵀ = 0, since J is a combination of BᵀR⁻¹. So v̂ and the closure C z are an invertible recombination of the beams, with
//! independent noise, and together say what the beams say. For a Janus C is (1, −1, 1, −1)/2σ. The velocity cancels in C z, the
//! beams' biases and lever arms do not.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::aiding::beams::BeamTerms;
use crate::aiding::{Innovation, MAX_ROWS};
use crate::dvl::geometry::BeamMask;
use crate::layout::VELOCITY;

/// Appends the closure of the valid beams, m/s over m/s, to the rows of a velocity that is solved from them.
///
/// `rank` is that of the beams' directions. Nothing is appended where no beam is redundant.
pub(crate) fn push_closure(innovation: &mut Innovation, terms: &BeamTerms, valid: BeamMask, rank: usize) {
    let beams: Vec<usize> = valid.iter().filter(|&beam| beam < MAX_ROWS).collect();
    let count = beams.len();
    if count <= rank {
        return;
    }
    let noise = DMatrix::from_fn(count, count, |i, j| terms.noise[(beams[i], beams[j])]);
    let directions = DMatrix::from_fn(count, count.max(3), |i, k| match k {
        0..3 => terms.jacobian[(beams[i], VELOCITY + k)],
        _ => 0.0,
    });
    // What is not positive definite has been refused by the least squares.
    let Some(factor) = Cholesky::new(noise).map(|factor| factor.l()) else {
        return;
    };
    let Some(whitened) = factor.solve_lower_triangular(&directions) else {
        return;
    };
    let basis = whitened.col_piv_qr().q();
    for direction in rank..count {
        let unit: DVector<f64> = basis.column(direction).into_owned();
        let Some(weights) = factor.tr_solve_lower_triangular(&unit) else {
            return;
        };
        let row = innovation.rows;
        innovation.rows += 1;
        innovation.degrees += 1;
        innovation.noise[(row, row)] = 1.0;
        for (&beam, &weight) in beams.iter().zip(&weights) {
            innovation.residual[row] += weight * terms.residual[beam];
            let mut into = innovation.jacobian.row_mut(row);
            into += terms.jacobian.row(beam) * weight;
            if let (Some(into), Some(from)) = (&mut innovation.by_further, &terms.by_further) {
                let mut into = into.row_mut(row);
                into += from.row(beam) * weight;
            }
        }
    }
}

#[cfg(test)]
#[path = "closure_tests.rs"]
mod tests;
