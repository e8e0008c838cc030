//! Beams that the water returned: the velocity relative to the water along each.
//!
//! With R platform to tangent, c the current and l the lever arm of a beam, its reading is that of a beam that the bottom returned
//! (`beams.rs`) at the velocity relative to the water:
//!
//! ```text
//! y_i = (1 + SF) b_iᵀ (v − Rᵀ c) + b_iᵀ (ω × l_i) + bias_i + n
//! ```
//!
//! c is the current of [`crate::aiding::water`], whose error it has too: no row changes the yaw. Water alone leaves one thing open: a
//! velocity over ground and the same current, v + Rᵀδ and c + δ, give the same readings. Tilt and accelerometer biases stay bounded,
//! since they act on v − Rᵀc, which the beams measure.

use nalgebra::Vector3;

use crate::aiding::further::{FIRST_WATER, FurtherRows};
use crate::aiding::water::{CURRENT, WaterVector};
use crate::aiding::{BeamTerms, Motion};
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::frames::{Vec3, skew};
use crate::layout::ATTITUDE;
use crate::state::NavState;

/// Residual, Jacobian and noise of the beams of a ping that the water returned.
///
/// `beams_at` gives those of a ping that the bottom returned, at any motion.
#[must_use]
pub fn water_track_terms(
    motion: &Motion<'_>,
    geometry: &BeamGeometry,
    water: &WaterVector,
    ping: &BeamSample,
    beams_at: impl FnOnce(&Motion<'_>) -> BeamTerms,
) -> BeamTerms {
    let (rotation, level) = (motion.rotation(), &motion.level);
    let current_t = level.rotation_t_n * Vector3::new(water[CURRENT], water[CURRENT + 1], 0.0);
    let state = NavState {
        velocity_p_mps: Vec3::from(motion.state.velocity_p_mps.0 - rotation.tr_mul(&current_t)),
        ..*motion.state
    };
    let mut terms = beams_at(&Motion {
        state: &state,
        ..*motion
    });
    let (scale, down_t) = (1.0 + state.dvl_scale_factor, level.down_t());
    let further = terms.by_further.get_or_insert_with(|| Box::new(FurtherRows::zeros()));
    for beam in ping.valid.iter() {
        let direction_t = rotation * geometry.direction_p(beam) * scale;
        // R = Exp([ρ×]) R̂ gives Rᵀc = R̂ᵀ(c + [c×]ρ); the part about the vertical belongs to the current's own error.
        let turned = skew(&current_t) * direction_t;
        let by_misalignment = turned - down_t * down_t.dot(&turned);
        for k in 0..3 {
            terms.jacobian[(beam, ATTITUDE + k)] += by_misalignment[k];
        }
        let direction_n = level.rotation_t_n.tr_mul(&direction_t);
        further[(beam, FIRST_WATER + CURRENT)] = -direction_n.x;
        further[(beam, FIRST_WATER + CURRENT + 1)] = -direction_n.y;
    }
    terms
}

#[cfg(test)]
#[path = "water_track_tests.rs"]
mod tests;
