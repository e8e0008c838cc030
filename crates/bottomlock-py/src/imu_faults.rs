//! Limits and faults of inertial readings.

use bottomlock::mechanisation::{IMU_FAULTS, ImuSample};
use bottomlock::replay as core;
use bottomlock::replay::{ImuFaults, RejectedReading};

use crate::arrays::{by_name, rows, times};
use crate::prelude::*;

/// Readings from their columns: times (n,), rates (n, 3) and forces (n, 3).
pub fn samples(time_ns: Argument, omega_p_radps: Argument, force_p_mps2: Argument) -> PyResult<Vec<ImuSample>> {
    let stamps = times("time_ns", time_ns)?;
    let rates = rows::<3>("omega_p_radps", omega_p_radps, Some(stamps.len()))?;
    let forces = rows::<3>("force_p_mps2", force_p_mps2, Some(stamps.len()))?;
    Ok(ImuSample::of_columns(&stamps, &rates, &forces).collect())
}

/// Rows of inertial readings, time_ns (n,), omega_p_radps (n, 3), force_p_mps2 (n, 3), that the limits of the options
/// reject, with the reasons; `imu` is the model's section.
#[pyfunction]
pub fn rejected_imu<'py>(
    py: Python<'py>,
    imu: Argument,
    options: Argument,
    time_ns: Argument,
    omega_p_radps: Argument,
    force_p_mps2: Argument,
) -> Dict<'py> {
    let (model, limits) = (settings::part("imu", imu)?, settings::options(options)?.imu_limits);
    let readings = samples(time_ns, omega_p_radps, force_p_mps2)?;
    rejected_dict(py, &core::rejected_readings(&readings, &model, &limits))
}

/// Faults of the inertial readings: their counts, every reading that was rejected, every interval that was inflated.
pub fn put_faults(out: &Bound<'_, PyDict>, faults: &ImuFaults) -> PyResult<()> {
    let py = out.py();
    out.set_item("imu_faults", by_name(py, &IMU_FAULTS, &faults.counts)?)?;
    out.set_item("rejected_imu", rejected_dict(py, &faults.rejected)?)?;
    let intervals = PyDict::new(py);
    columns! { intervals, &[faults.bridged.len()], faults.bridged.iter() => time_ns, gap_s }
    out.set_item("inflated_imu", intervals)
}

/// Row, time and reason of each reading that was rejected.
fn rejected_dict<'py>(py: Python<'py>, rejected: &[RejectedReading]) -> Dict<'py> {
    let out = PyDict::new(py);
    columns! { out, &[rejected.len()], rejected.iter() => row, time_ns }
    let reasons: Vec<String> = rejected.iter().map(|reading| reading.fault.to_string()).collect();
    out.set_item("reason", reasons)?;
    Ok(out)
}
