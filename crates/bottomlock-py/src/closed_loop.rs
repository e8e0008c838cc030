//! Vehicles that are steered on their own estimates.

use bottomlock::frames::{Rot, Vec3};
use bottomlock::navigator::Method;
use bottomlock::simulation::closed_loop as core;
use bottomlock::simulation::closed_loop::{Common, TruthSegment, Vehicle};
use bottomlock::state::NavState;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, from_rows, item, rows};
use crate::batch_arrays::BatchArrays;
use crate::dvl::BeamGeometry;
use crate::errors::{raise, refuse};
use crate::settings;
use crate::truth::Truths;

/// Vehicles side by side whose truth depends on their own estimates: the caller steers them and tells where they went.
///
/// The sensor errors of run k are those of run k of a campaign; led along the truth of a campaign, in whatever pieces, a run
/// yields the campaign's bits.
///
/// Args:
///     geometry: the beams.
///     simulated, assumed: what the sensors are, and what the filters take them to be (`Scenario.kernel_model`).
///     options: filter options (`Scenario.kernel_options`).
///     arms: ways of aiding.
///     start: the truth at the start: time_ns, position_t_m (n, 3), attitude_t_p (n, 4), velocity_p_mps (n, 3).
///     own_vehicles: false for a vehicle per run with all arms aboard; true for one per run and arm, the arms of a run one after
///         the other.
///     seed, trajectory_key, first_run: key of the random numbers.
///     threads: 0 for as many as there are cores; the bits do not depend on it.
///
/// Raises:
///     KernelError: for wrong shapes and numbers that make no sense.
#[pyclass(module = "bottomlock._kernel")]
pub struct ClosedLoop {
    inner: core::ClosedLoop,
    beams: usize,
    vehicles: usize,
    arms: usize,
    arms_aboard: usize,
    samples: usize,
}

#[pymethods]
impl ClosedLoop {
    #[new]
    #[pyo3(signature = (geometry, simulated, assumed, options, arms, start, *, own_vehicles, seed, trajectory_key, first_run,
        threads))]
    fn new(
        geometry: &BeamGeometry,
        simulated: &Bound<'_, PyDict>,
        assumed: &Bound<'_, PyDict>,
        options: &Bound<'_, PyDict>,
        arms: Vec<String>,
        start: &Bound<'_, PyDict>,
        own_vehicles: bool,
        seed: u64,
        trajectory_key: u64,
        first_run: u64,
        threads: usize,
    ) -> PyResult<Self> {
        let (simulated, assumed) = (settings::model(simulated)?, settings::model(assumed)?);
        let options = settings::options(options)?;
        let arms = arms
            .iter()
            .map(|name| Method::named(name).map_err(raise))
            .collect::<PyResult<Vec<_>>>()?;
        let starts = true_starts(start)?;
        let common = Common {
            geometry: &geometry.inner,
            simulated: &simulated,
            assumed: &assumed,
            options: &options,
            seed,
            trajectory_key,
        };
        let crews: Vec<&[Method]> = if own_vehicles {
            arms.chunks(1).collect()
        } else {
            vec![&arms]
        };
        if crews.is_empty() || starts.len() % crews.len() != 0 {
            let (vehicles, crews) = (starts.len(), crews.len());
            return Err(refuse(format!(
                "start has {vehicles} rows, expected a multiple of {crews} arms"
            )));
        }
        let depart = |(k, &start): (usize, &NavState)| Vehicle {
            run: first_run + (k / crews.len()) as u64,
            start,
            methods: crews[k % crews.len()],
        };
        let departures: Vec<_> = starts.iter().enumerate().map(depart).collect();
        Ok(Self {
            inner: core::ClosedLoop::new(&common, &departures, threads).map_err(raise)?,
            beams: geometry.inner.beams(),
            vehicles: starts.len(),
            arms: arms.len(),
            arms_aboard: crews[0].len(),
            samples: 0,
        })
    }

    /// Leads every vehicle along the truth since the last call: (n, samples, ·), its first sample the last of the call before.
    ///
    /// `schedule` is that of `run_batch`, with the epochs after the first sample (in the first call: at or after it); beam_valid,
    /// depth_offset_m, yaw_offset_rad and gps_heard may lead with an axis of vehicles. Raises KernelError, naming run and arm.
    fn advance(&mut self, py: Python<'_>, truth: &Bound<'_, PyDict>, schedule: &Bound<'_, PyDict>) -> PyResult<()> {
        let truths = Truths::of_runs(truth, self.vehicles)?;
        let schedule = settings::schedule(schedule, self.beams, self.vehicles)?;
        let segments: Vec<TruthSegment<'_>> = (0..self.vehicles)
            .map(|run| {
                Ok(TruthSegment {
                    truth: truths.of(run)?,
                    schedule: schedule.of(run),
                })
            })
            .collect::<PyResult<_>>()?;
        let inner = &mut self.inner;
        py.detach(|| inner.advance(&segments, &schedule.sample_time_ns))
            .map_err(raise)?;
        self.samples += schedule.sample_time_ns.len();
        Ok(())
    }

    /// What an arm aboard believes: position_t_m (n, 3), attitude_t_p (n, 4), velocity_p_mps (n, 3).
    ///
    /// Raises KernelError for an arm that is not there.
    #[pyo3(signature = (arm=0))]
    fn belief<'py>(&self, py: Python<'py>, arm: usize) -> PyResult<Bound<'py, PyDict>> {
        if arm >= self.arms_aboard {
            return Err(refuse(format!("arm is {arm}, expected less than {}", self.arms_aboard)));
        }
        let states = self.inner.estimates(arm);
        let out = PyDict::new(py);
        let threes = |of: fn(&NavState) -> [f64; 3]| from_rows(py, &states.iter().map(of).collect::<Vec<_>>());
        out.set_item("position_t_m", threes(|state| state.position_t_m.to_array())?)?;
        out.set_item("velocity_p_mps", threes(|state| state.velocity_p_mps.to_array())?)?;
        let attitudes: Vec<[f64; 4]> = states.iter().map(|s| s.attitude_t_p.to_quaternion_wxyz()).collect();
        out.set_item("attitude_t_p", array(py, attitudes.concat(), &[states.len(), 4])?)?;
        Ok(out)
    }

    /// What the arms have yielded so far, as `run_batch` returns it.
    fn results<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let records = self.inner.records();
        let flown = self.vehicles * self.arms_aboard;
        let mut yields = BatchArrays::new(flown / self.arms, self.arms, self.samples);
        let places = yields.places();
        for (mut place, record) in places.into_iter().flatten().zip(records.iter().flatten()) {
            place.take(record);
        }
        yields.into_dict(py)
    }
}

fn true_starts(start: &Bound<'_, PyDict>) -> PyResult<Vec<NavState>> {
    let get = |key| item(start, "start", key);
    let time_ns: i64 = get("time_ns")?
        .extract()
        .map_err(|_| refuse("start.time_ns is not an integer number of nanoseconds"))?;
    let position = rows::<3>("start.position_t_m", &get("position_t_m")?, None)?;
    let runs = Some(position.len());
    let attitude = rows::<4>("start.attitude_t_p", &get("attitude_t_p")?, runs)?;
    let velocity = rows::<3>("start.velocity_p_mps", &get("velocity_p_mps")?, runs)?;
    let state_of = |k: usize| {
        let mut state = NavState::at_rest(time_ns);
        state.position_t_m = Vec3::from_array(position[k]);
        state.attitude_t_p = Rot::from_quaternion_wxyz(attitude[k]);
        state.velocity_p_mps = Vec3::from_array(velocity[k]);
        state
    };
    Ok((0..position.len()).map(state_of).collect())
}
