//! Everything that can arrive at a navigator, with its own time.

use crate::aiding::registry::Measurement;
use crate::dvl::geometry::{BeamGeometry, BeamSample};
use crate::error::{NavError, require_time};
use crate::mechanisation::ImuSample;

pub use crate::aiding::attitude::AttitudeSample;
pub use crate::aiding::depth::DepthSample;
pub use crate::aiding::gps::{GpsSample, GpsVelocity};
pub use crate::aiding::heading::HeadingSample;
pub use crate::aiding::registry::{STREAM_NAMES, STREAMS, WATER_TRACK};
pub use crate::aiding::thrust::ThrustSample;
pub use crate::aiding::velocity::VelocitySample;
pub use crate::aiding::water_track::WaterSample;

/// Anything that arrives.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Event {
    /// Inertial reading.
    Imu(ImuSample),
    /// Ping.
    Beams(BeamSample),
    /// A measurement of any other sensor.
    Aiding(Measurement),
    /// Beams that the water returned.
    WaterTrack(WaterSample),
}

impl<M: Into<Measurement>> From<M> for Event {
    fn from(measurement: M) -> Self {
        Self::Aiding(measurement.into())
    }
}

impl Event {
    /// Time of validity, ns.
    #[must_use]
    pub fn time_ns(&self) -> i64 {
        match self {
            Self::Imu(sample) => sample.time_ns,
            Self::Beams(ping) | Self::WaterTrack(WaterSample { ping, .. }) => ping.time_ns,
            Self::Aiding(measurement) => measurement.time_ns(),
        }
    }

    /// Name and number of the stream that the event belongs to.
    pub(crate) fn stream(&self) -> (&'static str, usize) {
        let index = match self {
            Self::Imu(_) => 0,
            Self::Beams(_) => 1,
            Self::Aiding(measurement) => 2 + measurement.kind() as usize,
            Self::WaterTrack(_) => WATER_TRACK,
        };
        (STREAM_NAMES[index], index)
    }

    /// Checks the numbers of the event.
    pub(crate) fn validate(&self, geometry: &BeamGeometry) -> Result<(), NavError> {
        require_time(self.stream().0, self.time_ns())?;
        match self {
            Self::Imu(sample) => sample.validate(),
            Self::Beams(sample) => sample.validate(geometry),
            Self::WaterTrack(sample) => sample.validate(geometry),
            Self::Aiding(measurement) => measurement.validate(),
        }
    }
}
