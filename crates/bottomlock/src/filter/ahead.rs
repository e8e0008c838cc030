//! What of the steps of filters side by side follows from their readings alone, worked out for many steps at once: what is left
//! to the chain of steps is short enough for the machine to work on two of them at a time.

use fearless_simd::Simd;

use crate::mechanisation::{EarthTerms, ImuSample, Inertial, Sampling, Turn};
use crate::simd::{Lane, Lanes, V3, WIDEST, splat3, sub};

/// Steps worked out at once.
const BLOCK: usize = 16;

/// The samples of all lanes.
pub(super) struct Streams<'a, T> {
    pub(super) of: [&'a [ImuSample]; WIDEST],
    /// True where all lanes are methods of a run.
    pub(super) are_one: bool,
    pub(super) gyro_bias_p_radps: V3<T>,
    pub(super) accel_bias_p_mps2: V3<T>,
    pub(super) sampling: Sampling,
}

impl<T> Streams<'_, T> {
    /// True where all lanes have a sample of this number, at the same time and after the one before it.
    #[inline(always)]
    fn agree(&self, at: usize) -> bool {
        let samples = self.of[0];
        if at >= samples.len() {
            return false;
        }
        let time_ns = samples[at].time_ns;
        let agreed = self.are_one || self.of.iter().all(|stream| stream[at].time_ns == time_ns);
        agreed && samples[at - 1].time_ns < time_ns
    }

    /// Readings less biases.
    #[inline(always)]
    fn corrected<S: Simd>(&self, simd: S, at: usize) -> Inertial<T>
    where
        T: Lanes<S>,
    {
        let (rate, force);
        if self.are_one {
            let (like, one) = (self.gyro_bias_p_radps[0], &self.of[0][at]);
            rate = splat3(like, one.rate_p_radps.to_array());
            force = splat3(like, one.force_p_mps2.to_array());
        } else {
            let own = self.of.map(|stream| &stream[at]);
            let rates = own.map(|own| &own.rate_p_radps.0);
            let forces = own.map(|own| &own.force_p_mps2.0);
            rate = [
                T::gather(simd, |k| rates[k].x),
                T::gather(simd, |k| rates[k].y),
                T::gather(simd, |k| rates[k].z),
            ];
            force = [
                T::gather(simd, |k| forces[k].x),
                T::gather(simd, |k| forces[k].y),
                T::gather(simd, |k| forces[k].z),
            ];
        }
        Inertial {
            rate_p_radps: sub(rate, self.gyro_bias_p_radps),
            force_p_mps2: sub(force, self.accel_bias_p_mps2),
        }
    }
}

/// The steps that come next.
pub(super) struct Ahead<T> {
    /// At the start of the first, and at the end of each.
    readings: [Inertial<T>; BLOCK + 1],
    turns: [Turn<T>; BLOCK],
    dt_s: [f64; BLOCK],
    is_averaged: bool,
}

impl<T: Lane> Ahead<T> {
    #[inline(always)]
    pub(super) fn nothing(like: T) -> Self {
        let zero = like.splat(0.0);
        let rest = Inertial {
            rate_p_radps: [zero; 3],
            force_p_mps2: [zero; 3],
        };
        Self {
            readings: [rest; BLOCK + 1],
            turns: [Turn::none(like); BLOCK],
            dt_s: [0.0; BLOCK],
            is_averaged: false,
        }
    }

    /// The steps after sample `taken`, as far as the samples of all lanes go on together: how many, and the attitude after the first.
    #[inline(always)]
    pub(super) fn read<S: Simd>(
        &mut self,
        simd: S,
        streams: &Streams<'_, T>,
        taken: usize,
        mut attitude_t_p: [T; 4],
        earth: &EarthTerms,
    ) -> (usize, [T; 4])
    where
        T: Lanes<S>,
    {
        let mut start = streams.corrected(simd, taken);
        self.readings[0] = start;
        self.is_averaged = streams.sampling == Sampling::Averaged;
        let mut count = 0;
        while count < BLOCK && streams.agree(taken + count + 1) {
            let at = taken + count + 1;
            let end = streams.corrected(simd, at);
            let dt_s = (streams.of[0][at].time_ns - streams.of[0][at - 1].time_ns) as f64 * 1e-9;
            let from = if self.is_averaged { end } else { start };
            let turn = Turn::of(&from, &end, dt_s, earth);
            if count == 0 {
                // Here, where there is other work while it comes.
                attitude_t_p = turn.after(attitude_t_p);
            }
            self.turns[count] = turn;
            self.readings[count + 1] = end;
            self.dt_s[count] = dt_s;
            start = end;
            count += 1;
        }
        (count, attitude_t_p)
    }

    #[inline(always)]
    pub(super) fn turn(&self, k: usize) -> &Turn<T> {
        &self.turns[k % BLOCK]
    }

    /// Readings at both ends of step k.
    #[inline(always)]
    pub(super) fn ends(&self, k: usize) -> (&Inertial<T>, &Inertial<T>) {
        let end = &self.readings[k % BLOCK + 1];
        (
            if self.is_averaged {
                end
            } else {
                &self.readings[k % BLOCK]
            },
            end,
        )
    }
    #[inline(always)]
    pub(super) fn dt_s(&self, k: usize) -> f64 {
        self.dt_s[k % BLOCK]
    }
}
