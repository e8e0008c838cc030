//! The fixed-interval smoother: the estimate of each sample from the whole log, by the Bryson–Frazier form modified by
//! Bierman.
//!
//! The filter records a [`Tape`]: the transition between updates, the matrices of each update, and state and covariance
//! at the samples. The backward pass propagates an adjoint (λ, Λ) from the last update to the first:
//!
//! - over a transition: λ ← Φᵀλ, Λ ← ΦᵀΛΦ;
//! - over an update: λ ← (I − K H)ᵀλ − HᵀS⁻¹z, Λ ← (I − K H)ᵀΛ(I − K H) + HᵀS⁻¹H;
//! - at a sample: x̂ ⊕ (−P λ) and P − P Λ P.
//!
//! No covariance is inverted, so frozen states need no special case, and process noise does not occur.
//!
//! # Closed loop
//! An update feeds its correction back, so the error after it is e⁺ = e⁻ − K z with respect to a new nominal state. The
//! adjoint refers to this error. The correction of a sample refers to the filter's nominal state at the sample and is
//! applied once; corrections are not summed over the updates.
//!
//! # Noise that depends on the error state
//! In exact VB (Eq. 26) and in the rows on the motion through the water the noise contains errors of the filter's
//! states: n = D δx + D_w δw + independent noise; that of a depth contains the sensor's bias. The backward pass uses
//! H + D in place of H, a row of λ for the bias, and six for the water states where there are any.
//!
//! # Source
//! Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18 (1973) 65–75.

use nalgebra::{DMatrix, DVector};

use crate::error::{NavError, require_finite, require_finite_squares};
use crate::filter::tape::{Step, Tape};
use crate::layout::DIM;
use crate::state::{Covariance, ErrorVector, NavState};
use crate::stop::Stop;

/// A smoothed sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothed {
    /// Estimate from the whole log.
    pub state: NavState,
    /// Covariance of the estimate.
    pub covariance: Covariance,
}

/// The adjoint: λ and Λ.
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

    /// The adjoint for another number of states.
    ///
    /// Added states have no later measurement, so their entries are zero. Removed states started independent of the
    /// others, so measurements of them carry no information on earlier times.
    fn resized(self, states: usize) -> Self {
        Self {
            vector: self.vector.resize_vertically(states, 0.0),
            matrix: self.matrix.resize(states, states, 0.0),
        }
    }

    /// λ ← Aᵀλ, Λ ← AᵀΛA.
    fn transposed_by(&self, a: &DMatrix<f64>) -> Self {
        let matrix = a.transpose() * &self.matrix * a;
        Self {
            vector: a.transpose() * &self.vector,
            matrix: (&matrix + matrix.transpose()) * 0.5,
        }
    }

    /// The adjoint before a step of the tape: over a transition Φᵀλ and ΦᵀΛΦ, over an update (I − K H)ᵀλ − HᵀS⁻¹z and
    /// (I − K H)ᵀΛ(I − K H) + HᵀS⁻¹H; `None` is zero.
    fn before(later: Option<Self>, step: &Step) -> Option<Self> {
        match step {
            Step::Transition(phi) => later.map(|later| later.resized(phi.nrows()).transposed_by(phi)),
            Step::Update {
                weighted_innovation,
                weight,
                h,
                gain,
            } => {
                let states = h.ncols();
                let later = later.unwrap_or_else(|| Self::zeros(states)).resized(states);
                let mut before = later.transposed_by(&(DMatrix::identity(states, states) - gain * h));
                before.vector -= h.transpose() * weighted_innovation;
                before.matrix += h.transpose() * weight * h;
                Some(before)
            }
            Step::Sample { .. } => later,
        }
    }
}

/// Smooths a tape; samples are returned in order of time.
///
/// Samples after the last update equal the filter's, bit for bit.
///
/// # Errors
/// [`NavError::NotFinite`] if the transition to a sample cannot be inverted, after a gap in the IMU stream over which a
/// state has decayed to zero; [`NavError::Interrupted`] where `stop` asks for an early end.
pub fn smooth(tape: Tape, stop: &Stop) -> Result<Vec<Smoothed>, NavError> {
    let mut adjoint: Option<Adjoint> = None;
    let mut samples = Vec::new();
    for step in tape.steps.into_iter().rev() {
        stop.check()?;
        match step {
            Step::Sample {
                pending,
                state,
                covariance,
            } => samples.push(smoothed(*state, &covariance, adjoint.as_ref(), pending)?),
            other => adjoint = Adjoint::before(adjoint, &other),
        }
    }
    samples.reverse();
    Ok(samples)
}

/// x̂ ⊕ (−P λ) and P − P Λ P, with the adjoint at the sample: Φ⁻ᵀ λ with λ at the previous entry and Φ = `pending`.
fn smoothed(
    mut state: NavState,
    covariance: &DMatrix<f64>,
    adjoint: Option<&Adjoint>,
    pending: DMatrix<f64>,
) -> Result<Smoothed, NavError> {
    let error_state_block = |p: &DMatrix<f64>| Covariance::from(p.fixed_view::<DIM, DIM>(0, 0));
    let Some(adjoint) = adjoint else {
        return Ok(Smoothed {
            state,
            covariance: error_state_block(covariance),
        });
    };
    let time_ns = state.time_ns;
    let (correction, p) = corrected(covariance, adjoint, pending).ok_or(NavError::NotFinite {
        field: "smoother transition",
        time_ns,
    })?;
    require_finite("smoothed state", time_ns, correction.as_slice())?;
    require_finite_squares("smoothed covariance", time_ns, p.as_slice())?;
    state.inject(&ErrorVector::from_iterator(correction.iter().copied()));
    Ok(Smoothed {
        state,
        covariance: error_state_block(&((&p + p.transpose()) * 0.5)),
    })
}

/// −P λ and P − P Λ P of all states; `None` where the transition cannot be inverted.
fn corrected(
    covariance: &DMatrix<f64>,
    adjoint: &Adjoint,
    pending: DMatrix<f64>,
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let states = pending.nrows();
    let adjoint = adjoint.clone().resized(states).transposed_by(&pending.try_inverse()?);
    let p = covariance - covariance * &adjoint.matrix * covariance;
    Some((-(covariance * &adjoint.vector), p))
}

#[cfg(test)]
#[path = "calibration_tests.rs"]
mod calibration_tests;
#[cfg(test)]
mod tests;
