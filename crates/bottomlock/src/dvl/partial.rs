//! The extended loosely coupled methods and the selector (Eqs. 23–49): one least-squares solution with extra rows.
//!
//! | Method | Extra row | Solved components |
//! |---|---|---|
//! | virtual beam (VB) | `b_j · v = b_j · v_prior` for missing beams, until the rank is 3 | all, or none |
//! | nullified sway (NSV) | `e_y · v = 0` | all, or none (erratum E2) |
//! | partial loose coupling (PLCF) | none | the platform axes in the row space (erratum E3) |
//! | virtual heave (VHV) | `e_z · v = w_prior` | as PLCF; never the heave of the prior |
//! | selector | – | per axis the smallest variance of these four |
//! | information | none | the observable principal axes |
//! | weak sway | `e_y · v = 0` with a large variance | the observable principal axes |
//!
//! With three independent beams every method is plain least squares.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::geometry::{BeamGeometry, BeamMask, MAX_BEAMS};
use super::velocity::{Gain, HEAVE_SLOT, LeastSquares, Rows, SWAY_SLOT, VIRTUAL_SLOT, least_squares};
use crate::error::{NavError, require_finite_squares, require_positive};

/// Covariance of the beam readings, beams by beams, (m/s)².
pub type BeamNoise = SMatrix<f64, MAX_BEAMS, MAX_BEAMS>;

/// Method that computes a velocity from the valid beams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum PartialMethod {
    /// Weighted least squares on three or more independent beams (LC).
    LeastSquares,
    /// VB, Sect. 3.1, with n_f in place of the correlation of Eq. 26, unless [`Assumptions::exact_virtual_beams`] keeps it.
    VirtualBeam,
    /// NSV, Sect. 3.2.
    NullifiedSway,
    /// PLCF, Sect. 3.3.
    PartialLoose,
    /// VHV, Sect. 3.4.
    VirtualHeave,
    /// The selector, Eqs. 48 and 49.
    Selector,
    /// The rank-deficient least-squares information, along its principal axes.
    Information,
    /// Least squares on the beams and a sway row with a large variance.
    WeakSway,
}

/// Parameters of the methods.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Assumptions {
    /// n_f of Eq. 28.
    pub virtual_beam_factor: f64,
    /// Whether the method `vb` keeps the correlation of Eq. 26: it is then identical to tight coupling. n_f is then 1.
    pub exact_virtual_beams: bool,
    /// ε of Eq. 36, (m/s)².
    pub nullified_sway_var_m2ps2: f64,
    /// Variance of the weak sway row, (m/s)², once a second: pings that follow each other sooner share it.
    pub weak_sway_var_m2ps2: f64,
}

impl Assumptions {
    /// Checks every number, whichever method is in use.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the field.
    pub fn validate(&self) -> Result<(), NavError> {
        let (field, value) = ("options.assumptions.virtual_beam_factor", self.virtual_beam_factor);
        require_positive(field, value)?;
        if self.exact_virtual_beams && value != 1.0 {
            let expected = "1 with exact_virtual_beams, which keeps the correlation that the factor stands for";
            return Err(NavError::OutOfRange { field, value, expected });
        }
        let nullified = self.nullified_sway_var_m2ps2;
        require_positive("options.assumptions.nullified_sway_var_m2ps2", nullified)?;
        require_positive("options.assumptions.weak_sway_var_m2ps2", self.weak_sway_var_m2ps2)
    }

    /// The assumptions of a ping `interval_s` after the one before it, if any. A sway that lasts is no new information at each
    /// ping: the weak row's variance is that of a second. Rarer pings keep it, which is cautious.
    #[must_use]
    pub fn of_ping(&self, interval_s: Option<f64>) -> Self {
        let mut own = *self;
        own.weak_sway_var_m2ps2 *= interval_s.map_or(1.0, |interval_s| (1.0 / interval_s).max(1.0));
        own
    }
}

impl Default for Assumptions {
    /// n_f = 1 (no compensation) without the correlation, ε = 1e-3 and a weak sway row of 2 (m/s)².
    fn default() -> Self {
        Self {
            virtual_beam_factor: 1.0,
            exact_virtual_beams: false,
            nullified_sway_var_m2ps2: 1e-3,
            weak_sway_var_m2ps2: 2.0,
        }
    }
}

/// Reason why a component is not solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// No beam is valid.
    NoBeams,
    /// The axis lies outside the row space.
    OutsideRowSpace,
    /// The row of the method adds no direction to those of the beams, so its system is singular.
    ConstraintSingular,
    /// The method needs a prior velocity and none was given.
    PriorRequired,
    /// The component would be the prior's own.
    PriorOnly,
}

/// Status of one component of a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// The component is solved.
    Solved,
    /// The component is not solved, for this reason.
    Unobservable(Reason),
}

/// Rows that the filter takes from a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// The solved platform components.
    Components,
    /// The observable principal axes.
    Axes,
}

/// Linear estimator of a fix: gain, covariance and status of each component, without the row values.
#[derive(Debug, Clone, PartialEq)]
pub struct FixEstimator {
    /// Gain: velocity = gain · row values.
    pub gain: Gain,
    /// Covariance of the fix, (m/s)²; defined for solved components, or along the observed axes.
    pub covariance: Matrix3<f64>,
    /// Status of surge, sway and heave.
    pub components: [Component; 3],
    /// Method that each component comes from.
    pub sources: [PartialMethod; 3],
    /// The least-squares solution, for the port along principal axes.
    pub solution: LeastSquares,
    /// Virtual beams, by slot.
    pub virtual_beams: [Option<usize>; 2],
    /// Rows that the filter takes.
    pub port: Port,
}

impl FixEstimator {
    /// No component is solved, for one reason.
    fn unsolved(method: PartialMethod, reason: Reason, solution: LeastSquares) -> Self {
        Self {
            gain: Gain::zeros(),
            covariance: Matrix3::zeros(),
            components: [Component::Unobservable(reason); 3],
            sources: [method; 3],
            solution,
            virtual_beams: [None; 2],
            port: Port::Components,
        }
    }

    /// Every axis in the row space is solved.
    fn of_row_space(method: PartialMethod, solution: LeastSquares) -> Self {
        Self::by_axis(method, solution, |_| None)
    }

    /// Every axis in the row space is solved, except those for which `withheld` gives a reason.
    fn by_axis(method: PartialMethod, solution: LeastSquares, withheld: impl Fn(usize) -> Option<Reason>) -> Self {
        let components = std::array::from_fn(|k| match withheld(k) {
            Some(reason) => Component::Unobservable(reason),
            None if solution.observes(&axis(k)) => Component::Solved,
            None => Component::Unobservable(Reason::OutsideRowSpace),
        });
        Self {
            gain: solution.gain,
            covariance: solution.covariance,
            components,
            sources: [method; 3],
            solution,
            virtual_beams: [None; 2],
            port: Port::Components,
        }
    }

    /// Returns true if component `k` (surge, sway, heave) is solved.
    #[must_use]
    pub fn is_solved(&self, k: usize) -> bool {
        self.components[k] == Component::Solved
    }
}

fn axis(k: usize) -> Vector3<f64> {
    Vector3::ith(k, 1.0)
}

fn beam_rows(geometry: &BeamGeometry, valid: BeamMask, noise: &BeamNoise) -> Rows {
    let mut rows = Rows::empty();
    for beam in valid.iter().filter(|&beam| beam < geometry.beams()) {
        rows.directions[beam] = Some(*geometry.direction_p(beam));
    }
    rows.noise.fixed_view_mut::<MAX_BEAMS, MAX_BEAMS>(0, 0).copy_from(noise);
    rows
}

/// The estimator of `method` for the valid beams.
///
/// `noise` is the covariance of the beam readings, (m/s)². `prior_cov` is the covariance of the prior velocity, (m/s)²,
/// which VB and VHV need. Lost beams and unobservable axes are values, not errors.
///
/// # Errors
/// [`NavError::NotPositiveDefinite`] if the beam noise is not a covariance; [`NavError::OutOfRange`] or
/// [`NavError::NotFinite`] for an invalid assumption or prior.
pub fn fix_estimator(
    method: PartialMethod,
    geometry: &BeamGeometry,
    valid: BeamMask,
    noise: &BeamNoise,
    prior_cov: Option<&Matrix3<f64>>,
    assumptions: &Assumptions,
) -> Result<FixEstimator, NavError> {
    assumptions.validate()?;
    let beams = beam_rows(geometry, valid, noise);
    let solution = least_squares(&beams)?;
    estimator_beyond_beams(method, geometry, valid, &beams, solution, prior_cov, assumptions)
}

/// As [`fix_estimator`], given the rows of the beams and their least-squares solution.
fn estimator_beyond_beams(
    method: PartialMethod,
    geometry: &BeamGeometry,
    valid: BeamMask,
    beams: &Rows,
    solution: LeastSquares,
    prior_cov: Option<&Matrix3<f64>>,
    assumptions: &Assumptions,
) -> Result<FixEstimator, NavError> {
    if solution.rank == 0 {
        return Ok(FixEstimator::unsolved(method, Reason::NoBeams, solution));
    }
    if solution.rank == 3 && method != PartialMethod::Information {
        return Ok(FixEstimator::of_row_space(method, solution));
    }
    match method {
        PartialMethod::LeastSquares => Ok(FixEstimator::unsolved(method, Reason::OutsideRowSpace, solution)),
        PartialMethod::PartialLoose => Ok(FixEstimator::of_row_space(method, solution)),
        PartialMethod::Information => Ok(FixEstimator {
            port: Port::Axes,
            ..FixEstimator::of_row_space(method, solution)
        }),
        PartialMethod::WeakSway => {
            let rows = beams.with(SWAY_SLOT, axis(1), assumptions.weak_sway_var_m2ps2);
            Ok(FixEstimator {
                port: Port::Axes,
                ..FixEstimator::of_row_space(method, least_squares(&rows)?)
            })
        }
        PartialMethod::NullifiedSway => nullified_sway(beams, solution, assumptions),
        PartialMethod::VirtualBeam => match checked_prior(prior_cov)? {
            None => Ok(FixEstimator::unsolved(method, Reason::PriorRequired, solution)),
            Some(prior) => virtual_beam(geometry, valid, beams, solution, prior, assumptions.virtual_beam_factor),
        },
        PartialMethod::VirtualHeave => match checked_prior(prior_cov)? {
            None => Ok(FixEstimator::unsolved(method, Reason::PriorRequired, solution)),
            Some(prior) => virtual_heave(beams, solution, prior),
        },
        PartialMethod::Selector => selector(geometry, valid, beams, prior_cov, assumptions, solution),
    }
}

fn checked_prior(prior_cov: Option<&Matrix3<f64>>) -> Result<Option<&Matrix3<f64>>, NavError> {
    if let Some(cov) = prior_cov {
        require_finite_squares("prior cov_m2ps2", 0, cov.as_slice())?;
        let symmetric = (cov - cov.transpose()).amax() <= 1e-9 * cov.amax();
        if !symmetric || cov.cholesky().is_none() {
            return Err(NavError::NotPositiveDefinite {
                matrix: "prior cov_m2ps2",
                time_ns: 0,
            });
        }
    }
    Ok(prior_cov)
}

/// NSV, Eqs. (31)–(36), with a weighted row in place of a deleted column.
///
/// Erratum E2: singular if the beams already determine the sway, as pairs (1,4) and (2,3) of the x-Janus do.
fn nullified_sway(rows: &Rows, beams: LeastSquares, assumptions: &Assumptions) -> Result<FixEstimator, NavError> {
    let solution = least_squares(&rows.with(SWAY_SLOT, axis(1), assumptions.nullified_sway_var_m2ps2))?;
    if solution.rank < 3 {
        let reason = if solution.rank == beams.rank {
            Reason::ConstraintSingular
        } else {
            Reason::OutsideRowSpace
        };
        return Ok(FixEstimator::unsolved(PartialMethod::NullifiedSway, reason, beams));
    }
    Ok(FixEstimator::of_row_space(PartialMethod::NullifiedSway, solution))
}

/// VB, Eqs. (23)–(30): missing beams are virtualised until the rank is 3.
///
/// σ_v3 = n_f √(b₃ᵀ P_vv b₃) with the whole P_vv (erratum E6).
fn virtual_beam(
    geometry: &BeamGeometry,
    valid: BeamMask,
    rows: &Rows,
    beams: LeastSquares,
    prior_cov: &Matrix3<f64>,
    factor: f64,
) -> Result<FixEstimator, NavError> {
    let method = PartialMethod::VirtualBeam;
    let (mut rows, mut virtual_beams) = (rows.clone(), [None; 2]);
    let (mut rank, mut null) = (beams.rank, beams.null);
    while rank < 3 {
        // The missing beam with the largest component along the null space gives the best condition; of equals the
        // lowest number.
        let null_component = |beam: usize| (null.transpose() * geometry.direction_p(beam)).norm();
        let mut best = None;
        for beam in (0..geometry.beams()).filter(|&beam| !valid.contains(beam)) {
            if null_component(beam) > best.map_or(1e-7, |other| null_component(other) * (1.0 + 1e-9)) {
                best = Some(beam);
            }
        }
        let Some(beam) = best else { break };
        let index = usize::from(virtual_beams[0].is_some());
        rows.put(VIRTUAL_SLOT + index, *geometry.direction_p(beam), 1.0);
        virtual_beams[index] = Some(beam);
        (rank, null) = rows.null_space();
    }
    if rank < 3 {
        return Ok(FixEstimator::unsolved(method, Reason::OutsideRowSpace, beams));
    }
    for (i, first) in virtual_beams.iter().enumerate() {
        for (j, second) in virtual_beams.iter().enumerate() {
            if let (Some(first), Some(second)) = (first, second) {
                let covariance = geometry
                    .direction_p(*first)
                    .dot(&(prior_cov * geometry.direction_p(*second)));
                rows.noise[(VIRTUAL_SLOT + i, VIRTUAL_SLOT + j)] = factor * factor * covariance;
            }
        }
    }
    Ok(FixEstimator {
        virtual_beams,
        ..FixEstimator::of_row_space(method, least_squares(&rows)?)
    })
}

/// VHV, Eqs. (44)–(47), with the plus sign of erratum E1.
fn virtual_heave(rows: &Rows, beams: LeastSquares, prior_cov: &Matrix3<f64>) -> Result<FixEstimator, NavError> {
    if beams.observes(&axis(2)) {
        return Ok(FixEstimator::of_row_space(PartialMethod::VirtualHeave, beams));
    }
    let rows = rows.with(HEAVE_SLOT, axis(2), prior_cov[(2, 2)]);
    let withheld = |k: usize| (k == 2).then_some(Reason::PriorOnly);
    Ok(FixEstimator::by_axis(
        PartialMethod::VirtualHeave,
        least_squares(&rows)?,
        withheld,
    ))
}

/// The selector, Eqs. (48) and (49): per axis the smallest variance; the covariance is diagonal.
fn selector(
    geometry: &BeamGeometry,
    valid: BeamMask,
    beams: &Rows,
    prior_cov: Option<&Matrix3<f64>>,
    assumptions: &Assumptions,
    solution: LeastSquares,
) -> Result<FixEstimator, NavError> {
    const CANDIDATES: [PartialMethod; 4] = [
        PartialMethod::VirtualBeam,
        PartialMethod::NullifiedSway,
        PartialMethod::PartialLoose,
        PartialMethod::VirtualHeave,
    ];
    let mut selected = FixEstimator::unsolved(PartialMethod::Selector, Reason::OutsideRowSpace, solution.clone());
    for method in CANDIDATES {
        let candidate =
            estimator_beyond_beams(method, geometry, valid, beams, solution.clone(), prior_cov, assumptions)?;
        if method == PartialMethod::VirtualBeam {
            selected.virtual_beams = candidate.virtual_beams;
        }
        for k in 0..3 {
            let better = !selected.is_solved(k) || candidate.covariance[(k, k)] < selected.covariance[(k, k)];
            if candidate.is_solved(k) && better {
                selected.gain.set_row(k, &candidate.gain.row(k));
                selected.covariance[(k, k)] = candidate.covariance[(k, k)];
                selected.components[k] = Component::Solved;
                selected.sources[k] = method;
            }
        }
    }
    Ok(selected)
}
