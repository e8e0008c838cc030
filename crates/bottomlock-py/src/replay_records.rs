//! What a replay records of each ping and of the innovation of each measurement, as arrays.

use bottomlock::filter::report::Sensor;
use bottomlock::replay::{InnovationRecord, PingRecord, Track};
use numpy::Element;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;
use crate::batch_arrays::{NO_CHOICE, choice_code};

/// For each method a dict of sensors: times, flags, rows, and innovations with their covariances, padded with NaN.
pub fn put_innovations(out: &Bound<'_, PyDict>, tracks: &[Track]) -> PyResult<()> {
    let py = out.py();
    let of_methods = tracks.iter().map(|track| {
        let sensors = PyDict::new(py);
        let mut names: Vec<Sensor> = track.innovations.iter().map(|record| record.sensor).collect();
        names.sort_unstable();
        names.dedup();
        for sensor in names {
            let records: Vec<_> = track.innovations.iter().filter(|one| one.sensor == sensor).collect();
            sensors.set_item(sensor.name(), of_sensor(py, &records)?)?;
        }
        Ok(sensors)
    });
    out.set_item("innovations", of_methods.collect::<PyResult<Vec<_>>>()?)
}

fn of_sensor<'py>(py: Python<'py>, records: &[&InnovationRecord]) -> PyResult<Bound<'py, PyDict>> {
    let count = records.len();
    let width = records.iter().map(|record| record.rows).max().unwrap_or(0);
    let mut residuals = vec![f64::NAN; count * width];
    let mut covariances = vec![f64::NAN; count * width * width];
    for (k, record) in records.iter().enumerate() {
        let rows = record.rows;
        let (residual, covariance) = record.numbers.split_at(rows);
        residuals[k * width..][..rows].copy_from_slice(residual);
        for i in 0..rows {
            covariances[(k * width + i) * width..][..rows].copy_from_slice(&covariance[i * rows..][..rows]);
        }
    }
    let out = PyDict::new(py);
    let times = records.iter().map(|record| record.time_ns).collect();
    out.set_item("time_ns", array::<i64>(py, times, &[count])?)?;
    let flags = records.iter().map(|record| record.is_withheld).collect();
    out.set_item("withheld", array::<bool>(py, flags, &[count])?)?;
    let rows = records.iter().map(|record| record.rows as u8).collect();
    out.set_item("rows", array::<u8>(py, rows, &[count])?)?;
    out.set_item("residual", array(py, residuals, &[count, width])?)?;
    out.set_item("covariance", array(py, covariances, &[count, width, width])?)?;
    Ok(out)
}

/// Fix status, NIS, innovations and weights of each ping, methods × pings.
pub fn put_pings<'py>(out: &Bound<'py, PyDict>, tracks: &[Track], pings: usize, beams: usize) -> PyResult<()> {
    fn put<'py, T: Element>(
        out: &Bound<'py, PyDict>,
        key: &str,
        tracks: &[Track],
        shape: &[usize],
        of: impl Fn(&PingRecord) -> Vec<T>,
    ) -> PyResult<()> {
        let values = tracks
            .iter()
            .flat_map(|track| track.pings.iter().flat_map(&of))
            .collect();
        out.set_item(key, array(out.py(), values, shape)?)
    }
    let (flat, wide) = ([tracks.len(), pings], [tracks.len(), pings, beams]);
    put(out, "nis", tracks, &flat, |ping| vec![ping.nis])?;
    put(out, "nis_dof", tracks, &flat, |ping| vec![ping.degrees as u8])?;
    put(out, "fix_status", tracks, &flat, |ping| vec![ping.status as u8])?;
    put(out, "innovation_mps", tracks, &wide, |ping| {
        ping.innovation_mps[..beams].to_vec()
    })?;
    put(out, "innovation_sd_mps", tracks, &wide, |ping| {
        ping.innovation_sd_mps[..beams].to_vec()
    })?;
    put(out, "beam_weight", tracks, &wide, |ping| {
        ping.beam_weight[..beams].to_vec()
    })?;
    let choice = |ping: &PingRecord| ping.choice.as_ref().map_or([NO_CHOICE; 3], choice_code).to_vec();
    put(out, "choice", tracks, &[tracks.len(), pings, 3], choice)
}
