//! A fix as plain numbers and codes, as Python's arrays and C's structures have it.

use nalgebra::Matrix3;

use super::fix::{FixOutcome, VelocityFix};
use super::partial::{Component, PartialMethod, Reason};
use crate::error::NavError;

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

impl PartialMethod {
    /// The method of a name.
    ///
    /// # Errors
    /// [`NavError::UnknownName`], which lists the known names.
    pub fn named(name: &str) -> Result<Self, NavError> {
        let found = FIX_METHODS.iter().find(|(known, _)| *known == name);
        found.map(|(_, method)| *method).ok_or_else(|| NavError::UnknownName {
            what: "method",
            name: name.into(),
            expected: "least_squares, virtual_beam, nullified_sway, partial_loose, virtual_heave, selector, information, \
                       weak_sway",
        })
    }
}

/// Code of the method that a component comes from; 0 for none.
#[must_use]
pub fn source_code(method: Option<PartialMethod>) -> u8 {
    match method {
        None | Some(PartialMethod::Selector) => 0,
        Some(PartialMethod::LeastSquares) => 1,
        Some(PartialMethod::VirtualBeam) => 2,
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

/// How much of a velocity a ping determines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum Solved {
    /// Surge, sway and heave are solved.
    Complete = 0,
    /// Some of them are; the others are NaN.
    Partial = 1,
    /// None of them is, though there are beams.
    Unobservable = 2,
    /// No beam is valid.
    NoBeams = 3,
    /// The method needs a prior.
    PriorRequired = 4,
}

/// A velocity from one ping.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct FixRow {
    /// How much is solved.
    pub fix: Solved,
    /// Surge, sway and heave over ground, platform frame, m/s; NaN for a component that is not solved.
    pub velocity_p_mps: [f64; 3],
    /// Covariance, (m/s)^2; NaN likewise.
    pub cov_m2ps2: [[f64; 3]; 3],
    /// Why a component is not solved: 0 solved, 1 no beams, 2 outside what the beams measure, 3 the assumption does not help, 4 a
    /// prior is required, 5 known from the prior alone.
    pub component: [u8; 3],
    /// Method a component comes from: 1 least_squares, 2 virtual_beam, 3 nullified_sway, 4 partial_loose, 5 virtual_heave,
    /// 6 information, 7 weak_sway; 0 for none.
    pub source: [u8; 3],
    /// Number of independent directions.
    pub rank: u8,
    /// The velocity along what is observed, m/s; zero across it.
    pub observed_velocity_p_mps: [f64; 3],
    /// Its information matrix, (s/m)^2.
    pub information_s2pm2: [[f64; 3]; 3],
}

impl FixRow {
    fn none(fix: Solved, reason: Reason) -> Self {
        Self {
            fix,
            velocity_p_mps: [f64::NAN; 3],
            cov_m2ps2: [[f64::NAN; 3]; 3],
            component: [component_code(Component::Unobservable(reason)); 3],
            source: [0; 3],
            rank: 0,
            observed_velocity_p_mps: [0.0; 3],
            information_s2pm2: [[0.0; 3]; 3],
        }
    }

    fn of(solved: Solved, fix: &VelocityFix) -> Self {
        let estimator = &fix.estimator;
        let (axes, variances) = estimator.solution.principal_axes();
        let weights = variances.map(|variance| if variance > 0.0 { variance.recip() } else { 0.0 });
        let information: Matrix3<f64> = axes * Matrix3::from_diagonal(&weights) * axes.transpose();
        let mut row = Self {
            component: estimator.components.map(component_code),
            rank: estimator.solution.rank as u8,
            observed_velocity_p_mps: fix.velocity_p_mps.to_array(),
            information_s2pm2: information.into(),
            ..Self::none(solved, Reason::NoBeams)
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
            FixOutcome::Fix(fix) => Self::of(Solved::Complete, fix),
            FixOutcome::Unobservable(fix) if (0..3).any(|k| fix.estimator.is_solved(k)) => {
                Self::of(Solved::Partial, fix)
            }
            FixOutcome::Unobservable(fix) => Self::of(Solved::Unobservable, fix),
            FixOutcome::TooFewBeams => Self::none(Solved::NoBeams, Reason::NoBeams),
            FixOutcome::PriorRequired => Self::none(Solved::PriorRequired, Reason::PriorRequired),
        }
    }
}
