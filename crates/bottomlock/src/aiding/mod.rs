//! Each aiding sensor as an innovation: residual, Jacobian, noise (Eqs. 7, 18, 22 in the full form of erratum E7).
//!
//! A sensor is one file here, its name below, and its lines in [`registry`]. Nothing else in the kernel names one. See
//! `docs/sensors.md`.

pub mod acoustic_position;
pub mod attitude;
pub mod beams;
pub mod calibration;
pub(crate) mod closure;
pub mod current_layers;
pub mod depth;
pub(crate) mod deviation;
pub mod further;
pub mod gps;
pub mod heading;
mod innovation;
pub mod motion_prior;
pub mod outliers;
pub mod position;
pub mod registry;
mod reports;
pub mod sensor;
pub mod speed_bound;
pub mod thrust;
pub mod velocity;
pub mod water;
pub mod water_track;

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::aiding::current_layers::CurrentAt;
use crate::earth::LocalLevel;
use crate::frames::skew;
use crate::layout::DIM;
use crate::state::NavState;

pub use self::beams::{BeamTerms, InformationPort, beam_terms, loosely_coupled, tightly_coupled};
pub use self::innovation::{CorrectedPath, Corrects, CorrelatedNoise, Innovation, TangentRows};

/// Largest number of rows of one measurement.
pub const MAX_ROWS: usize = 8;

/// Jacobian of up to [`MAX_ROWS`] rows.
pub type RowJacobian = SMatrix<f64, MAX_ROWS, DIM>;

/// The state of motion at a measurement.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// The estimate.
    pub state: &'a NavState,
    /// ω_ip less the estimated bias, platform frame, rad/s.
    pub rate_ip_p_radps: Vector3<f64>,
    /// Earth rate, tangent frame, rad/s.
    pub earth_rate_t_radps: Vector3<f64>,
    /// Variance of one gyro reading, (rad/s)².
    pub gyro_variance: f64,
    /// North, east, down and depth at the state's position.
    pub level: LocalLevel,
    /// The water states with the current at the vehicle, where the filter has them.
    pub water: Option<CurrentAt>,
}

impl Motion<'_> {
    pub(crate) fn rotation(&self) -> Matrix3<f64> {
        self.state.attitude_t_p.matrix()
    }
    /// ω_tp = ω_ip − Rᵀω_ie.
    pub(crate) fn rate_tp(&self) -> Vector3<f64> {
        self.rate_ip_p_radps - self.rotation().transpose() * self.earth_rate_t_radps
    }
    /// ∂ω_tp/∂ρ = −Rᵀ[ω_ie×]; ∂ω_tp/∂b_g = −I.
    pub(crate) fn rate_by_misalignment(&self) -> Matrix3<f64> {
        -self.rotation().transpose() * skew(&self.earth_rate_t_radps)
    }
}

#[cfg(test)]
impl<'a> Motion<'a> {
    /// Without rates, over a tangent plane.
    pub(crate) fn still(state: &'a NavState) -> Self {
        Self {
            state,
            rate_ip_p_radps: Vector3::zeros(),
            earth_rate_t_radps: Vector3::zeros(),
            gyro_variance: 0.0,
            level: LocalLevel::of_plane(&state.position_t_m),
            water: None,
        }
    }
}

#[cfg(test)]
mod readings_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod validate_tests;
