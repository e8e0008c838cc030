//! A sequential test of whether the innovations of measured velocities are white: an error that lasts and is too small for any
//! gate shows in their mean.
//!
//! Each innovation z = H δx + n with covariance S measures the velocity error by its score s = Hᵥᵀ S⁻¹ z, whose covariance in a
//! filter that is right is the information J = Hᵥᵀ S⁻¹ Hᵥ, and which is white then. With exponentially fading weights over
//! windows θ, λ = exp(−Δt/θ), u ← λ u + s and U ← λ² U + J, the length uᵀ U⁻¹ u is chi-squared with three degrees of freedom,
//! or as many as the beams determine. It first passes a threshold l at the rate l^(3/2) exp(−l/2) √(2/π)/θ (the
//! Ornstein–Uhlenbeck process in three dimensions for large l; in steps it passes more rarely). The thresholds give each window
//! 1e-7 per second, as the short ones of the slip (`slip_test.rs`): all of them one false alarm in a month at most. At 1e-5 readings
//! that are a tenth noisier than stated raise one in minutes (ten dives of `tests/replay/test_thrust_section.py`), and a step is
//! noticed a few pings sooner.
//!
//! What lasts is an inertial reading that has changed, a misalignment, a sensor's noise that is not white. The covariance of the
//! inertial states grows by the ratio of the length to what it is expected to be, as by a run of rejected velocities
//! (`evidence.rs`), without the position, which has not moved by more than what is to be corrected.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::Eskf;
use super::charge::{Charge, states};
use super::joseph::PredictedInnovation;
use crate::aiding::Innovation;
use crate::error::{NavError, require_finite};
use crate::filter::gate::FIVE_SIGMA_FACTOR;
use crate::layout::{ATTITUDE, DVL_BIAS, VELOCITY};

/// Number of windows.
const WINDOWS: usize = 4;
/// Time constants of the windows, s.
const WINDOW_S: [f64; WINDOWS] = [1.0, 4.0, 16.0, 64.0];
/// Thresholds of the windows.
const THRESHOLD: [f64; WINDOWS] = [43.073, 40.085, 37.079, 34.05];
/// States that are charged: misalignment, velocity and inertial biases.
const CHARGED: usize = DVL_BIAS - ATTITUDE;
/// Part of the mean information below which a direction has none.
const UNDETERMINED: f64 = 1e-6;

/// Memory of the test.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct LastingTest {
    last_ns: Option<i64>,
    score: [Vector3<f64>; WINDOWS],
    information: [Matrix3<f64>; WINDOWS],
    /// How many times longer than expected a sum is that has passed its threshold.
    ratio: Option<f64>,
}

impl LastingTest {
    /// Takes the score of an innovation with its information.
    fn take(&mut self, score: &Vector3<f64>, information: &Matrix3<f64>, time_ns: i64) {
        let since_s = self
            .last_ns
            .map_or(f64::INFINITY, |last_ns| (time_ns - last_ns) as f64 * 1e-9);
        self.last_ns = Some(time_ns);
        for (k, window_s) in WINDOW_S.into_iter().enumerate() {
            let left = (-since_s / window_s).exp();
            self.score[k] = self.score[k] * left + score;
            self.information[k] = self.information[k] * (left * left) + information;
            let length = length(&self.score[k], &self.information[k]);
            if length > THRESHOLD[k] {
                self.ratio = Some(self.ratio.unwrap_or(0.0).max(length / 3.0));
            }
        }
    }

    /// Checks a test that was read from bytes.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        for (score, information) in self.score.iter().zip(&self.information) {
            require_finite("sums of innovations", time_ns, score.as_slice())?;
            require_finite("sums of innovations", time_ns, information.as_slice())?;
        }
        Ok(())
    }
}

/// uᵀ U⁻¹ u, of the directions that have information.
fn length(score: &Vector3<f64>, information: &Matrix3<f64>) -> f64 {
    let least = UNDETERMINED * information.trace();
    let factor = (information + Matrix3::from_diagonal_element(least)).cholesky();
    factor.map_or(0.0, |factor| score.dot(&factor.solve(score)))
}

impl Eskf {
    /// Takes the innovation of a velocity (platform axes) that was used; one that is not plausible is an outlier, whatever gate let
    /// it pass.
    pub(super) fn test_lasting<const M: usize>(&mut self, innovation: &Innovation, predicted: &PredictedInnovation<M>) {
        let is_plausible = predicted.nis <= self.plausible.threshold(innovation.degrees);
        if self.inflate_after_rejections == 0 || !is_plausible {
            return;
        }
        let h: SMatrix<f64, M, 3> = innovation.jacobian.fixed_view::<M, 3>(0, VELOCITY).into_owned();
        let weighted = predicted.cholesky().solve(&h).transpose();
        let score = weighted * innovation.residual.fixed_rows::<M>(0);
        self.lasting.take(&score, &(weighted * h), self.state.time_ns);
    }

    /// Begins anew.
    pub(crate) fn forget_lasting(&mut self) {
        *self.lasting = LastingTest::default();
    }

    /// Charges the inertial states with an error that lasts, where the innovations since the last charge show one.
    pub(crate) fn charge_lasting(&mut self) -> Option<Charge> {
        let ratio = self.lasting.ratio?;
        self.forget_lasting();
        self.propagate_covariance();
        let most = self.largest_factor(&states(ATTITUDE..DVL_BIAS));
        let factor = ratio.min(FIVE_SIGMA_FACTOR).min(most).max(1.0);
        let mut charge = Charge::none(Some(factor));
        let mut grown = charge.inertial.fixed_view_mut::<CHARGED, CHARGED>(ATTITUDE, ATTITUDE);
        grown.copy_from(&(self.covariance.fixed_view::<CHARGED, CHARGED>(ATTITUDE, ATTITUDE) * (factor - 1.0)));
        self.charge(&charge);
        Some(charge)
    }
}

#[cfg(test)]
#[path = "lasting_tests.rs"]
mod tests;
