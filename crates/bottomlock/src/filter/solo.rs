//! One filter over many IMU samples: what [`Eskf::predict`] does step by step, bit for bit.
//!
//! Eight steps are taken side by side as far as they do not wait for each other. Meanwhile the covariance goes on over the eight
//! before: its arithmetic fills the pauses in the chain of rotations that the attitude is.

use fearless_simd::{Simd, f64x8};

use super::Eskf;
use crate::error::NavError;
use crate::error_model::{Interval, Last, Single, Span, Step, Steps, Stretch, Underway};
use crate::mechanisation::step_block::{Ahead, Biases, Course, STEPS, Table, Wake};
use crate::mechanisation::{ImuSample, KINEMATICS, Kinematics};
use crate::simd::{M3, with_vectors};

/// Fewer steps than this are not worth it.
const WORTH_IT: usize = 4;

impl Eskf {
    /// Takes all samples after the first, which it has taken already, or those up to where it fails.
    pub(super) fn predict_along(&mut self, samples: &[ImuSample]) -> Result<(), (usize, NavError)> {
        let rising = samples
            .windows(2)
            .take_while(|step| step[0].time_ns < step[1].time_ns)
            .count();
        // A smoother wants to see every transition.
        let mut taken = 0;
        if self.tape.is_none() && rising >= WORTH_IT {
            self.gather_covariance();
            self.begin_interval(&samples[0], &samples[1]);
            let flown = &samples[..=rising];
            taken = match self.interval {
                Interval::Step(step) if step.duration_s() <= 0.0 => {
                    with_vectors!(simd => self.fly(simd, flown, EveryStep::of(simd, &step)))
                }
                Interval::Stretch(stretch) => with_vectors!(simd => self.fly(simd, flown, Stretches::of(stretch))),
                _ => 0,
            };
        }
        for (k, step) in samples[taken..].windows(2).enumerate() {
            self.predict(&step[0], &step[1])
                .map_err(|error| (taken + k + 1, error))?;
        }
        Ok(())
    }

    /// Returns how many steps it has taken: all, or as many eights as go before one in which it would run out of numbers.
    #[inline(always)]
    fn fly<S: Simd>(&mut self, simd: S, samples: &[ImuSample], mut kind: impl Kind<S>) -> usize {
        let biases = Biases {
            gyro_p_radps: self.state.gyro_bias_p_radps.to_array(),
            accel_p_mps2: self.state.accel_bias_p_mps2.to_array(),
        };
        let (earth, sampling, steps) = (self.earth, self.sampling, samples.len() - 1);
        let mut whole = self.covariance.whole();
        let mut covariance = Underway::of(simd, &whole.data.0);
        let mut wake = Wake::of(simd, &self.kinematics);
        let mut motion = Table::<KINEMATICS>::EMPTY;
        let mut attitude = self.kinematics.attitude_t_p;
        let mut ahead = Ahead::EMPTY;
        ahead.read(simd, &samples[..=STEPS.min(steps)], &biases, sampling, &earth);
        for k in 0..STEPS.min(steps) {
            ahead.turn(k, &mut attitude);
        }
        let (mut taken, mut dt_s) = (0, 0.0);
        while taken < steps {
            let count = STEPS.min(steps - taken);
            let Some(course) = wake.follow(simd, &ahead, count, &earth) else {
                break;
            };
            motion.put(&course.after.to_array());
            kind.take(&course, self);
            dt_s = ahead.dt_s(count - 1);
            let next = &samples[taken + count..=(taken + count + STEPS).min(steps)];
            if next.len() > 1 {
                ahead.read(simd, next, &biases, sampling, &earth);
            }
            for k in 0..count {
                if k + 1 < next.len() {
                    ahead.turn(k, &mut attitude);
                }
                kind.propagate(simd, k, &motion, &mut covariance, self);
            }
            taken += count;
        }
        if taken > 0 {
            let last = (taken - 1) % STEPS;
            covariance.rows.put_into(simd, &mut whole.data.0);
            self.covariance.set(&whole);
            self.kinematics = motion.kinematics(last);
            self.interval = kind.interval(last);
            self.state.time_ns = samples[taken].time_ns;
            self.last_rate_p_radps = samples[taken].rate_p_radps.0;
            self.last_step_s = dt_s;
        }
        taken
    }
}

/// How often the covariance is propagated.
trait Kind<S: Simd> {
    /// Takes eight steps.
    fn take(&mut self, course: &Course<S>, filter: &Eskf);
    /// Propagates the covariance over step k of them, where it is due.
    fn propagate(&mut self, simd: S, k: usize, motion: &Table<KINEMATICS>, p: &mut Underway, filter: &mut Eskf);
    /// The interval after step k.
    fn interval(&self, k: usize) -> Interval;
}

/// At every step.
struct EveryStep<S: Simd> {
    last: Last<S>,
    steps: Steps,
}

impl<S: Simd> EveryStep<S> {
    #[inline(always)]
    fn of(simd: S, step: &Step<f64>) -> Self {
        Self {
            last: Last::of(simd, step),
            steps: Steps::EMPTY,
        }
    }
}

impl<S: Simd> Kind<S> for EveryStep<S> {
    #[inline(always)]
    fn take(&mut self, course: &Course<S>, filter: &Eskf) {
        self.steps.take(course, &mut self.last, &filter.noise, &filter.earth);
    }
    #[inline(always)]
    fn propagate(&mut self, simd: S, k: usize, motion: &Table<KINEMATICS>, p: &mut Underway, filter: &mut Eskf) {
        if let Some(water) = &mut filter.water {
            water.propagate(&self.steps.interval(k), &motion.kinematics(k), &filter.earth);
        }
        self.steps.propagate(simd, k, &mut p.rows);
    }
    #[inline(always)]
    fn interval(&self, k: usize) -> Interval {
        self.steps.empty_after(k)
    }
}

/// Every so often.
struct Stretches {
    now: Stretch<f64>,
    /// R at both ends of each step, summed; and its length.
    taken: Table<10>,
}

impl Stretches {
    #[inline(always)]
    fn of(now: Stretch<f64>) -> Self {
        Self {
            now,
            taken: Table::EMPTY,
        }
    }
}

impl<S: Simd> Kind<S> for Stretches {
    #[inline(always)]
    fn take(&mut self, course: &Course<S>, filter: &Eskf) {
        let start = Kinematics {
            rotation_t_p: course.rotation_before,
            ..course.after
        };
        let [x, y, z]: M3<f64x8<S>> = Stretch::take(&start, &course.after, &course.end, &filter.earth);
        self.taken
            .put(&[x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2], course.dt_s]);
    }
    #[inline(always)]
    fn propagate(&mut self, simd: S, k: usize, motion: &Table<KINEMATICS>, p: &mut Underway, filter: &mut Eskf) {
        let [a, b, c, d, e, f, g, h, i, dt_s] = self.taken.of(k);
        self.now.add(&[[a, b, c], [d, e, f], [g, h, i]], dt_s);
        if self.now.duration_s() + 0.5 * dt_s < filter.covariance_period_s {
            return;
        }
        let end = motion.kinematics(k);
        if let Some(water) = &mut filter.water {
            water.propagate(&self.now.into(), &end, &filter.earth);
        }
        self.now.propagate_rows(simd, p, &end, &filter.noise, &filter.earth);
    }
    #[inline(always)]
    fn interval(&self, _k: usize) -> Interval {
        self.now.into()
    }
}

#[cfg(test)]
#[path = "solo_tests.rs"]
mod tests;
