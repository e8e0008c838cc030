//! A bound on the speed: no underwater vehicle does 35 m/s.
//!
//! Where beams leave a direction of the velocity unobserved for minutes, its uncertainty grows to tens of metres per second,
//! and products of errors with it that the linear model leaves out (docs/linear_range.md). Physics bounds it: each component
//! of the velocity is 0 ± σ, the same error for a time τ. An epoch Δt after the last therefore counts with the variance
//! σ² τ / Δt, and all epochs of a time τ together as one.

use crate::aiding::Innovation;
use crate::error::{NavError, require_non_negative, require_positive};
use crate::layout::VELOCITY;
use crate::state::NavState;
use nalgebra::Matrix3;

/// The bound; none by default.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpeedBound {
    /// σ of each component of the velocity over ground, m/s; 0 for no bound.
    pub sd_mps: f64,
    /// τ, s.
    pub time_s: f64,
}

impl Default for SpeedBound {
    fn default() -> Self {
        Self {
            sd_mps: 0.0,
            time_s: 60.0,
        }
    }
}

impl SpeedBound {
    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        require_non_negative("options.speed_bound.sd_mps", self.sd_mps)?;
        require_positive("options.speed_bound.time_s", self.time_s)
    }

    /// 0 = v̂ + δv + n, after an interval of `since_s` (s) without.
    #[must_use]
    pub fn innovation(&self, state: &NavState, since_s: f64) -> Innovation {
        let epochs = (self.time_s / since_s).max(1.0);
        let noise = Matrix3::identity() * (self.sd_mps * self.sd_mps * epochs);
        let mut innovation = Innovation::vector(-state.velocity_p_mps.0, &noise);
        innovation.put(VELOCITY, &Matrix3::identity());
        innovation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Vec3;

    /// σ = 3 m/s over τ = 60 s: 20 s after the last one it counts with 9 · 60/20 m²/s², 90 s after it with 9.
    #[test]
    fn by_hand() {
        let bound = SpeedBound {
            sd_mps: 3.0,
            time_s: 60.0,
        };
        let mut state = NavState::at_rest(0);
        state.velocity_p_mps = Vec3::new(2.0, -0.5, 0.1);
        for (since_s, variance) in [(20.0, 27.0), (90.0, 9.0)] {
            let innovation = bound.innovation(&state, since_s);
            assert_eq!((innovation.rows, innovation.degrees), (3, 3));
            for k in 0..3 {
                assert_eq!(innovation.residual[k], -state.velocity_p_mps.0[k]);
            }
            let noise: Matrix3<f64> = innovation.noise.fixed_view::<3, 3>(0, 0).into();
            assert!((noise - Matrix3::identity() * variance).amax() < 1e-12);
            let rows: Matrix3<f64> = innovation.jacobian.fixed_view::<3, 3>(0, VELOCITY).into();
            assert_eq!((rows, innovation.jacobian.sum()), (Matrix3::identity(), 3.0));
        }
    }
}
