//! Models and options from their keys.

use bottomlock::aiding::InformationPort;
use bottomlock::aiding::calibration::CalibrationPrior;
use bottomlock::aiding::current_layers::LayersPrior;
use bottomlock::aiding::motion_prior::MotionPrior;
use bottomlock::aiding::outliers::{Robust, Tail};
use bottomlock::aiding::registry::{Levers, SectionReader, SensorKind, SensorModels};
use bottomlock::aiding::sensor::{Numbers, Section};
use bottomlock::aiding::speed_bound::SpeedBound;
use bottomlock::aiding::thrust::ThrustUse;
use bottomlock::aiding::water::WaterPrior;
use bottomlock::dvl::geometry::BeamMask;
use bottomlock::dvl::partial::Assumptions;
use bottomlock::earth::{EarthModel, Environment};
use bottomlock::filter::gate::{Gate, GateTable};
use bottomlock::filter::options::Options;
use bottomlock::frames::{Platform, Rot, Tangent, Vec3};
use bottomlock::mechanisation::Sampling;
use bottomlock::model::{ImuModel, InitialModel, Model};
use bottomlock::navigator::{METHODS, Method};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::vector;
use crate::errors::{invalid, raise};
use crate::imu_faults;
use crate::keys::{Keys, nearest, read};

/// The aiding method of a short name; the error names the nearest one.
pub fn method(py: Python<'_>, name: &str) -> PyResult<Method> {
    Method::named(name).or_else(|error| {
        let known: Vec<_> = METHODS.iter().map(|method| method.name.to_owned()).collect();
        let hint = nearest(py, name, &known)?.map_or(String::new(), |near| format!("; did you mean '{near}'?"));
        Err(invalid(format!("{error}{hint}")))
    })
}

/// Aiding methods of their short names.
pub fn methods(py: Python<'_>, names: &[String]) -> PyResult<Vec<Method>> {
    names.iter().map(|name| method(py, name)).collect()
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
pub fn environment(keys: &Keys<'_>) -> PyResult<Environment> {
    Ok(Environment {
        latitude_rad: keys.number("latitude_rad")?,
        gravity_mps2: keys.number("gravity_mps2")?,
        earth_rate_radps: keys.number("earth_rate_radps")?,
        earth: match keys.text("earth")?.as_str() {
            "ellipsoid" => EarthModel::Ellipsoid,
            "tangent_plane" => EarthModel::TangentPlane,
            other => {
                return Err(invalid(format!(
                    "earth is '{other}', expected 'ellipsoid' or 'tangent_plane'"
                )));
            }
        },
    })
}

/// Errors of the inertial sensors.
pub fn imu(keys: &Keys<'_>) -> PyResult<ImuModel> {
    Ok(ImuModel {
        accel_noise_mps_rts: keys.number("accel_noise_mps_rts")?,
        gyro_noise_rad_rts: keys.number("gyro_noise_rad_rts")?,
        accel_bias_sd_mps2: keys.number("accel_bias_sd_mps2")?,
        gyro_bias_sd_radps: keys.number("gyro_bias_sd_radps")?,
        accel_bias_walk_mps2_rts: keys.number("accel_bias_walk_mps2_rts")?,
        gyro_bias_walk_radps_rts: keys.number("gyro_bias_walk_radps_rts")?,
    })
}

/// Uncertainty of the initial state.
pub fn initial(keys: &Keys<'_>) -> PyResult<InitialModel> {
    Ok(InitialModel {
        position_sd_m: keys.vector("position_sd_m")?,
        attitude_sd_rad: keys.vector("attitude_sd_rad")?,
        velocity_sd_mps: keys.vector("velocity_sd_mps")?,
    })
}

impl Numbers for Keys<'_> {
    type Error = PyErr;
    fn number(&self, key: &'static str) -> PyResult<f64> {
        self.number(key)
    }
    fn number_or(&self, key: &'static str, otherwise: f64) -> PyResult<f64> {
        self.number_or(key, otherwise)
    }
    fn triple(&self, key: &'static str) -> PyResult<[f64; 3]> {
        self.vector(key)
    }
}

/// A model, whose sections are read by their names.
struct ModelKeys<'a, 'py>(&'a Keys<'py>);

impl SectionReader for ModelKeys<'_, '_> {
    type Error = PyErr;
    fn section<S: Section>(&self) -> PyResult<S> {
        if !self.0.has_value(S::NAME)? {
            return Ok(S::default());
        }
        read(S::NAME, &self.0.item(S::NAME)?, |keys| S::read(keys))
    }
}

/// A whole model, checked also where a call has nothing to do with it.
pub fn model(value: &Bound<'_, PyAny>) -> PyResult<Model> {
    let model = read("model", value, |keys| {
        Ok(Model {
            environment: read("environment", &keys.item("environment")?, environment)?,
            imu: read("imu", &keys.item("imu")?, imu)?,
            initial: read("initial", &keys.item("initial")?, initial)?,
            sensors: SensorModels::read(&ModelKeys(keys))?,
        })
    })?;
    model.validate().map_err(raise)?;
    Ok(model)
}

/// The lever arms of the sensors; zero where none is named.
pub fn levers(keys: &Keys<'_>) -> PyResult<Levers> {
    let mut levers = Levers::default();
    for kind in SensorKind::ALL {
        if let Some(key) = kind.declaration().lever {
            levers = levers.with(kind, Vec3::from_array(keys.vector_or_zero(key)?));
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

/// Filter options, checked as [`model`].
pub fn options(value: &Bound<'_, PyAny>) -> PyResult<Options> {
    let options = read("options", value, options_of)?;
    options.validate().map_err(raise)?;
    Ok(options)
}

fn options_of(keys: &Keys<'_>) -> PyResult<Options> {
    let default = Options::default();
    let probability = keys.number("gate_probability")?;
    GateTable::new(Gate::Joint { probability }).map_err(raise)?;
    let gate = match keys.text("gate")?.as_str() {
        "joint" => Gate::Joint { probability },
        "per_row" => Gate::PerRow,
        "off" => Gate::Off,
        other => {
            return Err(invalid(format!(
                "options.gate is '{other}', expected 'joint', 'per_row' or 'off'"
            )));
        }
    };
    let information_port = match keys.text("information_port")?.as_str() {
        "axes" => InformationPort::Axes,
        "full" => InformationPort::Full,
        other => {
            return Err(invalid(format!(
                "options.information_port is '{other}', expected 'axes' or 'full'"
            )));
        }
    };
    Ok(Options {
        gate,
        inflate_after_rejections: if keys.has("inflate_after_rejections")? {
            keys.extract("inflate_after_rejections", "a whole number, 0 or more")?
        } else {
            default.inflate_after_rejections
        },
        robust: match keys.get("robust")? {
            None => default.robust,
            Some(value) if value.is_none() => Robust::default(),
            Some(_) => keys.section("robust", robust)?,
        },
        speed_bound: SpeedBound {
            sd_mps: keys.number_or("speed_sd_mps", default.speed_bound.sd_mps)?,
            time_s: keys.number_or("speed_time_s", default.speed_bound.time_s)?,
        },
        imu_limits: imu_faults::limits(keys)?,
        water_track: keys.has("water_track")? && keys.extract("water_track", "True or False")?,
        thrust: if keys.has("thrust")? {
            thrust_use(&keys.text("thrust")?)?
        } else {
            default.thrust
        },
        current_layers: if keys.has("current_layers")? {
            keys.section("current_layers", current_layers)?
        } else {
            default.current_layers
        },
        water: if keys.has("water")? {
            keys.section("water", water)?
        } else {
            default.water
        },
        calibration: if keys.has("calibration")? {
            keys.section("calibration", calibration)?
        } else {
            default.calibration
        },
        motion: if keys.has("motion")? {
            keys.section("motion", motion)?
        } else {
            default.motion
        },
        covariance_period_ns: keys.extract("covariance_period_ns", "an integer number of nanoseconds")?,
        sampling: sampling(&keys.text("imu_sampling")?)?,
        estimate_dvl: keys.extract("estimate_dvl", "True or False")?,
        assumptions: Assumptions {
            virtual_beam_factor: keys.number("virtual_beam_factor")?,
            nullified_sway_var_m2ps2: keys.number("nullified_sway_var_m2ps2")?,
            weak_sway_var_m2ps2: keys.number("weak_sway_var_m2ps2")?,
        },
        information_port,
        levers: levers(keys)?,
    })
}

/// What the revolutions correct.
fn thrust_use(text: &str) -> PyResult<ThrustUse> {
    let found = ThrustUse::NAMES.into_iter().find(|(_, name)| *name == text);
    found.map(|(used, _)| used).ok_or_else(|| {
        invalid(format!(
            "options.thrust is '{text}', expected 'off', 'velocity' or 'all'"
        ))
    })
}

/// The prior of the motion through the water.
pub fn water(keys: &Keys<'_>) -> PyResult<WaterPrior> {
    Ok(WaterPrior {
        current_sd_mps: keys.number("current_sd_mps")?,
        current_time_s: keys.number("current_time_s")?,
        sway_gain_m: keys.number("sway_gain_m")?,
        sway_gain_sd_m: keys.number("sway_gain_sd_m")?,
        trim_sd_mps: keys.number("trim_sd_mps")?,
        trim_time_s: keys.number("trim_time_s")?,
        slip_sd_mps: keys.number("slip_sd_mps")?,
        slip_time_s: keys.number("slip_time_s")?,
        slip_epochs: keys.number("slip_epochs")?,
    })
}

/// The prior of the current by depth.
pub fn current_layers(keys: &Keys<'_>) -> PyResult<LayersPrior> {
    Ok(LayersPrior {
        sd_mps: keys.number("sd_mps")?,
        time_s: keys.number("time_s")?,
        way_m: keys.number("way_m")?,
        spacing_m: keys.number("spacing_m")?,
        mean_time_s: keys.number("mean_time_s")?,
    })
}

/// The prior of the DVL's mounting and clock.
pub fn calibration(keys: &Keys<'_>) -> PyResult<CalibrationPrior> {
    Ok(CalibrationPrior {
        mounting_sd_rad: keys.vector("mounting_sd_rad")?,
        clock_sd_s: keys.number("clock_sd_s")?,
    })
}

/// Prior of the vehicle's motion.
pub fn motion(keys: &Keys<'_>) -> PyResult<MotionPrior> {
    Ok(MotionPrior {
        mean_sd_mps: keys.vector("mean_sd_mps")?,
        mean_time_s: keys.number("mean_time_s")?,
        change_sd_mps: keys.vector("change_sd_mps")?,
        change_time_s: keys.vector("change_time_s")?,
    })
}

/// Treatment of outliers among the beams; a gate that is None or not given is none.
pub fn robust(keys: &Keys<'_>) -> PyResult<Robust> {
    let degrees = keys.optional_number("student_t_degrees")?;
    let tail = match keys.text("tail")?.as_str() {
        "gaussian" => Tail::Gaussian,
        "student_t" => Tail::StudentT {
            degrees: keys.number("student_t_degrees")?,
        },
        other => {
            return Err(invalid(format!(
                "options.robust.tail is '{other}', expected 'gaussian' or 'student_t'"
            )));
        }
    };
    // The degrees of a tail that is not chosen may be given, and are checked too.
    if let Some(degrees) = degrees {
        let given = Robust {
            tail: Tail::StudentT { degrees },
            ..Robust::default()
        };
        given.validate().map_err(raise)?;
    }
    Ok(Robust {
        closure_gate: keys.optional_number("closure_gate")?,
        beam_gate: keys.optional_number("beam_gate")?,
        tail,
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
    let sampling = match options.sampling {
        Sampling::Instantaneous => "instantaneous",
        Sampling::Averaged => "averaged",
    };
    dict.set_item("imu_sampling", sampling)?;
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
    let layers = PyDict::new(py);
    layers.set_item("sd_mps", options.current_layers.sd_mps)?;
    layers.set_item("time_s", options.current_layers.time_s)?;
    layers.set_item("way_m", options.current_layers.way_m)?;
    layers.set_item("spacing_m", options.current_layers.spacing_m)?;
    layers.set_item("mean_time_s", options.current_layers.mean_time_s)?;
    dict.set_item("current_layers", layers)?;
    let calibration = PyDict::new(py);
    calibration.set_item("mounting_sd_rad", options.calibration.mounting_sd_rad)?;
    calibration.set_item("clock_sd_s", options.calibration.clock_sd_s)?;
    dict.set_item("calibration", calibration)?;
    let motion = PyDict::new(py);
    motion.set_item("mean_sd_mps", options.motion.mean_sd_mps)?;
    motion.set_item("mean_time_s", options.motion.mean_time_s)?;
    motion.set_item("change_sd_mps", options.motion.change_sd_mps)?;
    motion.set_item("change_time_s", options.motion.change_time_s)?;
    dict.set_item("motion", motion)?;
    dict.set_item("water_track", options.water_track)?;
    let name_of = |(used, name)| (used == options.thrust).then_some(name);
    dict.set_item("thrust", ThrustUse::NAMES.into_iter().find_map(name_of))?;
    dict.set_item("speed_sd_mps", options.speed_bound.sd_mps)?;
    dict.set_item("speed_time_s", options.speed_bound.time_s)?;
    imu_faults::put_limits(&dict, &options.imu_limits)?;
    dict.set_item("robust", robust_dict(py, &options.robust)?)?;
    for kind in SensorKind::ALL {
        if let Some(key) = kind.declaration().lever {
            dict.set_item(key, options.levers.of(kind).to_array())?;
        }
    }
    Ok(dict)
}

/// The treatment of outliers, under the keys that [`robust`] reads.
fn robust_dict<'py>(py: Python<'py>, robust: &Robust) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("closure_gate", robust.closure_gate)?;
    dict.set_item("beam_gate", robust.beam_gate)?;
    let mut degrees = Tail::STUDENT_T_DEGREES;
    let tail = match robust.tail {
        Tail::Gaussian => "gaussian",
        Tail::StudentT { degrees: own } => {
            degrees = own;
            "student_t"
        }
    };
    dict.set_item("tail", tail)?;
    dict.set_item("student_t_degrees", degrees)?;
    Ok(dict)
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
