//! How far measurements in the tangent frame are linear in the error state, and what the filter does beyond that.
//!
//! With R = Exp(ρ) R̂ and v = v̂ + δv, the velocity in the tangent frame is
//!
//! ```text
//! R v = R̂ v̂ + R̂ δv + ρ × R̂ v̂ + b + O(ρ²),   b = ρ × R̂ δv.
//! ```
//!
//! F has all of it but b. Where beams leave a direction of the velocity unobserved, δv grows to tens of m/s and b to
//! decimetres per second. Position, depth and velocity in the tangent frame then contradict the linear model, and a
//! first-order update takes the contradiction for information on the misalignment. What is done instead is derived in
//! docs/linear_range.md:
//!
//! - Velocity, three axes: the Jacobian is that at the velocity after the update.
//! - Position, three axes: ∫b dt = ρ × ∫R̂ δv dt, and the integral is what the update observes as correction of the
//!   position, but for the error of before (`Eskf::share_of_way`). The error state is moved to the corrected path (`filter/corrected_path.rs`).
//! - Depth: nothing observes that integral. Beyond the linear range the measurement corrects its own axis of the position alone
//!   (Schmidt's filter), whose variance has grown by `E[b_z²] Δt²` since the last depth.
//! - Heave: since the last velocity it has an error of ½ g (ρ_x² + ρ_y²) Δt, which F leaves out of gravity and an update by a velocity,
//!   depth or position would take for a bias of the accelerometers. Its variance grows by the square (`Eskf::widen_heave`).

use nalgebra::Matrix3;

use super::Eskf;
use crate::aiding::{Corrects, Innovation, TangentRows};
use crate::error::NavError;
use crate::filter::report::{Sensor, UpdateReport};
use crate::frames::skew;
use crate::layout::{ATTITUDE, POSITION, VELOCITY};
use crate::state::{Covariance, ErrorVector};

/// Root mean square of b_z, m/s, beyond which a depth corrects its own axis alone.
///
/// Results are the same from 1 to 5 mm/s; at 10 mm/s depth contradicts a diagonal pair of beams.
pub const LINEAR_RANGE_MPS: f64 = 2e-3;

const DOWN: (usize, usize) = (POSITION + 2, POSITION + 2);

/// What has been measured, and when (or when the filter began), ns.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Measured {
    pub(super) depth_ns: i64,
    /// All axes of the position.
    pub(super) position_ns: i64,
    /// Variance of its horizontal part then, or where an update has left less of it, m².
    pub(super) horizontal_m2: f64,
    /// A velocity in the platform frame; `None` before the first.
    pub(super) velocity_ns: Option<i64>,
    /// The heave's covariance has what the linear model leaves out until then.
    pub(super) heave_ns: i64,
}

impl Measured {
    pub(super) fn nothing_at(time_ns: i64, covariance: &Covariance) -> Self {
        Self {
            depth_ns: time_ns,
            position_ns: time_ns,
            horizontal_m2: horizontal_variance(covariance),
            velocity_ns: None,
            heave_ns: time_ns,
        }
    }

    /// Whether the last of depth and position is a depth, which has corrected its own axis alone.
    pub(super) fn has_depth_alone(&self) -> bool {
        self.depth_ns > self.position_ns
    }
}

impl Eskf {
    /// Returns true if the velocity is so uncertain that the linear model no longer holds in the tangent frame.
    #[must_use]
    pub fn is_beyond_linear_range(&self) -> bool {
        self.vertical_product_variance() > LINEAR_RANGE_MPS * LINEAR_RANGE_MPS
    }

    /// Updates with rows in the tangent frame.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub(super) fn update_in_tangent_frame(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
    ) -> Result<UpdateReport, NavError> {
        let mut innovation = innovation.clone();
        let before = (self.covariance[DOWN], self.measured);
        self.linearise(&mut innovation);
        self.covariance[DOWN] += self.left_out_variance(&innovation);
        // Known already where the update's own correction of the horizontal position turns the axis of the depth.
        self.note_position(innovation.tangent_rows);
        let outcome = self.fuse_rows(&innovation, sensor);
        if !outcome.as_ref().is_ok_and(UpdateReport::was_used) {
            (self.covariance[DOWN], self.measured) = before;
        } else if innovation.tangent_rows == TangentRows::Position {
            self.measured.horizontal_m2 = horizontal_variance(&self.covariance);
        }
        outcome
    }

    /// Takes rows in the tangent frame as an update does, for its gate and for what a rejected reading is evidence of.
    pub(super) fn linearise(&self, innovation: &mut Innovation) {
        match innovation.tangent_rows {
            TangentRows::None | TangentRows::Yaw => {}
            TangentRows::Velocity => {
                let gained_t = self.rotation() * self.first_correction(innovation).fixed_rows::<3>(VELOCITY);
                add_by_misalignment(innovation, &-skew(&gained_t));
            }
            TangentRows::Position => self.linearise_at_corrected_path(innovation),
            TangentRows::Depth if self.is_beyond_linear_range() => innovation.corrects = Corrects::Depth,
            TangentRows::Depth => {}
        }
    }

    /// Variance of what the linear model leaves out of a depth since the last one, m²; zero within the linear range.
    pub(super) fn left_out_variance(&self, innovation: &Innovation) -> f64 {
        if innovation.corrects == Corrects::Depth {
            self.vertical_product_variance() * self.since_depth_s().powi(2)
        } else {
            0.0
        }
    }

    /// Makes the heave as uncertain as what the linear model has left out of it since the last velocity, where this is beyond the
    /// linear range; called before a velocity, depth or position is used.
    pub(crate) fn widen_heave(&mut self) {
        if self.left_out_heave_variance() <= LINEAR_RANGE_MPS * LINEAR_RANGE_MPS {
            return;
        }
        self.propagate_covariance();
        let down_p = self.rotation().row(2).transpose();
        let left_out = down_p * down_p.transpose() * self.left_out_heave_variance();
        let mut velocity = self.covariance.fixed_view_mut::<3, 3>(VELOCITY, VELOCITY);
        velocity += left_out;
        self.measured.heave_ns = self.state.time_ns;
    }

    /// `E[(½ g (ρ_x² + ρ_y²))²] Δt²`, (m/s)², of Gaussian tilts, with Δt since the last velocity or, before the first, position, less
    /// what the covariance has already.
    fn left_out_heave_variance(&self) -> f64 {
        let measured = &self.measured;
        let since_ns = measured.velocity_ns.unwrap_or(measured.position_ns);
        let squared_s2 = |time_ns: i64| ((time_ns - since_ns).max(0) as f64 * 1e-9).powi(2);
        let time_s2 = squared_s2(self.state.time_ns) - squared_s2(measured.heave_ns);
        let tilt = self.covariance.fixed_view::<2, 2>(ATTITUDE, ATTITUDE);
        let (xx, yy, xy) = (tilt[(0, 0)], tilt[(1, 1)], tilt[(0, 1)]);
        let fourth = 3.0 * (xx * xx + yy * yy) + 2.0 * xx * yy + 4.0 * xy * xy;
        (0.5 * self.gravity_mps2()).powi(2) * fourth * time_s2
    }

    /// Time since the last depth, s.
    pub(super) fn since_depth_s(&self) -> f64 {
        (self.state.time_ns - self.measured.depth_ns) as f64 * 1e-9
    }

    /// The error that an innovation of three rows explains by itself.
    fn first_correction(&self, innovation: &Innovation) -> ErrorVector {
        self.explained_by(innovation)
            .map_or_else(ErrorVector::zeros, |explained| explained.error)
    }

    fn note_position(&mut self, measured: TangentRows) {
        if measured == TangentRows::Position {
            self.measured.position_ns = self.state.time_ns;
        }
        if matches!(measured, TangentRows::Position | TangentRows::Depth) {
            self.measured.depth_ns = self.state.time_ns;
        }
    }

    /// Notes how well the horizontal position is known, where this is better than before.
    pub(super) fn note_horizontal_position(&mut self) {
        self.measured.horizontal_m2 = self.measured.horizontal_m2.min(horizontal_variance(&self.covariance));
    }

    /// Part of the position's error that has come about since the position was last known, by the variance of its horizontal part. The
    /// rest, as of a start at a place that is not well known, lies on no way that a misalignment turns.
    pub(super) fn share_of_way(&self, covariance: &Covariance) -> f64 {
        let horizontal_m2 = horizontal_variance(covariance);
        if horizontal_m2 > self.measured.horizontal_m2 {
            1.0 - self.measured.horizontal_m2 / horizontal_m2
        } else {
            0.0
        }
    }

    pub(super) fn rotation(&self) -> Matrix3<f64> {
        Matrix3::from(self.kinematics.rotation_t_p).transpose()
    }

    /// `E[b_z²]`, (m/s)², of b_z = ρ_x u_y − ρ_y u_x with u = R̂ δv, all of them Gaussian (Isserlis' theorem).
    fn vertical_product_variance(&self) -> f64 {
        let rotation = self.rotation();
        let horizontal = rotation.fixed_rows::<2>(0);
        let rho = self.covariance.fixed_view::<2, 2>(ATTITUDE, ATTITUDE);
        let u = horizontal * self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY) * horizontal.transpose();
        let both = self.covariance.fixed_view::<2, 3>(ATTITUDE, VELOCITY) * horizontal.transpose();
        let (xx, xy, yx, yy) = (both[(0, 0)], both[(0, 1)], both[(1, 0)], both[(1, 1)]);
        rho[(0, 0)] * u[(1, 1)] + rho[(1, 1)] * u[(0, 0)] - 2.0 * rho[(0, 1)] * u[(0, 1)]
            + 2.0 * (xy * xy + yx * yx - xx * yy - xy * yx)
    }
}

fn horizontal_variance(covariance: &Covariance) -> f64 {
    covariance.fixed_view::<2, 2>(POSITION, POSITION).trace()
}

fn add_by_misalignment(innovation: &mut Innovation, block: &Matrix3<f64>) {
    let mut by_misalignment = innovation.jacobian.fixed_view_mut::<3, 3>(0, ATTITUDE);
    by_misalignment += block;
}

#[cfg(test)]
#[path = "linear_range_tests.rs"]
mod tests;
