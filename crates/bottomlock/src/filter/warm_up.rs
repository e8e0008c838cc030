//! The warm-up of inertial sensors: biases that move to their values of operation while the sensors warm up.
//!
//! A bias that is off by w at the start and by w e^(−t/τ) at t has moved by w (1 − e^(−t/τ)). The filter takes this for a random
//! walk whose variance at every time is that of the move, σ² (1 − e^(−t/τ))²: what it adds over an interval is the difference. The
//! walk's steps are independent where those of the move are one draw, so that over a part of the warm-up it says more, never
//! less.

use crate::error::{NavError, require_non_negative, require_positive};
use crate::layout::{ACCEL_BIAS, GYRO_BIAS};
use crate::model::ImuModel;
use crate::state::Covariance;

/// Time constants after which sensors are warm: 5e-5 of the move is left.
const WARM: f64 = 10.0;

/// How far biases will move, and since when.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct WarmUp {
    accel_sd_mps2: f64,
    gyro_sd_radps: f64,
    time_s: f64,
    elapsed_s: f64,
}

impl WarmUp {
    /// At the start; `None` for sensors that are warm.
    pub(super) fn new(imu: &ImuModel) -> Option<Self> {
        let is_warm = imu.accel_warm_up_sd_mps2 == 0.0 && imu.gyro_warm_up_sd_radps == 0.0;
        (!is_warm).then_some(Self {
            accel_sd_mps2: imu.accel_warm_up_sd_mps2,
            gyro_sd_radps: imu.gyro_warm_up_sd_radps,
            time_s: imu.warm_up_time_s.0,
            elapsed_s: 0.0,
        })
    }

    /// The covariance that the next `duration_s` add; `None` once the sensors are warm.
    pub(super) fn added(&self, duration_s: f64) -> Option<Covariance> {
        if self.elapsed_s > WARM * self.time_s {
            return None;
        }
        let moved = |time_s: f64| (-time_s / self.time_s).exp_m1().powi(2);
        let gained = moved(self.elapsed_s + duration_s) - moved(self.elapsed_s);
        let mut added = Covariance::zeros();
        for axis in 0..3 {
            added[(ACCEL_BIAS + axis, ACCEL_BIAS + axis)] = gained * self.accel_sd_mps2.powi(2);
            added[(GYRO_BIAS + axis, GYRO_BIAS + axis)] = gained * self.gyro_sd_radps.powi(2);
        }
        Some(added)
    }

    /// The time has gone on.
    pub(super) fn advance(&mut self, duration_s: f64) {
        self.elapsed_s += duration_s;
    }

    /// Checks numbers that were read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self) -> Result<(), NavError> {
        require_non_negative("warm-up of accelerometers", self.accel_sd_mps2)?;
        require_non_negative("warm-up of gyros", self.gyro_sd_radps)?;
        require_non_negative("time since the start", self.elapsed_s)?;
        require_positive("time constant of the warm-up", self.time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::level_turn::advance;
    use crate::testing::*;

    /// After a time constant a bias has moved by 1 − 1/e of what it will, after ten by all of it, whatever the intervals; the
    /// covariance that is asked for between them is that of an interval.
    #[test]
    fn biases_move_as_far_as_they_will() {
        for period_ns in [0, 100_000_000] {
            let mut model = Model::table_2();
            model.imu = ImuModel {
                accel_warm_up_sd_mps2: 2e-3,
                gyro_warm_up_sd_radps: 1e-4,
                warm_up_time_s: WalkTime(5.0),
                ..ImuModel::default()
            };
            let options = Options {
                covariance_period_ns: period_ns,
                ..Options::default()
            };
            let mut filter = Eskf::new(NavState::at_rest(0), &model, &options).unwrap();
            for (steps, moved) in [(500, 1.0 - (-1.0_f64).exp()), (4500, 1.0), (1000, 1.0)] {
                advance(&mut filter, steps - 3);
                filter.propagate_covariance();
                advance(&mut filter, 3);
                for (state, sd) in [(ACCEL_BIAS, 2e-3), (GYRO_BIAS, 1e-4)] {
                    let found = filter.covariance()[(state, state)].sqrt();
                    assert!((found / (moved * sd) - 1.0).abs() < 1e-4, "{steps}: {found}");
                }
            }
        }
    }
}
