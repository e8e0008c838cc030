//! The propeller's revolutions: the speed through the water along the platform's forward axis.
//!
//! With R platform to tangent, c the current at the vehicle's depth, n the revolutions a second (signed), a the advance per
//! revolution and s the slip,
//!
//! ```text
//! e_xᵀ (v − Rᵀ c) = a n + s + noise
//! ```
//!
//! a is a constant of the vehicle, known to a tenth; s, what waves, turns and changes of speed make of it, is a Gauss–Markov
//! process of seconds. Both are further states (`filter/gauss_markov.rs`), and c is the current of [`crate::aiding::water`] and
//! [`crate::aiding::current_layers`] with its error, so that no row changes the yaw. At one heading and one speed a and the
//! current ahead cannot be told apart; together they say the speed over ground, and it is what is asked for when the bottom is
//! lost at that heading and speed. A propeller at rest drives nothing, whatever the vehicle does: it gives no row.
//!
//! # The revolutions of the Jacobian
//! ∂/∂a is n, and n as it was read holds slip and noise: they would pass for changes of speed that the vehicle did not make, and a
//! would shrink. Nor is it n = û/â of the estimate, which turns with the estimate what a and c leave open. It is n less what slip and noise have
//! in it by the innovation, which the filter knows (`filter/thrust.rs`).

use nalgebra::Vector3;

use crate::aiding::declare::model_section;
use crate::aiding::further::{FIRST_THRUST, FIRST_WATER, FurtherRows};
use crate::aiding::innovation::Corrects;
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Report, Scene, Simulation, TimeConstant};
use crate::aiding::water::{SpeedThroughWater, WATER};
use crate::aiding::{Innovation, Motion};
use crate::error::{NavError, require_finite, require_magnitude, require_positive};
use crate::frames::{Platform, Vec3};
#[cfg(feature = "simulation")]
use crate::random::Normals;

/// Number of further states.
pub const THRUST: usize = 2;
/// Index of the advance per revolution, m.
pub const ADVANCE: usize = 0;
/// Index of the slip, m/s.
pub const SLIP: usize = 1;

/// Time after a ping that determines the whole velocity for which it is held, ns.
pub(crate) const HELD_NS: i64 = 2_000_000_000;

/// Bound of the revolutions, 1/s: thirty times those of a small thruster.
const MOST_REVOLUTIONS_HZ: f64 = 1e3;

/// Bound of advance, m, and slip, m/s.
const LARGEST: f64 = 1e3;

model_section! {
    /// Speed through the water by the revolutions of the propeller, 1 sigma.
    pub struct ThrustModel in "thrust" {
        /// Advance per revolution, m.
        pub advance_m: f64,
        /// Its uncertainty, m.
        pub advance_sd_m: f64,
        /// Its mean of simulated vehicles, m; 0 for the same.
        pub true_advance_m: f64,
        /// Slip, m/s.
        pub slip_sd_mps: f64,
        /// Correlation time of the slip, s.
        pub slip_time_s: TimeConstant,
        /// White noise of a reading, as a speed, m/s.
        pub noise_sd_mps: f64,
    }
}

impl ThrustModel {
    /// Checks what a filter needs that uses the revolutions.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the number.
    pub(crate) fn require_usable(&self) -> Result<(), NavError> {
        require_positive("thrust.advance_m", self.advance_m)?;
        require_positive("thrust.slip_sd_mps", self.slip_sd_mps)?;
        let numbers = [
            ("thrust.advance_m", self.advance_m),
            ("thrust.advance_sd_m", self.advance_sd_m),
            ("thrust.slip_sd_mps", self.slip_sd_mps),
        ];
        let expected = "less than 1000: no propeller is that large";
        (numbers.into_iter()).try_for_each(|(field, value)| require_magnitude(field, &[value], LARGEST, expected))
    }
}

/// What the revolutions correct.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThrustUse {
    /// Nothing: they are refused.
    #[default]
    Off,
    /// The states of thrust and water, and where the bottom's beams do not determine it the velocity: a wrong advance then spoils no
    /// attitude and no bias, and nothing at all before the bottom is lost.
    Velocity,
    /// All states.
    All,
}

impl ThrustUse {
    /// The states that a row corrects, and that it does not where the bottom's beams hold the velocity: it then learns advance and
    /// current from it.
    pub(crate) const fn corrects(self, is_velocity_held: bool) -> Corrects {
        match self {
            Self::All => Corrects::All,
            Self::Off | Self::Velocity if is_velocity_held => Corrects::ThroughWater,
            Self::Off | Self::Velocity => Corrects::Velocity,
        }
    }
}

/// Revolutions of the propeller.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ThrustSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Revolutions, 1/s; positive where they drive the vehicle forward.
    pub revolutions_hz: f64,
    /// White noise of the speed that they say, m/s, 1 sigma.
    pub sd_mps: f64,
}

impl AidingSensor for ThrustSample {
    const KIND: SensorKind = SensorKind::Thrust;
    const STREAM: &'static str = "thrust";
    const REPORTS: &'static [Report] = &[Report {
        sensor: Sensor::Thrust,
        quantity: None,
    }];
    const LOG: &'static [Column] = &[Column::new("thrust_revolutions_hz", 1)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "thrust",
        offset: Some("thrust_current_mps"),
        // White noise, slip, advance.
        random: &[23, 24, 25],
        columns: Self::LOG,
    });

    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        require_finite("revolutions_hz", self.time_ns, &[self.revolutions_hz])?;
        let expected = "less than 1000 a second: are they per minute?";
        require_magnitude("revolutions_hz", &[self.revolutions_hz], MOST_REVOLUTIONS_HZ, expected)?;
        require_positive("thrust sd_mps", self.sd_mps)
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, _: &Vec3<Platform>) -> Innovation {
        thrust(motion, self.revolutions_hz, self.sd_mps)
    }

    /// At the advance of the model.
    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        let along = motion
            .water
            .map(|at| SpeedThroughWater::along(&Vector3::x(), motion, &at.water));
        let speed_mps = along.map_or(motion.state.velocity_p_mps.0.x, |along| along.speed_mps);
        Self {
            time_ns: motion.state.time_ns,
            revolutions_hz: revolutions_hz(speed_mps, models.thrust.advance_m),
            sd_mps: models.thrust.noise_sd_mps,
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        Some(Self {
            time_ns,
            revolutions_hz: *(*values.first()?)?.first()?,
            sd_mps: models.thrust.noise_sd_mps,
        })
    }

    /// With advance and slip drawn per run; the offset is the component of the current along the platform's forward axis.
    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, slip, advance] = random else { return None };
        let actual = &scene.actual.thrust;
        let mean_m = if actual.true_advance_m > 0.0 {
            actual.true_advance_m
        } else {
            actual.advance_m
        };
        let advance_m = mean_m + advance.gauss_markov(actual.advance_sd_m, f64::INFINITY, scene.time_ns);
        let slip_mps = slip.gauss_markov(actual.slip_sd_mps, actual.slip_time_s.0, scene.time_ns);
        let speed_mps = scene.truth.velocity_p_mps.x - scene.offset - slip_mps - actual.noise_sd_mps * noise.one();
        Some(Self {
            time_ns: scene.time_ns,
            revolutions_hz: revolutions_hz(speed_mps, advance_m),
            sd_mps: scene.claimed.thrust.noise_sd_mps,
        })
    }

    fn numbers(&self) -> Vec<f64> {
        vec![self.revolutions_hz]
    }
}

/// Revolutions at a speed through the water; none with a propeller that drives nothing.
fn revolutions_hz(speed_mps: f64, advance_m: f64) -> f64 {
    if advance_m > 0.0 { speed_mps / advance_m } else { 0.0 }
}

/// z = a n + s − e_xᵀ(v − Rᵀc), to which the filter adds a n and s with their columns; no row without the current as states, nor
/// at rest.
#[must_use]
pub fn thrust(motion: &Motion<'_>, revolutions_hz: f64, sd_mps: f64) -> Innovation {
    let mut innovation = Innovation::empty();
    let Some(at) = motion.water.filter(|_| revolutions_hz != 0.0) else {
        return innovation;
    };
    let along = SpeedThroughWater::along(&Vector3::x(), motion, &at.water);
    (innovation.rows, innovation.degrees) = (1, 1);
    innovation.residual[0] = -along.speed_mps;
    innovation.jacobian.set_row(0, &along.by_state.transpose());
    innovation.noise[(0, 0)] = sd_mps.powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows.fixed_view_mut::<1, WATER>(0, FIRST_WATER)
        .copy_from(&along.by_water.transpose());
    rows[(0, FIRST_THRUST + ADVANCE)] = -revolutions_hz;
    rows[(0, FIRST_THRUST + SLIP)] = -1.0;
    at.complete(motion, &Vector3::zeros(), 0, &mut innovation.jacobian, &mut rows);
    innovation.by_further = Some(rows);
    innovation
}

#[cfg(test)]
#[path = "thrust_tests.rs"]
mod tests;
