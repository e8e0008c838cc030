//! What is recorded of a method along a run: errors, claims and NEES at each sample, and counts of fixes.

use crate::filter::nees::nees;
use crate::filter::report::Choice;
use crate::layout::{ACCEL_BIAS, ATTITUDE, DIM};
use crate::state::{Covariance, ErrorVector};

/// Result of one method of one run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MethodRecord {
    /// Error at each sample: position (tangent, m), misalignment (tangent, rad), velocity (platform, m/s).
    pub error: Vec<[f64; 9]>,
    /// Standard deviation claimed for each.
    pub sd: Vec<[f64; 9]>,
    /// Normalised estimation error squared of the whole state.
    pub nees: Vec<f64>,
    /// The same of misalignment and velocity (6 degrees of freedom).
    pub nees_velocity_attitude: Vec<f64>,
    /// Mean normalised innovation squared over the DVL fixes; NaN without any.
    pub nis_mean: f64,
    /// DVL fixes used, whole or in part.
    pub fixes_accepted: u64,
    /// DVL fixes rejected by the gate.
    pub fixes_rejected: u64,
    /// DVL fixes before which the velocity was beyond the linear range ([`crate::filter::linear_range`]).
    pub fixes_beyond_linear_range: u64,
    /// The selection at each ping, for the selector of the paper.
    pub choices: Vec<Choice>,
    /// How well the IMU's biases are known at the last sample; none without samples.
    pub biases: Option<BiasRecord>,
}

/// Errors of the biases of accelerometers (m/s²) and gyros (rad/s), x, y, z each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasRecord {
    /// True minus estimate.
    pub error: [f64; 6],
    /// Standard deviation claimed for each.
    pub sd: [f64; 6],
}

/// How far the estimate of a method is from the truth, and what the method claims.
pub(super) struct Deviation {
    pub(super) error: ErrorVector,
    pub(super) linear_error: ErrorVector,
    pub(super) covariance: Covariance,
}

impl MethodRecord {
    pub(super) fn push(&mut self, deviation: &Deviation, nees: Nees) {
        let (error, covariance) = (&deviation.error, &deviation.covariance);
        let sd = |i: usize| covariance[(i, i)].sqrt();
        self.error.push(std::array::from_fn(|i| error[i]));
        self.sd.push(std::array::from_fn(sd));
        self.nees.push(nees.whole);
        self.nees_velocity_attitude.push(nees.velocity_attitude);
        self.biases = Some(BiasRecord {
            error: std::array::from_fn(|i| error[ACCEL_BIAS + i]),
            sd: std::array::from_fn(|i| sd(ACCEL_BIAS + i)),
        });
    }
}

/// The normalised errors of a method at a sample.
pub(super) struct Nees {
    whole: f64,
    velocity_attitude: f64,
}

/// NEES of several methods side by side; `None` for a covariance that is not positive definite.
pub(super) fn nees_of(deviations: &[Deviation]) -> Vec<Option<Nees>> {
    let pairs = |error: fn(&Deviation) -> &ErrorVector| -> Vec<_> {
        deviations.iter().map(|one| (&one.covariance, error(one))).collect()
    };
    let whole = nees::<DIM>(&pairs(|one| &one.linear_error), 0..DIM);
    let velocity_attitude = nees::<8>(&pairs(|one| &one.error), ATTITUDE..ATTITUDE + 6);
    let both = |(whole, part): (Option<f64>, Option<f64>)| {
        Some(Nees {
            whole: whole?,
            velocity_attitude: part?,
        })
    };
    whole.into_iter().zip(velocity_attitude).map(both).collect()
}
