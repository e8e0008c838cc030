//! Observability of a window, and covariance analysis along a truth.

use bottomlock::aiding::registry::{Sensor, reports};
use bottomlock::layout::DIM;
use bottomlock::observability::history;
use bottomlock::observability::history::History;
use bottomlock::observability::paper;
use bottomlock::observability::paper::{Sensors, Sign};
use bottomlock::observability::rank;
use bottomlock::observability::rank::{Observability, WindowRank};
use bottomlock::observability::{Aiding, Epochs, System, full};
use bottomlock::simulation::truth::Truth;
use nalgebra::DMatrix;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{array, booleans, floats, times};
use crate::calls::interruptible;
use crate::dvl::BeamGeometry;
use crate::errors::invalid;
use crate::keys::{Keys, read};
use crate::memory::product;
use crate::settings;
use crate::truth::Truths;

/// A linear error model.
enum Kind {
    Filter { estimate_dvl: bool },
    Paper(Sign),
}

impl Kind {
    fn parse(name: &str) -> PyResult<Self> {
        match name {
            "full" => Ok(Self::Filter { estimate_dvl: true }),
            "inertial" => Ok(Self::Filter { estimate_dvl: false }),
            "paper" => Ok(Self::Paper(Sign::Consistent)),
            "paper_printed" => Ok(Self::Paper(Sign::Printed)),
            other => Err(invalid(format!(
                "kind is '{other}', expected 'full', 'inertial', 'paper' or 'paper_printed'"
            ))),
        }
    }
}

/// An aiding set from beams, a flag for each of `SENSORS`, and lever arms; sensors that are not named are not in the
/// set.
fn aiding(value: &Bound<'_, PyAny>, beams: usize) -> PyResult<Aiding> {
    read("aiding", value, |keys| aiding_of(keys, beams))
}

fn aiding_of(keys: &Keys<'_>, beams: usize) -> PyResult<Aiding> {
    let flag = |sensor: Sensor| -> PyResult<bool> {
        let key = sensor.name();
        Ok(keys.has(key)? && keys.extract(key, "True or False")?)
    };
    let mut sensors = Vec::new();
    for (_, report) in reports() {
        sensors.extend(flag(report.sensor)?.then_some(report.sensor));
    }
    let mask = booleans("aiding.beams", &keys.item("beams")?, &[Some(beams)])?;
    Ok(Aiding {
        beams: settings::mask(&mask.values),
        sensors: sensors.into_iter().collect(),
        levers: match keys.get("levers")? {
            Some(levers) => settings::levers("aiding.levers", &levers)?,
            None => Default::default(),
        },
    })
}

/// The aiding set at each epoch of a schedule: time_ns (e,), beams (e, n), and a column (e,) for each other sensor.
fn scheduled_sets(keys: &Keys<'_>, beams: usize) -> PyResult<Vec<(i64, Aiding)>> {
    let times = times("schedule.time_ns", &keys.item("time_ns")?)?;
    let count = Some(times.len());
    let masks = booleans("schedule.beams", &keys.item("beams")?, &[count, Some(beams)])?;
    let mut columns = Vec::new();
    for (_, report) in reports() {
        let key = report.sensor.name();
        if let Some(value) = keys.get(key)? {
            columns.push((report.sensor, booleans(&keys.path(key), &value, &[count])?.values));
        }
    }
    let at = |(k, &time_ns): (usize, &i64)| {
        let sensors = columns.iter().filter(|(_, measures)| measures[k]);
        let set = Aiding {
            beams: settings::mask(&masks.values[k * beams..(k + 1) * beams]),
            sensors: sensors.map(|(sensor, _)| *sensor).collect(),
            ..Aiding::default()
        };
        (time_ns, set)
    };
    Ok(times.iter().enumerate().map(at).collect())
}

/// The epochs of a schedule, if one is given; the 2015 model has periodic epochs only.
fn schedule(given: Option<&Bound<'_, PyAny>>, beams: usize, kind: &Kind) -> PyResult<Option<Vec<(i64, Aiding)>>> {
    if given.is_some() && matches!(kind, Kind::Paper(_)) {
        return Err(invalid(
            "schedule: the 2015 model has periodic epochs only, expected period_ns in its place",
        ));
    }
    given
        .map(|value| read("schedule", value, |keys| scheduled_sets(keys, beams)))
        .transpose()
}

/// Checks that the transition matrices of all epochs fit into memory.
fn require_memory(truth: &Truth<'_>, sets: usize, epochs: Epochs<'_>) -> PyResult<()> {
    let count = match epochs {
        Epochs::Every(period_ns) => match (truth.time_ns.first(), truth.time_ns.last()) {
            (Some(first), Some(last)) => (last.abs_diff(*first) / period_ns.unsigned_abs().max(1)) as usize,
            _ => 0,
        },
        Epochs::Scheduled(scheduled) => scheduled.len(),
    };
    // There are no more epochs than samples; each has a transition matrix, and one from half as many samples.
    let count = count.min(truth.time_ns.len());
    let bytes = product(&[sets, count, 2 * DIM * DIM * size_of::<f64>()]);
    crate::memory::require(bytes, || format!("{sets} aiding sets with {count} epochs"))
}

/// The sensors of the 2015 model, which has a DVL and a depth sensor only.
fn paper_sensors(aiding: &Aiding, sign: Sign) -> PyResult<Sensors> {
    let (velocity, depth) = (
        aiding.sensors.contains(Sensor::Velocity),
        aiding.sensors.contains(Sensor::Depth),
    );
    let named = [(Sensor::Velocity, velocity), (Sensor::Depth, depth)];
    let known = Aiding {
        sensors: named
            .into_iter()
            .filter_map(|(sensor, there)| there.then_some(sensor))
            .collect(),
        ..Aiding::default()
    };
    if *aiding != known {
        return Err(invalid(
            "aiding: the 2015 model has velocity and depth aiding only, expected no other sensor",
        ));
    }
    Ok(Sensors {
        velocity: velocity.then_some(sign),
        depth,
    })
}

fn matrix<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    array(py, m.transpose().as_slice().to_vec(), &[m.nrows(), m.ncols()])
}

/// Rank, gap and unobservable subspace of a window for each aiding set.
///
/// Each result is a dict:
///
/// - states, rank, decided, gap, widest_step, singular_values (n,), noise_floor;
/// - basis (k, n) of the unobservable subspace, SI, with its pivots (k,); unobservable_fraction (n,); scales (n,);
/// - gramian (n, n) of 2015, Eq. (1), rows (m, n) and epoch_time_ns (e,);
/// - with `per_epoch`, epoch_rank, epoch_gap and epoch_decided (e,) of the windows that end at each epoch.
///
/// `schedule` (time_ns (e,), beams (e, n) and a column (e,) per sensor) selects the sensors of a set at each epoch, in
/// place of the period. Raises KernelError for an empty aiding set, a window of fewer than two epochs, or a motion that
/// is not finite.
#[pyfunction]
#[pyo3(signature = (
    geometry, truth, model, aidings, *, kind="full", period_ns=1_000_000_000, schedule=None, scale=None, per_epoch=false
))]
pub fn observe<'py>(
    py: Python<'py>,
    geometry: &BeamGeometry,
    truth: &Bound<'py, PyAny>,
    model: &Bound<'py, PyAny>,
    aidings: Vec<Bound<'py, PyAny>>,
    kind: &str,
    period_ns: i64,
    schedule: Option<&Bound<'py, PyAny>>,
    scale: Option<&Bound<'py, PyAny>>,
    per_epoch: bool,
) -> PyResult<Bound<'py, PyList>> {
    let (truths, model, kind) = (Truths::new(truth)?, settings::model(model)?, Kind::parse(kind)?);
    let truth = truths.of(0)?;
    let scheduled = self::schedule(schedule, geometry.inner.beams(), &kind)?;
    let epochs = scheduled.as_deref().map_or(Epochs::Every(period_ns), Epochs::Scheduled);
    let sets = aidings
        .iter()
        .map(|dict| aiding(dict, geometry.inner.beams()))
        .collect::<PyResult<Vec<_>>>()?;
    let scale = scale
        .map(|value| floats("scale", value, &[None]))
        .transpose()?
        .map(|given| given.values);
    let sensors = match kind {
        Kind::Paper(sign) => sets
            .iter()
            .map(|set| paper_sensors(set, sign))
            .collect::<PyResult<Vec<_>>>()?,
        Kind::Filter { .. } => Vec::new(),
    };
    require_memory(&truth, sets.len(), epochs)?;
    let analysed = interruptible(py, None, |stop| {
        let systems = match kind {
            Kind::Filter { estimate_dvl } => {
                full::systems(&truth, &geometry.inner, &model, &sets, estimate_dvl, epochs)?
            }
            Kind::Paper(_) => sensors
                .iter()
                .map(|set| paper::system(&truth, &model, set, period_ns))
                .collect::<Result<Vec<_>, _>>()?,
        };
        systems
            .into_iter()
            .map(|system| {
                stop.check()?;
                let whole = rank::observe(&system, system.epochs.len(), scale.as_deref())?;
                let parts = if per_epoch {
                    rank::growing_windows(&system, scale.as_deref(), stop)?
                } else {
                    Vec::new()
                };
                Ok((system, whole, parts))
            })
            .collect::<Result<Vec<_>, _>>()
    })?;
    let out = PyList::empty(py);
    for (system, whole, parts) in &analysed {
        out.append(result(py, system, whole, parts)?)?;
    }
    Ok(out)
}

fn result<'py>(
    py: Python<'py>,
    system: &System,
    whole: &Observability,
    parts: &[WindowRank],
) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let vector = |values: &[f64]| array(py, values.to_vec(), &[values.len()]);
    let counts = |values: Vec<i64>| {
        let count = values.len();
        array(py, values, &[count])
    };
    out.set_item("states", &system.names)?;
    out.set_item("rank", whole.rank)?;
    out.set_item("decided", whole.decided)?;
    out.set_item("gap", whole.gap)?;
    out.set_item("widest_step", whole.widest_step)?;
    out.set_item("singular_values", vector(whole.singular_values.as_slice())?)?;
    out.set_item("noise_floor", whole.noise_floor)?;
    out.set_item("basis", matrix(py, &whole.basis)?)?;
    out.set_item("pivots", counts(whole.pivots.iter().map(|&k| k as i64).collect())?)?;
    out.set_item("unobservable_fraction", vector(whole.unobservable_fraction.as_slice())?)?;
    out.set_item("scales", vector(whole.scales.as_slice())?)?;
    out.set_item("gramian", matrix(py, &rank::gramian(system))?)?;
    out.set_item("rows", matrix(py, &rank::rows(system))?)?;
    let times = system.epochs.iter().map(|epoch| epoch.time_ns).collect();
    out.set_item("epoch_time_ns", counts(times)?)?;
    if !parts.is_empty() {
        // The first epoch alone is no window and has no rank.
        let padded =
            std::iter::once((-1, f64::NAN, false)).chain(parts.iter().map(|p| (p.rank as i64, p.gap, p.decided)));
        let padded: Vec<_> = padded.collect();
        out.set_item("epoch_rank", counts(padded.iter().map(|p| p.0).collect())?)?;
        out.set_item("epoch_gap", vector(&padded.iter().map(|p| p.1).collect::<Vec<_>>())?)?;
        let decided: Vec<bool> = padded.iter().map(|p| p.2).collect();
        out.set_item("epoch_decided", array(py, decided, &[padded.len()])?)?;
    }
    Ok(out)
}

/// Covariance analysis along a truth: time_ns (e,), covariance (e, n, n), SI, after the update of each epoch, and
/// states.
///
/// `kind` as for `observe`; "full" is the filter with 20 states, "inertial" the filter with frozen DVL states. Raises
/// KernelError as `observe` does.
#[pyfunction]
#[pyo3(signature = (geometry, truth, model, aiding, *, kind="full", period_ns=1_000_000_000, schedule=None))]
pub fn covariance_history<'py>(
    py: Python<'py>,
    geometry: &BeamGeometry,
    truth: &Bound<'py, PyAny>,
    model: &Bound<'py, PyAny>,
    aiding: &Bound<'py, PyAny>,
    kind: &str,
    period_ns: i64,
    schedule: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (truths, model, kind) = (Truths::new(truth)?, settings::model(model)?, Kind::parse(kind)?);
    let truth = truths.of(0)?;
    let scheduled = self::schedule(schedule, geometry.inner.beams(), &kind)?;
    let epochs = scheduled.as_deref().map_or(Epochs::Every(period_ns), Epochs::Scheduled);
    let set = self::aiding(aiding, geometry.inner.beams())?;
    let sensors = match kind {
        Kind::Paper(sign) => Some(paper_sensors(&set, sign)?),
        Kind::Filter { .. } => None,
    };
    let estimate_dvl = matches!(kind, Kind::Filter { estimate_dvl: true });
    require_memory(&truth, 1, epochs)?;
    let history: History = interruptible(py, None, |stop| match sensors {
        Some(sensors) => history::of_paper(&truth, &model, &sensors, period_ns, stop),
        None => history::of_filter(&truth, &geometry.inner, &model, &set, estimate_dvl, epochs, stop),
    })?;
    let states = history.covariance.first().map_or(0, DMatrix::nrows);
    let names: Vec<&str> = match sensors {
        Some(_) => paper::NAMES[15 - states..].to_vec(),
        None => full::NAMES.to_vec(),
    };
    let out = PyDict::new(py);
    let epochs = history.time_ns.len();
    out.set_item("states", names)?;
    out.set_item("time_ns", array(py, history.time_ns, &[epochs])?)?;
    // A symmetric matrix is the same by rows and by columns.
    let values = history.covariance.iter().flat_map(|p| p.as_slice().to_vec()).collect();
    out.set_item("covariance", array::<f64>(py, values, &[epochs, states, states])?)?;
    Ok(out)
}
