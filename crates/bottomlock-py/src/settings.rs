//! Models and options; their keys are the kernel's.

use bottomlock::dvl::geometry::BeamMask;
use bottomlock::earth::{EarthModel, Environment};
use bottomlock::filter::options::Options;
use bottomlock::frames::{Platform, Rot, Tangent};
use bottomlock::mechanisation::Sampling;
use bottomlock::model::Model;
use bottomlock::navigator::Method;
use bottomlock::settings as core;
use serde::de::value::{Error, StrDeserializer};
use serde::de::{DeserializeOwned, IntoDeserializer};

use crate::arrays::vector;
use crate::given::Given;
use crate::prelude::*;
use crate::state;

/// The aiding method of a short name.
pub fn method(name: &str) -> PyResult<Method> {
    Method::named(name).map_err(raise)
}

/// Aiding methods by their short names, or as classes of one's own.
pub fn methods(values: Argument) -> PyResult<Vec<Method>> {
    let arguments = values.py().import("bottomlock.arguments")?;
    let names: Vec<String> = arguments.call_method1("method_names", (values,))?.extract()?;
    names.iter().map(|name| method(name)).collect()
}

/// A unit quaternion, scalar first.
pub fn attitude(name: &str, value: Argument) -> PyResult<Rot<Tangent, Platform>> {
    Rot::from_unit_wxyz(name, vector(name, value)?).map_err(raise)
}

/// A whole model, checked also where a call has nothing to do with it.
pub fn model(value: Argument) -> PyResult<Model> {
    core::model(Given(value.clone())).map_err(raise)
}

/// Filter options, checked as [`model`].
pub fn options(value: Argument) -> PyResult<Options> {
    core::options(Given(value.clone())).map_err(raise)
}

/// A part of the settings, such as the section "imu" of a model; its numbers are not checked yet.
pub fn part<T: DeserializeOwned>(place: &str, value: Argument) -> PyResult<T> {
    core::read(place, Given(value.clone())).map_err(raise)
}

/// What an IMU sample means.
pub fn sampling(name: &str) -> PyResult<Sampling> {
    let name: StrDeserializer<'_, Error> = name.into_deserializer();
    core::read("imu_sampling", name).map_err(raise)
}

/// Checks settings by the kernel's rules: "model", the section of a model by its name, "options", a section of them as
/// "options.water", or "initial_state".
///
/// Raises KernelError, which names the key and what was expected.
#[pyfunction]
pub fn check_settings(place: &str, values: Argument) -> PyResult<()> {
    if place == "initial_state" {
        return state::state(place, values)?.validate().map_err(raise);
    }
    core::check(place, Given(values.clone())).map_err(raise)
}

/// The kernel's default options: the one place where they are stated.
pub fn default_options(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let text = serde_json::to_string(&Options::default()).map_err(|error| invalid(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// A mask from its flags.
pub fn mask(flags: &[bool]) -> BeamMask {
    (0..flags.len()).filter(|&beam| flags[beam]).collect()
}

/// Deeper than any sea, m; the gradient of gravity holds as far.
const DEEPEST_M: f64 = 12_000.0;

/// Normal gravity at a latitude and depth, m/s² (Somigliana's formula with WGS 84, plus 2.226e-6 1/s² times depth).
#[pyfunction]
#[pyo3(signature = (latitude_rad, depth_m=0.0))]
pub fn normal_gravity_mps2(latitude_rad: f64, depth_m: f64) -> PyResult<f64> {
    if !(depth_m.abs() <= DEEPEST_M) {
        return Err(invalid(format!(
            "depth_m is {depth_m:e}, expected at most 12 km down or up: is it in mm or cm?"
        )));
    }
    let gravity = bottomlock::earth::normal_gravity_mps2(latitude_rad, depth_m);
    Environment {
        latitude_rad,
        gravity_mps2: gravity,
        earth_rate_radps: 0.0,
        earth: EarthModel::TangentPlane,
    }
    .validate()
    .map_err(raise)?;
    Ok(gravity)
}
