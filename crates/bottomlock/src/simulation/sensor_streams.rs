//! The seeded sensor streams of a whole run as arrays (Eqs. 12, 15 and Table 2).

use crate::dvl::geometry::{BeamGeometry, BeamSample, MAX_BEAMS};
use crate::error::NavError;
use crate::mechanisation::{ImuSample, Sampling};
use crate::model::Model;
use crate::navigator::events::{AttitudeSample, DepthSample, GpsSample};
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
    /// Depth readings.
    pub depth: Vec<DepthSample>,
    /// Attitude readings.
    pub attitude: Vec<AttitudeSample>,
    /// GPS readings.
    pub gps: Vec<GpsSample>,
}

/// Draws every stream of one run; a reading carries the standard deviation that `claimed` says, whatever made its error.
///
/// # Errors
/// [`NavError`] for a truth, a model or a schedule that makes no sense (truth and model are taken as validated by the caller).
pub fn simulate(
    truth: &Truth<'_>,
    geometry: &BeamGeometry,
    model: &Model,
    claimed: &Model,
    schedule: &Schedule<'_>,
    sampling: Sampling,
    key: &RunKey,
) -> Result<Streams, NavError> {
    schedule.validate()?;
    let mut suite = SensorErrors::new(model, claimed, sampling, geometry.beams(), truth.time_ns[0], key);
    let mut streams = Streams {
        initial: drawn_start(&true_state(truth, 0), model, key),
        imu: Vec::with_capacity(truth.time_ns.len()),
        accel_bias_p_mps2: Vec::with_capacity(truth.time_ns.len()),
        gyro_bias_p_radps: Vec::with_capacity(truth.time_ns.len()),
        pings: Vec::with_capacity(schedule.dvl_time_ns.len()),
        beam_bias_mps: Vec::with_capacity(schedule.dvl_time_ns.len()),
        scale_factor: Vec::with_capacity(schedule.dvl_time_ns.len()),
        depth: Vec::new(),
        attitude: Vec::new(),
        gps: Vec::new(),
    };
    suite.imus(truth, 0..truth.time_ns.len(), |reading, &accel_bias, &gyro_bias| {
        streams.imu.push(reading);
        streams.accel_bias_p_mps2.push(accel_bias.into());
        streams.gyro_bias_p_radps.push(gyro_bias.into());
    });
    for (&time_ns, &valid) in schedule.dvl_time_ns.iter().zip(schedule.beam_valid) {
        if let Some(previous) = streams.pings.last().filter(|last| time_ns <= last.time_ns) {
            return Err(NavError::TimeNotIncreasing {
                stream: "dvl",
                time_ns,
                previous_ns: previous.time_ns,
            });
        }
        streams.pings.push(suite.ping(truth, geometry, time_ns, valid)?);
        let (bias, scale) = suite.dvl_errors();
        streams.beam_bias_mps.push(bias);
        streams.scale_factor.push(scale);
    }
    let offset = |offsets: &[f64], k: usize| offsets.get(k).copied().unwrap_or(0.0);
    for (k, &time_ns) in schedule.depth_time_ns.iter().enumerate() {
        let reading = suite.depth(truth, time_ns, offset(schedule.depth_offset_m, k))?;
        streams.depth.push(reading);
    }
    for (k, &time_ns) in schedule.magnetometer_time_ns.iter().enumerate() {
        let reading = suite.attitude(truth, time_ns, offset(schedule.yaw_offset_rad, k))?;
        streams.attitude.push(reading);
    }
    for &time_ns in schedule.gps_time_ns {
        streams.gps.push(suite.gps(truth, time_ns)?);
    }
    Ok(streams)
}
