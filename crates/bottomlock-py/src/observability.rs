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
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Argument, Dict, booleans, floats, times};
use crate::calls::interruptible;
use crate::dvl;
use crate::errors::invalid;
use crate::keys::{Keys, read};
use crate::memory::product;
use crate::results::{Results, matrix};
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
fn aiding(value: Argument, beams: usize) -> PyResult<Aiding> {
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
            Some(levers) => settings::part("aiding.levers", &levers)?,
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
fn schedule(given: Option<Argument>, beams: usize, kind: &Kind) -> PyResult<Option<Vec<(i64, Aiding)>>> {
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
    let has = |sensor: &Sensor| aiding.sensors.contains(*sensor);
    let known = Aiding {
        sensors: [Sensor::Velocity, Sensor::Depth].into_iter().filter(has).collect(),
        ..Aiding::default()
    };
    if *aiding != known {
        return Err(invalid(
            "aiding: the 2015 model has velocity and depth aiding only, expected no other sensor",
        ));
    }
    Ok(Sensors {
        velocity: has(&Sensor::Velocity).then_some(sign),
        depth: has(&Sensor::Depth),
    })
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
    geometry: Argument,
    truth: Argument,
    model: Argument,
    aidings: Vec<Bound<'py, PyAny>>,
    kind: &str,
    period_ns: i64,
    schedule: Option<Argument>,
    scale: Option<Argument>,
    per_epoch: bool,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let geometry = dvl::geometry(geometry)?;
    let (truths, model, kind) = (Truths::new(truth)?, settings::model(model)?, Kind::parse(kind)?);
    let truth = truths.of(0)?;
    let scheduled = self::schedule(schedule, geometry.beams(), &kind)?;
    let epochs = scheduled.as_deref().map_or(Epochs::Every(period_ns), Epochs::Scheduled);
    let sets = aidings
        .iter()
        .map(|dict| aiding(dict, geometry.beams()))
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
            Kind::Filter { estimate_dvl } => full::systems(&truth, &geometry, &model, &sets, estimate_dvl, epochs)?,
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
    let results = analysed
        .iter()
        .map(|(system, whole, parts)| result(py, system, whole, parts));
    results.collect()
}

fn result<'py>(py: Python<'py>, system: &System, whole: &Observability, parts: &[WindowRank]) -> Dict<'py> {
    let out = PyDict::new(py);
    out.set_item("states", &system.names)?;
    out.set_item("rank", whole.rank)?;
    out.set_item("decided", whole.decided)?;
    out.set_item("gap", whole.gap)?;
    out.set_item("widest_step", whole.widest_step)?;
    out.column("singular_values", whole.singular_values.as_slice().iter().copied())?;
    out.set_item("noise_floor", whole.noise_floor)?;
    out.set_item("basis", matrix(py, &whole.basis)?)?;
    out.column("pivots", whole.pivots.iter().map(|&k| k as i64))?;
    out.column(
        "unobservable_fraction",
        whole.unobservable_fraction.as_slice().iter().copied(),
    )?;
    out.column("scales", whole.scales.as_slice().iter().copied())?;
    out.set_item("gramian", matrix(py, &rank::gramian(system))?)?;
    out.set_item("rows", matrix(py, &rank::rows(system))?)?;
    out.column("epoch_time_ns", system.epochs.iter().map(|epoch| epoch.time_ns))?;
    if !parts.is_empty() {
        // The first epoch alone is no window and has no rank.
        let windows = parts.iter().map(|part| (part.rank as i64, part.gap, part.decided));
        let padded: Vec<_> = std::iter::once((-1, f64::NAN, false)).chain(windows).collect();
        out.column("epoch_rank", padded.iter().map(|window| window.0))?;
        out.column("epoch_gap", padded.iter().map(|window| window.1))?;
        out.column("epoch_decided", padded.iter().map(|window| window.2))?;
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
    geometry: Argument,
    truth: Argument,
    model: Argument,
    aiding: Argument,
    kind: &str,
    period_ns: i64,
    schedule: Option<Argument>,
) -> Dict<'py> {
    let geometry = dvl::geometry(geometry)?;
    let (truths, model, kind) = (Truths::new(truth)?, settings::model(model)?, Kind::parse(kind)?);
    let truth = truths.of(0)?;
    let scheduled = self::schedule(schedule, geometry.beams(), &kind)?;
    let epochs = scheduled.as_deref().map_or(Epochs::Every(period_ns), Epochs::Scheduled);
    let set = self::aiding(aiding, geometry.beams())?;
    let sensors = match kind {
        Kind::Paper(sign) => Some(paper_sensors(&set, sign)?),
        Kind::Filter { .. } => None,
    };
    let estimate_dvl = matches!(kind, Kind::Filter { estimate_dvl: true });
    require_memory(&truth, 1, epochs)?;
    let history: History = interruptible(py, None, |stop| match sensors {
        Some(sensors) => history::of_paper(&truth, &model, &sensors, period_ns, stop),
        None => history::of_filter(&truth, &geometry, &model, &set, estimate_dvl, epochs, stop),
    })?;
    let states = history.covariance.first().map_or(0, DMatrix::nrows);
    let names: Vec<&str> = match sensors {
        Some(_) => paper::NAMES[15 - states..].to_vec(),
        None => full::NAMES.to_vec(),
    };
    let out = PyDict::new(py);
    let shape = [history.time_ns.len(), states, states];
    out.set_item("states", names)?;
    out.column("time_ns", history.time_ns)?;
    // A symmetric matrix is the same by rows and by columns.
    let values = history
        .covariance
        .iter()
        .flat_map(|covariance| covariance.iter().copied());
    out.put("covariance", &shape, values)?;
    Ok(out)
}
