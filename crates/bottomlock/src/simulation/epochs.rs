//! The epochs of a schedule in order of time.

use crate::simulation::schedule::Schedule;

/// Which sensor measures.
#[derive(Debug, Clone, Copy)]
pub(super) enum Aid {
    Dvl,
    Depth,
    Magnetometer,
    Gps,
}

/// A sensor and the number of its epoch.
pub(super) type Epoch = (Aid, usize);

/// The epochs of all aiding sensors in order of time; at the same time DVL before depth before magnetometer before GPS.
pub(super) struct Epochs<'a> {
    streams: [(Aid, &'a [i64], usize); 4],
}

impl<'a> Epochs<'a> {
    pub(super) fn new(schedule: &Schedule<'a>) -> Self {
        Self {
            streams: [
                (Aid::Dvl, schedule.dvl_time_ns, 0),
                (Aid::Depth, schedule.depth_time_ns, 0),
                (Aid::Magnetometer, schedule.magnetometer_time_ns, 0),
                (Aid::Gps, schedule.gps_time_ns, 0),
            ],
        }
    }

    pub(super) fn next_ns(&self) -> Option<i64> {
        let nexts = self.streams.iter().filter_map(|(_, times, next)| times.get(*next));
        nexts.min().copied()
    }

    pub(super) fn next_if(&mut self, wanted: impl Fn(i64) -> bool) -> Option<Epoch> {
        let (sensor, times, next) = self
            .streams
            .iter_mut()
            .filter(|(_, times, next)| *next < times.len())
            .min_by_key(|(_, times, next)| times[*next])?;
        let k = *next;
        wanted(times[k]).then(|| {
            *next += 1;
            (*sensor, k)
        })
    }
}
