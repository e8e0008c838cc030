//! The position of a point of the vehicle: the rows that every sensor of position has.
//!
//! A position in the tangent frame is exact however far from the origin; the standard deviations are those along north, east and
//! down at the vehicle.

use nalgebra::Matrix3;

use crate::aiding::{Innovation, Motion, TangentRows};
use crate::frames::{Platform, Tangent, Vec3, skew};
use crate::layout::{ATTITUDE, POSITION};

/// z = p_meas − (p + R l): a position in the tangent frame of a point at `lever_p_m`.
#[must_use]
pub fn position(
    motion: &Motion<'_>,
    position_t_m: &Vec3<Tangent>,
    sd_m: &[f64; 3],
    lever_p_m: &Vec3<Platform>,
) -> Innovation {
    let state = motion.state;
    let lever_t = state.attitude_t_p * *lever_p_m;
    let noise = motion.level.covariance_t(sd_m);
    let mut innovation = Innovation::vector((*position_t_m - state.position_t_m - lever_t).0, &noise);
    innovation.tangent_rows = TangentRows::Position;
    innovation.put(POSITION, &Matrix3::identity());
    innovation.put(ATTITUDE, &-skew(&lever_t.0));
    innovation
}
