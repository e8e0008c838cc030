//! Covariance inflation after consecutive rejections.
//!
//! Correct measurements are rejected rarely and one at a time: at 99.73 % five consecutive rejections occur once in 10¹²
//! measurements. But if the error of the filter exceeds its covariance, for example with an initial tilt error of four
//! sigma, the innovation grows as fast as its sigma, the NIS stays constant, and every measurement of a mission is
//! rejected. After a number of consecutive rejections by one sensor the covariance is therefore multiplied by the factor
//! with which NIS is what it is expected to be, and the measurement is tested again.
//!
//! What is inflated depends on what the sensor measures:
//!
//! - a velocity: all inertial states, since a wrong velocity most often comes from a wrong tilt. What goes beyond five
//!   sigma is no error of the tilt: the rest of the factor applies to the velocity alone;
//! - a position, where no velocity was accepted since the first rejection or the accepted ones leave a direction open: the same
//!   with the position;
//! - a position else, a depth, an angle: the states in its rows alone, so that a wrong sensor cannot spoil the others.
//!
//! Three kinds of rejections do not count. Beams that contradict each other are rejected whatever the covariance.
//! Measurements that do not agree from one to the next are noise: an error of the filter changes little
//! between two of them. Neither do rejected assumptions count. What a sensor shows beyond five sigma of a velocity that
//! it has confirmed before is a matter of doubt ([`super::doubt`]).

use std::ops::Range;

use nalgebra::{SMatrix, Vector3};

use super::Eskf;
use super::doubt::{Doubt, Doubts};
use crate::aiding::sensor::Quantity;
use crate::aiding::{Innovation, MAX_ROWS};
use crate::error::{NavError, require_finite};
use crate::filter::gate::FIVE_SIGMA_FACTOR;
use crate::filter::report::Sensor;
use crate::layout::{ATTITUDE, DIM, DVL_BIAS, POSITION, VELOCITY};

/// Factor on the inertial covariance with which every error of an inertial state passes the gate.
const UNINFORMATIVE_FACTOR: f64 = 1e6;

/// Halvings of the logarithm of a factor: four digits.
const BISECTIONS: usize = 20;

/// Largest attitude sigma after inflation, rad.
const MAX_ATTITUDE_SD_RAD: f64 = 1.0;
/// Largest position sigma after inflation, m.
const MAX_POSITION_SD_M: f64 = 1e6;

type Rows = SMatrix<f64, MAX_ROWS, MAX_ROWS>;

/// The errors of the inertial states of which a rejected measurement may be evidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AdmissibleError {
    /// Of any size.
    Any,
    /// Of up to five of the claimed sigma.
    FiveSigma,
}

impl AdmissibleError {
    /// On the inertial covariance.
    const fn factor(self) -> f64 {
        match self {
            Self::Any => UNINFORMATIVE_FACTOR,
            Self::FiveSigma => FIVE_SIGMA_FACTOR,
        }
    }
}

/// Counts of consecutive rejections, by sensor.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct ConsecutiveRejections {
    explained: Box<[Count; Sensor::COUNT]>,
    pub(super) doubts: Doubts,
}

impl ConsecutiveRejections {
    /// The count of a sensor.
    pub(super) fn explained(&mut self, sensor: Sensor) -> &mut Count {
        &mut self.explained[sensor as usize]
    }

    /// Checks counts that were read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        self.explained
            .iter()
            .try_for_each(|count| count.check_restored(time_ns))?;
        self.doubts.check_restored(time_ns)
    }
}

/// The consecutive rejections of one sensor.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Count {
    measurements: u32,
    /// Sum of the logarithms of their factors.
    log_factor: f64,
    /// Time of the first.
    since_ns: i64,
    /// What the last showed of the measured quantity's error.
    correction: Vector3<f64>,
}

impl Count {
    /// Checks a count that was read from bytes.
    ///
    /// # Errors
    /// [`NavError::NotFinite`].
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        require_finite("rejections", time_ns, &[self.log_factor])?;
        require_finite("rejections", time_ns, self.correction.as_slice())
    }

    /// Counts a rejection; returns the run, which is over, if it completes `most` of them and has lasted `least_ns`.
    pub(super) fn rejection(
        &mut self,
        factor: f64,
        correction: Vector3<f64>,
        (most, least_ns): (u32, i64),
        time_ns: i64,
    ) -> Option<Run> {
        if self.measurements == 0 || !agree(&self.correction, &correction) {
            *self = Self {
                since_ns: time_ns,
                ..Self::default()
            };
        }
        self.correction = correction;
        self.measurements += 1;
        self.log_factor += factor.ln();
        (self.measurements >= most && time_ns - self.since_ns >= least_ns).then(|| {
            let run = std::mem::take(self);
            Run {
                since_ns: run.since_ns,
                factor: (run.log_factor / f64::from(run.measurements)).exp(),
            }
        })
    }
}

/// Consecutive rejections that agree.
pub(super) struct Run {
    /// Time of the first.
    pub(super) since_ns: i64,
    /// Geometric mean of their factors.
    pub(super) factor: f64,
}

/// Returns true if two errors differ by less than half their root sum of squares, as two of an error that grows
/// in proportion to time do.
fn agree(one: &Vector3<f64>, other: &Vector3<f64>) -> bool {
    (other - one).norm_squared() <= 0.25 * (one.norm_squared() + other.norm_squared())
}

impl Eskf {
    /// Number of consecutive rejections after which the covariance is inflated; 0 for never.
    pub(crate) fn rejections_allowed(&self) -> u32 {
        self.inflate_after_rejections
    }

    /// Notes that a measurement passed its gate.
    pub(crate) fn note_accepted(&mut self, sensor: Sensor) {
        self.consecutive_rejections.explained[sensor as usize] = Count::default();
        if let Some(doubt) = self.consecutive_rejections.doubts.of_mut(sensor) {
            *doubt = Doubt::default();
        }
    }

    /// Counts the rejection of a measurement with this innovation, and inflates the covariance once the limit of
    /// consecutive rejections is reached; returns the factor. A rejection that no `admissible` error explains does not count.
    ///
    /// # Errors
    /// [`NavError::NotFinite`] for an innovation that is not finite.
    pub(crate) fn note_rejected(
        &mut self,
        innovation: &Innovation,
        sensor: Sensor,
        admissible: AdmissibleError,
    ) -> Result<Option<f64>, NavError> {
        let Some(quantity) = sensor.quantity().filter(|_| self.inflate_after_rejections > 0) else {
            return Ok(None);
        };
        self.propagate_covariance();
        require_finite("innovation", self.state.time_ns, innovation.residual.as_slice())?;
        let with_further_noise = self.with_further_noise(innovation);
        let innovation = with_further_noise.as_deref().unwrap_or(innovation);
        let by_inertial = self.innovation_covariance(innovation, &states(0..DVL_BIAS));
        let mut whole = self.innovation_covariance(innovation, &states(0..DIM)) + innovation.noise;
        if let Some(cross) = &innovation.cross {
            let half = innovation.jacobian * **cross;
            whole += half + half.transpose();
        }
        if self.is_doubted(innovation, sensor) {
            let difference = solved(innovation, VELOCITY);
            let doubt = self.consecutive_rejections.doubts.of_mut(sensor);
            return Ok(doubt.and_then(|doubt| doubt.go_on(difference, self.state.time_ns)));
        }
        if self.is_in_doubt(sensor) {
            return Ok(None);
        }
        let explains =
            |covariance: &Rows| norm_squared(innovation, covariance) <= self.plausible.threshold(innovation.degrees);
        let widest = |admissible: AdmissibleError| whole + by_inertial * (admissible.factor() - 1.0);
        if explains(&whole) {
            self.note_accepted(sensor);
            return Ok(None);
        }
        let is_doubtful = !explains(&widest(admissible));
        if is_doubtful && !explains(&widest(AdmissibleError::Any)) {
            return Ok(None);
        }
        let block = match quantity {
            Quantity::Position => POSITION,
            Quantity::Velocity => VELOCITY,
            Quantity::Angle => ATTITUDE,
        };
        let (measured, inflated) = self.inflated_states(innovation, sensor, quantity, block);
        let factor = matching_factor(innovation, &whole, &self.innovation_covariance(innovation, &inflated));
        let correction = solved(innovation, block);
        let factor = if is_doubtful {
            self.note_doubtful(sensor, factor, correction)
        } else {
            let needed = (self.inflate_after_rejections, 0);
            let count = &mut self.consecutive_rejections.explained[sensor as usize];
            count
                .rejection(factor, correction, needed, self.state.time_ns)
                .map(|run| run.factor)
        };
        let Some(factor) = factor else { return Ok(None) };
        let indirect = factor
            .min(FIVE_SIGMA_FACTOR)
            .min(self.largest_factor(&inflated))
            .max(1.0);
        let direct = (factor / indirect)
            .min(self.largest_factor(&measured) / indirect)
            .max(1.0);
        self.inflate(&inflated, indirect);
        self.inflate(&measured, direct);
        Ok((indirect * direct > 1.0).then_some(indirect * direct))
    }

    /// Multiplies the covariance of some states, which adds noise to them.
    fn inflate(&mut self, states: &[bool; DIM], factor: f64) {
        for i in (0..DIM).filter(|&i| states[i]) {
            for j in (0..DIM).filter(|&j| states[j]) {
                self.covariance[(i, j)] *= factor;
            }
        }
    }

    /// The states that the sensor measures itself, and all those to inflate.
    fn inflated_states(
        &self,
        innovation: &Innovation,
        sensor: Sensor,
        quantity: Quantity,
        block: usize,
    ) -> ([bool; DIM], [bool; DIM]) {
        let since_ns = match self.consecutive_rejections.explained[sensor as usize] {
            Count { measurements: 0, .. } => self.state.time_ns,
            count => count.since_ns,
        };
        let has_velocity = self.measured.velocity_ns.is_some_and(|time_ns| time_ns >= since_ns);
        let measured = match quantity {
            Quantity::Velocity => states(VELOCITY..VELOCITY + 3),
            Quantity::Position | Quantity::Angle => observed(innovation, block),
        };
        let is_open = !has_velocity || self.is_beyond_linear_range();
        let is_free = quantity == Quantity::Position && innovation.rows == 3 && is_open;
        if quantity == Quantity::Velocity || is_free {
            (measured, states(0..DVL_BIAS))
        } else {
            (measured, measured)
        }
    }

    /// H P Hᵀ of the errors of some states.
    fn innovation_covariance(&self, innovation: &Innovation, states: &[bool; DIM]) -> Rows {
        let mut h = innovation.jacobian;
        for k in (0..DIM).filter(|&k| !states[k]) {
            h.column_mut(k).fill(0.0);
        }
        h * self.covariance * h.transpose()
    }

    /// Factor that keeps attitude and position sigmas below their limits.
    ///
    /// A method with a wrong assumption is rejected again and again, and must not inflate its covariance without bound.
    fn largest_factor(&self, inflated: &[bool; DIM]) -> f64 {
        let largest = |block: usize| {
            (block..block + 3)
                .filter(|&k| inflated[k])
                .fold(0.0_f64, |most, k| most.max(self.covariance[(k, k)]))
        };
        let factor = |sd: f64, variance: f64| sd * sd / variance;
        factor(MAX_ATTITUDE_SD_RAD, largest(ATTITUDE)).min(factor(MAX_POSITION_SD_M, largest(POSITION)))
    }
}

/// The states of a range.
fn states(range: Range<usize>) -> [bool; DIM] {
    std::array::from_fn(|k| range.contains(&k))
}

/// The states of a block of three that the rows measure: those whose column has at least half the largest entry.
fn observed(innovation: &Innovation, block: usize) -> [bool; DIM] {
    let weight: [f64; 3] = std::array::from_fn(|k| innovation.jacobian.column(block + k).amax());
    let largest = weight.iter().fold(0.0_f64, |most, &one| most.max(one));
    std::array::from_fn(|k| (block..block + 3).contains(&k) && weight[k - block] >= 0.5 * largest)
}

/// The error of a block of three states that the rows show, of minimum norm where they leave a direction open.
fn solved(innovation: &Innovation, block: usize) -> Vector3<f64> {
    let rows = innovation.jacobian.view((0, block), (innovation.rows, 3)).into_owned();
    let z = innovation.residual.rows(0, innovation.rows);
    rows.pseudo_inverse(1e-6).map_or_else(
        |_| Vector3::zeros(),
        |inverse| {
            let solution = inverse * z;
            Vector3::new(solution[0], solution[1], solution[2])
        },
    )
}

/// zᵀS⁻¹z; infinite where S is not positive definite.
fn norm_squared(innovation: &Innovation, s: &Rows) -> f64 {
    let m = innovation.rows;
    let z = innovation.residual.rows(0, m);
    let factor = s.view((0, 0), (m, m)).into_owned().cholesky();
    factor.map_or(f64::INFINITY, |factor| z.dot(&factor.solve(&z)))
}

/// The factor on the part `own` of S with which NIS is what it is expected to be, its degrees of freedom and what no
/// factor explains; 1 where it is less already.
fn matching_factor(innovation: &Innovation, s: &Rows, own: &Rows) -> f64 {
    let nis = |factor: f64| norm_squared(innovation, &(s + own * (factor - 1.0)));
    let expected = innovation.degrees as f64 + nis(UNINFORMATIVE_FACTOR);
    let (mut low, mut high) = (0.0, UNINFORMATIVE_FACTOR.ln());
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if nis(middle.exp()) > expected {
            low = middle;
        } else {
            high = middle;
        }
    }
    high.exp()
}

#[cfg(test)]
#[path = "inflation_tests.rs"]
mod tests;
