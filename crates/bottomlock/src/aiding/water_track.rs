//! Beams that the water returned: the velocity relative to the water along each.
//!
//! With R platform to tangent, c(z) the current at the depth of the cell and l the lever arm of a beam, its reading is that of a
//! beam that the bottom returned (`beams.rs`) at the velocity relative to the water:
//!
//! ```text
//! y_i = (1 + SF) b_iᵀ (v − Rᵀ c(z_i)) + b_iᵀ (ω × l_i) + bias_i + n,   z_i = z + D·R (l_i + r b_i)
//! ```
//!
//! with D down at the vehicle and r the range of the cell. c is the current of [`crate::aiding::water`] and
//! [`crate::aiding::current_layers`], whose error it has too: no row changes the yaw. Water alone leaves one thing open: a
//! velocity over ground and the same current, v + Rᵀδ and c + δ, give the same readings. Tilt and accelerometer biases stay bounded,
//! since they act on v − Rᵀc, which the beams measure.

use nalgebra::Vector3;

use crate::aiding::current_layers::Water;
use crate::aiding::further::{FurtherRows, block};
use crate::aiding::sensor::{Fraction, model_section};
use crate::aiding::water::CURRENT;
use crate::aiding::{BeamTerms, Motion};
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error::NavError;
use crate::frames::{Vec3, skew};
use crate::layout::ATTITUDE;
use crate::state::NavState;

/// Longest range of a cell, m: no DVL profiles that far.
const LONGEST_M: f64 = 2000.0;

/// Beams that the water returned.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WaterSample {
    /// The beams.
    pub ping: BeamSample,
    /// From the transducer along the beam to the middle of the cell, m; 0 for the water at the vehicle.
    pub range_m: f64,
}

impl WaterSample {
    /// Checks the numbers.
    ///
    /// # Errors
    /// As [`BeamSample::validate`]; [`NavError::OutOfRange`] for the range.
    pub fn validate(&self, geometry: &BeamGeometry) -> Result<(), NavError> {
        self.ping.validate(geometry)?;
        if (0.0..=LONGEST_M).contains(&self.range_m) {
            return Ok(());
        }
        Err(NavError::OutOfRange {
            field: "water track range_m",
            value: self.range_m,
            expected: "metres along the beam, from 0 (the water at the vehicle) to 2000",
        })
    }
}

/// From the vehicle to the cell of a beam, tangent frame, m.
#[must_use]
pub fn cell_t_m(motion: &Motion<'_>, geometry: &BeamGeometry, beam: usize, range_m: f64) -> Vector3<f64> {
    motion.rotation() * (geometry.lever_arm_p_m(beam) + geometry.direction_p(beam) * range_m)
}

model_section! {
    /// Errors of simulated beams that the water returned; bias and scale factor are those of the bottom's beams.
    pub struct WaterTrackModel in "water_track" {
        /// White noise of a beam, m/s, 1 sigma.
        pub beam_noise_sd_mps: f64,
        /// Distance along the beam from the transducer to the middle of the cell, m.
        pub range_m: f64,
        /// Fraction of readings of a beam that are outliers, such as fish; the filter does not model them.
        pub outlier_fraction: Fraction,
        /// Noise of an outlier over that of a good reading.
        pub outlier_factor: f64,
        /// Fraction of readings of a beam that are lost.
        pub lost_fraction: Fraction,
        /// Part of the vehicle's velocity relative to the water with which the water in the cell follows it.
        pub wake: Fraction,
    }
}

/// Residual, Jacobian and noise of the beams of a ping that the water returned.
///
/// `beams_at` gives those of a ping that the bottom returned, at any motion.
#[must_use]
pub fn water_track_terms(
    motion: &Motion<'_>,
    geometry: &BeamGeometry,
    water: &Water<'_>,
    sample: &WaterSample,
    beams_at: impl Fn(&Motion<'_>) -> BeamTerms,
) -> BeamTerms {
    let (rotation, level) = (motion.rotation(), &motion.level);
    let (scale, down_t) = (1.0 + motion.state.dvl_scale_factor, level.down_t());
    let mut terms = beams_at(motion);
    let mut further = terms
        .by_further
        .take()
        .unwrap_or_else(|| Box::new(FurtherRows::zeros()));
    for beam in sample.ping.valid.iter() {
        let cell_t_m = cell_t_m(motion, geometry, beam, sample.range_m);
        let at = water.at(level.depth_m + down_t.dot(&cell_t_m));
        let current_t = level.rotation_t_n * Vector3::new(at.water[CURRENT], at.water[CURRENT + 1], 0.0);
        let relative = beams_at(&Motion {
            state: &NavState {
                velocity_p_mps: Vec3::from(motion.state.velocity_p_mps.0 - rotation.tr_mul(&current_t)),
                ..*motion.state
            },
            ..*motion
        });
        terms.residual[beam] = relative.residual[beam];
        terms.jacobian.set_row(beam, &relative.jacobian.row(beam));
        if let Some(rows) = &relative.by_further {
            further.set_row(beam, &rows.row(beam));
        }
        let direction_t = rotation * geometry.direction_p(beam) * scale;
        // R = Exp([ρ×]) R̂ gives Rᵀc = R̂ᵀ(c + [c×]ρ); the part about the vertical belongs to the current's own error.
        let turned = skew(&current_t) * direction_t;
        let by_misalignment = turned - down_t * down_t.dot(&turned);
        for k in 0..3 {
            terms.jacobian[(beam, ATTITUDE + k)] += by_misalignment[k];
        }
        let direction_n = level.rotation_t_n.tr_mul(&direction_t);
        further[(beam, block::WATER.first + CURRENT)] = -direction_n.x;
        further[(beam, block::WATER.first + CURRENT + 1)] = -direction_n.y;
        at.complete(motion, &cell_t_m, beam, &mut terms.jacobian, &mut further);
    }
    terms.by_further = Some(further);
    terms
}

#[cfg(test)]
#[path = "water_track_tests.rs"]
pub(in crate::aiding) mod tests;
