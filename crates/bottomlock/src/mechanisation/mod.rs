//! IMU samples and the strapdown step in the platform-velocity, tangent-frame form.
//!
//! ṙ = R v,  Ṙ = R [ω_tp×] with ω_tp = ω_ip − Rᵀω_ie,  v̇ = f + Rᵀg − (ω_ip + Rᵀω_ie) × v.
//!
//! The tangent frame does not turn with the place, so there is no transport rate; instead g is that of the place.
//!
//! The step is second order: rotation by the mean rate with the coning term of a linearly varying rate, specific force
//! and position by the trapezoidal rule in the tangent frame, whose local errors telescope over a run.
//!
//! All is inlined always: with `inline` alone `compare_filters` takes 1.8 times as long at `methods 8`, and 2.8 times at `methods_10hz 8`.

mod imu_limits;
mod segments;

pub(crate) use self::imu_limits::LONGEST_GAP_S;
pub use self::imu_limits::{IMU_FAULTS, ImuFault, ImuLimits, LongGap, Quantity};
pub use self::segments::{SegmentIntegrals, integrate_segment, integrate_segments};
pub use crate::earth::EarthTerms;

use crate::error::{NavError, require_finite};
use crate::frames::{Platform, Vec3};
use crate::simd::{Lane, M3, V3, add, add_mul, add_scaled, cross, dot, mul, scale, splat3, sub, sub_cross, tmul};
use crate::state::NavState;

/// One reading of the inertial measurement unit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ImuSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Angular rate ω_ip, platform frame, rad/s.
    pub rate_p_radps: Vec3<Platform>,
    /// Specific force, platform frame, m/s².
    pub force_p_mps2: Vec3<Platform>,
}

impl ImuSample {
    /// Readings of columns of one length: times, rates and forces.
    pub fn of_columns<'a>(
        time_ns: &'a [i64],
        rate_p_radps: &'a [[f64; 3]],
        force_p_mps2: &'a [[f64; 3]],
    ) -> impl ExactSizeIterator<Item = Self> + 'a {
        let readings = time_ns.iter().zip(rate_p_radps.iter().zip(force_p_mps2));
        readings.map(|(&time_ns, (&rate, &force))| Self {
            time_ns,
            rate_p_radps: Vec3::from_array(rate),
            force_p_mps2: Vec3::from_array(force),
        })
    }

    /// Checks that all numbers are finite.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub fn validate(&self) -> Result<(), NavError> {
        require_finite("imu omega_p_radps", self.time_ns, &self.rate_p_radps.to_array())?;
        require_finite("imu force_p_mps2", self.time_ns, &self.force_p_mps2.to_array())
    }

    /// The sample between two samples, linear in time.
    pub(crate) fn between(start: &Self, end: &Self, time_ns: i64) -> Self {
        let part = (time_ns - start.time_ns) as f64 / (end.time_ns - start.time_ns) as f64;
        Self {
            time_ns,
            rate_p_radps: start.rate_p_radps * (1.0 - part) + end.rate_p_radps * part,
            force_p_mps2: start.force_p_mps2 * (1.0 - part) + end.force_p_mps2 * part,
        }
    }
}

/// What a sample means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// The value at the sample's own time; a step uses both of its ends.
    #[default]
    Instantaneous,
    /// The mean since the sample before (increments divided by the interval); a step uses its later end.
    Averaged,
}

/// Position, attitude and velocity of one filter or of several side by side.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Kinematics<T> {
    /// Position, tangent frame, m.
    pub position_t_m: [T; 3],
    /// Attitude quaternion, scalar first, platform to tangent.
    pub attitude_t_p: [T; 4],
    /// The same as a rotation matrix, row by row; kept beside the quaternion since every step needs it.
    pub rotation_t_p: [[T; 3]; 3],
    /// Velocity, platform frame, m/s.
    pub velocity_p_mps: [T; 3],
    /// The same in the tangent frame, in which it is integrated.
    pub velocity_t_mps: [T; 3],
}

/// Numbers of [`Kinematics`].
pub(crate) const KINEMATICS: usize = 22;

/// Bias-corrected inertial readings at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Inertial<T> {
    /// ω_ip, platform frame, rad/s.
    pub rate_p_radps: [T; 3],
    /// Specific force, platform frame, m/s².
    pub force_p_mps2: [T; 3],
}

impl NavState {
    /// Position, attitude and velocity for the strapdown step.
    #[must_use]
    pub fn kinematics(&self) -> Kinematics<f64> {
        Kinematics::new(
            self.position_t_m.to_array(),
            self.attitude_t_p.to_quaternion_wxyz(),
            self.velocity_p_mps.to_array(),
        )
    }
}

impl<T: Copy> Kinematics<T> {
    /// All numbers in a row.
    #[inline(always)]
    pub(crate) fn to_array(self) -> [T; KINEMATICS] {
        let (r, q, m) = (self.position_t_m, self.attitude_t_p, self.rotation_t_p);
        let (v, u) = (self.velocity_p_mps, self.velocity_t_mps);
        [
            r[0], r[1], r[2], q[0], q[1], q[2], q[3], m[0][0], m[0][1], m[0][2], m[1][0], m[1][1], m[1][2], m[2][0],
            m[2][1], m[2][2], v[0], v[1], v[2], u[0], u[1], u[2],
        ]
    }

    /// The inverse of [`Kinematics::to_array`].
    #[inline(always)]
    pub(crate) fn from_array(x: [T; KINEMATICS]) -> Self {
        Self {
            position_t_m: [x[0], x[1], x[2]],
            attitude_t_p: [x[3], x[4], x[5], x[6]],
            rotation_t_p: [[x[7], x[8], x[9]], [x[10], x[11], x[12]], [x[13], x[14], x[15]]],
            velocity_p_mps: [x[16], x[17], x[18]],
            velocity_t_mps: [x[19], x[20], x[21]],
        }
    }
}

impl<T: Lane> Kinematics<T> {
    /// From position, attitude and velocity; the quaternion is normalised.
    pub fn new(position_t_m: [T; 3], attitude_t_p: [T; 4], velocity_p_mps: [T; 3]) -> Self {
        let attitude_t_p = normalise(attitude_t_p);
        let rotation_t_p = rotation_matrix(attitude_t_p);
        Self {
            position_t_m,
            attitude_t_p,
            rotation_t_p,
            velocity_p_mps,
            velocity_t_mps: mul(&rotation_t_p, velocity_p_mps),
        }
    }

    /// One strapdown step of `dt_s` seconds from `start` to `end`.
    #[inline(always)]
    pub fn step(&mut self, start: &Inertial<T>, end: &Inertial<T>, dt_s: f64, earth: &EarthTerms<T>) {
        let attitude_t_p = Turn::of(start, end, dt_s, earth.rate_t).after(self.attitude_t_p);
        self.follow(attitude_t_p, start, end, dt_s, earth);
    }

    /// The rest of a step that ends in an attitude.
    #[inline(always)]
    pub(crate) fn follow(
        &mut self,
        attitude_t_p: [T; 4],
        start: &Inertial<T>,
        end: &Inertial<T>,
        dt_s: f64,
        earth: &EarthTerms<T>,
    ) {
        let like = self.velocity_p_mps[0];
        let half = like.splat(0.5 * dt_s);
        let rotation = rotation_matrix(attitude_t_p);
        let fall_t = scale(earth.gravity_t, like.splat(dt_s));
        let mut gain_t = velocity_increment_t(&self.rotation_t_p, start, &rotation, end, half, fall_t[2]);
        if earth.gradient_t.is_some() {
            gain_t[0] += fall_t[0];
            gain_t[1] += fall_t[1];
        }
        let twice_turn_t = splat3(like, scale(earth.rate_t, 2.0 * dt_s));
        (self.position_t_m, self.velocity_t_mps) =
            integrate_velocity_position(self.position_t_m, self.velocity_t_mps, gain_t, twice_turn_t, half);
        self.velocity_p_mps = tmul(&rotation, self.velocity_t_mps);
        self.attitude_t_p = attitude_t_p;
        self.rotation_t_p = rotation;
    }
}

/// How the attitude changes in a step, which follows from the rates alone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turn<T> {
    /// Of the tangent frame: common to all lanes.
    frame: [f64; 4],
    platform: [T; 4],
}

impl<T: Lane> Turn<T> {
    #[inline(always)]
    pub(crate) fn of(start: &Inertial<T>, end: &Inertial<T>, dt_s: f64, earth_rate_t: [f64; 3]) -> Self {
        let like = start.rate_p_radps[0];
        Self {
            frame: frame_turn(scale(earth_rate_t, -0.5 * dt_s)),
            platform: platform_turn(start, end, like.splat(0.5 * dt_s), like.splat(dt_s * dt_s / 12.0)),
        }
    }

    /// The attitude after it.
    #[inline(always)]
    pub(crate) fn after(&self, attitude_t_p: [T; 4]) -> [T; 4] {
        let ([w, x, y, z], like) = (self.frame, attitude_t_p[0]);
        let frame = [like.splat(w), like.splat(x), like.splat(y), like.splat(z)];
        turned(attitude_t_p, frame, self.platform)
    }
}

/// How the platform turns in a step: the rotation vector of a linearly varying rate is the mean rate plus the coning term
/// (Groves 2013, Eq. 5.84), where `twelfth` is a twelfth of the step squared.
#[inline(always)]
fn platform_turn<T: Lane>(start: &Inertial<T>, end: &Inertial<T>, half: T, twelfth: T) -> [T; 4] {
    let mean = scale(add(start.rate_p_radps, end.rate_p_radps), half);
    let coning = cross(start.rate_p_radps, end.rate_p_radps);
    quaternion_exp(add_scaled(mean, coning, twelfth))
}

/// How the tangent frame turns with the Earth: a small rotation on the other side.
#[inline(always)]
fn frame_turn<T: Lane>(half_turn_t: V3<T>) -> [T; 4] {
    let one = half_turn_t[0].splat(1.0);
    normalise([one, half_turn_t[0], half_turn_t[1], half_turn_t[2]])
}

/// The attitude after both.
#[inline(always)]
fn turned<T: Lane>(attitude: [T; 4], turn_t: [T; 4], turn_p: [T; 4]) -> [T; 4] {
    renormalise(quaternion_mul(turn_t, quaternion_mul(attitude, turn_p)))
}

/// What a step adds to the velocity in the tangent frame: the trapezoid of R f, and gravity's exactly.
#[inline(always)]
fn velocity_increment_t<T: Lane>(
    before: &M3<T>,
    start: &Inertial<T>,
    after: &M3<T>,
    end: &Inertial<T>,
    half: T,
    fall: T,
) -> V3<T> {
    let force_t = mul(before, start.force_p_mps2);
    let mut gain_t = scale(add_mul(force_t, after, end.force_p_mps2), half);
    gain_t[2] += fall;
    gain_t
}

/// Position and velocity after a step: Coriolis at the old velocity plus half the gain.
#[inline(always)]
fn integrate_velocity_position<T: Lane>(
    position_t: V3<T>,
    velocity_t: V3<T>,
    gain_t: V3<T>,
    twice_turn_t: V3<T>,
    half: T,
) -> (V3<T>, V3<T>) {
    let middle_t = add_scaled(velocity_t, gain_t, half.splat(0.5));
    let new_velocity_t = sub_cross(add(velocity_t, gain_t), twice_turn_t, middle_t);
    (
        add_scaled(position_t, add(velocity_t, new_velocity_t), half),
        new_velocity_t,
    )
}

/// Derivatives (ṙ in the tangent frame, body rate ω_tp, v̇ in the platform frame) of the mechanisation.
#[inline(always)]
pub fn derivatives<T: Lane>(
    kinematics: &Kinematics<T>,
    inertial: &Inertial<T>,
    earth: &EarthTerms<T>,
) -> ([T; 3], [T; 3], [T; 3]) {
    let rotation = &kinematics.rotation_t_p;
    let velocity = kinematics.velocity_p_mps;
    let like = velocity[0];
    let rate_ie_p = tmul(rotation, splat3(like, earth.rate_t));
    let gravity_p = tmul(rotation, earth.gravity_t);
    let rate_tp = sub(inertial.rate_p_radps, rate_ie_p);
    let swing = cross(add(inertial.rate_p_radps, rate_ie_p), velocity);
    (
        mul(rotation, velocity),
        rate_tp,
        sub(add(inertial.force_p_mps2, gravity_p), swing),
    )
}

/// Product of two quaternions, scalar first.
#[inline(always)]
pub(crate) fn quaternion_mul<T: Lane>(a: [T; 4], b: [T; 4]) -> [T; 4] {
    let (u, v) = ([a[1], a[2], a[3]], [b[1], b[2], b[3]]);
    let vector = add_scaled(add_scaled(cross(u, v), v, a[0]), u, b[0]);
    [a[0].mul_add(b[0], -dot(u, v)), vector[0], vector[1], vector[2]]
}

/// Square of half a rotation, rad², up to which four terms serve: the fifth is below 3e-17.
const SERIES_LIMIT: f64 = 0.01;

/// Quaternion of a rotation vector, rad.
#[inline(always)]
pub(crate) fn quaternion_exp<T: Lane>(vector: V3<T>) -> [T; 4] {
    let half_squared = dot(vector, vector) * vector[0].splat(0.25);
    // Each lane decides for itself: its bits must not depend on its neighbours.
    let (cosine, half_sinc) = if half_squared.any_above(SERIES_LIMIT) {
        (
            half_squared.map(|square| cosine_and_half_sinc(square).0),
            half_squared.map(|square| cosine_and_half_sinc(square).1),
        )
    } else {
        series(half_squared)
    };
    let [x, y, z] = scale(vector, half_sinc);
    [cosine, x, y, z]
}

/// cos x and sin(x)/2x of x², for small x.
#[inline(always)]
fn series<T: Lane>(square: T) -> (T, T) {
    (
        polynomial(square, [1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0]),
        polynomial(
            square,
            [0.5, -1.0 / 12.0, 1.0 / 240.0, -1.0 / 10_080.0, 1.0 / 725_760.0],
        ),
    )
}

#[inline(always)]
fn polynomial<T: Lane>(x: T, [a, b, c, d, e]: [f64; 5]) -> T {
    let inner = x.mul_add(x.mul_add(x.splat(e), x.splat(d)), x.splat(c));
    x.mul_add(x.mul_add(inner, x.splat(b)), x.splat(a))
}

/// cos x and sin(x)/2x of x².
fn cosine_and_half_sinc(square: f64) -> (f64, f64) {
    if square > SERIES_LIMIT {
        let x = square.sqrt();
        (x.cos(), 0.5 * x.sin() / x)
    } else {
        series(square)
    }
}

#[inline(always)]
fn squared_norm<T: Lane>(q: [T; 4]) -> T {
    q[3].mul_add(q[3], q[2].mul_add(q[2], q[1].mul_add(q[1], q[0] * q[0])))
}

#[inline(always)]
fn times<T: Lane>(q: [T; 4], factor: T) -> [T; 4] {
    [q[0] * factor, q[1] * factor, q[2] * factor, q[3] * factor]
}

#[inline(always)]
fn normalise<T: Lane>(q: [T; 4]) -> [T; 4] {
    times(q, squared_norm(q).sqrt().recip())
}

/// Takes the rounding off a product of unit quaternions: one step of Newton's from 1 towards 1/|q|.
#[inline(always)]
fn renormalise<T: Lane>(q: [T; 4]) -> [T; 4] {
    let half = q[0].splat(-0.5);
    times(q, squared_norm(q).mul_add(half, half.splat(1.5)))
}

#[inline(always)]
fn rotation_matrix<T: Lane>([w, x, y, z]: [T; 4]) -> M3<T> {
    let one = w.splat(1.0);
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    let (xx, yy, zz) = (one - x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    [
        [one - (yy + zz), xy - wz, xz + wy],
        [xy + wz, xx - zz, yz - wx],
        [xz - wy, yz + wx, xx - yy],
    ]
}

#[cfg(test)]
mod tests;
