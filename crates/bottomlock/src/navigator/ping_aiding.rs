//! Aiding by a ping: outliers screened, the rest given to the method, rejections counted.

use super::{BeamAiding, Navigator, tight_innovation};
use crate::aiding::outliers;
use crate::dvl::geometry::{BeamMask, BeamSample, MAX_BEAMS};
use crate::dvl::partial::PartialMethod;
use crate::error::NavError;
use crate::filter::Eskf;
use crate::filter::charge::Charge;
use crate::filter::report::{Sensor, UpdateReport, Verdict};

impl Navigator {
    /// Screens a ping and aids with what is left, once more where its rejection inflates the covariance; returns the
    /// beams that are left.
    pub(super) fn aid_with_ping(
        &mut self,
        ping: &BeamSample,
        report: &mut dyn FnMut(&UpdateReport),
    ) -> Result<BeamMask, NavError> {
        self.filters.each_mut().for_each(Eskf::prepare_for_ping);
        if ping.valid.count() > 0 && self.aiding != BeamAiding::None {
            self.filters.each_mut().for_each(Eskf::widen_heave);
        }
        let (mut left, mut weight) = self.screen(ping)?;
        let is_confirmed = self.is_confirmed(ping.valid, left.valid);
        let mut charge = None;
        if left.valid != ping.valid {
            charge = self.filters.note_rejected(
                &tight_innovation(&self.filters.measurements_only, &self.geometry, ping),
                Sensor::Beams,
                is_confirmed,
            )?;
            if charge.is_some() {
                (left, weight) = self.screen(ping)?;
            }
        }
        let mut outcome = self.aid_with_beams(&left)?;
        if left.valid == ping.valid && charge.is_none() {
            charge = self.note_verdict(&left, outcome.as_ref(), is_confirmed)?;
            if charge.is_some() {
                outcome = self.aid_with_beams(&left)?;
            }
        }
        if outcome.as_ref().is_some_and(UpdateReport::was_used) {
            self.confirmed = self.confirmed.or(left.valid);
            if !self.assumes_nothing() {
                self.filters.forget_lasting();
            } else if charge.is_none() {
                charge = self.filters.charge_lasting();
            }
        }
        if let Some(mut outcome) = outcome {
            if let Some(charge) = charge {
                charge.note_in(&mut outcome);
            }
            outcome.beam_weight = weight;
            if left.valid.count() == 0 && ping.valid.count() > 0 {
                outcome.verdict = Verdict::Rejected;
            }
            report(&outcome);
        }
        Ok(left.valid)
    }

    /// Whether what the rejected beams of a ping show beyond five sigma is doubted; `left` are those that screening leaves.
    ///
    /// Beams without redundancy fit some velocity whatever they read, and the wrong ones of a burst of fish agree from ping to
    /// ping as the right ones of a wrong filter do. What tells the two apart, once each of the beams has been accepted, is
    /// size; but where redundant beams agree with each other and none with the filter, the filter is wrong by any size.
    fn is_confirmed(&self, ping: BeamMask, left: BeamMask) -> bool {
        let is_confirmed = ping.and(self.confirmed) == ping;
        let is_redundant = ping.count() > self.geometry.rank_of(ping);
        let is_whole = left == BeamMask::NONE || left == ping;
        is_confirmed && !(is_redundant && is_whole)
    }

    /// Whether the innovations of pings are those of the beams themselves, without a method's assumption.
    fn assumes_nothing(&self) -> bool {
        match self.aiding {
            BeamAiding::Tight | BeamAiding::SwayCurrent => true,
            BeamAiding::Loose(method) => method == PartialMethod::LeastSquares || self.is_lossless(method),
            BeamAiding::None | BeamAiding::Own(_) => false,
        }
    }

    /// Counts the gate's verdict on a whole ping; returns what has become uncertain by it.
    fn note_verdict(
        &mut self,
        ping: &BeamSample,
        outcome: Option<&UpdateReport>,
        is_confirmed: bool,
    ) -> Result<Option<Charge>, NavError> {
        if outcome.is_none_or(|outcome| outcome.verdict != Verdict::Rejected) {
            self.filters.measurements_only.note_accepted(Sensor::Beams);
            return Ok(None);
        }
        let innovation = match self.aiding {
            BeamAiding::Loose(method) if !self.is_lossless(method) => self.loose_innovation(method, ping)?.0,
            BeamAiding::Own(own) => self.own_innovation(own, ping)?,
            _ => tight_innovation(&self.filters.measurements_only, &self.geometry, ping),
        };
        self.filters.note_rejected(&innovation, Sensor::Beams, is_confirmed)
    }

    /// The ping after outlier rejection with the innovation covariance of the filter without assumptions, and the weight
    /// of each beam; the ping itself and no weight where it is off.
    fn screen(&mut self, ping: &BeamSample) -> Result<(BeamSample, Option<[f64; MAX_BEAMS]>), NavError> {
        let robust = self.options.robust.filter(|robust| !robust.is_off());
        let Some(robust) = robust.filter(|_| self.aiding != BeamAiding::None) else {
            return Ok((*ping, None));
        };
        let (geometry, filter) = (&self.geometry, &mut self.filters.measurements_only);
        let covariance = filter.propagated_covariance();
        let mut terms = filter.beam_terms(geometry, ping);
        filter.add_further_to(&mut terms);
        let screened = outliers::screen(&robust, geometry, &covariance, &terms, ping)?;
        Ok((screened.ping, Some(screened.weight)))
    }
}

#[cfg(test)]
#[path = "ping_aiding_tests.rs"]
mod tests;
