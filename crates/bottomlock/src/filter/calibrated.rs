//! A filter's readings with the further states as it estimates them.

use std::borrow::Cow;

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::Eskf;
use crate::aiding::calibration::{Calibration, CalibrationCovariance, calibrated_beam_terms};
use crate::aiding::current_layers::{CurrentAt, Layer};
use crate::aiding::further::FIRST_CALIBRATION;
use crate::aiding::water_track::{WaterSample, cell_t_m, water_track_terms};
use crate::aiding::{self, BeamTerms, Innovation, Motion};
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error_model::Coefficients;
use crate::filter::water_block::WaterBlock;
use crate::layout::{DIM, VELOCITY};
use crate::mechanisation::Inertial;

/// The current, north and east, m/s, and its covariance about true north, (m/s)².
pub type CurrentEstimate = (Vector2<f64>, Matrix2<f64>);

impl Eskf {
    /// Estimated mounting and clock of the DVL with the covariance of their errors; `None` where they are taken as stated.
    #[must_use]
    pub fn calibration(&self) -> Option<(Calibration, CalibrationCovariance)> {
        let block = self.extensions.calibration.as_deref()?;
        Some((*block.estimate(), self.extensions.covariance_of(FIRST_CALIBRATION)))
    }

    /// Brings the mean acceleration up to date before a ping, where the clock is unknown.
    pub(crate) fn prepare_for_ping(&mut self) {
        if self.extensions.calibration.is_some() {
            self.propagate_covariance();
        }
    }

    /// [`aiding::beam_terms`] at the estimated mounting and clock.
    pub(crate) fn beam_terms(&self, geometry: &BeamGeometry, ping: &BeamSample) -> BeamTerms {
        self.with_motion(|motion| self.beam_terms_at(motion, geometry, ping))
    }

    fn beam_terms_at(&self, motion: &Motion<'_>, geometry: &BeamGeometry, ping: &BeamSample) -> BeamTerms {
        match self.extensions.calibration.as_deref() {
            None => aiding::beam_terms(motion, geometry, ping),
            Some(block) => {
                let change = block.motion_change(self.velocity_by_state());
                calibrated_beam_terms(motion, &change, geometry, block.estimate(), ping)
            }
        }
    }

    /// Beams that the water returned, as rows at the estimated current; no row without the current as states.
    pub(crate) fn water_track_innovation(&self, geometry: &BeamGeometry, sample: &WaterSample) -> Innovation {
        let Some(water) = self.water() else {
            return Innovation::empty();
        };
        let turned = self.calibrated_geometry(geometry);
        let current = (water.estimate(), water.layers());
        let terms = self.with_motion(|motion| {
            water_track_terms(motion, &turned, current, sample, |relative| {
                self.beam_terms_at(relative, geometry, &sample.ping)
            })
        });
        aiding::tightly_coupled(&terms, &sample.ping)
    }

    /// Depths of the cells of a sample, m.
    fn cell_depths_m(&self, geometry: &BeamGeometry, sample: &WaterSample) -> Vec<f64> {
        let turned = self.calibrated_geometry(geometry);
        self.with_motion(|motion| {
            let down_t = motion.level.down_t();
            let below_m = |beam| down_t.dot(&cell_t_m(motion, &turned, beam, sample.range_m));
            let valid = sample.ping.valid.iter();
            valid.map(|beam| motion.level.depth_m + below_m(beam)).collect()
        })
    }

    /// Moves the current's layers to the depth of the vehicle, and to those of the cells of a sample.
    pub(crate) fn prepare_for_water(&mut self, cells: Option<(&BeamGeometry, &WaterSample)>) {
        if self.water().and_then(WaterBlock::layers).is_none() {
            return;
        }
        let vehicle_m = self.with_motion(|motion| motion.level.depth_m);
        let cells_m = cells.map_or_else(Vec::new, |(geometry, sample)| self.cell_depths_m(geometry, sample));
        let upper_m = cells_m.iter().copied().fold(vehicle_m, f64::min);
        let lower_m = cells_m.iter().copied().fold(vehicle_m, f64::max);
        self.extensions.enclose_depths(upper_m, lower_m);
    }

    /// Takes note of the layers that a sample has measured.
    pub(crate) fn note_water(&mut self, geometry: &BeamGeometry, sample: &WaterSample) {
        let cells_m = self.cell_depths_m(geometry, sample);
        if let Some(water) = self.extensions.water.as_deref_mut() {
            cells_m.into_iter().for_each(|depth_m| water.note(depth_m));
        }
    }

    /// The current's layers, the uppermost first, each with the current at its depth and its covariance as [`Eskf::current`] has
    /// them.
    #[must_use]
    pub fn layers(&self) -> Vec<(Layer, CurrentEstimate)> {
        let Some((water, layers)) = self.water().and_then(|water| Some((water, water.layers()?))) else {
            return Vec::new();
        };
        let with_current = |layer: Layer| (layer, self.current_of(&water.at(layer.depth_m)));
        layers.each().map(with_current).collect()
    }

    /// The current at the vehicle, where it is estimated.
    pub(crate) fn current_at_vehicle(&self) -> Option<CurrentAt> {
        let depth_m = self.with_motion(|motion| motion.level.depth_m);
        self.water().map(|water| water.at(depth_m))
    }

    /// A geometry at the estimated mounting.
    pub(crate) fn calibrated_geometry<'a>(&self, geometry: &'a BeamGeometry) -> Cow<'a, BeamGeometry> {
        match self.extensions.calibration.as_deref() {
            None => Cow::Borrowed(geometry),
            Some(block) => Cow::Owned(geometry.clone().turned(block.estimate().mounting)),
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
        let estimate = self.extensions.processes.estimate();
        for k in further.states().filter(|&k| estimate[k] != 0.0) {
            whole.residual.axpy(-estimate[k], &rows.column(k), 1.0);
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
