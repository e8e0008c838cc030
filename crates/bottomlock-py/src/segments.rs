//! Inertial readings integrated over segments.

use bottomlock::mechanisation::integrate_segments as integrate;

use crate::arrays::{Rows, times};
use crate::prelude::*;

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
    time_ns: Argument<'_, 'py>,
    force_p_mps2: Argument<'_, 'py>,
    omega_p_radps: Argument<'_, 'py>,
    readings: usize,
) -> Dict<'py> {
    let stamps = times("time_ns", time_ns)?;
    let forces = Rows::<3>::new("force_p_mps2", force_p_mps2, &[Some(stamps.len())])?;
    let rates = Rows::<3>::new("omega_p_radps", omega_p_radps, &[Some(stamps.len())])?;
    let integrals = integrate(&stamps, forces.get()?, rates.get()?, readings).map_err(raise)?;
    let shape = [stamps.len() / readings, readings];
    let (dict, each) = (PyDict::new(py), || integrals.iter());
    dict.put("rotation", &shape, each().map(|at| at.rotation.transpose()))?;
    dict.put("force_integral_mps", &shape, each().map(|at| at.force_mps))?;
    dict.put(
        "rotation_integral_s",
        &shape,
        each().map(|at| at.rotation_s.transpose()),
    )?;
    dict.put("bias_integral", &shape, each().map(|at| at.bias.transpose()))?;
    Ok(dict)
}
