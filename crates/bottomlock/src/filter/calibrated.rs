//! A filter's readings with the further states as it estimates them.

use std::borrow::Cow;

use nalgebra::SMatrix;

use super::Eskf;
use crate::aiding::calibration::{Calibration, CalibrationCovariance, calibrated_beam_terms};
use crate::aiding::further::block;
use crate::aiding::{self, BeamTerms, Innovation, Motion};
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error_model::Coefficients;
use crate::layout::{DIM, VELOCITY};
use crate::mechanisation::Inertial;

impl Eskf {
    /// Estimated mounting and clock of the DVL with the covariance of their errors; `None` where they are taken as stated.
    #[must_use]
    pub fn calibration(&self) -> Option<(Calibration, CalibrationCovariance)> {
        let calibration = self.extensions.further().calibration()?;
        Some((calibration, self.extensions.covariance_of(block::CALIBRATION.first)))
    }

    /// Brings the mean acceleration up to date before a ping, where the clock is unknown.
    pub(crate) fn prepare_for_ping(&mut self) {
        if self.extensions.change.is_some() {
            self.propagate_covariance();
        }
    }

    /// [`aiding::beam_terms`] at the estimated mounting and clock.
    pub(crate) fn beam_terms(&self, geometry: &BeamGeometry, ping: &BeamSample) -> BeamTerms {
        self.with_motion(|motion| self.beam_terms_at(motion, geometry, ping))
    }

    pub(super) fn beam_terms_at(&self, motion: &Motion<'_>, geometry: &BeamGeometry, ping: &BeamSample) -> BeamTerms {
        let further = self.extensions.further();
        let mut terms = match (self.extensions.change.as_deref(), further.calibration()) {
            (Some(change), Some(calibration)) => {
                let change = change.motion_change(self.velocity_by_state());
                calibrated_beam_terms(motion, &change, geometry, &calibration, ping)
            }
            _ => aiding::beam_terms(motion, geometry, ping),
        };
        self.add_biases_to(&mut terms, ping);
        terms
    }

    /// A geometry at the estimated mounting.
    pub(crate) fn calibrated_geometry<'a>(&self, geometry: &'a BeamGeometry) -> Cow<'a, BeamGeometry> {
        match self.extensions.further().calibration() {
            None => Cow::Borrowed(geometry),
            Some(calibration) => Cow::Owned(geometry.clone().turned(calibration.mounting)),
        }
    }

    /// An innovation less the estimated slow errors of its sensor, with what the further states add to its noise; `None` for
    /// one that they have no part in.
    pub(super) fn with_further_noise(&self, innovation: &Innovation) -> Option<Box<Innovation>> {
        let rows = innovation.by_further.as_deref()?;
        let further = self.extensions.further();
        if further
            .states()
            .all(|k| rows.column(k).iter().all(|&number| number == 0.0))
        {
            return None;
        }
        let mut whole = Box::new(Innovation {
            by_further: None,
            cross: innovation.cross.clone(),
            correlated_noise: innovation.correlated_noise.clone(),
            corrected_path: innovation.corrected_path.clone(),
            ..*innovation
        });
        for (k, estimate) in further.added() {
            whole.residual.axpy(-estimate, &rows.column(k), 1.0);
        }
        further.add_to(&mut whole, rows);
        Some(whole)
    }

    /// Adds what the further states add to S to the noise of a ping's beams, with the covariance as it stands.
    pub(crate) fn add_further_to(&self, terms: &mut BeamTerms) {
        if let Some(rows) = &terms.by_further {
            let further = self.extensions.further();
            terms.noise += further.added_to_innovation(&terms.jacobian, rows);
        }
    }

    /// The rows of F for the velocity, at the state as it stands.
    pub(super) fn velocity_by_state(&self) -> SMatrix<f64, 3, DIM> {
        let inertial = Inertial {
            rate_p_radps: (self.last_rate_p_radps - self.state.gyro_bias_p_radps.0).into(),
            force_p_mps2: [0.0; 3],
        };
        let earth = &self.earth;
        let f = Coefficients::at(&self.kinematics, &inertial, earth).dense(earth);
        SMatrix::from_fn(|i, j| f[VELOCITY + i][j])
    }
}

#[cfg(test)]
#[path = "calibration_tests.rs"]
mod tests;
