//! The error of a filter in the coordinates in which its propagation is linear, for the NEES of the whole state.
//!
//! P describes errors that obey the linear model. Where a direction of the velocity is unobserved, the plain difference of
//! positions does not: it contains ∫b dt with b = ρ × R̂ δv (see [`super::linear_range`]), which beams cannot tell from a
//! rotation of the path. With a misalignment ρ that is nearly constant,
//!
//! - where velocities in the platform frame aid the filter, ξ = Exp(−ρ)(p̂ + r − r̂) − p̂ is linear, with p̂ the way since the
//!   position was last known: ξ̇ = R̂ δv holds exactly. The linear model's δr is ξ + ρ × p̂, the inverse of
//!   [`super::corrected_path`], with its share of the way;
//! - the logarithm in SE₂(3) is linear in free inertial navigation (Barrau & Bonnabel 2017, sect. IV-B), to second order
//!   Exp(−ρ/2)(r − r̂) and Exp(ρ/2) R̂ δv.
//!
//! An axis that a depth sensor has corrected contains the integral of b since the last depth alone.

use nalgebra::{Rotation3, Vector3};

use super::Eskf;
use super::corrected_path::{turned_in_part, way_by_yaw};
use crate::layout::{ATTITUDE, POSITION, VELOCITY};
use crate::state::{Covariance, ErrorVector, NavState};

impl Eskf {
    /// The error of the estimate (20, SI units, in the order of [`crate::layout`]) in the coordinates of its linear model.
    /// `covariance` is that of [`Eskf::covariance`].
    #[must_use]
    pub fn linear_error(&self, truth: &NavState, covariance: &Covariance) -> ErrorVector {
        let estimate = self.state();
        let mut error = truth.error_of(&estimate);
        let block = |from: usize| Vector3::new(error[from], error[from + 1], error[from + 2]);
        let (position_t, rho, velocity_p) = (block(POSITION), block(ATTITUDE), block(VELOCITY));
        let rotation = estimate.attitude_t_p.matrix();
        let mut linear_t = if self.measured.velocity_ns.is_some() {
            let (way_t, turn) = (way_by_yaw(covariance), Rotation3::from_scaled_axis(rho));
            let share = self.share_of_way(covariance);
            let beside_t = position_t + way_t - turn * (way_t - rho.cross(&way_t));
            turned_in_part(&turn, share).lu().solve(&beside_t).unwrap_or(beside_t)
        } else {
            let half = Rotation3::from_scaled_axis(-0.5 * rho);
            let velocity_p = rotation.transpose() * (half.inverse() * (rotation * velocity_p));
            error.fixed_rows_mut::<3>(VELOCITY).copy_from(&velocity_p);
            half * position_t
        };
        if self.measured.has_depth_alone() {
            let since_s = (estimate.time_ns - self.measured.depth_ns) as f64 * 1e-9;
            let [here, there] = [&estimate, truth].map(|state| self.settings.earth.level(&state.position_t_m));
            let (down_t, heave_m) = (here.down_t(), rho.cross(&(rotation * velocity_p)).z * since_s);
            let deeper_m = there.depth_m - here.depth_m - heave_m;
            linear_t.z = (deeper_m - down_t.xy().dot(&linear_t.xy())) / down_t.z;
        }
        error.fixed_rows_mut::<3>(POSITION).copy_from(&linear_t);
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    const NOW_NS: i64 = 20_000_000_000;
    const RHO: [f64; 3] = [0.2, -0.1, 0.4];
    const WAY: [f64; 3] = [30.0, -20.0, 10.0];
    const GAIN: [f64; 3] = [1.0, 2.0, -0.5];

    /// A filter and a truth that is off by way, misalignment and velocity.
    fn filter_and_truth() -> (Eskf, NavState) {
        let mut state = NavState::at_rest(NOW_NS);
        state.attitude_t_p = Rot::from_euler_rad(0.3, -0.2, 1.1);
        let mut filter = Eskf::new(state, &Model::table_2(), &Options::default()).unwrap();
        filter.measured.horizontal_m2 = 0.0; // the error is of the way alone
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

    /// The covariance after a level way, by which a yaw of 0.1 rad moves the position.
    fn covariance_after(way_t: [f64; 2]) -> Covariance {
        let mut covariance = Covariance::identity();
        covariance[(ATTITUDE + 2, ATTITUDE + 2)] = 0.01;
        (
            covariance[(POSITION, ATTITUDE + 2)],
            covariance[(POSITION + 1, ATTITUDE + 2)],
        ) = (-0.01 * way_t[1], 0.01 * way_t[0]);
        covariance
    }

    /// Aided by velocities, a way of 489 m that is turned by 10° and nothing else: ξ = 0, where Exp(−ρ)(r − r̂) less ρ × p̂ is
    /// 7.4 m. Attitude and velocity errors are as they are.
    #[test]
    fn a_turned_way_is_no_other_error() {
        let (mut filter, mut truth) = filter_and_truth();
        filter.measured.velocity_ns = Some(NOW_NS);
        let (way_t, rho) = (
            Vector3::new(489.0, 0.0, 0.0),
            Vector3::new(0.0, 0.0, 10_f64.to_radians()),
        );
        truth.attitude_t_p = Rot::<Tangent, Tangent>::exp(rho) * filter.state().attitude_t_p;
        truth.position_t_m = Vec3::from_array((Rotation3::from_scaled_axis(rho) * way_t - way_t).into());
        let (error, plain) = (
            filter.linear_error(&truth, &covariance_after([489.0, 0.0])),
            truth.error_of(&filter.state()),
        );
        let xi = block(&error, POSITION) - rho.cross(&way_t);
        assert!(xi.norm() < 1e-9, "{xi}");
        let wrong = Rotation3::from_scaled_axis(-rho) * block(&plain, POSITION) - rho.cross(&way_t);
        assert!((wrong.norm() - 7.4).abs() < 0.05);
        assert_eq!(error.rows(ATTITUDE, 17), plain.rows(ATTITUDE, 17));
        assert!((block(&error, ATTITUDE) - rho).norm() < 1e-12);
    }

    /// Of 2 m² of the horizontal position 1.2 were there before: by (2a) with 0.4 of the error on the way, the linear error is found again.
    #[test]
    fn what_was_there_before_does_not_turn() {
        let (mut filter, mut truth) = filter_and_truth();
        (filter.measured.velocity_ns, filter.measured.horizontal_m2) = (Some(NOW_NS), 1.2);
        let (way_t, linear_t) = (Vector3::from(WAY), Vector3::new(40.0, 70.0, -5.0));
        let level_t = Vector3::new(way_t.x, way_t.y, 0.0);
        let rest_t = linear_t * 0.4 - Vector3::from(RHO).cross(&level_t);
        let off_t = linear_t * 0.6 + turned(1.0, level_t + rest_t) - level_t;
        truth.position_t_m = Vec3::from_array((filter.state().position_t_m.0 + off_t).into());
        let error = filter.linear_error(&truth, &covariance_after([WAY[0], WAY[1]]));
        assert!((block(&error, POSITION) - linear_t).norm() < 1e-9);
    }

    /// Along a turn, with a misalignment and a velocity error that are constant and large: ξ is ∫R̂ δv dt at every time, with
    /// the way that the filter's own covariance knows.
    #[test]
    fn the_rate_of_the_linear_position_error_is_the_velocity_error() {
        let mut state = NavState::at_rest(0);
        state.attitude_t_p = Rot::from_euler_rad(0.0, 0.0, 1.1);
        state.velocity_p_mps = Vec3::new(2.0, 0.5, 0.0);
        let mut model = Model::table_2();
        model.environment.earth_rate_radps = 0.0;
        let mut filter = Eskf::new(state, &model, &Options::default()).unwrap();
        let mut covariance = Covariance::identity() * 1e-14;
        covariance[(ATTITUDE + 2, ATTITUDE + 2)] = 0.01;
        filter.set_covariance(&covariance).unwrap();
        filter.measured.velocity_ns = Some(0);
        let gravity_mps2 = filter.gravity_mps2();
        let sample = |k: i64| ImuSample {
            time_ns: k * 10_000_000,
            rate_p_radps: Vec3::new(0.0, 0.0, 0.05),
            force_p_mps2: Vec3::new(0.02, 0.2, -gravity_mps2),
        };
        let (rho, gain_p) = (Vector3::from(RHO), Vector3::from(GAIN));
        let mut besides_t = Vector3::zeros();
        for k in 0..2000 {
            let before = filter.rotation() * gain_p;
            filter.predict(&sample(k), &sample(k + 1)).unwrap();
            besides_t += (before + filter.rotation() * gain_p) * 0.005;
            if k % 400 != 399 {
                continue;
            }
            let estimate = filter.state();
            let way_t = estimate.position_t_m.0;
            let mut truth = estimate;
            truth.position_t_m = Vec3::from_array(turned(1.0, way_t + besides_t).into());
            truth.attitude_t_p = Rot::<Tangent, Tangent>::exp(RHO.into()) * estimate.attitude_t_p;
            truth.velocity_p_mps = Vec3::from_array((estimate.velocity_p_mps.0 + gain_p).into());
            let error = filter.linear_error(&truth, &filter.covariance());
            let xi = block(&error, POSITION) - rho.cross(&way_t);
            assert!((xi - besides_t).norm() < 1e-4, "{k}: {xi} {besides_t}");
        }
        assert!(besides_t.norm() > 20.0 && filter.state().position_t_m.0.norm() > 20.0);
    }

    /// Free: Exp(−ρ/2)(r − r̂) and Exp(ρ/2) R̂ δv.
    #[test]
    fn free_navigation_turns_by_half() {
        let (filter, truth) = filter_and_truth();
        let error = filter.linear_error(&truth, &filter.covariance());
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
        let covariance = filter.covariance();
        let error = filter.linear_error(&truth, &covariance);
        assert!((error[POSITION + 2] - (WAY[2] - since)).abs() < 1e-12 && since.abs() > 0.1);
        assert!((error[POSITION] - turned(-0.5, WAY.into()).x).abs() < 1e-12);
        filter.measured.position_ns = filter.measured.depth_ns;
        let error = filter.linear_error(&truth, &covariance);
        assert!((error[POSITION + 2] - turned(-0.5, WAY.into()).z).abs() < 1e-12);
    }
}
