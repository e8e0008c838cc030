//! The prediction of a filter alone: a group of one.

use super::Eskf;
use super::extensions::Extensions;
use super::prediction::{Group, LastStep, PredictionHooks, predict};
use super::streams::Streams;
use crate::error::NavError;
use crate::error_model::{CovarianceInterval, Interval, Matrix};
use crate::mechanisation::{EarthTerms, ImuSample, Kinematics};
use crate::simd::{WIDEST, with_vectors};

impl Eskf {
    /// One strapdown step from `start` to `end`, and the covariance where its interval is full.
    ///
    /// # Errors
    /// [`NavError::TimeNotIncreasing`]; [`NavError::NotFinite`] where the state has run out of numbers.
    pub fn predict(&mut self, start: &ImuSample, end: &ImuSample) -> Result<(), NavError> {
        self.predict_along(&[*start, *end]).map_err(|(_, error)| error)
    }

    /// Takes all samples after the first, which it has taken already, or those up to the one where it fails.
    ///
    /// # Errors
    /// As [`Eskf::predict`], with the number of the sample.
    pub fn predict_along(&mut self, samples: &[ImuSample]) -> Result<(), (usize, NavError)> {
        if !matches!(samples, [first, second, ..] if first.time_ns < second.time_ns) {
            return outcome(samples, 0);
        }
        self.begin_interval();
        let settings = self.settings;
        let streams = Streams {
            of: [samples; WIDEST],
            are_one: true,
            gyro_bias_p_radps: self.state.gyro_bias_p_radps.to_array(),
            accel_bias_p_mps2: self.state.accel_bias_p_mps2.to_array(),
        };
        let mut alone = Alone {
            extensions: &mut self.extensions,
            is_lost: false,
        };
        let (kinematics, covariance, earth) = (&mut self.kinematics, &mut self.covariance.data.0, &mut self.earth);
        let last = match &mut self.interval {
            Interval::Open => LastStep { at: 0, dt_s: 0.0 },
            Interval::FirstOrder(interval) => with_vectors!(simd => predict(
                simd, &mut Group { kinematics, interval, covariance, earth }, &streams, &settings, &mut alone
            )),
            Interval::SecondOrder(interval) => with_vectors!(simd => predict(
                simd, &mut Group { kinematics, interval, covariance, earth }, &streams, &settings, &mut alone
            )),
        };
        let is_lost = alone.is_lost;
        self.settle(samples, last);
        if is_lost {
            return Err((last.at, ran_out_of_numbers(self.state.time_ns)));
        }
        outcome(samples, last.at)
    }

    /// Begins an interval where none is open.
    pub(super) fn begin_interval(&mut self) {
        if matches!(self.interval, Interval::Open) {
            let many_steps = self.settings.covariance_period_s > 0.0;
            self.earth = self.settings.earth_of_interval(&self.kinematics);
            self.interval = with_vectors!(_simd => Interval::begin(&self.kinematics, &self.earth, many_steps));
        }
    }

    /// Takes note of the last sample that was taken.
    pub(super) fn settle(&mut self, samples: &[ImuSample], last: LastStep) {
        if last.at > 0 {
            let reading = &samples[last.at];
            self.state.time_ns = reading.time_ns;
            self.last_rate_p_radps = reading.rate_p_radps.0;
            self.last_step_s = last.dt_s;
        }
    }

    /// Brings the covariance up to date, all of it.
    pub(super) fn propagate_covariance(&mut self) {
        let (earth, noise) = (&self.earth, &self.settings.noise);
        if self.interval.duration_s() > 0.0 {
            self.extensions.propagate(&self.interval, &self.kinematics, earth);
        }
        self.interval
            .propagate(&mut self.covariance.data.0, &self.kinematics, noise, earth);
        if let Some(added) = self.extensions.added.take() {
            self.covariance += *added;
        }
    }
}

/// Hooks of the prediction of a single filter.
struct Alone<'a> {
    extensions: &'a mut Extensions,
    is_lost: bool,
}

impl<I: CovarianceInterval<f64> + Into<Interval>> PredictionHooks<f64, I> for Alone<'_> {
    #[inline(always)]
    fn propagate(&mut self, interval: &I, end: &Kinematics<f64>, earth: &EarthTerms<f64>) {
        if !self.extensions.is_empty() {
            self.extensions.propagate(&(*interval).into(), end, earth);
        }
    }
    #[inline(always)]
    fn propagated(&mut self, covariance: &mut Matrix<f64>) {
        if let Some(added) = self.extensions.added.take() {
            for (column, added) in covariance.iter_mut().flatten().zip(&*added) {
                *column += added;
            }
        }
    }
    #[inline(always)]
    fn on_non_finite(&mut self, _at: usize, _dt_s: f64, _group: &Group<'_, f64, I>) -> bool {
        self.is_lost = true;
        false
    }
}

/// What becomes of a filter that has taken sample `at`, and would have gone on if time had risen.
fn outcome(samples: &[ImuSample], at: usize) -> Result<(), (usize, NavError)> {
    match samples.get(at + 1) {
        None => Ok(()),
        Some(next) => Err((
            at + 1,
            NavError::TimeNotIncreasing {
                stream: "imu",
                time_ns: next.time_ns,
                previous_ns: samples[at].time_ns,
            },
        )),
    }
}

#[cold]
pub(super) fn ran_out_of_numbers(time_ns: i64) -> NavError {
    NavError::NotFinite {
        field: "state position_t_m",
        time_ns,
    }
}

#[cfg(test)]
#[path = "predict_tests.rs"]
mod tests;
