//! A turn for the tests of observability.

use super::{GRAVITY, SECOND_NS};
use crate::frames::{Platform, Rot, Tangent};
use crate::simulation::truth::Truth;

/// A turn about the vertical at a constant rate and surge, from heading north; the Earth rests.
pub(super) struct Turn {
    pub(super) time_ns: Vec<i64>,
    pub(super) position: Vec<[f64; 3]>,
    pub(super) attitude: Vec<[f64; 4]>,
    pub(super) velocity: Vec<[f64; 3]>,
    pub(super) omega: Vec<[f64; 3]>,
    pub(super) force: Vec<[f64; 3]>,
}

impl Turn {
    pub(super) fn new(rate: f64, speed: f64, seconds: i64, rate_hz: i64) -> Self {
        let count = seconds * rate_hz + 1;
        let time_ns: Vec<i64> = (0..count).map(|k| k * SECOND_NS / rate_hz).collect();
        let at = |t: &i64| *t as f64 * 1e-9;
        let position = |t: f64| {
            if rate == 0.0 {
                [speed * t, 0.0, 0.0]
            } else {
                let radius = speed / rate;
                [radius * (rate * t).sin(), radius * (1.0 - (rate * t).cos()), 0.0]
            }
        };
        Self {
            position: time_ns.iter().map(|t| position(at(t))).collect(),
            attitude: time_ns
                .iter()
                .map(|t| Rot::<Tangent, Platform>::from_euler_rad(0.0, 0.0, rate * at(t)).to_quaternion_wxyz())
                .collect(),
            velocity: vec![[speed, 0.0, 0.0]; count as usize],
            omega: vec![[0.0, 0.0, rate]; count as usize],
            force: vec![[0.0, rate * speed, -GRAVITY]; count as usize],
            time_ns,
        }
    }

    pub(super) fn truth(&self) -> Truth<'_> {
        Truth {
            time_ns: &self.time_ns,
            position_t_m: &self.position,
            attitude_t_p: &self.attitude,
            velocity_p_mps: &self.velocity,
            omega_p_radps: &self.omega,
            force_p_mps2: &self.force,
        }
    }
}
