//! One run's sensors with their errors, fed the truth as it unfolds (Eqs. 12, 15 and Table 2).
//!
//! Every stream is its own ChaCha8 stream under the key (campaign seed, trajectory, run): run k alone equals run k of a campaign,
//! a sensor switched off shifts no other, and lost beams are drawn like the others.

mod inertial;

use std::ops::Range;

use chacha20::ChaCha8Rng;
use chacha20::rand_core::SeedableRng;
use nalgebra::{UnitQuaternion, Vector3};
use rand_distr::{Distribution, StandardNormal};

use self::inertial::Inertial;
use crate::dvl::geometry::{BeamGeometry, BeamMask, BeamMotion, BeamSample, MAX_BEAMS};
use crate::error::NavError;
use crate::frames::{Rot, Vec3};
use crate::layout;
use crate::layout::BIASED_BEAMS;
use crate::mechanisation::{ImuSample, Sampling};
use crate::model::Model;
use crate::navigator::events::{AttitudeSample, DepthSample, GpsSample};
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
    Depth = 7,
    Magnetometer = 8,
    GpsPosition = 9,
    GpsVelocity = 10,
    /// Plus the beam's index.
    BeamNoise = 100,
    /// Plus the beam's index.
    BeamBias = 200,
}

/// The key of a run's generators; its streams are told apart by their numbers.
fn seed(key: &RunKey) -> [u8; 32] {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&key.seed.to_le_bytes());
    seed[8..16].copy_from_slice(&key.trajectory.to_le_bytes());
    seed[16..24].copy_from_slice(&key.run.to_le_bytes());
    seed[24..].copy_from_slice(b"botmlock");
    seed
}

#[derive(Debug)]
struct Normals(ChaCha8Rng);

impl Normals {
    fn new(key: &RunKey, stream: Stream, index: usize) -> Self {
        let mut generator = ChaCha8Rng::from_seed(seed(key));
        generator.set_stream(stream as u64 + index as u64);
        Self(generator)
    }
    fn one(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
    fn each(&mut self, sd: &[f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|k, _| sd[k] * self.one())
    }
    fn fill(&mut self, rows: &mut [[f64; 3]]) {
        rows.as_flattened_mut().fill_with(|| self.one());
    }
}

/// A navigator's start: the truth less an error drawn from the model.
pub(crate) fn drawn_start(truth: &NavState, model: &Model, key: &RunKey) -> NavState {
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
    let mut state = *truth;
    state.inject(&-error);
    state
}

/// The sensors of one run; each reading is drawn from the truth at its time.
///
/// `at` is the truth around the present: the whole of it, or a window that moves along with it.
#[derive(Debug)]
pub(crate) struct SensorErrors {
    model: Model,
    claimed: Model,
    sampling: Sampling,
    inertial: Inertial,
    dvl: Dvl,
    depth: Normals,
    magnetometer: Normals,
    gps_position: Normals,
    gps_velocity: Normals,
}

#[derive(Debug)]
struct Dvl {
    noise: Vec<Normals>,
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
        sampling: Sampling,
        beams: usize,
        first_ns: i64,
        key: &RunKey,
    ) -> Self {
        let of = |stream| Normals::new(key, stream, 0);
        let of_beams = |stream| -> Vec<Normals> { (0..beams).map(|beam| Normals::new(key, stream, beam)).collect() };
        let (mut walk, mut scale_walk) = (of_beams(Stream::BeamBias), of(Stream::DvlScale));
        let mut bias_mps = [0.0; MAX_BEAMS];
        for (bias, normals) in bias_mps.iter_mut().zip(&mut walk) {
            *bias = model.dvl.beam_bias_sd_mps * normals.one();
        }
        Self {
            model: *model,
            claimed: *claimed,
            sampling,
            inertial: Inertial::new(&model.imu, key),
            dvl: Dvl {
                noise: of_beams(Stream::BeamNoise),
                walk,
                scale_factor: model.dvl.scale_factor_sd * scale_walk.one(),
                scale_walk,
                bias_mps,
                previous_ns: first_ns,
            },
            depth: of(Stream::Depth),
            magnetometer: of(Stream::Magnetometer),
            gps_position: of(Stream::GpsPosition),
            gps_velocity: of(Stream::GpsVelocity),
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
        self.imus(at, k..k + 1, |reading, _, _| readings.push(reading));
        readings[0]
    }

    /// The inertial readings at samples of the truth, which come in order, each once; `take` gets each of them with the true
    /// biases of accelerometers (m/s²) and gyros (rad/s).
    pub(crate) fn imus(
        &mut self,
        at: &Truth<'_>,
        samples: Range<usize>,
        take: impl FnMut(ImuSample, &Vector3<f64>, &Vector3<f64>),
    ) {
        self.inertial.read(&self.model, self.sampling, at, samples, take);
    }

    /// The ping at a time.
    pub(crate) fn ping(
        &mut self,
        at: &Truth<'_>,
        geometry: &BeamGeometry,
        time_ns: i64,
        valid: BeamMask,
    ) -> Result<BeamSample, NavError> {
        let (dvl, own) = (&self.model.dvl, &mut self.dvl);
        let instant = at.at("dvl", time_ns)?;
        let root_dt = ((time_ns - own.previous_ns) as f64 * 1e-9).sqrt();
        own.previous_ns = time_ns;
        own.scale_factor += dvl.scale_factor_walk_rts * root_dt * own.scale_walk.one();
        for (bias, normals) in own.bias_mps.iter_mut().zip(&mut own.walk) {
            *bias += dvl.beam_bias_walk_mps_rts * root_dt * normals.one();
        }
        let earth = Vec3::from(self.model.environment.earth_rate_t_radps().0);
        let motion = BeamMotion {
            velocity_p_mps: instant.velocity_p_mps,
            rate_tp_p_radps: instant.omega_p_radps - (instant.attitude_t_p.inverse() * earth).0,
            beam_bias_mps: [0.0; BIASED_BEAMS],
            scale_factor: own.scale_factor,
        };
        let mut ping = BeamSample {
            time_ns,
            velocity_mps: [f64::NAN; MAX_BEAMS],
            sd_mps: [self.claimed.dvl.beam_noise_sd_mps; MAX_BEAMS],
            valid,
        };
        for (beam, normals) in own.noise.iter_mut().enumerate() {
            let reading = geometry.beam_velocity_mps(beam, &motion) + own.bias_mps[beam];
            let error = dvl.beam_noise_sd_mps * normals.one();
            ping.velocity_mps[beam] = (reading + error) * geometry.sound_speed_scale();
        }
        Ok(ping)
    }

    /// The depth reading at a time, off by what density, tide and barometer do to it.
    pub(crate) fn depth(&mut self, at: &Truth<'_>, time_ns: i64, offset_m: f64) -> Result<DepthSample, NavError> {
        let true_m = at.at("depth", time_ns)?.position_t_m.z;
        Ok(DepthSample {
            time_ns,
            depth_m: true_m + offset_m + self.model.depth.sd_m * self.depth.one(),
            sd_m: self.claimed.depth.sd_m,
        })
    }

    /// The attitude reading at a time, its yaw off by what declination and iron do to it.
    pub(crate) fn attitude(
        &mut self,
        at: &Truth<'_>,
        time_ns: i64,
        yaw_offset_rad: f64,
    ) -> Result<AttitudeSample, NavError> {
        let magnetometer = self.model.magnetometer;
        let [roll, pitch, yaw] = at.at("magnetometer", time_ns)?.attitude_t_p.to_euler_rad();
        let tilt = magnetometer.roll_pitch_sd_rad;
        let error = self.magnetometer.each(&[tilt, tilt, magnetometer.yaw_sd_rad]);
        let quaternion =
            UnitQuaternion::from_euler_angles(roll + error.x, pitch + error.y, yaw + yaw_offset_rad + error.z);
        Ok(AttitudeSample {
            time_ns,
            attitude_t_p: Rot::from_quaternion_wxyz([quaternion.w, quaternion.i, quaternion.j, quaternion.k]),
            roll_pitch_sd_rad: self.claimed.magnetometer.roll_pitch_sd_rad,
            yaw_sd_rad: self.claimed.magnetometer.yaw_sd_rad,
        })
    }

    /// The GPS reading at a time.
    pub(crate) fn gps(&mut self, at: &Truth<'_>, time_ns: i64) -> Result<GpsSample, NavError> {
        let (gps, claimed) = (self.model.gps, self.claimed.gps);
        let instant = at.at("gps", time_ns)?;
        let velocity_t = (instant.attitude_t_p * Vec3::from(instant.velocity_p_mps)).0;
        Ok(GpsSample {
            time_ns,
            position_t_m: (instant.position_t_m + self.gps_position.each(&gps.position_sd_m)).into(),
            position_sd_m: claimed.position_sd_m,
            velocity_t_mps: (velocity_t + self.gps_velocity.each(&gps.velocity_sd_mps)).into(),
            velocity_sd_mps: claimed.velocity_sd_mps,
        })
    }
}

#[cfg(test)]
mod tests {
    use chacha20::rand_core::Rng;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Word for word those of `rand_chacha`, over several refills, whatever the key and the stream: two libraries, one cipher.
        #[test]
        fn words_are_those_of_the_cipher(seed: u64, run: u64, index in 0_usize..8) {
            let key = RunKey { seed, trajectory: 7, run };
            let mut own = Normals::new(&key, Stream::BeamNoise, index);
            let mut other = <rand_chacha::ChaCha8Rng as SeedableRng>::from_seed(super::seed(&key));
            other.set_stream(Stream::BeamNoise as u64 + index as u64);
            for _ in 0..400 {
                prop_assert_eq!(own.0.next_u64(), other.next_u64());
            }
        }
    }
}
