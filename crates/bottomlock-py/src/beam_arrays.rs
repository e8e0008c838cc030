//! Velocities, flags and standard deviations of beams, where a masked beam is not valid.

use bottomlock::aiding::water_track::WaterSample;
use bottomlock::dvl::geometry::BeamSample;

use crate::arrays::{Masked, booleans, floats, times};
use crate::keys::Keys;
use crate::prelude::*;

/// Flat arrays of one shape.
pub struct BeamArrays {
    pub velocity_mps: Vec<f64>,
    pub valid: Vec<bool>,
    /// Empty where it was not given.
    pub sd_mps: Vec<f64>,
}

impl BeamArrays {
    /// Reads the arrays; `names` are those of velocity, flags and standard deviations.
    pub fn new(
        names: [&str; 3],
        velocity_mps: Argument,
        valid: Argument,
        sd_mps: Option<Argument>,
        shape: &[Option<usize>],
    ) -> PyResult<Self> {
        let velocity_mps = Masked::of(velocity_mps)?;
        let valid = Masked::of(valid)?;
        let sd_mps = sd_mps.map(Masked::of).transpose()?;
        let velocities = floats(names[0], &velocity_mps.data, shape)?;
        let shape: Vec<Option<usize>> = velocities.shape.iter().copied().map(Some).collect();
        let mut flags = booleans(names[1], &valid.data, &shape)?.values;
        let arrays = [Some(&velocity_mps), Some(&valid), sd_mps.as_ref()]
            .into_iter()
            .flatten();
        for mask in arrays.filter_map(|array| array.mask.as_ref()) {
            let mask = booleans(names[0], mask, &shape)?.values;
            let both = flags.iter_mut().zip(mask);
            both.for_each(|(flag, is_masked)| *flag &= !is_masked);
        }
        Ok(Self {
            velocity_mps: velocities.values,
            valid: flags,
            sd_mps: match &sd_mps {
                Some(sd_mps) => floats(names[2], &sd_mps.data, &shape)?.values,
                None => Vec::new(),
            },
        })
    }

    /// A row as a ping.
    pub fn ping(&self, time_ns: i64, row: usize, beams: usize) -> BeamSample {
        let part = row * beams..(row + 1) * beams;
        let valid = settings::mask(&self.valid[part.clone()]);
        BeamSample::new(time_ns, &self.velocity_mps[part.clone()], &self.sd_mps[part], valid)
    }
}

/// A ping of velocity_mps, valid and sd_mps, each (beams,).
pub fn ping(time_ns: i64, [velocity_mps, valid, sd_mps]: [Argument; 3], beams: usize) -> PyResult<BeamSample> {
    let names = ["velocity_mps", "valid", "sd_mps"];
    let readings = BeamArrays::new(names, velocity_mps, valid, Some(sd_mps), &[Some(beams)])?;
    Ok(readings.ping(time_ns, 0, beams))
}

/// Beams that the water returned, of a log: as [`pings`], with the range of each row's cell, which is 0 where it is left out.
pub fn water_samples(keys: &Keys<'_>, beams: usize, model_sd_mps: f64) -> PyResult<Vec<WaterSample>> {
    if !keys.has("water_track_time_ns")? {
        return Ok(Vec::new());
    }
    let pings = pings(keys, "water_track_time_ns", "water_track", beams, model_sd_mps)?;
    let count = &[Some(pings.len())];
    let range_m = keys.given("water_track_range_m", |name, value| floats(name, value, count))?;
    let range_m = range_m.map_or_else(|| vec![0.0; pings.len()], |range_m| range_m.values);
    let samples = pings.into_iter().zip(range_m);
    Ok(samples.map(|(ping, range_m)| WaterSample { ping, range_m }).collect())
}

/// Pings of a log: `<prefix>_velocity_mps`, `_valid` and, where they are not those of the model, `_sd_mps`, each (n, beams).
pub fn pings(
    keys: &Keys<'_>,
    times_key: &str,
    prefix: &str,
    beams: usize,
    model_sd_mps: f64,
) -> PyResult<Vec<BeamSample>> {
    let time_ns = keys.with(times_key, times)?;
    let key = |name: &str| format!("{prefix}_{name}");
    let paths = ["velocity_mps", "valid", "sd_mps"].map(|name| keys.path(&key(name)));
    let sd = keys.get(&key("sd_mps"))?;
    let mut readings = BeamArrays::new(
        [&paths[0], &paths[1], &paths[2]],
        &keys.item(&key("velocity_mps"))?,
        &keys.item(&key("valid"))?,
        sd.as_ref(),
        &[Some(time_ns.len()), Some(beams)],
    )?;
    if sd.is_none() {
        readings.sd_mps = vec![model_sd_mps; readings.velocity_mps.len()];
    }
    let of_row = |(row, time_ns): (usize, i64)| readings.ping(time_ns, row, beams);
    Ok(time_ns.into_iter().enumerate().map(of_row).collect())
}
