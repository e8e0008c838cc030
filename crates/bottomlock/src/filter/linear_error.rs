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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::options::Options;
    use crate::frames::{Rot, Tangent, Vec3};
    use crate::model::Model;

    const NOW_NS: i64 = 20_000_000_000;
    const RHO: [f64; 3] = [0.2, -0.1, 0.4];
    const WAY: [f64; 3] = [30.0, -20.0, 10.0];
    const GAIN: [f64; 3] = [1.0, 2.0, -0.5];

    /// A filter and a truth that is off by way, misalignment and velocity.
    fn filter_and_truth() -> (Eskf, NavState) {
        let mut state = NavState::at_rest(NOW_NS);
        state.attitude_t_p = Rot::from_euler_rad(0.3, -0.2, 1.1);
        let filter = Eskf::new(state, &Model::table_2(), &Options::default()).unwrap();
        let mut truth = filter.state();
        truth.position_t_m = Vec3::from_array(WAY);
        truth.attitude_t_p = Rot::<Tangent, Tangent>::exp(RHO.into()) * truth.attitude_t_p;
        truth.velocity_p_mps = Vec3::from_array(GAIN);
        (filter, truth)
    }

    fn block(error: &ErrorVector, from: usize) -> Vector3<f64> {
        error.fixed_rows::<3>(from).into_owned()
    }

    fn turned(share: f64, vector: Vector3<f64>) -> Vector3<f64> {
        Rotation3::from_scaled_axis(Vector3::from(RHO) * share) * vector
    }

    /// Aided by velocities: Exp(−ρ)(r − r̂), and the other errors as they are.
    #[test]
    fn the_path_turns_back_by_the_misalignment() {
        let (mut filter, truth) = filter_and_truth();
        filter.measured.velocity_ns = Some(NOW_NS);
        let (error, plain) = (filter.linear_error(&truth), truth.error_of(&filter.state()));
        assert!((block(&error, POSITION) - turned(-1.0, WAY.into())).norm() < 1e-12);
        assert_eq!(error.rows(ATTITUDE, 17), plain.rows(ATTITUDE, 17));
        assert!((block(&error, ATTITUDE) - Vector3::from(RHO)).norm() < 1e-12);
    }

    /// Free: Exp(−ρ/2)(r − r̂) and Exp(ρ/2) R̂ δv.
    #[test]
    fn free_navigation_turns_by_half() {
        let (filter, truth) = filter_and_truth();
        let error = filter.linear_error(&truth);
        let rotation = filter.state().attitude_t_p.matrix();
        assert!((block(&error, POSITION) - turned(-0.5, WAY.into())).norm() < 1e-12);
        let velocity_t = rotation * block(&error, VELOCITY);
        assert!((velocity_t - turned(0.5, rotation * Vector3::from(GAIN))).norm() < 1e-12);
    }

    /// Four seconds after a depth: the depth error less (ρ × R̂ δv)_z times four; a position takes all of it.
    #[test]
    fn a_depth_takes_what_came_before() {
        let (mut filter, truth) = filter_and_truth();
        filter.measured.position_ns = NOW_NS - 9_000_000_000;
        filter.measured.depth_ns = NOW_NS - 4_000_000_000;
        let velocity_t = filter.state().attitude_t_p.matrix() * Vector3::from(GAIN);
        let since = Vector3::from(RHO).cross(&velocity_t).z * 4.0;
        let error = filter.linear_error(&truth);
        assert!((error[POSITION + 2] - (WAY[2] - since)).abs() < 1e-12 && since.abs() > 0.1);
        assert!((error[POSITION] - turned(-0.5, WAY.into()).x).abs() < 1e-12);
        filter.measured.position_ns = filter.measured.depth_ns;
        assert!((filter.linear_error(&truth)[POSITION + 2] - turned(-0.5, WAY.into()).z).abs() < 1e-12);
    }
}
