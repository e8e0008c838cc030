//! One update: gate, correction of covariance and state, report.

use nalgebra::SMatrix;

use super::Eskf;
use super::further_update::Update;
use super::joseph::PredictedInnovation;
use crate::aiding::sensor::Quantity;
use crate::aiding::{Innovation, TangentRows};
use crate::error::NavError;
use crate::error_model::Interval;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::layout::{ATTITUDE, DIM, block_name};
use crate::state::ErrorVector;

impl Eskf {
    /// Tests an innovation of at most M rows, corrects covariance and state, and reports.
    pub(super) fn fuse<const M: usize>(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
    ) -> Result<UpdateReport, NavError> {
        // Borrowed from here on, since it is large.
        let predicted = PredictedInnovation::<M>::of(&self.covariance, innovation);
        let predicted = predicted.as_ref().ok_or(NavError::NotPositiveDefinite {
            matrix: "innovation covariance",
            time_ns: self.state.time_ns,
        })?;
        let mut report = self.report(innovation, sensor, predicted);

        let rejected_rows = if self.is_doubted(innovation, sensor) {
            u8::MAX
        } else {
            self.gate.rejected_rows(&report)
        };
        let is_rejected = (0..innovation.rows).all(|row| rejected_rows & (1 << row) != 0);
        if rejected_rows != 0 && !is_rejected {
            self.fuse_rows(&innovation.select(|row| rejected_rows & (1 << row) == 0), sensor)?;
            report.verdict = Verdict::AcceptedInPart { rejected_rows };
            return Ok(report);
        }
        if is_rejected {
            report.verdict = Verdict::Rejected;
            return Ok(report);
        }

        let share_of_way = self.share_of_way(&self.covariance);
        let mut correction = predicted
            .correct(&mut self.covariance, innovation)
            .map_err(|indefinite| not_positive_definite(indefinite.negative, self.state.time_ns))?;
        if !self.extensions.is_empty() {
            self.update_extensions(innovation, predicted, &correction.gain);
        }
        if innovation.tangent_rows == TangentRows::None && sensor.quantity() == Some(Quantity::Velocity) {
            self.measured.velocity_ns = Some(self.state.time_ns);
            self.test_lasting(innovation, predicted);
        }
        if let Some(path) = &innovation.corrected_path {
            self.move_to_corrected_path(path, &mut correction.error);
        } else {
            self.follow_corrected_path(&mut correction.error, share_of_way);
        }
        self.note_horizontal_position();
        self.feed_back(&correction.error);
        Ok(report)
    }

    /// The report of an innovation before the gate, with the verdict `Accepted`.
    fn report<const M: usize>(
        &self,
        innovation: &Innovation,
        sensor: Sensor,
        predicted: &PredictedInnovation<M>,
    ) -> UpdateReport {
        let mut report = UpdateReport {
            rows: innovation.rows,
            degrees: innovation.degrees,
            nis: predicted.nis,
            threshold: self.gate.threshold(innovation.degrees),
            verdict: Verdict::Accepted,
            is_beyond_linear_range: self.is_beyond_linear_range(),
            ..UpdateReport::empty(sensor, self.state.time_ns)
        };
        for n in 0..innovation.rows {
            report.residual[n] = innovation.residual[n];
            for m in 0..innovation.rows {
                report.covariance[(m, n)] = predicted.s[(m, n)];
            }
        }
        report
    }

    /// Updates the further states and the tape, where they exist, after an update of the error state.
    fn update_extensions<const M: usize>(
        &mut self,
        innovation: &Innovation,
        predicted: &PredictedInnovation<M>,
        gain: &SMatrix<f64, DIM, M>,
    ) {
        let z = innovation.residual.fixed_rows::<M>(0).into_owned();
        let factor = predicted.cholesky();
        let update = Update {
            z: &z,
            s: &predicted.s,
            factor: &factor,
            cross_covariance: &predicted.cross_covariance,
            gain,
        };
        let yaw_rad = (gain.row(ATTITUDE + 2) * z)[0];
        let further_gain = self.extensions.update(&update, innovation, yaw_rad);
        if self.extensions.tape.is_some() {
            self.record_update(innovation, &update, &further_gain);
        }
    }

    /// Adds the estimated error to the state (closed loop).
    fn feed_back(&mut self, error: &ErrorVector) {
        let mut state = self.state();
        state.inject(error);
        self.state = state;
        self.kinematics = state.kinematics();
        self.interval = Interval::Open;
        self.extensions.begin_interval(&self.kinematics);
    }
}

/// The error for an indefinite covariance, which names the block of a negative variance if there is one.
pub(super) fn not_positive_definite(negative: Option<usize>, time_ns: i64) -> NavError {
    NavError::NotPositiveDefinite {
        matrix: negative.map_or("state covariance", block_name),
        time_ns,
    }
}

#[cfg(test)]
#[path = "update_tests.rs"]
mod tests;
