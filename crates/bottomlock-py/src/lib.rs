//! Python bindings of the kernel: they check arguments, release the GIL and map errors, and hold no formula.

use pyo3::prelude::*;

mod arrays;
mod batch;
mod batch_arrays;
mod beam_arrays;
mod calls;
mod closed_loop;
mod dvl;
mod earth;
mod errors;
mod given;
mod imu_faults;
mod keys;
mod memory;
mod navigator;
mod observability;
mod own_method;
mod prelude;
mod replay;
mod replay_records;
mod report;
mod results;
mod schedule;
mod segments;
mod settings;
mod shared;
mod state;
mod truth;
mod velocity;

/// Compiled kernel of bottomlock; use it through `bottomlock`.
#[pymodule]
mod _kernel {
    #[pymodule_export]
    use super::{
        batch::{error_model, run_batch, simulate_sensors},
        closed_loop::ClosedLoop,
        dvl::BeamGeometry,
        earth::local_earth,
        imu_faults::rejected_imu,
        navigator::Navigator,
        observability::{covariance_history, observe},
        own_method::register_method,
        replay::replay_log,
        report::Report,
        segments::integrate_segments,
        settings::{check_settings, normal_gravity_mps2},
        velocity::solve_velocity,
    };

    use bottomlock::aiding::registry::reports;
    use bottomlock::navigator::{METHODS, RECOMMENDED_METHOD};

    use pyo3::types::PyTuple;

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("DEFAULT_OPTIONS", super::settings::default_options(module.py())?)?;
        module.add("STATES", bottomlock::layout::DIM)?;
        module.add("INERTIAL_STATES", bottomlock::layout::DVL_BIAS)?;
        module.add("EARTH_RATE_RADPS", bottomlock::earth::EARTH_RATE_RADPS)?;
        module.add("RECOMMENDED_METHOD", RECOMMENDED_METHOD)?;
        let add = |key: &str, names: Vec<&str>| module.add(key, PyTuple::new(module.py(), names)?);
        add("FIX_STATUS", bottomlock::replay::FIX_STATUS.to_vec())?;
        add("SENSORS", reports().map(|(_, report)| report.name()).collect())?;
        add("METHODS", METHODS.iter().map(|method| method.name).collect())
    }
}
