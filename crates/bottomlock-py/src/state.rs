//! States from their keys, and as dicts.

use bottomlock::frames::Vec3;
use bottomlock::layout::DIM;
use bottomlock::state::{Covariance, NavState};
use nalgebra::Vector4;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, floats};
use crate::keys::{Keys, read};
use crate::settings;

/// A time among the keys, integer nanoseconds.
pub fn time_ns(keys: &Keys<'_>) -> PyResult<i64> {
    keys.extract(
        "time_ns",
        "an integer number of nanoseconds: seconds are a likely mistake",
    )
}

/// The state at the start of a navigator or a replay; biases and scale factor are zero where they are not given.
pub fn state(owner: &str, value: &Bound<'_, PyAny>) -> PyResult<NavState> {
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

/// Puts the fields of a state into a dict, SI units.
pub fn put_state(out: &Bound<'_, PyDict>, state: &NavState) -> PyResult<()> {
    let py = out.py();
    let three = |value: [f64; 3]| array(py, value.to_vec(), &[3]);
    out.set_item("time_ns", state.time_ns)?;
    out.set_item("position_t_m", three(state.position_t_m.to_array())?)?;
    out.set_item(
        "attitude_t_p",
        array(py, state.attitude_t_p.to_quaternion_wxyz().to_vec(), &[4])?,
    )?;
    out.set_item("velocity_p_mps", three(state.velocity_p_mps.to_array())?)?;
    out.set_item("accel_bias_p_mps2", three(state.accel_bias_p_mps2.to_array())?)?;
    out.set_item("gyro_bias_p_radps", three(state.gyro_bias_p_radps.to_array())?)?;
    out.set_item("dvl_bias_mps", array(py, state.dvl_bias_mps.as_slice().to_vec(), &[4])?)?;
    out.set_item("dvl_scale_factor", state.dvl_scale_factor)
}

/// A (20, 20) covariance, where one is given.
pub fn covariance(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Covariance>> {
    value
        .map(|value| {
            let values = floats("covariance", value, &[Some(DIM), Some(DIM)])?.values;
            Ok(Covariance::from_row_slice(&values))
        })
        .transpose()
}
