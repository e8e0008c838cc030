//! Inertial readings integrated over segments.

use bottomlock::mechanisation::integrate_segment;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Rows, array, times};
use crate::errors::{invalid, raise};

/// Strapdown integrals of inertial readings along segments of `readings` each, every one from its own beginning.
///
/// time_ns (s m,); force_p_mps2 and omega_p_radps (s m, 3), platform frame. Returns a dict: `rotation` (s, m, 3, 3), from the platform
/// to its axes at the segment's beginning; `force_integral_mps` (s, m, 3); `rotation_integral_s` (s, m, 3, 3); `bias_integral`
/// (s, m, 3, 3), m: column j is the change of the velocity, m/s, by a gyro bias of 1 rad/s about axis j.
///
/// Raises KernelError for a wrong shape, readings that do not divide into segments, and numbers that are not finite.
#[pyfunction]
pub fn integrate_segments<'py>(
    py: Python<'py>,
    time_ns: &Bound<'py, PyAny>,
    force_p_mps2: &Bound<'py, PyAny>,
    omega_p_radps: &Bound<'py, PyAny>,
    readings: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let stamps = times("time_ns", time_ns)?;
    let forces = Rows::<3>::new("force_p_mps2", force_p_mps2, &[Some(stamps.len())])?;
    let rates = Rows::<3>::new("omega_p_radps", omega_p_radps, &[Some(stamps.len())])?;
    if readings == 0 || !stamps.len().is_multiple_of(readings) {
        return Err(invalid(format!(
            "readings is {readings}, expected a number by which the {} readings divide into segments",
            stamps.len()
        )));
    }
    let count = stamps.len();
    let (mut rotation, mut force) = (Vec::with_capacity(9 * count), Vec::with_capacity(3 * count));
    let (mut swept, mut bias) = (Vec::with_capacity(9 * count), Vec::with_capacity(9 * count));
    let segments = stamps
        .chunks(readings)
        .zip(forces.get()?.chunks(readings))
        .zip(rates.get()?.chunks(readings));
    for ((stamps, forces), rates) in segments {
        for at in integrate_segment(stamps, forces, rates).map_err(raise)? {
            rotation.extend(at.rotation.transpose().iter());
            force.extend(at.force_mps.iter());
            swept.extend(at.rotation_s.transpose().iter());
            bias.extend(at.bias.transpose().iter());
        }
    }
    let shape = [count / readings, readings, 3, 3];
    let dict = PyDict::new(py);
    dict.set_item("rotation", array::<f64>(py, rotation, &shape)?)?;
    dict.set_item("force_integral_mps", array::<f64>(py, force, &shape[..3])?)?;
    dict.set_item("rotation_integral_s", array::<f64>(py, swept, &shape)?)?;
    dict.set_item("bias_integral", array::<f64>(py, bias, &shape)?)?;
    Ok(dict)
}
