//! The innovation gate and its thresholds.

use crate::aiding::MAX_ROWS;
use crate::chi_squared::quantile;
use crate::error::NavError;

/// Test of an innovation against its covariance S.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Gate {
    /// Compares the NIS of all rows with a chi-squared quantile.
    Joint {
        /// Probability with which a correct measurement passes.
        probability: f64,
    },
    /// Compares each row with three of its standard deviations (the rule of the papers).
    PerRow,
    /// Rejects nothing.
    Off,
}

/// A gate with its thresholds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "Gate", into = "Gate")]
pub struct GateTable {
    /// The test.
    pub gate: Gate,
    /// Chi-squared quantiles for 1 to [`MAX_ROWS`] degrees of freedom; infinite without a joint gate.
    quantiles: [f64; MAX_ROWS],
}

impl GateTable {
    /// Computes the thresholds of a gate.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] unless the probability lies strictly between 0 and 1.
    pub fn new(gate: Gate) -> Result<Self, NavError> {
        let mut quantiles = [f64::INFINITY; MAX_ROWS];
        if let Gate::Joint { probability } = gate {
            if !(probability > 0.0 && probability < 1.0) {
                return Err(NavError::OutOfRange {
                    field: "gate_probability",
                    value: probability,
                    expected: "strictly between 0 and 1: a probability, not a percentage",
                });
            }
            quantiles = std::array::from_fn(|k| quantile(k + 1, probability));
        }
        Ok(Self { gate, quantiles })
    }

    /// A gate that accepts every measurement.
    #[must_use]
    pub fn open() -> Self {
        Self {
            gate: Gate::Off,
            quantiles: [f64::INFINITY; MAX_ROWS],
        }
    }

    /// Threshold of the NIS for a number of degrees of freedom.
    #[must_use]
    pub fn threshold(&self, degrees: usize) -> f64 {
        self.quantiles[degrees.clamp(1, MAX_ROWS) - 1]
    }
}

impl TryFrom<Gate> for GateTable {
    type Error = NavError;
    fn try_from(gate: Gate) -> Result<Self, NavError> {
        Self::new(gate)
    }
}

impl From<GateTable> for Gate {
    fn from(table: GateTable) -> Self {
        table.gate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tabulated 99 % quantiles of chi-squared: 6.635 for one degree of freedom, 11.345 for three.
    #[test]
    fn gate_thresholds_are_the_tabulated_quantiles() {
        let table = GateTable::new(Gate::Joint { probability: 0.99 }).unwrap();
        assert!((table.threshold(1) - 6.634_896_6).abs() < 1e-5);
        assert!((table.threshold(3) - 11.344_866_7).abs() < 1e-5);
        assert!(GateTable::new(Gate::Joint { probability: 1.0 }).is_err());
        assert_eq!(GateTable::new(Gate::Off).unwrap().threshold(2), f64::INFINITY);
    }
}
