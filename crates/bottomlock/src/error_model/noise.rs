//! The process noise of half an interval (Eqs. 5, 6, 10 and 11).
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 1.7 times as long at `methods 8`.

use super::ProcessNoise;
use super::covariance::Matrix;
use crate::layout::{ACCEL_BIAS, ATTITUDE, BIASED_BEAMS, DVL_BIAS, DVL_SCALE, GYRO_BIAS, VELOCITY};
use crate::simd::{Lane, M3, Simd, Strip, V3, cross, scale, transposed};

/// G Q Gᵀ T/2 (isotropic noise, so R Q Rᵀ = Q) as the blocks that are not zero.
#[derive(Clone, Copy)]
pub struct HalfNoise<T> {
    /// On the diagonal.
    pub(super) attitude: T,
    /// Below the diagonal and on it.
    pub(super) velocity: M3<T>,
    /// Row i: element i of the velocity with the misalignment.
    pub(super) across: M3<T>,
    pub(super) accel_bias: T,
    pub(super) gyro_bias: T,
    pub(super) dvl_bias: T,
    pub(super) dvl_scale: T,
}

impl<T: Lane> HalfNoise<T> {
    /// Noise of an interval of twice `half`, in seconds, where `rotation` and `velocity_p` are R and v times 1/√`weight`.
    #[inline(always)]
    pub(super) fn new(rotation: &M3<T>, velocity_p: V3<T>, noise: &ProcessNoise, half: T, weight: T) -> Self {
        let v = velocity_p;
        let gyro_noise_by_velocity = scale(v, half.splat(noise.gyro) * half * weight);
        let accel = half.splat(noise.accel) * half;
        // [v×][v×]ᵀ = |v|² I − v vᵀ, and [v×]Rᵀ.
        let [x, y, z] = [
            gyro_noise_by_velocity[0] * v[0],
            gyro_noise_by_velocity[1] * v[1],
            gyro_noise_by_velocity[2] * v[2],
        ];
        let zero = half.splat(0.0);
        Self {
            attitude: half.splat(noise.gyro) * half,
            velocity: [
                [accel + (y + z), zero, zero],
                [-(gyro_noise_by_velocity[1] * v[0]), accel + (x + z), zero],
                [
                    -(gyro_noise_by_velocity[2] * v[0]),
                    -(gyro_noise_by_velocity[2] * v[1]),
                    accel + (x + y),
                ],
            ],
            across: transposed(&[
                cross(gyro_noise_by_velocity, rotation[0]),
                cross(gyro_noise_by_velocity, rotation[1]),
                cross(gyro_noise_by_velocity, rotation[2]),
            ]),
            accel_bias: half.splat(noise.accel_bias) * half,
            gyro_bias: half.splat(noise.gyro_bias) * half,
            dvl_bias: half.splat(noise.dvl_bias) * half,
            dvl_scale: half.splat(noise.dvl_scale) * half,
        }
    }

    /// P ← P + G Q Gᵀ T/2.
    #[inline(always)]
    pub(super) fn add_to(&self, p: &mut Matrix<T>) {
        for i in 0..3 {
            for j in 0..3 {
                p[VELOCITY + i][ATTITUDE + j] += self.across[i][j];
                if j < i {
                    p[VELOCITY + i][VELOCITY + j] += self.velocity[i][j];
                }
            }
        }
        self.add_to_upper(p);
    }

    /// The same by strips of the rows up to `wide`, as a transition then takes them: a strip that is read just after a part of it was
    /// written by itself waits until that is in the cache.
    #[inline(always)]
    pub(super) fn add_to_rows<S: Simd, W: Strip<S, T>>(&self, simd: S, p: &mut Matrix<T>, wide: usize) {
        for i in 0..3 {
            for j in (0..wide).step_by(W::WIDTH) {
                let of = |k: usize| (j..j + W::WIDTH).contains(&k).then(|| k - j);
                let mut tilt = W::take(simd, &p[ATTITUDE + i][j..]);
                let mut velocity = W::take(simd, &p[VELOCITY + i][j..]);
                if let Some(k) = of(ATTITUDE + i) {
                    tilt = tilt.plus_at(k, self.attitude);
                }
                for l in 0..3 {
                    if let Some(k) = of(VELOCITY + l) {
                        tilt = tilt.plus_at(k, self.across[l][i]);
                        velocity = velocity.plus_at(k, self.velocity[i.max(l)][i.min(l)]);
                    }
                    if let Some(k) = of(ATTITUDE + l) {
                        velocity = velocity.plus_at(k, self.across[i][l]);
                    }
                }
                tilt.put(&mut p[ATTITUDE + i][j..]);
                velocity.put(&mut p[VELOCITY + i][j..]);
            }
        }
        self.add_to_steady(p);
    }

    /// The same on and above the diagonal alone.
    #[inline(always)]
    pub(super) fn add_to_upper(&self, p: &mut Matrix<T>) {
        for i in 0..3 {
            p[ATTITUDE + i][ATTITUDE + i] += self.attitude;
            for j in 0..3 {
                p[ATTITUDE + j][VELOCITY + i] += self.across[i][j];
                if i <= j {
                    p[VELOCITY + i][VELOCITY + j] += self.velocity[j][i];
                }
            }
        }
        self.add_to_steady(p);
    }

    /// Its random walks alone.
    #[inline(always)]
    fn add_to_steady(&self, p: &mut Matrix<T>) {
        for i in 0..3 {
            p[ACCEL_BIAS + i][ACCEL_BIAS + i] += self.accel_bias;
            p[GYRO_BIAS + i][GYRO_BIAS + i] += self.gyro_bias;
        }
        for i in 0..BIASED_BEAMS {
            p[DVL_BIAS + i][DVL_BIAS + i] += self.dvl_bias;
        }
        p[DVL_SCALE][DVL_SCALE] += self.dvl_scale;
    }
}
