//! Updates with the verdict of another filter's gate, and assumptions on the motion through the water.

use nalgebra::{Matrix3, Vector3};

use super::Eskf;
use crate::aiding::Innovation;
use crate::aiding::further::{FurtherRows, block};
use crate::aiding::water::{WATER, WaterRow};
use crate::error::NavError;
use crate::filter::gate::{Gate, GateTable};
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::filter::slip_test::Alarm;
use crate::layout::VELOCITY;
use crate::state::Covariance;

/// Chi-squared quantile of three degrees at 1 − 1e-6: tested at every epoch, so it must not be exceeded by chance in a
/// mission.
const EXCLUDED: f64 = 30.665;

impl Eskf {
    /// Sets the time between two IMU samples, s: a measurement may split a step, which does not change the gyro noise
    /// of the sample.
    pub(crate) fn note_interval(&mut self, interval_s: f64) {
        self.last_step_s = interval_s;
    }

    /// The velocity, platform frame, m/s, and its covariance, (m/s)², as the last update or propagation left them.
    pub(crate) fn velocity(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let own = self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY).into_owned();
        (Vector3::from(self.kinematics.velocity_p_mps), own)
    }

    /// The covariance at the time of the state, propagated as for an update.
    pub(crate) fn propagated_covariance(&mut self) -> Covariance {
        self.propagate_covariance();
        self.covariance
    }

    /// Returns true if this filter's covariance excludes the velocity of `other`; never with the gate off or beyond the
    /// linear range, where the covariance leaves second-order terms out.
    pub(crate) fn excludes_velocity_of(&self, other: &Self) -> bool {
        let (velocity, own) = self.velocity();
        let difference = other.velocity().0 - velocity;
        self.gate.gate != Gate::Off
            && !self.is_beyond_linear_range()
            && own
                .cholesky()
                .is_some_and(|factor| difference.dot(&factor.solve(&difference)) > EXCLUDED)
    }

    /// Updates with the rows that another filter's gate accepted, without a gate of its own; returns whether they are
    /// plausible to this filter.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub fn update_with_verdict(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
        verdict: Verdict,
    ) -> Result<bool, NavError> {
        let rejected = match verdict {
            Verdict::Accepted => 0,
            Verdict::AcceptedInPart { rejected_rows } => rejected_rows,
            Verdict::Rejected | Verdict::NoInformation | Verdict::Withheld => u8::MAX,
        };
        let own = std::mem::replace(&mut self.gate, GateTable::open());
        let outcome = if rejected == 0 {
            self.update(innovation, sensor)
        } else {
            self.update(&innovation.select(|row| rejected & (1 << row) == 0), sensor)
        };
        self.gate = own;
        outcome.map(|report| !(report.nis > self.plausible.threshold(report.degrees)))
    }

    /// Updates with an assumption on the motion through the water, gated by itself; without water states it has no row.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub fn assume(&mut self, row: &WaterRow, sensor: Sensor) -> Result<UpdateReport, NavError> {
        self.propagate_covariance();
        let Some(water) = &mut self.extensions.water else {
            return Ok(UpdateReport::empty(sensor, self.state.time_ns));
        };
        let uncertainty_m2ps2 = water.begin_epoch(row);
        if let Some(further) = &mut self.extensions.further {
            further.add_variance(block::WATER.first + row.slip, uncertainty_m2ps2);
        }
        let mut innovation = Innovation {
            rows: 1,
            degrees: 1,
            ..Innovation::empty()
        };
        innovation.residual[0] = row.residual;
        innovation.jacobian.set_row(0, &row.by_state.transpose());
        innovation.noise[(0, 0)] = row.variance;
        let mut rows = Box::new(FurtherRows::zeros());
        rows.fixed_view_mut::<1, WATER>(0, block::WATER.first)
            .copy_from(&row.by_water.transpose());
        if let Some(at) = self.current_at_vehicle().filter(|_| self.has_layers()) {
            self.with_motion(|motion| at.complete(motion, &Vector3::zeros(), 0, &mut innovation.jacobian, &mut rows));
        }
        innovation.by_further = Some(rows);
        self.update(&innovation, sensor)
    }

    /// Tests the assumptions by the reports of a ping's rows, of sway and of heave; never with the gate off. The rows are linear
    /// in the velocity, so that they are tested beyond the linear range too.
    pub(crate) fn test_slips(&mut self, reports: &[UpdateReport; 2]) -> [Option<Alarm>; 2] {
        if self.gate.gate == Gate::Off {
            return [None; 2];
        }
        let normalised = reports.map(|report| report.residual[0] / report.covariance[(0, 0)].sqrt());
        (self.extensions.water.as_mut()).map_or([None; 2], |water| water.test(normalised))
    }
}

#[cfg(test)]
#[path = "assume_tests.rs"]
mod tests;
