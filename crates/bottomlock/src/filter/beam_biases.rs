//! Biases of the beams beyond those that the 20 states have: the same random walks, as further states.

use super::Eskf;
use crate::aiding::BeamTerms;
use crate::aiding::further::{FurtherRows, Process, block};
use crate::dvl::geometry::BeamSample;
use crate::layout::BIASED_BEAMS;
use crate::model::Model;

impl Eskf {
    /// The same filter for a DVL with so many beams, whose biases it estimates where it does those of the first four.
    #[must_use]
    pub(crate) fn with_beams(mut self, beams: usize, model: &Model, estimate_dvl: bool) -> Self {
        if estimate_dvl && beams > BIASED_BEAMS {
            let dvl = &model.sensors.dvl;
            let bias = Process {
                walk: dvl.beam_bias_walk_mps_rts.powi(2),
                ..Process::constant(dvl.beam_bias_sd_mps)
            };
            let mut biases = vec![Process::constant(0.0); block::BEAM_BIAS.count];
            biases[..beams - BIASED_BEAMS].fill(bias);
            self.extensions.begin(&(block::BEAM_BIAS, biases));
        }
        self
    }

    /// Adds the biases of those beams to the terms of a ping.
    pub(super) fn add_biases_to(&self, terms: &mut BeamTerms, ping: &BeamSample) {
        let further = self.extensions.further();
        if !further.has(block::BEAM_BIAS) {
            return;
        }
        let rows = terms.by_further.get_or_insert_with(|| Box::new(FurtherRows::zeros()));
        for beam in ping.valid.iter().filter(|&beam| beam >= BIASED_BEAMS) {
            let state = block::BEAM_BIAS.first + beam - BIASED_BEAMS;
            rows[(beam, state)] = 1.0;
            terms.residual[beam] -= further.estimate()[state];
        }
    }
}

#[cfg(test)]
#[path = "beam_biases_tests.rs"]
mod tests;
