//! Quantiles of chi-squared: a gate asks for the same ones at every measurement.

use std::cell::Cell;

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Most degrees of freedom of which a quantile is kept.
const KEPT: usize = 8;

thread_local! {
    /// The last probability asked for with each number of degrees of freedom from 1 to [`KEPT`], and its quantile.
    static LAST: Cell<[(f64, f64); KEPT]> = const { Cell::new([(f64::NAN, f64::INFINITY); KEPT]) };
}

/// Quantile for a number of degrees of freedom; infinite for none.
pub(crate) fn quantile(degrees: usize, probability: f64) -> f64 {
    let compute = || ChiSquared::new(degrees as f64).map_or(f64::INFINITY, |of| of.inverse_cdf(probability));
    let mut last = LAST.get();
    let Some((known, quantile)) = last.get_mut(degrees.wrapping_sub(1)) else {
        return compute();
    };
    if *known == probability {
        return *quantile;
    }
    let computed = compute();
    (*known, *quantile) = (probability, computed);
    LAST.set(last);
    computed
}

#[cfg(test)]
mod tests {
    use super::quantile;

    /// Tabulated quantiles, asked for in turn and again.
    #[test]
    fn each_probability_has_its_own_quantile() {
        let table = [
            (1, 0.99, 6.634_897),
            (1, 0.95, 3.841_459),
            (3, 0.99, 11.344_867),
            (9, 0.99, 21.665_994),
        ];
        for (degrees, probability, expected) in [table, table].concat() {
            assert!((quantile(degrees, probability) - expected).abs() < 1e-5);
        }
        assert_eq!(quantile(0, 0.99), f64::INFINITY);
    }
}
