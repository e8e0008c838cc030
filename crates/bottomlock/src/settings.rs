//! Settings from any format that Serde reads; a refusal names the key, what was expected, and the nearest known key.
//!
//! The structs of the kernel are the one declaration of their keys: [`Options`], [`Model`] and their parts.

use std::fmt::Display;

use serde::de::Deserializer;

use crate::aiding::calibration::CalibrationPrior;
use crate::aiding::current_layers::LayersPrior;
use crate::aiding::motion_prior::MotionPrior;
use crate::aiding::outliers::Robust;
use crate::aiding::registry::SensorModels;
use crate::aiding::speed_bound::SpeedBound;
use crate::aiding::water::WaterPrior;
use crate::dvl::partial::Assumptions;
use crate::earth::Environment;
use crate::error::NavError;
pub use crate::error::setting::{hint, nearest, read};
use crate::filter::options::Options;
use crate::mechanisation::ImuLimits;
use crate::model::{ImuModel, InitialModel, Model};

/// Options of a filter, checked.
///
/// # Errors
/// As [`read`] and [`Options::validate`].
pub fn options<'de, D: Deserializer<'de, Error: Display>>(source: D) -> Result<Options, NavError> {
    let options: Options = read("options", source)?;
    options.validate()?;
    Ok(options)
}

/// A model, checked.
///
/// # Errors
/// As [`read`] and [`Model::validate`].
pub fn model<'de, D: Deserializer<'de, Error: Display>>(source: D) -> Result<Model, NavError> {
    let model: Model = read("model", source)?;
    model.validate()?;
    Ok(model)
}

/// Checks a part of the settings by its name: "options", a section of them as "options.water", "model", or one of its sections.
///
/// # Errors
/// As [`read`] and the part's `validate`; [`NavError::UnknownName`] for another name.
pub fn check<'de, D: Deserializer<'de, Error: Display>>(place: &str, source: D) -> Result<(), NavError> {
    match place {
        "model" => model(source).map(|_| ()),
        "options" => options(source).map(|_| ()),
        "environment" => read::<Environment, _>(place, source)?.validate(),
        "imu" => read::<ImuModel, _>(place, source)?.validate(),
        "initial" => read::<InitialModel, _>(place, source)?.validate(),
        "options.assumptions" => read::<Assumptions, _>(place, source)?.validate(),
        "options.imu_limits" => read::<ImuLimits, _>(place, source)?.validate(),
        "options.speed_bound" => read::<SpeedBound, _>(place, source)?.validate(),
        "options.water" => read::<WaterPrior, _>(place, source)?.validate(),
        "options.current_layers" => read::<LayersPrior, _>(place, source)?.validate(),
        "options.calibration" => read::<CalibrationPrior, _>(place, source)?.validate(),
        "options.motion" => read::<MotionPrior, _>(place, source)?.validate(),
        "options.robust" => read::<Robust, _>(place, source)?.validate(),
        "options.levers" => read::<crate::aiding::registry::Levers, _>(place, source)?.validate(place),
        _ => SensorModels::check(place, source),
    }
}

#[cfg(test)]
#[path = "settings_tests.rs"]
mod tests;
