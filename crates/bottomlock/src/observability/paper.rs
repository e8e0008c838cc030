//! The 15-state model of Klein & Diamant 2015 with its closed-form transition matrix, for either sign of its
//! measurement matrix.
//!
//! States are in the paper's order: position and velocity error in the tangent frame, misalignment, accelerometer bias,
//! gyro bias; a bias adds to the error rate. The Earth does not rotate. With velocity aiding alone the position is left
//! out, which leaves 12 states.
//!
//! The integrals of 2015, Eq. (6) follow from the truth. The specific force is the acceleration minus gravity, so S and
//! P have a closed form in velocity and position. The other integrals are quadratures of rotations by Hermite's rule
//! with known derivatives.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::full::largest_speed;
use super::magnus::Point;
use super::{Epoch, StateKind, System, epoch_samples};
use crate::earth::Environment;
use crate::error::NavError;
use crate::frames::skew;
use crate::model::Model;
use crate::simulation::truth::Truth;

/// Names of the states, in order.
pub const NAMES: [&str; 15] = [
    "position north",
    "position east",
    "position down",
    "velocity north",
    "velocity east",
    "velocity down",
    "tilt north",
    "tilt east",
    "yaw",
    "accel bias x",
    "accel bias y",
    "accel bias z",
    "gyro bias x",
    "gyro bias y",
    "gyro bias z",
];

const POSITION: usize = 0;
const VELOCITY: usize = 3;
const TILT: usize = 6;
const ACCEL_BIAS: usize = 9;
const GYRO_BIAS: usize = 12;

/// Sign of the misalignment block of the DVL's rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// As 2015, Eqs. 9, 10 and 14 print it: −T(v×).
    Printed,
    /// As it follows from 2015, Eq. 4: +T(v×) (erratum E12).
    Consistent,
}

/// Aiding sensors of the 2015 model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sensors {
    /// DVL velocity (2015, Eq. 10), with the sign of its misalignment block.
    pub velocity: Option<Sign>,
    /// Depth (2015, Eq. 13).
    pub depth: bool,
}

/// The integrals of 2015, Eq. (6) at a time.
struct Integrals {
    duration_s: f64,
    p: Matrix3<f64>,
    q: Matrix3<f64>,
    t: Matrix3<f64>,
    s: Matrix3<f64>,
    r: Matrix3<f64>,
    m: Matrix3<f64>,
    /// J = ∫ S Ṙ, so that M = ∫ Ṡ R = S R − J by parts.
    j: Matrix3<f64>,
}

impl Integrals {
    fn zeros() -> Self {
        let zero = Matrix3::zeros();
        Self {
            duration_s: 0.0,
            p: zero,
            q: zero,
            t: zero,
            s: zero,
            r: zero,
            m: zero,
            j: zero,
        }
    }

    /// Φ(t, t₀) of 2015, Eq. (5).
    fn transition(&self) -> DMatrix<f64> {
        let mut phi = DMatrix::identity(15, 15);
        let mut put = |row: usize, column: usize, block: &Matrix3<f64>| {
            phi.view_mut((row, column), (3, 3)).copy_from(block);
        };
        put(POSITION, VELOCITY, &(Matrix3::identity() * self.duration_s));
        put(POSITION, TILT, &self.p);
        put(POSITION, ACCEL_BIAS, &self.q);
        put(POSITION, GYRO_BIAS, &self.t);
        put(VELOCITY, TILT, &self.s);
        put(VELOCITY, ACCEL_BIAS, &self.r);
        put(VELOCITY, GYRO_BIAS, &self.m);
        put(TILT, GYRO_BIAS, &self.r);
        phi
    }
}

/// ∫ over a step from values and derivatives at its ends (Hermite's rule), exact for cubics.
fn hermite(h: f64, a: &Matrix3<f64>, b: &Matrix3<f64>, da: &Matrix3<f64>, db: &Matrix3<f64>) -> Matrix3<f64> {
    (a + b) * (0.5 * h) + (da - db) * (h * h / 12.0)
}

/// Φ(t_k, t_0) at each of `samples`, the first of which is t_0; `thinned` uses every second truth sample.
fn transitions(truth: &Truth<'_>, samples: &[usize], environment: &Environment, thinned: bool) -> Vec<DMatrix<f64>> {
    let path = Path::new(truth, samples[0], environment);
    let mut now = Integrals::zeros();
    let mut out = vec![now.transition()];
    let mut point = Point::at(truth, samples[0], environment);
    let mut k = samples[0];
    for &target in &samples[1..] {
        while k < target {
            let next = path.next_sample(k, target, thinned);
            let end = Point::at(truth, next, environment);
            now = path.advance(&now, (k, &point), (next, &end));
            point = end;
            k = next;
        }
        out.push(now.transition());
    }
    out
}

/// A truth from a first sample on, with the terms of the integrals that have a closed form.
struct Path<'a> {
    truth: &'a Truth<'a>,
    first: usize,
    velocity_t: Vector3<f64>,
    gravity: Vector3<f64>,
}

impl<'a> Path<'a> {
    fn new(truth: &'a Truth<'a>, first: usize, environment: &Environment) -> Self {
        Self {
            truth,
            first,
            velocity_t: Point::at(truth, first, environment).velocity_t,
            gravity: Vector3::new(0.0, 0.0, environment.gravity_mps2),
        }
    }

    fn elapsed_s(&self, k: usize) -> f64 {
        (self.truth.time_ns[k] - self.truth.time_ns[self.first]) as f64 * 1e-9
    }

    /// The sample after `k`, or with `thinned` the one after that if both steps are about equal.
    fn next_sample(&self, k: usize, target: usize, thinned: bool) -> usize {
        if thinned && k + 2 <= target {
            let seconds = |from: usize| self.elapsed_s(from + 1) - self.elapsed_s(from);
            let (a, b) = (seconds(k), seconds(k + 1));
            if (a - b).abs() <= 0.1 * a.max(b) {
                return k + 2;
            }
        }
        k + 1
    }

    /// S = −∫[f×] in closed form, since f = v̇ − g.
    fn s(&self, k: usize, point: &Point) -> Matrix3<f64> {
        -skew(&(point.velocity_t - self.velocity_t - self.gravity * self.elapsed_s(k)))
    }

    /// P = ∫S in closed form.
    fn p(&self, k: usize) -> Matrix3<f64> {
        let t = self.elapsed_s(k);
        let position = |k: usize| Vector3::from(self.truth.position_t_m[k]);
        -skew(&(position(k) - position(self.first) - self.velocity_t * t - self.gravity * (0.5 * t * t)))
    }

    /// [f×] in the tangent frame.
    fn force(&self, point: &Point) -> Matrix3<f64> {
        skew(&(point.acceleration_t - self.gravity))
    }

    /// The integrals at the end of a step from sample and point `from` to sample and point `to`.
    fn advance(&self, now: &Integrals, from: (usize, &Point), to: (usize, &Point)) -> Integrals {
        let ((k, start), (next, end)) = (from, to);
        let h = self.elapsed_s(next) - self.elapsed_s(k);
        let s = self.s(next, end);
        let r = now.r
            + hermite(
                h,
                &start.rotation,
                &end.rotation,
                &start.rotation_rate,
                &end.rotation_rate,
            );
        let q = now.q + hermite(h, &now.r, &r, &start.rotation, &end.rotation);
        let slope = |s: &Matrix3<f64>, at: &Point| -self.force(at) * at.rotation + s * at.rotation_rate;
        let j = now.j
            + hermite(
                h,
                &(now.s * start.rotation),
                &(s * end.rotation),
                &slope(&now.s, start),
                &slope(&s, end),
            );
        let m = s * r - j;
        let t = now.t + hermite(h, &now.m, &m, &(-self.force(start) * now.r), &(-self.force(end) * r));
        Integrals {
            duration_s: self.elapsed_s(next),
            p: self.p(next),
            q,
            t,
            s,
            r,
            m,
            j,
        }
    }
}

/// Φ between two truth samples.
pub(super) fn transition(truth: &Truth<'_>, from: usize, to: usize, environment: &Environment) -> DMatrix<f64> {
    let mut pair = transitions(truth, &[from, to], environment, false);
    pair.pop().unwrap_or_else(|| DMatrix::identity(15, 15))
}

/// The linear system of a truth in the states of the 2015 model.
///
/// The model has no Earth rate. For a truth with Earth rate the velocities are kept, and the specific force is the one
/// that gives them without Earth rate.
///
/// # Errors
/// [`NavError`] for an invalid truth or model, or without a sensor.
pub fn system(truth: &Truth<'_>, model: &Model, sensors: &Sensors, period_ns: i64) -> Result<System, NavError> {
    model.validate()?;
    if sensors.velocity.is_none() && !sensors.depth {
        return Err(NavError::WrongCount {
            field: "aiding sensors",
            got: 0,
            expected: "velocity, depth or both: the 2015 model has no others".into(),
        });
    }
    let samples = epoch_samples(truth, period_ns)?;
    let duration_s = (truth.time_ns[truth.time_ns.len() - 1] - truth.time_ns[0]) as f64 * 1e-9;
    let dropped = if sensors.depth { 0 } else { VELOCITY };
    let keep = 15 - dropped;
    let square = |m: &DMatrix<f64>| m.view((dropped, dropped), (keep, keep)).into_owned();
    let fine = transitions(truth, &samples, &model.environment, false);
    let coarse = transitions(truth, &samples, &model.environment, true);
    let mut epochs = Vec::with_capacity(samples.len());
    for (index, &k) in samples.iter().enumerate() {
        let (rows, row_scale, noise) = rows(truth, k, model, sensors, duration_s);
        epochs.push(Epoch {
            time_ns: truth.time_ns[k],
            transition: square(&fine[index]),
            coarse: square(&coarse[index]),
            rows: rows.columns(dropped, keep).into_owned(),
            row_scale,
            noise,
        });
    }
    Ok(System {
        names: NAMES[dropped..].iter().map(ToString::to_string).collect(),
        kinds: (dropped..15)
            .map(|index| match index {
                0..3 => StateKind::Position,
                3..6 => StateKind::Velocity,
                6..9 => StateKind::Tilt,
                9..12 => StateKind::AccelBias,
                _ => StateKind::GyroBias,
            })
            .collect(),
        gravity_mps2: model.environment.gravity_mps2,
        speed_mps: largest_speed(truth),
        epochs,
    })
}

/// H of 2015, Eqs. (10) and (13).
fn rows(
    truth: &Truth<'_>,
    k: usize,
    model: &Model,
    sensors: &Sensors,
    duration_s: f64,
) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
    let count = 3 * usize::from(sensors.velocity.is_some()) + usize::from(sensors.depth);
    let mut h = DMatrix::zeros(count, 15);
    let mut scale = DVector::from_element(count, 1.0);
    let mut noise = DMatrix::identity(count, count) * model.sensors.dvl.beam_noise_sd_mps.powi(2);
    if let Some(sign) = sensors.velocity {
        let to_body = truth.attitude(k).matrix().transpose();
        let velocity_t = to_body.transpose() * Vector3::from(truth.velocity_p_mps[k]);
        let by_misalignment = to_body * skew(&velocity_t);
        h.view_mut((0, VELOCITY), (3, 3)).copy_from(&to_body);
        h.view_mut((0, TILT), (3, 3)).copy_from(&match sign {
            Sign::Printed => -by_misalignment,
            Sign::Consistent => by_misalignment,
        });
    }
    if sensors.depth {
        h[(count - 1, POSITION + 2)] = 1.0;
        scale[count - 1] = duration_s;
        noise[(count - 1, count - 1)] = model.sensors.depth.sd_m.powi(2);
    }
    (h, scale, noise)
}
