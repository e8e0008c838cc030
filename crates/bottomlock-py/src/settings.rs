//! Models, options and schedules from dicts.

use bottomlock::aiding::InformationPort;
use bottomlock::aiding::outliers::{Robust, Tail};
use bottomlock::aiding::water::WaterPrior;
use bottomlock::dvl::geometry::BeamMask;
use bottomlock::dvl::partial::Assumptions;
use bottomlock::earth::Environment;
use bottomlock::filter::gate::Gate;
use bottomlock::filter::options::Options;
use bottomlock::frames::{Platform, Rot, Tangent, Vec3};
use bottomlock::mechanisation::Sampling;
use bottomlock::model::{DepthModel, DvlModel, GpsModel, ImuModel, InitialModel, MagnetometerModel, Model};
use bottomlock::simulation::schedule::Schedule;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{booleans, floats, item, times, vector};
use crate::errors::refuse;

fn section<'py>(dict: &Bound<'py, PyDict>, owner: &str, key: &str) -> PyResult<Bound<'py, PyDict>> {
    item(dict, owner, key)?
        .cast_into::<PyDict>()
        .map_err(|_| refuse(format!("{owner}.{key} is not a dict")))
}

fn number(dict: &Bound<'_, PyDict>, owner: &str, key: &str) -> PyResult<f64> {
    item(dict, owner, key)?
        .extract()
        .map_err(|_| refuse(format!("{owner}.{key} is not a number")))
}

fn text(dict: &Bound<'_, PyDict>, owner: &str, key: &str) -> PyResult<String> {
    item(dict, owner, key)?
        .extract()
        .map_err(|_| refuse(format!("{owner}.{key} is not a text")))
}

fn triple(dict: &Bound<'_, PyDict>, owner: &str, key: &str) -> PyResult<[f64; 3]> {
    vector(&format!("{owner}.{key}"), &item(dict, owner, key)?)
}

/// A unit quaternion, scalar first.
pub fn attitude(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Rot<Tangent, Platform>> {
    let quaternion: [f64; 4] = vector(name, value)?;
    let norm = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !((norm - 1.0).abs() < 1e-6) {
        return Err(refuse(format!("{name} has norm {norm}, expected 1 (scalar first)")));
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

/// A whole model.
pub fn model(dict: &Bound<'_, PyDict>) -> PyResult<Model> {
    let part = |key| section(dict, "model", key);
    let (imu, dvl, initial) = (part("imu")?, part("dvl")?, part("initial")?);
    let (depth, magnetometer, gps) = (part("depth")?, part("magnetometer")?, part("gps")?);
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
        dvl: DvlModel {
            beam_noise_sd_mps: number(&dvl, "dvl", "beam_noise_sd_mps")?,
            beam_bias_sd_mps: number(&dvl, "dvl", "beam_bias_sd_mps")?,
            beam_bias_walk_mps_rts: number(&dvl, "dvl", "beam_bias_walk_mps_rts")?,
            scale_factor_sd: number(&dvl, "dvl", "scale_factor_sd")?,
            scale_factor_walk_rts: number(&dvl, "dvl", "scale_factor_walk_rts")?,
        },
        initial: InitialModel {
            position_sd_m: triple(&initial, "initial", "position_sd_m")?,
            attitude_sd_rad: triple(&initial, "initial", "attitude_sd_rad")?,
            velocity_sd_mps: triple(&initial, "initial", "velocity_sd_mps")?,
        },
        depth: DepthModel {
            sd_m: number(&depth, "depth", "sd_m")?,
        },
        magnetometer: MagnetometerModel {
            yaw_sd_rad: number(&magnetometer, "magnetometer", "yaw_sd_rad")?,
            roll_pitch_sd_rad: number(&magnetometer, "magnetometer", "roll_pitch_sd_rad")?,
        },
        gps: GpsModel {
            position_sd_m: triple(&gps, "gps", "position_sd_m")?,
            velocity_sd_mps: triple(&gps, "gps", "velocity_sd_mps")?,
        },
    })
}

/// What an IMU sample means.
pub fn sampling(name: &str) -> PyResult<Sampling> {
    match name {
        "instantaneous" => Ok(Sampling::Instantaneous),
        "averaged" => Ok(Sampling::Averaged),
        other => Err(refuse(format!(
            "imu_sampling is '{other}', expected 'instantaneous' or 'averaged'"
        ))),
    }
}

/// Filter options.
pub fn options(dict: &Bound<'_, PyDict>) -> PyResult<Options> {
    let probability = number(dict, "options", "gate_probability")?;
    let gate = match text(dict, "options", "gate")?.as_str() {
        "joint" => Gate::Joint { probability },
        "per_row" => Gate::PerRow,
        "off" => Gate::Off,
        other => {
            return Err(refuse(format!(
                "options.gate is '{other}', expected 'joint', 'per_row' or 'off'"
            )));
        }
    };
    let information_port = match text(dict, "options", "information_port")?.as_str() {
        "axes" => InformationPort::Axes,
        "full" => InformationPort::Full,
        other => {
            return Err(refuse(format!(
                "options.information_port is '{other}', expected 'axes' or 'full'"
            )));
        }
    };
    let lever = |key: &str| -> PyResult<_> {
        if dict.contains(key)? {
            triple(dict, "options", key).map(Vec3::from_array)
        } else {
            Ok(Vec3::zeros())
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
            .map_err(|_| refuse("options.inflate_after_rejections is not a whole number, 0 or more"))?,
    };
    Ok(Options {
        gate,
        inflate_after_rejections,
        robust: robust(dict)?,
        water,
        covariance_period_ns: item(dict, "options", "covariance_period_ns")?
            .extract()
            .map_err(|_| refuse("options.covariance_period_ns is not an integer number of nanoseconds"))?,
        sampling: sampling(&text(dict, "options", "imu_sampling")?)?,
        estimate_dvl: item(dict, "options", "estimate_dvl")?
            .extract()
            .map_err(|_| refuse("options.estimate_dvl is not True or False"))?,
        assumptions: Assumptions {
            virtual_beam_factor: number(dict, "options", "virtual_beam_factor")?,
            nullified_sway_var_m2ps2: number(dict, "options", "nullified_sway_var_m2ps2")?,
            weak_sway_var_m2ps2: number(dict, "options", "weak_sway_var_m2ps2")?,
        },
        information_port,
        depth_lever_p_m: lever("depth_lever_p_m")?,
        gps_lever_p_m: lever("gps_lever_p_m")?,
    })
}

/// What is done against outliers among the beams; nothing where the options say nothing.
fn robust(options: &Bound<'_, PyDict>) -> PyResult<Robust> {
    if options.get_item("robust")?.is_none_or(|value| value.is_none()) {
        return Ok(Robust::default());
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
            return Err(refuse(format!(
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

/// Epochs of all sensors, owned.
pub struct OwnedSchedule {
    pub dvl_time_ns: Vec<i64>,
    pub beam_valid: PerRun<BeamMask>,
    pub depth_time_ns: Vec<i64>,
    pub depth_offset_m: PerRun<f64>,
    pub magnetometer_time_ns: Vec<i64>,
    pub yaw_offset_rad: PerRun<f64>,
    /// Of every run, or one for all.
    pub gps_time_ns: Vec<Vec<i64>>,
    pub sample_time_ns: Vec<i64>,
}

impl OwnedSchedule {
    /// What one run meets.
    pub fn of(&self, run: usize) -> Schedule<'_> {
        Schedule {
            dvl_time_ns: &self.dvl_time_ns,
            beam_valid: self.beam_valid.of(run),
            depth_time_ns: &self.depth_time_ns,
            depth_offset_m: self.depth_offset_m.of(run),
            magnetometer_time_ns: &self.magnetometer_time_ns,
            yaw_offset_rad: self.yaw_offset_rad.of(run),
            gps_time_ns: &self.gps_time_ns[run.min(self.gps_time_ns.len() - 1)],
        }
    }
}

/// Values of each epoch, the same for every run or each run's own.
pub struct PerRun<T> {
    values: Vec<T>,
    epochs: usize,
    by_run: bool,
}

impl<T> PerRun<T> {
    /// The values of one run.
    pub fn of(&self, run: usize) -> &[T] {
        if self.by_run {
            &self.values[run * self.epochs..(run + 1) * self.epochs]
        } else {
            &self.values
        }
    }
}

/// The shape (epochs, ..) or (runs, epochs, ..) of values that may differ by run.
fn per_run_shape(value: &Bound<'_, PyAny>, runs: usize, of_one: &[Option<usize>]) -> (bool, Vec<Option<usize>>) {
    let dimensions: usize = value.getattr("ndim").and_then(|n| n.extract()).unwrap_or(of_one.len());
    let by_run = dimensions == of_one.len() + 1;
    let leading = by_run.then_some(Some(runs));
    (by_run, leading.into_iter().chain(of_one.iter().copied()).collect())
}

fn offsets(dict: &Bound<'_, PyDict>, key: &str, runs: usize, epochs: usize) -> PyResult<PerRun<f64>> {
    let Some(value) = dict.get_item(key)? else {
        return Ok(PerRun {
            values: vec![0.0; epochs],
            epochs,
            by_run: false,
        });
    };
    let (by_run, shape) = per_run_shape(&value, runs, &[Some(epochs)]);
    let values = floats(&format!("schedule.{key}"), &value, &shape)?.values;
    Ok(PerRun { values, epochs, by_run })
}

/// The GPS epochs at which each run hears the satellites.
fn heard_only(dict: &Bound<'_, PyDict>, time_ns: Vec<i64>, runs: usize) -> PyResult<Vec<Vec<i64>>> {
    let Some(value) = dict.get_item("gps_heard")? else {
        return Ok(vec![time_ns]);
    };
    let epochs = time_ns.len();
    let (by_run, shape) = per_run_shape(&value, runs, &[Some(epochs)]);
    let values = booleans("schedule.gps_heard", &value, &shape)?.values;
    let heard = PerRun { values, epochs, by_run };
    let of_run = |run| -> Vec<i64> {
        let pairs = time_ns.iter().zip(heard.of(run));
        pairs.filter(|(_, heard)| **heard).map(|(&t, _)| t).collect()
    };
    Ok((0..if by_run { runs } else { 1 }).map(of_run).collect())
}

/// A schedule for a number of runs.
pub fn schedule(dict: &Bound<'_, PyDict>, beams: usize, runs: usize) -> PyResult<OwnedSchedule> {
    let epochs_of = |key: &str| times(&format!("schedule.{key}"), &item(dict, "schedule", key)?);
    let dvl_time_ns = epochs_of("dvl_time_ns")?;
    let valid = item(dict, "schedule", "beam_valid")?;
    let epochs = dvl_time_ns.len();
    let (by_run, shape) = per_run_shape(&valid, runs, &[Some(epochs), Some(beams)]);
    let flags = booleans("schedule.beam_valid", &valid, &shape)?;
    let (depth_time_ns, magnetometer_time_ns) = (epochs_of("depth_time_ns")?, epochs_of("magnetometer_time_ns")?);
    let gps_time_ns = heard_only(dict, epochs_of("gps_time_ns")?, runs)?;
    Ok(OwnedSchedule {
        beam_valid: PerRun {
            values: flags.values.chunks_exact(beams.max(1)).map(mask).collect(),
            epochs,
            by_run,
        },
        dvl_time_ns,
        depth_offset_m: offsets(dict, "depth_offset_m", runs, depth_time_ns.len())?,
        depth_time_ns,
        yaw_offset_rad: offsets(dict, "yaw_offset_rad", runs, magnetometer_time_ns.len())?,
        magnetometer_time_ns,
        gps_time_ns,
        sample_time_ns: epochs_of("sample_time_ns")?,
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
    .map_err(crate::errors::raise)?;
    Ok(gravity)
}
