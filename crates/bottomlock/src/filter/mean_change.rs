//! The mean acceleration of the last moments, for the clock of the DVL.
//!
//! What a clock that is off by τ changes is the mean acceleration over τ, times τ. It is taken from what the strapdown steps
//! add to the velocity, without the corrections of the updates, as a moving mean with the clock's own σ as time constant: its
//! noise then enters the beams as a velocity random walk of half that time, which is far below theirs.

use nalgebra::{SMatrix, Vector3};

use crate::aiding::calibration::MotionChange;
use crate::error::{NavError, require_finite};
use crate::frames::{Platform, Rot, Tangent, Vec3};
use crate::layout::DIM;
use crate::mechanisation::Kinematics;

/// Moving means of acceleration and angular acceleration.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct MeanChange {
    /// Time constant, s; nothing is kept where it is zero.
    window_s: f64,
    /// Time that the means go back, s.
    elapsed_s: f64,
    velocity_p_mps: Vector3<f64>,
    attitude_t_p: Rot<Tangent, Platform>,
    rate_p_radps: Vector3<f64>,
    pub(super) acceleration_p_mps2: Vector3<f64>,
    pub(super) angular_acceleration_p_radps2: Vector3<f64>,
}

impl MeanChange {
    /// No change so far, from a state on.
    pub(super) fn new(window_s: f64, kinematics: &Kinematics<f64>) -> Self {
        let mut change = Self {
            window_s,
            elapsed_s: 0.0,
            velocity_p_mps: Vector3::zeros(),
            attitude_t_p: Rot::identity(),
            rate_p_radps: Vector3::zeros(),
            acceleration_p_mps2: Vector3::zeros(),
            angular_acceleration_p_radps2: Vector3::zeros(),
        };
        change.begin(kinematics);
        change
    }

    /// The same anew.
    pub(super) fn restarted(&self, kinematics: &Kinematics<f64>) -> Self {
        Self::new(self.window_s, kinematics)
    }

    /// The state has been corrected: what comes is counted from the new one.
    pub(super) fn begin(&mut self, kinematics: &Kinematics<f64>) {
        self.velocity_p_mps = Vector3::from(kinematics.velocity_p_mps);
        self.attitude_t_p = Rot::from_quaternion_wxyz(kinematics.attitude_t_p);
    }

    /// The state has come to `end` in `duration_s`.
    pub(super) fn extend(&mut self, duration_s: f64, end: &Kinematics<f64>) {
        if !(self.window_s > 0.0 && duration_s > 0.0) {
            return;
        }
        let (before_v, before_r) = (self.velocity_p_mps, self.attitude_t_p);
        self.begin(end);
        let acceleration = (self.velocity_p_mps - before_v) / duration_s;
        let turn: Rot<Platform, Platform> = before_r.inverse() * self.attitude_t_p;
        let rate = turn.log() / duration_s;
        // A plain mean until the time constant is over.
        let share = (-(-duration_s / self.window_s).exp_m1()).max(duration_s / (self.elapsed_s + duration_s));
        self.acceleration_p_mps2 += (acceleration - self.acceleration_p_mps2) * share;
        if self.elapsed_s > 0.0 {
            self.angular_acceleration_p_radps2 = (rate - self.rate_p_radps) * (share / duration_s);
        }
        self.rate_p_radps += (rate - self.rate_p_radps) * share;
        self.elapsed_s += duration_s;
    }

    /// How the motion changes; `velocity_by_state` are the rows of F for the velocity.
    pub(super) fn motion_change(&self, velocity_by_state: SMatrix<f64, 3, DIM>) -> MotionChange {
        MotionChange {
            acceleration_p_mps2: self.acceleration_p_mps2,
            angular_acceleration_p_radps2: self.angular_acceleration_p_radps2,
            velocity_by_state,
        }
    }

    /// Checks numbers that were read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        require_finite("mean acceleration", time_ns, &[self.window_s, self.elapsed_s])?;
        require_finite("mean acceleration", time_ns, &self.attitude_t_p.to_quaternion_wxyz())?;
        [
            self.velocity_p_mps,
            self.rate_p_radps,
            self.acceleration_p_mps2,
            self.angular_acceleration_p_radps2,
        ]
        .iter()
        .try_for_each(|vector| {
            require_finite(
                "mean acceleration",
                time_ns,
                &Vec3::<Platform>::from(*vector).to_array(),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(speed_mps: f64, yaw_rad: f64) -> Kinematics<f64> {
        let attitude = Rot::<Tangent, Platform>::from_euler_rad(0.0, 0.0, yaw_rad);
        Kinematics::new([0.0; 3], attitude.to_quaternion_wxyz(), [speed_mps, 0.0, 0.0])
    }

    /// A constant acceleration, straight and angular, is found whatever the lengths of the intervals, and a correction of the
    /// state is none.
    #[test]
    fn a_constant_acceleration() {
        let (a, alpha, window_s) = (0.3, 0.02, 0.1);
        let at = |t: f64| moving(1.0 + a * t, 0.5 * alpha * t * t);
        let mut change = MeanChange::new(window_s, &at(0.0));
        let mut t = 0.0;
        for step in 0..400 {
            let duration_s = if step % 3 == 0 { 0.004 } else { 0.05 };
            t += duration_s;
            change.extend(duration_s, &at(t));
            if step == 390 {
                change.begin(&moving(7.0, 1.0));
                change.begin(&at(t));
            }
        }
        assert!((change.acceleration_p_mps2 - Vector3::new(a, 0.0, 0.0)).norm() < 1e-9);
        // The mean of a rate over an interval belongs to its middle.
        assert!((change.angular_acceleration_p_radps2.z / alpha - 1.0).abs() < 0.3);
    }

    /// Nothing is kept without a clock, nor over no time; the first interval says all there is, but no angular acceleration.
    #[test]
    fn nothing_of_nothing() {
        let mut off = MeanChange::new(0.0, &moving(1.0, 0.0));
        let before = off.clone();
        off.extend(0.01, &moving(2.0, 0.1));
        assert_eq!(off, before);
        let mut change = MeanChange::new(10.0, &moving(1.0, 0.0));
        let before = change.clone();
        change.extend(0.0, &moving(2.0, 0.1));
        assert_eq!(change, before);
        change.extend(0.5, &moving(2.0, 0.1));
        assert!((change.acceleration_p_mps2.x - 2.0).abs() < 1e-12);
        assert_eq!(change.angular_acceleration_p_radps2, Vector3::zeros());
        change.extend(0.5, &moving(6.0, 0.1));
        assert!(
            (change.acceleration_p_mps2.x - 5.0).abs() < 1e-12,
            "the mean of 2 and 8"
        );
    }

    /// Half of a step of the acceleration is seen after 0.69 time constants.
    #[test]
    fn the_time_constant() {
        let mut change = MeanChange::new(0.2, &moving(1.0, 0.0));
        for _ in 0..1000 {
            change.extend(0.01, &moving(1.0, 0.0));
        }
        let mut speed = 1.0;
        for _ in 0..14 {
            speed += 0.01 * 2.0;
            change.extend(0.01, &moving(speed, 0.0));
        }
        assert!((change.acceleration_p_mps2.x - 2.0 * (1.0 - (-0.7_f64).exp())).abs() < 1e-9);
    }
}
