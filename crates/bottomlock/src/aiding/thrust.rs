//! The propeller's revolutions: the speed through the water along the platform's forward axis.
//!
//! With R platform to tangent, c the current at the vehicle's depth, q the revolutions per metre through the water and s the
//! slip, the propeller makes
//!
//! ```text
//! n = q e_xᵀ (v − Rᵀ c) + s + noise
//! ```
//!
//! revolutions a second, signed. q is a constant of the vehicle, known to a tenth; s, what waves, turns and changes of speed ask
//! for, is a Gauss–Markov process of seconds. Both are further states (`filter/gauss_markov.rs`), and c is the current of
//! [`crate::aiding::water`] and [`crate::aiding::current_layers`] with its error, so that no row changes the yaw. At one
//! heading and one speed q and the current ahead cannot be told apart; together they say the speed over ground, and it is what is
//! asked for when the bottom is lost at that heading and speed. A propeller at rest drives nothing, whatever the vehicle does: it gives no row.
//!
//! The revolutions are the reading, and the speed is in the Jacobian by q. Turned over, with a n for the speed and n in the
//! Jacobian by a, slip and noise of the reading would pass for changes of speed that the vehicle did not make, and a would shrink.

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
use crate::random::Normals;

/// Number of further states.
pub const THRUST: usize = 2;
/// Index of the revolutions per metre through the water, 1/m.
pub const PER_METRE: usize = 0;
/// Index of the slip, 1/s.
pub const SLIP: usize = 1;

/// Bound of the revolutions, 1/s: thirty times those of a small thruster.
const MOST_REVOLUTIONS_HZ: f64 = 1e3;

/// Bound of revolutions per metre, 1/m, and slip, 1/s.
const LARGEST: f64 = 1e4;

model_section! {
    /// Revolutions of the propeller, 1 sigma.
    pub struct ThrustModel in "thrust" {
        /// Revolutions per metre through the water, 1/m.
        pub revolutions_per_m: f64,
        /// Their uncertainty, 1/m.
        pub revolutions_per_m_sd: f64,
        /// Their mean of simulated vehicles, 1/m; 0 for the same.
        pub true_revolutions_per_m: f64,
        /// Slip, 1/s.
        pub slip_sd_hz: f64,
        /// Correlation time of the slip, s.
        pub slip_time_s: TimeConstant,
        /// White noise of a reading, 1/s.
        pub noise_sd_hz: f64,
    }
}

impl ThrustModel {
    /// Checks what a filter needs that uses the revolutions.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the number.
    pub(crate) fn require_usable(&self) -> Result<(), NavError> {
        require_positive("thrust.revolutions_per_m", self.revolutions_per_m)?;
        require_positive("thrust.slip_sd_hz", self.slip_sd_hz)?;
        let numbers = [
            ("thrust.revolutions_per_m", self.revolutions_per_m),
            ("thrust.revolutions_per_m_sd", self.revolutions_per_m_sd),
            ("thrust.slip_sd_hz", self.slip_sd_hz),
        ];
        let expected = "less than 10000: no propeller turns that often";
        (numbers.into_iter()).try_for_each(|(field, value)| require_magnitude(field, &[value], LARGEST, expected))
    }
}

/// What the revolutions correct.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum ThrustUse {
    /// Nothing: they are refused.
    #[default]
    Off,
    /// The velocity, and the states of motion, thrust and water: a wrong coefficient then spoils no attitude and no bias.
    Velocity,
    /// All states.
    All,
}

impl ThrustUse {
    /// The names of the uses.
    pub const NAMES: [(Self, &str); 3] = [(Self::Off, "off"), (Self::Velocity, "velocity"), (Self::All, "all")];

    /// The states that a row corrects.
    pub(crate) const fn corrects(self) -> Corrects {
        match self {
            Self::Off | Self::Velocity => Corrects::Velocity,
            Self::All => Corrects::All,
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
    /// White noise, 1/s, 1 sigma.
    pub sd_hz: f64,
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
        // White noise, slip, revolutions per metre.
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
        require_positive("thrust sd_hz", self.sd_hz)
    }

    fn innovation(&self, _: Sensor, motion: &Motion<'_>, _: &Vec3<Platform>) -> Innovation {
        thrust(motion, self.revolutions_hz, self.sd_hz)
    }

    /// With the revolutions per metre of the model.
    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        let along = motion
            .water
            .map(|at| SpeedThroughWater::along(&Vector3::x(), motion, &at.water));
        let speed_mps = along.map_or(motion.state.velocity_p_mps.0.x, |along| along.speed_mps);
        Self {
            time_ns: motion.state.time_ns,
            revolutions_hz: models.thrust.revolutions_per_m * speed_mps,
            sd_hz: models.thrust.noise_sd_hz,
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        Some(Self {
            time_ns,
            revolutions_hz: *(*values.first()?)?.first()?,
            sd_hz: models.thrust.noise_sd_hz,
        })
    }

    /// With revolutions per metre and slip drawn per run; the offset is the component of the current along the platform's forward
    /// axis.
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, slip, per_metre] = random else { return None };
        let actual = &scene.actual.thrust;
        let mean = if actual.true_revolutions_per_m > 0.0 {
            actual.true_revolutions_per_m
        } else {
            actual.revolutions_per_m
        };
        let revolutions_per_m =
            mean + per_metre.gauss_markov(actual.revolutions_per_m_sd, f64::INFINITY, scene.time_ns);
        let slip_hz = slip.gauss_markov(actual.slip_sd_hz, actual.slip_time_s.0, scene.time_ns);
        let speed_mps = scene.truth.velocity_p_mps.x - scene.offset;
        Some(Self {
            time_ns: scene.time_ns,
            revolutions_hz: revolutions_per_m * speed_mps + slip_hz + actual.noise_sd_hz * noise.one(),
            sd_hz: scene.claimed.thrust.noise_sd_hz,
        })
    }

    fn numbers(&self) -> Vec<f64> {
        vec![self.revolutions_hz]
    }
}

/// z = n − q e_xᵀ(v − Rᵀc) − s, of which the filter takes q and s with their columns off; no row without the current as states,
/// nor at rest.
#[must_use]
pub fn thrust(motion: &Motion<'_>, revolutions_hz: f64, sd_hz: f64) -> Innovation {
    let mut innovation = Innovation::empty();
    let Some(at) = motion.water.filter(|_| revolutions_hz != 0.0) else {
        return innovation;
    };
    let (along, per_metre) = (
        SpeedThroughWater::along(&Vector3::x(), motion, &at.water),
        motion.revolutions_per_m,
    );
    (innovation.rows, innovation.degrees) = (1, 1);
    innovation.residual[0] = revolutions_hz;
    innovation
        .jacobian
        .set_row(0, &(along.by_state.transpose() * per_metre));
    innovation.noise[(0, 0)] = sd_hz.powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows.fixed_view_mut::<1, WATER>(0, FIRST_WATER)
        .copy_from(&(along.by_water.transpose() * per_metre));
    rows[(0, FIRST_THRUST + PER_METRE)] = along.speed_mps;
    rows[(0, FIRST_THRUST + SLIP)] = 1.0;
    at.complete(motion, &Vector3::zeros(), 0, &mut innovation.jacobian, &mut rows);
    innovation.by_further = Some(rows);
    innovation
}

#[cfg(test)]
#[path = "thrust_tests.rs"]
mod tests;
