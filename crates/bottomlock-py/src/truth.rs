//! Truths from their keys.

use bottomlock::simulation::truth::Truth;

use crate::arrays::{Rows, times};
use crate::keys::read;
use crate::prelude::*;

/// The truths of one or more runs over the same times; contiguous arrays are read without a copy.
pub struct Truths<'py> {
    time_ns: Vec<i64>,
    position_t_m: Rows<'py, 3>,
    attitude_t_p: Rows<'py, 4>,
    velocity_p_mps: Rows<'py, 3>,
    omega_p_radps: Rows<'py, 3>,
    force_p_mps2: Rows<'py, 3>,
}

impl<'py> Truths<'py> {
    /// One truth, arrays (samples, ·), or one for each of a number of runs, arrays (runs, samples, ·).
    pub fn new(value: &Bound<'py, PyAny>, runs: Option<usize>) -> PyResult<Self> {
        read("truth", value, |keys| {
            let time_ns = keys.with("time_ns", times)?;
            let leading: Vec<_> = runs.into_iter().chain([time_ns.len()]).map(Some).collect();
            let three = |key: &str| keys.with(key, |name, value| Rows::new(name, value, &leading));
            Ok(Self {
                position_t_m: three("position_t_m")?,
                attitude_t_p: keys.with("attitude_t_p", |name, value| Rows::new(name, value, &leading))?,
                velocity_p_mps: three("velocity_p_mps")?,
                omega_p_radps: three("omega_p_radps")?,
                force_p_mps2: three("force_p_mps2")?,
                time_ns,
            })
        })
    }

    /// The truth of one run.
    pub fn of(&self, run: usize) -> PyResult<Truth<'_>> {
        let samples = run * self.time_ns.len()..(run + 1) * self.time_ns.len();
        Ok(Truth {
            time_ns: &self.time_ns,
            position_t_m: &self.position_t_m.get()?[samples.clone()],
            attitude_t_p: &self.attitude_t_p.get()?[samples.clone()],
            velocity_p_mps: &self.velocity_p_mps.get()?[samples.clone()],
            omega_p_radps: &self.omega_p_radps.get()?[samples.clone()],
            force_p_mps2: &self.force_p_mps2.get()?[samples],
        })
    }
}
