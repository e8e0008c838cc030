//! The linear error models by their names, for a window and for a history.

use super::history::{History, of_filter, of_paper};
use super::paper::{self, Sensors, Sign};
use super::{Aiding, Epochs, System, full};
use crate::aiding::registry::Sensor;
use crate::dvl::geometry::BeamGeometry;
use crate::error::NavError;
use crate::model::Model;
use crate::simulation::truth::Truth;
use crate::stop::Stop;

/// A linear error model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The filter's, with its DVL states or with those frozen.
    Filter {
        /// Whether biases and scale factor of the DVL are estimated.
        estimate_dvl: bool,
    },
    /// That of 2015, with a sign of its measurement matrix.
    Paper(Sign),
}

impl Kind {
    /// The model of a name.
    ///
    /// # Errors
    /// [`NavError::Setting`], which lists the known names.
    pub fn named(name: &str) -> Result<Self, NavError> {
        match name {
            "full" => Ok(Self::Filter { estimate_dvl: true }),
            "inertial" => Ok(Self::Filter { estimate_dvl: false }),
            "paper" => Ok(Self::Paper(Sign::Consistent)),
            "paper_printed" => Ok(Self::Paper(Sign::Printed)),
            other => Err(NavError::setting(
                "kind",
                format!("is '{other}'"),
                "'full', 'inertial', 'paper' or 'paper_printed'",
            )),
        }
    }

    /// Checks that the model has such epochs and sensors: that of 2015 has periodic epochs, a DVL and a depth sensor only.
    ///
    /// # Errors
    /// [`NavError::Setting`].
    pub fn check(self, sets: &[Aiding], epochs: Epochs<'_>) -> Result<(), NavError> {
        if matches!((self, epochs), (Self::Paper(_), Epochs::Scheduled(_))) {
            let found = "cannot be followed: the 2015 model has periodic epochs only";
            return Err(NavError::setting("schedule", found, "period_ns in its place"));
        }
        let known = |set: &Aiding| {
            let sensors = [Sensor::Velocity, Sensor::Depth].into_iter();
            let sensors = sensors.filter(|&sensor| set.sensors.contains(sensor)).collect();
            *set == Aiding {
                sensors,
                ..Aiding::default()
            }
        };
        if matches!(self, Self::Paper(_)) && !sets.iter().all(known) {
            let found = "has other sensors: the 2015 model has velocity and depth aiding only";
            return Err(NavError::setting("aiding", found, "no other sensor"));
        }
        Ok(())
    }

    /// The sensors of an aiding set in the model of 2015; `None` for the filter's model.
    fn sensors(self, set: &Aiding) -> Option<Sensors> {
        match self {
            Self::Filter { .. } => None,
            Self::Paper(sign) => Some(Sensors {
                velocity: set.sensors.contains(Sensor::Velocity).then_some(sign),
                depth: set.sensors.contains(Sensor::Depth),
            }),
        }
    }

    /// The rows of every aiding set along a truth.
    ///
    /// # Errors
    /// As [`Kind::check`], [`full::systems`] and [`paper::system`].
    pub fn systems(
        self,
        truth: &Truth<'_>,
        geometry: &BeamGeometry,
        model: &Model,
        sets: &[Aiding],
        epochs: Epochs<'_>,
    ) -> Result<Vec<System>, NavError> {
        self.check(sets, epochs)?;
        match (self, epochs) {
            (Self::Paper(_), Epochs::Every(period_ns)) => {
                let sensors = sets.iter().filter_map(|set| self.sensors(set));
                sensors
                    .map(|sensors| paper::system(truth, model, &sensors, period_ns))
                    .collect()
            }
            _ => full::systems(
                truth,
                geometry,
                model,
                sets,
                self == Self::Filter { estimate_dvl: true },
                epochs,
            ),
        }
    }

    /// Names of the states and the covariance after every epoch along a truth.
    ///
    /// # Errors
    /// As [`Kind::check`], [`of_filter`] and [`of_paper`].
    pub fn history(
        self,
        truth: &Truth<'_>,
        geometry: &BeamGeometry,
        model: &Model,
        set: &Aiding,
        epochs: Epochs<'_>,
        stop: &Stop,
    ) -> Result<(&'static [&'static str], History), NavError> {
        self.check(&[*set], epochs)?;
        if let (Some(sensors), Epochs::Every(period_ns)) = (self.sensors(set), epochs) {
            let history = of_paper(truth, model, &sensors, period_ns, stop)?;
            let states = history.covariance.first().map_or(0, |covariance| covariance.nrows());
            return Ok((&paper::NAMES[15 - states..], history));
        }
        let estimate_dvl = self == Self::Filter { estimate_dvl: true };
        let history = of_filter(truth, geometry, model, set, estimate_dvl, epochs, stop)?;
        Ok((&full::NAMES, history))
    }
}
