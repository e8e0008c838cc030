//! Observability of an aided navigator along a motion: stacked measurement rows, rank, and unobservable subspace.
//!
//! The rows H(t_k) Φ(t_k, t_0) over a window are stacked, and their singular values give the rank. The Gramian of Klein
//! & Diamant 2015, Eq. (1), is the square of the stack, which costs half the digits; it is computed for comparison.
//! Columns are scaled by the effect of a state over the window, so that states of different units are comparable.
//!
//! The linear models are [`full`], the 20-state filter of this crate along any truth (or its first 15 states), and
//! [`paper`], the 2015 model with its closed-form transition matrix and either sign of its measurement matrix.
//!
//! # Frames and units
//! As in [`crate::layout`], SI, also for the basis of the unobservable subspace.

pub mod full;
pub mod history;
pub mod kind;
mod magnus;
pub mod paper;
pub mod rank;

use nalgebra::{DMatrix, DVector};

use crate::aiding::registry::{Levers, Sensor, reports};
use crate::dvl::geometry::{BEAM_EXISTS, BeamGeometry, BeamMask};
use crate::error::NavError;
use crate::simulation::truth::Truth;

/// A set of aiding sensors, whose rows are stacked.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Aiding {
    /// Valid DVL beams.
    pub beams: BeamMask,
    /// Other sensors.
    pub sensors: SensorSet,
    /// Lever arms of the sensors, platform frame, m.
    pub levers: Levers,
}

/// A set of sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SensorSet(u64);

impl SensorSet {
    /// Returns true if the sensor is in the set.
    #[must_use]
    pub const fn contains(self, sensor: Sensor) -> bool {
        self.0 & (1 << sensor as u64) != 0
    }
    /// The sensors in both sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl FromIterator<Sensor> for SensorSet {
    fn from_iter<I: IntoIterator<Item = Sensor>>(sensors: I) -> Self {
        Self(sensors.into_iter().fold(0, |set, sensor| set | 1 << sensor as u64))
    }
}

/// Measurement epochs of a window.
#[derive(Debug, Clone, Copy)]
pub enum Epochs<'a> {
    /// All sensors of the aiding set at a period, ns, from the first truth sample on.
    Every(i64),
    /// At each time, ns, the sensors that are both in the aiding set and in the given set.
    Scheduled(&'a [(i64, Aiding)]),
}

impl Aiding {
    /// Checks that the set is not empty, that its beams exist, and that its lever arms are finite.
    ///
    /// # Errors
    /// [`NavError::WrongCount`] for an empty set, [`NavError::BadBeam`] for a beam that the geometry lacks,
    /// [`NavError::NotFinite`] for a lever arm.
    pub fn validate(&self, geometry: &BeamGeometry) -> Result<(), NavError> {
        self.levers.validate("aiding.levers")?;
        if self.is_empty() {
            let names: Vec<&str> = reports().map(|(_, report)| report.name()).collect();
            return Err(NavError::WrongCount {
                field: "aiding sensors",
                got: 0,
                expected: format!("at least one of a beam, {}", names.join(", ")),
            });
        }
        if let Some(beam) = self.beams.iter().find(|&beam| beam >= geometry.beams()) {
            return Err(NavError::BadBeam {
                beam: beam + 1,
                time_ns: 0,
                field: "number",
                value: (beam + 1) as f64,
                expected: BEAM_EXISTS,
            });
        }
        Ok(())
    }

    /// Returns true if no sensor is in the set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.beams == BeamMask::default() && self.sensors == SensorSet::default()
    }

    /// The sensors in both sets, with the lever arms of `self`.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        Self {
            beams: self.beams.and(other.beams),
            sensors: self.sensors.and(other.sensors),
            levers: self.levers,
        }
    }
}

/// Measurement rows at one time, with the transition matrix to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Epoch {
    /// Time, ns.
    pub time_ns: i64,
    /// Φ(t, t_0), states by states, SI.
    pub transition: DMatrix<f64>,
    /// Φ(t, t_0) from half as many samples: the difference bounds the quadrature error.
    pub coarse: DMatrix<f64>,
    /// H(t), one row per measurement.
    pub rows: DMatrix<f64>,
    /// Reading of each row for a change of the states by their scales: m/s, m or rad.
    pub row_scale: DVector<f64>,
    /// Measurement noise covariance, SI.
    pub noise: DMatrix<f64>,
}

/// Linear system over a window, as [`rank::observe`] analyses it.
#[derive(Debug, Clone, PartialEq)]
pub struct System {
    /// Name of each state.
    pub names: Vec<String>,
    /// Quantity of each state, which sets its scale.
    pub kinds: Vec<StateKind>,
    /// Gravity, m/s²: couples tilt to velocity.
    pub gravity_mps2: f64,
    /// Largest speed over the window, m/s: couples the scale factor to velocity.
    pub speed_mps: f64,
    /// Measurement epochs in order of time; the first is at t_0.
    pub epochs: Vec<Epoch>,
}

/// Quantity of a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateKind {
    /// Position, m.
    Position,
    /// Misalignment, rad.
    Tilt,
    /// Velocity, m/s.
    Velocity,
    /// A beam's bias, m/s.
    BeamBias,
    /// Accelerometer bias, m/s².
    AccelBias,
    /// Gyro bias, rad/s.
    GyroBias,
    /// Scale factor of the velocity.
    ScaleFactor,
}

impl System {
    /// Number of states.
    #[must_use]
    pub fn states(&self) -> usize {
        self.names.len()
    }

    /// The size of each state that changes a velocity by 1 m/s over T = `duration_s`: tilt 1/(g T), accelerometer bias
    /// 1/T, gyro bias 2/(g T²), position T.
    #[must_use]
    pub fn scales(&self, duration_s: f64) -> DVector<f64> {
        let speed = if self.speed_mps > 0.1 { self.speed_mps } else { 1.0 };
        DVector::from_iterator(
            self.states(),
            self.kinds.iter().map(|kind| match kind {
                StateKind::Position => duration_s,
                StateKind::Tilt => 1.0 / (self.gravity_mps2 * duration_s),
                StateKind::Velocity | StateKind::BeamBias => 1.0,
                StateKind::AccelBias => 1.0 / duration_s,
                StateKind::GyroBias => 2.0 / (self.gravity_mps2 * duration_s * duration_s),
                StateKind::ScaleFactor => 1.0 / speed,
            }),
        )
    }
}

/// Largest number of epochs of a window: over an hour of a sensor at 1 Hz, with the memory of many masks in bounds.
const MAX_EPOCHS: usize = 5000;

fn too_many(epochs: usize) -> NavError {
    NavError::WrongCount {
        field: "epochs of the window",
        got: epochs,
        expected: format!("at most {MAX_EPOCHS}: a shorter window or a longer period_ns"),
    }
}

fn too_few(epochs: usize) -> NavError {
    NavError::WrongCount {
        field: "epochs of the window",
        got: epochs,
        expected: "at least 2: a longer window or a shorter period_ns".into(),
    }
}

/// Truth samples of a schedule: for each time the first sample at or after it.
///
/// # Errors
/// [`NavError::TimeNotIncreasing`], also for two times within one sample interval; [`NavError::OutsideTruth`];
/// [`NavError::WrongCount`] for fewer than two epochs or more than 5000.
pub(crate) fn scheduled_samples(truth: &Truth<'_>, scheduled: &[(i64, Aiding)]) -> Result<Vec<usize>, NavError> {
    truth.validate()?;
    let (first_ns, last_ns) = (truth.time_ns[0], truth.time_ns[truth.time_ns.len() - 1]);
    let mut samples: Vec<usize> = Vec::new();
    for (index, &(time_ns, _)) in scheduled.iter().enumerate() {
        if time_ns < first_ns || time_ns > last_ns {
            return Err(NavError::OutsideTruth {
                stream: "schedule",
                time_ns,
                first_ns,
                last_ns,
            });
        }
        let sample = truth.time_ns.partition_point(|&t| t < time_ns);
        if samples.last().is_some_and(|&before| before >= sample) {
            return Err(NavError::TimeNotIncreasing {
                stream: "schedule (in steps of a truth sample)",
                time_ns,
                previous_ns: scheduled[index - 1].0,
            });
        }
        samples.push(sample);
    }
    match samples.len() {
        count @ (0 | 1) => Err(too_few(count)),
        count if count > MAX_EPOCHS => Err(too_many(count)),
        _ => Ok(samples),
    }
}

/// Truth samples of periodic epochs: for each period the first sample at or after it.
///
/// # Errors
/// [`NavError::OutOfRange`] for a period that is not positive; [`NavError::WrongCount`] for fewer than two epochs or
/// more than 5000.
pub(crate) fn epoch_samples(truth: &Truth<'_>, period_ns: i64) -> Result<Vec<usize>, NavError> {
    truth.validate()?;
    if period_ns <= 0 {
        return Err(NavError::OutOfRange {
            field: "period_ns",
            value: period_ns as f64,
            expected: "a positive number of nanoseconds",
        });
    }
    let (first, last) = (truth.time_ns[0], truth.time_ns[truth.time_ns.len() - 1]);
    let mut samples = Vec::new();
    let mut target = first;
    while target <= last {
        let sample = truth.time_ns.partition_point(|&t| t < target);
        samples.push(sample);
        if samples.len() > MAX_EPOCHS {
            return Err(too_many(samples.len()));
        }
        // After a gap in the truth the next multiple of the period follows, so that no sample is used twice.
        let behind = i128::from(truth.time_ns[sample]) - i128::from(target);
        let next = i128::from(target) + (behind / i128::from(period_ns) + 1) * i128::from(period_ns);
        match i64::try_from(next) {
            Ok(time_ns) => target = time_ns,
            Err(_) => break,
        }
    }
    if samples.len() < 2 {
        return Err(too_few(samples.len()));
    }
    Ok(samples)
}

#[cfg(test)]
mod input_tests;
#[cfg(test)]
mod tests;
