//! Named blocks of the error state (Tal et al. 2017, Eqs. 2 and 8).
//!
//! A further state is one more block here, since all other code refers to these names.

use std::ops::Range;

/// Number of error states.
pub const DIM: usize = 20;
/// Number of leading states with dynamics (position, misalignment, velocity); the other states are random walks.
pub const DYNAMIC: usize = 9;
/// Number of beams that have a bias state.
pub const BIASED_BEAMS: usize = 4;

/// Largest number of beams of one instrument.
pub const MAX_BEAMS: usize = 8;

/// First index of the position error, tangent frame, m.
pub const POSITION: usize = 0;
/// First index of the misalignment ρ, tangent frame, rad.
pub const ATTITUDE: usize = 3;
/// First index of the velocity error, platform frame, m/s.
pub const VELOCITY: usize = 6;
/// First index of the accelerometer bias error, platform frame, m/s².
pub const ACCEL_BIAS: usize = 9;
/// First index of the gyro bias error, platform frame, rad/s.
pub const GYRO_BIAS: usize = 12;
/// First index of the beam bias errors, m/s.
pub const DVL_BIAS: usize = 15;
/// Index of the DVL scale factor error.
pub const DVL_SCALE: usize = 19;

/// Name and index range of each block, in order.
pub const BLOCKS: [(&str, Range<usize>); 7] = [
    ("position_t_m", 0..3),
    ("misalignment_t_rad", 3..6),
    ("velocity_p_mps", 6..9),
    ("accel_bias_p_mps2", 9..12),
    ("gyro_bias_p_radps", 12..15),
    ("dvl_bias_mps", 15..19),
    ("dvl_scale_factor", 19..20),
];

/// Name of the block that holds state `index`, for messages.
#[must_use]
pub fn block_name(index: usize) -> &'static str {
    BLOCKS
        .iter()
        .find(|(_, range)| range.contains(&index))
        .map_or("unknown", |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The blocks cover the state without gap or overlap, so a loop over blocks visits every state.
    #[test]
    fn blocks_tile_the_state() {
        let mut next = 0;
        for (_, range) in BLOCKS {
            assert_eq!(range.start, next);
            next = range.end;
        }
        assert_eq!(next, DIM);
        assert_eq!(block_name(DVL_SCALE), "dvl_scale_factor");
        assert_eq!(block_name(GYRO_BIAS + 2), "gyro_bias_p_radps");
    }
}
