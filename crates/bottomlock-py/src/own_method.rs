//! Methods in Python: a callable that turns a ping into rows.

use bottomlock::layout::DIM;
use bottomlock::navigator::own_method::{BeamMethod, Measured, MeasuredRows, PingBeams, PingPrior, register};
use nalgebra::{Matrix3, Vector3};
use pyo3::types::PyTuple;

use crate::arrays::{floats, vector};
use crate::errors::raise_timeless;
use crate::prelude::*;

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
            let returned = ping_dict(py, beams, prior).and_then(|ping| self.call.bind(py).call1((ping,)));
            let measured = returned.and_then(|returned| measured(&returned));
            measured.map_err(|error| one_line(py, &error))
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
    let class = error.get_type(py).name();
    let class = class.map_or_else(|_| "exception".into(), |name| name.to_string());
    format!("{class}: {text}")
}

/// What a method is told.
fn ping_dict<'py>(py: Python<'py>, beams: &PingBeams<'_>, prior: &PingPrior<'_>) -> Dict<'py> {
    let valid: Vec<usize> = beams.ping.valid.iter().collect();
    let each = || valid.iter().copied();
    let (terms, count) = (beams.terms, valid.len());
    let out = PyDict::new(py);
    out.set_item("time_ns", beams.ping.time_ns)?;
    out.column("number", each().map(|beam| beam as i64))?;
    out.column("reading_mps", each().map(|beam| beams.ping.velocity_mps[beam]))?;
    out.column("directions_p", each().map(|beam| *beams.geometry.direction_p(beam)))?;
    out.column("residual_mps", each().map(|beam| terms.residual[beam]))?;
    out.column("jacobian", each().map(|beam| terms.jacobian.row(beam).transpose()))?;
    let noise = each().flat_map(|beam| each().map(move |other| terms.noise[(beam, other)]));
    out.put("noise_m2ps2", &[count, count], noise)?;
    fields! { out, prior.state => position_t_m, attitude_t_p, velocity_p_mps, dvl_bias_mps, dvl_scale_factor }
    out.entry("omega_tp_p_radps", prior.omega_tp_p_radps)?;
    out.entry("covariance", *prior.covariance)?;
    Ok(out)
}

/// What a method returned.
fn measured(returned: Argument) -> PyResult<Measured> {
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
    Ok(MeasuredRows::of(&residual.values, &jacobian.values, &noise.values))
}
