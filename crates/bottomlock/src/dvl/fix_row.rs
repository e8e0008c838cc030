//! A fix as plain numbers and codes, as Python's arrays and C's structures have it.

use nalgebra::Matrix3;

use super::fix::{FixOutcome, VelocityFix};
use super::partial::{Component, PartialMethod, Reason};

/// Names of the methods that a ping can be solved by.
pub const FIX_METHODS: [(&str, PartialMethod); 8] = [
    ("least_squares", PartialMethod::LeastSquares),
    ("virtual_beam", PartialMethod::VirtualBeam),
    ("nullified_sway", PartialMethod::NullifiedSway),
    ("partial_loose", PartialMethod::PartialLoose),
    ("virtual_heave", PartialMethod::VirtualHeave),
    ("selector", PartialMethod::Selector),
    ("information", PartialMethod::Information),
    ("weak_sway", PartialMethod::WeakSway),
];

/// Code of the method that a component comes from; 0 for none.
#[must_use]
pub fn source_code(method: Option<PartialMethod>) -> u8 {
    match method {
        None | Some(PartialMethod::Selector) => 0,
        Some(PartialMethod::LeastSquares) => 1,
        Some(PartialMethod::VirtualBeam | PartialMethod::VirtualBeamExact) => 2,
        Some(PartialMethod::NullifiedSway) => 3,
        Some(PartialMethod::PartialLoose) => 4,
        Some(PartialMethod::VirtualHeave) => 5,
        Some(PartialMethod::Information) => 6,
        Some(PartialMethod::WeakSway) => 7,
    }
}

/// Code of the status of a component.
fn component_code(component: Component) -> u8 {
    match component {
        Component::Solved => 0,
        Component::Unobservable(Reason::NoBeams) => 1,
        Component::Unobservable(Reason::OutsideRowSpace) => 2,
        Component::Unobservable(Reason::ConstraintSingular) => 3,
        Component::Unobservable(Reason::PriorRequired) => 4,
        Component::Unobservable(Reason::PriorOnly) => 5,
    }
}

/// A velocity from one ping in plain numbers, platform frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixRow {
    /// 0 every component is solved, 1 some are, 2 none is, 3 no beam is valid, 4 the method needs a prior.
    pub status: u8,
    /// Surge, sway and heave over ground, m/s; NaN for a component that is not solved.
    pub velocity_p_mps: [f64; 3],
    /// Covariance, (m/s)²; NaN likewise.
    pub cov_m2ps2: [[f64; 3]; 3],
    /// 0 solved, 1 no beams, 2 outside the row space, 3 the constraint is singular, 4 a prior is required, 5 the prior's own.
    pub component: [u8; 3],
    /// [`source_code`] of each component.
    pub source: [u8; 3],
    /// Number of independent directions.
    pub rank: u8,
    /// Velocity along what is observed, m/s; zero across it.
    pub observed_velocity_p_mps: [f64; 3],
    /// Its information matrix, (s/m)².
    pub information_s2pm2: [[f64; 3]; 3],
}

impl FixRow {
    fn none(status: u8, reason: Reason) -> Self {
        Self {
            status,
            velocity_p_mps: [f64::NAN; 3],
            cov_m2ps2: [[f64::NAN; 3]; 3],
            component: [component_code(Component::Unobservable(reason)); 3],
            source: [0; 3],
            rank: 0,
            observed_velocity_p_mps: [0.0; 3],
            information_s2pm2: [[0.0; 3]; 3],
        }
    }

    fn of(status: u8, fix: &VelocityFix) -> Self {
        let estimator = &fix.estimator;
        let (axes, variances) = estimator.solution.principal_axes();
        let weights = variances.map(|variance| if variance > 0.0 { variance.recip() } else { 0.0 });
        let information: Matrix3<f64> = axes * Matrix3::from_diagonal(&weights) * axes.transpose();
        let mut row = Self {
            component: estimator.components.map(component_code),
            rank: estimator.solution.rank as u8,
            observed_velocity_p_mps: fix.velocity_p_mps.to_array(),
            information_s2pm2: information.into(),
            ..Self::none(status, Reason::NoBeams)
        };
        for k in (0..3).filter(|&k| estimator.is_solved(k)) {
            row.velocity_p_mps[k] = fix.velocity_p_mps.0[k];
            row.source[k] = source_code(Some(estimator.sources[k]));
            for l in (0..3).filter(|&l| estimator.is_solved(l)) {
                row.cov_m2ps2[k][l] = estimator.covariance[(k, l)];
            }
        }
        row
    }
}

impl From<&FixOutcome> for FixRow {
    fn from(outcome: &FixOutcome) -> Self {
        match outcome {
            FixOutcome::Fix(fix) => Self::of(0, fix),
            FixOutcome::Unobservable(fix) if (0..3).any(|k| fix.estimator.is_solved(k)) => Self::of(1, fix),
            FixOutcome::Unobservable(fix) => Self::of(2, fix),
            FixOutcome::TooFewBeams => Self::none(3, Reason::NoBeams),
            FixOutcome::PriorRequired => Self::none(4, Reason::PriorRequired),
        }
    }
}
