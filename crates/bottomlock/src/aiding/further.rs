//! Layout of the states beside the 20 of the error state, and the rows that a sensor fills for them.
//!
//! A state beside the 20 is a parameter of a sensor or of the vehicle: its error belongs to the noise of the measurements that
//! contain it, n = D_f δf + white noise. A sensor states D_f; what follows from it is the filter's
//! (`filter/further_states.rs`). A further block is its name, its range and its number here.

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use crate::aiding::MAX_ROWS;
use crate::aiding::calibration::CALIBRATION;
use crate::aiding::current_layers::LAYER_STATES;
use crate::aiding::thrust::THRUST;
use crate::aiding::water::WATER;

/// Number of states of the error of an attitude reference: offset of roll, pitch and yaw, then their first-order walks.
pub const ATTITUDE_ERROR: usize = 6;
/// Number of states of the error of a heading sensor: offset, then first-order walk.
pub const HEADING_ERROR: usize = 2;

/// Number of states of the deviation of a compass: its coefficients by cos ψ, sin ψ, cos 2ψ and sin 2ψ.
pub const DEVIATION: usize = 4;

/// Number of states of the motion of the vehicle.
pub const MOTION: usize = 6;

/// Number of states of the waves in a depth: what they add now, and the same a quarter of their period ago.
pub const DEPTH_WAVE: usize = 2;

/// Number of states of the gyros' scale factors and misalignments: a matrix by rows.
pub const GYRO_MATRIX: usize = 9;

/// Index of the bias of the depth sensor, m.
pub const DEPTH_BIAS: usize = 0;
/// First index of the waves in a depth, m ([`crate::aiding::depth`]).
pub const FIRST_DEPTH_WAVE: usize = DEPTH_BIAS + 1;
/// First index of mounting and clock of the DVL ([`crate::aiding::calibration`]).
pub const FIRST_CALIBRATION: usize = FIRST_DEPTH_WAVE + DEPTH_WAVE;
/// First index of the error of the attitude reference, rad ([`crate::aiding::attitude`]).
pub const FIRST_ATTITUDE_ERROR: usize = FIRST_CALIBRATION + CALIBRATION;
/// First index of the deviation of the attitude reference's yaw, rad (`aiding/deviation.rs`).
pub const FIRST_ATTITUDE_DEVIATION: usize = FIRST_ATTITUDE_ERROR + ATTITUDE_ERROR;
/// First index of the error of the heading sensor, rad ([`crate::aiding::heading`]).
pub const FIRST_HEADING_ERROR: usize = FIRST_ATTITUDE_DEVIATION + DEVIATION;
/// First index of the deviation of the heading sensor, rad.
pub const FIRST_HEADING_DEVIATION: usize = FIRST_HEADING_ERROR + HEADING_ERROR;
/// First index of the gyros' scale factors and misalignments (`filter/gyro_matrix.rs`).
pub const FIRST_GYRO_MATRIX: usize = FIRST_HEADING_DEVIATION + DEVIATION;
/// First index of the motion of the vehicle: mean of surge, sway and heave, then their changes, m/s
/// ([`crate::aiding::motion_prior`]).
pub const FIRST_MOTION: usize = FIRST_GYRO_MATRIX + GYRO_MATRIX;
/// First index of what the drives make of the speed: scale, then slip, m/s, along surge, sway and heave ([`crate::aiding::thrust`]).
pub const FIRST_THRUST: usize = FIRST_MOTION + MOTION;
/// First index of the motion through the water ([`crate::aiding::water`]); it and its layers are last, since a filter may begin or
/// end them while it runs, and the states of a smoother's tape then keep their places.
pub const FIRST_WATER: usize = FIRST_THRUST + THRUST;
/// First index of the current's layers ([`crate::aiding::current_layers`]), north and east of each place, m/s.
pub const FIRST_LAYERS: usize = FIRST_WATER + WATER;
/// Number of further states.
pub const FURTHER: usize = FIRST_LAYERS + LAYER_STATES;

/// Name and range of each block, in order.
pub const FURTHER_BLOCKS: [(&str, Range<usize>); 12] = [
    ("depth_bias_m", DEPTH_BIAS..FIRST_DEPTH_WAVE),
    ("depth_wave_m", FIRST_DEPTH_WAVE..FIRST_CALIBRATION),
    ("dvl_mounting_and_clock", FIRST_CALIBRATION..FIRST_ATTITUDE_ERROR),
    ("attitude_error_rad", FIRST_ATTITUDE_ERROR..FIRST_ATTITUDE_DEVIATION),
    ("attitude_deviation_rad", FIRST_ATTITUDE_DEVIATION..FIRST_HEADING_ERROR),
    ("heading_error_rad", FIRST_HEADING_ERROR..FIRST_HEADING_DEVIATION),
    ("heading_deviation_rad", FIRST_HEADING_DEVIATION..FIRST_GYRO_MATRIX),
    ("gyro_matrix", FIRST_GYRO_MATRIX..FIRST_MOTION),
    ("motion_p_mps", FIRST_MOTION..FIRST_THRUST),
    ("thrust", FIRST_THRUST..FIRST_WATER),
    ("water", FIRST_WATER..FIRST_LAYERS),
    ("current_layers_mps", FIRST_LAYERS..FURTHER),
];

/// One number for each further state.
pub type FurtherVector = SVector<f64, FURTHER>;
/// Jacobian of up to [`MAX_ROWS`] rows with respect to the further states.
pub type FurtherRows = SMatrix<f64, MAX_ROWS, FURTHER>;

#[cfg(test)]
mod tests {
    use super::*;

    /// The blocks cover the further states without gap or overlap, the water and its layers last.
    #[test]
    fn blocks_tile_the_further_states() {
        let mut next = 0;
        for (_, range) in FURTHER_BLOCKS {
            assert_eq!(range.start, next);
            next = range.end;
        }
        assert_eq!((next, FURTHER_BLOCKS[10].1.start), (FURTHER, FIRST_WATER));
    }
}
