//! Slow errors of the sensors as a filter estimates them.

use super::Eskf;
use crate::aiding::deviation::harmonics;
use crate::aiding::further::{Block, DEVIATION, block};

impl Eskf {
    /// Estimate and standard deviation of the depth sensor's bias, m; `None` for a sensor without bias.
    #[must_use]
    pub fn depth_bias_m(&self) -> Option<(f64, f64)> {
        let has_bias = self.extensions.further().has(block::DEPTH_BIAS);
        has_bias.then(|| self.slow_error(&[(block::DEPTH_BIAS.first, 1.0)]))
    }

    /// Estimated error of the attitude reference in roll, pitch and yaw, offset, walk and deviation together, with its standard
    /// deviation, rad; `None` where it is not estimated.
    #[must_use]
    pub fn attitude_error_rad(&self) -> Option<[(f64, f64); 3]> {
        let first = block::ATTITUDE_ERROR.first;
        let of_angle = |axis: usize| [(first + axis, 1.0), (first + 3 + axis, 1.0)];
        self.estimates([block::ATTITUDE_ERROR, block::ATTITUDE_DEVIATION])
            .then(|| {
                let yaw = [&of_angle(2)[..], &self.deviation(block::ATTITUDE_DEVIATION.first)].concat();
                [&of_angle(0)[..], &of_angle(1), &yaw].map(|states| self.slow_error(states))
            })
    }

    /// Estimated error of the heading sensor, offset, walk and deviation together, with its standard deviation, rad; `None` where
    /// it is not estimated.
    #[must_use]
    pub fn heading_error_rad(&self) -> Option<(f64, f64)> {
        let first = block::HEADING_ERROR.first;
        self.estimates([block::HEADING_ERROR, block::HEADING_DEVIATION])
            .then(|| {
                let slow = [(first, 1.0), (first + 1, 1.0)];
                self.slow_error(&[&slow[..], &self.deviation(block::HEADING_DEVIATION.first)].concat())
            })
    }

    /// Each block of slow errors of sensors by its name in [`block::SLOW`], with the largest estimate of one of its states in
    /// sigmas of its prior.
    #[must_use]
    pub fn slow_errors(&self) -> Vec<(&'static str, f64)> {
        let further = self.extensions.further();
        let blocks = block::SLOW.into_iter().filter(|&block| further.has(block));
        let largest = |block: Block| block.range().map(|k| further.sigmas(k)).fold(0.0, f64::max);
        blocks.map(|block| (block.name, largest(block))).collect()
    }

    /// Whether the filter has one of the blocks.
    fn estimates(&self, blocks: [Block; 2]) -> bool {
        blocks.into_iter().any(|block| self.extensions.further().has(block))
    }

    /// The states of a deviation, with what each adds to the yaw.
    fn deviation(&self, first: usize) -> [(usize, f64); DEVIATION] {
        let level = self.settings.earth.level(&self.state.position_t_m);
        let [_, _, yaw] = level.to_euler_rad(self.state.attitude_t_p);
        let harmonics = harmonics(yaw);
        std::array::from_fn(|k| (first + k, harmonics[k]))
    }

    /// Estimate and standard deviation of a weighted sum of slow errors.
    fn slow_error(&self, states: &[(usize, f64)]) -> (f64, f64) {
        let (estimate, covariance) = (
            self.extensions.further().estimate(),
            self.extensions.further().covariance(),
        );
        let pairs = states
            .iter()
            .flat_map(|one| states.iter().map(move |other| (one, other)));
        let variance: f64 = pairs.map(|((i, a), (j, b))| a * b * covariance[(*i, *j)]).sum();
        let sum = states.iter().map(|(k, weight)| weight * estimate[*k]).sum();
        (sum, variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
#[path = "slow_errors_tests.rs"]
mod tests;
