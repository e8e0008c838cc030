//! What the propeller makes of its revolutions, as a filter estimates it.

use nalgebra::{SMatrix, SVector};

use super::Eskf;
use crate::aiding::further::FIRST_THRUST;
use crate::aiding::thrust::THRUST;

impl Eskf {
    /// Revolutions per metre through the water, 1/m, and slip, 1/s, with the covariance of their errors; `None` where they are not
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
}

#[cfg(test)]
#[path = "thrust_tests.rs"]
mod tests;
