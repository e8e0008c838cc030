//! The epochs of a schedule in order of time.

use crate::aiding::registry::SensorKind;
use crate::simulation::schedule::Schedule;

/// Which sensor measures.
#[derive(Debug, Clone, Copy)]
pub(super) enum Aid {
    Dvl,
    Sensor(SensorKind),
    Water,
}

/// A sensor and the number of its epoch.
pub(super) type Epoch = (Aid, usize);

/// The epochs of all aiding sensors in order of time; at the same time the DVL's first, then in the order of the registry, and the water's
/// last.
pub(super) struct Epochs<'a> {
    streams: Vec<(Aid, &'a [i64], usize)>,
}

impl<'a> Epochs<'a> {
    pub(super) fn new(schedule: &Schedule<'a>) -> Self {
        let others = SensorKind::ALL.map(|kind| (Aid::Sensor(kind), schedule.of(kind).time_ns, 0));
        let water = (Aid::Water, schedule.water.time_ns, 0);
        let all = [(Aid::Dvl, schedule.dvl_time_ns, 0)]
            .into_iter()
            .chain(others)
            .chain([water]);
        Self {
            streams: all.filter(|(_, times, _)| !times.is_empty()).collect(),
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
