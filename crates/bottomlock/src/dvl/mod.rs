//! Doppler velocity log: beam geometry, velocity from beams, and what to do when beams are missing.

pub mod fix;
pub mod geometry;
pub mod partial;
pub mod velocity;

#[cfg(test)]
mod partial_tests;
