//! The inertial readings of filters side by side, less their biases.

use crate::mechanisation::{ImuSample, Inertial};
use crate::simd::{Lane, V3, splat3, sub};

/// The samples of each lane, at the same times; one slice where all lanes have the same.
pub(super) struct Streams<'a, T> {
    pub(super) of: &'a [&'a [ImuSample]],
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
        if let [samples] = self.of {
            let one = &samples[at];
            rate = splat3(like, one.rate_p_radps.to_array());
            force = splat3(like, one.force_p_mps2.to_array());
        } else {
            rate = [
                like.each(|k| self.of[k][at].rate_p_radps.0.x),
                like.each(|k| self.of[k][at].rate_p_radps.0.y),
                like.each(|k| self.of[k][at].rate_p_radps.0.z),
            ];
            force = [
                like.each(|k| self.of[k][at].force_p_mps2.0.x),
                like.each(|k| self.of[k][at].force_p_mps2.0.y),
                like.each(|k| self.of[k][at].force_p_mps2.0.z),
            ];
        }
        Inertial {
            rate_p_radps: sub(rate, self.gyro_bias_p_radps),
            force_p_mps2: sub(force, self.accel_bias_p_mps2),
        }
    }
}
