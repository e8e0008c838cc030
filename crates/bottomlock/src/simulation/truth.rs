//! True motion as sampled arrays, with interpolation between the samples.

use nalgebra::Vector3;

use crate::aiding::sensor::TrueMotion;
use crate::error::{NavError, require_finite, require_time};
use crate::frames::{Platform, Rot, Tangent, Vec3};
use crate::state::NavState;

/// True motion sampled at the IMU rate; all slices have the same length.
#[derive(Debug, Clone, Copy)]
pub struct Truth<'a> {
    /// Sample times, ns, increasing.
    pub time_ns: &'a [i64],
    /// Position, tangent frame, m.
    pub position_t_m: &'a [[f64; 3]],
    /// Attitude as a unit quaternion, scalar first, platform to tangent.
    pub attitude_t_p: &'a [[f64; 4]],
    /// Velocity over ground, platform frame, m/s.
    pub velocity_p_mps: &'a [[f64; 3]],
    /// Inertial angular rate ω_ip, platform frame, rad/s.
    pub omega_p_radps: &'a [[f64; 3]],
    /// Specific force, platform frame, m/s².
    pub force_p_mps2: &'a [[f64; 3]],
}

impl<'a> Truth<'a> {
    /// The truth over a range of samples.
    ///
    /// # Panics
    /// If the range lies outside the samples.
    #[must_use]
    pub fn slice(&self, samples: std::ops::Range<usize>) -> Truth<'a> {
        Truth {
            time_ns: &self.time_ns[samples.clone()],
            position_t_m: &self.position_t_m[samples.clone()],
            attitude_t_p: &self.attitude_t_p[samples.clone()],
            velocity_p_mps: &self.velocity_p_mps[samples.clone()],
            omega_p_radps: &self.omega_p_radps[samples.clone()],
            force_p_mps2: &self.force_p_mps2[samples],
        }
    }

    /// Checks lengths, times, and that every number is finite.
    ///
    /// # Errors
    /// [`NavError`], which names the array and the time.
    pub fn validate(&self) -> Result<(), NavError> {
        let count = self.time_ns.len();
        if count < 2 {
            return Err(NavError::WrongCount {
                field: "truth samples",
                got: count,
                expected: "at least 2".into(),
            });
        }
        let lengths = [
            ("truth position_t_m", self.position_t_m.len()),
            ("truth attitude_t_p", self.attitude_t_p.len()),
            ("truth velocity_p_mps", self.velocity_p_mps.len()),
            ("truth omega_p_radps", self.omega_p_radps.len()),
            ("truth force_p_mps2", self.force_p_mps2.len()),
        ];
        for (field, got) in lengths {
            if got != count {
                return Err(NavError::WrongCount {
                    field,
                    got,
                    expected: format!("{count} as for time_ns"),
                });
            }
        }
        for k in 0..count {
            let time = self.time_ns[k];
            require_time("truth", time)?;
            if k > 0 && time <= self.time_ns[k - 1] {
                let previous_ns = self.time_ns[k - 1];
                return Err(NavError::TimeNotIncreasing {
                    stream: "truth",
                    time_ns: time,
                    previous_ns,
                });
            }
            require_finite("truth position_t_m", time, &self.position_t_m[k])?;
            require_finite("truth attitude_t_p", time, &self.attitude_t_p[k])?;
            require_finite("truth velocity_p_mps", time, &self.velocity_p_mps[k])?;
            require_finite("truth omega_p_radps", time, &self.omega_p_radps[k])?;
            require_finite("truth force_p_mps2", time, &self.force_p_mps2[k])?;
            let norm = self.attitude_t_p[k].iter().map(|q| q * q).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > 1e-6 {
                return Err(NavError::OutOfRange {
                    field: "truth attitude_t_p norm",
                    value: norm,
                    expected: "1 within 1e-6 (unit quaternion, scalar first)",
                });
            }
        }
        Ok(())
    }

    /// Attitude at sample `k`.
    pub(crate) fn attitude(&self, k: usize) -> Rot<Tangent, Platform> {
        Rot::from_quaternion_wxyz(self.attitude_t_p[k])
    }

    /// The motion at a time inside the truth: linear between samples, attitude along the shortest rotation.
    ///
    /// # Errors
    /// [`NavError::OutsideTruth`], which names the stream.
    pub(crate) fn at(&self, stream: &'static str, time_ns: i64) -> Result<TrueMotion, NavError> {
        let (first_ns, last_ns) = (self.time_ns[0], self.time_ns[self.time_ns.len() - 1]);
        if time_ns < first_ns || time_ns > last_ns {
            return Err(NavError::OutsideTruth {
                stream,
                time_ns,
                first_ns,
                last_ns,
            });
        }
        let after = self.time_ns.partition_point(|&t| t < time_ns);
        let before = after.saturating_sub(usize::from(self.time_ns[after] != time_ns));
        let interval_ns = (self.time_ns[after] - self.time_ns[before]).max(1);
        let fraction = (time_ns - self.time_ns[before]) as f64 / interval_ns as f64;
        let interpolate =
            |a: &[[f64; 3]]| Vector3::from(a[before]) * (1.0 - fraction) + Vector3::from(a[after]) * fraction;
        let attitude_increment = (self.attitude(before).inverse() * self.attitude(after)).log() * fraction;
        Ok(TrueMotion {
            position_t_m: interpolate(self.position_t_m),
            attitude_t_p: self.attitude(before) * Rot::<Platform, Platform>::exp(attitude_increment),
            velocity_p_mps: interpolate(self.velocity_p_mps),
            omega_p_radps: interpolate(self.omega_p_radps),
        })
    }
}

/// True state at sample `k`, with zero biases.
#[must_use]
pub fn true_state(truth: &Truth<'_>, k: usize) -> NavState {
    let mut state = NavState::at_rest(truth.time_ns[k]);
    state.position_t_m = Vec3::from_array(truth.position_t_m[k]);
    state.attitude_t_p = truth.attitude(k);
    state.velocity_p_mps = Vec3::from_array(truth.velocity_p_mps[k]);
    state
}
