//! When sensors measure and which beams return.

use crate::aiding::registry::{SENSORS, SensorKind};
use crate::dvl::geometry::{BeamMask, MAX_BEAMS};
use crate::error::{NavError, require_finite, require_non_negative, require_rising};

/// Times of each sensor, returning beams, and offsets of readings by the environment.
#[derive(Debug, Clone, Copy, Default)]
pub struct Schedule<'a> {
    /// DVL epochs, ns, rising.
    pub dvl_time_ns: &'a [i64],
    /// Valid beams of each DVL epoch.
    pub beam_valid: &'a [BeamMask],
    /// Range along each beam, m, 0 for one that meets no bottom; none where the noise of the beams does not grow with it.
    pub beam_range_m: &'a [[f64; MAX_BEAMS]],
    /// Epochs of the other sensors, by their places in the registry.
    pub sensors: [SensorEpochs<'a>; SENSORS],
    /// Epochs of the beams that the water returns.
    pub water: WaterEpochs<'a>,
}

/// When the water returns beams, and how it moves: c = `current_n_mps` + depth `shear_n_ps`, along north and east.
///
/// The arrays have a value for each epoch.
#[derive(Debug, Clone, Copy, Default)]
pub struct WaterEpochs<'a> {
    /// Epochs, ns, rising.
    pub time_ns: &'a [i64],
    /// Valid beams.
    pub beam_valid: &'a [BeamMask],
    /// Current at depth 0, m/s.
    pub current_n_mps: &'a [[f64; 2]],
    /// Its change with depth, 1/s.
    pub shear_n_ps: &'a [[f64; 2]],
}

/// When a sensor measures.
#[derive(Debug, Clone, Copy, Default)]
pub struct SensorEpochs<'a> {
    /// Epochs, ns, rising.
    pub time_ns: &'a [i64],
    /// Reading less true value without noise at each of them, in the unit of the reading; none for ideal surroundings.
    pub offset: &'a [f64],
}

impl<'a> Schedule<'a> {
    /// The epochs of a sensor.
    #[must_use]
    pub const fn of(&self, kind: SensorKind) -> &SensorEpochs<'a> {
        &self.sensors[kind as usize]
    }

    /// The same with other epochs of a sensor.
    #[must_use]
    pub fn with(mut self, kind: SensorKind, time_ns: &'a [i64], offset: &'a [f64]) -> Self {
        self.sensors[kind as usize] = SensorEpochs { time_ns, offset };
        self
    }

    /// Checks that the arrays at the epochs have their length and are finite.
    pub(crate) fn validate(&self) -> Result<(), NavError> {
        let same = |field, got: usize, wanted: usize, of: &str| {
            if got == wanted {
                Ok(())
            } else {
                Err(NavError::WrongCount {
                    field,
                    got,
                    expected: format!("{wanted} as for {of}_time_ns"),
                })
            }
        };
        same("beam_valid", self.beam_valid.len(), self.dvl_time_ns.len(), "dvl")?;
        if !self.beam_range_m.is_empty() {
            same("beam_range_m", self.beam_range_m.len(), self.dvl_time_ns.len(), "dvl")?;
        }
        for &range_m in self.beam_range_m.iter().flatten() {
            require_non_negative("beam_range_m", range_m)?;
        }
        let (water, epochs) = (&self.water, self.water.time_ns.len());
        same("water_track_valid", water.beam_valid.len(), epochs, "water_track")?;
        same("water_current_n_mps", water.current_n_mps.len(), epochs, "water_track")?;
        same("water_shear_n_ps", water.shear_n_ps.len(), epochs, "water_track")?;
        require_rising("water_track", water.time_ns)?;
        for (k, &time_ns) in water.time_ns.iter().enumerate() {
            require_finite("water_current_n_mps", time_ns, &water.current_n_mps[k])?;
            require_finite("water_shear_n_ps", time_ns, &water.shear_n_ps[k])?;
        }
        for kind in SensorKind::ALL {
            let (epochs, simulation) = (self.of(kind), kind.declaration().simulation);
            let (name, field) = simulation.map_or(("", None), |of| (of.name, of.offset));
            let field = field.unwrap_or("offset");
            if !epochs.offset.is_empty() {
                same(field, epochs.offset.len(), epochs.time_ns.len(), name)?;
            }
            for (&time_ns, &offset) in epochs.time_ns.iter().zip(epochs.offset) {
                require_finite(field, time_ns, &[offset])?;
            }
        }
        Ok(())
    }
}
