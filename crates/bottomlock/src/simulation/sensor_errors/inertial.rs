//! The errors of the IMU: white noise on drifting biases, drawn many samples at a time.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::{Stream, normals};
use crate::earth::Earth;
use crate::frames::{Rot, Tangent};
use crate::mechanisation::{ImuSample, Sampling};
use crate::model::{ImuModel, Model};
use crate::random::Normals;
use crate::simulation::sensor_errors::RunKey;
use crate::simulation::truth::Truth;

/// What takes each reading, with the true biases of accelerometers (m/s²) and gyros (rad/s).
pub(crate) type Take<'a> = dyn FnMut(ImuSample, &Vector3<f64>, &Vector3<f64>) + 'a;

/// Samples whose noise is drawn at a time.
const AT_ONCE: usize = 64;

/// The inertial sensors of a run.
#[derive(Debug)]
pub(super) struct Inertial {
    accel_noise: Normals,
    gyro_noise: Normals,
    accel_walk: Normals,
    gyro_walk: Normals,
    /// Its current value, m/s².
    pub(super) accel_bias: Vector3<f64>,
    /// Its current value, rad/s.
    pub(super) gyro_bias: Vector3<f64>,
    /// Scale factors and misalignments of the gyros, by which readings are too much.
    gyro_matrix: Matrix3<f64>,
    /// What the gyros see of the specific force, less that of a level vehicle at rest, rad/s per m/s².
    gyro_by_force: Matrix3<f64>,
    /// Scale factors of the accelerometers; at a level vehicle's rest they are part of the biases.
    accel_scale: Vector3<f64>,
    /// How far the biases of accelerometers and gyros move while the sensors warm up.
    warm_up: [Vector3<f64>; 2],
    /// Gravity at the origin, m/s².
    gravity_mps2: f64,
    /// Time of the first reading.
    first_ns: Option<i64>,
}

impl Inertial {
    pub(super) fn new(imu: &ImuModel, key: &RunKey) -> Self {
        let of = |stream| normals(key, stream, 0);
        let (mut accel_walk, mut gyro_walk) = (of(Stream::AccelBias), of(Stream::GyroBias));
        Self {
            accel_noise: of(Stream::AccelNoise),
            gyro_noise: of(Stream::GyroNoise),
            accel_bias: accel_walk.each(&[1.0; 3]) * imu.accel_bias_sd_mps2,
            gyro_bias: gyro_walk.each(&[1.0; 3]) * imu.gyro_bias_sd_radps,
            accel_walk,
            gyro_walk,
            gyro_matrix: drawn_matrix(imu, &mut of(Stream::GyroMatrix)),
            gyro_by_force: {
                let mut normals = of(Stream::GyroForce);
                Matrix3::from_fn(|_, _| imu.gyro_g_sensitivity_sd_radps_per_mps2 * normals.one())
            },
            accel_scale: of(Stream::AccelScale).each(&[1.0; 3]) * imu.accel_scale_sd,
            warm_up: [
                of(Stream::AccelWarmUp).each(&[1.0; 3]) * imu.accel_warm_up_sd_mps2,
                of(Stream::GyroWarmUp).each(&[1.0; 3]) * imu.gyro_warm_up_sd_radps,
            ],
            gravity_mps2: 0.0,
            first_ns: None,
        }
    }

    /// Reads samples of the truth, which come in order, each once; `take` gets each reading with the biases behind it.
    pub(super) fn read(
        &mut self,
        model: &Model,
        earth: &Earth,
        sampling: Sampling,
        at: &Truth<'_>,
        mut samples: Range<usize>,
        take: &mut Take<'_>,
    ) {
        self.gravity_mps2 = earth.gravity_mps2;
        if self.first_ns.is_none() {
            let Some(first) = samples.next() else { return };
            let (accel_noise, gyro_noise) = (self.accel_noise.each(&[1.0; 3]), self.gyro_noise.each(&[1.0; 3]));
            let truth = (
                Vector3::from(at.omega_p_radps[first]),
                Vector3::from(at.force_p_mps2[first]),
            );
            let reading = self.reading(&model.imu, at, first, truth, &gyro_noise, &accel_noise);
            self.first_ns = Some(at.time_ns[first]);
            take(reading, &self.accel_bias, &self.gyro_bias);
        }
        let mut drawn = [[[0.0; 3]; AT_ONCE]; 4];
        while !samples.is_empty() {
            let count = samples.len().min(AT_ONCE);
            let streams = [
                &mut self.accel_walk,
                &mut self.gyro_walk,
                &mut self.gyro_noise,
                &mut self.accel_noise,
            ];
            for (stream, rows) in streams.into_iter().zip(&mut drawn) {
                stream.fill(&mut rows[..count]);
            }
            for (row, k) in samples.by_ref().take(count).enumerate() {
                let [accel_walk, gyro_walk, gyro_noise, accel_noise] =
                    drawn.each_ref().map(|rows| Vector3::from(rows[row]));
                let root_dt = root_interval_s(at, k);
                self.accel_bias += accel_walk * (model.imu.accel_bias_walk_mps2_rts * root_dt);
                self.gyro_bias += gyro_walk * (model.imu.gyro_bias_walk_radps_rts * root_dt);
                self.warm(model.imu.warm_up_time_s.0, [at.time_ns[k - 1], at.time_ns[k]]);
                let truth = match sampling {
                    Sampling::Instantaneous => (Vector3::from(at.omega_p_radps[k]), Vector3::from(at.force_p_mps2[k])),
                    Sampling::Averaged => mean_readings(at, earth, k),
                };
                let reading = self.reading(&model.imu, at, k, truth, &gyro_noise, &accel_noise);
                take(reading, &self.accel_bias, &self.gyro_bias);
            }
        }
    }

    /// The biases move on from one time to the next.
    fn warm(&mut self, time_s: f64, between_ns: [i64; 2]) {
        if self.warm_up == [Vector3::zeros(); 2] {
            return;
        }
        let first_ns = self.first_ns.unwrap_or(between_ns[0]);
        let [before, after] = between_ns.map(|time_ns| (-((time_ns - first_ns) as f64) * 1e-9 / time_s).exp());
        let [accel, gyro] = self.warm_up.map(|whole| whole * (before - after));
        self.accel_bias += accel;
        self.gyro_bias += gyro;
    }

    fn reading(
        &self,
        imu: &ImuModel,
        at: &Truth<'_>,
        k: usize,
        (rate, force): (Vector3<f64>, Vector3<f64>),
        gyro_noise: &Vector3<f64>,
        accel_noise: &Vector3<f64>,
    ) -> ImuSample {
        let root_dt = root_interval_s(at, k);
        let from_level = force + Vector3::z() * self.gravity_mps2;
        ImuSample {
            time_ns: at.time_ns[k],
            rate_p_radps: (rate
                + self.gyro_matrix * rate
                + self.gyro_by_force * from_level
                + self.gyro_bias
                + gyro_noise * (imu.gyro_noise_rad_rts / root_dt))
                .into(),
            force_p_mps2: (force
                + self.accel_scale.component_mul(&from_level)
                + self.accel_bias
                + accel_noise * (imu.accel_noise_mps_rts / root_dt))
                .into(),
        }
    }
}

/// Scale factors and misalignments of the gyros of a run.
fn drawn_matrix(imu: &ImuModel, normals: &mut Normals) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| {
        let sd = if i == j {
            imu.gyro_scale_sd
        } else {
            imu.gyro_misalignment_sd_rad
        };
        sd * normals.one()
    })
}

/// Root of the time since the sample before; of the first sample, of the time to the next.
fn root_interval_s(at: &Truth<'_>, k: usize) -> f64 {
    let after = k.max(1);
    ((at.time_ns[after] - at.time_ns[after - 1]) as f64 * 1e-9).sqrt()
}

/// The mean rate and force since the last sample that lead the strapdown step from truth to truth.
fn mean_readings(truth: &Truth<'_>, on: &Earth, k: usize) -> (Vector3<f64>, Vector3<f64>) {
    let dt = (truth.time_ns[k] - truth.time_ns[k - 1]) as f64 * 1e-9;
    let earth = Vector3::from(on.rate_t);
    let (before, after) = (truth.attitude(k - 1), truth.attitude(k));
    let turn = before.inverse() * Rot::<Tangent, Tangent>::exp(earth * dt) * after;
    let (r0, r1) = (before.matrix(), after.matrix());
    let (v0, v1) = (
        r0 * Vector3::from(truth.velocity_p_mps[k - 1]),
        r1 * Vector3::from(truth.velocity_p_mps[k]),
    );
    let middle_t_m = (Vector3::from(truth.position_t_m[k - 1]) + Vector3::from(truth.position_t_m[k])) * 0.5;
    let gravity = on.gravity_t_mps2(&middle_t_m.into());
    let needed = (v1 - v0) / dt - gravity + earth.cross(&(v0 + v1));
    let mean: Matrix3<f64> = (r0 + r1) * 0.5;
    // The mean of two neighbouring rotations is invertible unless they are half a turn apart.
    let force = mean
        .lu()
        .solve(&needed)
        .unwrap_or_else(|| Vector3::from(truth.force_p_mps2[k]));
    (turn.log() / dt, force)
}
