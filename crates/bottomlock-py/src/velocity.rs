//! Velocity from beams.

use bottomlock::dvl::fix::{FixOutcome, PingContext, VelocityFix, VelocityPrior, solve};
use bottomlock::dvl::geometry as core;
use bottomlock::dvl::geometry::{BeamSample, MAX_BEAMS};
use bottomlock::dvl::partial::{Assumptions, Component, PartialMethod, Reason};
use bottomlock::frames::Vec3;
use nalgebra::{Matrix3, Vector3};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, floats, rows};
use crate::beam_arrays::BeamArrays;
use crate::calls::detached;
use crate::dvl::BeamGeometry;
use crate::errors::{invalid, without_time};
use crate::settings::mask;

/// The method of a name.
fn method_of(name: &str) -> PyResult<PartialMethod> {
    Ok(match name {
        "least_squares" => PartialMethod::LeastSquares,
        "virtual_beam" => PartialMethod::VirtualBeam,
        "nullified_sway" => PartialMethod::NullifiedSway,
        "partial_loose" => PartialMethod::PartialLoose,
        "virtual_heave" => PartialMethod::VirtualHeave,
        "selector" => PartialMethod::Selector,
        "information" => PartialMethod::Information,
        "weak_sway" => PartialMethod::WeakSway,
        other => {
            return Err(invalid(format!(
                "unknown method '{other}', expected one of least_squares, virtual_beam, nullified_sway, partial_loose, \
                 virtual_heave, selector, information, weak_sway"
            )));
        }
    })
}

/// Code of a component's status.
fn reason_code(component: Component) -> u8 {
    match component {
        Component::Solved => 0,
        Component::Unobservable(Reason::NoBeams) => 1,
        Component::Unobservable(Reason::OutsideRowSpace) => 2,
        Component::Unobservable(Reason::ConstraintSingular) => 3,
        Component::Unobservable(Reason::PriorRequired) => 4,
        Component::Unobservable(Reason::PriorOnly) => 5,
    }
}

/// Code of the method that a component comes from.
pub fn source_code(method: PartialMethod) -> u8 {
    match method {
        PartialMethod::LeastSquares => 1,
        PartialMethod::VirtualBeam | PartialMethod::VirtualBeamExact => 2,
        PartialMethod::NullifiedSway => 3,
        PartialMethod::PartialLoose => 4,
        PartialMethod::VirtualHeave => 5,
        PartialMethod::Selector => 0,
        PartialMethod::Information => 6,
        PartialMethod::WeakSway => 7,
    }
}

/// Result columns, one entry per ping.
#[derive(Default)]
struct Columns {
    velocity: Vec<f64>,
    cov: Vec<f64>,
    observed_velocity: Vec<f64>,
    information: Vec<f64>,
    component: Vec<u8>,
    status: Vec<u8>,
    rank: Vec<u8>,
    source: Vec<u8>,
}

impl Columns {
    fn push(&mut self, outcome: &FixOutcome) {
        match outcome {
            FixOutcome::Fix(fix) => self.fix(0, fix),
            FixOutcome::Unobservable(fix) => {
                let any = (0..3).any(|k| fix.estimator.is_solved(k));
                self.fix(if any { 1 } else { 2 }, fix);
            }
            FixOutcome::TooFewBeams => self.none(3, Reason::NoBeams),
            FixOutcome::PriorRequired => self.none(4, Reason::PriorRequired),
        }
    }

    fn fix(&mut self, status: u8, fix: &VelocityFix) {
        let estimator = &fix.estimator;
        for k in 0..3 {
            let solved = estimator.is_solved(k);
            self.velocity
                .push(if solved { fix.velocity_p_mps.0[k] } else { f64::NAN });
            self.component.push(reason_code(estimator.components[k]));
            self.source
                .push(if solved { source_code(estimator.sources[k]) } else { 0 });
            for l in 0..3 {
                let both = solved && estimator.is_solved(l);
                self.cov
                    .push(if both { estimator.covariance[(k, l)] } else { f64::NAN });
            }
        }
        let (axes, variances) = estimator.solution.principal_axes();
        let weights = variances.map(|variance| if variance > 0.0 { variance.recip() } else { 0.0 });
        let information: Matrix3<f64> = axes * Matrix3::from_diagonal(&weights) * axes.transpose();
        // Row by row; a symmetric matrix reads the same by columns.
        self.information.extend(information.iter());
        self.observed_velocity.extend(fix.velocity_p_mps.0.iter());
        self.status.push(status);
        self.rank.push(estimator.solution.rank as u8);
    }

    fn none(&mut self, status: u8, reason: Reason) {
        self.velocity.extend([f64::NAN; 3]);
        self.cov.extend([f64::NAN; 9]);
        self.information.extend([0.0; 9]);
        self.observed_velocity.extend([0.0; 3]);
        self.component.extend([reason_code(Component::Unobservable(reason)); 3]);
        self.source.extend([0; 3]);
        self.status.push(status);
        self.rank.push(0);
    }

    /// The columns as a Python dict; `beams_used` (n, beams) is passed on.
    fn into_dict<'py>(self, py: Python<'py>, beams_used: Bound<'py, PyArrayDyn<bool>>) -> PyResult<Bound<'py, PyDict>> {
        let count = self.status.len();
        let out = PyDict::new(py);
        out.set_item("velocity_p_mps", array(py, self.velocity, &[count, 3])?)?;
        out.set_item("cov_m2ps2", array(py, self.cov, &[count, 3, 3])?)?;
        out.set_item(
            "observed_velocity_p_mps",
            array(py, self.observed_velocity, &[count, 3])?,
        )?;
        out.set_item("information_s2pm2", array(py, self.information, &[count, 3, 3])?)?;
        out.set_item("component", array(py, self.component, &[count, 3])?)?;
        out.set_item("status", array(py, self.status, &[count])?)?;
        out.set_item("beams_used", beams_used)?;
        out.set_item("rank", array(py, self.rank, &[count])?)?;
        out.set_item("source", array(py, self.source, &[count, 3])?)?;
        Ok(out)
    }
}

/// Solves pings for the platform velocity, one row per ping.
///
/// Args:
///     geometry: beam geometry.
///     velocity_mps: (n, beams) beam velocities, m/s.
///     valid: (n, beams) true for a valid beam.
///     method: name of the method.
///     beam_sd_mps: (beams,) standard deviation of each beam, m/s.
///     prior_velocity_p_mps, prior_cov_m2ps2: (n, 3) and (n, 3, 3) prior velocity, platform frame, and its covariance.
///     omega_tp_p_radps: (n, 3) angular rate relative to the tangent frame, platform frame, rad/s, for the lever arms.
///     virtual_beam_factor: n_f of Eq. 28.
///     nullified_sway_var_m2ps2: ε of Eq. 36, (m/s)². weak_sway_var_m2ps2: variance of the weak sway row, (m/s)².
///
/// Raises:
///     KernelError: for a wrong shape, a valid beam that is not finite or an invalid prior, naming the row.
///
/// Source: Tal et al. 2017, Eqs. 17-49.
#[pyfunction]
#[pyo3(signature = (geometry, velocity_mps, valid, *, method, beam_sd_mps, prior_velocity_p_mps=None,
    prior_cov_m2ps2=None, omega_tp_p_radps=None, virtual_beam_factor, nullified_sway_var_m2ps2,
    weak_sway_var_m2ps2))]
pub fn solve_velocity<'py>(
    py: Python<'py>,
    geometry: &BeamGeometry,
    velocity_mps: &Bound<'py, PyAny>,
    valid: &Bound<'py, PyAny>,
    method: &str,
    beam_sd_mps: &Bound<'py, PyAny>,
    prior_velocity_p_mps: Option<&Bound<'py, PyAny>>,
    prior_cov_m2ps2: Option<&Bound<'py, PyAny>>,
    omega_tp_p_radps: Option<&Bound<'py, PyAny>>,
    virtual_beam_factor: f64,
    nullified_sway_var_m2ps2: f64,
    weak_sway_var_m2ps2: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let beams = geometry.inner.beams();
    let readings = BeamArrays::new(
        ["velocity_mps", "valid", ""],
        velocity_mps,
        valid,
        None,
        &[None, Some(beams)],
    )?;
    let count = readings.valid.len() / beams;
    let pings = Pings {
        velocity_mps: readings.velocity_mps,
        valid: readings.valid,
        sd_mps: floats("beam_sd_mps", beam_sd_mps, &[Some(beams)])?.values,
        method: method_of(method)?,
        priors: priors(prior_velocity_p_mps, prior_cov_m2ps2, count)?,
        omega_tp_p_radps: omega_tp_p_radps
            .map(|value| rows::<3>("omega_tp_p_radps", value, Some(count)))
            .transpose()?,
        assumptions: Assumptions {
            virtual_beam_factor,
            nullified_sway_var_m2ps2,
            weak_sway_var_m2ps2,
        },
    };
    let columns = detached(py, || Ok(pings.solve(&geometry.inner, count)))?;
    let columns = columns.map_err(|(row, error)| invalid(format!("row {row}: {}", without_time(&error))))?;
    columns.into_dict(py, array(py, pings.valid, &[count, beams])?)
}

/// Prior velocities and covariances, one per ping, if they are given.
fn priors(
    velocity: Option<&Bound<'_, PyAny>>,
    cov: Option<&Bound<'_, PyAny>>,
    count: usize,
) -> PyResult<Option<Vec<VelocityPrior>>> {
    match (velocity, cov) {
        (Some(velocity), Some(cov)) => {
            let velocity = rows::<3>("prior_velocity_p_mps", velocity, Some(count))?;
            let cov = floats("prior_cov_m2ps2", cov, &[Some(count), Some(3), Some(3)])?.values;
            let prior = |(k, velocity): (usize, [f64; 3])| VelocityPrior {
                velocity_p_mps: Vec3::from_array(velocity),
                cov_m2ps2: Matrix3::from_row_slice(&cov[9 * k..9 * k + 9]),
            };
            Ok(Some(velocity.into_iter().enumerate().map(prior).collect()))
        }
        (None, None) => Ok(None),
        _ => Err(invalid(
            "prior_velocity_p_mps and prior_cov_m2ps2 go together: give both or neither",
        )),
    }
}

/// Pings to solve, with the method and its inputs; arrays are flat, ping by ping.
struct Pings {
    method: PartialMethod,
    velocity_mps: Vec<f64>,
    valid: Vec<bool>,
    sd_mps: Vec<f64>,
    priors: Option<Vec<VelocityPrior>>,
    omega_tp_p_radps: Option<Vec<[f64; 3]>>,
    assumptions: Assumptions,
}

impl Pings {
    /// Solves `count` pings; an error comes with its row.
    fn solve(&self, geometry: &core::BeamGeometry, count: usize) -> Result<Columns, (usize, bottomlock::NavError)> {
        let beams = geometry.beams();
        let mut columns = Columns::default();
        for row in 0..count {
            let own = row * beams..(row + 1) * beams;
            let mut ping = BeamSample {
                time_ns: 0,
                velocity_mps: [f64::NAN; MAX_BEAMS],
                sd_mps: [f64::NAN; MAX_BEAMS],
                valid: mask(&self.valid[own.clone()]),
            };
            ping.velocity_mps[..beams].copy_from_slice(&self.velocity_mps[own]);
            ping.sd_mps[..beams].copy_from_slice(&self.sd_mps);
            let rate = self.omega_tp_p_radps.as_ref().map(|rates| rates[row]);
            let context = PingContext {
                omega_tp_p_radps: rate.map_or(Vector3::zeros(), Vector3::from),
                prior: self.priors.as_ref().map(|priors| priors[row]),
            };
            let outcome =
                solve(self.method, geometry, &ping, &context, &self.assumptions).map_err(|error| (row, error))?;
            columns.push(&outcome);
        }
        Ok(columns)
    }
}
