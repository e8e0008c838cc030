//! What the navigator assumes of the vehicle's motion: the prior of its velocity, and the bound on its speed.

use super::{BeamAiding, Navigator};
use crate::aiding::motion_prior::{EPOCH_NS, LEARNING_NS, LOST_NS, WATER_HELD_NS};
use crate::dvl::geometry::BeamSample;
use crate::error::NavError;
use crate::filter::report::{Sensor, UpdateReport};

impl Navigator {
    /// Applies the prior of the vehicle's motion to every filter where an epoch is due.
    pub(super) fn keep_to_motion(
        &mut self,
        time_ns: i64,
        report: &mut dyn FnMut(&UpdateReport),
    ) -> Result<(), NavError> {
        let prior = self.options.motion;
        if prior.is_off() || self.next_motion_ns.is_some_and(|next_ns| time_ns < next_ns) {
            return Ok(());
        }
        self.next_motion_ns = Some(time_ns + EPOCH_NS);
        report(
            &self
                .filters
                .update(Sensor::Motion, &|filter| prior.innovation(&filter.state()))?,
        );
        Ok(())
    }

    /// Learns the vehicle's motion from a ping that determines the whole velocity, now and then; the ping before it was taken at
    /// `before_ns`. The velocity is that of the pings then, whose noise every row would carry into the position.
    pub(super) fn learn_motion(
        &mut self,
        time_ns: i64,
        before_ns: Option<i64>,
        report: &mut dyn FnMut(&UpdateReport),
    ) -> Result<(), NavError> {
        let part = |time_ns: i64| time_ns.div_euclid(LEARNING_NS);
        if before_ns.is_none_or(|before_ns| part(before_ns) != part(time_ns)) {
            self.next_motion_ns = None;
            self.keep_to_motion(time_ns, report)?;
        }
        self.next_motion_ns = Some(time_ns + LOST_NS);
        Ok(())
    }

    /// Puts the prior of the velocity off after a ping whose beams determine the velocity through the water. The vehicle's changes
    /// are then measured, and row after row of the prior would say that the current makes them.
    pub(super) fn note_water_velocity(&mut self, ping: &BeamSample) {
        if self.geometry.rank_of(ping.valid) == 3 {
            self.next_motion_ns = Some(ping.time_ns + WATER_HELD_NS);
        }
    }

    /// Bounds the speed of the filter on the measurements alone beyond the linear range, where the options say so.
    pub(super) fn bound_speed(&mut self, time_ns: i64, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        let (bound, filter) = (&self.options.speed_bound, &mut self.filters.measurements_only);
        if bound.sd_mps == 0.0 || self.aiding == BeamAiding::None || !filter.is_beyond_linear_range() {
            return Ok(());
        }
        let Some(last_ns) = self.last_ping_ns else {
            return Ok(());
        };
        let innovation = bound.innovation(&filter.state(), (time_ns - last_ns) as f64 * 1e-9);
        report(&filter.update(&innovation, Sensor::Speed)?);
        Ok(())
    }
}
