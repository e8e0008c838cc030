//! Measurements that no instrument makes: finite numbers whose squares are none.

use crate::aiding::registry::{Levers, Measurement};
use crate::aiding::water_track::WaterSample;
use crate::dvl::geometry::BeamSample;
use crate::error::{LARGEST, NavError, UNIT, require_plausible};
use crate::filter::Eskf;
use crate::navigator::events::Event;

/// Largest deviation of a measurement from what the filter expects, SI.
const LARGEST_RESIDUAL: f64 = LARGEST;
/// Variances that a measurement can have, SI.
const SMALLEST_VARIANCE: f64 = 1e-30;
const LARGEST_VARIANCE: f64 = LARGEST * LARGEST;

/// Checks that an update with a measurement has numbers, before the measurement is taken or waits.
///
/// # Errors
/// [`NavError::Implausible`] that names the stream.
pub(crate) fn require_measurable(event: &Event, filter: &Eskf, levers: &Levers) -> Result<(), NavError> {
    require_current(event, filter)?;
    match event {
        Event::Imu(_) => Ok(()),
        Event::Beams(ping) | Event::WaterTrack(WaterSample { ping, .. }) => {
            require_measurable_ping(event.stream().0, ping)
        }
        Event::Aiding(measurement) => {
            let (stream, time_ns) = (event.stream().0, event.time_ns());
            measurement.reports().try_for_each(|sensor| {
                let innovation = filter.with_motion(|motion| measurement.innovation(sensor, motion, levers));
                (0..innovation.rows).try_for_each(|row| {
                    let residual = [innovation.residual[row]];
                    require_plausible(stream, time_ns, &residual, LARGEST_RESIDUAL, UNIT)?;
                    require_variance(stream, time_ns, innovation.noise[(row, row)])
                })
            })
        }
    }
}

/// Checks that a filter has the states that an event measures, where they are not those of every filter.
///
/// # Errors
/// [`NavError::Setting`] that names the option.
pub(crate) fn require_current(event: &Event, filter: &Eskf) -> Result<(), NavError> {
    let (is_missing, key, found, expected) = match event {
        Event::WaterTrack(_) => (
            filter.water().is_none(),
            "options.water_track",
            "is false",
            "true, for beams that the water returned: the current is then a state",
        ),
        Event::Aiding(Measurement::Thrust(_)) => (
            filter.thrust().is_none(),
            "options.thrust",
            "is \"off\"",
            "\"velocity\" or \"all\" with model.thrust, for speeds by the drives: their scale and the current are then states",
        ),
        _ => return Ok(()),
    };
    if is_missing {
        return Err(NavError::setting(key, found, expected));
    }
    Ok(())
}

/// The velocities of a ping are checked with its beams ([`BeamSample::validate`]).
fn require_measurable_ping(stream: &'static str, ping: &BeamSample) -> Result<(), NavError> {
    let mut variances = ping.valid.iter().map(|beam| ping.sd_mps[beam].powi(2));
    variances.try_for_each(|variance| require_variance(stream, ping.time_ns, variance))
}

fn require_variance(stream: &'static str, time_ns: i64, value: f64) -> Result<(), NavError> {
    if (SMALLEST_VARIANCE..=LARGEST_VARIANCE).contains(&value) {
        return Ok(());
    }
    Err(NavError::NoVariance { stream, time_ns, value })
}
