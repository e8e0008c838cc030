//! Speeds by the vehicle's drives in a filter: scale and slip as estimated, and the Jacobian by the scale.
//!
//! # The Jacobian by the scale
//! The row is â n + ŝ − û with n as it was read, and its column of the scale is n̄, the speed without slip and noise. Of the
//! innovation z these have the part (P_ss + R)/S, and n̄ = n − z/â times as much. While scale and current are open, S is large and
//! n̄ is what was read; later it is what is expected, û/â, which the noise of this reading has no part in. It is that from ten
//! times on: half of a reading's noise in n̄, time and again, would still let the scale shrink.
//!
//! Where they contradict the beams, which know the velocity, scale, slip and current become uncertain ([`super::evidence`]), each by
//! its variance: where hardly anything turns the slip, since something else drives the vehicle or holds it.

use nalgebra::{SMatrix, SVector};

use super::Eskf;
use super::joseph::PredictedInnovation;
use crate::aiding::further::block;
use crate::aiding::registry::{Levers, Measurement, Sensor};
use crate::aiding::thrust::{SCALE, SLIP, THRUST, thrust_axis};
use crate::aiding::{Corrects, Innovation};

/// The scale and the slip of a report among the further states.
pub(crate) struct SpeedStates {
    scale: usize,
    slip: usize,
}

impl SpeedStates {
    /// Those of a report; `None` for one that says no speed through the water by what drives the vehicle.
    pub(crate) fn of(sensor: Sensor) -> Option<Self> {
        thrust_axis(sensor).map(|axis| Self {
            scale: block::THRUST.first + SCALE + axis,
            slip: block::THRUST.first + SLIP + axis,
        })
    }
}

/// S over the variance of slip and noise up to which all of the innovation is theirs.
const KNOWN: f64 = 10.0;

impl Eskf {
    /// Scale and slip, m/s, of the speed by the drives, along surge, sway and heave each, with the covariance of their errors; `None`
    /// where they are not estimated.
    #[must_use]
    pub fn thrust(&self) -> Option<(SVector<f64, THRUST>, SMatrix<f64, THRUST, THRUST>)> {
        let further = self.extensions.further();
        further.has(block::THRUST).then(|| {
            let estimate = further
                .estimate()
                .fixed_rows::<THRUST>(block::THRUST.first)
                .into_owned();
            (estimate, self.extensions.covariance_of(block::THRUST.first))
        })
    }

    /// Brings current and covariance up to date before speeds by the drives are taken.
    pub(crate) fn prepare_for_thrust(&mut self) {
        self.propagate_covariance();
        self.prepare_for_water(None);
    }

    /// The innovation of a sensor beside the beams, with the states that it corrects, where it is of the drives; without rows
    /// for an axis that the model does not use.
    pub(crate) fn aiding_innovation(
        &self,
        measurement: &Measurement,
        sensor: Sensor,
        levers: &Levers,
        corrects: Corrects,
    ) -> Innovation {
        let innovation = self.with_motion(|motion| measurement.innovation(sensor, motion, levers));
        match SpeedStates::of(sensor) {
            Some(states) if self.extensions.further().variance()[states.slip] == 0.0 => Innovation::empty(),
            Some(states) => self.without_slip(&states, innovation, corrects),
            None => innovation,
        }
    }

    /// The innovation of a speed by the drives with the column of the scale without slip and noise, and with the states that it
    /// corrects; [`Eskf::prepare_for_thrust`] has gone before.
    fn without_slip(&self, states: &SpeedStates, innovation: Innovation, corrects: Corrects) -> Innovation {
        let scale = self.extensions.further().estimate()[states.scale];
        let found = self.with_further_noise(&innovation).and_then(|whole| {
            let s = PredictedInnovation::<1>::of(&self.covariance, &whole)?.s[(0, 0)];
            let slip = self.extensions.further().covariance()[(states.slip, states.slip)];
            let own = slip + innovation.noise[(0, 0)];
            Some(whole.residual[0] * (KNOWN * own / s).min(1.0))
        });
        let mut innovation = Innovation { corrects, ..innovation };
        if let (Some(slip_mps), Some(rows)) = (found, &mut innovation.by_further)
            && scale != 0.0
        {
            // The filter adds â n̄ to the residual, which has â n.
            rows[(0, states.scale)] += slip_mps / scale;
            innovation.residual[0] += slip_mps;
        }
        innovation
    }
}

#[cfg(test)]
#[path = "thrust_tests.rs"]
mod tests;
