//! One filter over many IMU samples: what [`Eskf::predict`] does step by step, bit for bit, with all in reach of the loop.

use fearless_simd::{Simd, dispatch};

use super::Eskf;
use super::convoy::corrected;
use crate::error::NavError;
use crate::error_model::{Halves, Rows, Single, Step, Stretch};
use crate::imu::{ImuSample, Inertial, Sampling};
use crate::lane::level;

/// Fewer steps than this are not worth the covariance's way into rows and back.
const WORTH_ROWS: usize = 4;

impl Eskf {
    /// Takes all samples after the first, which it has taken already, or those up to where it fails.
    pub(super) fn predict_along(&mut self, samples: &[ImuSample]) -> Result<(), (usize, NavError)> {
        // A smoother wants to see every transition.
        if self.tape.is_some() || samples.len() <= WORTH_ROWS || samples[1].time_ns <= samples[0].time_ns {
            for (k, step) in samples.windows(2).enumerate() {
                self.predict(&step[0], &step[1]).map_err(|error| (k + 1, error))?;
            }
            return Ok(());
        }
        self.begin_interval(&samples[0], &samples[1]);
        if self.covariance_period_s > 0.0 {
            dispatch!(level(), simd => self.fly::<_, Stretch<f64>>(simd, samples))
        } else {
            dispatch!(level(), simd => self.fly::<_, Step<f64>>(simd, samples))
        }
    }

    #[inline(always)]
    fn fly<S: Simd, I: Single>(&mut self, simd: S, samples: &[ImuSample]) -> Result<(), (usize, NavError)> {
        let Some(mut interval) = I::of(&self.interval) else {
            return Ok(());
        };
        let (gyro_bias, accel_bias) = (
            self.state.gyro_bias_p_radps.to_array(),
            self.state.accel_bias_p_mps2.to_array(),
        );
        let (earth, noise, sampling) = (self.earth, self.noise, self.sampling);
        let mut kinematics = self.kinematics;
        let mut rows = Rows::of(&self.covariance.data.0);
        let mut halves = Halves::NONE;
        let mut first = corrected(&reading(&samples[0]), gyro_bias, accel_bias);
        let (mut dt_s, mut is_due, mut end) = (0.0, false, samples.len() - 1);
        let mut outcome = Ok(());
        for at in 1..samples.len() {
            let (previous_ns, time_ns) = (samples[at - 1].time_ns, samples[at].time_ns);
            if time_ns <= previous_ns {
                end = at - 1;
                outcome = Err((at, Self::does_not_rise(time_ns, previous_ns)));
                break;
            }
            dt_s = (time_ns - previous_ns) as f64 * 1e-9;
            let last = corrected(&reading(&samples[at]), gyro_bias, accel_bias);
            if sampling == Sampling::Averaged {
                first = last;
            }
            let mut after = kinematics;
            after.step(&first, &last, dt_s, &earth);
            let taken = I::take(&kinematics, &after, &last, &earth);
            // The covariance comes a step late: its arithmetic fills the pauses in the chain of operations that the state is,
            // and what it reads as vectors was written, number by number, long enough ago.
            if is_due {
                if let Some(water) = &mut self.water {
                    water.propagate(&interval.into(), &kinematics, &earth);
                }
                interval.propagate_rows(simd, &mut rows, &halves, &kinematics, &earth);
            }
            interval.add(&taken, dt_s);
            kinematics = after;
            first = last;
            let [x, y, z] = kinematics.position_t_m;
            if !(x + y + z).is_finite() {
                (is_due, end) = (false, at);
                outcome = Err((at, Self::ran_out_of_numbers(time_ns)));
                break;
            }
            is_due = interval.duration_s() + 0.5 * dt_s >= self.covariance_period_s;
            if is_due {
                interval.note_noise(&mut halves, &kinematics, &noise);
            }
        }
        if is_due {
            if let Some(water) = &mut self.water {
                water.propagate(&interval.into(), &kinematics, &earth);
            }
            interval.propagate_rows(simd, &mut rows, &halves, &kinematics, &earth);
        }
        rows.put_into(&mut self.covariance.data.0);
        self.kinematics = kinematics;
        self.interval = interval.into();
        self.state.time_ns = samples[end].time_ns;
        self.last_rate_p_radps = samples[end].rate_p_radps.0;
        self.last_step_s = dt_s;
        outcome
    }
}

#[inline(always)]
fn reading(sample: &ImuSample) -> Inertial<f64> {
    Inertial {
        rate_p_radps: sample.rate_p_radps.to_array(),
        force_p_mps2: sample.force_p_mps2.to_array(),
    }
}
