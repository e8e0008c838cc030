//! Schedules of many runs, owned: what the runs have in common is kept once.

use crate::aiding::registry::SENSORS;
use crate::dvl::geometry::{BeamMask, MAX_BEAMS};
use crate::simulation::schedule::{Schedule, SensorEpochs, WaterEpochs};

/// Values at each epoch, shared by all runs or one set for each.
#[derive(Debug, Clone)]
pub struct PerRun<T>(pub Vec<Vec<T>>);

impl<T> Default for PerRun<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> PerRun<T> {
    /// The values of one run.
    #[must_use]
    pub fn of(&self, run: usize) -> &[T] {
        self.0.get(run).or(self.0.last()).map_or(&[], Vec::as_slice)
    }
}

/// Epochs of all sensors, owned.
#[derive(Debug, Clone)]
pub struct OwnedSchedule {
    /// DVL epochs, ns.
    pub dvl_time_ns: Vec<i64>,
    /// Their valid beams.
    pub beam_valid: PerRun<BeamMask>,
    /// Their ranges, m; none where the noise does not grow with them.
    pub beam_range_m: PerRun<[f64; MAX_BEAMS]>,
    /// Epochs of the other sensors.
    pub sensors: [OwnedEpochs; SENSORS],
    /// Epochs of the beams that the water returns.
    pub water: OwnedWater,
    /// When states are recorded, ns.
    pub sample_time_ns: Vec<i64>,
}

/// Epochs of a sensor and the offsets that the environment adds to its readings.
#[derive(Debug, Clone, Default)]
pub struct OwnedEpochs {
    /// Epochs, ns.
    pub time_ns: PerRun<i64>,
    /// Offset at each; none for ideal surroundings.
    pub offset: PerRun<f64>,
}

/// Epochs of the beams that the water returns, and the current at each.
#[derive(Debug, Clone, Default)]
pub struct OwnedWater {
    /// Epochs, ns.
    pub time_ns: Vec<i64>,
    /// Valid beams.
    pub beam_valid: PerRun<BeamMask>,
    /// Current at depth 0, m/s.
    pub current_n_mps: Vec<[f64; 2]>,
    /// Its change with depth, 1/s.
    pub shear_n_ps: Vec<[f64; 2]>,
}

impl OwnedSchedule {
    /// The epochs of one run.
    #[must_use]
    pub fn of(&self, run: usize) -> Schedule<'_> {
        Schedule {
            dvl_time_ns: &self.dvl_time_ns,
            beam_valid: self.beam_valid.of(run),
            beam_range_m: self.beam_range_m.of(run),
            sensors: self.sensors.each_ref().map(|epochs| SensorEpochs {
                time_ns: epochs.time_ns.of(run),
                offset: epochs.offset.of(run),
            }),
            water: WaterEpochs {
                time_ns: &self.water.time_ns,
                beam_valid: self.water.beam_valid.of(run),
                current_n_mps: &self.water.current_n_mps,
                shear_n_ps: &self.water.shear_n_ps,
            },
        }
    }
}
