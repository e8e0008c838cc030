//! Limits and faults of inertial readings.

use bottomlock::frames::Vec3;
use bottomlock::mechanisation::{IMU_FAULTS, ImuLimits, ImuSample, LongGap};
use bottomlock::replay as core;
use bottomlock::replay::{ImuFaults, RejectedReading};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, by_name, rows, times};
use crate::errors::{invalid, raise};
use crate::keys::{Keys, read};
use crate::settings;

/// The limits of the inertial readings; the default of each that the options do not name.
pub fn limits(options: &Keys<'_>) -> PyResult<ImuLimits> {
    let default = ImuLimits::default();
    Ok(ImuLimits {
        max_rate_radps: options.number_or("max_imu_rate_radps", default.max_rate_radps)?,
        max_force_mps2: options.number_or("max_imu_force_mps2", default.max_force_mps2)?,
        stuck_after: if options.has("imu_stuck_after")? {
            options.extract("imu_stuck_after", "a whole number, 0 or more")?
        } else {
            default.stuck_after
        },
        max_gap_s: options.number_or("max_imu_gap_s", default.max_gap_s)?,
        long_gap: if options.has("imu_gap")? {
            match options.text("imu_gap")?.as_str() {
                "refuse" => LongGap::Refuse,
                "inflate" => LongGap::Inflate,
                other => {
                    return Err(invalid(format!(
                        "options.imu_gap is '{other}', expected 'refuse' or 'inflate'"
                    )));
                }
            }
        } else {
            default.long_gap
        },
        gap_rate_sd_radps: options.number_or("imu_gap_rate_sd_radps", default.gap_rate_sd_radps)?,
        gap_accel_sd_mps2: options.number_or("imu_gap_accel_sd_mps2", default.gap_accel_sd_mps2)?,
    })
}

/// The limits, under the keys that [`limits`] reads.
pub fn put_limits(dict: &Bound<'_, PyDict>, limits: &ImuLimits) -> PyResult<()> {
    dict.set_item("max_imu_rate_radps", limits.max_rate_radps)?;
    dict.set_item("max_imu_force_mps2", limits.max_force_mps2)?;
    dict.set_item("imu_stuck_after", limits.stuck_after)?;
    dict.set_item("max_imu_gap_s", limits.max_gap_s)?;
    let gap = match limits.long_gap {
        LongGap::Refuse => "refuse",
        LongGap::Inflate => "inflate",
    };
    dict.set_item("imu_gap", gap)?;
    dict.set_item("imu_gap_rate_sd_radps", limits.gap_rate_sd_radps)?;
    dict.set_item("imu_gap_accel_sd_mps2", limits.gap_accel_sd_mps2)
}

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
    let (model, limits) = (read("imu", imu, settings::imu)?, settings::options(options)?.imu_limits);
    limits.validate().map_err(raise)?;
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
