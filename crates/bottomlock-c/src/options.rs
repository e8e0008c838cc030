//! Options of the filter.

use std::ffi::c_char;

use bottomlock::NavError;
use bottomlock::filter::options::Options as Core;
use serde::{Deserialize, Serialize};

use crate::calls::{Status, call, free};
use crate::pointers::{at, at_mut, text};
use crate::settings::Settings;

/// Options of the filter, SI.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Options(pub(crate) Core);

impl Settings for Options {
    const NAME: &'static str = "options";

    fn validate(&self) -> Result<(), NavError> {
        self.0.validate()
    }
}

/// Options from an object of JSON, of which every key may be left out: "{}" has the defaults, which suit a vehicle whose inertial
/// readings are instantaneous. For example "{\"gate\": \"off\", \"water\": {\"slip_time_s\": 30}}". NULL for an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_from_json(json: *const c_char) -> Option<Box<Options>> {
    call!(made, Options::from_json(text("json", json)?))
}

/// Changes what an object of JSON names; all else stays. An error changes nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_set(options: *mut Options, json: *const c_char) -> Status {
    call!(status, at_mut("options", options)?.change(text("json", json)?))
}

/// The options as JSON, numbers to the last bit: `size` is the number of bytes with the NUL; `BL_STATUS_BUFFER_TOO_SMALL` where `json`
/// holds less, as with a capacity of 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bl_options_to_json(
    options: *const Options,
    json: *mut c_char,
    capacity: usize,
    size: *mut usize,
) -> Status {
    call!(status, at("options", options)?.write(json, capacity, size))
}

/// Frees options; NULL is none. Navigators made with them stay.
#[unsafe(no_mangle)]
pub extern "C" fn bl_options_free(options: Option<Box<Options>>) {
    free(options);
}
