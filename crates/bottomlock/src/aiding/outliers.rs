//! Outliers among the beams: gates that reject single beams, and weights for heavy-tailed noise.
//!
//! Pings are screened before the aiding method uses them: a rejected beam counts as lost, a beam with a lower weight gets a larger
//! standard deviation. Every method is therefore robust in the same way, and tight coupling, information form and exact virtual
//! beam remain the same filter. All tests use the filter's innovation covariance S = H P Hᵀ + R of the beam rows, which contains
//! the uncertainty of beam biases and lever arms.
//!
//! # Gates
//! - Closure: the consistency of redundant beams does not depend on the velocity. With N a basis of the left null space of the beam
//!   directions, (Nᵀz)ᵀ(NᵀS N)⁻¹Nᵀz is chi-squared with as many degrees as there are redundant beams.
//! - Single beams: leaving beam i out reduces the NIS by w_i² = (S⁻¹z)_i² / (S⁻¹)_ii, the squared normalised residual of beam i
//!   against its prediction from the inertial navigation and the other beams: chi-squared with one degree of freedom (Baarda, A
//!   testing procedure for use in geodetic networks, 1968).
//!
//! If either test fails, the fewest beams are rejected without which the others pass. Closure alone cannot identify the faulty one of
//! four beams, since any three are not redundant; the prediction of the inertial navigation decides, by the NIS of the rest. Where
//! that of the next best choice is within odds of 20 to 1, as after a start or an outage, no beam stands out: all keep their readings,
//! with the noise of their closure if it fails. Where more than half would go, the prediction is wrong, and none is left.
//! Neither holds without redundancy, where three beams or fewer fit some velocity whatever they read.
//!
//! # Heavy tails
//! With D_i the beam's own variance, divided by a weight w_i, the estimate of its noise is n̂ = D W⁻¹ S⁻¹ z. With Student's t of
//! ν degrees, iterated until the weights converge, w_i = (ν + 1) / (ν + e_i / D_i), e_i the mean square of n_i including its
//! posterior variance. This is the variational filter of Agamennoni, Nieto & Nebot, Approximate inference in state-space models with heavy-tailed noise,
//! IEEE Trans. Signal Processing 60 (2012), with a weight for each beam. D_i is the beam's variance times (ν + 3)/(ν + 1): the
//! mean weight is 1, but the Fisher information of a reading of Student's t is only (ν + 1)/(ν + 3) of that of a Gaussian, and
//! the filter would otherwise be overconfident.

use nalgebra::{DMatrix, DVector};

use crate::aiding::{BeamTerms, tightly_coupled};
use crate::chi_squared::quantile;
use crate::dvl::geometry::{BeamGeometry, BeamSample, MAX_BEAMS};
use crate::error::NavError;
use crate::state::Covariance;

/// Least difference of the NIS of what is left from that without as many other beams: odds of 20 to 1, as in `replay/robust_fix.py`.
const STANDS_OUT: f64 = 5.991_464_547_107_98;

/// Largest number of iterations on the weights.
const ITERATIONS: usize = 5000;
/// Relative change of a weight below which they have converged.
const STANDSTILL: f64 = 1e-9;

/// The distribution of a beam's noise; its standard deviation is the scale.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tail {
    /// A Gaussian: the Kalman update.
    #[default]
    Gaussian,
    /// Student's t.
    StudentT,
}

/// Treatment of outliers among the beams; by default what instruments need.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Robust {
    /// Probability that a good ping passes the closure test.
    pub closure_gate: Option<f64>,
    /// Probability that a good beam passes its own test.
    pub beam_gate: Option<f64>,
    /// Noise of the beams that pass.
    pub tail: Tail,
    /// ν of Student's t, 1 or more; the Gaussian as ν grows.
    pub student_t_degrees: f64,
}

impl Default for Robust {
    /// Closure and single-beam gates at 99.73 %, and Student's t with four degrees for the beams that pass.
    ///
    /// Closure residuals of instruments have such tails (docs/robust.md). Student's t alone is consistent; the gates
    /// remove what no tail explains.
    fn default() -> Self {
        Self {
            closure_gate: Some(0.9973),
            beam_gate: Some(0.9973),
            tail: Tail::StudentT,
            student_t_degrees: 4.0,
        }
    }
}

impl Robust {
    /// No treatment: pings pass unchanged.
    pub const OFF: Self = Self {
        closure_gate: None,
        beam_gate: None,
        tail: Tail::Gaussian,
        student_t_degrees: 4.0,
    };

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        for (field, gate) in [
            ("options.robust.closure_gate", self.closure_gate),
            ("options.robust.beam_gate", self.beam_gate),
        ] {
            if let Some(value) = gate.filter(|&p| !(p > 0.0 && p < 1.0)) {
                return Err(NavError::OutOfRange {
                    field,
                    value,
                    expected: "strictly between 0 and 1",
                });
            }
        }
        // Those of a tail that is not chosen, too.
        if self.student_t_degrees.is_finite() && self.student_t_degrees >= 1.0 {
            return Ok(());
        }
        Err(NavError::OutOfRange {
            field: "options.robust.student_t_degrees",
            value: self.student_t_degrees,
            expected: "a finite number >= 1",
        })
    }

    /// True if pings pass unchanged.
    #[must_use]
    pub fn is_off(&self) -> bool {
        self.closure_gate.is_none() && self.beam_gate.is_none() && self.tail == Tail::Gaussian
    }
}

/// A screened ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screened {
    /// The ping without its rejected beams, and with the standard deviations of weighted beams.
    pub ping: BeamSample,
    /// Fraction of its information that each beam keeps, 1 at most: its variance over its new variance. 0 if the beam was
    /// rejected, NaN if it was lost before.
    pub weight: [f64; MAX_BEAMS],
}

/// The rows of some beams: residual z, covariance from the state H P Hᵀ, and noise R.
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

    /// The rows of some of the beams, by their bits.
    fn of(&self, bits: usize) -> Self {
        let kept: Vec<usize> = (0..self.beams.len()).filter(|&i| bits & (1 << i) != 0).collect();
        let square = |all: &DMatrix<f64>| all.select_rows(&kept).select_columns(&kept);
        Self {
            beams: kept.iter().map(|&i| self.beams[i]).collect(),
            z: self.z.select_rows(&kept),
            hph: square(&self.hph),
            r: square(&self.r),
        }
    }

    fn nis(&self, time_ns: i64) -> Result<f64, NavError> {
        Ok(self.z.dot(&(self.weight(&self.r, time_ns)? * &self.z)))
    }

    /// Reduction of the NIS by leaving out each beam.
    fn leave_one_out(&self, time_ns: i64) -> Result<DVector<f64>, NavError> {
        let weight = self.weight(&self.r, time_ns)?;
        let weighted = &weight * &self.z;
        Ok(DVector::from_fn(self.z.len(), |i, _| {
            weighted[i].powi(2) / weight[(i, i)]
        }))
    }

    /// Whether the closure and every beam pass their tests.
    fn pass(&self, robust: &Robust, geometry: &BeamGeometry, time_ns: i64) -> Result<bool, NavError> {
        if let Some(probability) = robust.closure_gate {
            let (statistic, degrees) = self.closure(geometry, time_ns)?;
            if degrees > 0 && statistic > quantile(degrees, probability) {
                return Ok(false);
            }
        }
        Ok(match robust.beam_gate {
            Some(probability) => self.leave_one_out(time_ns)?.max() <= quantile(1, probability),
            None => true,
        })
    }

    /// The fewest beams without which the others pass, of those of a ping that does not. Of redundant beams `None` where as many
    /// others are about as likely, and all where it would be more than half.
    fn outliers(&self, robust: &Robust, geometry: &BeamGeometry, time_ns: i64) -> Result<Option<Vec<usize>>, NavError> {
        let beams = self.beams.len();
        let all = (1_usize << beams) - 1;
        let is_redundant = beams > geometry.rank_of(self.beams.iter().copied().collect());
        let most = if is_redundant { beams / 2 } else { beams - 1 };
        for count in 1..=most {
            let mut rests = Vec::new();
            for bits in (1..all).filter(|bits| bits.count_ones() as usize == count) {
                let rest = self.of(all ^ bits);
                rests.push((rest.nis(time_ns)?, bits, rest));
            }
            rests.sort_by(|one, other| one.0.total_cmp(&other.0));
            let (least, bits, rest) = &rests[0];
            if rest.pass(robust, geometry, time_ns)? {
                let stands_out = !is_redundant || rests.get(1).is_none_or(|next| next.0 - least >= STANDS_OUT);
                return Ok(stands_out.then(|| self.of(*bits).beams));
            }
        }
        Ok(Some(self.beams.clone()))
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

    /// The variances of the beams' own noise with converged weights of Student's t; `own` are those in R.
    fn weighted(&self, own: &DVector<f64>, degrees: f64, time_ns: i64) -> Result<DVector<f64>, NavError> {
        let scale = own * ((degrees + 3.0) / (degrees + 1.0));
        let mut widened = scale.clone();
        for _ in 0..ITERATIONS {
            let inverse = self.weight(&(&self.r + DMatrix::from_diagonal(&(&widened - own))), time_ns)?;
            let noise = widened.component_mul(&(&inverse * &self.z));
            let next = DVector::from_fn(own.len(), |i, _| {
                let variance = widened[i] - widened[i].powi(2) * inverse[(i, i)];
                scale[i] * (degrees + (noise[i].powi(2) + variance.max(0.0)) / scale[i]) / (degrees + 1.0)
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

/// Rejects outliers of a ping and weights the remaining beams; `terms` are those of the ping, `covariance` is the filter's at its time.
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
    let mut rows = Rows::new(covariance, terms, ping);
    if rows.beams.is_empty() {
        return Ok(out);
    }
    if !rows.pass(robust, geometry, time_ns)? {
        match rows.outliers(robust, geometry, time_ns)? {
            Some(outliers) => {
                outliers.iter().for_each(|&beam| out.weight[beam] = 0.0);
                out.ping.valid = ping.valid.iter().filter(|beam| !outliers.contains(beam)).collect();
            }
            None => {
                let (statistic, degrees) = rows.closure(geometry, time_ns)?;
                let wider = (statistic / degrees.max(1) as f64).max(1.0).sqrt();
                ping.valid.iter().for_each(|beam| out.ping.sd_mps[beam] *= wider);
            }
        }
        rows = Rows::new(covariance, terms, &out.ping);
        if rows.beams.is_empty() {
            return Ok(out);
        }
    }
    if robust.tail == Tail::StudentT {
        let own = DVector::from_fn(rows.beams.len(), |i, _| {
            (out.ping.sd_mps[rows.beams[i]] / geometry.sound_speed_scale()).powi(2)
        });
        let widened = rows.weighted(&own, robust.student_t_degrees, time_ns)?;
        for (i, &beam) in rows.beams.iter().enumerate() {
            out.ping.sd_mps[beam] = widened[i].sqrt() * geometry.sound_speed_scale();
        }
    }
    for &beam in &rows.beams {
        out.weight[beam] = (ping.sd_mps[beam] / out.ping.sd_mps[beam]).powi(2);
    }
    Ok(out)
}

#[cfg(test)]
#[path = "outliers_tests.rs"]
mod tests;
