//! A sequential test of the assumed slips in sway and heave: their innovations are white with unit variance if the assumption
//! holds.
//!
//! The normalised innovations of both rows are summed with exponentially fading weights over windows θ of 1 to 256 s:
//! z ← λ z + √(1−λ²) ν with λ = exp(−Δt/θ). If the assumption holds, each pair of z is a standard normal first-order process,
//! whose length first passes u at the rate u² exp(−u²/2)/θ (the Ornstein–Uhlenbeck process in two dimensions for large u; in
//! steps it passes more rarely). A bias that lasts, small as it may be in one innovation, grows with the root of the window.
//! The thresholds give windows up to 16 s a rate of 1e-7 per second and longer ones, which find what is slow, 1e-5 per second.
//!
//! The mean of ν² over the same windows sees a slip that is larger than assumed without lasting: it is chi-squared with
//! (1+λ)/(1−λ) degrees of freedom, normal by Wilson and Hilferty's cube root (1931).
//!
//! Both tests add up to 4.05e-5 false alarms per second at most. Innovations count up to [`CLIP`], so a single outlier cannot raise an alarm.

use crate::error::{NavError, require_finite};

/// Number of windows.
const WINDOWS: usize = 9;
/// Time constants of the windows, s.
const WINDOW_S: [f64; WINDOWS] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0];
/// Thresholds u² of the windows: u² exp(−u²/2)/θ is 1e-7 per second, from 32 s on 1e-5 per second.
const THRESHOLD: [f64; WINDOWS] = [39.594, 38.132, 36.667, 35.199, 33.728, 22.304, 20.776, 19.235, 17.680];
/// Threshold of the normal deviate of a mean of squares: exceeded by chance at 1e-9.
const DEVIATE: f64 = 6.0;
/// Largest normalised innovation that is counted.
const CLIP: f64 = 4.0;
/// Fewest degrees of freedom at which the cube root is normal enough in the tail.
const FEWEST_DEGREES: f64 = 20.0;
/// Windows from this length on show a change of the current, s.
const SLOW_S: f64 = 32.0;
/// Quantile of chi-squared of two degrees at 95 %: half of it is −ln 0.05.
const USUAL: f64 = 5.991_464_547_107_979;
/// Time constant of a current at an alarm, s: a tenth of a prior of an hour.
const FASTEST_S: f64 = 360.0;
/// Part of the squared length from which on a row takes part in an alarm.
const PART: f64 = 0.25;

/// What an innovation shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Alarm {
    /// The slip is larger than assumed.
    Larger,
    /// The slip lasts for longer than the seconds given.
    Lasting(f64),
}

/// Memory of the test: of sway and of heave.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct SlipTest {
    /// z of each window.
    sums: [[f64; WINDOWS]; 2],
    /// Mean of ν² of each window.
    squares: [[f64; WINDOWS]; 2],
}

impl SlipTest {
    /// A test that has seen nothing.
    pub(super) fn new() -> Self {
        Self {
            sums: [[0.0; WINDOWS]; 2],
            squares: [[1.0; WINDOWS]; 2],
        }
    }

    /// Takes the normalised innovations of a ping, `since_s` after the last; returns the alarms of both slips.
    pub(super) fn take(&mut self, normalised: [f64; 2], since_s: f64) -> [Option<Alarm>; 2] {
        let mut alarms = [None; 2];
        for (k, window_s) in WINDOW_S.into_iter().enumerate() {
            let left = (-since_s / window_s).exp();
            let degrees = (1.0 + left) / (1.0 - left);
            for (row, innovation) in normalised.into_iter().enumerate() {
                let innovation = innovation.clamp(-CLIP, CLIP);
                let sum = &mut self.sums[row][k];
                *sum = left * *sum + (1.0 - left * left).sqrt() * innovation;
                let square = &mut self.squares[row][k];
                *square += (1.0 - left) * (innovation * innovation - *square);
                let is_larger = degrees.is_finite() && degrees >= FEWEST_DEGREES && deviate(*square, degrees) > DEVIATE;
                alarms[row] = alarms[row].or(is_larger.then_some(Alarm::Larger));
            }
            let z = [0, 1].map(|row| self.sums[row][k].powi(2));
            let length = z[0] + z[1];
            for row in 0..2 {
                let takes_part = length > THRESHOLD[k] && z[row] >= PART * length;
                alarms[row] = alarms[row].or(takes_part.then_some(Alarm::Lasting(window_s)));
            }
        }
        alarms
    }

    /// Time constant of a current whose prior has `prior_s`.
    pub(super) fn current_time_s(&self, prior_s: f64) -> f64 {
        let slow = (0..WINDOWS).filter(|&k| WINDOW_S[k] >= SLOW_S);
        let part = slow.map(|k| {
            let length = self.sums[0][k].powi(2) + self.sums[1][k].powi(2);
            (length - USUAL) / (THRESHOLD[k] - USUAL)
        });
        let part = part.fold(0.0, f64::max).min(1.0);
        if part == 0.0 || prior_s <= FASTEST_S {
            return prior_s;
        }
        prior_s * (FASTEST_S / prior_s).powf(part)
    }

    /// Checks a test that was read from bytes.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        require_finite("sums of slip innovations", time_ns, self.sums.as_flattened())?;
        require_finite("squares of slip innovations", time_ns, self.squares.as_flattened())
    }
}

/// Wilson and Hilferty's normal deviate of a mean of squares.
fn deviate(mean_square: f64, degrees: f64) -> f64 {
    let variance = 2.0 / (9.0 * degrees);
    (mean_square.cbrt() - (1.0 - variance)) / variance.sqrt()
}

#[cfg(test)]
#[path = "slip_test_tests.rs"]
mod tests;
