//! The transition matrix of the error model between truth samples, to fourth order.
//!
//! With w = R δv in place of the platform velocity error, F contains R, the tangent velocity and their product, and no
//! specific force. Their derivatives at the samples are known, so the Magnus expansion with Hermite quadrature has an
//! error of fifth order in the step, which at 150 Hz is below rounding. Without Earth rate F is nilpotent, so the
//! series of the exponential is finite.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::earth::Environment;
use crate::frames::skew;
use crate::simulation::truth::Truth;

/// Number of states with dynamics or with a bias that drives them.
pub(super) const MOVING: usize = 15;
/// A matrix over position, misalignment, w = R δv, accelerometer bias and gyro bias.
pub(super) type Block = SMatrix<f64, MOVING, MOVING>;

const R: usize = 0;
const RHO: usize = 3;
const W: usize = 6;
const BA: usize = 9;
const BG: usize = 12;

/// F and its time derivative at a truth sample.
struct Generator {
    f: Block,
    rate: Block,
}

/// Attitude matrix, tangent velocity, and their rates at a truth sample.
pub(super) struct Point {
    pub(super) rotation: Matrix3<f64>,
    pub(super) rotation_rate: Matrix3<f64>,
    pub(super) velocity_t: Vector3<f64>,
    pub(super) acceleration_t: Vector3<f64>,
}

impl Point {
    /// The point at sample `k`: Ṙ = R [ω_tp×], v̇ = R f + g − 2 ω_ie × v in the tangent frame.
    pub(super) fn at(truth: &Truth<'_>, k: usize, environment: &Environment) -> Self {
        let rotation = truth.attitude(k).matrix();
        let earth_t = environment.earth_rate_t_radps().0;
        let rate_tp = Vector3::from(truth.omega_p_radps[k]) - rotation.transpose() * earth_t;
        let velocity_t = rotation * Vector3::from(truth.velocity_p_mps[k]);
        let gravity_t = Vector3::new(0.0, 0.0, environment.gravity_mps2);
        Self {
            rotation_rate: rotation * skew(&rate_tp),
            acceleration_t: rotation * Vector3::from(truth.force_p_mps2[k]) + gravity_t
                - 2.0 * earth_t.cross(&velocity_t),
            rotation,
            velocity_t,
        }
    }
}

fn put(f: &mut Block, row: usize, column: usize, block: &Matrix3<f64>) {
    f.fixed_view_mut::<3, 3>(row, column).copy_from(block);
}

impl Generator {
    fn at(truth: &Truth<'_>, k: usize, environment: &Environment) -> Self {
        let point = Point::at(truth, k, environment);
        let earth = skew(&environment.earth_rate_t_radps().0);
        let gravity = skew(&Vector3::new(0.0, 0.0, environment.gravity_mps2));
        let (velocity, acceleration) = (skew(&point.velocity_t), skew(&point.acceleration_t));
        let (rotation, rotation_rate) = (&point.rotation, &point.rotation_rate);
        let mut f = Block::zeros();
        put(&mut f, R, W, &Matrix3::identity());
        put(&mut f, R, RHO, &-velocity);
        put(&mut f, RHO, RHO, &-earth);
        put(&mut f, RHO, BG, &-rotation);
        put(&mut f, W, W, &(-2.0 * earth));
        put(&mut f, W, RHO, &(gravity + velocity * earth));
        put(&mut f, W, BA, &-rotation);
        put(&mut f, W, BG, &(-velocity * rotation));
        let mut rate = Block::zeros();
        put(&mut rate, R, RHO, &-acceleration);
        put(&mut rate, RHO, BG, &-rotation_rate);
        put(&mut rate, W, RHO, &(acceleration * earth));
        put(&mut rate, W, BA, &-rotation_rate);
        put(&mut rate, W, BG, &(-acceleration * rotation - velocity * rotation_rate));
        Self { f, rate }
    }
}

/// exp − I: adding the identity would lose digits of a short step.
fn exponential_less_one(generator: &Block) -> Block {
    let mut total = *generator;
    let mut term = *generator;
    for k in 2..=8_u32 {
        term = term * generator / f64::from(k);
        total += term;
        if term.amax() <= 1e-18 * total.amax() {
            break;
        }
    }
    total
}

/// Φ from sample `from` to sample `to`, in w = R δv; `thinned` uses every second sample where steps are about equal.
pub(super) fn transition(truth: &Truth<'_>, from: usize, to: usize, environment: &Environment, thinned: bool) -> Block {
    let length = |a: usize, b: usize| (truth.time_ns[b] - truth.time_ns[a]) as f64 * 1e-9;
    // Φ − I with compensated summation (Kahan 1965), since the rounding errors of thousands of equal steps would add
    // up.
    let (mut moved, mut lost) = (Block::zeros(), Block::zeros());
    let mut start = Generator::at(truth, from, environment);
    let mut k = from;
    while k < to {
        let mut next = k + 1;
        if thinned && k + 2 <= to {
            let (first, second) = (length(k, k + 1), length(k + 1, k + 2));
            // A jump in the motion is written as two samples 1 ns apart; a step must not span it.
            if (first - second).abs() <= 0.1 * first.max(second) {
                next = k + 2;
            }
        }
        let h = length(k, next);
        let end = Generator::at(truth, next, environment);
        let mut exponent = (start.f + end.f) * (0.5 * h);
        // An interval of one sample cannot be thinned, so the trapezoidal rule gives the coarser value.
        if !(thinned && to - from == 1) {
            let commutator = start.f * end.f - end.f * start.f;
            exponent += (start.rate - end.rate - commutator) * (h * h / 12.0);
        }
        let step = exponential_less_one(&exponent);
        let change = step + step * moved - lost;
        let sum = moved + change;
        lost = (sum - moved) - change;
        moved = sum;
        start = end;
        k = next;
    }
    moved + Block::identity()
}
