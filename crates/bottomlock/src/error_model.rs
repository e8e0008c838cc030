//! The error model (Eqs. 2–11) and the propagation of the covariance.
//!
//! F has nine dynamic rows made of skew, identity and zero blocks; the covariance is propagated through them alone
//! (a dense 20×20 product costs eleven times the arithmetic). Everything is written over [`Lane`].
//!
//! Sources: Tal et al. 2017, Eqs. (3)–(6), (9)–(11); F₃₂ and F₃₃ after Miller, Farrell et al. 2010, as erratum E8 states.

mod carry;

use crate::imu::{EarthTerms, Inertial, Kinematics};
use crate::lane::{Lane, M3, V3, add, cross, mat_axpy, mat_mul, mul, scale, skew, sub, tmul, zero3};
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, DVL_BIAS, DVL_SCALE, DYNAMIC, GYRO_BIAS, POSITION, VELOCITY};

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
        let zero = T::splat(0.0);
        let rate_ie_t = earth.rate_t.map(T::splat);
        let gravity_t = [zero, zero, T::splat(earth.gravity_mps2)];
        // Rᵀ[g×] and Rᵀ[ω_ie×]: column j of [a×] is a × e_j.
        let transposed_times_skew = |a: V3<T>| -> M3<T> {
            let columns = [[zero, a[2], -a[1]], [-a[2], zero, a[0]], [a[1], -a[0], zero]].map(|c| tmul(&rotation, c));
            std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]))
        };
        let earth_part = mat_mul(&skew(velocity_p), &transposed_times_skew(rate_ie_t));
        Self {
            velocity_t: mul(&rotation, velocity_p),
            rotation,
            force: mat_axpy(&transposed_times_skew(gravity_t), T::splat(1.0), &earth_part),
            swing: add(inertial.rate_p_radps, tmul(&rotation, rate_ie_t)),
            velocity_p,
        }
    }

    fn zero() -> Self {
        let zero = [T::splat(0.0); 3];
        Self {
            velocity_t: zero,
            rotation: zero3(),
            force: zero3(),
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
        let mut f = [[T::splat(0.0); DIM]; DIM];
        let mut put = |row: usize, column: usize, block: M3<T>| {
            for i in 0..3 {
                f[row + i][column..column + 3].copy_from_slice(&block[i]);
            }
        };
        let minus = T::splat(-1.0);
        let negative = |m: M3<T>| mat_axpy(&zero3(), minus, &m);
        let one = T::splat(1.0);
        let zero = T::splat(0.0);
        put(POSITION, ATTITUDE, negative(skew(self.velocity_t)));
        put(POSITION, VELOCITY, self.rotation);
        put(ATTITUDE, ATTITUDE, negative(skew(earth.rate_t.map(T::splat))));
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

/// Integrates the coefficients over an interval by the trapezoidal rule.
#[derive(Debug, Clone, Copy)]
pub struct Interval<T> {
    sum: Coefficients<T>,
    last: Option<Coefficients<T>>,
    duration_s: f64,
}

impl<T: Lane> Default for Interval<T> {
    fn default() -> Self {
        Self {
            sum: Coefficients::zero(),
            last: None,
            duration_s: 0.0,
        }
    }
}

impl<T: Lane> Interval<T> {
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
        let half = T::splat(0.5 * dt_s);
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
        let mean = self.mean();
        add_half_noise(p, &mean, noise, self.duration_s);
        if second_order {
            sandwich(p, &SecondOrder::new(&self.sum, self.duration_s, earth));
        } else {
            sandwich(p, &FirstOrder::new(&self.sum, self.duration_s, earth));
        }
        add_half_noise(p, &mean, noise, self.duration_s);
        self.sum = Coefficients::zero();
        self.duration_s = 0.0;
    }

    fn mean(&self) -> Coefficients<T> {
        let mut mean = Coefficients::zero();
        mean.add_scaled(&self.sum, T::splat(1.0 / self.duration_s));
        mean
    }

    /// Φ over the interval as a dense matrix `[row][column]`, for inspection and tests.
    #[must_use]
    pub fn dense_transition(&self, earth: &EarthTerms, second_order: bool) -> [[T; DIM]; DIM] {
        let mut phi = [[T::splat(0.0); DIM]; DIM];
        for column in 0..DIM {
            let mut unit = [T::splat(0.0); DIM];
            unit[column] = T::splat(1.0);
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

/// A transition matrix whose last eleven rows are the identity.
trait Transition<T> {
    /// The dynamic rows of Φ x.
    fn apply(&self, x: &[T; DIM]) -> [T; DYNAMIC];
}

/// Φ = I + F T, F with its skew and identity blocks.
struct FirstOrder<T> {
    velocity_t: V3<T>,
    rotation: M3<T>,
    earth: V3<T>,
    force: M3<T>,
    swing: V3<T>,
    velocity_p: V3<T>,
    duration: T,
}

impl<T: Lane> FirstOrder<T> {
    #[inline(always)]
    fn new(sum: &Coefficients<T>, duration_s: f64, earth: &EarthTerms) -> Self {
        Self {
            velocity_t: sum.velocity_t,
            rotation: sum.rotation,
            earth: earth.rate_t.map(|w| T::splat(w * duration_s)),
            force: sum.force,
            swing: sum.swing,
            velocity_p: sum.velocity_p,
            duration: T::splat(duration_s),
        }
    }
}

#[inline(always)]
fn part<T: Lane>(x: &[T; DIM], start: usize) -> V3<T> {
    [x[start], x[start + 1], x[start + 2]]
}

#[inline(always)]
fn join<T: Lane>(r: V3<T>, rho: V3<T>, v: V3<T>) -> [T; DYNAMIC] {
    [r[0], r[1], r[2], rho[0], rho[1], rho[2], v[0], v[1], v[2]]
}

impl<T: Lane> Transition<T> for FirstOrder<T> {
    #[inline(always)]
    fn apply(&self, x: &[T; DIM]) -> [T; DYNAMIC] {
        let (r, rho, v) = (part(x, POSITION), part(x, ATTITUDE), part(x, VELOCITY));
        let (ba, bg) = (part(x, ACCEL_BIAS), part(x, GYRO_BIAS));
        let new_r = add(sub(r, cross(self.velocity_t, rho)), mul(&self.rotation, v));
        let new_rho = sub(sub(rho, cross(self.earth, rho)), mul(&self.rotation, bg));
        let new_v = sub(add(v, mul(&self.force, rho)), cross(self.swing, v));
        let new_v = sub(sub(new_v, scale(ba, self.duration)), cross(self.velocity_p, bg));
        join(new_r, new_rho, new_v)
    }
}

/// Φ = I + F T + (F T)²/2; the blocks are those of Φ − I.
struct SecondOrder<T> {
    r_rho: M3<T>,
    r_v: M3<T>,
    r_ba: M3<T>,
    r_bg: M3<T>,
    rho_rho: M3<T>,
    rho_bg: M3<T>,
    v_rho: M3<T>,
    v_v: M3<T>,
    v_ba: M3<T>,
    v_bg: M3<T>,
}

impl<T: Lane> SecondOrder<T> {
    #[inline(always)]
    fn new(sum: &Coefficients<T>, duration_s: f64, earth: &EarthTerms) -> Self {
        let (half, minus) = (T::splat(0.5), T::splat(-1.0));
        let negative = |m: &M3<T>| mat_axpy(&zero3(), minus, m);
        // Blocks of F T.
        let a = negative(&skew(sum.velocity_t));
        let b = sum.rotation;
        let w = negative(&skew(earth.rate_t.map(|rate| T::splat(rate * duration_s))));
        let n = negative(&sum.rotation);
        let c = sum.force;
        let d = negative(&skew(sum.swing));
        let e = T::splat(-duration_s);
        let g = negative(&skew(sum.velocity_p));
        // Blocks of (F T)²/2 added to them.
        let quadratic =
            |x: &M3<T>, y: &M3<T>, z: &M3<T>, u: &M3<T>| mat_axpy(&mat_mul(x, y), T::splat(1.0), &mat_mul(z, u));
        let identity_times = |s: T| {
            let zero = T::splat(0.0);
            [[s, zero, zero], [zero, s, zero], [zero, zero, s]]
        };
        Self {
            r_rho: mat_axpy(&a, half, &quadratic(&a, &w, &b, &c)),
            r_v: mat_axpy(&b, half, &mat_mul(&b, &d)),
            r_ba: mat_axpy(&zero3(), half * e, &b),
            r_bg: mat_axpy(&zero3(), half, &quadratic(&a, &n, &b, &g)),
            rho_rho: mat_axpy(&w, half, &mat_mul(&w, &w)),
            rho_bg: mat_axpy(&n, half, &mat_mul(&w, &n)),
            v_rho: mat_axpy(&c, half, &quadratic(&c, &w, &d, &c)),
            v_v: mat_axpy(&d, half, &mat_mul(&d, &d)),
            v_ba: mat_axpy(&identity_times(e), half * e, &d),
            v_bg: mat_axpy(&g, half, &quadratic(&c, &n, &d, &g)),
        }
    }
}

impl<T: Lane> Transition<T> for SecondOrder<T> {
    #[inline(always)]
    fn apply(&self, x: &[T; DIM]) -> [T; DYNAMIC] {
        let (r, rho, v) = (part(x, POSITION), part(x, ATTITUDE), part(x, VELOCITY));
        let (ba, bg) = (part(x, ACCEL_BIAS), part(x, GYRO_BIAS));
        let new_r = add(add(r, mul(&self.r_rho, rho)), mul(&self.r_v, v));
        let new_r = add(add(new_r, mul(&self.r_ba, ba)), mul(&self.r_bg, bg));
        let new_rho = add(add(rho, mul(&self.rho_rho, rho)), mul(&self.rho_bg, bg));
        let new_v = add(add(v, mul(&self.v_rho, rho)), mul(&self.v_v, v));
        let new_v = add(add(new_v, mul(&self.v_ba, ba)), mul(&self.v_bg, bg));
        join(new_r, new_rho, new_v)
    }
}

/// P ← Φ P Φᵀ for a symmetric P, result exactly symmetric.
#[inline(always)]
fn sandwich<T: Lane>(p: &mut [[T; DIM]; DIM], phi: &impl Transition<T>) {
    let zero = T::splat(0.0);
    // Columns of the dynamic rows of Φ P.
    let mut columns = [[zero; DYNAMIC]; DIM];
    for j in 0..DIM {
        columns[j] = phi.apply(&p[j]);
    }
    for i in 0..DYNAMIC {
        let mut row = [zero; DIM];
        for j in 0..DIM {
            row[j] = columns[j][i];
        }
        let image = phi.apply(&row);
        for k in 0..=i {
            p[i][k] = image[k];
            p[k][i] = image[k];
        }
        for j in DYNAMIC..DIM {
            p[i][j] = row[j];
            p[j][i] = row[j];
        }
    }
}

/// P ← P + G Q Gᵀ T/2 (Eqs. 5 and 10; isotropic noise, so R Q Rᵀ = Q).
#[inline(always)]
fn add_half_noise<T: Lane>(p: &mut [[T; DIM]; DIM], mean: &Coefficients<T>, noise: &ProcessNoise, duration_s: f64) {
    let half = 0.5 * duration_s;
    let gyro = T::splat(noise.gyro * half);
    let lever = skew(mean.velocity_p);
    for i in 0..3 {
        p[ATTITUDE + i][ATTITUDE + i] += gyro;
        p[VELOCITY + i][VELOCITY + i] += T::splat(noise.accel * half);
        p[ACCEL_BIAS + i][ACCEL_BIAS + i] += T::splat(noise.accel_bias * half);
        p[GYRO_BIAS + i][GYRO_BIAS + i] += T::splat(noise.gyro_bias * half);
        for j in 0..3 {
            // [v×][v×]ᵀ and [v×]Rᵀ: row i of the lever with row j of the other factor.
            let own = lever[i][0] * lever[j][0] + lever[i][1] * lever[j][1] + lever[i][2] * lever[j][2];
            p[VELOCITY + i][VELOCITY + j] += own * gyro;
            let turn = mean.rotation[j];
            let across = (lever[i][0] * turn[0] + lever[i][1] * turn[1] + lever[i][2] * turn[2]) * gyro;
            p[VELOCITY + i][ATTITUDE + j] += across;
            p[ATTITUDE + j][VELOCITY + i] += across;
        }
    }
    for i in DVL_BIAS..DVL_SCALE {
        p[i][i] += T::splat(noise.dvl_bias * half);
    }
    p[DVL_SCALE][DVL_SCALE] += T::splat(noise.dvl_scale * half);
}

/// The dense noise density G Q Gᵀ at the mean coefficients, for inspection and tests.
#[must_use]
pub fn dense_noise(coefficients: &Coefficients<f64>, noise: &ProcessNoise) -> [[f64; DIM]; DIM] {
    let mut q = [[0.0; DIM]; DIM];
    add_half_noise(&mut q, coefficients, noise, 2.0);
    q
}

#[cfg(test)]
#[path = "error_model_tests.rs"]
mod tests;
