//! Earth rate, normal gravity, and the environment of a mission.
//!
//! The tangent frame is fixed to the Earth at the origin, so that neither transport rate nor convergence of the meridians enters
//! the mechanisation. What changes with the place is gravity, in size and direction, and which way is down and north; both
//! follow exactly from the position, see `ellipsoid.rs`.

mod ellipsoid;
mod terms;

pub use self::ellipsoid::{Ellipsoid, Place};
#[cfg(test)]
pub(crate) use self::terms::in_lanes;
pub use self::terms::{Earth, EarthTerms, LocalLevel};

use crate::error::{NavError, require_finite, require_non_negative};
use crate::frames::{Tangent, Vec3};

/// Rotation rate of the Earth (WGS 84), rad/s.
pub const EARTH_RATE_RADPS: f64 = 7.292_115e-5;

/// Semi-major axis of the ellipsoid (WGS 84), m.
pub const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;
/// Square of its eccentricity.
pub const ECCENTRICITY_SQUARED: f64 = 0.006_694_379_990_14;
/// Normal gravity at the equator (WGS 84), m/s².
const GRAVITY_EQUATOR_MPS2: f64 = 9.780_325_335_9;
/// The constant k of Somigliana's formula (Groves 2013, Eq. 2.134).
const GRAVITY_RISE: f64 = 0.001_931_853;

/// Increase of gravity with depth in sea water, 1/s².
///
/// Free-air gradient 3.086e-6 less 4πGρ = 8.6e-7 for water of 1025 kg/m³ above the point (Poisson's equation; Turcotte
/// & Schubert, *Geodynamics*, sect. 5).
pub const GRAVITY_DEPTH_GRADIENT_PS2: f64 = 2.226e-6;

/// What gravity is less than anywhere on Earth, with room for an experiment.
const GREATEST_GRAVITY_MPS2: f64 = 20.0;

/// Normal gravity at a geodetic latitude, rad, and a depth below the ellipsoid, m, in m/s².
///
/// # Source
/// Somigliana's formula with the constants of WGS 84 (Groves 2013, Eq. 2.134), plus a linear depth term.
///
/// ```
/// let equator = bottomlock::earth::normal_gravity_mps2(0.0, 0.0);
/// assert!((equator - 9.780_325_335_9).abs() < 1e-12);
/// ```
#[must_use]
pub fn normal_gravity_mps2(latitude_rad: f64, depth_m: f64) -> f64 {
    let s2 = latitude_rad.sin().powi(2);
    GRAVITY_EQUATOR_MPS2 * (1.0 + GRAVITY_RISE * s2) / (1.0 - ECCENTRICITY_SQUARED * s2).sqrt()
        + GRAVITY_DEPTH_GRADIENT_PS2 * depth_m
}

/// What the Earth is to a filter and to simulated sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EarthModel {
    /// A plane: gravity and the directions of north, east and down are those of the origin everywhere, as in the 2017 paper.
    TangentPlane,
    /// The ellipsoid of WGS 84: gravity, depth, level and heading are those of the place.
    #[default]
    Ellipsoid,
}

/// Latitude, gravity and Earth rate of a mission.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// Geodetic latitude, rad.
    pub latitude_rad: f64,
    /// Gravity at the origin of the tangent frame, m/s²; on a tangent plane it is that everywhere. 0 for specific forces without
    /// gravity (docs/no_imu.md).
    pub gravity_mps2: f64,
    /// Earth rate, rad/s; zero for a non-rotating Earth.
    pub earth_rate_radps: f64,
    /// Plane or ellipsoid.
    pub earth: EarthModel,
}

impl Environment {
    /// The tangent plane of a rotating Earth with normal gravity at a latitude, rad, and a depth, m.
    #[must_use]
    pub fn normal(latitude_rad: f64, depth_m: f64) -> Self {
        Self {
            latitude_rad,
            gravity_mps2: normal_gravity_mps2(latitude_rad, depth_m),
            earth_rate_radps: EARTH_RATE_RADPS,
            earth: EarthModel::TangentPlane,
        }
    }

    /// The same with another model of the Earth.
    #[must_use]
    pub fn on(self, earth: EarthModel) -> Self {
        Self { earth, ..self }
    }

    /// Earth rate resolved in the tangent frame, rad/s.
    #[must_use]
    pub fn earth_rate_t_radps(&self) -> Vec3<Tangent> {
        Vec3::new(
            self.earth_rate_radps * self.latitude_rad.cos(),
            0.0,
            -self.earth_rate_radps * self.latitude_rad.sin(),
        )
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] or [`NavError::NotFinite`], which names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        require_finite("environment.earth_rate_radps", 0, &[self.earth_rate_radps])?;
        require_non_negative("environment.gravity_mps2", self.gravity_mps2)?;
        if self.gravity_mps2 > GREATEST_GRAVITY_MPS2 {
            return Err(NavError::OutOfRange {
                field: "environment.gravity_mps2",
                value: self.gravity_mps2,
                expected: "9.7 to 9.9 m/s^2, 20 at most",
            });
        }
        if !(self.latitude_rad.abs() <= std::f64::consts::FRAC_PI_2) {
            return Err(NavError::OutOfRange {
                field: "environment.latitude_rad",
                value: self.latitude_rad,
                expected: "-pi/2 to pi/2: the latitude is in radians",
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod environment_tests {
    use super::*;

    /// Gravity at the pole is the value tabulated by WGS 84.
    #[test]
    fn gravity_at_the_pole() {
        let pole = normal_gravity_mps2(std::f64::consts::FRAC_PI_2, 0.0);
        assert!((pole - 9.832_184_937_9).abs() < 2e-8, "{pole}");
    }

    /// At the north pole the Earth rotates about the upward vertical, which is −z.
    #[test]
    fn earth_rate_points_up_at_the_pole() {
        let rate = Environment::normal(std::f64::consts::FRAC_PI_2, 0.0).earth_rate_t_radps();
        assert!((rate.0.z + EARTH_RATE_RADPS).abs() < 1e-20);
        assert!(rate.0.x.abs() < 1e-20);
    }

    /// At 45° south half of the squared rate is northwards, as in the north, and half is down: Ω/√2 = 5.156304e-5 rad/s.
    #[test]
    fn earth_rate_points_down_in_the_south() {
        for (degrees, down) in [(-45.0, 5.156_304e-5), (45.0, -5.156_304e-5)] {
            let rate = Environment::normal(f64::to_radians(degrees), 0.0).earth_rate_t_radps();
            assert!(
                (rate - Vec3::new(5.156_304e-5, 0.0, down)).0.amax() < 1e-11,
                "{degrees}: {rate:?}"
            );
        }
    }
}
