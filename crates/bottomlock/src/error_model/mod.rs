//! The error model (Eqs. 2–11) and the propagation of the covariance.
//!
//! F has nine dynamic rows made of skew, identity and zero blocks; the covariance is propagated through them alone
//! (a dense 20×20 product costs eleven times the arithmetic). Everything is written over [`Lane`].
//!
//! Sources: Tal et al. 2017, Eqs. (3)–(6), (9)–(11); F₃₂ and F₃₃ after Miller, Farrell et al. 2010, as erratum E8 states.
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 1.8 times as long at `methods 8`.

mod covariance;
mod first_order;
mod interval;
mod noise;
mod second_order;
mod side_by_side;

pub(crate) use covariance::complete_biases;
pub use covariance::{CovarianceInterval, Matrix, Parts, Transition};
pub use first_order::{FirstOrder, FirstOrderInterval};
pub use interval::Interval;
pub use noise::HalfNoise;
pub use second_order::{SecondOrder, SecondOrderInterval};
pub(crate) use side_by_side::SideBySide;

use crate::error::NavError;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM, GYRO_BIAS, POSITION, VELOCITY};
use crate::mechanisation::{EarthTerms, ImuSample, Inertial, Kinematics};
use crate::simd::{
    Lane, M3, V3, add, add_scaled, cross, mat_axpy, mat_mul, scale, skew, splat3, sub_cross, tmul, transposed, zero3,
};

use crate::state::NavState;

/// Power spectral densities of the process noise (Eqs. 6 and 11): squares of the per-root-second figures.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
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
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct Coefficients<T> {
    /// R v: the block F_rρ is −[R v ×].
    velocity_t: V3<T>,
    /// R: the block F_rv; F_ρ,bg is −R.
    rotation: M3<T>,
    /// F₃₂ = Rᵀ[g×] + [v×]Rᵀ[ω_ie×]; g of the place.
    velocity_by_misalignment: M3<T>,
    /// ω_ip + Rᵀω_ie: the block F₃₃ is minus its cross matrix.
    coriolis_rate_p: V3<T>,
    /// v: the block F_v,bg is −[v×].
    velocity_p: V3<T>,
}

impl<T: Lane> Coefficients<T> {
    /// The coefficients at a state and rate.
    #[inline(always)]
    pub fn at(kinematics: &Kinematics<T>, inertial: &Inertial<T>, earth: &EarthTerms<T>) -> Self {
        Self::without_rate(kinematics, earth).with_rate(inertial)
    }

    /// The same of coefficients without a rate.
    #[inline(always)]
    fn with_rate(self, inertial: &Inertial<T>) -> Self {
        Self {
            coriolis_rate_p: add(inertial.rate_p_radps, self.coriolis_rate_p),
            ..self
        }
    }

    /// The coefficients at a state, as if ω_ip were zero.
    #[inline(always)]
    fn without_rate(kinematics: &Kinematics<T>, earth: &EarthTerms<T>) -> Self {
        let rotation = kinematics.rotation_t_p;
        let velocity_p = kinematics.velocity_p_mps;
        let like = velocity_p[0];
        let (w, gravity) = (splat3(like, earth.rate_t), earth.gravity_t[2]);
        let [x, y, z] = rotation;
        // Column j of Rᵀ[ω×] is Rᵀ(ω × e_j), and of [v×]Rᵀ[ω×] its cross product; of Rᵀ[g×] with g down only two are not zero.
        let mut columns = [
            sub_cross(scale(y, gravity), add_scaled(scale(y, w[2]), z, -w[1]), velocity_p),
            sub_cross(scale(x, -gravity), add_scaled(scale(z, w[0]), x, -w[2]), velocity_p),
            cross(velocity_p, add_scaled(scale(x, w[1]), y, -w[0])),
        ];
        if earth.gradient_t.is_some() {
            let [north, east, _] = earth.gravity_t;
            columns[0] = add_scaled(columns[0], z, -east);
            columns[1] = add_scaled(columns[1], z, north);
            columns[2] = add_scaled(add_scaled(columns[2], x, east), y, -north);
        }
        Self {
            velocity_t: kinematics.velocity_t_mps,
            rotation,
            velocity_by_misalignment: transposed(&columns),
            coriolis_rate_p: tmul(&rotation, w),
            velocity_p,
        }
    }

    /// The sum of two, times `factor`.
    #[inline(always)]
    fn scaled_sum(a: &Self, b: &Self, factor: T) -> Self {
        let (r, q) = (&a.rotation, &b.rotation);
        let (f, g) = (&a.velocity_by_misalignment, &b.velocity_by_misalignment);
        Self {
            velocity_t: scaled_sum(a.velocity_t, b.velocity_t, factor),
            rotation: [
                scaled_sum(r[0], q[0], factor),
                scaled_sum(r[1], q[1], factor),
                scaled_sum(r[2], q[2], factor),
            ],
            velocity_by_misalignment: [
                scaled_sum(f[0], g[0], factor),
                scaled_sum(f[1], g[1], factor),
                scaled_sum(f[2], g[2], factor),
            ],
            coriolis_rate_p: scaled_sum(a.coriolis_rate_p, b.coriolis_rate_p, factor),
            velocity_p: scaled_sum(a.velocity_p, b.velocity_p, factor),
        }
    }

    /// Adds the sum of two others, times `factor`.
    #[inline(always)]
    fn add_sum(&mut self, a: &Self, b: &Self, factor: T) {
        add_scaled_sum(&mut self.velocity_t, a.velocity_t, b.velocity_t, factor);
        add_scaled_sum(&mut self.coriolis_rate_p, a.coriolis_rate_p, b.coriolis_rate_p, factor);
        add_scaled_sum(&mut self.velocity_p, a.velocity_p, b.velocity_p, factor);
        for i in 0..3 {
            add_scaled_sum(&mut self.rotation[i], a.rotation[i], b.rotation[i], factor);
            let (f, g) = (a.velocity_by_misalignment[i], b.velocity_by_misalignment[i]);
            add_scaled_sum(&mut self.velocity_by_misalignment[i], f, g, factor);
        }
    }

    /// The dense F of Eq. 9, for inspection and tests; `[row][column]`.
    pub fn dense(&self, earth: &EarthTerms<T>) -> [[T; DIM]; DIM] {
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
        put(VELOCITY, ATTITUDE, self.velocity_by_misalignment);
        if let Some(gradient) = &earth.gradient_t {
            put(VELOCITY, POSITION, mat_mul(&transposed(&self.rotation), gradient));
        }
        put(VELOCITY, VELOCITY, negative(skew(self.coriolis_rate_p)));
        put(
            VELOCITY,
            ACCEL_BIAS,
            negative([[one, zero, zero], [zero, one, zero], [zero, zero, one]]),
        );
        put(VELOCITY, GYRO_BIAS, negative(skew(self.velocity_p)));
        f
    }
}

/// (a + b) s.
#[inline(always)]
fn scaled_sum<T: Lane>(a: V3<T>, b: V3<T>, s: T) -> V3<T> {
    scale(add(a, b), s)
}

/// c ← c + (a + b) s.
#[inline(always)]
fn add_scaled_sum<T: Lane>(c: &mut V3<T>, a: V3<T>, b: V3<T>, s: T) {
    *c = add_scaled(*c, add(a, b), s);
}

/// The dense F of Eq. 9 and the noise density G Q Gᵀ at a state and an inertial reading, for inspection and tests.
///
/// # Errors
/// As [`NavState::validate`] and [`ImuSample::validate`].
pub fn dense_at(
    earth: &EarthTerms<f64>,
    noise: &ProcessNoise,
    state: &NavState,
    sample: &ImuSample,
) -> Result<[[[f64; DIM]; DIM]; 2], NavError> {
    state.validate()?;
    sample.validate()?;
    let inertial = Inertial {
        rate_p_radps: sample.rate_p_radps.to_array(),
        force_p_mps2: sample.force_p_mps2.to_array(),
    };
    let coefficients = Coefficients::at(&state.kinematics(), &inertial, earth);
    Ok([coefficients.dense(earth), dense_noise(&coefficients, noise)])
}

/// The dense noise density G Q Gᵀ at the mean coefficients, for inspection and tests.
#[must_use]
pub fn dense_noise(coefficients: &Coefficients<f64>, noise: &ProcessNoise) -> [[f64; DIM]; DIM] {
    let mut density = [[0.0; DIM]; DIM];
    HalfNoise::new(&coefficients.rotation, coefficients.velocity_p, noise, 1.0, 1.0).add_to(&mut density);
    density
}

#[cfg(test)]
mod place_tests;
#[cfg(test)]
mod tests;
