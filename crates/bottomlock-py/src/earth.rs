//! Gravity, level and depth at places on the Earth.

use bottomlock::earth::{Earth, Environment};
use bottomlock::frames::Vec3;

use crate::arrays::Rows;
use crate::prelude::*;

/// Gravity (m/s²), north, east and down, and depth at positions (n, 3) in the tangent frame of an environment.
///
/// Returns a dict: `gravity_t_mps2` (n, 3); `rotation_t_n` (n, 3, 3), whose columns are north, east and down in the tangent frame;
/// `depth_m` (n,), below the level of the origin.
#[pyfunction]
#[pyo3(name = "local_earth")]
pub fn local_earth<'py>(py: Python<'py>, environment: Argument, position_t_m: Argument<'_, 'py>) -> Dict<'py> {
    let environment: Environment = settings::part("environment", environment)?;
    environment.validate().map_err(crate::errors::raise)?;
    let earth = Earth::from(&environment);
    let rows = Rows::<3>::new("position_t_m", position_t_m, &[None])?;
    let positions = || rows.get().map(|rows| rows.iter().copied().map(Vec3::from_array));
    let levels: Vec<_> = positions()?.map(|position| earth.level(&position)).collect();
    let dict = PyDict::new(py);
    let gravities = positions()?.map(|position| earth.gravity_t_mps2(&position));
    dict.column("gravity_t_mps2", gravities)?;
    let rotations = levels.iter().map(|level| level.rotation_t_n.transpose());
    dict.column("rotation_t_n", rotations)?;
    dict.column("depth_m", levels.iter().map(|level| level.depth_m))?;
    Ok(dict)
}
