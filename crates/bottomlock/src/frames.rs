//! Reference frames as types: a vector carries its frame, and a rotation carries both of its frames.
//!
//! `Rot<To, From> * Vec3<From> = Vec3<To>`: inner frames cancel, as in `R_p^t v^p`. Mixing frames does not compile:
//!
//! ```compile_fail
//! use bottomlock::frames::{Platform, Tangent, Vec3};
//! let v_p = Vec3::<Platform>::new(1.0, 0.0, 0.0);
//! let v_t = Vec3::<Tangent>::new(1.0, 0.0, 0.0);
//! let wrong = v_p + v_t;
//! ```
//!
//! A rotation does not accept a vector of the frame it maps to:
//!
//! ```compile_fail
//! use bottomlock::frames::{Platform, Rot, Tangent, Vec3};
//! let attitude_t_p = Rot::<Tangent, Platform>::identity();
//! let wrong = attitude_t_p * Vec3::<Tangent>::new(1.0, 0.0, 0.0);
//! ```
//!
//! Rotations chain only through a common frame:
//!
//! ```compile_fail
//! use bottomlock::frames::{Dvl, Platform, Rot, Tangent};
//! let wrong = Rot::<Platform, Dvl>::identity() * Rot::<Tangent, Platform>::identity();
//! ```

use std::marker::PhantomData;
use std::ops::{Add, Mul, Neg, Sub};

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::error::NavError;

/// Tangent frame: north, east, down, fixed to the Earth at the start of the mission.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tangent;
/// Platform frame: forward, right, down, fixed to the vehicle, at the IMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Platform;
/// DVL frame, fixed to the instrument; the mounting rotation maps it to the platform frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dvl;

/// A vector resolved in frame `F`.
#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(bound = "", from = "[f64; 3]", into = "[f64; 3]")]
pub struct Vec3<F>(pub Vector3<f64>, PhantomData<F>);

impl<F> Clone for Vec3<F> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<F> Copy for Vec3<F> {}

impl<F> Default for Vec3<F> {
    fn default() -> Self {
        Self::zeros()
    }
}

impl<F> Vec3<F> {
    /// A vector from its three components.
    #[must_use]
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Self(Vector3::new(x, y, z), PhantomData)
    }
    /// A vector from an array.
    #[must_use]
    pub fn from_array(xyz: [f64; 3]) -> Self {
        Self(Vector3::from(xyz), PhantomData)
    }
    /// The zero vector.
    #[must_use]
    pub fn zeros() -> Self {
        Self(Vector3::zeros(), PhantomData)
    }
    /// The three components.
    #[must_use]
    pub fn to_array(self) -> [f64; 3] {
        self.0.into()
    }
    /// Returns true if all components are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }
    /// The vector product `self` × `other`.
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self(self.0.cross(&other.0), PhantomData)
    }
}

impl<F> From<Vector3<f64>> for Vec3<F> {
    fn from(vector: Vector3<f64>) -> Self {
        Self(vector, PhantomData)
    }
}
impl<F> From<[f64; 3]> for Vec3<F> {
    fn from(xyz: [f64; 3]) -> Self {
        Self::from_array(xyz)
    }
}
impl<F> From<Vec3<F>> for [f64; 3] {
    fn from(vector: Vec3<F>) -> Self {
        vector.to_array()
    }
}
impl<F> Add for Vec3<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, PhantomData)
    }
}
impl<F> Sub for Vec3<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, PhantomData)
    }
}
impl<F> Neg for Vec3<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, PhantomData)
    }
}
impl<F> Mul<f64> for Vec3<F> {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self(self.0 * factor, PhantomData)
    }
}

/// The rotation that maps vectors resolved in `From` to vectors resolved in `To`.
#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(bound = "")]
pub struct Rot<To, From>(UnitQuaternion<f64>, PhantomData<(To, From)>);

impl<To, From> Clone for Rot<To, From> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<To, From> Copy for Rot<To, From> {}

impl<To, From> Rot<To, From> {
    /// The identity, for two frames that coincide.
    #[must_use]
    pub fn identity() -> Self {
        Self(UnitQuaternion::identity(), PhantomData)
    }
    /// A rotation from a quaternion, scalar first; the quaternion is normalised here.
    #[must_use]
    pub fn from_quaternion_wxyz([w, x, y, z]: [f64; 4]) -> Self {
        Self(
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
            PhantomData,
        )
    }
    /// The same of a quaternion that must have a norm of 1 within 1e-6.
    ///
    /// # Errors
    /// [`NavError::Setting`], which calls it `name`.
    pub fn from_unit_wxyz(name: &str, quaternion: [f64; 4]) -> Result<Self, NavError> {
        let norm = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
        if (norm - 1.0).abs() < 1e-6 {
            return Ok(Self::from_quaternion_wxyz(quaternion));
        }
        Err(NavError::setting(name, format!("has norm {norm}"), "1 (scalar first)"))
    }
    /// The quaternion, scalar first.
    #[must_use]
    pub fn to_quaternion_wxyz(self) -> [f64; 4] {
        [self.0.w, self.0.i, self.0.j, self.0.k]
    }
    /// A rotation from Euler angles, rad, z-y-x: by yaw about z, then by pitch about the new y, then by roll about the
    /// new x.
    #[must_use]
    pub fn from_euler_rad(roll: f64, pitch: f64, yaw: f64) -> Self {
        Self(UnitQuaternion::from_euler_angles(roll, pitch, yaw), PhantomData)
    }
    /// A rotation from its matrix.
    #[must_use]
    pub fn from_matrix(matrix: &Matrix3<f64>) -> Self {
        let rotation = Rotation3::from_matrix_unchecked(*matrix);
        Self(UnitQuaternion::from_rotation_matrix(&rotation), PhantomData)
    }
    /// Euler angles `[roll, pitch, yaw]`, rad, z-y-x.
    ///
    /// At pitch ±90° only a combination of roll and yaw is defined.
    #[must_use]
    pub fn to_euler_rad(self) -> [f64; 3] {
        let (roll, pitch, yaw) = self.0.euler_angles();
        [roll, pitch, yaw]
    }
    /// Exponential of a rotation vector, rad.
    #[must_use]
    pub fn exp(rotation_vector: Vector3<f64>) -> Self {
        Self(UnitQuaternion::from_scaled_axis(rotation_vector), PhantomData)
    }
    /// Rotation vector, rad, of length at most π.
    #[must_use]
    pub fn log(self) -> Vector3<f64> {
        self.0.scaled_axis()
    }
    /// The rotation matrix.
    #[must_use]
    pub fn matrix(self) -> Matrix3<f64> {
        *self.0.to_rotation_matrix().matrix()
    }
    /// The inverse rotation.
    #[must_use]
    pub fn inverse(self) -> Rot<From, To> {
        Rot(self.0.inverse(), PhantomData)
    }
}

impl<To, From> Mul<Vec3<From>> for Rot<To, From> {
    type Output = Vec3<To>;
    fn mul(self, vector: Vec3<From>) -> Vec3<To> {
        Vec3(self.0 * vector.0, PhantomData)
    }
}
impl<To, Via, From> Mul<Rot<Via, From>> for Rot<To, Via> {
    type Output = Rot<To, From>;
    fn mul(self, other: Rot<Via, From>) -> Rot<To, From> {
        Rot(self.0 * other.0, PhantomData)
    }
}

/// The cross-product matrix `[a×]`.
#[must_use]
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    a.cross_matrix()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    /// A yaw of 90° points the bow east, which fixes the sense of rotation of `attitude_t_p`.
    #[test]
    fn yaw_points_the_bow_east() {
        let attitude_t_p = Rot::<Tangent, Platform>::from_euler_rad(0.0, 0.0, FRAC_PI_2);
        let bow_t = attitude_t_p * Vec3::new(1.0, 0.0, 0.0);
        assert!((bow_t.0 - Vector3::new(0.0, 1.0, 0.0)).norm() < 1e-15);
    }

    /// Positive pitch raises the bow towards −z.
    #[test]
    fn pitch_raises_the_bow() {
        let attitude_t_p = Rot::<Tangent, Platform>::from_euler_rad(0.0, 0.3, 0.0);
        let bow_t = attitude_t_p * Vec3::new(1.0, 0.0, 0.0);
        assert!((bow_t.0 - Vector3::new(0.3_f64.cos(), 0.0, -(0.3_f64.sin()))).norm() < 1e-15);
    }

    /// Euler angles to quaternion and back are the same angles.
    #[test]
    fn euler_round_trip() {
        let angles = [0.1, -1.2, 2.5];
        let back = Rot::<Tangent, Platform>::from_euler_rad(angles[0], angles[1], angles[2]).to_euler_rad();
        for (a, b) in angles.iter().zip(back) {
            assert!((a - b).abs() < 1e-14);
        }
    }
}
