//! Models and options from dicts.

use bottomlock::aiding::InformationPort;
use bottomlock::aiding::outliers::{Robust, Tail};
use bottomlock::aiding::registry::{Levers, SectionReader, SensorKind, SensorModels};
use bottomlock::aiding::sensor::{Numbers, Section};
use bottomlock::aiding::speed_bound::SpeedBound;
use bottomlock::aiding::water::WaterPrior;
use bottomlock::dvl::geometry::BeamMask;
use bottomlock::dvl::partial::Assumptions;
use bottomlock::earth::Environment;
use bottomlock::filter::gate::{Gate, GateTable};
use bottomlock::filter::options::Options;
use bottomlock::frames::{Platform, Rot, Tangent, Vec3};
use bottomlock::mechanisation::Sampling;
use bottomlock::model::{ImuModel, InitialModel, Model};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{item, vector};
use crate::errors::{invalid, raise};

fn section<'py>(dict: &Bound<'py, PyDict>, owner: &str, key: &str) -> PyResult<Bound<'py, PyDict>> {
    item(dict, owner, key)?
        .cast_into::<PyDict>()
        .map_err(|_| invalid(format!("{owner}.{key} is not a dict")))
}

fn number(dict: &Bound<'_, PyDict>, owner: &str, key: &str) -> PyResult<f64> {
    item(dict, owner, key)?
        .extract()
        .map_err(|_| invalid(format!("{owner}.{key} is not a number")))
}

fn text(dict: &Bound<'_, PyDict>, owner: &str, key: &str) -> PyResult<String> {
    item(dict, owner, key)?
        .extract()
        .map_err(|_| invalid(format!("{owner}.{key} is not a text")))
}

fn triple(dict: &Bound<'_, PyDict>, owner: &str, key: &str) -> PyResult<[f64; 3]> {
    vector(&format!("{owner}.{key}"), &item(dict, owner, key)?)
}

/// A unit quaternion, scalar first.
pub fn attitude(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Rot<Tangent, Platform>> {
    let quaternion: [f64; 4] = vector(name, value)?;
    let norm = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !((norm - 1.0).abs() < 1e-6) {
        return Err(invalid(format!("{name} has norm {norm}, expected 1 (scalar first)")));
    }
    Ok(Rot::from_quaternion_wxyz(quaternion))
}

/// The environment of a model.
pub fn environment(dict: &Bound<'_, PyDict>) -> PyResult<Environment> {
    Ok(Environment {
        latitude_rad: number(dict, "environment", "latitude_rad")?,
        gravity_mps2: number(dict, "environment", "gravity_mps2")?,
        earth_rate_radps: number(dict, "environment", "earth_rate_radps")?,
    })
}

/// A section of a model, whose numbers are read by their keys.
struct SectionDict<'py> {
    dict: Bound<'py, PyDict>,
    name: &'static str,
}

impl Numbers for SectionDict<'_> {
    type Error = PyErr;
    fn number(&self, key: &'static str) -> PyResult<f64> {
        number(&self.dict, self.name, key)
    }
    fn triple(&self, key: &'static str) -> PyResult<[f64; 3]> {
        triple(&self.dict, self.name, key)
    }
}

/// A model, whose sections are read by their names.
struct ModelDict<'a, 'py>(&'a Bound<'py, PyDict>);

impl SectionReader for ModelDict<'_, '_> {
    type Error = PyErr;
    fn section<S: Section>(&self) -> PyResult<S> {
        if S::OPTIONAL && !self.0.contains(S::NAME)? {
            return Ok(S::default());
        }
        S::read(&SectionDict {
            dict: section(self.0, "model", S::NAME)?,
            name: S::NAME,
        })
    }
}

/// A whole model.
pub fn model(dict: &Bound<'_, PyDict>) -> PyResult<Model> {
    let part = |key| section(dict, "model", key);
    let (imu, initial) = (part("imu")?, part("initial")?);
    Ok(Model {
        environment: environment(&part("environment")?)?,
        imu: ImuModel {
            accel_noise_mps_rts: number(&imu, "imu", "accel_noise_mps_rts")?,
            gyro_noise_rad_rts: number(&imu, "imu", "gyro_noise_rad_rts")?,
            accel_bias_sd_mps2: number(&imu, "imu", "accel_bias_sd_mps2")?,
            gyro_bias_sd_radps: number(&imu, "imu", "gyro_bias_sd_radps")?,
            accel_bias_walk_mps2_rts: number(&imu, "imu", "accel_bias_walk_mps2_rts")?,
            gyro_bias_walk_radps_rts: number(&imu, "imu", "gyro_bias_walk_radps_rts")?,
        },
        initial: InitialModel {
            position_sd_m: triple(&initial, "initial", "position_sd_m")?,
            attitude_sd_rad: triple(&initial, "initial", "attitude_sd_rad")?,
            velocity_sd_mps: triple(&initial, "initial", "velocity_sd_mps")?,
        },
        sensors: SensorModels::read(&ModelDict(dict))?,
    })
}

/// The lever arms of the sensors; zero where a dict names none.
pub fn levers(dict: &Bound<'_, PyDict>, owner: &str) -> PyResult<Levers> {
    let mut levers = Levers::default();
    for kind in SensorKind::ALL {
        if let Some(key) = kind.declaration().lever
            && dict.contains(key)?
        {
            levers = levers.with(kind, Vec3::from_array(triple(dict, owner, key)?));
        }
    }
    Ok(levers)
}

/// What an IMU sample means.
pub fn sampling(name: &str) -> PyResult<Sampling> {
    match name {
        "instantaneous" => Ok(Sampling::Instantaneous),
        "averaged" => Ok(Sampling::Averaged),
        other => Err(invalid(format!(
            "imu_sampling is '{other}', expected 'instantaneous' or 'averaged'"
        ))),
    }
}

/// Filter options.
pub fn options(dict: &Bound<'_, PyDict>) -> PyResult<Options> {
    let probability = number(dict, "options", "gate_probability")?;
    GateTable::new(Gate::Joint { probability }).map_err(raise)?;
    let gate = match text(dict, "options", "gate")?.as_str() {
        "joint" => Gate::Joint { probability },
        "per_row" => Gate::PerRow,
        "off" => Gate::Off,
        other => {
            return Err(invalid(format!(
                "options.gate is '{other}', expected 'joint', 'per_row' or 'off'"
            )));
        }
    };
    let information_port = match text(dict, "options", "information_port")?.as_str() {
        "axes" => InformationPort::Axes,
        "full" => InformationPort::Full,
        other => {
            return Err(invalid(format!(
                "options.information_port is '{other}', expected 'axes' or 'full'"
            )));
        }
    };
    let water = match dict.get_item("water")? {
        None => WaterPrior::default(),
        Some(_) => {
            let water = section(dict, "options", "water")?;
            let of = |key| number(&water, "options.water", key);
            WaterPrior {
                current_sd_mps: of("current_sd_mps")?,
                current_time_s: of("current_time_s")?,
                sway_gain_m: of("sway_gain_m")?,
                sway_gain_sd_m: of("sway_gain_sd_m")?,
                trim_sd_mps: of("trim_sd_mps")?,
                trim_time_s: of("trim_time_s")?,
                slip_sd_mps: of("slip_sd_mps")?,
                slip_time_s: of("slip_time_s")?,
                slip_epochs: of("slip_epochs")?,
            }
        }
    };
    let inflate_after_rejections = match dict.get_item("inflate_after_rejections")? {
        None => Options::default().inflate_after_rejections,
        Some(fixes) => fixes
            .extract()
            .map_err(|_| invalid("options.inflate_after_rejections is not a whole number, 0 or more"))?,
    };
    Ok(Options {
        gate,
        inflate_after_rejections,
        robust: robust(dict)?,
        speed_bound: speed_bound(dict)?,
        water,
        covariance_period_ns: item(dict, "options", "covariance_period_ns")?
            .extract()
            .map_err(|_| invalid("options.covariance_period_ns is not an integer number of nanoseconds"))?,
        sampling: sampling(&text(dict, "options", "imu_sampling")?)?,
        estimate_dvl: item(dict, "options", "estimate_dvl")?
            .extract()
            .map_err(|_| invalid("options.estimate_dvl is not True or False"))?,
        assumptions: Assumptions {
            virtual_beam_factor: number(dict, "options", "virtual_beam_factor")?,
            nullified_sway_var_m2ps2: number(dict, "options", "nullified_sway_var_m2ps2")?,
            weak_sway_var_m2ps2: number(dict, "options", "weak_sway_var_m2ps2")?,
        },
        information_port,
        levers: levers(dict, "options")?,
    })
}

/// The kernel's default options, under the keys that [`options`] reads: the one place where they are stated.
pub fn default_options(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let options = Options::default();
    let dict = PyDict::new(py);
    let (gate, probability) = match options.gate {
        Gate::Joint { probability } => ("joint", Some(probability)),
        Gate::PerRow => ("per_row", None),
        Gate::Off => ("off", None),
    };
    dict.set_item("gate", gate)?;
    dict.set_item("gate_probability", probability)?;
    dict.set_item("inflate_after_rejections", options.inflate_after_rejections)?;
    dict.set_item("covariance_period_ns", options.covariance_period_ns)?;
    dict.set_item("estimate_dvl", options.estimate_dvl)?;
    dict.set_item("virtual_beam_factor", options.assumptions.virtual_beam_factor)?;
    dict.set_item("nullified_sway_var_m2ps2", options.assumptions.nullified_sway_var_m2ps2)?;
    dict.set_item("weak_sway_var_m2ps2", options.assumptions.weak_sway_var_m2ps2)?;
    let port = match options.information_port {
        InformationPort::Axes => "axes",
        InformationPort::Full => "full",
    };
    dict.set_item("information_port", port)?;
    let water = PyDict::new(py);
    water.set_item("current_sd_mps", options.water.current_sd_mps)?;
    water.set_item("current_time_s", options.water.current_time_s)?;
    water.set_item("sway_gain_m", options.water.sway_gain_m)?;
    water.set_item("sway_gain_sd_m", options.water.sway_gain_sd_m)?;
    water.set_item("trim_sd_mps", options.water.trim_sd_mps)?;
    water.set_item("trim_time_s", options.water.trim_time_s)?;
    water.set_item("slip_sd_mps", options.water.slip_sd_mps)?;
    water.set_item("slip_time_s", options.water.slip_time_s)?;
    water.set_item("slip_epochs", options.water.slip_epochs)?;
    dict.set_item("water", water)?;
    dict.set_item("speed_sd_mps", options.speed_bound.sd_mps)?;
    dict.set_item("speed_time_s", options.speed_bound.time_s)?;
    dict.set_item("robust", robust_dict(py, &options.robust)?)?;
    Ok(dict)
}

/// The bound on the speed; none where the options do not name it.
fn speed_bound(options: &Bound<'_, PyDict>) -> PyResult<SpeedBound> {
    let mut bound = SpeedBound::default();
    if options.contains("speed_sd_mps")? {
        bound.sd_mps = number(options, "options", "speed_sd_mps")?;
    }
    if options.contains("speed_time_s")? {
        bound.time_s = number(options, "options", "speed_time_s")?;
    }
    Ok(bound)
}

/// The treatment of outliers, under the keys that [`robust`] reads.
fn robust_dict<'py>(py: Python<'py>, robust: &Robust) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("closure_gate", robust.closure_gate)?;
    dict.set_item("beam_gate", robust.beam_gate)?;
    match robust.tail {
        Tail::Gaussian => dict.set_item("tail", "gaussian")?,
        Tail::StudentT { degrees } => {
            dict.set_item("tail", "student_t")?;
            dict.set_item("student_t_degrees", degrees)?;
        }
        Tail::Huber { threshold } => {
            dict.set_item("tail", "huber")?;
            dict.set_item("huber_threshold", threshold)?;
        }
    }
    Ok(dict)
}

/// Treatment of outliers among the beams: the recommended one where the options do not name it, none for `None`.
fn robust(options: &Bound<'_, PyDict>) -> PyResult<Robust> {
    match options.get_item("robust")? {
        None => return Ok(Options::default().robust),
        Some(value) if value.is_none() => return Ok(Robust::default()),
        Some(_) => {}
    }
    let dict = section(options, "options", "robust")?;
    let gate = |key: &str| -> PyResult<Option<f64>> {
        match dict.get_item(key)? {
            Some(value) if !value.is_none() => number(&dict, "options.robust", key).map(Some),
            _ => Ok(None),
        }
    };
    let of = |key| number(&dict, "options.robust", key);
    let tail = match text(&dict, "options.robust", "tail")?.as_str() {
        "gaussian" => Tail::Gaussian,
        "student_t" => Tail::StudentT {
            degrees: of("student_t_degrees")?,
        },
        "huber" => Tail::Huber {
            threshold: of("huber_threshold")?,
        },
        other => {
            return Err(invalid(format!(
                "options.robust.tail is '{other}', expected 'gaussian', 'student_t' or 'huber'"
            )));
        }
    };
    Ok(Robust {
        closure_gate: gate("closure_gate")?,
        beam_gate: gate("beam_gate")?,
        tail,
    })
}

/// A mask from its flags.
pub fn mask(flags: &[bool]) -> BeamMask {
    flags
        .iter()
        .enumerate()
        .filter(|(_, flag)| **flag)
        .map(|(beam, _)| beam)
        .collect()
}

/// Normal gravity at a latitude and depth, m/s² (Somigliana's formula with WGS 84, plus 2.226e-6 1/s² times depth).
#[pyfunction]
#[pyo3(signature = (latitude_rad, depth_m=0.0))]
pub fn normal_gravity_mps2(latitude_rad: f64, depth_m: f64) -> PyResult<f64> {
    let gravity = bottomlock::earth::normal_gravity_mps2(latitude_rad, depth_m);
    Environment {
        latitude_rad,
        gravity_mps2: gravity,
        earth_rate_radps: 0.0,
    }
    .validate()
    .map_err(raise)?;
    Ok(gravity)
}
