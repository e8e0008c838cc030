//! The error-state extended Kalman filter: prediction, gate, update, feedback (Eqs. 1 and 7).

mod assume;
mod beam_biases;
mod bridge;
mod calibrated;
pub(crate) mod charge;
mod corrected_path;
pub mod current;
mod definite;
pub(crate) mod evidence;
mod extensions;
pub mod filter_group;
mod further_states;
mod further_update;
pub mod gate;
mod imu_matrix;
mod joseph;
mod lasting;
#[cfg(test)]
mod level_turn;
mod linear_error;
pub mod linear_range;
mod mean_change;
pub mod near_vertical;
pub mod nees;
pub mod options;
mod plausible;
mod predict;
mod prediction;
pub mod report;
mod restored;
pub(crate) mod slip_test;
mod slow_errors;
mod streams;
pub mod tape;
pub(crate) mod thrust;
mod update;
mod warm_up;
pub mod water_block;

use nalgebra::{SMatrix, Vector3};

pub(crate) use self::bridge::{BridgeNoise, seconds_between};
use self::definite::is_positive_definite;
use self::evidence::Evidence;
use self::extensions::Extensions;
use self::lasting::LastingTest;
use self::linear_range::Measured;
use self::prediction::Settings;
use self::update::not_positive_definite;
use crate::aiding::MAX_ROWS;
use crate::aiding::thrust::ThrustUse;
use crate::aiding::{Innovation, Motion, TangentRows};
use crate::earth::{Earth, EarthTerms};
use crate::error::{NavError, require_finite, require_finite_squares};
use crate::error_model::Interval;
use crate::filter::gate::GateTable;
use crate::filter::options::Options;
use crate::filter::report::{Sensor, UpdateReport};
use crate::filter::water_block::WaterBlock;
use crate::frames::{Rot, Vec3};
use crate::layout::{DIM, VELOCITY};
use crate::mechanisation::{ImuSample, Kinematics};
use crate::model::Model;
use crate::state::{Covariance, NavState};

/// The filter: state, covariance, and the interval since the covariance was last propagated.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Eskf {
    state: NavState,
    kinematics: Kinematics<f64>,
    /// At the start of the interval; the rows of the DVL's states are mirrored before anything but a prediction reads
    /// them.
    covariance: Covariance,
    interval: Interval,
    /// Gravity of the interval.
    earth: EarthTerms<f64>,
    /// ω_ip of the last reading, bias included.
    last_rate_p_radps: Vector3<f64>,
    last_step_s: f64,
    measured: Measured,
    settings: Settings,
    gate: GateTable,
    /// Tells a filter that is wrong from one that is not, whatever gate rejects.
    plausible: GateTable,
    inflate_after_rejections: u32,
    evidence: Evidence,
    lasting: Box<LastingTest>,
    extensions: Extensions,
}

impl Eskf {
    /// A filter at an initial state.
    ///
    /// # Errors
    /// [`NavError`] for an invalid model, option or state, which names the field.
    pub fn new(state: NavState, model: &Model, options: &Options) -> Result<Self, NavError> {
        model.validate()?;
        options.validate()?;
        state.validate()?;
        if options.thrust != ThrustUse::Off {
            model.sensors.thrust.require_usable()?;
        }
        let kinematics = state.kinematics();
        let earth = Earth::from(&model.environment);
        let covariance = model.initial_covariance(options.estimate_dvl);
        Ok(Self {
            earth: earth.terms(kinematics.position_t_m),
            kinematics,
            state,
            interval: Interval::default(),
            last_rate_p_radps: Vector3::zeros(),
            last_step_s: 0.0,
            measured: Measured::nothing_at(state.time_ns, &covariance),
            covariance,
            settings: Settings {
                earth,
                noise: model.process_noise(options.estimate_dvl),
                sampling: options.imu_sampling,
                covariance_period_s: options.covariance_period_ns as f64 * 1e-9,
            },
            gate: GateTable::new(options.gate, options.gate_probability)?,
            plausible: GateTable::plausible(options.gate, options.gate_probability)?,
            inflate_after_rejections: options.inflate_after_rejections,
            evidence: Evidence::default(),
            lasting: Box::default(),
            extensions: Extensions::new(model, options, &kinematics),
        })
    }

    /// The same filter with water states, or without.
    #[must_use]
    pub fn with_water(mut self, water: Option<WaterBlock>) -> Self {
        self.set_water(water);
        self
    }

    /// Replaces the water states but for the current, its gain and the trim, which stay with their covariance.
    pub(crate) fn set_slips(&mut self, water: WaterBlock) {
        self.extensions.set_slips(water);
    }

    /// Begins the water states, or ends them.
    pub(crate) fn set_water(&mut self, water: Option<WaterBlock>) {
        self.extensions.set_water(water);
    }

    /// Replaces the covariance (20×20, symmetric, SI units, in the order of [`crate::layout`]).
    ///
    /// # Errors
    /// [`NavError::NotPositiveDefinite`] unless positive definite apart from frozen states (zero rows);
    /// [`NavError::NotFinite`].
    pub fn set_covariance(&mut self, covariance: &Covariance) -> Result<(), NavError> {
        require_finite_squares("covariance", self.state.time_ns, covariance.as_slice())?;
        let symmetric = (covariance + covariance.transpose()) * 0.5;
        if (symmetric - covariance).amax() > 1e-9 * covariance.amax() {
            return Err(NavError::NotPositiveDefinite {
                matrix: "covariance (not symmetric)",
                time_ns: self.state.time_ns,
            });
        }
        require_positive_definite(&symmetric, self.state.time_ns)?;
        self.covariance = symmetric;
        self.note_horizontal_position();
        self.extensions.restart(&self.kinematics);
        self.interval = Interval::default();
        Ok(())
    }

    /// The estimated state.
    #[must_use]
    pub fn state(&self) -> NavState {
        let mut state = self.state;
        state.position_t_m = Vec3::from_array(self.kinematics.position_t_m);
        state.attitude_t_p = Rot::from_quaternion_wxyz(self.kinematics.attitude_t_p);
        state.velocity_p_mps = Vec3::from_array(self.kinematics.velocity_p_mps);
        state
    }

    /// Gravity at the origin, m/s²; 0 for readings without it.
    #[must_use]
    pub fn gravity_mps2(&self) -> f64 {
        self.settings.earth.gravity_mps2
    }

    /// The time of the state, ns.
    #[must_use]
    pub fn time_ns(&self) -> i64 {
        self.state.time_ns
    }

    /// The covariance at the time of the state; the filter is not changed.
    #[must_use]
    pub fn covariance(&self) -> Covariance {
        let (mut covariance, mut interval) = (self.covariance, self.interval);
        let (earth, noise) = (&self.earth, &self.settings.noise);
        let turned = self.extensions.turned(&interval, &self.kinematics, earth);
        interval.propagate(&mut covariance.data.0, &self.kinematics, noise, earth);
        if let Some(turned) = turned {
            let further = self.extensions.further();
            covariance += further.considered(&turned, &self.interval, &self.kinematics, earth);
        }
        let warm_up = self.extensions.warm_up;
        if let Some(added) = warm_up.and_then(|warm_up| warm_up.added(self.interval.duration_s())) {
            covariance += added;
        }
        covariance
    }

    /// Sets the angular rate before the first step, for lever arms.
    pub fn note_rate(&mut self, sample: &ImuSample) {
        self.last_rate_p_radps = sample.rate_p_radps.0;
    }

    /// Calls `function` with the motion at the time of the state, for the predicted readings of a sensor.
    pub fn with_motion<T>(&self, function: impl FnOnce(&Motion<'_>) -> T) -> T {
        let state = self.state();
        function(&self.motion_of(&state))
    }

    fn motion_of<'a>(&self, state: &'a NavState) -> Motion<'a> {
        let gyro_variance = if self.last_step_s > 0.0 {
            self.settings.noise.gyro / self.last_step_s
        } else {
            0.0
        };
        let level = self.settings.earth.level(&state.position_t_m);
        let water = self.water_states().map(|water| water.at(level.depth_m));
        Motion {
            state,
            rate_ip_p_radps: self.last_rate_p_radps - state.gyro_bias_p_radps.0,
            earth_rate_t_radps: self.settings.earth.rate_t.into(),
            gyro_variance,
            level,
            water,
        }
    }

    /// Covariance of the error state with the velocity error (20×3), propagated to the time of the state.
    pub fn velocity_covariance(&mut self) -> SMatrix<f64, DIM, 3> {
        self.propagate_covariance();
        self.covariance.fixed_columns::<3>(VELOCITY).into_owned()
    }

    /// Tests an innovation, corrects the state and the covariance, and reports.
    ///
    /// # Errors
    /// [`NavError::NotFinite`] for a residual or noise that is not finite; [`NavError::NotPositiveDefinite`] for a
    /// covariance that cannot be factorised.
    pub fn update(&mut self, innovation: &Innovation, sensor: Sensor) -> Result<UpdateReport, NavError> {
        self.propagate_covariance();
        if let Some(whole) = self.with_further_noise(innovation) {
            return self.update(&whole, sensor);
        }
        require_finite("innovation", self.state.time_ns, innovation.residual.as_slice())?;
        require_finite_squares("innovation noise", self.state.time_ns, innovation.noise.as_slice())?;
        match innovation.tangent_rows {
            TangentRows::None => self.fuse_rows(innovation, sensor),
            TangentRows::Yaw => self.update_with_yaw(innovation, sensor),
            _ => self.update_in_tangent_frame(innovation, sensor),
        }
    }

    /// [`Eskf::fuse`] with room for the number of rows; every further size is compiled for every kind of vectors.
    fn fuse_rows(&mut self, innovation: &Innovation, sensor: Sensor) -> Result<UpdateReport, NavError> {
        match innovation.rows {
            0 => Ok(UpdateReport::empty(sensor, self.state.time_ns)),
            1 => self.fuse::<1>(innovation, sensor),
            2..=4 => self.fuse::<4>(innovation, sensor),
            _ => self.fuse::<MAX_ROWS>(innovation, sensor),
        }
    }

    /// Updates with the correlated innovation of exact VB (Eq. 26), whose S is singular.
    ///
    /// The first three rows are projected on the `rank` principal axes of their S that carry information; a closure after them stays.
    ///
    /// # Errors
    /// As [`Eskf::update`].
    pub fn update_correlated(
        &mut self,
        innovation: &Innovation,
        rank: usize,
        sensor: Sensor,
    ) -> Result<UpdateReport, NavError> {
        self.propagate_covariance();
        if let Some(whole) = self.with_further_noise(innovation) {
            return self.update_correlated(&whole, rank, sensor);
        }
        let h = innovation.jacobian.fixed_rows::<3>(0).into_owned();
        let cross = innovation.cross.as_deref().copied().unwrap_or_else(SMatrix::zeros);
        let noise = innovation.noise.fixed_view::<3, 3>(0, 0);
        let half = h * cross.fixed_columns::<3>(0);
        let s = h * self.covariance * h.transpose() + half + half.transpose() + noise;
        let eigen = ((s + s.transpose()) * 0.5).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
        let mut projected = Innovation {
            rows: rank + innovation.rows.saturating_sub(3),
            degrees: rank + innovation.rows.saturating_sub(3),
            ..Innovation::empty()
        };
        let mut axes = SMatrix::<f64, MAX_ROWS, MAX_ROWS>::zeros();
        for (row, &from) in order.iter().take(rank).enumerate() {
            let mut velocity = axes.fixed_view_mut::<1, 3>(row, 0);
            velocity.copy_from(&eigen.eigenvectors.column(from).transpose());
        }
        for (row, from) in (rank..).zip(3..innovation.rows) {
            axes[(row, from)] = 1.0;
        }
        projected.residual = axes * innovation.residual;
        projected.jacobian = axes * innovation.jacobian;
        projected.noise = axes * innovation.noise * axes.transpose();
        projected.cross = Some(Box::new(cross * axes.transpose()));
        projected.correlated_noise = innovation
            .correlated_noise
            .as_ref()
            .map(|correlated_noise| correlated_noise.turned(&axes));
        self.update(&projected, sensor)
    }
}

fn require_positive_definite(covariance: &Covariance, time_ns: i64) -> Result<(), NavError> {
    if is_positive_definite(covariance) {
        return Ok(());
    }
    let negative = (0..DIM).find(|&k| covariance[(k, k)] < 0.0);
    Err(not_positive_definite(negative, time_ns))
}

#[cfg(test)]
mod tests;
