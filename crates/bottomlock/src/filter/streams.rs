//! The inertial readings of filters side by side, less their biases.

use crate::mechanisation::{ImuSample, Inertial};
use crate::simd::{Lane, V3, WIDEST, splat3, sub};

/// The samples of all lanes, at the same times.
pub(super) struct Streams<'a, T> {
    pub(super) of: [&'a [ImuSample]; WIDEST],
    /// True where all lanes have the same samples.
    pub(super) are_one: bool,
    pub(super) gyro_bias_p_radps: V3<T>,
    pub(super) accel_bias_p_mps2: V3<T>,
}

impl<T: Lane> Streams<'_, T> {
    /// Length of the step to sample `at`, where there is one and its time rises.
    #[inline(always)]
    pub(super) fn step_s(&self, at: usize) -> Option<f64> {
        let samples = self.of[0];
        let dt_s = (samples.get(at)?.time_ns - samples[at - 1].time_ns) as f64 * 1e-9;
        (dt_s > 0.0).then_some(dt_s)
    }

    /// Readings less biases.
    #[inline(always)]
    pub(super) fn corrected(&self, at: usize) -> Inertial<T> {
        let (rate, force);
        let like = self.gyro_bias_p_radps[0];
        if self.are_one {
            let one = &self.of[0][at];
            rate = splat3(like, one.rate_p_radps.to_array());
            force = splat3(like, one.force_p_mps2.to_array());
        } else {
            let own = self.of.map(|stream| &stream[at]);
            let rates = own.map(|own| &own.rate_p_radps.0);
            let forces = own.map(|own| &own.force_p_mps2.0);
            rate = [
                like.each(|k| rates[k].x),
                like.each(|k| rates[k].y),
                like.each(|k| rates[k].z),
            ];
            force = [
                like.each(|k| forces[k].x),
                like.each(|k| forces[k].y),
                like.each(|k| forces[k].z),
            ];
        }
        Inertial {
            rate_p_radps: sub(rate, self.gyro_bias_p_radps),
            force_p_mps2: sub(force, self.accel_bias_p_mps2),
        }
    }
}
