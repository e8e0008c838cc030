//! One step: the strapdown, and the covariance where its interval is full.

use fearless_simd::Simd;

use super::Eskf;
use crate::error::NavError;
use crate::error_model::{Interval, Underway};
use crate::mechanisation::{ImuSample, Inertial, Sampling};
use crate::simd::with_vectors;

impl Eskf {
    /// One strapdown step from `start` to `end`, and the covariance where its interval is full.
    ///
    /// # Errors
    /// [`NavError::TimeNotIncreasing`]; [`NavError::NotFinite`] where the state has run out of numbers.
    pub fn predict(&mut self, start: &ImuSample, end: &ImuSample) -> Result<(), NavError> {
        let dt_s = (end.time_ns - start.time_ns) as f64 * 1e-9;
        if dt_s <= 0.0 {
            return Err(Self::does_not_rise(end.time_ns, start.time_ns));
        }
        self.begin_interval(start, end);
        with_vectors!(simd => self.advance(simd, start, end, dt_s))
    }

    /// The step, compiled for the machine's own instructions.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, simd: S, start: &ImuSample, end: &ImuSample, dt_s: f64) -> Result<(), NavError> {
        let (first, last) = (self.corrected(self.first_of(start, end)), self.corrected(end));
        let before = self.kinematics;
        self.kinematics.step(&first, &last, dt_s, &self.earth);
        self.interval
            .extend(&before, &self.kinematics, &last, dt_s, &self.earth);
        self.state.time_ns = end.time_ns;
        self.last_rate_p_radps = end.rate_p_radps.0;
        self.last_step_s = dt_s;
        let [x, y, z] = self.kinematics.position_t_m;
        if !(x + y + z).is_finite() {
            return Err(Self::ran_out_of_numbers(end.time_ns));
        }
        // Half a step of slack, so that rounding of the sample times does not lengthen the interval by a step.
        if self.interval.duration_s() + 0.5 * dt_s >= self.covariance_period_s {
            if self.tape.is_some() {
                self.propagate_covariance();
                return Ok(());
            }
            if let Some(water) = &mut self.water {
                water.propagate(&self.interval, &self.kinematics, &self.earth);
            }
            if self.underway.is_none() {
                self.underway = Some(Box::new(Underway::of(simd, &self.covariance.whole().data.0)));
            }
            if let Some(underway) = &mut self.underway {
                self.interval
                    .propagate_rows(simd, underway, &self.kinematics, &self.noise, &self.earth);
            }
        }
        Ok(())
    }

    /// The sample that a step begins with.
    #[inline(always)]
    fn first_of<'a>(&self, start: &'a ImuSample, end: &'a ImuSample) -> &'a ImuSample {
        match self.sampling {
            Sampling::Instantaneous => start,
            Sampling::Averaged => end,
        }
    }

    /// Begins an interval where none is open.
    pub(super) fn begin_interval(&mut self, start: &ImuSample, end: &ImuSample) {
        if matches!(self.interval, Interval::Open) {
            let first = self.corrected(self.first_of(start, end));
            let many_steps = self.covariance_period_s > 0.0;
            self.interval = with_vectors!(_simd => Interval::begin(&self.kinematics, &first, &self.earth, many_steps));
        }
    }

    #[cold]
    fn does_not_rise(time_ns: i64, previous_ns: i64) -> NavError {
        NavError::TimeNotIncreasing {
            stream: "imu",
            time_ns,
            previous_ns,
        }
    }

    #[cold]
    pub(super) fn ran_out_of_numbers(time_ns: i64) -> NavError {
        NavError::NotFinite {
            field: "state position_t_m",
            time_ns,
        }
    }

    /// The covariance as a whole, where it was underway.
    pub(super) fn gather_covariance(&mut self) {
        if let Some(underway) = self.underway.take() {
            let mut whole = self.covariance.whole();
            with_vectors!(simd => underway.rows.put_into(simd, &mut whole.data.0));
            self.covariance.set(&whole);
        }
    }

    pub(super) fn propagate_covariance(&mut self) {
        self.gather_covariance();
        self.record_transition();
        if let Some(water) = &mut self.water {
            water.propagate(&self.interval, &self.kinematics, &self.earth);
        }
        if self.interval.duration_s() > 0.0 {
            let mut whole = self.covariance.whole();
            self.interval
                .propagate(&mut whole.data.0, &self.kinematics, &self.noise, &self.earth);
            self.covariance.set(&whole);
        }
    }

    #[inline(always)]
    fn corrected(&self, sample: &ImuSample) -> Inertial<f64> {
        Inertial {
            rate_p_radps: (sample.rate_p_radps - self.state.gyro_bias_p_radps).to_array(),
            force_p_mps2: (sample.force_p_mps2 - self.state.accel_bias_p_mps2).to_array(),
        }
    }
}
