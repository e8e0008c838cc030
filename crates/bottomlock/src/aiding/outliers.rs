//! Beams that err more than a Gaussian does: gates that take single beams out, and weights for heavy tails.
//!
//! Everything is done to a ping before a method makes anything of it: a beam that is taken out is lost, a beam that is weighted has
//! a larger standard deviation. So every way of aiding is robust in the same way, and tight coupling, information form and exact
//! virtual beam stay one filter. All tests stand on the filter's own innovation covariance S = H P Hᵀ + R of the beam rows, which
//! holds what is known of beam biases and lever arms.
//!
//! # Gates
//! - Closure: redundant beams contradict each other whatever the velocity is. With N a basis of the left null space of the beam
//!   directions, (Nᵀz)ᵀ(NᵀS N)⁻¹Nᵀz is chi-squared with as many degrees as there are redundant beams.
//! - Single beams: taking beam i out lessens the NIS by w_i² = (S⁻¹z)_i² / (S⁻¹)_ii, the normalised square of beam i as the inertial
//!   navigator and the other beams predict it: chi-squared with one degree (Baarda, A testing procedure for use in geodetic
//!   networks, 1968).
//!
//! Where either fails, the beam with the largest w_i² goes, and what is left is tested again. Closure alone cannot say which of four
//! beams it is: leaving any one out leaves nothing redundant; the navigator's own prediction decides.
//!
//! # Heavy tails
//! With D_i the beam's own variance, divided by a weight w_i, the estimate of its noise is n̂ = D W⁻¹ S⁻¹ z. Repeated until the weights
//! stand still:
//! - Student's t with ν degrees: w_i = (ν + 1) / (ν + e_i / D_i), e_i the mean square of n_i, its posterior variance included: the variational
//!   filter of Agamennoni, Nieto & Nebot, Approximate inference in state-space models with heavy-tailed noise, IEEE Trans. Signal
//!   Processing 60 (2012), with a weight for each beam. D_i is the beam's variance times (ν + 3)/(ν + 1): the weights have a mean of
//!   1, but a reading of Student's t tells of its location only (ν + 1)/(ν + 3) of what a Gaussian one tells (its Fisher
//!   information), and the filter would claim the rest;
//! - Huber: w_i = min(1, k / |n̂_i / σ_i|), k in standard deviations (Karlgaard & Schaub, Huber-based divided difference filtering,
//!   J. Guidance, Control, and Dynamics 30 (2007)).

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::aiding::{BeamTerms, tightly_coupled};
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamSample, MAX_BEAMS};
use crate::error::{NavError, require_positive};
use crate::state::Covariance;

/// Steps of the iteration on the weights at most.
const ITERATIONS: usize = 5000;
/// Change of a weight, relative, at which they stand still.
const STANDSTILL: f64 = 1e-9;

/// The distribution of a beam's noise; its standard deviation is the scale.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Tail {
    /// A Gaussian: the Kalman update.
    #[default]
    Gaussian,
    /// Student's t.
    StudentT {
        /// ν, 1 or more; the Gaussian as ν grows.
        degrees: f64,
    },
    /// A Gaussian whose tails are exponential.
    Huber {
        /// Where the tails begin, standard deviations.
        threshold: f64,
    },
}

/// What is done against outliers among the beams; nothing by default.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Robust {
    /// Probability with which a good ping passes the test of closure.
    pub closure_gate: Option<f64>,
    /// Probability with which a good beam passes its own test.
    pub beam_gate: Option<f64>,
    /// Noise of the beams that pass.
    pub tail: Tail,
}

impl Robust {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        for (field, gate) in [
            ("robust.closure_gate", self.closure_gate),
            ("robust.beam_gate", self.beam_gate),
        ] {
            if let Some(value) = gate.filter(|&p| !(p > 0.0 && p < 1.0)) {
                return Err(NavError::OutOfRange {
                    field,
                    value,
                    expected: "strictly between 0 and 1",
                });
            }
        }
        match self.tail {
            Tail::Gaussian => Ok(()),
            Tail::StudentT { degrees } if degrees.is_finite() && degrees >= 1.0 => Ok(()),
            Tail::StudentT { degrees } => Err(NavError::OutOfRange {
                field: "robust.student_t_degrees",
                value: degrees,
                expected: "a finite number >= 1",
            }),
            Tail::Huber { threshold } => require_positive("robust.huber_threshold", threshold),
        }
    }

    /// True where pings pass untouched.
    #[must_use]
    pub fn is_off(&self) -> bool {
        *self == Self::default()
    }
}

/// What is left of a ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screened {
    /// The ping without the beams that were taken out, and with the standard deviations of those that were weighted.
    pub ping: BeamSample,
    /// The share of its information that each beam keeps, 1 at most: its variance over the one that it has now. 0 where it was
    /// taken out, NaN where it was lost before.
    pub weight: [f64; MAX_BEAMS],
}

impl Screened {
    /// True where beams were valid and none is left.
    #[must_use]
    pub fn took_all(&self) -> bool {
        self.ping.valid.iter().next().is_none() && self.weight.contains(&0.0)
    }
}

/// The rows of some beams: residual z, what the state contributes H P Hᵀ, and the noise R.
struct Rows {
    beams: Vec<usize>,
    z: DVector<f64>,
    hph: DMatrix<f64>,
    r: DMatrix<f64>,
}

impl Rows {
    fn new(covariance: &Covariance, terms: &BeamTerms, ping: &BeamSample) -> Self {
        let rows = tightly_coupled(terms, ping);
        let m = rows.rows;
        let h = rows.jacobian.rows(0, m);
        Self {
            beams: ping.valid.iter().collect(),
            z: rows.residual.rows(0, m).into_owned(),
            hph: h * covariance * h.transpose(),
            r: rows.noise.view((0, 0), (m, m)).into_owned(),
        }
    }

    /// S⁻¹.
    fn weight(&self, r: &DMatrix<f64>, time_ns: i64) -> Result<DMatrix<f64>, NavError> {
        let s = &self.hph + r;
        let factor = s.cholesky().ok_or(NavError::NotPositiveDefinite {
            matrix: "innovation covariance of the beams",
            time_ns,
        })?;
        Ok(factor.inverse())
    }

    /// By how much taking each beam out lessens the NIS.
    fn leave_one_out(&self, time_ns: i64) -> Result<DVector<f64>, NavError> {
        let weight = self.weight(&self.r, time_ns)?;
        let weighted = &weight * &self.z;
        Ok(DVector::from_fn(self.z.len(), |i, _| {
            weighted[i].powi(2) / weight[(i, i)]
        }))
    }

    /// The statistic of closure and its degrees of freedom.
    fn closure(&self, geometry: &BeamGeometry, time_ns: i64) -> Result<(f64, usize), NavError> {
        let m = self.beams.len();
        let directions = DMatrix::from_fn(m, 3, |i, k| geometry.direction_p(self.beams[i])[k]);
        let eigen = (&directions * directions.transpose()).symmetric_eigen();
        // b are unit vectors, so the eigenvalues add up to m.
        let redundant: Vec<usize> = (0..m).filter(|&k| eigen.eigenvalues[k] < 1e-9 * m as f64).collect();
        if redundant.is_empty() {
            return Ok((0.0, 0));
        }
        let null = eigen.eigenvectors.select_columns(&redundant);
        let (gap, s) = (
            null.transpose() * &self.z,
            null.transpose() * (&self.hph + &self.r) * &null,
        );
        let factor = s.cholesky().ok_or(NavError::NotPositiveDefinite {
            matrix: "covariance of closure",
            time_ns,
        })?;
        Ok((gap.dot(&factor.solve(&gap)), redundant.len()))
    }

    /// The variances of the beams' own noise once the weights stand still; `own` are those in R.
    fn weighted(&self, own: &DVector<f64>, tail: Tail, time_ns: i64) -> Result<DVector<f64>, NavError> {
        let scale = match tail {
            Tail::StudentT { degrees } => own * ((degrees + 3.0) / (degrees + 1.0)),
            Tail::Gaussian | Tail::Huber { .. } => own.clone(),
        };
        let mut widened = scale.clone();
        for _ in 0..ITERATIONS {
            let inverse = self.weight(&(&self.r + DMatrix::from_diagonal(&(&widened - own))), time_ns)?;
            let noise = widened.component_mul(&(&inverse * &self.z));
            let next = DVector::from_fn(own.len(), |i, _| match tail {
                Tail::Gaussian => own[i],
                Tail::StudentT { degrees } => {
                    let variance = widened[i] - widened[i].powi(2) * inverse[(i, i)];
                    scale[i] * (degrees + (noise[i].powi(2) + variance.max(0.0)) / scale[i]) / (degrees + 1.0)
                }
                Tail::Huber { threshold } => scale[i] * (noise[i].abs() / scale[i].sqrt() / threshold).max(1.0),
            });
            let moved = (0..own.len()).fold(0.0, |most: f64, i| most.max((next[i] / widened[i] - 1.0).abs()));
            widened = next;
            if moved < STANDSTILL {
                break;
            }
        }
        Ok(widened)
    }
}

/// Takes outliers out of a ping and weights what is left; `terms` are those of the ping, `covariance` is the filter's at its time.
///
/// # Errors
/// [`NavError::NotPositiveDefinite`] where a factorisation fails; [`NavError::OutOfRange`] for a bad option.
pub fn screen(
    robust: &Robust,
    geometry: &BeamGeometry,
    covariance: &Covariance,
    terms: &BeamTerms,
    ping: &BeamSample,
) -> Result<Screened, NavError> {
    robust.validate()?;
    let time_ns = ping.time_ns;
    let mut out = Screened {
        ping: *ping,
        weight: [f64::NAN; MAX_BEAMS],
    };
    ping.valid.iter().for_each(|beam| out.weight[beam] = 1.0);
    loop {
        let rows = Rows::new(covariance, terms, &out.ping);
        if rows.beams.is_empty() {
            return Ok(out);
        }
        let doubts = rows.leave_one_out(time_ns)?;
        let worst = doubts.imax();
        let opens = match robust.closure_gate {
            Some(probability) => {
                let (statistic, degrees) = rows.closure(geometry, time_ns)?;
                degrees > 0 && statistic > quantile(degrees, probability)
            }
            None => false,
        };
        let fails = robust
            .beam_gate
            .is_some_and(|probability| doubts[worst] > quantile(1, probability));
        if !(opens || fails) {
            break;
        }
        let beam = rows.beams[worst];
        out.weight[beam] = 0.0;
        out.ping.valid = (out.ping.valid.iter().filter(|&other| other != beam)).collect::<BeamMask>();
    }
    if robust.tail != Tail::Gaussian {
        let rows = Rows::new(covariance, terms, &out.ping);
        let own = DVector::from_fn(rows.beams.len(), |i, _| {
            (ping.sd_mps[rows.beams[i]] / geometry.sound_speed_scale()).powi(2)
        });
        let widened = rows.weighted(&own, robust.tail, time_ns)?;
        for (i, &beam) in rows.beams.iter().enumerate() {
            out.weight[beam] = own[i] / widened[i];
            out.ping.sd_mps[beam] = widened[i].sqrt() * geometry.sound_speed_scale();
        }
    }
    Ok(out)
}

/// Chi-squared quantile; never where the distribution is not to be had.
fn quantile(degrees: usize, probability: f64) -> f64 {
    ChiSquared::new(degrees as f64).map_or(f64::INFINITY, |distribution| distribution.inverse_cdf(probability))
}

#[cfg(test)]
#[path = "outliers_tests.rs"]
mod tests;
