//! Velocity from beams.

use bottomlock::dvl::fix::{PingContext, VelocityPrior, solve};
use bottomlock::dvl::fix_row::{FIX_METHODS, FixRow};
use bottomlock::dvl::geometry as core;
use bottomlock::dvl::geometry::BeamSample;
use bottomlock::dvl::partial::{Assumptions, PartialMethod};
use bottomlock::frames::Vec3;
use nalgebra::{Matrix3, Vector3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Argument, Dict, floats, rows};
use crate::beam_arrays::BeamArrays;
use crate::calls::detached;
use crate::dvl;
use crate::errors::{invalid, without_time};
use crate::results::Results;
use crate::settings::mask;

/// The method of a name.
fn method_of(name: &str) -> PyResult<PartialMethod> {
    let found = FIX_METHODS.iter().find(|(known, _)| *known == name);
    found.map(|(_, method)| *method).ok_or_else(|| {
        let known = FIX_METHODS.map(|(known, _)| known).join(", ");
        invalid(format!("unknown method '{name}', expected one of {known}"))
    })
}

/// Solves pings for the platform velocity, one row per ping.
///
/// Args:
///     geometry: beam geometry.
///     velocity_mps: (n, beams) beam velocities, m/s.
///     valid: (n, beams) true for a valid beam.
///     method: name of the method.
///     beam_sd_mps: (beams,) standard deviation of each beam, m/s, or one number for all.
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
    geometry: Argument,
    velocity_mps: Argument,
    valid: Argument,
    method: &str,
    beam_sd_mps: Argument,
    prior_velocity_p_mps: Option<Argument>,
    prior_cov_m2ps2: Option<Argument>,
    omega_tp_p_radps: Option<Argument>,
    virtual_beam_factor: f64,
    nullified_sway_var_m2ps2: f64,
    weak_sway_var_m2ps2: f64,
) -> Dict<'py> {
    let geometry = dvl::geometry(geometry)?;
    let beams = geometry.beams();
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
        sd_mps: if beam_sd_mps.len().is_ok() {
            floats("beam_sd_mps", beam_sd_mps, &[Some(beams)])?.values
        } else {
            floats("beam_sd_mps", beam_sd_mps, &[])?.values.repeat(beams)
        },
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
    let rows = detached(py, || Ok(pings.solve(&geometry, count)))?;
    let rows = rows.map_err(|(row, error)| invalid(format!("row {row}: {}", without_time(&error))))?;
    let out = PyDict::new(py);
    out.column("velocity_p_mps", rows.iter().map(|row| row.velocity_p_mps))?;
    out.column("cov_m2ps2", rows.iter().map(|row| row.cov_m2ps2))?;
    out.column(
        "observed_velocity_p_mps",
        rows.iter().map(|row| row.observed_velocity_p_mps),
    )?;
    out.column("information_s2pm2", rows.iter().map(|row| row.information_s2pm2))?;
    out.column("component", rows.iter().map(|row| row.component))?;
    out.column("status", rows.iter().map(|row| row.status))?;
    out.put("beams_used", &[count, beams], pings.valid)?;
    out.column("rank", rows.iter().map(|row| row.rank))?;
    out.column("source", rows.iter().map(|row| row.source))?;
    Ok(out)
}

/// Prior velocities and covariances, one per ping, if they are given.
fn priors(velocity: Option<Argument>, cov: Option<Argument>, count: usize) -> PyResult<Option<Vec<VelocityPrior>>> {
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
    fn solve(&self, geometry: &core::BeamGeometry, count: usize) -> Result<Vec<FixRow>, (usize, bottomlock::NavError)> {
        let beams = geometry.beams();
        let solve = |row: usize| {
            let part = row * beams..(row + 1) * beams;
            let valid = mask(&self.valid[part.clone()]);
            let ping = BeamSample::new(0, &self.velocity_mps[part], &self.sd_mps, valid);
            let rate = self.omega_tp_p_radps.as_ref().map(|rates| rates[row]);
            let context = PingContext {
                omega_tp_p_radps: rate.map_or(Vector3::zeros(), Vector3::from),
                prior: self.priors.as_ref().map(|priors| priors[row]),
            };
            let outcome = solve(self.method, geometry, &ping, &context, &self.assumptions);
            outcome
                .map(|outcome| FixRow::from(&outcome))
                .map_err(|error| (row, error))
        };
        (0..count).map(solve).collect()
    }
}
