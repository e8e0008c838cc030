//! The innovation gate: its rule, its thresholds, and what follows a verdict.
//!
//! - Accepted: update (`update.rs`); the run of the sensor's rejections ends.
//! - Some rows rejected: update with the others.
//! - Rejected: the measurement is not used, and may be evidence of an error of its sensor or of the filter (`evidence.rs`).
//!
//! Whether a measurement is evidence against the filter is tested with [`GateTable::plausible`], whatever the gate in use rejects.

use crate::aiding::MAX_ROWS;
use crate::chi_squared::quantile;
use crate::error::NavError;
use crate::filter::report::UpdateReport;

/// Standard deviations beyond which the gate of the papers rejects a row.
const ROW_SIGMAS: f64 = 3.0;

/// Factor on variances for an error of five sigma: the largest that counts against a velocity which its sensor has confirmed, and
/// the largest inflation of states that the sensor does not measure itself.
pub(super) const FIVE_SIGMA_FACTOR: f64 = 25.0;

/// Time from the first rejected reading after which the readings of a sensor in doubt are used.
pub(super) const LONGEST_DOUBT_NS: i64 = 30_000_000_000;

/// Probability of the test of what is plausible where the gate in use has none.
const PLAUSIBLE: f64 = 0.9973;

/// Test of an innovation against its covariance S.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// Compares the NIS of all rows with a chi-squared quantile.
    Joint,
    /// Compares each row with three of its standard deviations (the rule of the papers).
    PerRow,
    /// Rejects nothing.
    Off,
}

/// A gate with its thresholds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "(Gate, f64)", into = "(Gate, f64)")]
pub struct GateTable {
    /// The test.
    pub gate: Gate,
    /// Probability with which a correct measurement passes a joint gate.
    probability: f64,
    /// Chi-squared quantiles for 1 to [`MAX_ROWS`] degrees of freedom; infinite without a joint gate.
    quantiles: [f64; MAX_ROWS],
}

impl GateTable {
    /// Computes the thresholds of a gate; `probability` is that with which a correct measurement passes a joint one.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] unless the probability lies strictly between 0 and 1.
    pub fn new(gate: Gate, probability: f64) -> Result<Self, NavError> {
        let mut quantiles = [f64::INFINITY; MAX_ROWS];
        if gate == Gate::Joint {
            if !(probability > 0.0 && probability < 1.0) {
                return Err(NavError::OutOfRange {
                    field: "options.gate_probability",
                    value: probability,
                    expected: "strictly between 0 and 1: a probability, not a percentage",
                });
            }
            quantiles = std::array::from_fn(|k| quantile(k + 1, probability));
        }
        Ok(Self {
            gate,
            probability,
            quantiles,
        })
    }

    /// A gate that accepts every measurement.
    #[must_use]
    pub fn open() -> Self {
        Self {
            gate: Gate::Off,
            probability: PLAUSIBLE,
            quantiles: [f64::INFINITY; MAX_ROWS],
        }
    }

    /// The joint test of whether a measurement agrees with the filter, whatever the gate in use rejects.
    ///
    /// # Errors
    /// As [`GateTable::new`].
    pub fn plausible(gate: Gate, probability: f64) -> Result<Self, NavError> {
        let is_joint = gate == Gate::Joint;
        Self::new(Gate::Joint, if is_joint { probability } else { PLAUSIBLE })
    }

    /// The rows of an innovation that the gate rejects, a bit per row.
    #[must_use]
    pub fn rejected_rows(&self, report: &UpdateReport) -> u8 {
        match self.gate {
            Gate::Joint if report.nis > report.threshold => u8::MAX,
            Gate::PerRow => (0..report.rows)
                .filter(|&k| report.residual[k].powi(2) > ROW_SIGMAS.powi(2) * report.covariance[(k, k)])
                .fold(0, |bits, k| bits | 1 << k),
            Gate::Off | Gate::Joint => 0,
        }
    }

    /// Threshold of the NIS for a number of degrees of freedom.
    #[must_use]
    pub fn threshold(&self, degrees: usize) -> f64 {
        self.quantiles[degrees.clamp(1, MAX_ROWS) - 1]
    }
}

impl TryFrom<(Gate, f64)> for GateTable {
    type Error = NavError;
    fn try_from((gate, probability): (Gate, f64)) -> Result<Self, NavError> {
        Self::new(gate, probability)
    }
}

impl From<GateTable> for (Gate, f64) {
    fn from(table: GateTable) -> Self {
        (table.gate, table.probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tabulated 99 % quantiles of chi-squared: 6.635 for one degree of freedom, 11.345 for three.
    #[test]
    fn gate_thresholds_are_the_tabulated_quantiles() {
        let table = GateTable::new(Gate::Joint, 0.99).unwrap();
        assert!((table.threshold(1) - 6.634_896_6).abs() < 1e-5);
        assert!((table.threshold(3) - 11.344_866_7).abs() < 1e-5);
        assert!(GateTable::new(Gate::Joint, 1.0).is_err());
        assert_eq!(GateTable::new(Gate::Off, 0.5).unwrap().threshold(2), f64::INFINITY);
    }
}
