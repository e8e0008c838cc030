//! A yaw near the vertical: when it is a linear function of the attitude error, and what the filter does where it is not.
//!
//! With pitch θ, yaw ψ and ρ the misalignment, the horizontal part of the bow has the length cos θ. An error turns it by
//! e = ρ_x cos ψ + ρ_y sin ψ (times sin θ) across and stretches it by f = ρ_y cos ψ − ρ_x sin ψ along itself, so that
//!
//! ```text
//! δψ = atan2(ρ_z cos θ + e sin θ, cos θ − f sin θ) = ρ_z + e tan θ + e f tan² θ + ….
//! ```
//!
//! The filter has the first two terms. The third is an error of the model that lasts as long as f does, so a larger
//! variance of each yaw would only delay the damage: the yaw is withheld while the root mean square of the third term
//! exceeds the sensor's own standard deviation. For Gaussian errors (Isserlis' theorem)
//! `E[(e f)²] = E[e²] E[f²] + 2 E[e f]²`. The tilt alone counts: another measurement than the yaw makes it smaller.
//! With a tilt known to 0.5 mrad and a yaw to 1° it is withheld within a quarter of a degree of the vertical; figures in
//! docs/sensors.md.

use nalgebra::Vector2;

use super::Eskf;
use crate::aiding::Innovation;
use crate::error::NavError;
use crate::filter::report::{Sensor, UpdateReport, Verdict};
use crate::layout::ATTITUDE;

impl Eskf {
    /// Updates with a yaw, or withholds it.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub(super) fn update_with_yaw(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
    ) -> Result<UpdateReport, NavError> {
        if innovation.rows > 0 && self.neglected_yaw_variance(innovation) <= innovation.noise[(0, 0)] {
            return self.fuse_rows(innovation, sensor);
        }
        Ok(UpdateReport {
            verdict: Verdict::Withheld,
            ..UpdateReport::empty(sensor, self.state.time_ns)
        })
    }

    /// Mean square of e f tan² θ, rad²; e tan θ is what the row of a yaw has of the tilt.
    fn neglected_yaw_variance(&self, innovation: &Innovation) -> f64 {
        let across = Vector2::new(
            innovation.jacobian[(0, ATTITUDE)],
            innovation.jacobian[(0, ATTITUDE + 1)],
        );
        let along = Vector2::new(-across.y, across.x);
        let tilt = self.covariance.fixed_view::<2, 2>(ATTITUDE, ATTITUDE);
        let both = across.dot(&(tilt * along));
        across.dot(&(tilt * across)) * along.dot(&(tilt * along)) + 2.0 * both * both
    }
}

#[cfg(test)]
#[path = "near_vertical_tests.rs"]
mod tests;
