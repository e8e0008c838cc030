//! Seeded sensor streams from a truth (Eqs. 12, 15 and Table 2).
//!
//! Every stream is its own ChaCha8 stream under the key (campaign seed, trajectory, run): run k alone equals run k of a campaign,
//! a sensor switched off shifts no other, and lost beams are drawn like the others.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamMotion, BeamSample, MAX_BEAMS};
use crate::error::NavError;
use crate::events::{AttitudeSample, DepthSample, GpsSample};
use crate::frames::{Rot, Tangent, Vec3};
use crate::imu::{ImuSample, Sampling};
use crate::layout::{self, BIASED_BEAMS};
use crate::model::Model;
use crate::state::{ErrorVector, NavState};
use crate::truth::{Truth, true_state};

/// When each sensor measures, and which beams return.
#[derive(Debug, Clone, Copy)]
pub struct Schedule<'a> {
    /// DVL epochs, ns, rising.
    pub dvl_time_ns: &'a [i64],
    /// Valid beams of each DVL epoch.
    pub beam_valid: &'a [BeamMask],
    /// Depth epochs, ns.
    pub depth_time_ns: &'a [i64],
    /// Magnetometer epochs, ns.
    pub magnetometer_time_ns: &'a [i64],
    /// GPS epochs, ns.
    pub gps_time_ns: &'a [i64],
}

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
    Depth = 7,
    Magnetometer = 8,
    GpsPosition = 9,
    GpsVelocity = 10,
    /// Plus the beam's index.
    BeamNoise = 100,
    /// Plus the beam's index.
    BeamBias = 200,
}

struct Normals(ChaCha8Rng);

impl Normals {
    fn new(key: &RunKey, stream: Stream, index: usize) -> Self {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&key.seed.to_le_bytes());
        seed[8..16].copy_from_slice(&key.trajectory.to_le_bytes());
        seed[16..24].copy_from_slice(&key.run.to_le_bytes());
        seed[24..].copy_from_slice(b"botmlock");
        let mut generator = ChaCha8Rng::from_seed(seed);
        generator.set_stream(stream as u64 + index as u64);
        Self(generator)
    }
    fn one(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
    fn three(&mut self, sd: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sd * self.one())
    }
    fn each(&mut self, sd: &[f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|k, _| sd[k] * self.one())
    }
}

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
    /// True beam biases and scale factor before the first ping.
    pub first_dvl: ([f64; MAX_BEAMS], f64),
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
    if schedule.dvl_time_ns.len() != schedule.beam_valid.len() {
        return Err(NavError::WrongCount {
            field: "beam_valid",
            got: schedule.beam_valid.len(),
            expected: format!("{} as for dvl_time_ns", schedule.dvl_time_ns.len()),
        });
    }
    let (imu, accel_bias_p_mps2, gyro_bias_p_radps) = imu_stream(truth, model, sampling, key);
    let mut initial = true_state(truth, 0);
    initial.inject(&-initial_error(model, key));
    initial.time_ns = truth.time_ns[0];
    let dvl = dvl_streams(truth, geometry, model, claimed, schedule, key)?;
    Ok(Streams {
        initial,
        imu,
        accel_bias_p_mps2,
        gyro_bias_p_radps,
        pings: dvl.pings,
        beam_bias_mps: dvl.bias,
        scale_factor: dvl.scale,
        first_dvl: dvl.first,
        depth: depth_stream(truth, model, claimed, schedule.depth_time_ns, key)?,
        attitude: attitude_stream(truth, model, claimed, schedule.magnetometer_time_ns, key)?,
        gps: gps_stream(truth, model, claimed, schedule.gps_time_ns, key)?,
    })
}

fn initial_error(model: &Model, key: &RunKey) -> ErrorVector {
    let mut normals = Normals::new(key, Stream::Initial, 0);
    let mut error = ErrorVector::zeros();
    let blocks = [
        (layout::POSITION, model.initial.position_sd_m),
        (layout::ATTITUDE, model.initial.attitude_sd_rad),
        (layout::VELOCITY, model.initial.velocity_sd_mps),
    ];
    for (start, sd) in blocks {
        error.fixed_rows_mut::<3>(start).copy_from(&normals.each(&sd));
    }
    error
}

type ImuStream = (Vec<ImuSample>, Vec<[f64; 3]>, Vec<[f64; 3]>);

fn imu_stream(truth: &Truth<'_>, model: &Model, sampling: Sampling, key: &RunKey) -> ImuStream {
    let imu = &model.imu;
    let mut accel_noise = Normals::new(key, Stream::AccelNoise, 0);
    let mut gyro_noise = Normals::new(key, Stream::GyroNoise, 0);
    let mut accel_walk = Normals::new(key, Stream::AccelBias, 0);
    let mut gyro_walk = Normals::new(key, Stream::GyroBias, 0);
    let mut accel_bias = accel_walk.three(imu.accel_bias_sd_mps2);
    let mut gyro_bias = gyro_walk.three(imu.gyro_bias_sd_radps);
    let count = truth.time_ns.len();
    let (mut samples, mut accel_biases, mut gyro_biases) = (
        Vec::with_capacity(count),
        Vec::with_capacity(count),
        Vec::with_capacity(count),
    );
    for k in 0..count {
        let neighbour = if k == 0 { 1 } else { k };
        let root_dt = ((truth.time_ns[neighbour] - truth.time_ns[neighbour - 1]) as f64 * 1e-9).sqrt();
        if k > 0 {
            accel_bias += accel_walk.three(imu.accel_bias_walk_mps2_rts * root_dt);
            gyro_bias += gyro_walk.three(imu.gyro_bias_walk_radps_rts * root_dt);
        }
        let (rate, force) = match sampling {
            Sampling::Averaged if k > 0 => mean_readings(truth, model, k),
            _ => (
                Vector3::from(truth.omega_p_radps[k]),
                Vector3::from(truth.force_p_mps2[k]),
            ),
        };
        samples.push(ImuSample {
            time_ns: truth.time_ns[k],
            rate_p_radps: (rate + gyro_bias + gyro_noise.three(imu.gyro_noise_rad_rts / root_dt)).into(),
            force_p_mps2: (force + accel_bias + accel_noise.three(imu.accel_noise_mps_rts / root_dt)).into(),
        });
        accel_biases.push(accel_bias.into());
        gyro_biases.push(gyro_bias.into());
    }
    (samples, accel_biases, gyro_biases)
}

/// The mean rate and force since the last sample that lead the strapdown step from truth to truth.
fn mean_readings(truth: &Truth<'_>, model: &Model, k: usize) -> (Vector3<f64>, Vector3<f64>) {
    let dt = (truth.time_ns[k] - truth.time_ns[k - 1]) as f64 * 1e-9;
    let earth = model.environment.earth_rate_t_radps().0;
    let (before, after) = (truth.attitude(k - 1), truth.attitude(k));
    let turn = before.inverse() * Rot::<Tangent, Tangent>::exp(earth * dt) * after;
    let (r0, r1) = (before.matrix(), after.matrix());
    let (v0, v1) = (
        r0 * Vector3::from(truth.velocity_p_mps[k - 1]),
        r1 * Vector3::from(truth.velocity_p_mps[k]),
    );
    let gravity = Vector3::new(0.0, 0.0, model.environment.gravity_mps2);
    let needed = (v1 - v0) / dt - gravity + earth.cross(&(v0 + v1));
    let mean: Matrix3<f64> = (r0 + r1) * 0.5;
    // The mean of two neighbouring rotations is invertible unless they are half a turn apart.
    let force = mean
        .lu()
        .solve(&needed)
        .unwrap_or_else(|| Vector3::from(truth.force_p_mps2[k]));
    (turn.log() / dt, force)
}

struct DvlStreams {
    pings: Vec<BeamSample>,
    bias: Vec<[f64; MAX_BEAMS]>,
    scale: Vec<f64>,
    first: ([f64; MAX_BEAMS], f64),
}

fn dvl_streams(
    truth: &Truth<'_>,
    geometry: &BeamGeometry,
    model: &Model,
    claimed: &Model,
    schedule: &Schedule<'_>,
    key: &RunKey,
) -> Result<DvlStreams, NavError> {
    let dvl = &model.dvl;
    let earth = model.environment.earth_rate_t_radps().0;
    let stream_of = |stream: Stream| -> Vec<Normals> {
        (0..geometry.beams())
            .map(|beam| Normals::new(key, stream, beam))
            .collect()
    };
    let (mut noise, mut walk) = (stream_of(Stream::BeamNoise), stream_of(Stream::BeamBias));
    let mut scale_walk = Normals::new(key, Stream::DvlScale, 0);
    let mut bias = [0.0; MAX_BEAMS];
    for (beam, normals) in walk.iter_mut().enumerate() {
        bias[beam] = dvl.beam_bias_sd_mps * normals.one();
    }
    let mut scale = dvl.scale_factor_sd * scale_walk.one();
    let mut out = DvlStreams {
        pings: Vec::new(),
        bias: Vec::new(),
        scale: Vec::new(),
        first: (bias, scale),
    };
    let mut previous_ns = truth.time_ns[0];
    for (&time_ns, &valid) in schedule.dvl_time_ns.iter().zip(schedule.beam_valid) {
        if !out.pings.is_empty() && time_ns <= previous_ns {
            return Err(NavError::TimeNotIncreasing {
                stream: "dvl",
                time_ns,
                previous_ns,
            });
        }
        let instant = truth.at("dvl", time_ns)?;
        let root_dt = ((time_ns - previous_ns) as f64 * 1e-9).sqrt();
        previous_ns = time_ns;
        scale += dvl.scale_factor_walk_rts * root_dt * scale_walk.one();
        let mut ping = BeamSample {
            time_ns,
            velocity_mps: [f64::NAN; MAX_BEAMS],
            sd_mps: [claimed.dvl.beam_noise_sd_mps; MAX_BEAMS],
            valid,
        };
        for beam in 0..geometry.beams() {
            bias[beam] += dvl.beam_bias_walk_mps_rts * root_dt * walk[beam].one();
        }
        let motion = BeamMotion {
            velocity_p_mps: instant.velocity_p_mps,
            rate_tp_p_radps: instant.omega_p_radps - (instant.attitude_t_p.inverse() * Vec3::from(earth)).0,
            beam_bias_mps: [0.0; BIASED_BEAMS],
            scale_factor: scale,
        };
        for beam in 0..geometry.beams() {
            let reading = geometry.beam_velocity_mps(beam, &motion) + bias[beam];
            let error = dvl.beam_noise_sd_mps * noise[beam].one();
            ping.velocity_mps[beam] = (reading + error) * geometry.sound_speed_scale();
        }
        out.pings.push(ping);
        out.bias.push(bias);
        out.scale.push(scale);
    }
    Ok(out)
}

fn depth_stream(
    truth: &Truth<'_>,
    model: &Model,
    claimed: &Model,
    times: &[i64],
    key: &RunKey,
) -> Result<Vec<DepthSample>, NavError> {
    let mut normals = Normals::new(key, Stream::Depth, 0);
    let sd_m = model.depth.sd_m;
    let claimed_sd_m = claimed.depth.sd_m;
    times
        .iter()
        .map(|&time_ns| {
            let depth_m = truth.at("depth", time_ns)?.position_t_m.z + sd_m * normals.one();
            Ok(DepthSample {
                time_ns,
                depth_m,
                sd_m: claimed_sd_m,
            })
        })
        .collect()
}

fn attitude_stream(
    truth: &Truth<'_>,
    model: &Model,
    claimed: &Model,
    times: &[i64],
    key: &RunKey,
) -> Result<Vec<AttitudeSample>, NavError> {
    let mut normals = Normals::new(key, Stream::Magnetometer, 0);
    let magnetometer = model.magnetometer;
    let tilt = magnetometer.roll_pitch_sd_rad;
    times
        .iter()
        .map(|&time_ns| {
            let [roll, pitch, yaw] = truth.at("magnetometer", time_ns)?.attitude_t_p.to_euler_rad();
            let error = normals.each(&[tilt, tilt, magnetometer.yaw_sd_rad]);
            let quaternion = UnitQuaternion::from_euler_angles(roll + error.x, pitch + error.y, yaw + error.z);
            Ok(AttitudeSample {
                time_ns,
                attitude_t_p: Rot::from_quaternion_wxyz([quaternion.w, quaternion.i, quaternion.j, quaternion.k]),
                roll_pitch_sd_rad: claimed.magnetometer.roll_pitch_sd_rad,
                yaw_sd_rad: claimed.magnetometer.yaw_sd_rad,
            })
        })
        .collect()
}

fn gps_stream(
    truth: &Truth<'_>,
    model: &Model,
    claimed: &Model,
    times: &[i64],
    key: &RunKey,
) -> Result<Vec<GpsSample>, NavError> {
    let mut position = Normals::new(key, Stream::GpsPosition, 0);
    let mut velocity = Normals::new(key, Stream::GpsVelocity, 0);
    let gps = model.gps;
    times
        .iter()
        .map(|&time_ns| {
            let instant = truth.at("gps", time_ns)?;
            let velocity_t = (instant.attitude_t_p * Vec3::from(instant.velocity_p_mps)).0;
            Ok(GpsSample {
                time_ns,
                position_t_m: (instant.position_t_m + position.each(&gps.position_sd_m)).into(),
                position_sd_m: claimed.gps.position_sd_m,
                velocity_t_mps: (velocity_t + velocity.each(&gps.velocity_sd_mps)).into(),
                velocity_sd_mps: claimed.gps.velocity_sd_mps,
            })
        })
        .collect()
}
