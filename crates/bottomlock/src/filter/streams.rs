//! The steps of filters side by side: their inertial readings less their biases, and the attitudes that follow.

use crate::mechanisation::{ImuSample, Inertial, Sampling, Turn};
use crate::simd::{Lane, V3, WIDEST, splat3, sub};

/// The samples of all lanes.
pub(super) struct Streams<'a, T> {
    pub(super) of: [&'a [ImuSample]; WIDEST],
    /// True where all lanes have the same samples.
    pub(super) are_one: bool,
    pub(super) gyro_bias_p_radps: V3<T>,
    pub(super) accel_bias_p_mps2: V3<T>,
}

/// A step, as far as it follows from the readings at its ends and the attitude before it.
#[derive(Clone, Copy)]
pub(super) struct Step<T> {
    pub(super) start: Inertial<T>,
    pub(super) end: Inertial<T>,
    pub(super) dt_s: f64,
    /// After it.
    pub(super) attitude_t_p: [T; 4],
}

impl<T: Lane> Streams<'_, T> {
    /// The step to sample `at`, where there is one, its time rises and is the same in all lanes.
    #[inline(always)]
    pub(super) fn step(
        &self,
        at: usize,
        start: &Inertial<T>,
        attitude_t_p: [T; 4],
        sampling: Sampling,
        earth_rate_t: [f64; 3],
    ) -> Option<Step<T>> {
        let dt_s = self.step_s(at)?;
        let end = self.corrected(at);
        let start = match sampling {
            Sampling::Instantaneous => *start,
            Sampling::Averaged => end,
        };
        Some(Step {
            start,
            end,
            dt_s,
            attitude_t_p: Turn::of(&start, &end, dt_s, earth_rate_t).after(attitude_t_p),
        })
    }

    #[inline(always)]
    fn step_s(&self, at: usize) -> Option<f64> {
        let samples = self.of[0];
        let time_ns = samples.get(at)?.time_ns;
        if !self.are_one {
            for stream in self.of {
                if stream[at].time_ns != time_ns {
                    return None;
                }
            }
        }
        let dt_s = (time_ns - samples[at - 1].time_ns) as f64 * 1e-9;
        (dt_s > 0.0).then_some(dt_s)
    }

    /// Readings less biases.
    #[inline(always)]
    pub(super) fn corrected(&self, at: usize) -> Inertial<T> {
        let like = self.gyro_bias_p_radps[0];
        let one = &self.of[0][at];
        let (mut rate, mut force) = (
            splat3(like, one.rate_p_radps.to_array()),
            splat3(like, one.force_p_mps2.to_array()),
        );
        if !self.are_one {
            let mut own = [one; WIDEST];
            for (own, stream) in own.iter_mut().zip(self.of) {
                *own = &stream[at];
            }
            for i in 0..3 {
                rate[i] = like.each(
                    #[inline(always)]
                    |k| own[k].rate_p_radps.0[i],
                );
                force[i] = like.each(
                    #[inline(always)]
                    |k| own[k].force_p_mps2.0[i],
                );
            }
        }
        Inertial {
            rate_p_radps: sub(rate, self.gyro_bias_p_radps),
            force_p_mps2: sub(force, self.accel_bias_p_mps2),
        }
    }
}
