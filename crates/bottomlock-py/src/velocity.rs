//! Velocity from beams.

use bottomlock::dvl::fix::{PingContext, VelocityPrior, solve};
use bottomlock::dvl::fix_row::FixRow;
use bottomlock::dvl::partial::{Assumptions, PartialMethod};
use bottomlock::frames::Vec3;
use nalgebra::{Matrix3, Vector3};

use crate::arrays::{floats, rows};
use crate::beam_arrays::BeamArrays;
use crate::calls::detached;
use crate::prelude::*;

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
    let names = ["velocity_mps", "valid", ""];
    let mut readings = BeamArrays::new(names, velocity_mps, valid, None, &[None, Some(beams)])?;
    let count = readings.valid.len() / beams;
    let sd_shape = &[Some(beams)][..usize::from(beam_sd_mps.len().is_ok())];
    let sd_mps = floats("beam_sd_mps", beam_sd_mps, sd_shape)?.values;
    readings.sd_mps = sd_mps.repeat(count * beams / sd_mps.len());
    let method = PartialMethod::named(method).map_err(raise)?;
    let priors = priors(prior_velocity_p_mps, prior_cov_m2ps2, count)?;
    let rates = omega_tp_p_radps.map(|value| rows::<3>("omega_tp_p_radps", value, Some(count)));
    let rates = rates.transpose()?;
    let assumptions = Assumptions {
        virtual_beam_factor,
        nullified_sway_var_m2ps2,
        weak_sway_var_m2ps2,
        ..Assumptions::default()
    };
    let solve_row = |row: usize| {
        let context = PingContext {
            omega_tp_p_radps: rates.as_ref().map_or(Vector3::zeros(), |rates| rates[row].into()),
            prior: priors.as_ref().map(|priors| priors[row]),
        };
        let outcome = solve(method, &geometry, &readings.ping(0, row, beams), &context, &assumptions);
        outcome
            .as_ref()
            .map(FixRow::from)
            .map_err(|error| (row, error.timeless()))
    };
    let rows = detached(py, || Ok((0..count).map(solve_row).collect::<Result<Vec<_>, _>>()))?;
    let rows = rows.map_err(|(row, error)| invalid(format!("row {row}: {error}")))?;
    let out = PyDict::new(py);
    columns! { out, &[count], rows.iter() => velocity_p_mps, cov_m2ps2, observed_velocity_p_mps, information_s2pm2 }
    columns! { out, &[count], rows.iter() => component, rank, source }
    out.column("status", rows.iter().map(|row| row.fix as u8))?;
    out.put("beams_used", &[count, beams], readings.valid)?;
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
