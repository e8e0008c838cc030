//! The transition over many steps to second order, exact in how the platform turns meanwhile.
//!
//! In the tangent frame the velocity error δv_t = R δv − [R v×]ρ makes F simple, and nearly constant however the platform
//! turns: δṙ = δv_t, ρ̇ = −[ω×]ρ − R δb_g, δv̇_t = −[f_t×]ρ − R δb_a − 2[ω×]δv_t. Its integrals are what the strapdown step
//! knows already: ∫f_t from the gain in velocity, ∫∫f_t from the way made good, and ∫R. Φ is of second order there, and is then
//! carried over into the platform frame with R and v at both ends.
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 5.1 times as long at `methods_10hz 8`.

use super::ProcessNoise;
use super::covariance::{CovarianceInterval, Parts, Transition, lift3};
use super::noise::HalfNoise;
use crate::mechanisation::{EarthTerms, Inertial, Kinematics};
use crate::simd::{
    Lane, Lift, M3, V3, add, add_mul, add_scaled, cross, mat_axpy, mat_mul, mat_mul_add, mat_scale, negative, scale,
    skew, splat3, sub, transposed, zero3,
};

/// Motion at the start of an interval.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Start<T> {
    pub(super) position_t: V3<T>,
    pub(super) velocity_t: V3<T>,
    pub(super) velocity_p: V3<T>,
    pub(super) rotation: M3<T>,
}

impl<T: Lane> Start<T> {
    #[inline(always)]
    fn at(kinematics: &Kinematics<T>) -> Self {
        Self {
            position_t: kinematics.position_t_m,
            velocity_t: kinematics.velocity_t_mps,
            velocity_p: kinematics.velocity_p_mps,
            rotation: kinematics.rotation_t_p,
        }
    }
}

/// Its start, and ∫R dt since.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct SecondOrderInterval<T> {
    pub(super) start: Start<T>,
    pub(super) rotation_integral: M3<T>,
    pub(super) duration_s: f64,
}

impl<T: Lane> CovarianceInterval<T> for SecondOrderInterval<T> {
    type Phi = SecondOrder<T>;

    #[inline(always)]
    fn begin(kinematics: &Kinematics<T>, _earth: &EarthTerms<T>) -> Self {
        Self {
            start: Start::at(kinematics),
            rotation_integral: zero3(kinematics.velocity_p_mps[0]),
            duration_s: 0.0,
        }
    }

    #[inline(always)]
    fn extend(
        &mut self,
        before: &Kinematics<T>,
        after: &Kinematics<T>,
        _start: &Inertial<T>,
        _end: &Inertial<T>,
        dt_s: f64,
        _earth: &EarthTerms<T>,
    ) {
        let half = after.velocity_p_mps[0].splat(0.5 * dt_s);
        let both = sum(&before.rotation_t_p, &after.rotation_t_p);
        self.rotation_integral = mat_axpy(&self.rotation_integral, half, &both);
        self.duration_s += dt_s;
    }

    #[inline(always)]
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    #[inline(always)]
    fn transition(&self, end: &Kinematics<T>, earth: &EarthTerms<T>) -> SecondOrder<T> {
        let (start, end) = (&self.start, &Start::at(end));
        let like = end.velocity_p[0];
        let (half, two) = (like.splat(0.5), like.splat(2.0));
        let duration = like.splat(self.duration_s);

        // ∫f_t = Δv − g T + 2 ω × Δr, and ∫∫f_t + v₀ T = Δr − g T²/2 + ω T × Δr.
        let turn_t = splat3(like, scale(earth.rate_t, self.duration_s));
        let way = sub(end.position_t, start.position_t);
        let gained = sub(end.velocity_t, start.velocity_t);
        let mut push = add_scaled(gained, cross(splat3(like, earth.rate_t), way), two);
        let duration_of_fall = like.splat(-self.duration_s);
        push[2] += earth.gravity_t[2] * duration_of_fall;
        let mut reach = add(way, cross(turn_t, way));
        let fall = like.splat(-0.5) * earth.gravity_t[2];
        reach[2] += fall * duration * duration;
        if earth.gradient_t.is_some() {
            for k in 0..2 {
                push[k] += earth.gravity_t[k] * duration_of_fall;
                reach[k] += like.splat(-0.5) * earth.gravity_t[k] * duration * duration;
            }
        }

        // Blocks in the tangent frame, less the identity: first order, and half the product of first orders.
        let (w, u, s) = (skew(turn_t), skew(push), self.rotation_integral);
        let minus_w = negative(&w);
        let w_squared = mat_mul(&w, &w);
        let rho_rho = mat_axpy(&minus_w, half, &w_squared);
        let rho_bg = mat_mul_add(&mat_scale(half, &w), &s, &negative(&s));
        let v_rho = mat_mul_add(&w, &u, &mat_mul_add(&mat_scale(half, &u), &w, &negative(&u)));
        let v_v = mat_scale(two, &sum(&minus_w, &w_squared));
        let v_ba = mat_mul_add(&w, &s, &negative(&s));
        let v_bg = mat_mul(&mat_scale(half, &u), &s);

        // Into the platform frame: δv_t = R₀ δv − [v₀×]ρ before, δv = R₁ᵀ(δv_t + [v₁×]ρ) after.
        let (before, after) = (skew(start.velocity_t), skew(end.velocity_t));
        let back = transposed(&end.rotation);
        let v_rho = mat_mul_add(&negative(&v_v), &before, &sum(&v_rho, &skew(gained)));
        let v_rho = mat_mul_add(&after, &rho_rho, &v_rho);
        let w_t = mat_scale(duration, &w);
        let mut rotated = mat_mul(&back, &start.rotation);
        for i in 0..3 {
            rotated[i][i] += like.splat(-1.0);
        }
        SecondOrder {
            r_rho: mat_mul_add(&w_t, &before, &negative(&skew(reach))),
            r_v: mat_mul_add(&negative(&w_t), &start.rotation, &mat_scale(duration, &start.rotation)),
            r_ba: mat_scale(like.splat(-0.5 * self.duration_s), &s),
            rho_rho,
            rho_bg,
            v_rho: mat_mul(&back, &v_rho),
            v_v: mat_mul_add(&back, &mat_mul(&v_v, &start.rotation), &rotated),
            v_ba: mat_mul(&back, &v_ba),
            v_bg: mat_mul(&back, &mat_mul_add(&after, &rho_bg, &v_bg)),
        }
    }

    #[inline(always)]
    fn first_noise(&self, noise: &ProcessNoise) -> HalfNoise<T> {
        noise_of(&self.start.rotation, self.start.velocity_p, noise, self.duration_s)
    }

    #[inline(always)]
    fn second_noise(&self, end: &Kinematics<T>, noise: &ProcessNoise) -> HalfNoise<T> {
        noise_of(&end.rotation_t_p, end.velocity_p_mps, noise, self.duration_s)
    }

    #[inline(always)]
    fn empty(&mut self, end: &Kinematics<T>) {
        self.start = Start::at(end);
        self.rotation_integral = zero3(end.velocity_p_mps[0]);
        self.duration_s = 0.0;
    }
}

#[inline(always)]
fn sum<T: Lane>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    [add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])]
}

#[inline(always)]
fn noise_of<T: Lane>(rotation: &M3<T>, velocity_p: V3<T>, noise: &ProcessNoise, duration_s: f64) -> HalfNoise<T> {
    let like = velocity_p[0];
    HalfNoise::new(
        rotation,
        velocity_p,
        noise,
        like.splat(0.5 * duration_s),
        like.splat(1.0),
    )
}

/// Φ with all its blocks filled; those of Φ − I are kept.
#[derive(Debug, Clone, Copy)]
pub struct SecondOrder<T> {
    r_rho: M3<T>,
    r_v: M3<T>,
    r_ba: M3<T>,
    rho_rho: M3<T>,
    rho_bg: M3<T>,
    v_rho: M3<T>,
    v_v: M3<T>,
    v_ba: M3<T>,
    v_bg: M3<T>,
}

impl<T: Lane> Transition<T> for SecondOrder<T> {
    #[inline(always)]
    fn position<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let r = add_mul(add_mul(x.r, &lift3(x, &self.r_rho), x.rho), &lift3(x, &self.r_v), x.v);
        add_mul(r, &lift3(x, &self.r_ba), x.ba)
    }
    #[inline(always)]
    fn attitude<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let rho = add_mul(x.rho, &lift3(x, &self.rho_rho), x.rho);
        add_mul(rho, &lift3(x, &self.rho_bg), x.bg)
    }
    #[inline(always)]
    fn velocity<W: Lift<T>>(&self, x: &Parts<W>) -> V3<W> {
        let v = add_mul(add_mul(x.v, &lift3(x, &self.v_rho), x.rho), &lift3(x, &self.v_v), x.v);
        add_mul(add_mul(v, &lift3(x, &self.v_ba), x.ba), &lift3(x, &self.v_bg), x.bg)
    }
}
