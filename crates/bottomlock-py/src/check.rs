//! The rules of settings, for objects that are made before a kernel call takes them.

use bottomlock::aiding::registry::{SectionReader, SensorModels};
use bottomlock::aiding::sensor::Section;
use pyo3::prelude::*;

use crate::errors::{invalid, raise};
use crate::keys::{Keys, read};
use crate::{settings, state};

/// The keys of one section of a model.
struct OneSection<'a, 'py>(&'a Keys<'py>);

impl SectionReader for OneSection<'_, '_> {
    type Error = PyErr;
    fn section<S: Section>(&self) -> PyResult<S> {
        S::read(self.0)
    }
}

/// Checks settings by the kernel's rules: the section of a model by its name, "model", "options", "options.water",
/// "options.current_layers", "options.calibration", "options.motion", "options.robust" or "initial_state".
///
/// Raises KernelError, which names the key, the value and what was expected.
#[pyfunction]
pub fn check_settings(place: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
    let verdict = match place {
        "model" => settings::model(values).map(|_| Ok(()))?,
        "options" => settings::options(values).map(|_| Ok(()))?,
        "initial_state" => state::state(place, values)?.validate(),
        _ => read(place, values, |keys| match place {
            "environment" => Ok(settings::environment(keys)?.validate()),
            "imu" => Ok(settings::imu(keys)?.validate()),
            "initial" => Ok(settings::initial(keys)?.validate()),
            "options.water" => Ok(settings::water(keys)?.validate()),
            "options.current_layers" => Ok(settings::current_layers(keys)?.validate()),
            "options.calibration" => Ok(settings::calibration(keys)?.validate()),
            "options.motion" => Ok(settings::motion(keys)?.validate()),
            "options.robust" => Ok(settings::robust(keys)?.validate()),
            _ => SensorModels::check(place, &OneSection(keys))
                .unwrap_or_else(|| Err(invalid(format!("'{place}' are no settings of the kernel")))),
        })?,
    };
    verdict.map_err(raise)
}
