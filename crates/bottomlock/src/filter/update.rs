//! One innovation: judged by the gate, taken into covariance and state, reported.

use nalgebra::SMatrix;

use super::Eskf;
use super::inflation::is_explicable;
use super::joseph::Expectation;
use crate::aiding::Innovation;
use crate::aiding::water::WATER;
use crate::error::NavError;
use crate::error_model::Interval;
use crate::filter::gate::Gate;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::filter::water_block::Update;
use crate::layout::{DIM, block_name};
use crate::state::ErrorVector;

impl Eskf {
    /// `shared` is the covariance of the further states with the noise, where there is any.
    pub(super) fn fuse<const M: usize>(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
        shared: Option<&SMatrix<f64, WATER, M>>,
    ) -> Result<UpdateReport, NavError> {
        // Borrowed where it was made: it is large.
        let seen = Expectation::<M>::of(&self.covariance, innovation);
        let seen = seen.as_ref().ok_or(NavError::NotPositiveDefinite {
            matrix: "innovation covariance",
            time_ns: self.state.time_ns,
        })?;
        let mut report = UpdateReport {
            rows: M,
            degrees: innovation.degrees,
            nis: seen.nis,
            threshold: self.gate.threshold(innovation.degrees),
            verdict: Verdict::Accepted,
            ..UpdateReport::empty(sensor, self.state.time_ns)
        };
        for n in 0..M {
            report.residual[n] = innovation.residual[n];
            for m in 0..M {
                report.covariance[(m, n)] = seen.s[(m, n)];
            }
        }

        match self.gate.gate {
            Gate::Off => {}
            Gate::Joint { .. } => {
                if report.nis > report.threshold {
                    report.verdict = Verdict::Rejected;
                }
            }
            Gate::PerRow => {
                let rejected: u8 = (0..M)
                    .filter(|&k| innovation.residual[k].powi(2) > 9.0 * seen.s[(k, k)])
                    .fold(0, |bits, k| bits | 1 << k);
                if rejected != 0 {
                    let kept = innovation.select(|row| rejected & (1 << row) == 0);
                    if kept.rows == 0 {
                        report.verdict = Verdict::Rejected;
                    } else {
                        self.update(&kept, sensor)?;
                        report.verdict = Verdict::AcceptedInPart {
                            rejected_rows: rejected,
                        };
                        return Ok(report);
                    }
                }
            }
        }
        let is_rejected = report.verdict == Verdict::Rejected;
        if !is_rejected || is_explicable(&self.covariance, innovation, &seen.s, report.threshold) {
            self.inflate_after_rejections(&mut report);
        }
        if is_rejected {
            return Ok(report);
        }

        let correction = seen.correct(&mut self.covariance, innovation);
        let correction = correction
            .as_ref()
            .map_err(|refused| not_positive_definite(refused.negative, self.state.time_ns))?;
        if self.extensions.water.is_some() || self.extensions.tape.is_some() {
            self.follow_update(innovation, seen, &correction.gain, shared);
        }
        self.feed_back(&correction.error);
        Ok(report)
    }

    /// The further states and the tape, where there are any, after an update of the error state.
    fn follow_update<const M: usize>(
        &mut self,
        innovation: &Innovation,
        seen: &Expectation<M>,
        gain: &SMatrix<f64, DIM, M>,
        shared: Option<&SMatrix<f64, WATER, M>>,
    ) {
        let z = innovation.residual.fixed_rows::<M>(0).into_owned();
        let factor = seen.cholesky();
        let mut own_gain = None;
        if let Some(water) = &mut self.extensions.water {
            let update = Update {
                z: &z,
                h: &innovation.jacobian.fixed_rows::<M>(0).into_owned(),
                s: &seen.s,
                factor: &factor,
                cross_covariance: &seen.cross_covariance,
                gain,
            };
            own_gain = Some(water.follow(&update, &shared.copied().unwrap_or_else(SMatrix::zeros)));
        }
        if self.extensions.tape.is_some() {
            self.record_update(innovation, &z, &factor, gain, own_gain.as_ref());
        }
    }

    fn feed_back(&mut self, error: &ErrorVector) {
        let mut state = self.state();
        state.inject(error);
        self.state = state;
        self.kinematics = state.kinematics();
        self.interval = Interval::Open;
    }
}

/// Names the block of a negative variance, where there is one.
pub(super) fn not_positive_definite(negative: Option<usize>, time_ns: i64) -> NavError {
    NavError::NotPositiveDefinite {
        matrix: negative.map_or("state covariance", block_name),
        time_ns,
    }
}
