//! Covariance inflation after consecutive rejections of velocity fixes.
//!
//! Correct fixes are rejected rarely and one at a time: at 99.73 % five consecutive rejections occur once in 10¹²
//! fixes. But if the error of the filter exceeds its covariance, for example with an initial tilt error of four sigma,
//! the innovation grows as fast as its sigma, the NIS stays constant, and the gate rejects every fix of a mission.
//! After a number of consecutive rejections the covariance of the inertial states is therefore multiplied by the mean
//! of NIS over its degrees of freedom, which is the factor by which it was too small. The gate then tests the next fix
//! against the inflated covariance.
//!
//! Beams that contradict each other are rejected whatever the covariance. That is a fault of the sensor and does not
//! count.

use nalgebra::SMatrix;

use super::Eskf;
use crate::aiding::Innovation;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::layout::{ATTITUDE, DVL_BIAS, POSITION};
use crate::state::Covariance;

/// Factor on the inertial covariance with which every error of an inertial state passes the gate.
const UNINFORMATIVE_FACTOR: f64 = 1e6;

/// Largest attitude sigma after inflation, rad.
const MAX_ATTITUDE_SD_RAD: f64 = 1.0;
/// Largest position sigma after inflation, m.
const MAX_POSITION_SD_M: f64 = 1e6;

/// Count of consecutive rejections of velocity fixes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ConsecutiveRejections {
    fixes: u32,
    nis_per_degree: f64,
}

impl ConsecutiveRejections {
    /// Counts a fix, and returns the inflation factor if it completes `limit` consecutive rejections (0: never).
    fn count(&mut self, report: &UpdateReport, limit: u32) -> Option<f64> {
        if report.verdict != Verdict::Rejected {
            *self = Self::default();
            return None;
        }
        self.fixes += 1;
        self.nis_per_degree += report.nis / report.degrees as f64;
        (self.fixes == limit).then(|| {
            let factor = self.nis_per_degree / f64::from(self.fixes);
            *self = Self::default();
            factor
        })
    }
}

/// Returns true if an innovation of covariance `s` would pass the gate with an uninformative covariance of the inertial
/// states.
pub(super) fn is_explained_by_inertial_states<const M: usize>(
    p: &Covariance,
    innovation: &Innovation,
    s: &SMatrix<f64, M, M>,
    threshold: f64,
) -> bool {
    let z = innovation.residual.fixed_rows::<M>(0);
    let by_inertial = innovation.jacobian.fixed_view::<M, DVL_BIAS>(0, 0);
    let inertial = p.fixed_view::<DVL_BIAS, DVL_BIAS>(0, 0);
    let uninformative = s + by_inertial * inertial * by_inertial.transpose() * UNINFORMATIVE_FACTOR;
    uninformative
        .cholesky()
        .is_some_and(|factor| !(z.dot(&factor.solve(&z)) > threshold))
}

impl Eskf {
    /// Inflates the covariance once the limit of consecutive rejections is reached, and reports the factor.
    pub(super) fn inflate_after_rejections(&mut self, report: &mut UpdateReport) {
        // Rejected assumptions stay rejected, and a depth sensor may be wrong for a whole mission.
        if !matches!(report.sensor, Sensor::Beams | Sensor::Velocity) || self.inflate_after_rejections == 0 {
            return;
        }
        let factor = self.consecutive_rejections.count(report, self.inflate_after_rejections);
        report.inflation = factor
            .map(|factor| factor.min(self.largest_factor()))
            .filter(|factor| *factor > 1.0);
        if let Some(factor) = report.inflation {
            self.inflate(factor);
        }
    }

    /// Factor that keeps attitude and position sigmas below their limits.
    ///
    /// A method with a wrong assumption is rejected again and again, and must not inflate its covariance without bound.
    fn largest_factor(&self) -> f64 {
        let largest = |block: usize| (block..block + 3).fold(0.0_f64, |most, k| most.max(self.covariance[(k, k)]));
        let factor = |sd: f64, variance: f64| sd * sd / variance;
        factor(MAX_ATTITUDE_SD_RAD, largest(ATTITUDE)).min(factor(MAX_POSITION_SD_M, largest(POSITION)))
    }

    /// Multiplies the covariance of position, attitude, velocity and IMU biases, which adds noise to these states.
    fn inflate(&mut self, factor: f64) {
        let mut inertial = self.covariance.fixed_view_mut::<DVL_BIAS, DVL_BIAS>(0, 0);
        inertial *= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fix(verdict: Verdict, nis: f64) -> UpdateReport {
        UpdateReport {
            verdict,
            nis,
            degrees: 3,
            ..UpdateReport::empty(Sensor::Beams, 0)
        }
    }

    /// By hand: NIS 15, 18 and 21 of 3 degrees have a mean ratio of 6; an accepted fix resets the count.
    #[test]
    fn factor_is_the_mean_over_consecutive_rejections() {
        let mut consecutive_rejections = ConsecutiveRejections::default();
        let counted: Vec<_> = [(Verdict::Rejected, 99.0), (Verdict::Accepted, 1.0)]
            .into_iter()
            .chain([15.0, 18.0, 21.0, 15.0].map(|nis| (Verdict::Rejected, nis)))
            .map(|(verdict, nis)| consecutive_rejections.count(&fix(verdict, nis), 3))
            .collect();
        assert_eq!(counted, [None, None, None, None, Some(6.0), None]);
    }
}
