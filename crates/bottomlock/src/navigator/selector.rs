//! The consistent selector: several consistent filters, one of which is selected after each ping.
//!
//! One filter uses the beams alone; the others also make assumptions on the motion. After each ping the selector takes
//! the filter with the smallest velocity variance among those that the beams do not contradict. Each filter processes
//! every measurement once, so no information is counted twice.
//!
//! The test is Hausman's. If an assumption is correct, the filter that makes it is efficient, and the covariance of the
//! difference between the two estimates is the difference of their covariances (Hausman 1978, Theorem 2.1 and Corollary
//! 2.6). An assumption cannot make the filter on the beams alone reject beams, and a wrong assumption is dropped as
//! soon as the beams contradict it.

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

/// Methods of the selector's filters, by short name; the first makes no assumption.
pub const SELECTOR_METHODS: [(&str, BeamAiding); 3] = [
    ("tc", BeamAiding::Tight),
    ("weak_sway", BeamAiding::Loose(PartialMethod::WeakSway)),
    ("sway_current", BeamAiding::SwayCurrent),
];

/// Probability with which a correct assumption passes the test.
const PASS_PROBABILITY: f64 = 0.9973;
/// Velocity differences below this are negligible, since linearisation errors are as large, m/s.
const FLOOR_MPS: f64 = 0.005;

/// The navigators, and the index of the selected one.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
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
            gate: GateTable::new(Gate::Joint, PASS_PROBABILITY)?,
        })
    }

    pub(super) fn push(&mut self, event: &Event, report: &mut dyn FnMut(&UpdateReport)) -> Result<(), NavError> {
        let mut outcomes = Vec::new();
        let [measurements_only, others @ ..] = &mut self.members[..] else {
            return Ok(());
        };
        measurements_only.push(event, &mut |outcome| outcomes.push(*outcome))?;
        for member in others {
            member.push(event, &mut |_| {})?;
        }
        for mut outcome in outcomes {
            if outcome.sensor == Sensor::Beams {
                outcome.choice = Some(self.select());
            }
            report(&outcome);
        }
        Ok(())
    }

    /// Selects the filter with the smallest velocity variance among those that the beams do not contradict.
    ///
    /// Beyond the linear range the filter on the beams alone contradicts nothing: its velocity is uncertain by more than any
    /// error of an assumption, and its covariance leaves second-order terms out.
    fn select(&mut self) -> Choice {
        let (velocity, covariance) = self.members[0].velocity();
        let mut best = (0, covariance.trace());
        let is_tested = !self.members[0].filter().is_beyond_linear_range();
        let (mut reason, mut statistic, mut threshold) = (SelectionReason::NoGain, 0.0, 0.0);
        // Beams that contradict little sway through the water contradict none over ground too.
        let sways =
            (self.members.iter()).any(|member| member.constrained_water().is_some_and(|water| water.alarms() > 0));
        for (k, member) in self.members.iter().enumerate().skip(1) {
            if sways && member.constrained_water().is_none() {
                continue;
            }
            let (constrained, reduced) = member.velocity();
            let (test, degrees) = hausman(&(constrained - velocity), &(covariance - reduced));
            let limit = self.gate.threshold(degrees);
            if is_tested && !(test <= limit) {
                if best.0 == 0 {
                    (reason, statistic, threshold) = (SelectionReason::BeamsContradict, test, limit);
                }
            } else if reduced.trace() < best.1 {
                best = (k, reduced.trace());
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

/// Hausman's statistic of the difference of two estimates and its degrees of freedom.
///
/// `variance_reduction` is the difference of their covariances, (m/s)². Directions without reduction are left out.
fn hausman(difference: &Vector3<f64>, variance_reduction: &Matrix3<f64>) -> (f64, usize) {
    let eigen = variance_reduction.symmetric_eigen();
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
#[path = "selector_tests.rs"]
mod tests;
