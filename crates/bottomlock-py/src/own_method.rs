//! Methods in Python: a callable that turns a ping into rows.

use bottomlock::aiding::MAX_ROWS;
use bottomlock::layout::DIM;
use bottomlock::navigator::own_method::{BeamMethod, Measured, MeasuredRows, PingBeams, PingPrior, register};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{array, floats, vector};
use crate::errors::{invalid, raise_timeless};

/// Registers a method: a name of its own for scenarios, replays and navigators.
///
/// `call` gets a dict of arrays for each ping and returns None, a velocity with its covariance ((3,), (3, 3)), or rows
/// ((m,), (m, 20), (m, m)); `bottomlock.own_method` makes it from a class. It is called with the GIL, on the kernel's threads.
/// `label` names it in messages beside its name. A method of that name from before is replaced. Raises KernelError for a
/// name of a built-in method, and one that is not lower-case letters, digits and underscores.
#[pyfunction]
pub fn register_method(name: &str, label: String, call: Py<PyAny>) -> PyResult<()> {
    register(name, Box::new(Callable { label, call }))
        .map(|_| ())
        .map_err(raise_timeless)
}

struct Callable {
    label: String,
    call: Py<PyAny>,
}

impl BeamMethod for Callable {
    fn ping(&self, beams: &PingBeams<'_>, prior: &PingPrior<'_>) -> Result<Measured, String> {
        Python::attach(|py| {
            let outcome = ping_dict(py, beams, prior).and_then(|ping| self.call.bind(py).call1((ping,)));
            outcome
                .and_then(|returned| measured(&returned))
                .map_err(|error| one_line(py, &error))
        })
    }

    fn label(&self) -> &str {
        &self.label
    }
}

/// The words of an exception, with its class unless it is one of ours.
fn one_line(py: Python<'_>, error: &PyErr) -> String {
    let text = error.value(py).to_string();
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if error.is_instance_of::<crate::errors::KernelError>(py) {
        return text;
    }
    let class = error
        .get_type(py)
        .name()
        .map_or_else(|_| "exception".into(), |name| name.to_string());
    format!("{class}: {text}")
}

/// What a method is told.
fn ping_dict<'py>(py: Python<'py>, beams: &PingBeams<'_>, prior: &PingPrior<'_>) -> PyResult<Bound<'py, PyDict>> {
    let valid: Vec<usize> = beams.ping.valid.iter().collect();
    let count = valid.len();
    let (terms, state) = (beams.terms, prior.state);
    let pick = |of: &dyn Fn(usize) -> Vec<f64>| valid.iter().flat_map(|&beam| of(beam)).collect::<Vec<f64>>();
    let out = PyDict::new(py);
    let put = |name: &str, values: Vec<f64>, shape: &[usize]| out.set_item(name, array(py, values, shape)?);
    let numbers: Vec<i64> = valid.iter().map(|&beam| beam as i64).collect();
    out.set_item("time_ns", beams.ping.time_ns)?;
    out.set_item("number", array(py, numbers, &[count])?)?;
    put(
        "reading_mps",
        pick(&|beam| vec![beams.ping.velocity_mps[beam]]),
        &[count],
    )?;
    let directions = pick(&|beam| beams.geometry.direction_p(beam).as_slice().to_vec());
    put("directions_p", directions, &[count, 3])?;
    put("residual_mps", pick(&|beam| vec![terms.residual[beam]]), &[count])?;
    let jacobian = pick(&|beam| terms.jacobian.row(beam).iter().copied().collect());
    put("jacobian", jacobian, &[count, DIM])?;
    let noise = pick(&|beam| valid.iter().map(|&other| terms.noise[(beam, other)]).collect());
    put("noise_m2ps2", noise, &[count, count])?;
    put("velocity_p_mps", state.velocity_p_mps.to_array().to_vec(), &[3])?;
    put("position_t_m", state.position_t_m.to_array().to_vec(), &[3])?;
    put("attitude_t_p", state.attitude_t_p.to_quaternion_wxyz().to_vec(), &[4])?;
    put(
        "dvl_bias_mps",
        state.dvl_bias_mps.as_slice().to_vec(),
        &[state.dvl_bias_mps.len()],
    )?;
    out.set_item("dvl_scale_factor", state.dvl_scale_factor)?;
    put("omega_tp_p_radps", prior.omega_tp_p_radps.as_slice().to_vec(), &[3])?;
    // A covariance is symmetric, so its columns are its rows.
    put("covariance", prior.covariance.as_slice().to_vec(), &[DIM, DIM])?;
    Ok(out)
}

/// What a method returned.
fn measured(returned: &Bound<'_, PyAny>) -> PyResult<Measured> {
    if returned.is_none() {
        return Ok(Measured::Nothing);
    }
    let parts = returned.cast::<PyTuple>().map_err(|_| invalid("returned no tuple"))?;
    match parts.len() {
        2 => {
            let velocity: [f64; 3] = vector("velocity_p_mps", &parts.get_item(0)?)?;
            let cov = floats("cov_m2ps2", &parts.get_item(1)?, &[Some(3), Some(3)])?;
            Ok(Measured::Fix {
                velocity_p_mps: Vector3::from(velocity),
                cov_m2ps2: Matrix3::from_row_slice(&cov.values),
            })
        }
        3 => rows(parts).map(Measured::Rows),
        count => Err(invalid(format!("returned {count} values, expected 2 or 3"))),
    }
}

fn rows(parts: &Bound<'_, PyTuple>) -> PyResult<MeasuredRows> {
    let residual = floats("residual", &parts.get_item(0)?, &[None])?;
    let count = residual.shape[0];
    let jacobian = floats("jacobian", &parts.get_item(1)?, &[Some(count), Some(DIM)])?;
    let noise = floats("noise", &parts.get_item(2)?, &[Some(count), Some(count)])?;
    let within = |row: usize, column: usize| row < count && column < count;
    Ok(MeasuredRows {
        rows: count,
        residual: SVector::from_fn(|row, _| residual.values.get(row).copied().unwrap_or(0.0)),
        jacobian: SMatrix::from_fn(|row, k| jacobian.values.get(row * DIM + k).copied().unwrap_or(0.0)),
        noise: SMatrix::<f64, MAX_ROWS, MAX_ROWS>::from_fn(|row, column| {
            if within(row, column) {
                noise.values[row * count + column]
            } else {
                0.0
            }
        }),
    })
}
