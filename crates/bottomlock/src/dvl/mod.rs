//! Doppler velocity log (DVL): beam geometry, velocity from beams, and the methods for partial measurements.

mod beam_mask;
pub mod fix;
pub mod fix_row;
pub mod geometry;
pub mod partial;
pub mod velocity;

#[cfg(test)]
mod fix_tests;
#[cfg(test)]
mod partial_tests;
