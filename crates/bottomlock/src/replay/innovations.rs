//! Innovations of every measurement of a log, and measurements that are withheld: predicted, compared and not used.
//!
//! A withheld measurement goes to a copy of the filter whose estimate is reported. The copy has the bits that the filter would
//! have had with it, so its innovation is that of the first measurement after an outage of the sensor, at any time within one
//! outage. A method with assumptions predicts with them; what it uses is reported of its filter without them, whose gate decides.

use super::log::Log;
use super::{Replay, STREAM_NAMES, STREAMS};
use crate::error::NavError;
use crate::filter::BridgeNoise;
use crate::filter::report::{Sensor, UpdateReport};
use crate::mechanisation::ImuSample;
use crate::navigator::Navigator;
use crate::navigator::events::Event;

/// Innovation z of a measurement and its covariance S, before the gate of the filter.
#[derive(Debug, Clone, PartialEq)]
pub struct InnovationRecord {
    /// Sensor.
    pub sensor: Sensor,
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Whether the filter did not use the measurement.
    pub is_withheld: bool,
    /// Number of rows.
    pub rows: usize,
    /// z, then the rows of S, in the units of the measurement.
    pub numbers: Box<[f64]>,
}

impl InnovationRecord {
    /// That of a report; `None` without a row, and for an assumption but those on the motion through the water.
    pub(super) fn of(report: &UpdateReport, is_withheld: bool) -> Option<Self> {
        let rows = report.rows;
        let is_assumed = matches!(report.sensor, Sensor::Speed | Sensor::Motion);
        if is_assumed || rows == 0 {
            return None;
        }
        let covariance = (0..rows).flat_map(|i| (0..rows).map(move |j| report.covariance[(i, j)]));
        Some(Self {
            sensor: report.sensor,
            time_ns: report.time_ns,
            is_withheld,
            rows,
            numbers: report.residual.iter().take(rows).copied().chain(covariance).collect(),
        })
    }
}

/// Copies of the filters with a withheld measurement that falls between two inertial readings.
#[derive(Debug, Default)]
pub(super) struct Withheld(Vec<(Navigator, Event)>);

impl Withheld {
    /// Predicts a measurement without using it.
    pub(super) fn predict(
        &mut self,
        navigator: &Navigator,
        event: &Event,
        records: &mut Vec<InnovationRecord>,
    ) -> Result<(), NavError> {
        let (mut copy, before) = (navigator.clone(), records.len());
        copy.filters().keep_best();
        copy.push(event, &mut |report| records.extend(record_of(report, event)))?;
        // Where the copy has the measurement still to take, it takes it with the next inertial reading.
        if records.len() == before {
            self.0.push((copy, *event));
        }
        Ok(())
    }

    /// Predicts those that waited for an inertial reading.
    pub(super) fn advance(
        &mut self,
        reading: &ImuSample,
        bridge: Option<&BridgeNoise>,
        records: &mut Vec<InnovationRecord>,
    ) -> Result<(), NavError> {
        self.0.drain(..).try_for_each(|(mut copy, event)| {
            copy.push_bridging(reading, bridge, &mut |report| {
                records.extend(record_of(report, &event));
            })
        })
    }
}

/// Record of a report if it is that of a withheld measurement.
fn record_of(report: &UpdateReport, event: &Event) -> Option<InnovationRecord> {
    let is_its = match event {
        Event::Imu(_) => false,
        Event::Beams(_) => report.sensor == Sensor::Beams,
        Event::WaterTrack(_) => report.sensor == Sensor::WaterTrack,
        Event::Aiding(measurement) => measurement.reports().any(|sensor| sensor == report.sensor),
    };
    InnovationRecord::of(report, true).filter(|record| is_its && record.time_ns == event.time_ns())
}

/// Checks that each stream has a flag for each row, or none.
pub(super) fn require_flags(log: &Log<'_>, request: &Replay<'_>) -> Result<(), NavError> {
    (0..STREAMS).try_for_each(|stream| {
        let (flags, rows) = (request.withheld[stream].len(), log.len(stream));
        if flags == 0 || (flags == rows && stream != super::log::IMU) {
            return Ok(());
        }
        Err(NavError::WrongCount {
            field: "withheld",
            got: flags,
            expected: format!("{rows}, one for each row of {}, and none for imu", STREAM_NAMES[stream]),
        })
    })
}

#[cfg(test)]
#[path = "innovations_tests.rs"]
mod tests;
