//! The error of a filter in the coordinates in which its propagation is linear, for the NEES of the whole state.
//!
//! P describes errors that obey the linear model. Where a direction of the velocity is unobserved, the plain difference of
//! positions does not: it contains ∫b dt with b = ρ × R̂ δv (see [`super::linear_range`]), which beams cannot tell from a
//! rotation of the path. With a misalignment ρ that is nearly constant,
//!
//! - ξ = Exp(−ρ)(r − r̂) is linear where velocities in the platform frame aid the filter: ξ̇ = R̂ δv holds exactly;
//! - the logarithm in SE₂(3) is linear in free inertial navigation (Barrau & Bonnabel 2017, sect. IV-B), to second order
//!   Exp(−ρ/2)(r − r̂) and Exp(ρ/2) R̂ δv.
//!
//! An axis that a depth sensor has corrected contains the integral of b since the last depth alone.

use nalgebra::{Rotation3, Vector3};

use super::Eskf;
use crate::layout::{ATTITUDE, POSITION, VELOCITY};
use crate::state::{ErrorVector, NavState};

impl Eskf {
    /// The error of the estimate (20, SI units, in the order of [`crate::layout`]) in linear coordinates.
    #[must_use]
    pub fn linear_error(&self, truth: &NavState) -> ErrorVector {
        let estimate = self.state();
        let mut error = truth.error_of(&estimate);
        let block = |from: usize| Vector3::new(error[from], error[from + 1], error[from + 2]);
        let (position_t, rho, velocity_p) = (block(POSITION), block(ATTITUDE), block(VELOCITY));
        let rotation = estimate.attitude_t_p.matrix();
        let half = Rotation3::from_scaled_axis(-0.5 * rho);
        let mut turned_t = half * position_t;
        if self.measured.velocity_ns.is_some() {
            turned_t = half * turned_t;
        } else {
            let velocity_p = rotation.transpose() * (half.inverse() * (rotation * velocity_p));
            error.fixed_rows_mut::<3>(VELOCITY).copy_from(&velocity_p);
        }
        if self.measured.depth_ns > self.measured.position_ns {
            let since_s = (estimate.time_ns - self.measured.depth_ns) as f64 * 1e-9;
            turned_t.z = position_t.z - rho.cross(&(rotation * velocity_p)).z * since_s;
        }
        error.fixed_rows_mut::<3>(POSITION).copy_from(&turned_t);
        error
    }
}
