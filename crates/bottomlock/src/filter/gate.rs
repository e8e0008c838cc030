//! The innovation gate and its thresholds.

use std::cell::Cell;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::aiding::MAX_ROWS;
use crate::error::NavError;

/// How an innovation is judged; always on its own covariance S.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gate {
    /// The normalised innovation squared of the whole fix against a chi-squared quantile.
    Joint {
        /// Probability with which a good fix passes.
        probability: f64,
    },
    /// Each component against three of its standard deviations (the papers' rule).
    PerRow,
    /// Nothing is rejected.
    Off,
}

/// A gate with its thresholds worked out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GateTable {
    /// The rule.
    pub gate: Gate,
    /// Chi-squared quantile for 1, 2, … [`MAX_ROWS`] degrees of freedom (joint gate).
    quantiles: [f64; MAX_ROWS],
}

impl GateTable {
    /// Works out the thresholds.
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
                    expected: "strictly between 0 and 1",
                });
            }
            quantiles = chi_squared_quantiles(probability);
        }
        Ok(Self { gate, quantiles })
    }

    /// A gate that lets everything pass.
    #[must_use]
    pub fn open() -> Self {
        Self {
            gate: Gate::Off,
            quantiles: [f64::INFINITY; MAX_ROWS],
        }
    }

    /// Threshold of the normalised innovation squared for a number of degrees of freedom.
    #[must_use]
    pub fn threshold(&self, degrees: usize) -> f64 {
        self.quantiles[degrees.clamp(1, MAX_ROWS) - 1]
    }
}

thread_local! {
    /// The last probability asked for and its quantiles: every filter of a campaign asks for the same ones.
    static QUANTILES: Cell<(f64, [f64; MAX_ROWS])> = const { Cell::new((f64::NAN, [f64::INFINITY; MAX_ROWS])) };
}

/// Quantiles of chi-squared for 1, 2, … [`MAX_ROWS`] degrees of freedom.
fn chi_squared_quantiles(probability: f64) -> [f64; MAX_ROWS] {
    let (known, mut quantiles) = QUANTILES.get();
    if known != probability {
        for (index, quantile) in quantiles.iter_mut().enumerate() {
            if let Ok(distribution) = ChiSquared::new((index + 1) as f64) {
                *quantile = distribution.inverse_cdf(probability);
            }
        }
        QUANTILES.set((probability, quantiles));
    }
    quantiles
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chi-squared quantiles as tabulated: 99 % of one degree of freedom is 6.635, of three 11.345.
    #[test]
    fn gate_thresholds_are_the_tabulated_quantiles() {
        let table = GateTable::new(Gate::Joint { probability: 0.99 }).unwrap();
        assert!((table.threshold(1) - 6.634_896_6).abs() < 1e-5);
        assert!((table.threshold(3) - 11.344_866_7).abs() < 1e-5);
        assert!(GateTable::new(Gate::Joint { probability: 1.0 }).is_err());
        assert_eq!(GateTable::new(Gate::Off).unwrap().threshold(2), f64::INFINITY);
    }
}
