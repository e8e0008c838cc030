//! A gate that refuses fix after fix has the filter against it, not the sensor.
//!
//! Right fixes are refused rarely and one at a time: at 99.73 % five in a row come once in 10¹² fixes. But where the filter
//! is wrong by more than it claims, by an initial tilt of four sigma say, the innovation grows as its own sigma grows, NIS
//! stays where it is, and the gate refuses every fix of a mission. After a number of consecutive_rejections in a row the covariance of the
//! inertial states is therefore multiplied by the mean of NIS over its degrees of freedom: the factor by which it was too
//! small for what was seen. The next fix is judged by what is then claimed; nothing is taken without a gate.
//!
//! Beams that contradict each other are refused however wide the covariance is. They are the sensor's fault and do not count.

use nalgebra::SMatrix;

use super::Eskf;
use crate::aiding::Innovation;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::layout::{ATTITUDE, DVL_BIAS, POSITION};
use crate::state::Covariance;

/// An inertial covariance wider by this factor explains all that an inertial state can explain.
const WIDEST: f64 = 1e6;

/// Attitude sigma beyond which nothing is inflation, rad.
const WIDEST_ATTITUDE_RAD: f64 = 1.0;
/// Position sigma beyond which nothing is inflation, m.
const WIDEST_POSITION_M: f64 = 1e6;

/// ConsecutiveRejections in a row of the fixes of velocity.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ConsecutiveRejections {
    fixes: u32,
    nis_per_degree: f64,
}

impl ConsecutiveRejections {
    /// Counts a fix; the factor for the covariance where it completes `limit` consecutive_rejections (0: never).
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

/// True where an innovation, its covariance being `s`, would pass if the inertial states were known as badly as can be.
pub(super) fn is_explicable<const M: usize>(
    p: &Covariance,
    innovation: &Innovation,
    s: &SMatrix<f64, M, M>,
    threshold: f64,
) -> bool {
    let z = innovation.residual.fixed_rows::<M>(0);
    let by_inertial = innovation.jacobian.fixed_view::<M, DVL_BIAS>(0, 0);
    let inertial = p.fixed_view::<DVL_BIAS, DVL_BIAS>(0, 0);
    let widest = s + by_inertial * inertial * by_inertial.transpose() * WIDEST;
    widest
        .cholesky()
        .is_some_and(|factor| !(z.dot(&factor.solve(&z)) > threshold))
}

impl Eskf {
    /// Widens the covariance where the gate has refused one fix of velocity too many, and says so in the report.
    pub(super) fn inflate_after_rejections(&mut self, report: &mut UpdateReport) {
        // Assumptions stay refused, and what a depth sensor says may be wrong for a mission.
        if !matches!(report.sensor, Sensor::Beams | Sensor::Velocity) || self.inflate_after_rejections == 0 {
            return;
        }
        let factor = self.consecutive_rejections.count(report, self.inflate_after_rejections);
        report.inflation = factor
            .map(|factor| factor.min(self.greatest_factor()))
            .filter(|factor| *factor > 1.0);
        if let Some(factor) = report.inflation {
            self.inflate(factor);
        }
    }

    /// What leaves every attitude within a radian and every position within the sea: a method that is wrong again and again,
    /// since its assumption is, must not widen without end.
    fn greatest_factor(&self) -> f64 {
        let greatest = |block: usize| (block..block + 3).fold(0.0_f64, |most, k| most.max(self.covariance[(k, k)]));
        let within = |sd: f64, variance: f64| sd * sd / variance;
        within(WIDEST_ATTITUDE_RAD, greatest(ATTITUDE)).min(within(WIDEST_POSITION_M, greatest(POSITION)))
    }

    /// Multiplies the covariance of position, attitude, velocity and the IMU's biases among themselves: noise is added to them.
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

    /// By hand: NIS 15, 18 and 21 of 3 degrees are 6 on average; one accepted fix in between starts the count anew.
    #[test]
    fn factor_is_the_mean_of_a_row_of_refusals() {
        let mut consecutive_rejections = ConsecutiveRejections::default();
        let counted: Vec<_> = [(Verdict::Rejected, 99.0), (Verdict::Accepted, 1.0)]
            .into_iter()
            .chain([15.0, 18.0, 21.0, 15.0].map(|nis| (Verdict::Rejected, nis)))
            .map(|(verdict, nis)| consecutive_rejections.count(&fix(verdict, nis), 3))
            .collect();
        assert_eq!(counted, [None, None, None, None, Some(6.0), None]);
    }
}
