//! States from their keys, and as dicts.

use bottomlock::frames::Vec3;
use bottomlock::layout::DIM;
use bottomlock::state::{Covariance, NavState};
use nalgebra::Vector4;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Argument, Dict, floats};
use crate::keys::{Keys, read};
use crate::results::Results;
use crate::settings;

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
        state.position_t_m = Vec3::from_array(keys.vector("position_t_m")?);
        state.attitude_t_p = settings::attitude(&keys.path("attitude_t_p"), &keys.item("attitude_t_p")?)?;
        state.velocity_p_mps = Vec3::from_array(keys.vector("velocity_p_mps")?);
        state.accel_bias_p_mps2 = Vec3::from_array(keys.vector_or_zero("accel_bias_p_mps2")?);
        state.gyro_bias_p_radps = Vec3::from_array(keys.vector_or_zero("gyro_bias_p_radps")?);
        state.dvl_bias_mps = Vector4::from(keys.vector_or_zero::<4>("dvl_bias_mps")?);
        state.dvl_scale_factor = keys.number_or("dvl_scale_factor", 0.0)?;
        Ok(state)
    })
}

/// The fields of a state as a dict, SI units.
pub fn state_dict<'py>(py: Python<'py>, state: &NavState) -> Dict<'py> {
    let out = PyDict::new(py);
    out.set_item("time_ns", state.time_ns)?;
    out.states("", &[], || std::iter::once(state))?;
    out.set_item("dvl_scale_factor", state.dvl_scale_factor)?;
    Ok(out)
}

/// A (20, 20) covariance, where one is given.
pub fn covariance(value: Option<Argument>) -> PyResult<Option<Covariance>> {
    value
        .map(|value| {
            let values = floats("covariance", value, &[Some(DIM), Some(DIM)])?.values;
            Ok(Covariance::from_row_slice(&values))
        })
        .transpose()
}
