//! The fixed-interval smoother: what the whole log says of each sample, in the form of Bryson and Frazier, modified by Bierman.
//!
//! While the filter runs it leaves a [`Tape`]: the transition composed between updates, what each update used, and state and
//! covariance at the samples. The backward pass carries an adjoint (λ, Λ) from the last update to the first:
//!
//! - over a transition: λ ← Φᵀλ, Λ ← ΦᵀΛΦ;
//! - over an update: λ ← (I − K H)ᵀλ − HᵀS⁻¹z, Λ ← (I − K H)ᵀΛ(I − K H) + HᵀS⁻¹H;
//! - at a sample: x̂ ⊕ (−P λ) and P − P Λ P.
//!
//! No covariance is inverted, so frozen states need no care, and process noise does not occur.
//!
//! # Closed loop
//! An update feeds its correction back, so the error that the filter carries on is e⁺ = e⁻ − K z of a new nominal state. The
//! adjoint follows that very error; the correction of a sample refers to the filter's nominal state at the sample and is fed in
//! once. Nothing has to be added up over the resets.
//!
//! # Noise that the filter's own error makes
//! In exact VB (Eq. 26) and in the rows on the motion through the water, n holds errors that the filter carries: n = D δx + D_w δw
//! + independent. Going back, these are followed like H's own: H + D stands for H, and the further states for six more rows of λ.
//!
//! # Source
//! Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18 (1973) 65–75.

use nalgebra::{DMatrix, DVector};

use crate::error::{NavError, require_finite};
use crate::filter::tape::{Step, Tape};
use crate::layout::DIM;
use crate::state::{Covariance, ErrorVector, NavState};

/// A sample of the filter with what the whole log says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    /// The estimate from the whole log.
    pub state: NavState,
    /// Its covariance.
    pub covariance: Covariance,
}

/// λ and Λ.
#[derive(Debug, Clone)]
struct Adjoint {
    vector: DVector<f64>,
    matrix: DMatrix<f64>,
}

impl Adjoint {
    fn zeros(states: usize) -> Self {
        Self {
            vector: DVector::zeros(states),
            matrix: DMatrix::zeros(states, states),
        }
    }

    /// The same for more states, of which nothing later has been measured, or for fewer: states that began in between began
    /// independent of the others, so what was measured of them says nothing of what was before.
    fn over(self, states: usize) -> Self {
        Self {
            vector: self.vector.resize_vertically(states, 0.0),
            matrix: self.matrix.resize(states, states, 0.0),
        }
    }

    /// λ ← Aᵀλ, Λ ← AᵀΛA.
    fn through(&self, a: &DMatrix<f64>) -> Self {
        let matrix = a.transpose() * &self.matrix * a;
        Self {
            vector: a.transpose() * &self.vector,
            matrix: (&matrix + matrix.transpose()) * 0.5,
        }
    }
}

/// Goes back over the tape; the samples come out in their order.
///
/// After the last update a sample is the filter's own, bit for bit.
///
/// # Errors
/// [`NavError::NotFinite`] where the transition to a sample cannot be undone: an inertial stream with a gap that leaves nothing
/// of a state.
pub fn smooth(tape: Tape) -> Result<Vec<Smoothed>, NavError> {
    let mut adjoint: Option<Adjoint> = None;
    let mut samples = Vec::new();
    for step in tape.steps.into_iter().rev() {
        match step {
            Step::Carry(phi) => adjoint = adjoint.map(|adjoint| adjoint.over(phi.nrows()).through(&phi)),
            Step::Update {
                weighted,
                weight,
                h,
                gain,
            } => {
                let states = h.ncols();
                let later = adjoint.unwrap_or_else(|| Adjoint::zeros(states)).over(states);
                let mut before = later.through(&(DMatrix::identity(states, states) - gain * &h));
                before.vector -= h.transpose() * weighted;
                before.matrix += h.transpose() * weight * &h;
                adjoint = Some(before);
            }
            Step::Sample {
                pending,
                state,
                covariance,
            } => {
                samples.push(smoothed(*state, &covariance, adjoint.as_ref(), pending)?);
            }
        }
    }
    samples.reverse();
    Ok(samples)
}
/// x̂ ⊕ (−P λ) and P − P Λ P, with the adjoint brought forward over `pending`: λ there is Φ⁻ᵀ times λ at the entry before.
fn smoothed(
    mut state: NavState,
    covariance: &DMatrix<f64>,
    adjoint: Option<&Adjoint>,
    pending: DMatrix<f64>,
) -> Result<Smoothed, NavError> {
    let own = |p: &DMatrix<f64>| Covariance::from(p.fixed_view::<DIM, DIM>(0, 0));
    let Some(adjoint) = adjoint else {
        return Ok(Smoothed {
            state,
            covariance: own(covariance),
        });
    };
    let (states, time_ns) = (pending.nrows(), state.time_ns);
    let back = pending.try_inverse().ok_or(NavError::NotFinite {
        field: "smoother transition",
        time_ns,
    })?;
    let here = adjoint.clone().over(states).through(&back);
    let correction = -(covariance * &here.vector);
    let p = covariance - covariance * &here.matrix * covariance;
    require_finite("smoothed state", time_ns, correction.as_slice())?;
    require_finite("smoothed covariance", time_ns, p.as_slice())?;
    state.inject(&ErrorVector::from_iterator(correction.iter().copied()));
    Ok(Smoothed {
        state,
        covariance: own(&((&p + p.transpose()) * 0.5)),
    })
}

#[cfg(test)]
mod tests;
