//! One run's sensors with their errors, fed the truth as it unfolds (Eqs. 12, 15 and Table 2).
//!
//! Every stream is its own ChaCha8 stream under the key (campaign seed, trajectory, run): run k alone equals run k of a campaign,
//! a sensor switched off shifts no other, and lost beams are drawn like the others.

mod inertial;
mod water;

use std::ops::Range;

use self::inertial::Inertial;
use self::water::{Water, WaterAround};
use crate::aiding::registry::{Levers, Measurement, SENSORS, SensorKind};
use crate::aiding::sensor::{Scene, TrueMotion};
use crate::aiding::water_track::WaterSample;
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamMotion, BeamSample, MAX_BEAMS};
use crate::earth::Earth;
use crate::error::NavError;
use crate::filter::options::Options;
use crate::frames::Vec3;
use crate::layout;
use crate::layout::BIASED_BEAMS;
use crate::mechanisation::{ImuSample, Sampling};
use crate::model::Model;
use crate::random::Normals;
use crate::simulation::schedule::{Schedule, WaterEpochs};
use crate::simulation::truth::Truth;
use crate::state::{ErrorVector, NavState};

/// The key of a run's random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunKey {
    /// Seed of the campaign.
    pub seed: u64,
    /// Key of the trajectory.
    pub trajectory: u64,
    /// Number of the run.
    pub run: u64,
}

#[derive(Debug, Clone, Copy)]
#[repr(u64)]
enum Stream {
    Initial = 1,
    AccelNoise = 2,
    GyroNoise = 3,
    AccelBias = 4,
    GyroBias = 5,
    DvlScale = 6,
    GyroMatrix = 700,
    AccelWarmUp = 701,
    GyroWarmUp = 702,
    GyroForce = 703,
    AccelScale = 704,
    // 7 to 99 belong to the sensors of the registry, each of which declares its own.
    /// Plus the beam's index.
    BeamNoise = 100,
    /// Plus the beam's index.
    BeamBias = 200,
    /// Plus the beam's index.
    BeamOutlier = 300,
    /// Plus the beam's index.
    WaterNoise = 400,
    /// Plus the beam's index.
    WaterOutlier = 500,
    /// Plus the beam's index.
    WaterLoss = 600,
}

/// The key of a run's generators; its streams differ by their numbers.
fn seed(key: &RunKey) -> [u8; 32] {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&key.seed.to_le_bytes());
    seed[8..16].copy_from_slice(&key.trajectory.to_le_bytes());
    seed[16..24].copy_from_slice(&key.run.to_le_bytes());
    seed[24..].copy_from_slice(b"botmlock");
    seed
}

/// The generator of a stream, or of a beam of it.
fn normals(key: &RunKey, stream: Stream, index: usize) -> Normals {
    Normals::new(seed(key), stream as u64 + index as u64)
}

/// A navigator's start: the truth less an error drawn from the model.
pub(crate) fn drawn_start(truth: &NavState, model: &Model, key: &RunKey) -> NavState {
    let mut normals = normals(key, Stream::Initial, 0);
    let mut error = ErrorVector::zeros();
    let blocks = [
        (layout::POSITION, model.initial.position_sd_m),
        (layout::ATTITUDE, model.initial.attitude_sd_rad),
        (layout::VELOCITY, model.initial.velocity_sd_mps),
    ];
    for (start, sd) in blocks {
        error.fixed_rows_mut::<3>(start).copy_from(&normals.each(&sd));
    }
    let mut state = *truth;
    state.inject(&-error);
    state
}

/// What the beams read at an instant of the truth, but for their biases.
fn motion_of(instant: &TrueMotion, model: &Model, scale_factor: f64) -> BeamMotion {
    let earth = Vec3::from(model.environment.earth_rate_t_radps().0);
    BeamMotion {
        velocity_p_mps: instant.velocity_p_mps,
        omega_tp_p_radps: instant.omega_p_radps - (instant.attitude_t_p.inverse() * earth).0,
        beam_bias_mps: [0.0; BIASED_BEAMS],
        scale_factor,
    }
}

/// The sensors of one run; each reading is drawn from the truth at its time.
///
/// `at` is the truth around the present: the whole of it, or a window that moves along with it.
#[derive(Debug)]
pub(crate) struct SensorErrors {
    model: Model,
    claimed: Model,
    earth: Earth,
    sampling: Sampling,
    inertial: Inertial,
    dvl: Dvl,
    water: Water,
    levers: Levers,
    sensors: [Vec<Normals>; SENSORS],
}

#[derive(Debug)]
struct Dvl {
    noise: Vec<Normals>,
    outliers: Vec<Normals>,
    walk: Vec<Normals>,
    scale_walk: Normals,
    bias_mps: [f64; MAX_BEAMS],
    scale_factor: f64,
    previous_ns: i64,
}

impl SensorErrors {
    /// Sensors that are as `model` says and claim the standard deviations of `claimed`.
    pub(crate) fn new(
        model: &Model,
        claimed: &Model,
        options: &Options,
        beams: usize,
        first_ns: i64,
        key: &RunKey,
    ) -> Self {
        let of = |stream| normals(key, stream, 0);
        let of_beams = |stream| -> Vec<Normals> { (0..beams).map(|beam| normals(key, stream, beam)).collect() };
        let (mut walk, mut scale_walk) = (of_beams(Stream::BeamBias), of(Stream::DvlScale));
        let mut bias_mps = [0.0; MAX_BEAMS];
        for (bias, normals) in bias_mps.iter_mut().zip(&mut walk) {
            *bias = model.sensors.dvl.beam_bias_sd_mps * normals.one();
        }
        Self {
            model: *model,
            claimed: *claimed,
            earth: Earth::from(&model.environment),
            sampling: options.imu_sampling,
            inertial: Inertial::new(&model.imu, key),
            dvl: Dvl {
                noise: of_beams(Stream::BeamNoise),
                outliers: of_beams(Stream::BeamOutlier),
                walk,
                scale_factor: model.sensors.dvl.scale_factor_sd * scale_walk.one(),
                scale_walk,
                bias_mps,
                previous_ns: first_ns,
            },
            water: Water {
                noise: of_beams(Stream::WaterNoise),
                outliers: of_beams(Stream::WaterOutlier),
                loss: of_beams(Stream::WaterLoss),
            },
            levers: options.levers,
            sensors: SensorKind::ALL.map(|kind| {
                let streams = kind.declaration().simulation.map_or(&[][..], |of| of.random);
                streams.iter().map(|&number| Normals::new(seed(key), number)).collect()
            }),
        }
    }

    /// Puts the true errors as they stand into a true state.
    pub(crate) fn errors_into(&self, truth: &mut NavState) {
        truth.accel_bias_p_mps2 = Vec3::from(self.inertial.accel_bias);
        truth.gyro_bias_p_radps = Vec3::from(self.inertial.gyro_bias);
        truth.dvl_bias_mps = nalgebra::Vector4::from_fn(|beam, _| self.dvl.bias_mps[beam]);
        truth.dvl_scale_factor = self.dvl.scale_factor;
    }

    /// True bias of every beam, m/s, and the scale factor, as they stand.
    pub(crate) fn dvl_errors(&self) -> ([f64; MAX_BEAMS], f64) {
        (self.dvl.bias_mps, self.dvl.scale_factor)
    }

    /// The inertial reading at sample k of the truth; samples come in order, each once.
    pub(crate) fn imu(&mut self, at: &Truth<'_>, k: usize) -> ImuSample {
        let mut readings = Vec::with_capacity(1);
        self.imus(at, k..k + 1, &mut |reading, _, _| readings.push(reading));
        readings[0]
    }

    /// The inertial readings at samples of the truth, which come in order, each once; `take` gets each of them with the true
    /// biases of accelerometers (m/s²) and gyros (rad/s).
    pub(crate) fn imus(&mut self, at: &Truth<'_>, samples: Range<usize>, take: &mut inertial::Take<'_>) {
        self.inertial
            .read(&self.model, &self.earth, self.sampling, at, samples, take);
    }

    /// The ping at epoch k of a schedule.
    pub(crate) fn ping(
        &mut self,
        at: &Truth<'_>,
        geometry: &BeamGeometry,
        schedule: &Schedule<'_>,
        k: usize,
    ) -> Result<BeamSample, NavError> {
        let time_ns = schedule.dvl_time_ns[k];
        let range_m = self.ranges(schedule, k)?;
        let (dvl, outliers) = (&self.model.sensors.dvl, &self.model.sensors.dvl_outliers);
        let own = &mut self.dvl;
        let instant = at.at("dvl", time_ns)?;
        let root_dt = ((time_ns - own.previous_ns) as f64 * 1e-9).sqrt();
        own.previous_ns = time_ns;
        own.scale_factor += dvl.scale_factor_walk_rts * root_dt * own.scale_walk.one();
        for (bias, normals) in own.bias_mps.iter_mut().zip(&mut own.walk) {
            *bias += dvl.beam_bias_walk_mps_rts * root_dt * normals.one();
        }
        let motion = motion_of(&instant, &self.model, own.scale_factor);
        let mut ping = BeamSample {
            time_ns,
            velocity_mps: [f64::NAN; MAX_BEAMS],
            sd_mps: range_m.map(|range_m| self.claimed.sensors.dvl.noise_sd_mps(range_m)),
            valid: schedule.beam_valid[k],
        };
        for (beam, (normals, random)) in own.noise.iter_mut().zip(&mut own.outliers).enumerate() {
            let reading = geometry.beam_velocity_mps(beam, &motion) + own.bias_mps[beam];
            let is_outlier = random.uniform() < outliers.outlier_fraction.0;
            let factor = if is_outlier { outliers.outlier_factor } else { 1.0 };
            let error = factor * dvl.noise_sd_mps(range_m[beam]) * normals.one();
            ping.velocity_mps[beam] = (reading + error) * geometry.sound_speed_scale();
        }
        Ok(ping)
    }

    /// The ranges at epoch k of a schedule, m.
    fn ranges(&self, schedule: &Schedule<'_>, k: usize) -> Result<[f64; MAX_BEAMS], NavError> {
        let grows = |model: &Model| model.sensors.dvl.beam_noise_sd_mps_per_m > 0.0;
        match schedule.beam_range_m.get(k) {
            None if grows(&self.model) || grows(&self.claimed) => Err(NavError::setting(
                "schedule.beam_range_m",
                "is missing",
                "the range of every beam at every ping, as dvl.beam_noise_sd_mps_per_m is more than 0",
            )),
            found => Ok(found.copied().unwrap_or_default()),
        }
    }

    /// The ping that the water returns at epoch k, with the biases and the scale factor of the last ping; none without a beam.
    pub(crate) fn water_ping(
        &mut self,
        at: &Truth<'_>,
        geometry: &BeamGeometry,
        epochs: &WaterEpochs<'_>,
        k: usize,
    ) -> Result<Option<WaterSample>, NavError> {
        let instant = at.at("water_track", epochs.time_ns[k])?;
        let motion = motion_of(&instant, &self.model, self.dvl.scale_factor);
        let water = WaterAround {
            level: self.earth.level(&instant.position_t_m.into()),
            rotation_t_p: instant.attitude_t_p.matrix(),
            current_n_mps: epochs.current_n_mps[k],
            shear_n_ps: epochs.shear_n_ps[k],
        };
        let mut ping = self.water.ping(
            geometry,
            &motion,
            &water,
            &self.model.sensors.water_track,
            &self.dvl.bias_mps,
        );
        ping.time_ns = epochs.time_ns[k];
        ping.sd_mps = [self.claimed.sensors.water_track.beam_noise_sd_mps; MAX_BEAMS];
        ping.valid = ping.valid.and(epochs.beam_valid[k]);
        let range_m = self.claimed.sensors.water_track.range_m;
        Ok((ping.valid != BeamMask::NONE).then_some(WaterSample { ping, range_m }))
    }

    /// The reading of a sensor at a time, with its environment offset; none for a sensor that is not simulated.
    pub(crate) fn measure(
        &mut self,
        at: &Truth<'_>,
        kind: SensorKind,
        time_ns: i64,
        offset: f64,
    ) -> Result<Option<Measurement>, NavError> {
        let declaration = kind.declaration();
        let Some(simulation) = declaration.simulation else {
            return Ok(None);
        };
        let truth = at.at(simulation.name, time_ns)?;
        let scene = Scene {
            time_ns,
            truth: &truth,
            level: self.earth.level(&truth.position_t_m.into()),
            offset,
            lever_p_m: *self.levers.of(kind),
            actual: &self.model.sensors,
            claimed: &self.claimed.sensors,
        };
        Ok(declaration.simulate(&scene, &mut self.sensors[kind as usize]))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// No two sensors share a random stream, and none takes one of the inertial sensors or of the beams.
    #[test]
    fn every_sensor_has_random_streams_of_its_own() {
        let declared = SensorKind::ALL
            .into_iter()
            .filter_map(|kind| kind.declaration().simulation);
        let numbers: Vec<u64> = declared.flat_map(|of| of.random).copied().collect();
        assert!(numbers.iter().all(|number| (7..100).contains(number)), "{numbers:?}");
        let apart: BTreeSet<_> = numbers.iter().collect();
        assert_eq!(apart.len(), numbers.len(), "{numbers:?}");
    }
}
