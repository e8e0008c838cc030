//! A place on the ellipsoid, as seen from the tangent frame: depth, level directions, and gravity with its gradient.
//!
//! # Equations
//! With the origin at geodetic latitude φ₀ on the ellipsoid, a position p has the Earth-fixed coordinates (longitude from the
//! origin's meridian)
//!
//! ```text
//! X = N₀ cos φ₀ − p_n sin φ₀ − p_d cos φ₀,   Y = p_e,   Z = N₀ (1 − e²) sin φ₀ + p_n cos φ₀ − p_d sin φ₀.
//! ```
//!
//! - Latitude φ by one step of Bowring's formula (Bowring 1976; Groves 2013, Eqs. 2.119–2.121): off by less than 1e-11 rad down
//!   to the deepest sea and up to 10 km.
//! - Height by the projection on the normal, h = ρ cos φ + Z sin φ − a w with w = √(1 − e² sin² φ), which an error of φ changes
//!   to second order only; depth d = −h.
//! - Down D = −(X/(N + h), Y/(N + h), sin φ) with N = a/w.
//! - Gravity g = |g| D, with |g| = γ(φ) + Γ d + (g₀ − γ(φ₀)): Somigliana's formula, the gradient in sea water, and what gravity at
//!   the origin is stated to be more than normal.
//! - ∂D/∂p = −N Nᵀ/(M + h) − E Eᵀ/(N + h) with M = a (1 − e²)/w³, so that
//!
//! ```text
//! ∂g/∂p = |g| ∂D/∂p + D (γ'(φ)/(M + h) Nᵀ + Γ Dᵀ).
//! ```
//!
//! With n = cos φ N = z_axis + sin φ D all of this is regular at the poles; north, and with it heading, is not.
//!
//! Everything is exact in the position, so no distance from the origin loses accuracy; no origin has to be moved
//! (docs/decisions.md#one-tangent-frame-and-the-exact-ellipsoid-below-it).

use super::{
    ECCENTRICITY_SQUARED, Environment, GRAVITY_DEPTH_GRADIENT_PS2, GRAVITY_EQUATOR_MPS2, GRAVITY_RISE,
    SEMI_MAJOR_AXIS_M, normal_gravity_mps2,
};
use crate::simd::{Lane, M3, V3, add_scaled, dot, plus, scale, splat3};

/// The tangent frame's origin on the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Ellipsoid {
    sin_latitude: f64,
    cos_latitude: f64,
    /// Distance of the origin from the axis of the Earth, m.
    from_axis_m: f64,
    /// Height of the origin above the plane of the equator, m.
    from_equator_m: f64,
    /// Gravity at the origin less normal gravity, m/s².
    anomaly_mps2: f64,
}

/// A place on the ellipsoid, resolved in the tangent frame, of one filter or of several side by side.
#[derive(Debug, Clone, Copy)]
pub struct Place<T> {
    /// Unit vector down, along the normal of the ellipsoid.
    pub down_t: V3<T>,
    /// North times cos φ; regular at the poles.
    pub north_cos_t: V3<T>,
    /// Depth below the ellipsoid of the origin, m.
    pub depth_m: T,
    /// Sine of the geodetic latitude.
    pub sin_latitude: T,
    /// Its cosine.
    pub cos_latitude: T,
    /// 1/(M + h): change of latitude along north, rad/m.
    pub meridian_curvature_pm: T,
    /// 1/(N + h): change of level along east, rad/m.
    pub transverse_curvature_pm: T,
    /// w of the head.
    root: T,
}

impl Ellipsoid {
    /// The origin of an environment.
    #[must_use]
    pub fn at_origin(environment: &Environment) -> Self {
        let (sin, cos) = environment.latitude_rad.sin_cos();
        let anomaly_mps2 = environment.gravity_mps2 - normal_gravity_mps2(environment.latitude_rad, 0.0);
        Self::new(sin, cos, anomaly_mps2)
    }

    fn new(sin: f64, cos: f64, anomaly_mps2: f64) -> Self {
        let transverse_m = SEMI_MAJOR_AXIS_M / (1.0 - ECCENTRICITY_SQUARED * sin * sin).sqrt();
        Self {
            sin_latitude: sin,
            cos_latitude: cos,
            from_axis_m: transverse_m * cos,
            from_equator_m: transverse_m * (1.0 - ECCENTRICITY_SQUARED) * sin,
            anomaly_mps2,
        }
    }

    /// True where the numbers are those of some origin.
    pub(super) fn is_plausible(&self) -> bool {
        let (sin, cos) = (self.sin_latitude, self.cos_latitude);
        let same = Self::new(sin, cos, self.anomaly_mps2);
        (sin * sin + cos * cos - 1.0).abs() < 1e-9
            && same.from_axis_m == self.from_axis_m
            && same.from_equator_m == self.from_equator_m
            && self.anomaly_mps2.abs() < 1e3
    }

    /// The place of a position in the tangent frame, m.
    #[inline(always)]
    pub fn place<T: Lane>(&self, position_t_m: V3<T>) -> Place<T> {
        let [north, east, down] = position_t_m;
        let (like, one) = (north, north.splat(1.0));
        let (s0, c0) = (self.sin_latitude, self.cos_latitude);
        let x = plus(plus(like.splat(self.from_axis_m), -s0, north), -c0, down);
        let z = plus(plus(like.splat(self.from_equator_m), c0, north), -s0, down);
        let squared = x.mul_add(x, east * east);
        let rho = squared.sqrt();

        // tan β = a Z/(b ρ), then tan φ = (Z + e'² b sin³ β)/(ρ − e² a cos³ β), where e'² b = e² a/√(1 − e²).
        let axes = (1.0 - ECCENTRICITY_SQUARED).sqrt();
        let level = rho * like.splat(axes);
        let beta = z.mul_add(z, level * level).sqrt().recip();
        let (sin_beta, cos_beta) = (z * beta, level * beta);
        let bulge_m = ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M;
        let up = plus(z, bulge_m / axes, sin_beta * sin_beta * sin_beta);
        let out = plus(rho, -bulge_m, cos_beta * cos_beta * cos_beta);
        let length = up.mul_add(up, out * out).sqrt().recip();
        let (sin, cos) = (up * length, out * length);

        let root = plus(one, -ECCENTRICITY_SQUARED, sin * sin).sqrt();
        let axis = like.splat(SEMI_MAJOR_AXIS_M);
        let depth_m = axis * root - rho.mul_add(cos, z * sin);
        let transverse_m = axis * root.recip();
        let meridian_m = transverse_m * like.splat(1.0 - ECCENTRICITY_SQUARED) * (root * root).recip();
        let transverse_curvature_pm = (transverse_m - depth_m).recip();

        // Down, from Earth-fixed axes into those of the origin.
        let (dx, dy) = (x * transverse_curvature_pm, east * transverse_curvature_pm);
        let down_t = [
            plus(like.splat(s0) * dx, -c0, sin),
            -dy,
            plus(like.splat(c0) * dx, s0, sin),
        ];
        Place {
            down_t,
            north_cos_t: add_scaled(splat3(like, [c0, 0.0, -s0]), down_t, sin),
            depth_m,
            sin_latitude: sin,
            cos_latitude: cos,
            meridian_curvature_pm: (meridian_m - depth_m).recip(),
            transverse_curvature_pm,
            root,
        }
    }

    /// Gravity and its gradient by position at a place, tangent frame, m/s² and 1/s².
    #[inline(always)]
    pub fn gravity<T: Lane>(&self, place: &Place<T>) -> (V3<T>, M3<T>) {
        let (sin, down) = (place.sin_latitude, place.down_t);
        let like = sin;
        let weight = place.root.recip();
        let rise = plus(like.splat(1.0), GRAVITY_RISE, sin * sin);
        let normal = like.splat(GRAVITY_EQUATOR_MPS2) * rise * weight;
        let size = plus(
            normal + like.splat(self.anomaly_mps2),
            GRAVITY_DEPTH_GRADIENT_PS2,
            place.depth_m,
        );

        // γ'(φ) N/(M + h) = n 2 sin φ dγ/d(sin² φ)/(M + h).
        let slope = (like.splat(GRAVITY_RISE) + like.splat(0.5 * ECCENTRICITY_SQUARED) * rise * weight * weight)
            * (like.splat(2.0 * GRAVITY_EQUATOR_MPS2) * sin * weight * place.meridian_curvature_pm);
        // (1/(M + h) − 1/(N + h)) N Nᵀ = e² a w⁻³/((M + h)(N + h)) n nᵀ, since N − M = e² a cos² φ w⁻³.
        let flat = like.splat(ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M)
            * (weight * weight * weight * place.meridian_curvature_pm * place.transverse_curvature_pm);
        let north = place.north_cos_t;
        let across = size * place.transverse_curvature_pm;
        let along = -(size * flat);
        let by_depth = across + like.splat(GRAVITY_DEPTH_GRADIENT_PS2);
        let gradient = [0, 1, 2].map(
            #[inline(always)]
            |i| {
                let mut row = scale(down, by_depth * down[i]);
                row = add_scaled(row, north, along.mul_add(north[i], slope * down[i]));
                row[i] = row[i] - across;
                row
            },
        );
        (scale(down, size), gradient)
    }
}

impl<T: Lane> Place<T> {
    /// Unit vectors north and east; without meaning at the poles.
    #[inline(always)]
    pub fn north_east_t(&self) -> (V3<T>, V3<T>) {
        let north = scale(self.north_cos_t, dot(self.north_cos_t, self.north_cos_t).sqrt().recip());
        (north, crate::simd::cross(self.down_t, north))
    }
}
