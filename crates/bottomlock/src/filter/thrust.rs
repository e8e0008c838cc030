//! Revolutions of the propeller and forces of the thrusters in a filter: advance and slip as estimated, and the Jacobian by the
//! advance.
//!
//! The advance of a force is the speed over that by the drag law ([`crate::aiding::effort`]), and the speed by the drag law its n.
//!
//! # The Jacobian by the advance
//! The row is â n + ŝ − û with n as it was read, and its column of the advance is n̄, the revolutions without slip and noise. Of the
//! innovation z these have the part (P_ss + R)/S, and n̄ = n − z/â times as much. While advance and current are open, S is large and
//! n̄ is what was read; later it is what is expected, û/â, which the noise of this reading has no part in. It is that from ten
//! times on: half of a reading's noise in n̄, time and again, would still let the advance shrink.
//!
//! Where they contradict the beams, which know the velocity, advance, slip and current become uncertain ([`super::evidence`]), each by
//! its variance: where hardly anything turns the slip, since something else drives the vehicle or holds it.

use nalgebra::{SMatrix, SVector};

use super::Eskf;
use super::joseph::PredictedInnovation;
use crate::aiding::effort::{self, SPEED_SCALE, effort_axis};
use crate::aiding::further::{FIRST_EFFORT, FIRST_THRUST};
use crate::aiding::registry::{Levers, Measurement, Sensor, SensorKind};
use crate::aiding::thrust::{ADVANCE, SLIP, THRUST};
use crate::aiding::{Corrects, Innovation};

/// The advance and the slip of a report among the further states.
pub(crate) struct SpeedStates {
    advance: usize,
    slip: usize,
}

impl SpeedStates {
    /// Those of a report; `None` for one that says no speed through the water by what drives the vehicle.
    pub(crate) fn of(sensor: Sensor) -> Option<Self> {
        if sensor == Sensor::Thrust {
            let (advance, slip) = (FIRST_THRUST + ADVANCE, FIRST_THRUST + SLIP);
            return Some(Self { advance, slip });
        }
        effort_axis(sensor).map(|axis| Self {
            advance: FIRST_EFFORT + SPEED_SCALE + axis,
            slip: FIRST_EFFORT + effort::SLIP + axis,
        })
    }
}

/// S over the variance of slip and noise up to which all of the innovation is theirs.
const KNOWN: f64 = 10.0;

impl Eskf {
    /// Advance per revolution, m, and slip of the propeller, m/s, with the covariance of their errors; `None` where they are not
    /// estimated.
    #[must_use]
    pub fn thrust(&self) -> Option<(SVector<f64, THRUST>, SMatrix<f64, THRUST, THRUST>)> {
        let processes = &self.extensions.processes;
        let is_estimated = processes.unknown().any(|block| block.start == FIRST_THRUST);
        is_estimated.then(|| {
            let estimate = processes.estimate().fixed_rows::<THRUST>(FIRST_THRUST).into_owned();
            (estimate, self.extensions.covariance_of(FIRST_THRUST))
        })
    }

    /// Brings current and covariance up to date before revolutions or forces are taken.
    pub(crate) fn prepare_for_thrust(&mut self) {
        self.propagate_covariance();
        self.prepare_for_water(None);
    }

    /// The innovation of a sensor beside the beams.
    pub(crate) fn measured_innovation(&self, measurement: &Measurement, sensor: Sensor, levers: &Levers) -> Innovation {
        match (measurement, effort_axis(sensor)) {
            (Measurement::Effort(sample), Some(axis)) => {
                self.effort_innovation(axis, sample, levers.of(SensorKind::Effort))
            }
            _ => self.with_motion(|motion| measurement.innovation(sensor, motion, levers)),
        }
    }

    /// The same with the states that it corrects, where it is of revolutions or forces.
    pub(crate) fn aiding_innovation(
        &self,
        measurement: &Measurement,
        sensor: Sensor,
        levers: &Levers,
        corrects: Corrects,
    ) -> Innovation {
        let innovation = self.measured_innovation(measurement, sensor, levers);
        match SpeedStates::of(sensor) {
            Some(states) => self.without_slip(&states, innovation, corrects),
            None => innovation,
        }
    }

    /// The innovation of revolutions or forces with the column of the advance without slip and noise, and with the states that it
    /// corrects; [`Eskf::prepare_for_thrust`] has gone before.
    fn without_slip(&self, states: &SpeedStates, innovation: Innovation, corrects: Corrects) -> Innovation {
        let advance = self.extensions.processes.estimate()[states.advance];
        let found = self.with_further_noise(&innovation).and_then(|whole| {
            let s = PredictedInnovation::<1>::of(&self.covariance, &whole)?.s[(0, 0)];
            let slip = self.extensions.further().covariance()[(states.slip, states.slip)];
            let own = slip + innovation.noise[(0, 0)];
            Some(whole.residual[0] * (KNOWN * own / s).min(1.0))
        });
        let mut innovation = Innovation { corrects, ..innovation };
        if let (Some(slip_mps), Some(rows)) = (found, &mut innovation.by_further)
            && advance != 0.0
        {
            // The filter adds â n̄ to the residual, which has â n.
            rows[(0, states.advance)] += slip_mps / advance;
            innovation.residual[0] += slip_mps;
        }
        innovation
    }

    /// Begins the slip anew, with a variance of its own.
    #[cfg(test)]
    pub(super) fn renew_slip(&mut self, variance: f64) {
        if let Some(further) = &mut self.extensions.further {
            further.renew(FIRST_THRUST + SLIP, variance);
        }
        let slip = FIRST_THRUST + SLIP;
        let mut back = crate::aiding::further::FurtherVector::zeros();
        back[slip] = -self.extensions.processes.estimate()[slip];
        self.extensions.processes.inject(&back);
    }
}

#[cfg(test)]
#[path = "thrust_tests.rs"]
mod tests;
