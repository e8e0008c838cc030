//! The position of a point of the vehicle: the rows that every sensor of position has.

use nalgebra::{Matrix3, Vector3};

use crate::aiding::{Innovation, TangentRows};
use crate::frames::{Platform, Tangent, Vec3, skew};
use crate::layout::{ATTITUDE, POSITION};
use crate::state::NavState;

/// z = p_meas − (p + R l): a position in the tangent frame of a point at `lever_p_m`.
#[must_use]
pub fn position(
    state: &NavState,
    position_t_m: &Vec3<Tangent>,
    sd_m: &[f64; 3],
    lever_p_m: &Vec3<Platform>,
) -> Innovation {
    let lever_t = state.attitude_t_p * *lever_p_m;
    let noise = Matrix3::from_diagonal(&Vector3::from(sd_m.map(|sd| sd * sd)));
    let mut innovation = Innovation::vector((*position_t_m - state.position_t_m - lever_t).0, &noise);
    innovation.tangent_rows = TangentRows::Position;
    innovation.put(POSITION, &Matrix3::identity());
    innovation.put(ATTITUDE, &-skew(&lever_t.0));
    innovation
}
