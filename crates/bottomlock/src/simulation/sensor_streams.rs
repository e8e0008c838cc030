//! The seeded sensor streams of a whole run as arrays (Eqs. 12, 15 and Table 2).

use crate::aiding::registry::{Measurement, SENSORS, SensorKind};
use crate::aiding::sensor::AidingSensor;
use crate::aiding::water_track::WaterSample;
use crate::dvl::geometry::{BeamGeometry, BeamSample, MAX_BEAMS};
use crate::error::NavError;
use crate::filter::options::Options;
use crate::mechanisation::ImuSample;
use crate::model::Model;
use crate::simulation::schedule::Schedule;
use crate::simulation::sensor_errors::{RunKey, SensorErrors, drawn_start};
use crate::simulation::truth::{Truth, true_state};
use crate::state::NavState;

/// All sensor streams of one run, with the true errors behind them.
#[derive(Debug, Clone, PartialEq)]
pub struct Streams {
    /// The filter's start: the truth less a drawn error.
    pub initial: NavState,
    /// Inertial readings.
    pub imu: Vec<ImuSample>,
    /// True accelerometer bias at each reading, m/s².
    pub accel_bias_p_mps2: Vec<[f64; 3]>,
    /// True gyro bias at each reading, rad/s.
    pub gyro_bias_p_radps: Vec<[f64; 3]>,
    /// Pings.
    pub pings: Vec<BeamSample>,
    /// True bias of every beam at each ping, m/s.
    pub beam_bias_mps: Vec<[f64; MAX_BEAMS]>,
    /// True scale factor at each ping.
    pub scale_factor: Vec<f64>,
    /// Pings that the water returned.
    pub water: Vec<WaterSample>,
    /// Readings of the other sensors, by their places in the registry.
    pub sensors: [Vec<Measurement>; SENSORS],
}

impl Streams {
    /// The readings of a sensor.
    pub fn of<S: AidingSensor + TryFrom<Measurement>>(&self) -> impl Iterator<Item = S> + use<'_, S> {
        self.sensors[S::KIND as usize]
            .iter()
            .filter_map(|&measurement| S::try_from(measurement).ok())
    }
}

/// Draws every stream of one run; the standard deviation of a reading is that of the model `claimed`.
///
/// # Errors
/// [`NavError`] for a truth, a model or a schedule that is not valid (truth and model are taken as validated by the caller).
pub fn simulate(
    truth: &Truth<'_>,
    geometry: &BeamGeometry,
    model: &Model,
    claimed: &Model,
    schedule: &Schedule<'_>,
    options: &Options,
    key: &RunKey,
) -> Result<Streams, NavError> {
    schedule.validate()?;
    let mut errors = SensorErrors::new(model, claimed, options, geometry.beams(), truth.time_ns[0], key);
    let mut streams = Streams {
        initial: drawn_start(&true_state(truth, 0), model, key),
        imu: Vec::with_capacity(truth.time_ns.len()),
        accel_bias_p_mps2: Vec::with_capacity(truth.time_ns.len()),
        gyro_bias_p_radps: Vec::with_capacity(truth.time_ns.len()),
        pings: Vec::with_capacity(schedule.dvl_time_ns.len()),
        beam_bias_mps: Vec::with_capacity(schedule.dvl_time_ns.len()),
        scale_factor: Vec::with_capacity(schedule.dvl_time_ns.len()),
        water: Vec::with_capacity(schedule.water.time_ns.len()),
        sensors: Default::default(),
    };
    errors.imus(
        truth,
        0..truth.time_ns.len(),
        &mut |reading, &accel_bias, &gyro_bias| {
            streams.imu.push(reading);
            streams.accel_bias_p_mps2.push(accel_bias.into());
            streams.gyro_bias_p_radps.push(gyro_bias.into());
        },
    );
    let mut water = (0..schedule.water.time_ns.len()).peekable();
    for (epoch, &time_ns) in schedule.dvl_time_ns.iter().enumerate() {
        if let Some(previous) = streams.pings.last().filter(|last| time_ns <= last.time_ns) {
            return Err(NavError::TimeNotIncreasing {
                stream: "dvl",
                time_ns,
                previous_ns: previous.time_ns,
            });
        }
        // Water has the biases of the last ping at or before it.
        while let Some(k) = water.next_if(|&k| schedule.water.time_ns[k] < time_ns) {
            let sample = errors.water_ping(truth, geometry, &schedule.water, k)?;
            streams.water.extend(sample);
        }
        streams.pings.push(errors.ping(truth, geometry, schedule, epoch)?);
        let (bias, scale) = errors.dvl_errors();
        streams.beam_bias_mps.push(bias);
        streams.scale_factor.push(scale);
    }
    for k in water {
        let sample = errors.water_ping(truth, geometry, &schedule.water, k)?;
        streams.water.extend(sample);
    }
    for kind in SensorKind::ALL {
        let epochs = schedule.of(kind);
        for (k, &time_ns) in epochs.time_ns.iter().enumerate() {
            let offset = epochs.offset.get(k).copied().unwrap_or(0.0);
            streams.sensors[kind as usize].extend(errors.measure(truth, kind, time_ns, offset)?);
        }
    }
    Ok(streams)
}
