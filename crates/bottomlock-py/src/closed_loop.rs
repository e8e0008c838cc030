//! Closed-loop simulation.

use bottomlock::frames::{Rot, Vec3};
use bottomlock::simulation::closed_loop as core;
use bottomlock::simulation::closed_loop::{ClosedLoopSetup, TruthSegment, VehicleStart};
use bottomlock::state::NavState;

use crate::arrays::rows;
use crate::batch_arrays::BatchArrays;
use crate::keys::read;
use crate::prelude::*;
use crate::shared::Shared;
use crate::truth::Truths;

const BROKEN: &str = "this closed loop has met an internal error before: start a new one";

/// Closed-loop simulation: the caller steers each vehicle on its estimate and passes the truth that results.
///
/// The sensor errors of run k are those of run k of a campaign. The truth of a campaign, in segments of any length,
/// gives the results of the campaign, bit for bit.
///
/// Args:
///     geometry: beam geometry.
///     simulated, assumed: models of the simulated sensors and of the filters (`Scenario.kernel_model`).
///     options: filter options (`Scenario.kernel_options`).
///     methods: aiding methods.
///     start: true state at the start: time_ns, position_t_m (n, 3), attitude_t_p (n, 4), velocity_p_mps (n, 3).
///     vehicle_per_method: false for one vehicle per run with all methods; true for one vehicle per run and method, in
///         the order of runs and, within a run, of methods.
///     seed, trajectory_key, first_run: key of the random numbers.
///     threads: number of threads, 0 for one per core; the results do not depend on it, bit for bit.
///
/// Raises:
///     KernelError: for a wrong shape, an invalid number or no method, naming the field.
///
/// A loop may be used by several threads: a lock inside takes their calls one after another, each whole.
#[pyclass(frozen, module = "bottomlock._kernel")]
pub struct ClosedLoop {
    inner: Shared<core::ClosedLoop>,
    beams: usize,
    vehicles: usize,
    methods: usize,
    methods_per_vehicle: usize,
}

#[pymethods]
impl ClosedLoop {
    #[new]
    #[pyo3(signature = (geometry, simulated, assumed, options, methods, start, *, vehicle_per_method, seed, trajectory_key, first_run,
        threads))]
    fn new(
        geometry: Argument,
        simulated: Argument,
        assumed: Argument,
        options: Argument,
        methods: Argument,
        start: Argument,
        vehicle_per_method: bool,
        seed: u64,
        trajectory_key: u64,
        first_run: u64,
        threads: usize,
    ) -> PyResult<Self> {
        let geometry = dvl::geometry(geometry)?;
        let (simulated, assumed) = (settings::model(simulated)?, settings::model(assumed)?);
        let options = settings::options(options)?;
        let methods = settings::methods(methods)?;
        let starts = true_starts(start)?;
        let common = ClosedLoopSetup {
            geometry: &geometry,
            simulated: &simulated,
            assumed: &assumed,
            options: &options,
            seed,
            trajectory_key,
        };
        let departures = VehicleStart::of_runs(first_run, &starts, &methods, vehicle_per_method).map_err(raise)?;
        let inner = core::ClosedLoop::new(&common, &departures, threads).map_err(raise)?;
        Ok(Self {
            inner: Shared::new(inner, BROKEN),
            beams: geometry.beams(),
            vehicles: starts.len(),
            methods: methods.len(),
            methods_per_vehicle: if vehicle_per_method { 1 } else { methods.len() },
        })
    }

    /// Runs every vehicle along the truth since the last call: arrays (n, samples, ·), whose first sample is the last
    /// of the call before.
    ///
    /// `schedule` is that of `run_batch`, with the epochs after the first sample (in the first call: at or after it);
    /// beam_valid, depth_offset_m, yaw_offset_rad and gps_received may have a leading axis of vehicles. Raises
    /// KernelError for a truth that does not continue the last one, samples outside it, and other bad input: the loop is then
    /// as before. After an error during a run, named with its method, and after a signal (Ctrl-C), the loop has failed, and
    /// every later call says so.
    fn advance(&self, py: Python<'_>, truth: Argument, schedule: Argument) -> PyResult<()> {
        let truths = Truths::new(truth, Some(self.vehicles))?;
        let schedule = crate::schedule::schedule(schedule, self.beams, self.vehicles)?;
        let segment = |run| {
            let (truth, schedule) = (truths.of(run)?, schedule.of(run));
            Ok(TruthSegment { truth, schedule })
        };
        let segments = (0..self.vehicles).map(segment).collect::<PyResult<Vec<_>>>()?;
        self.inner.with_long(py, |inner, stop| {
            inner.advance(&segments, &schedule.sample_time_ns, stop)
        })
    }

    /// Estimate of a method (by its index on a vehicle): position_t_m (n, 3), attitude_t_p (n, 4) and velocity_p_mps
    /// (n, 3).
    ///
    /// Raises KernelError for an index without a method.
    #[pyo3(signature = (method=0))]
    fn estimate<'py>(&self, py: Python<'py>, method: usize) -> Dict<'py> {
        if method >= self.methods_per_vehicle {
            return Err(invalid(format!(
                "method is {method}, expected less than {}",
                self.methods_per_vehicle
            )));
        }
        let states = self.inner.with(py, |inner| {
            inner.check()?;
            Ok(inner.estimates(method))
        })?;
        let out = PyDict::new(py);
        columns! { out, &[states.len()], states.iter() => position_t_m, attitude_t_p, velocity_p_mps }
        Ok(out)
    }

    /// Results so far, as `run_batch` returns them.
    fn results<'py>(&self, py: Python<'py>) -> Dict<'py> {
        let records = self.inner.with(py, |inner| {
            inner.check()?;
            Ok(inner.records())
        })?;
        let samples = records.iter().flatten().next().map_or(0, |record| record.nees.len());
        let runs = self.vehicles * self.methods_per_vehicle / self.methods;
        let mut results = BatchArrays::new([runs, self.methods, samples]);
        let mut records = records.into_iter().flatten();
        (0..runs).for_each(|run| results.store(run, records.by_ref().take(self.methods)));
        results.into_dict(py)
    }
}

/// The true states at the start, one per vehicle.
fn true_starts(start: Argument) -> PyResult<Vec<NavState>> {
    read("start", start, |keys| {
        let time_ns = crate::state::time_ns(keys)?;
        let position = keys.with("position_t_m", |name, value| rows::<3>(name, value, None))?;
        let runs = Some(position.len());
        let attitude = keys.with("attitude_t_p", |name, value| rows::<4>(name, value, runs))?;
        let velocity = keys.with("velocity_p_mps", |name, value| rows::<3>(name, value, runs))?;
        let state_of = |k: usize| {
            let mut state = NavState::at_rest(time_ns);
            state.position_t_m = Vec3::from_array(position[k]);
            state.attitude_t_p = Rot::from_quaternion_wxyz(attitude[k]);
            state.velocity_p_mps = Vec3::from_array(velocity[k]);
            state
        };
        Ok((0..position.len()).map(state_of).collect())
    })
}
