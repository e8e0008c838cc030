//! Limits and faults of inertial readings.

use bottomlock::frames::Vec3;
use bottomlock::mechanisation::{IMU_FAULTS, ImuSample};
use bottomlock::replay as core;
use bottomlock::replay::{ImuFaults, RejectedReading};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, by_name, rows, times};
use crate::settings;

/// Readings from their columns.
pub fn samples(time_ns: &[i64], rates: &[[f64; 3]], forces: &[[f64; 3]]) -> impl Iterator<Item = ImuSample> {
    let readings = time_ns.iter().zip(rates.iter().zip(forces));
    let sample = |(&time_ns, (&rate, &force)): (&i64, (&[f64; 3], &[f64; 3]))| ImuSample {
        time_ns,
        rate_p_radps: Vec3::from_array(rate),
        force_p_mps2: Vec3::from_array(force),
    };
    readings.map(sample)
}

/// Rows of inertial readings, time_ns (n,), omega_p_radps (n, 3), force_p_mps2 (n, 3), that the limits of the options
/// reject, with the reasons; `imu` is the model's section.
#[pyfunction]
pub fn rejected_imu<'py>(
    py: Python<'py>,
    imu: &Bound<'py, PyAny>,
    options: &Bound<'py, PyAny>,
    time_ns: &Bound<'py, PyAny>,
    omega_p_radps: &Bound<'py, PyAny>,
    force_p_mps2: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let (model, limits) = (settings::imu(imu)?, settings::options(options)?.imu_limits);
    let stamps = times("time_ns", time_ns)?;
    let rates = rows::<3>("omega_p_radps", omega_p_radps, Some(stamps.len()))?;
    let forces = rows::<3>("force_p_mps2", force_p_mps2, Some(stamps.len()))?;
    let readings: Vec<_> = samples(&stamps, &rates, &forces).collect();
    rejected_dict(py, &core::rejected_readings(&readings, &model, &limits))
}

/// Faults of the inertial readings: their counts, every reading that was rejected, every interval that was inflated.
pub fn put_faults(out: &Bound<'_, PyDict>, faults: &ImuFaults) -> PyResult<()> {
    let py = out.py();
    out.set_item("imu_faults", by_name(py, &IMU_FAULTS, &faults.counts)?)?;
    out.set_item("rejected_imu", rejected_dict(py, &faults.rejected)?)?;
    let (bridged, count) = (&faults.bridged, faults.bridged.len());
    let intervals = PyDict::new(py);
    let times = bridged.iter().map(|one| one.time_ns).collect();
    intervals.set_item("time_ns", array::<i64>(py, times, &[count])?)?;
    let lengths = bridged.iter().map(|one| one.gap_s).collect();
    intervals.set_item("gap_s", array::<f64>(py, lengths, &[count])?)?;
    out.set_item("inflated_imu", intervals)
}

/// Row, time and reason of each reading that was rejected.
fn rejected_dict<'py>(py: Python<'py>, rejected: &[RejectedReading]) -> PyResult<Bound<'py, PyDict>> {
    let (out, count) = (PyDict::new(py), rejected.len());
    let rows = rejected.iter().map(|one| one.row as i64).collect();
    out.set_item("row", array::<i64>(py, rows, &[count])?)?;
    let times = rejected.iter().map(|one| one.time_ns).collect();
    out.set_item("time_ns", array::<i64>(py, times, &[count])?)?;
    let reasons: Vec<String> = rejected.iter().map(|one| one.fault.to_string()).collect();
    out.set_item("reason", reasons)?;
    Ok(out)
}
