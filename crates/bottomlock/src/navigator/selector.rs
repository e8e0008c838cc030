//! A choice between filters that know different things, each of them honest about itself.
//!
//! The consistent selector flies filters side by side: one on the beams alone, and others that also assume something of the
//! motion. After each ping it takes the one that knows the velocity best among those that the beams do not contradict. What a
//! filter gains from its own prior is no news here: each one has counted its measurements once.
//!
//! The test is Hausman's: with a right assumption the filter that makes it is the efficient one, and the difference of the two
//! estimates has the difference of their covariances as its own (Hausman 1978, Theorem 2.1 and Corollary 2.6). No assumption can
//! lock beams out of the filter on the beams alone, and a wrong one is left as soon as the beams tell.

use nalgebra::{Matrix3, Vector3};

use crate::dvl::geometry::BeamGeometry;
use crate::dvl::partial::PartialMethod;
use crate::error::NavError;
use crate::filter::gate::{Gate, GateTable};
use crate::filter::options::Options;
use crate::filter::report::{Choice, SelectionReason, Sensor, UpdateReport};
use crate::model::Model;
use crate::navigator::events::Event;
use crate::navigator::{BeamAiding, Navigator};
use crate::state::NavState;

/// The filters of the selector; the first makes no assumption.
pub const SELECTOR_METHODS: [(&str, BeamAiding); 3] = [
    ("tc", BeamAiding::Tight),
    ("weak_sway", BeamAiding::Loose(PartialMethod::WeakSway)),
    ("sway_current", BeamAiding::SwayCurrent),
];

/// Probability with which a right assumption passes.
const PASS_PROBABILITY: f64 = 0.9973;
/// Differences of velocity below this are nobody's concern, and linearisation makes as much, m/s.
const FLOOR_MPS: f64 = 0.005;

/// The filters side by side, and which of them leads.
#[derive(Debug, Clone)]
pub struct Bank {
    pub(super) members: Vec<Navigator>,
    pub(super) selected: usize,
    gate: GateTable,
}

impl Bank {
    pub(super) fn new(
        initial: NavState,
        geometry: &BeamGeometry,
        model: &Model,
        options: &Options,
    ) -> Result<Self, NavError> {
        let member = |(_, aiding)| Navigator::new(initial, geometry.clone(), aiding, model, options);
        Ok(Self {
            members: SELECTOR_METHODS.into_iter().map(member).collect::<Result<_, _>>()?,
            selected: 0,
            gate: GateTable::new(Gate::Joint {
                probability: PASS_PROBABILITY,
            })?,
        })
    }

    pub(super) fn push(&mut self, event: &Event, report: &mut impl FnMut(&UpdateReport)) -> Result<(), NavError> {
        let mut heard = Vec::new();
        let [measurements_only, others @ ..] = &mut self.members[..] else {
            return Ok(());
        };
        measurements_only.push(event, &mut |outcome| heard.push(*outcome))?;
        for member in others {
            member.push(event, &mut |_| {})?;
        }
        for mut outcome in heard {
            if outcome.sensor == Sensor::Beams {
                outcome.choice = Some(self.choose());
            }
            report(&outcome);
        }
        Ok(())
    }

    /// The most informative filter that the beams do not contradict.
    fn choose(&mut self) -> Choice {
        let (velocity, covariance) = self.members[0].velocity();
        let mut best = (0, covariance.trace());
        let (mut reason, mut statistic, mut threshold) = (SelectionReason::NoGain, 0.0, 0.0);
        for (k, member) in self.members.iter().enumerate().skip(1) {
            let (assumed, sharper) = member.velocity();
            let (test, degrees) = hausman(&(assumed - velocity), &(covariance - sharper));
            let limit = self.gate.threshold(degrees);
            if !(test <= limit) {
                if best.0 == 0 {
                    (reason, statistic, threshold) = (SelectionReason::BeamsContradict, test, limit);
                }
            } else if sharper.trace() < best.1 {
                best = (k, sharper.trace());
                (reason, statistic, threshold) = (SelectionReason::SmallestVariance, test, limit);
            }
        }
        self.selected = best.0;
        Choice::Method {
            method: best.0,
            reason,
            statistic,
            threshold,
        }
    }
}

/// Hausman's statistic of a difference of estimates with the difference of their covariances, and its degrees of freedom.
///
/// A direction in which the assumption adds nothing tests nothing.
fn hausman(difference: &Vector3<f64>, gained: &Matrix3<f64>) -> (f64, usize) {
    let eigen = gained.symmetric_eigen();
    let floor = FLOOR_MPS * FLOOR_MPS;
    let (mut statistic, mut degrees) = (0.0, 0);
    for (variance, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *variance > floor {
            statistic += direction.dot(difference).powi(2) / (variance + floor);
            degrees += 1;
        }
    }
    (statistic, degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 0.3 m/s off in sway, where the assumption has taken 0.04 (m/s)² off the variance; surge tests nothing.
    #[test]
    fn only_what_was_gained_is_tested() {
        let gained = Matrix3::from_diagonal(&Vector3::new(0.0, 0.04, -1e-9));
        let (statistic, degrees) = hausman(&Vector3::new(5.0, 0.3, 0.0), &gained);
        assert_eq!(degrees, 1);
        assert!((statistic - 0.09 / 0.040_025).abs() < 1e-12);
        assert_eq!(hausman(&Vector3::zeros(), &Matrix3::zeros()), (0.0, 0));
    }
}
