//! What a replay records of each ping and of the innovation of each measurement, as arrays.

use std::collections::BTreeMap;

use bottomlock::dvl::geometry::MAX_BEAMS;
use bottomlock::filter::report::Sensor;
use bottomlock::replay::{InnovationRecord, PingRecord, Track};

use crate::batch_arrays::{NO_CHOICE, choice_code};
use crate::prelude::*;

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

/// For each method what it made of the measurements of each sensor, and how far each slow error left its prior.
pub fn put_sensors(out: &Bound<'_, PyDict>, tracks: &[Track]) -> PyResult<()> {
    let py = out.py();
    let of_methods = tracks.iter().map(|track| {
        let sensors = PyDict::new(py);
        for (sensor, record) in &track.sensors {
            let one = PyDict::new(py);
            fields! { one, record => measured, rejected, left_out, inflated, nis, degrees }
            sensors.set_item(sensor.name(), one)?;
        }
        Ok(sensors)
    });
    out.set_item("sensors", of_methods.collect::<PyResult<Vec<_>>>()?)?;
    let slow_errors = tracks
        .iter()
        .map(|track| track.slow_errors.iter().copied().collect::<BTreeMap<_, _>>());
    out.set_item("slow_errors", slow_errors.collect::<Vec<_>>())
}

fn of_sensor<'py>(py: Python<'py>, records: &[&InnovationRecord]) -> Dict<'py> {
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
    out.column("time_ns", records.iter().map(|record| record.time_ns))?;
    out.column("withheld", records.iter().map(|record| record.is_withheld))?;
    out.column("rows", records.iter().map(|record| record.rows as u8))?;
    out.put("residual", &[count, width], residuals)?;
    out.put("covariance", &[count, width, width], covariances)?;
    Ok(out)
}

/// Fix status, NIS, innovations and weights of each ping, methods × pings.
pub fn put_pings(out: &Bound<'_, PyDict>, tracks: &[Track], pings: usize, beams: usize) -> PyResult<()> {
    let each = || tracks.iter().flat_map(|track| &track.pings);
    let flat = [tracks.len(), pings];
    out.put("nis", &flat, each().map(|ping| ping.nis))?;
    out.put("nis_dof", &flat, each().map(|ping| ping.degrees as u8))?;
    out.put("fix_status", &flat, each().map(|ping| ping.status as u8))?;
    let by_beam = |key: &str, of: fn(&PingRecord) -> &[f64; MAX_BEAMS]| {
        out.put(
            key,
            &[tracks.len(), pings, beams],
            each().flat_map(|ping| of(ping)[..beams].iter().copied()),
        )
    };
    by_beam("innovation_mps", |ping| &ping.innovation_mps)?;
    by_beam("innovation_sd_mps", |ping| &ping.innovation_sd_mps)?;
    by_beam("beam_weight", |ping| &ping.beam_weight)?;
    let choice = |ping: &PingRecord| ping.choice.as_ref().map_or([NO_CHOICE; 3], choice_code);
    out.put("choice", &flat, each().map(choice))
}
