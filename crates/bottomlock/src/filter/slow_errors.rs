//! Slow errors of the sensors as a filter estimates them.

use super::Eskf;
use crate::aiding::deviation::harmonics;
use crate::aiding::further::{
    DEPTH_BIAS, DEVIATION, FIRST_ATTITUDE_DEVIATION, FIRST_ATTITUDE_ERROR, FIRST_HEADING_DEVIATION,
    FIRST_HEADING_ERROR, FURTHER_BLOCKS,
};

impl Eskf {
    /// Estimate and standard deviation of the depth sensor's bias, m; `None` for a sensor without bias.
    #[must_use]
    pub fn depth_bias_m(&self) -> Option<(f64, f64)> {
        let has_bias = self.extensions.processes.variance()[DEPTH_BIAS] > 0.0;
        has_bias.then(|| self.slow_error(&[(DEPTH_BIAS, 1.0)]))
    }

    /// Estimated error of the attitude reference in roll, pitch and yaw, offset, walk and deviation together, with its standard
    /// deviation, rad; `None` where it is not estimated.
    #[must_use]
    pub fn attitude_error_rad(&self) -> Option<[(f64, f64); 3]> {
        let first = FIRST_ATTITUDE_ERROR;
        let of_angle = |axis: usize| [(first + axis, 1.0), (first + 3 + axis, 1.0)];
        self.estimates(&[first, FIRST_ATTITUDE_DEVIATION]).then(|| {
            let yaw = [&of_angle(2)[..], &self.deviation(FIRST_ATTITUDE_DEVIATION)].concat();
            [&of_angle(0)[..], &of_angle(1), &yaw].map(|states| self.slow_error(states))
        })
    }

    /// Estimated error of the heading sensor, offset, walk and deviation together, with its standard deviation, rad; `None` where
    /// it is not estimated.
    #[must_use]
    pub fn heading_error_rad(&self) -> Option<(f64, f64)> {
        let first = FIRST_HEADING_ERROR;
        self.estimates(&[first, FIRST_HEADING_DEVIATION]).then(|| {
            let slow = [(first, 1.0), (first + 1, 1.0)];
            self.slow_error(&[&slow[..], &self.deviation(FIRST_HEADING_DEVIATION)].concat())
        })
    }

    /// Each block of slow errors of sensors by its name in [`FURTHER_BLOCKS`], with the largest estimate of one of its states in
    /// sigmas of its prior.
    #[must_use]
    pub fn slow_errors(&self) -> Vec<(&'static str, f64)> {
        let processes = &self.extensions.processes;
        let sigmas = |k: usize| match processes.variance()[k] {
            0.0 => 0.0,
            variance => processes.error()[k].abs() / variance.sqrt(),
        };
        let blocks = FURTHER_BLOCKS
            .into_iter()
            .filter(|(_, block)| processes.unknown().any(|one| one == *block));
        blocks
            .map(|(name, block)| (name, block.map(sigmas).fold(0.0, f64::max)))
            .collect()
    }

    /// Whether the filter has one of the blocks of slow errors.
    fn estimates(&self, blocks: &[usize]) -> bool {
        let mut unknown = self.extensions.processes.unknown();
        unknown.any(|block| blocks.contains(&block.start))
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
            self.extensions.processes.estimate(),
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
