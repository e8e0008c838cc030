//! The current as a filter estimates it, and the beams that the water returned as rows on it.

use nalgebra::{Matrix2, Vector2};

use super::Eskf;
use crate::aiding::current_layers::{CurrentAt, Layer, Water};
use crate::aiding::further::block;
use crate::aiding::water::{CURRENT, WaterCovariance};
use crate::aiding::water_track::{WaterSample, cell_t_m, water_track_terms};
use crate::aiding::{self, Innovation};
use crate::dvl::geometry::BeamGeometry;
use crate::filter::water_block::WaterBlock;
use crate::layout::ATTITUDE;

/// The current, north and east, m/s, and its covariance about true north, (m/s)².
pub type CurrentEstimate = (Vector2<f64>, Matrix2<f64>);

impl Eskf {
    /// What is known of the motion through the water beside the estimates of its states.
    #[must_use]
    pub fn water(&self) -> Option<&WaterBlock> {
        self.extensions.water.as_deref()
    }

    /// The water states as they are estimated, at the time of the last update or propagation of the covariance.
    #[must_use]
    pub fn water_states(&self) -> Option<Water<'_>> {
        let further = self.extensions.further();
        self.water().map(|water| further.water(water.layers()))
    }

    /// The current at the vehicle's depth, north and east, m/s, with its covariance about true north, (m/s)²: with the error of
    /// the heading along which the estimate is expressed; at the time of [`Eskf::water`].
    #[must_use]
    pub fn current(&self) -> Option<CurrentEstimate> {
        self.current_at_vehicle().map(|at| self.current_of(&at))
    }

    /// [`Eskf::current`] at any depth.
    #[must_use]
    pub fn current_of(&self, at: &CurrentAt) -> CurrentEstimate {
        let current = at.water.fixed_rows::<2>(CURRENT).into_owned();
        let further = self.extensions.further();
        let parts = at.parts();
        // c − ĉ = ρ_D e_D × ĉ + δc, to first order.
        let by_yaw = Vector2::new(-current.y, current.x);
        let (mut yaw_cross, mut own) = (Matrix2::zeros(), Matrix2::zeros());
        for (first, weight) in &parts {
            yaw_cross += by_yaw * further.cross().fixed_view::<1, 2>(ATTITUDE + 2, *first) * *weight;
            for (other, by_other) in &parts {
                own += further.covariance().fixed_view::<2, 2>(*first, *other) * (weight * by_other);
            }
        }
        let yaw_variance = self.covariance[(ATTITUDE + 2, ATTITUDE + 2)];
        let by_yaw_twice = by_yaw * yaw_variance * by_yaw.transpose();
        (current, own + by_yaw_twice + yaw_cross + yaw_cross.transpose())
    }

    /// Covariance of the errors of the water states; `None` without them.
    #[must_use]
    pub fn water_covariance(&self) -> Option<WaterCovariance> {
        self.water().map(|_| self.extensions.covariance_of(block::WATER.first))
    }

    /// Beams that the water returned, as rows at the estimated current; no row without the current as states.
    pub(crate) fn water_track_innovation(&self, geometry: &BeamGeometry, sample: &WaterSample) -> Innovation {
        let Some(water) = self.water_states() else {
            return Innovation::empty();
        };
        let turned = self.calibrated_geometry(geometry);
        let terms = self.with_motion(|motion| {
            water_track_terms(motion, &turned, &water, sample, |relative| {
                self.beam_terms_at(relative, geometry, &sample.ping)
            })
        });
        aiding::tightly_coupled(&terms, &sample.ping)
    }

    /// Whether the current is estimated by depth.
    pub(super) fn has_layers(&self) -> bool {
        self.water().is_some_and(|water| water.layers().is_some())
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
        if !self.has_layers() {
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
        let Some(water) = self.water_states() else {
            return;
        };
        let measured: Vec<CurrentAt> = cells_m.into_iter().map(|depth_m| water.at(depth_m)).collect();
        if let Some(layers) = self.extensions.water.as_deref_mut().and_then(WaterBlock::layers_mut) {
            measured.iter().for_each(|at| layers.note(at));
        }
    }

    /// The current's layers, the uppermost first, each with the current at its depth and its covariance as [`Eskf::current`] has
    /// them.
    #[must_use]
    pub fn layers(&self) -> Vec<(Layer, CurrentEstimate)> {
        let Some((water, layers)) = self.water_states().and_then(|water| Some((water, water.layers?))) else {
            return Vec::new();
        };
        let with_current = |layer: Layer| (layer, self.current_of(&water.at(layer.depth_m)));
        layers.each().map(with_current).collect()
    }

    /// The current at the vehicle, where it is estimated.
    pub(crate) fn current_at_vehicle(&self) -> Option<CurrentAt> {
        self.with_motion(|motion| motion.water)
    }
}
