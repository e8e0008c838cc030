//! Doubt between a filter and readings of a velocity that had confirmed it: which of the two is wrong?
//!
//! A velocity that the same sensor confirmed a moment ago can have become wrong through tilts and biases, which explain an
//! error of five sigma. Beyond that, either the readings are those of something else (fish, a vessel that passes), or the
//! filter was thrown off by inertial readings that were false. Both look alike: the readings agree with each other and not
//! with the filter. Time tells them apart, since such readings end.
//!
//! After as many solved velocities in a row as inflate the covariance ([`super::inflation`]) the velocity is known to the
//! difference d of the two and no better: P + d dᵀ holds whichever is right. The estimate stays with the filter. Readings on
//! the side of d are not used; one on the side of the filter is, and ends the doubt. After [`LONGEST_DOUBT_NS`] the readings are
//! believed, beams as well; but they do not widen the covariance, since some of them may be right.

use nalgebra::Vector3;

use super::Eskf;
use super::inflation::{AdmissibleError, Count};
use crate::aiding::{Innovation, TangentRows};
use crate::error::{NavError, require_finite};
use crate::filter::gate::LONGEST_DOUBT_NS;
use crate::filter::report::Sensor;
use crate::layout::VELOCITY;

/// Part of the variance of a difference that is left where nothing has told which is right.
const STILL_HELD: f64 = 0.25;

/// The readings of one sensor that no error of the filter explains.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Doubt {
    count: Count,
    open: Option<Difference>,
}

/// Between what readings show and the filter.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Difference {
    /// Time of the first reading.
    since_ns: i64,
    /// Of the covariance that has the readings accepted.
    factor: f64,
    velocity_p_mps: Vector3<f64>,
}

/// The doubts of the sensors whose readings may show more than an error of the filter explains.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Doubts {
    beams: Doubt,
    velocity: Doubt,
}

impl Doubts {
    /// The doubt of a sensor.
    pub(super) const fn of(&self, sensor: Sensor) -> Option<&Doubt> {
        match sensor {
            Sensor::Beams => Some(&self.beams),
            Sensor::Velocity => Some(&self.velocity),
            _ => None,
        }
    }

    /// The doubt of a sensor.
    pub(super) const fn of_mut(&mut self, sensor: Sensor) -> Option<&mut Doubt> {
        match sensor {
            Sensor::Beams => Some(&mut self.beams),
            Sensor::Velocity => Some(&mut self.velocity),
            _ => None,
        }
    }

    /// Checks doubts that were read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.beams.check_restored(time_ns)?;
        self.velocity.check_restored(time_ns)
    }
}

impl Doubt {
    /// Checks a doubt that was read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.count.check_restored(time_ns)?;
        self.open.map_or(Ok(()), |open| {
            require_finite("doubt", time_ns, &[open.factor])?;
            require_finite("doubt", time_ns, open.velocity_p_mps.as_slice())
        })
    }

    /// Another doubted reading; the factor of the covariance where the readings are to be believed.
    pub(super) fn go_on(&mut self, velocity_p_mps: Vector3<f64>, time_ns: i64) -> Option<f64> {
        let open = self.open.as_mut()?;
        open.velocity_p_mps = velocity_p_mps;
        let (is_over, factor) = (time_ns - open.since_ns >= LONGEST_DOUBT_NS, open.factor);
        is_over.then(|| {
            *self = Self::default();
            factor
        })
    }
}

impl Eskf {
    /// The error of the filter that a rejected reading of a sensor beside the beams may show: a velocity that came solved
    /// counts to five sigma of one that was accepted before.
    pub(crate) fn admissible_error(&self, sensor: Sensor) -> AdmissibleError {
        if sensor == Sensor::Velocity && self.measured.velocity_ns.is_some() {
            AdmissibleError::FiveSigma
        } else {
            AdmissibleError::Any
        }
    }

    /// The difference that the covariance of the velocity holds in doubt of a sensor, m/s.
    pub(crate) fn doubted(&self, sensor: Sensor) -> Option<Vector3<f64>> {
        let open = self.consecutive_rejections.doubts.of(sensor)?.open?;
        Some(open.velocity_p_mps)
    }

    /// Adds an error that the velocity may have to its covariance, m/s.
    pub(crate) fn doubt_velocity(&mut self, error_p_mps: &Vector3<f64>) {
        let mut velocity = self.covariance.fixed_view_mut::<3, 3>(VELOCITY, VELOCITY);
        velocity += error_p_mps * error_p_mps.transpose();
    }

    /// Counts a rejected reading that only an error beyond five sigma explains; returns the factor of the covariance where the
    /// readings are to be believed.
    pub(super) fn note_doubtful(&mut self, sensor: Sensor, factor: f64, velocity_p_mps: Vector3<f64>) -> Option<f64> {
        let time_ns = self.state.time_ns;
        // Of beams some may be right: through a wide covariance their noise would get in.
        let is_held = sensor != Sensor::Beams;
        let needed = (
            self.inflate_after_rejections,
            if is_held { 0 } else { LONGEST_DOUBT_NS },
        );
        let doubt = self.consecutive_rejections.doubts.of_mut(sensor)?;
        let run = doubt.count.rejection(factor, velocity_p_mps, needed, time_ns)?;
        if !is_held {
            return Some(run.factor);
        }
        doubt.open = Some(Difference {
            since_ns: run.since_ns,
            factor: run.factor,
            velocity_p_mps,
        });
        self.doubt_velocity(&velocity_p_mps);
        None
    }

    /// Whether the covariance of the velocity still holds the difference that is doubted: other sensors may have told since
    /// which of the two is right.
    pub(super) fn is_in_doubt(&self, sensor: Sensor) -> bool {
        self.doubted(sensor).is_some_and(|difference| {
            let velocity = self.covariance.fixed_view::<3, 3>(VELOCITY, VELOCITY);
            difference.dot(&(velocity * difference)) >= STILL_HELD * difference.norm_squared().powi(2)
        })
    }

    /// Whether a reading is one of those that are doubted: nearer to what they show than to the filter.
    pub(super) fn is_doubted(&self, innovation: &Innovation, sensor: Sensor) -> bool {
        if innovation.tangent_rows != TangentRows::None || !self.is_in_doubt(sensor) {
            return false;
        }
        let shown = innovation.jacobian.fixed_columns::<3>(VELOCITY) * self.doubted(sensor).unwrap_or_default();
        2.0 * innovation.residual.dot(&shown) > shown.norm_squared()
    }
}

#[cfg(test)]
#[path = "doubt_tests.rs"]
mod tests;
