//! Models: environment and sensor errors, by preset and by key.

use std::ffi::c_char;
use std::ptr;

use bottomlock::NavError;
use bottomlock::earth::{EarthModel, Environment};
use bottomlock::model::Model as Core;

use crate::calls::{Status, free, made, status};
use crate::names::c_name;
use crate::pointers::{at, at_mut, fill, put, text};
use crate::presets::{GRADES, named};
use crate::settings::{Choice, Key, Keyed, Slot, key, keys};

/// Environment and errors of the sensors, SI.
#[derive(Debug, Clone)]
pub struct Model {
    inner: Core,
    earth: Choice,
}

const EARTH: Choice = Choice {
    chosen: "ellipsoid",
    all: &["ellipsoid", "tangent_plane"],
};

impl Model {
    /// Table 2 of Tal et al. 2017 on the ellipsoid at a latitude, rad.
    fn at(latitude_rad: f64) -> Result<Self, NavError> {
        let model = Self {
            inner: Core {
                environment: Environment::normal(latitude_rad, 0.0),
                ..Core::table_2()
            },
            earth: EARTH,
        };
        model.check().map(|()| model)
    }

    /// The kernel's model.
    pub(crate) fn made(&self) -> Core {
        let mut made = self.inner;
        made.environment.earth = match self.earth.chosen {
            "ellipsoid" => EarthModel::Ellipsoid,
            _ => EarthModel::TangentPlane,
        };
        made
    }
}

impl Keyed for Model {
    const OWNER: &'static str = "model";
    const KEYS: &'static [Key<Self>] = keys! {
        "environment.latitude_rad": Number inner.environment.latitude_rad;
        "environment.gravity_mps2": Number inner.environment.gravity_mps2;
        "environment.earth_rate_radps": Number inner.environment.earth_rate_radps;
        "environment.earth": Choice earth;
        "imu.accel_noise_mps_rts": Number inner.imu.accel_noise_mps_rts;
        "imu.gyro_noise_rad_rts": Number inner.imu.gyro_noise_rad_rts;
        "imu.accel_bias_sd_mps2": Number inner.imu.accel_bias_sd_mps2;
        "imu.gyro_bias_sd_radps": Number inner.imu.gyro_bias_sd_radps;
        "imu.accel_bias_walk_mps2_rts": Number inner.imu.accel_bias_walk_mps2_rts;
        "imu.gyro_bias_walk_radps_rts": Number inner.imu.gyro_bias_walk_radps_rts;
        "initial.position_sd_m": Vector inner.initial.position_sd_m;
        "initial.attitude_sd_rad": Vector inner.initial.attitude_sd_rad;
        "initial.velocity_sd_mps": Vector inner.initial.velocity_sd_mps;
        "dvl.beam_noise_sd_mps": Number inner.sensors.dvl.beam_noise_sd_mps;
        "dvl.beam_bias_sd_mps": Number inner.sensors.dvl.beam_bias_sd_mps;
        "dvl.beam_bias_walk_mps_rts": Number inner.sensors.dvl.beam_bias_walk_mps_rts;
        "dvl.scale_factor_sd": Number inner.sensors.dvl.scale_factor_sd;
        "dvl.scale_factor_walk_rts": Number inner.sensors.dvl.scale_factor_walk_rts;
        "depth.sd_m": Number inner.sensors.depth.sd_m;
        "depth.bias_sd_m": Number inner.sensors.depth.bias_sd_m;
        "depth.bias_time_s": Number inner.sensors.depth.bias_time_s.0;
        "magnetometer.yaw_sd_rad": Number inner.sensors.magnetometer.yaw_sd_rad;
        "magnetometer.roll_pitch_sd_rad": Number inner.sensors.magnetometer.roll_pitch_sd_rad;
        "magnetometer.yaw_offset_sd_rad": Number inner.sensors.magnetometer.yaw_offset_sd_rad.0;
        "magnetometer.roll_pitch_offset_sd_rad": Number inner.sensors.magnetometer.roll_pitch_offset_sd_rad.0;
        "magnetometer.yaw_walk_sd_rad": Number inner.sensors.magnetometer.yaw_walk_sd_rad.0;
        "magnetometer.roll_pitch_walk_sd_rad": Number inner.sensors.magnetometer.roll_pitch_walk_sd_rad.0;
        "magnetometer.walk_time_s": Number inner.sensors.magnetometer.walk_time_s.0;
        "heading.sd_rad": Number inner.sensors.heading.sd_rad;
        "heading.offset_sd_rad": Number inner.sensors.heading.offset_sd_rad.0;
        "heading.walk_sd_rad": Number inner.sensors.heading.walk_sd_rad.0;
        "heading.walk_time_s": Number inner.sensors.heading.walk_time_s.0;
        "gps.position_sd_m": Vector inner.sensors.gps.position_sd_m;
        "gps.velocity_sd_mps": Vector inner.sensors.gps.velocity_sd_mps;
        "acoustic_position.sd_m": Number inner.sensors.acoustic_position.sd_m;
        "acoustic_position.sd_per_range": Number inner.sensors.acoustic_position.sd_per_range;
        "acoustic_position.transceiver_t_m": Vector inner.sensors.acoustic_position.transceiver_t_m.0;
        "thrust.advance_m": Number inner.sensors.thrust.advance_m;
        "thrust.advance_sd_m": Number inner.sensors.thrust.advance_sd_m;
        "thrust.slip_sd_mps": Number inner.sensors.thrust.slip_sd_mps;
        "thrust.slip_time_s": Number inner.sensors.thrust.slip_time_s.0;
        "thrust.noise_sd_mps": Number inner.sensors.thrust.noise_sd_mps;
        "effort.mass_kg": Vector inner.sensors.effort.mass_kg;
        "effort.linear_drag_kgps": Vector inner.sensors.effort.linear_drag_kgps;
        "effort.quadratic_drag_kgpm": Vector inner.sensors.effort.quadratic_drag_kgpm;
        "effort.buoyancy_n": Number inner.sensors.effort.buoyancy_n.0;
        "effort.speed_scale_sd": Number inner.sensors.effort.speed_scale_sd.0;
        "effort.speed_scale_time_s": Number inner.sensors.effort.speed_scale_time_s.0;
        "effort.inertia_sd": Number inner.sensors.effort.inertia_sd.0;
        "effort.inertia_time_s": Number inner.sensors.effort.inertia_time_s.0;
        "effort.slip_sd_mps": Number inner.sensors.effort.slip_sd_mps;
        "effort.slip_time_s": Number inner.sensors.effort.slip_time_s.0;
        "effort.noise_sd_n": Number inner.sensors.effort.noise_sd_n;
    };

    fn check(&self) -> Result<(), NavError> {
        self.made().validate()
    }
}

/// A model at a latitude, rad: errors of a packaged grade of IMUs ("tactical"; `bl_model_preset_name` lists them), all else from
/// Table 2 of Tal et al. 2017, as all of "table_2" is. Set what your sensors have. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_preset(name: *const c_char, latitude_rad: f64) -> *mut Model {
    made(|| {
        // SAFETY: as the header asks.
        let name = unsafe { text("name", name) }?;
        let mut model = Model::at(latitude_rad)?;
        if name != TABLE_2 {
            model.inner.imu = named("model", name, &GRADES, |grade| grade.name)?.imu();
        }
        Ok(model)
    })
}

const TABLE_2: &str = "table_2";

/// Name of a model preset by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_model_preset_name(number: usize) -> *const c_char {
    let grades = GRADES.iter().map(|grade| grade.name);
    grades.chain([TABLE_2]).nth(number).map_or(ptr::null(), c_name)
}

/// Name of a key by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_model_key(number: usize) -> *const c_char {
    Model::KEYS.get(number).map_or(ptr::null(), |key| c_name(key.name))
}

/// Sets a key whose value is a number, SI; 0 or 1 for a switch. For example "dvl.beam_noise_sd_mps". An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_set(model: *mut Model, key: *const c_char, value: f64) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { at_mut("model", model)?.set(self::key(key)?, value) })
}

/// Sets a key whose value is a vector of `count` numbers, SI. An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_set_vector(
    model: *mut Model,
    key: *const c_char,
    values: *const f64,
    count: usize,
) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { at_mut("model", model)?.set_vector(self::key(key)?, values, count) })
}

/// Sets a key whose value is a text. For example "environment.earth", "ellipsoid". An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_set_text(model: *mut Model, key: *const c_char, value: *const c_char) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { at_mut("model", model)?.set_text(self::key(key)?, text("value", value)?) })
}

/// Reads the numbers of a key into `values`, which holds `capacity`; `count` is how many there are, 1 but for a vector.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_get(
    model: *const Model,
    key: *const c_char,
    values: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> Status {
    status(|| {
        // SAFETY: as the header asks.
        unsafe {
            let numbers = at("model", model)?.numbers(self::key(key)?)?;
            put("count", count, numbers.len())?;
            fill("values", values, capacity, &numbers)
        }
    })
}

/// Reads the text of a key; it lives as long as the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_get_text(
    model: *const Model,
    key: *const c_char,
    value: *mut *const c_char,
) -> Status {
    // SAFETY: as the header asks.
    status(|| unsafe { put("value", value, c_name(at("model", model)?.text(self::key(key)?)?)) })
}

/// A copy. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_copy(model: *const Model) -> *mut Model {
    // SAFETY: as the header asks.
    made(|| unsafe { at("model", model) }.cloned())
}

/// Frees a model; NULL is none. Navigators made with it stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_free(model: *mut Model) {
    // SAFETY: as the header asks.
    unsafe { free(model) }
}
