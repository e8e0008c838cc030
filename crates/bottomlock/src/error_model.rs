//! The error model (Eqs. 2–11) and the propagation of the covariance.
//!
//! F has nine dynamic rows made of skew, identity and zero blocks; the covariance is propagated through them alone
//! (a dense 20×20 product costs eleven times the arithmetic). Everything is written over [`Lane`].
//!
//! Sources: Tal et al. 2017, Eqs. (3)–(6), (9)–(11); F₃₂ and F₃₃ after Miller, Farrell et al. 2010, as erratum E8 states.

mod carry;
mod sandwich;
mod side_by_side;
mod transition;

use crate::imu::{EarthTerms, Inertial, Kinematics};
use crate::lane::{Lane, M3, V3, add, dot, mat_axpy, mat_mul, mul, scale, skew, splat3, tmul, zero3};
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DVL_BIAS, DVL_SCALE, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};
use sandwich::sandwich;
use transition::{FirstOrder, SecondOrder, Transition};

/// Power spectral densities of the process noise (Eqs. 6 and 11): squares of the per-root-second figures.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ProcessNoise {
    /// Accelerometer white noise, (m/s)²/s.
    pub accel: f64,
    /// Gyro white noise, rad²/s.
    pub gyro: f64,
    /// Accelerometer bias random walk, (m/s²)²/s.
    pub accel_bias: f64,
    /// Gyro bias random walk, (rad/s)²/s.
    pub gyro_bias: f64,
    /// Beam bias random walk, (m/s)²/s.
    pub dvl_bias: f64,
    /// Scale factor random walk, 1/s.
    pub dvl_scale: f64,
}

/// The entries of F (Eq. 4) that change with time, for one filter or several side by side.
#[derive(Debug, Clone, Copy)]
pub struct Coefficients<T> {
    /// R v: the block F_rρ is −[R v ×].
    velocity_t: V3<T>,
    /// R: the block F_rv; F_ρ,bg is −R.
    rotation: M3<T>,
    /// F₃₂ = Rᵀ[g×] + [v×]Rᵀ[ω_ie×].
    force: M3<T>,
    /// ω_ip + Rᵀω_ie: the block F₃₃ is minus its cross matrix.
    swing: V3<T>,
    /// v: the block F_v,bg is −[v×].
    velocity_p: V3<T>,
}

impl<T: Lane> Coefficients<T> {
    /// The coefficients at a state and rate.
    #[inline(always)]
    pub fn at(kinematics: &Kinematics<T>, inertial: &Inertial<T>, earth: &EarthTerms) -> Self {
        let rotation = kinematics.rotation_t_p;
        let velocity_p = kinematics.velocity_p_mps;
        let like = velocity_p[0];
        let zero = like.splat(0.0);
        let rate_ie_t = splat3(like, earth.rate_t);
        let gravity_t = [zero, zero, like.splat(earth.gravity_mps2)];
        let earth_part = mat_mul(&skew(velocity_p), &transposed_times_skew(&rotation, rate_ie_t));
        Self {
            velocity_t: mul(&rotation, velocity_p),
            rotation,
            force: mat_axpy(
                &transposed_times_skew(&rotation, gravity_t),
                like.splat(1.0),
                &earth_part,
            ),
            swing: add(inertial.rate_p_radps, tmul(&rotation, rate_ie_t)),
            velocity_p,
        }
    }

    #[inline(always)]
    fn zero(like: T) -> Self {
        let zero = [like.splat(0.0); 3];
        Self {
            velocity_t: zero,
            rotation: zero3(like),
            force: zero3(like),
            swing: zero,
            velocity_p: zero,
        }
    }

    #[inline(always)]
    fn add_scaled(&mut self, other: &Self, factor: T) {
        self.velocity_t = add(self.velocity_t, scale(other.velocity_t, factor));
        self.rotation = mat_axpy(&self.rotation, factor, &other.rotation);
        self.force = mat_axpy(&self.force, factor, &other.force);
        self.swing = add(self.swing, scale(other.swing, factor));
        self.velocity_p = add(self.velocity_p, scale(other.velocity_p, factor));
    }

    /// The dense F of Eq. 9, for inspection and tests; `[row][column]`.
    pub fn dense(&self, earth: &EarthTerms) -> [[T; DIM]; DIM] {
        let like = self.velocity_p[0];
        let (zero, one, minus) = (like.splat(0.0), like.splat(1.0), like.splat(-1.0));
        let mut f = [[zero; DIM]; DIM];
        let mut put = |row: usize, column: usize, block: M3<T>| {
            for i in 0..3 {
                f[row + i][column..column + 3].copy_from_slice(&block[i]);
            }
        };
        let negative = |m: M3<T>| mat_axpy(&zero3(like), minus, &m);
        put(POSITION, ATTITUDE, negative(skew(self.velocity_t)));
        put(POSITION, VELOCITY, self.rotation);
        put(ATTITUDE, ATTITUDE, negative(skew(splat3(like, earth.rate_t))));
        put(ATTITUDE, GYRO_BIAS, negative(self.rotation));
        put(VELOCITY, ATTITUDE, self.force);
        put(VELOCITY, VELOCITY, negative(skew(self.swing)));
        put(
            VELOCITY,
            ACCEL_BIAS,
            negative([[one, zero, zero], [zero, one, zero], [zero, zero, one]]),
        );
        put(VELOCITY, GYRO_BIAS, negative(skew(self.velocity_p)));
        f
    }
}

/// Rᵀ[a×]: column j of [a×] is a × e_j.
#[inline(always)]
fn transposed_times_skew<T: Lane>(rotation: &M3<T>, a: V3<T>) -> M3<T> {
    let zero = a[0].splat(0.0);
    let x = tmul(rotation, [zero, a[2], -a[1]]);
    let y = tmul(rotation, [-a[2], zero, a[0]]);
    let z = tmul(rotation, [a[1], -a[0], zero]);
    [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]]
}

/// Integrates the coefficients over an interval by the trapezoidal rule.
#[derive(Debug, Clone, Copy)]
pub struct Interval<T> {
    sum: Coefficients<T>,
    last: Option<Coefficients<T>>,
    duration_s: f64,
}

impl Default for Interval<f64> {
    fn default() -> Self {
        Self::empty(0.0)
    }
}

impl<T: Lane> Interval<T> {
    /// An interval that has not begun, of lanes like `like`.
    #[inline(always)]
    #[must_use]
    pub fn empty(like: T) -> Self {
        Self {
            sum: Coefficients::zero(like),
            last: None,
            duration_s: 0.0,
        }
    }

    /// Length of the interval so far, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// True where the coefficients at the start of the next step are not known yet.
    #[must_use]
    pub fn needs_start(&self) -> bool {
        self.last.is_none()
    }

    /// States the coefficients at the start of the next step.
    #[inline(always)]
    pub fn start(&mut self, coefficients: Coefficients<T>) {
        self.last = Some(coefficients);
    }

    /// Adds a step of `dt_s` that ends with `coefficients`.
    #[inline(always)]
    pub fn extend(&mut self, coefficients: Coefficients<T>, dt_s: f64) {
        let half = coefficients.velocity_p[0].splat(0.5 * dt_s);
        let start = self.last.unwrap_or(coefficients);
        self.sum.add_scaled(&start, half);
        self.sum.add_scaled(&coefficients, half);
        self.last = Some(coefficients);
        self.duration_s += dt_s;
    }

    /// Forgets the coefficients at the current time: the state has been corrected.
    pub fn corrected(&mut self) {
        self.last = None;
    }

    /// Propagates a symmetric covariance over the interval and empties the interval.
    ///
    /// First order (Φ = I + F) suits one IMU step; second order (Φ = I + F + F²/2 with averaged F) suits an interval of many.
    /// The noise is trapezoidal in both: P⁺ = Φ(P + Q T/2)Φᵀ + Q T/2.
    #[inline(always)]
    pub fn propagate(&mut self, p: &mut [[T; DIM]; DIM], noise: &ProcessNoise, earth: &EarthTerms, second_order: bool) {
        if self.duration_s <= 0.0 {
            return;
        }
        let half = HalfNoise::new(&self.mean(), noise, self.duration_s);
        half.add_to(p);
        if second_order {
            sandwich(p, &SecondOrder::new(&self.sum, self.duration_s, earth));
        } else {
            sandwich(p, &FirstOrder::new(&self.sum, self.duration_s, earth));
        }
        half.add_to(p);
        self.empty_again();
    }

    #[inline(always)]
    fn empty_again(&mut self) {
        self.sum = Coefficients::zero(self.sum.velocity_p[0]);
        self.duration_s = 0.0;
    }

    #[inline(always)]
    fn mean(&self) -> Coefficients<T> {
        let like = self.sum.velocity_p[0];
        let mut mean = Coefficients::zero(like);
        mean.add_scaled(&self.sum, like.splat(1.0 / self.duration_s));
        mean
    }

    /// Φ over the interval as a dense matrix `[row][column]`, for inspection and tests.
    #[must_use]
    pub fn dense_transition(&self, earth: &EarthTerms, second_order: bool) -> [[T; DIM]; DIM] {
        let like = self.sum.velocity_p[0];
        let mut phi = [[like.splat(0.0); DIM]; DIM];
        for column in 0..DIM {
            let mut unit = [like.splat(0.0); DIM];
            unit[column] = like.splat(1.0);
            let image = if second_order {
                SecondOrder::new(&self.sum, self.duration_s, earth).apply(&unit)
            } else {
                FirstOrder::new(&self.sum, self.duration_s, earth).apply(&unit)
            };
            for row in 0..DIM {
                phi[row][column] = if row < DYNAMIC { image[row] } else { unit[row] };
            }
        }
        phi
    }
}

/// G Q Gᵀ T/2 (Eqs. 5 and 10; isotropic noise, so R Q Rᵀ = Q) as the blocks that are not zero.
struct HalfNoise<T> {
    attitude: T,
    velocity: M3<T>,
    accel: T,
    /// Rows: velocity; columns: misalignment.
    across: M3<T>,
    accel_bias: T,
    gyro_bias: T,
    dvl_bias: T,
    dvl_scale: T,
}

impl<T: Lane> HalfNoise<T> {
    #[inline(always)]
    fn new(mean: &Coefficients<T>, noise: &ProcessNoise, duration_s: f64) -> Self {
        let half = 0.5 * duration_s;
        let like = mean.velocity_p[0];
        let gyro = like.splat(noise.gyro * half);
        let lever = skew(mean.velocity_p);
        let (mut velocity, mut across) = (zero3(like), zero3(like));
        for i in 0..3 {
            for j in 0..3 {
                // [v×][v×]ᵀ and [v×]Rᵀ: row i of the lever with row j of the other factor.
                velocity[i][j] = dot(lever[i], lever[j]) * gyro;
                across[i][j] = dot(lever[i], mean.rotation[j]) * gyro;
            }
        }
        Self {
            attitude: gyro,
            velocity,
            accel: like.splat(noise.accel * half),
            across,
            accel_bias: like.splat(noise.accel_bias * half),
            gyro_bias: like.splat(noise.gyro_bias * half),
            dvl_bias: like.splat(noise.dvl_bias * half),
            dvl_scale: like.splat(noise.dvl_scale * half),
        }
    }

    /// P ← P + G Q Gᵀ T/2.
    #[inline(always)]
    fn add_to(&self, p: &mut [[T; DIM]; DIM]) {
        for i in 0..3 {
            p[ATTITUDE + i][ATTITUDE + i] += self.attitude;
            p[VELOCITY + i][VELOCITY + i] += self.accel;
            p[ACCEL_BIAS + i][ACCEL_BIAS + i] += self.accel_bias;
            p[GYRO_BIAS + i][GYRO_BIAS + i] += self.gyro_bias;
            for j in 0..3 {
                p[VELOCITY + i][VELOCITY + j] += self.velocity[i][j];
                p[VELOCITY + i][ATTITUDE + j] += self.across[i][j];
                p[ATTITUDE + j][VELOCITY + i] += self.across[i][j];
            }
        }
        for i in DVL_BIAS..DVL_SCALE {
            p[i][i] += self.dvl_bias;
        }
        p[DVL_SCALE][DVL_SCALE] += self.dvl_scale;
    }
}

/// The dense noise density G Q Gᵀ at the mean coefficients, for inspection and tests.
#[must_use]
pub fn dense_noise(coefficients: &Coefficients<f64>, noise: &ProcessNoise) -> [[f64; DIM]; DIM] {
    let mut q = [[0.0; DIM]; DIM];
    HalfNoise::new(coefficients, noise, 2.0).add_to(&mut q);
    q
}

#[cfg(test)]
#[path = "error_model_tests.rs"]
mod tests;
