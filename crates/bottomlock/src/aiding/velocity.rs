//! A velocity in the platform frame from an instrument that gives no beams.

use nalgebra::Matrix3;

use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Reading};
use crate::aiding::{Innovation, Motion};
use crate::dvl::geometry::{MAX_BEAM_SPEED_MPS, SLOW_ENOUGH};
use crate::error::{NavError, require_finite, require_finite_squares, require_magnitude};
use crate::frames::{Platform, Vec3};
use crate::layout::{DVL_SCALE, VELOCITY};
use crate::state::NavState;

/// A velocity solved by the instrument.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct VelocitySample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Velocity over ground, platform frame, m/s.
    pub velocity_p_mps: Vec3<Platform>,
    /// Its covariance, (m/s)².
    pub cov_m2ps2: Matrix3<f64>,
}

impl Reading for VelocitySample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("velocity_p_mps", self.time_ns, &self.velocity_p_mps.to_array())?;
        let speed = [self.velocity_p_mps.0.norm()];
        require_magnitude("velocity_p_mps", &speed, MAX_BEAM_SPEED_MPS, SLOW_ENOUGH)?;
        require_finite_squares("velocity cov_m2ps2", self.time_ns, self.cov_m2ps2.as_slice())?;
        let definite = self.cov_m2ps2.cholesky().is_some();
        let not = NavError::NotPositiveDefinite {
            matrix: "velocity cov_m2ps2",
            time_ns: self.time_ns,
        };
        if definite { Ok(()) } else { Err(not) }
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, _: &Vec3<Platform>) -> Innovation {
        velocity(motion.state, &self.velocity_p_mps, &self.cov_m2ps2)
    }
}

impl AidingSensor for VelocitySample {
    const KIND: SensorKind = SensorKind::Velocity;
    const STREAM: &'static str = "velocity";

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        Self {
            time_ns: motion.state.time_ns,
            velocity_p_mps: motion.state.velocity_p_mps,
            cov_m2ps2: Matrix3::identity() * models.dvl.beam_noise_sd_mps.powi(2),
        }
    }
}

/// z = v_meas − (1 + SF) v, with the scale factor's error a state as for the beams.
#[must_use]
pub fn velocity(state: &NavState, velocity_p_mps: &Vec3<Platform>, cov_m2ps2: &Matrix3<f64>) -> Innovation {
    let scale = 1.0 + state.dvl_scale_factor;
    let mut innovation = Innovation::vector(velocity_p_mps.0 - state.velocity_p_mps.0 * scale, cov_m2ps2);
    innovation.put(VELOCITY, &(Matrix3::identity() * scale));
    innovation
        .jacobian
        .fixed_view_mut::<3, 1>(0, DVL_SCALE)
        .copy_from(&state.velocity_p_mps.0);
    innovation
}
