//! Deviation of a magnetic compass: what the vehicle's own iron adds to its yaw, by the heading.
//!
//! Permanent magnetism of the vehicle turns with it against the field, which gives the semicircular part, and iron that the
//! field magnetises gives the quadrantal one (NGA, Handbook of Magnetic Compass Adjustment, 2004, ch. V):
//!
//! ```text
//! δ(ψ) = C cos ψ + B sin ψ + E cos 2ψ + D sin 2ψ
//! ```
//!
//! The coefficients are constants. A filter that has them as states learns them in turns, whose angle the gyros know.
//! ψ is the estimated yaw. That δ changes with an error of it is left out: at 3° of deviation, by a twentieth of the error.

use crate::aiding::further::{DEVIATION, Process};
#[cfg(feature = "simulation")]
use crate::random::Normals;

/// Deviation of a compass, 1 sigma of each coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DeviationModel {
    /// Coefficients by cos ψ and sin ψ, rad.
    pub(crate) semicircular_sd_rad: f64,
    /// Coefficients by cos 2ψ and sin 2ψ, rad.
    pub(crate) quadrantal_sd_rad: f64,
}

impl DeviationModel {
    /// 1 sigma of each coefficient, rad.
    pub(crate) fn sd_rad(&self) -> [f64; DEVIATION] {
        let [semicircular, quadrantal] = [self.semicircular_sd_rad, self.quadrantal_sd_rad];
        [semicircular, semicircular, quadrantal, quadrantal]
    }

    /// Its coefficients.
    pub(crate) fn processes(&self) -> Vec<Process> {
        self.sd_rad().into_iter().map(Process::constant).collect()
    }

    /// The deviation at a heading, rad, with coefficients drawn from a stream each.
    #[cfg(feature = "simulation")]
    pub(crate) fn draw(&self, streams: &mut [Normals], yaw_rad: f64, time_ns: i64) -> f64 {
        let drawn = streams.iter_mut().zip(self.sd_rad()).zip(harmonics(yaw_rad));
        drawn
            .map(|((stream, sd), harmonic)| harmonic * stream.gauss_markov(sd, f64::INFINITY, time_ns))
            .sum()
    }
}

/// What each coefficient adds to the yaw at a heading.
pub(crate) fn harmonics(yaw_rad: f64) -> [f64; DEVIATION] {
    let ((sin, cos), (sin_twice, cos_twice)) = (yaw_rad.sin_cos(), (2.0 * yaw_rad).sin_cos());
    [cos, sin, cos_twice, sin_twice]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    /// North, east, south: the semicircular part changes its sign within half a turn, the quadrantal one within a quarter.
    #[test]
    fn harmonics_by_hand() {
        let expected = [[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, -1.0, 0.0], [-1.0, 0.0, 1.0, 0.0]];
        for (yaw_rad, expected) in [0.0, FRAC_PI_2, PI].into_iter().zip(expected) {
            for (found, expected) in harmonics(yaw_rad).into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-15);
            }
        }
    }
}
