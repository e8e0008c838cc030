//! The Earth as the mechanisation and the sensors need it at a place.

use nalgebra::{Matrix3, Vector3};

use super::{EarthModel, Ellipsoid, Environment};
use crate::error::{NavError, require_finite};
use crate::frames::{Platform, Rot, Tangent, Vec3};
use crate::simd::{Lane, M3, V3, splat3};

/// Earth rate, gravity and shape of an environment, as a filter keeps them.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Earth {
    pub(crate) rate_t: [f64; 3],
    /// At the origin.
    pub(crate) gravity_mps2: f64,
    /// `None` for a tangent plane.
    ellipsoid: Option<Ellipsoid>,
}

/// Earth rate, and gravity with its gradient at a place: of one filter or of several side by side.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct EarthTerms<T> {
    pub(crate) rate_t: [f64; 3],
    /// On a tangent plane its first two components are zero and are left out of every sum.
    pub(crate) gravity_t: [T; 3],
    /// By position, 1/s²; `None` where gravity is the same everywhere.
    pub(crate) gradient_t: Option<[[T; 3]; 3]>,
}

/// Numbers of gravity and its gradient.
pub(crate) const GRAVITY: usize = 12;

/// North, east and down at a place, and its depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalLevel {
    /// Columns: north, east and down in the tangent frame.
    pub rotation_t_n: Matrix3<f64>,
    /// Depth below the level of the origin, m.
    pub depth_m: f64,
    /// Rotation of these axes by a change of position, tangent frame, rad/m; zero on a plane.
    pub turn_t: Matrix3<f64>,
}

impl From<&Environment> for Earth {
    fn from(environment: &Environment) -> Self {
        Self {
            rate_t: environment.earth_rate_t_radps().to_array(),
            gravity_mps2: environment.gravity_mps2,
            ellipsoid: (environment.earth == EarthModel::Ellipsoid).then(|| Ellipsoid::at_origin(environment)),
        }
    }
}

impl From<&Environment> for EarthTerms<f64> {
    /// At the origin.
    fn from(environment: &Environment) -> Self {
        Earth::from(environment).terms([0.0; 3])
    }
}

impl Earth {
    /// Gravity and its gradient at a position, m, in the tangent frame.
    #[inline(always)]
    pub fn terms<T: Lane>(&self, position_t_m: V3<T>) -> EarthTerms<T> {
        if let Some(ellipsoid) = self.pulling() {
            let (gravity_t, gradient_t) = ellipsoid.gravity(&ellipsoid.place(position_t_m));
            return EarthTerms {
                rate_t: self.rate_t,
                gravity_t,
                gradient_t: Some(gradient_t),
            };
        }
        EarthTerms {
            rate_t: self.rate_t,
            gravity_t: splat3(position_t_m[0], [0.0, 0.0, self.gravity_mps2]),
            gradient_t: None,
        }
    }

    /// The ellipsoid where gravity depends on the position.
    #[inline(always)]
    pub(crate) fn pulling(&self) -> Option<&Ellipsoid> {
        self.ellipsoid.as_ref().filter(|_| self.gravity_mps2 > 0.0)
    }

    /// Gravity at a position, tangent frame, m/s².
    #[must_use]
    pub fn gravity_t_mps2(&self, position_t_m: &Vec3<Tangent>) -> Vector3<f64> {
        self.terms(position_t_m.to_array()).gravity_t.into()
    }

    /// Curvature of the sea, 1/m: that of a sphere of the semi-major axis; 0 on a tangent plane.
    #[must_use]
    pub fn curvature_pm(&self) -> f64 {
        self.ellipsoid.as_ref().map_or(0.0, |_| 1.0 / super::SEMI_MAJOR_AXIS_M)
    }

    /// North, east, down and depth at a position.
    #[must_use]
    pub fn level(&self, position_t_m: &Vec3<Tangent>) -> LocalLevel {
        let Some(ellipsoid) = &self.ellipsoid else {
            return LocalLevel::of_plane(position_t_m);
        };
        let place = ellipsoid.place(position_t_m.to_array());
        let (north, east) = place.north_east_t();
        let [north, east, down] = [north, east, place.down_t].map(Vector3::from);
        // Northwards the level turns about −E with the latitude; eastwards about the Earth's axis with the longitude.
        let tangent = place.sin_latitude / place.cos_latitude;
        LocalLevel {
            rotation_t_n: Matrix3::from_columns(&[north, east, down]),
            depth_m: place.depth_m,
            turn_t: (north - down * tangent) * east.transpose() * place.transverse_curvature_pm
                - east * north.transpose() * place.meridian_curvature_pm,
        }
    }

    pub(crate) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        require_finite("earth rate", time_ns, &self.rate_t)?;
        require_finite("gravity", time_ns, &[self.gravity_mps2])?;
        let is_plausible = self.ellipsoid.as_ref().is_none_or(Ellipsoid::is_plausible);
        require_finite("ellipsoid", time_ns, &[if is_plausible { 0.0 } else { f64::NAN }])
    }
}

impl LocalLevel {
    /// Of a tangent plane.
    #[must_use]
    pub fn of_plane(position_t_m: &Vec3<Tangent>) -> Self {
        Self {
            rotation_t_n: Matrix3::identity(),
            depth_m: position_t_m.0.z,
            turn_t: Matrix3::zeros(),
        }
    }

    /// Euler angles `[roll, pitch, yaw]`, rad, of an attitude against these axes: yaw from north, level at the place.
    #[must_use]
    pub fn to_euler_rad(&self, attitude_t_p: Rot<Tangent, Platform>) -> [f64; 3] {
        (self.rotation_n_t() * attitude_t_p).to_euler_rad()
    }

    /// From the tangent frame to these axes; the same frame where the Earth is a plane.
    #[must_use]
    pub fn rotation_n_t(&self) -> Rot<Tangent, Tangent> {
        if self.turn_t == Matrix3::zeros() {
            return Rot::identity();
        }
        Rot::from_matrix(&self.rotation_t_n.transpose())
    }

    /// Covariance in the tangent frame of a vector with independent components along north, east and down.
    #[must_use]
    pub fn covariance_t(&self, sd: &[f64; 3]) -> Matrix3<f64> {
        let diagonal = Matrix3::from_diagonal(&Vector3::from(sd.map(|sd| sd * sd)));
        self.rotation_t_n * diagonal * self.rotation_t_n.transpose()
    }

    /// Down, tangent frame.
    #[must_use]
    pub fn down_t(&self) -> Vector3<f64> {
        self.rotation_t_n.column(2).into_owned()
    }
}

impl<T: Lane> EarthTerms<T> {
    /// Gravity and gradient in a row; zeros where there is no gradient.
    #[inline(always)]
    pub(crate) fn to_array(self) -> [T; GRAVITY] {
        let [x, y, z] = self.gravity_t;
        let zero = x.splat(0.0);
        let [a, b, c]: M3<T> = self.gradient_t.unwrap_or([[zero; 3]; 3]);
        [x, y, z, a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]]
    }

    /// From what [`EarthTerms::to_array`] gives, and terms of another lane type that have a gradient or none.
    #[inline(always)]
    pub(crate) fn of_array<U>(like: &EarthTerms<U>, [x, y, z, g @ ..]: [T; GRAVITY]) -> Self {
        let [a, b, c, d, e, f, h, i, j] = g;
        Self {
            rate_t: like.rate_t,
            gravity_t: [x, y, z],
            gradient_t: like.gradient_t.is_some().then_some([[a, b, c], [d, e, f], [h, i, j]]),
        }
    }
}

/// The same terms in every lane of a vector like `like`.
#[cfg(test)]
pub(crate) fn in_lanes<T: Lane>(earth: &EarthTerms<f64>, like: T) -> EarthTerms<T> {
    EarthTerms::of_array(earth, earth.to_array().map(|x| like.splat(x)))
}
