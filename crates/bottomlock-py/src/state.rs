//! States from their keys, and as dicts.

use bottomlock::layout::DIM;
use bottomlock::state::{Covariance, NavState};

use crate::arrays::{floats, vec3, vector};
use crate::keys::{Keys, read};
use crate::prelude::*;

/// A time among the keys, integer nanoseconds.
pub fn time_ns(keys: &Keys<'_>) -> PyResult<i64> {
    keys.extract(
        "time_ns",
        "an integer number of nanoseconds: seconds are a likely mistake",
    )
}

/// The state at the start of a navigator or a replay; biases and scale factor are zero where they are not given.
pub fn state(owner: &str, value: Argument) -> PyResult<NavState> {
    read(owner, value, |keys| {
        let mut state = NavState::at_rest(time_ns(keys)?);
        state.position_t_m = keys.with("position_t_m", vec3)?;
        state.attitude_t_p = keys.with("attitude_t_p", settings::attitude)?;
        state.velocity_p_mps = keys.with("velocity_p_mps", vec3)?;
        state.accel_bias_p_mps2 = keys
            .given("accel_bias_p_mps2", vec3)?
            .unwrap_or(state.accel_bias_p_mps2);
        state.gyro_bias_p_radps = keys
            .given("gyro_bias_p_radps", vec3)?
            .unwrap_or(state.gyro_bias_p_radps);
        state.dvl_bias_mps = keys.given("dvl_bias_mps", vector::<4>)?.unwrap_or_default().into();
        state.dvl_scale_factor = keys.number_or("dvl_scale_factor", 0.0)?;
        Ok(state)
    })
}

/// The fields of a state as a dict, SI units.
pub fn state_dict<'py>(py: Python<'py>, state: &NavState) -> Dict<'py> {
    let out = PyDict::new(py);
    fields! { out, state => time_ns, position_t_m, attitude_t_p, velocity_p_mps }
    fields! { out, state => accel_bias_p_mps2, gyro_bias_p_radps, dvl_bias_mps, dvl_scale_factor }
    Ok(out)
}

/// A (20, 20) covariance, where one is given.
pub fn covariance(value: Option<Argument>) -> PyResult<Option<Covariance>> {
    let values = value.map(|value| floats("covariance", value, &[Some(DIM), Some(DIM)]));
    Ok(values
        .transpose()?
        .map(|array| Covariance::from_row_slice(&array.values)))
}
