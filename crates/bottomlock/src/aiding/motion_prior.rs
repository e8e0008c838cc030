//! The motion of a vehicle without usable accelerometers: its velocity along its own axes keeps to a mean.
//!
//! Where no accelerometer says how the velocity changes, a random walk of the velocity is the wrong model beyond seconds: its
//! displacement grows with t^1.5 without bound, and a vehicle's speed is bounded. What vehicles do is measured in
//! docs/no_imu.md: each component of the velocity is a mean, which hardly changes, and a change of first order about it,
//!
//! ```text
//! v = m + s,   0 = v̂ − m̂ − ŝ + δv − δm − δs + n
//! ```
//!
//! with m and s as further states (`filter/gauss_markov.rs`). The row is exact but for n, which keeps S regular.

use nalgebra::Matrix3;

use crate::aiding::Innovation;
use crate::aiding::further::{FurtherRows, Process, Processes, block};
use crate::error::{NavError, require_non_negative, require_positive};
use crate::layout::VELOCITY;
use crate::state::NavState;

/// σ of n, m/s: far below what any DVL measures.
const ROW_SD_MPS: f64 = 1e-3;
/// Shortest time between two epochs, ns.
pub(crate) const EPOCH_NS: i64 = 500_000_000;
/// Time after a ping that determines the whole velocity from which on epochs follow, ns.
pub(crate) const LOST_NS: i64 = 2_000_000_000;
/// The same after a ping that determines the velocity through the water: some pings of a DVL that records one in a few seconds.
pub(crate) const WATER_HELD_NS: i64 = 10_000_000_000;
/// Time in which one of such pings is an epoch, ns.
pub(crate) const LEARNING_NS: i64 = 20_000_000_000;

/// Prior of the velocity along the platform's axes, 1 sigma; an axis of which both deviations are zero is free.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionPrior {
    /// Mean, m/s.
    pub mean_sd_mps: [f64; 3],
    /// Correlation time of the mean, s.
    pub mean_time_s: f64,
    /// Change about the mean, m/s.
    pub change_sd_mps: [f64; 3],
    /// Correlation time of the change, s.
    pub change_time_s: [f64; 3],
}

impl Default for MotionPrior {
    /// None.
    fn default() -> Self {
        Self {
            mean_sd_mps: [0.0; 3],
            mean_time_s: 10_000.0,
            change_sd_mps: [0.0; 3],
            change_time_s: [40.0; 3],
        }
    }
}

impl MotionPrior {
    /// Returns true if every axis is free.
    #[must_use]
    pub fn is_off(&self) -> bool {
        !(0..3).any(|axis| self.holds(axis))
    }

    /// Whether anything is known of an axis.
    fn holds(&self, axis: usize) -> bool {
        self.mean_sd_mps[axis] > 0.0 || self.change_sd_mps[axis] > 0.0
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let sd = self.mean_sd_mps.iter().map(|&sd| ("options.motion.mean_sd_mps", sd));
        sd.chain(
            self.change_sd_mps
                .iter()
                .map(|&sd| ("options.motion.change_sd_mps", sd)),
        )
        .try_for_each(|(field, sd)| require_non_negative(field, sd))?;
        require_positive("options.motion.mean_time_s", self.mean_time_s)?;
        self.change_time_s
            .iter()
            .try_for_each(|&time_s| require_positive("options.motion.change_time_s", time_s))
    }

    /// Mean and change along the axes.
    pub(crate) fn processes(&self) -> Processes {
        let mean = self.mean_sd_mps.map(|sd| Process::lasting(sd, self.mean_time_s));
        let change = |axis: usize| Process::lasting(self.change_sd_mps[axis], self.change_time_s[axis]);
        (block::MOTION, mean.into_iter().chain((0..3).map(change)).collect())
    }

    /// The rows of the axes of which something is known.
    #[must_use]
    pub fn innovation(&self, state: &NavState) -> Innovation {
        let noise = Matrix3::identity() * (ROW_SD_MPS * ROW_SD_MPS);
        let mut innovation = Innovation::vector(-state.velocity_p_mps.0, &noise);
        innovation.put(VELOCITY, &Matrix3::identity());
        let mut rows = Box::new(FurtherRows::zeros());
        for axis in 0..3 {
            rows[(axis, block::MOTION.first + axis)] = -1.0;
            rows[(axis, block::MOTION.first + 3 + axis)] = -1.0;
        }
        innovation.by_further = Some(rows);
        innovation.select(|row| self.holds(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Vec3;

    /// Surge and heave are known and sway is free: two rows, each by its own mean and change.
    #[test]
    fn rows_by_hand() {
        let prior = MotionPrior {
            mean_sd_mps: [0.5, 0.0, 0.0],
            change_sd_mps: [0.1, 0.0, 0.05],
            ..MotionPrior::default()
        };
        let mut state = NavState::at_rest(0);
        state.velocity_p_mps = Vec3::new(2.0, -0.5, 0.1);
        let innovation = prior.innovation(&state);
        assert_eq!((innovation.rows, innovation.degrees), (2, 2));
        assert_eq!([innovation.residual[0], innovation.residual[1]], [-2.0, -0.1]);
        let rows = innovation.by_further.unwrap();
        for (row, axis) in [(0, 0), (1, 2)] {
            assert_eq!(innovation.jacobian[(row, VELOCITY + axis)], 1.0);
            let own = [
                rows[(row, block::MOTION.first + axis)],
                rows[(row, block::MOTION.first + 3 + axis)],
            ];
            assert_eq!(own, [-1.0, -1.0]);
            assert_eq!(rows.row(row).abs().sum(), 2.0);
        }
        assert!(MotionPrior::default().is_off() && !prior.is_off());
    }
}
