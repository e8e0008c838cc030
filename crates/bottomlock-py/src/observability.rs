//! Observability of a window, and covariance analysis along a truth.

use bottomlock::aiding::registry::reports;
use bottomlock::layout::DIM;
use bottomlock::observability::kind::Kind;
use bottomlock::observability::rank;
use bottomlock::observability::rank::{Observability, WindowRank};
use bottomlock::observability::{Aiding, Epochs, System};
use bottomlock::simulation::truth::Truth;

use crate::arrays::{booleans, floats, times};
use crate::calls::interruptible;
use crate::keys::{Keys, read};
use crate::memory::product;
use crate::prelude::*;
use crate::results::matrix;
use crate::truth::Truths;

/// An aiding set from beams, a flag for each of `SENSORS`, and lever arms; sensors that are not named are not in the
/// set.
fn aiding(value: Argument, beams: usize) -> PyResult<Aiding> {
    read("aiding", value, |keys| {
        let mut sensors = Vec::new();
        for (_, report) in reports() {
            let key = report.name();
            let is_in = keys.has(key)? && keys.extract(key, "True or False")?;
            sensors.extend(is_in.then_some(report));
        }
        let mask = keys.with("beams", |name, value| booleans(name, value, &[Some(beams)]))?;
        Ok(Aiding {
            beams: settings::mask(&mask.values),
            sensors: sensors.into_iter().collect(),
            levers: keys.given("levers", settings::part)?.unwrap_or_default(),
        })
    })
}

/// The aiding set at each epoch of a schedule: time_ns (e,), beams (e, n), and a column (e,) for each other sensor.
fn scheduled_sets(keys: &Keys<'_>, beams: usize) -> PyResult<Vec<(i64, Aiding)>> {
    let times = keys.with("time_ns", times)?;
    let count = Some(times.len());
    let masks = keys.with("beams", |name, value| booleans(name, value, &[count, Some(beams)]))?;
    let mut columns = Vec::new();
    for (_, report) in reports() {
        let flags = keys.given(report.name(), |name, value| booleans(name, value, &[count]))?;
        columns.extend(flags.map(|flags| (report, flags.values)));
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

/// The epochs of a schedule, if one is given.
fn schedule(given: Option<Argument>, beams: usize) -> PyResult<Option<Vec<(i64, Aiding)>>> {
    let sets = given.map(|value| read("schedule", value, |keys| scheduled_sets(keys, beams)));
    sets.transpose()
}

/// Checks that the transition matrices of all epochs fit into memory.
fn require_memory(truth: &Truth<'_>, sets: usize, epochs: Epochs<'_>) -> PyResult<()> {
    let ends = truth.time_ns.first().zip(truth.time_ns.last());
    let span = ends.map_or(0, |(first, last)| last.abs_diff(*first));
    let count = match epochs {
        Epochs::Every(period_ns) => (span / period_ns.unsigned_abs().max(1)) as usize,
        Epochs::Scheduled(scheduled) => scheduled.len(),
    };
    // There are no more epochs than samples; each has a transition matrix, and one from half as many samples.
    let count = count.min(truth.time_ns.len());
    let bytes = product(&[sets, count, 2 * DIM * DIM * size_of::<f64>()]);
    crate::memory::require(bytes, || format!("{sets} aiding sets with {count} epochs"))
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
    let (truths, model) = (Truths::new(truth, None)?, settings::model(model)?);
    let (truth, kind) = (truths.of(0)?, Kind::named(kind).map_err(raise)?);
    let scheduled = self::schedule(schedule, geometry.beams())?;
    let epochs = scheduled.as_deref().map_or(Epochs::Every(period_ns), Epochs::Scheduled);
    let sets = aidings.iter().map(|dict| aiding(dict, geometry.beams()));
    let sets = sets.collect::<PyResult<Vec<_>>>()?;
    let scale = scale.map(|value| floats("scale", value, &[None])).transpose()?;
    let scale = scale.as_ref().map(|scale| scale.values.as_slice());
    kind.check(&sets, epochs).map_err(raise)?;
    require_memory(&truth, sets.len(), epochs)?;
    let analysed = interruptible(py, None, |stop| {
        let systems = kind.systems(&truth, &geometry, &model, &sets, epochs)?.into_iter();
        let analysed = systems.map(|system| {
            stop.check()?;
            let whole = rank::observe(&system, system.epochs.len(), scale)?;
            let parts = match per_epoch {
                true => rank::growing_windows(&system, scale, stop)?,
                false => Vec::new(),
            };
            Ok((system, whole, parts))
        });
        analysed.collect::<Result<Vec<_>, _>>()
    })?;
    let results = analysed
        .iter()
        .map(|(system, whole, parts)| result(py, system, whole, parts));
    results.collect()
}

fn result<'py>(py: Python<'py>, system: &System, whole: &Observability, parts: &[WindowRank]) -> Dict<'py> {
    let out = PyDict::new(py);
    out.set_item("states", &system.names)?;
    fields! { out, whole => rank, decided, gap, widest_step, noise_floor }
    for (key, numbers) in [
        ("singular_values", &whole.singular_values),
        ("unobservable_fraction", &whole.unobservable_fraction),
        ("scales", &whole.scales),
    ] {
        out.column(key, numbers.as_slice().iter().copied())?;
    }
    out.column("pivots", whole.pivots.iter().copied())?;
    out.set_item("basis", matrix(py, &whole.basis)?)?;
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
    let (truths, model) = (Truths::new(truth, None)?, settings::model(model)?);
    let (truth, kind) = (truths.of(0)?, Kind::named(kind).map_err(raise)?);
    let scheduled = self::schedule(schedule, geometry.beams())?;
    let epochs = scheduled.as_deref().map_or(Epochs::Every(period_ns), Epochs::Scheduled);
    let set = self::aiding(aiding, geometry.beams())?;
    kind.check(&[set], epochs).map_err(raise)?;
    require_memory(&truth, 1, epochs)?;
    let (names, history) = interruptible(py, None, |stop| {
        kind.history(&truth, &geometry, &model, &set, epochs, stop)
    })?;
    let out = PyDict::new(py);
    let shape = [history.time_ns.len(), names.len(), names.len()];
    out.set_item("states", names)?;
    out.column("time_ns", history.time_ns)?;
    // A symmetric matrix is the same by rows and by columns.
    out.put("covariance", &shape, history.covariance.iter().flatten().copied())?;
    Ok(out)
}
