//! Models: environment and sensor errors, by preset and as JSON.

use std::ffi::c_char;
use std::ptr;

use bottomlock::NavError;
use bottomlock::earth::{EarthModel, Environment};
use bottomlock::model::Model as Core;
use bottomlock::presets::GRADES;
use bottomlock::settings;
use serde::{Deserialize, Serialize};

use crate::calls::{Outcome, Status, call, free};
use crate::names::{c_name, named};
use crate::pointers::{at, at_mut, text};
use crate::settings::{Settings, parsed};

/// Environment and errors of the sensors, SI.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Model(pub(crate) Core);

const TABLE_2: &str = "table_2";

impl Settings for Model {
    const NAME: &'static str = "model";

    fn validate(&self) -> Result<(), NavError> {
        self.0.validate()
    }
}

impl Model {
    /// A model of a text, by its sections alone or as a preset with changes.
    pub(crate) fn given(json: &str) -> Outcome<Self> {
        let mut keys = parsed(json)?;
        let Some(name) = keys.as_object_mut().and_then(|keys| keys.remove("preset")) else {
            return Self::from_json(json);
        };
        let latitude = keys.as_object_mut().and_then(|keys| keys.remove("latitude_rad"));
        let name: String = settings::read("preset", name)?;
        let latitude_rad = settings::read("latitude_rad", latitude.unwrap_or_default())?;
        let mut model = Core {
            environment: Environment::normal(latitude_rad, 0.0).on(EarthModel::Ellipsoid),
            ..Core::table_2()
        };
        model.validate()?;
        if name != TABLE_2 {
            model.imu = named("model", &name, &GRADES, |grade| grade.0)?.imu();
        }
        Self(model).changed(keys)
    }
}

/// Name of a model preset by its number from 0, NULL beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn bl_model_preset_name(number: usize) -> *const c_char {
    let grades = GRADES.iter().map(|grade| grade.0);
    grades.chain([TABLE_2]).nth(number).map_or(ptr::null(), c_name)
}

/// A model from an object of JSON with the sections "environment", "imu", "initial" and those of the sensors; or with "preset" and
/// "latitude_rad", and what differs from it. A preset has the errors of a packaged grade of IMUs ("tactical"; `bl_model_preset_name`
/// lists them), all else from Table 2 of Tal et al. 2017, as all of "table_2" is. Set what your sensors have. NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_from_json(json: *const c_char) -> Option<Box<Model>> {
    call!(made, Model::given(text("json", json)?))
}

/// Changes what an object of JSON names; all else stays. For example "{\"dvl\": {\"beam_noise_sd_mps\": 0.02}}". An error changes
/// nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_set(model: *mut Model, json: *const c_char) -> Status {
    call!(status, at_mut("model", model)?.change(text("json", json)?))
}

/// The model as JSON, as `bl_options_to_json`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_model_to_json(
    model: *const Model,
    json: *mut c_char,
    capacity: usize,
    size: *mut usize,
) -> Status {
    call!(status, at("model", model)?.write(json, capacity, size))
}

/// Frees a model; NULL is none. Navigators made with it stay.
#[unsafe(no_mangle)]
pub extern "C" fn bl_model_free(model: Option<Box<Model>>) {
    free(model);
}
