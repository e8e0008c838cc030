//! Gravity, level and depth at places on the Earth.

use bottomlock::earth::Earth;
use bottomlock::frames::Vec3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Rows, array};
use crate::settings;

/// Gravity (m/s²), north, east and down, and depth at positions (n, 3) in the tangent frame of an environment.
///
/// Returns a dict: `gravity_t_mps2` (n, 3); `rotation_t_n` (n, 3, 3), whose columns are north, east and down in the tangent frame;
/// `depth_m` (n,), below the level of the origin.
#[pyfunction]
#[pyo3(name = "local_earth")]
pub fn local_earth<'py>(
    py: Python<'py>,
    environment: &Bound<'py, PyAny>,
    position_t_m: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let environment = settings::environment(environment)?;
    environment.validate().map_err(crate::errors::raise)?;
    let earth = Earth::from(&environment);
    let rows = Rows::<3>::new("position_t_m", position_t_m, &[None])?;
    let positions = rows.get()?;
    let count = positions.len();
    let mut gravity: Vec<f64> = Vec::with_capacity(3 * count);
    let mut rotation: Vec<f64> = Vec::with_capacity(9 * count);
    let mut depth = Vec::with_capacity(count);
    for position in positions {
        let position = Vec3::from_array(*position);
        let level = earth.level(&position);
        gravity.extend(earth.gravity_t_mps2(&position).iter());
        rotation.extend(level.rotation_t_n.transpose().iter());
        depth.push(level.depth_m);
    }
    let dict = PyDict::new(py);
    dict.set_item("gravity_t_mps2", array(py, gravity, &[count, 3])?)?;
    dict.set_item("rotation_t_n", array(py, rotation, &[count, 3, 3])?)?;
    dict.set_item("depth_m", array(py, depth, &[count])?)?;
    Ok(dict)
}
