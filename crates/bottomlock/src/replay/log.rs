//! A recorded log: its streams, merged by time of validity.

use crate::aiding::registry::{Measurement, SENSORS};
use crate::aiding::water_track::WaterSample;
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error::NavError;
use crate::mechanisation::ImuSample;
use crate::navigator::events::{Event, STREAM_NAMES, STREAMS, WATER_TRACK};
use crate::navigator::first_readings::FirstReadings;

/// Number of the inertial stream.
pub(super) const IMU: usize = 0;

/// A recorded log: each stream rising in time, any of them but the inertial one may be empty.
#[derive(Debug, Clone, Copy, Default)]
pub struct Log<'a> {
    /// Inertial readings.
    pub imu: &'a [ImuSample],
    /// Pings.
    pub pings: &'a [BeamSample],
    /// Measurements of the other sensors, by their places in the registry.
    pub sensors: [&'a [Measurement]; SENSORS],
    /// Beams that the water returned.
    pub water_track: &'a [WaterSample],
}

/// Names the row of an error, and its stream by its place in [`STREAM_NAMES`].
pub(super) fn in_row(stream: usize, row: usize) -> impl Fn(NavError) -> NavError {
    move |source| NavError::InRow {
        stream: STREAM_NAMES[stream],
        row,
        source: Box::new(source),
    }
}

impl Log<'_> {
    pub(crate) fn len(&self, stream: usize) -> usize {
        match stream {
            0 => self.imu.len(),
            1 => self.pings.len(),
            WATER_TRACK => self.water_track.len(),
            _ => self.sensors[stream - 2].len(),
        }
    }

    pub(crate) fn get(&self, stream: usize, row: usize) -> Option<Event> {
        match stream {
            0 => self.imu.get(row).copied().map(Event::Imu),
            1 => self.pings.get(row).copied().map(Event::Beams),
            WATER_TRACK => self.water_track.get(row).copied().map(Event::WaterTrack),
            _ => self.sensors[stream - 2].get(row).copied().map(Event::Aiding),
        }
    }

    /// Checks every number, and that time rises within each stream; `gravity_mps2` is that of the filter, m/s².
    ///
    /// # Errors
    /// [`NavError::InRow`] that names stream, row and field.
    pub fn validate(&self, geometry: &BeamGeometry, gravity_mps2: f64) -> Result<(), NavError> {
        let mut first = FirstReadings::default();
        for stream in 0..STREAMS {
            let mut previous_ns = None;
            for row in 0..self.len(stream) {
                let Some(event) = self.get(stream, row) else { break };
                let in_row = in_row(stream, row);
                event.validate(geometry).map_err(&in_row)?;
                first = first.with(&event, gravity_mps2, None).map_err(&in_row)?;
                let time_ns = event.time_ns();
                if let Some(previous_ns) = previous_ns.filter(|&previous_ns| time_ns <= previous_ns) {
                    return Err(in_row(NavError::TimeNotIncreasing {
                        stream: STREAM_NAMES[stream],
                        time_ns,
                        previous_ns,
                    }));
                }
                previous_ns = Some(time_ns);
            }
        }
        Ok(())
    }

    /// How many rows of each stream lie before a time.
    pub(super) fn rows_before(&self, time_ns: i64) -> [usize; STREAMS] {
        std::array::from_fn(|stream| {
            let before = |row: usize| self.get(stream, row).is_some_and(|event| event.time_ns() < time_ns);
            (0..self.len(stream)).take_while(|&row| before(row)).count()
        })
    }

    /// The earliest of the next rows of the streams from `first` on; at the same time in order of [`STREAM_NAMES`].
    pub(super) fn earliest(&self, next: &[usize; STREAMS], first: usize) -> Option<(usize, Event)> {
        let heads = (first..STREAMS).filter_map(|stream| Some((stream, self.get(stream, next[stream])?)));
        heads.min_by_key(|(_, event)| event.time_ns())
    }

    /// Rows that a replay from `start_ns` cannot use.
    pub(super) fn unused(&self, start_ns: i64, last_ns: i64) -> Unused {
        let mut unused = Unused::default();
        for stream in 0..STREAMS {
            let times = (0..self.len(stream)).filter_map(|row| Some(self.get(stream, row)?.time_ns()));
            for time_ns in times {
                unused.before_start[stream] += usize::from(time_ns < start_ns);
                unused.after_end[stream] += usize::from(time_ns > last_ns);
            }
        }
        unused
    }
}

/// Rows of each stream that moved no filter, in the order of [`STREAM_NAMES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Unused {
    /// Earlier than the start.
    pub before_start: [usize; STREAMS],
    /// Later than the last inertial reading, to which alone a filter can be led.
    pub after_end: [usize; STREAMS],
    /// Rejected by the checks of the inertial readings.
    pub rejected: [usize; STREAMS],
}
