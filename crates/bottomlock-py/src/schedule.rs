//! When sensors measure, from their keys: for many runs at once.

use bottomlock::aiding::registry::{SENSORS, SensorKind};
use bottomlock::aiding::sensor::Simulation;
use bottomlock::dvl::geometry::{BeamMask, MAX_BEAMS};
use bottomlock::simulation::owned_schedule::{OwnedEpochs, OwnedSchedule, OwnedWater, PerRun};

use crate::arrays::{Array, booleans, floats, rows, times};
use crate::keys::{Keys, read};
use crate::prelude::*;
use crate::settings::mask;

/// What an array converter gives: numbers or truth values.
type Convert<T> = fn(&str, Argument, &[Option<usize>]) -> PyResult<Array<T>>;

/// Values of the shape `of_one`, or (runs, ..) with one set for each run; none without the key.
fn per_run<T: Clone>(
    keys: &Keys<'_>,
    key: &str,
    runs: usize,
    of_one: &[usize],
    convert: Convert<T>,
) -> PyResult<Option<PerRun<T>>> {
    keys.given(key, |name, value| {
        let dimensions: usize = value.getattr("ndim").and_then(|n| n.extract()).unwrap_or(of_one.len());
        let by_run = (dimensions == of_one.len() + 1).then_some(runs);
        let shape: Vec<_> = by_run.iter().chain(of_one).copied().map(Some).collect();
        let values = convert(name, value, &shape)?.values;
        let each: usize = of_one.iter().product();
        let of_run = |run| values[run * each..][..each].to_vec();
        Ok(PerRun((0..by_run.unwrap_or(1)).map(of_run).collect()))
    })
}

/// Times of a key; none without it, where none of the keys that need them is given.
fn given_times<'a>(
    keys: &Keys<'_>,
    times_key: &str,
    others: impl IntoIterator<Item = &'a str>,
) -> PyResult<Option<Vec<i64>>> {
    let time_ns = keys.given(times_key, times)?;
    for key in others {
        if keys.has(key)? && time_ns.is_none() {
            return Err(invalid(format!("schedule has the key '{key}' but lacks '{times_key}'")));
        }
    }
    Ok(time_ns)
}

/// The epochs of a sensor that each run receives: `<name>_time_ns`, and where given `<name>_received` and the sensor's offset. A
/// sensor that is not named never measures.
fn epochs(keys: &Keys<'_>, of: &Simulation, runs: usize) -> PyResult<OwnedEpochs> {
    let (times_key, received_key) = (format!("{}_time_ns", of.name), format!("{}_received", of.name));
    let others = of.offset.into_iter().chain([received_key.as_str()]);
    let Some(time_ns) = given_times(keys, &times_key, others)? else {
        return Ok(OwnedEpochs::default());
    };
    let count = [time_ns.len()];
    let received = per_run::<bool>(keys, &received_key, runs, &count, booleans)?;
    let received = received.unwrap_or_else(|| PerRun(vec![vec![true; time_ns.len()]]));
    let offset_of = |key| per_run::<f64>(keys, key, runs, &count, floats);
    let offset = of.offset.map_or(Ok(None), offset_of)?.unwrap_or_default();
    let sets = offset.0.len().min(1) * received.0.len().max(offset.0.len());
    let kept_offset = |run: usize| kept(offset.of(run), received.of(run));
    Ok(OwnedEpochs {
        time_ns: PerRun(received.0.iter().map(|received| kept(&time_ns, received)).collect()),
        offset: PerRun((0..sets).map(kept_offset).collect()),
    })
}

/// The values that are received.
fn kept<T: Copy>(values: &[T], received: &[bool]) -> Vec<T> {
    let both = values.iter().zip(received);
    both.filter_map(|(&value, &is_received)| is_received.then_some(value))
        .collect()
}

/// Number of samples of a schedule, before it is read; none where it cannot be, which its reading then says.
pub fn sample_count(value: Argument) -> usize {
    let times = value.get_item("sample_time_ns");
    times.and_then(|times| times.len()).unwrap_or(0)
}

/// The valid beams at each of a number of epochs.
fn masks(keys: &Keys<'_>, key: &str, epochs: usize, beams: usize, runs: usize) -> PyResult<PerRun<BeamMask>> {
    keys.item(key)?;
    let flags = per_run::<bool>(keys, key, runs, &[epochs, beams], booleans)?.unwrap_or_default();
    let masks = |flags: &Vec<bool>| flags.chunks_exact(beams.max(1)).map(mask).collect();
    Ok(PerRun(flags.0.iter().map(masks).collect()))
}

/// The range of every beam at each of a number of epochs; none without the key.
fn ranges(keys: &Keys<'_>, epochs: usize, beams: usize, runs: usize) -> PyResult<PerRun<[f64; MAX_BEAMS]>> {
    let given = per_run::<f64>(keys, "beam_range_m", runs, &[epochs, beams], floats)?.unwrap_or_default();
    let padded = |row: &[f64]| std::array::from_fn(|beam| row.get(beam).copied().unwrap_or(0.0));
    let rows = |ranges: &Vec<f64>| ranges.chunks_exact(beams.max(1)).map(padded).collect();
    Ok(PerRun(given.0.iter().map(rows).collect()))
}

/// The epochs of the water, none without `water_track_time_ns`.
fn water(keys: &Keys<'_>, beams: usize, runs: usize) -> PyResult<OwnedWater> {
    const VALUES: [&str; 3] = ["water_track_valid", "water_current_n_mps", "water_shear_n_ps"];
    let Some(time_ns) = given_times(keys, "water_track_time_ns", VALUES)? else {
        return Ok(OwnedWater::default());
    };
    let epochs = time_ns.len();
    let pairs = |key: &str| keys.with(key, |name, value| rows::<2>(name, value, Some(epochs)));
    Ok(OwnedWater {
        beam_valid: masks(keys, VALUES[0], epochs, beams, runs)?,
        current_n_mps: pairs(VALUES[1])?,
        shear_n_ps: pairs(VALUES[2])?,
        time_ns,
    })
}

/// A schedule for a number of runs.
pub fn schedule(value: Argument, beams: usize, runs: usize) -> PyResult<OwnedSchedule> {
    read("schedule", value, |keys| {
        let dvl_time_ns = keys.with("dvl_time_ns", times)?;
        let beam_valid = masks(keys, "beam_valid", dvl_time_ns.len(), beams, runs)?;
        let mut sensors: [OwnedEpochs; SENSORS] = Default::default();
        for kind in SensorKind::ALL {
            if let Some(simulation) = kind.declaration().simulation {
                sensors[kind as usize] = epochs(keys, &simulation, runs)?;
            }
        }
        Ok(OwnedSchedule {
            beam_valid,
            beam_range_m: ranges(keys, dvl_time_ns.len(), beams, runs)?,
            dvl_time_ns,
            sensors,
            water: water(keys, beams, runs)?,
            sample_time_ns: keys.with("sample_time_ns", times)?,
        })
    })
}
