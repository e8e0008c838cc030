//! The bias of the depth sensor as a state beside the error state.
//!
//! A depth is known to centimetres from one reading to the next, but tide, density and the sensor's own offset move all of
//! them by decimetres. Taken for white noise of a centimetre the reading claims an absolute depth that it does not have,
//! and, as the bias drifts, a vertical velocity that tilts the platform. The bias b is a Gauss–Markov process; with its
//! prior σ and correlation time it is estimated from the first depth on:
//!
//! ```text
//! z = d − (p + R l)_z − b̂ = H δx + δb + n
//! ```

use nalgebra::{SMatrix, SVector};

use super::water_block::Update;
use crate::aiding::depth::DepthModel;
use crate::aiding::sensor::Section;
use crate::aiding::water::{WATER, WaterVector};
use crate::aiding::{CorrectedPath, CorrelatedNoise, Innovation, MAX_ROWS};
use crate::error::{NavError, require_finite, require_finite_squares};
use crate::error_model::Interval;
use crate::layout::DIM;
use crate::mechanisation::{EarthTerms, Kinematics};

/// The bias, m, with its covariances.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct DepthBias {
    model: DepthModel,
    estimate_m: f64,
    variance_m2: f64,
    /// E[δx δb].
    cross: SVector<f64, DIM>,
    /// E[δw δb], with the water states; zero without them.
    water: WaterVector,
}

impl DepthBias {
    /// The bias at its prior; `None` for a sensor without.
    pub(super) fn new(model: &DepthModel) -> Option<Self> {
        (model.bias_sd_m > 0.0).then(|| Self {
            model: *model,
            estimate_m: 0.0,
            variance_m2: model.bias_sd_m.powi(2),
            cross: SVector::zeros(),
            water: WaterVector::zeros(),
        })
    }

    /// Checks a bias that was read from bytes.
    ///
    /// # Errors
    /// [`NavError`] that names the number.
    pub(super) fn check_restored(&self, time_ns: i64) -> Result<(), NavError> {
        Section::validate(&self.model)?;
        require_finite("depth bias", time_ns, &[self.estimate_m, self.variance_m2])?;
        require_finite_squares("depth bias covariance", time_ns, self.cross.as_slice())?;
        require_finite_squares("depth bias covariance", time_ns, self.water.as_slice())
    }

    /// Becomes independent of the water states, which start anew.
    pub(super) fn start_water(&mut self) {
        self.water = WaterVector::zeros();
    }

    /// Takes the bias into a depth's innovation.
    pub(super) fn add_to(&self, innovation: &mut Innovation) {
        innovation.residual[0] -= self.estimate_m;
        innovation.noise[(0, 0)] += self.variance_m2;
        let mut cross = SMatrix::<f64, DIM, MAX_ROWS>::zeros();
        cross.set_column(0, &self.cross);
        innovation.cross = Some(Box::new(cross));
        let mut noise = CorrelatedNoise::default();
        noise.by_depth_bias[0] = 1.0;
        innovation.correlated_noise = Some(Box::new(noise));
    }

    /// Factor by which the bias decays over `duration_s`.
    pub(super) fn decay(&self, duration_s: f64) -> f64 {
        (-duration_s / self.model.bias_time_s.0).exp()
    }

    /// Propagates over an interval of the error state that ends at `end`; `water_decay` are the factors of the water
    /// states.
    pub(super) fn propagate(
        &mut self,
        interval: &Interval,
        end: &Kinematics<f64>,
        earth: &EarthTerms,
        water_decay: &WaterVector,
    ) {
        interval.carry(&mut self.cross.data.0, end, earth);
        let left = self.decay(interval.duration_s());
        self.cross *= left;
        self.water.component_mul_assign(&(water_decay * left));
        let prior_m2 = self.model.bias_sd_m.powi(2);
        self.variance_m2 = prior_m2 + left * left * (self.variance_m2 - prior_m2);
    }

    /// E[δb zᵀ] of an innovation before its update.
    pub(super) fn innovation_cross<const M: usize>(&self, innovation: &Innovation) -> SVector<f64, M> {
        let mut cross = innovation.jacobian.fixed_rows::<M>(0) * self.cross;
        if let Some(noise) = &innovation.correlated_noise {
            cross += noise.by_state.fixed_rows::<M>(0) * self.cross
                + noise.by_water.fixed_rows::<M>(0) * self.water
                + noise.by_depth_bias.fixed_rows::<M>(0) * self.variance_m2;
        }
        cross
    }

    /// E[δw nᵀ] by the bias that an innovation contains.
    pub(super) fn water_cross<const M: usize>(&self, innovation: &Innovation) -> SMatrix<f64, WATER, M> {
        innovation
            .correlated_noise
            .as_ref()
            .map_or_else(SMatrix::zeros, |noise| {
                self.water * noise.by_depth_bias.fixed_rows::<M>(0).transpose()
            })
    }

    /// Updates with an update of the error state and of the water states (gain `water_gain`), where `x` is E[δb zᵀ]
    /// before; returns the gain.
    pub(super) fn update<const M: usize>(
        &mut self,
        update: &Update<'_, M>,
        x: &SVector<f64, M>,
        water_gain: Option<&SMatrix<f64, WATER, M>>,
    ) -> SVector<f64, M> {
        let gain = if update.corrects_position_alone {
            SVector::zeros()
        } else {
            update.factor.solve(x)
        };
        let s_gain = update.s * gain;
        self.cross += update.gain * (s_gain - x) - update.cross_covariance * gain;
        self.variance_m2 += gain.dot(&(s_gain - x * 2.0));
        if let Some(water_gain) = water_gain {
            // The water states' own gain is optimal, or zero with that of the bias.
            self.water -= water_gain * x;
        }
        self.estimate_m += gain.dot(update.z);
        gain
    }

    /// Follows a move of the error state, δr ← A δr + B ρ.
    pub(super) fn move_to_corrected_path(&mut self, path: &CorrectedPath) {
        path.move_rows(&mut self.cross);
    }

    /// E[δx δb].
    pub(super) fn cross(&self) -> &SVector<f64, DIM> {
        &self.cross
    }

    /// E[δw δb].
    pub(super) fn cross_with_water(&self) -> &WaterVector {
        &self.water
    }

    /// E[δb²], m².
    pub(super) fn variance_m2(&self) -> f64 {
        self.variance_m2
    }

    /// The estimated bias, m.
    pub(super) fn estimate_m(&self) -> f64 {
        self.estimate_m
    }
}

#[cfg(test)]
#[path = "depth_bias_tests.rs"]
mod tests;
