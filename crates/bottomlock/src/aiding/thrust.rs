//! What drives the vehicle, a propeller or thrusters: the speed through the water along each axis of the platform.
//!
//! With R platform to tangent, c the current at the vehicle's depth, l the place that the speeds refer to, ω = ω_tp, n_k the speed along
//! axis k that the drives say, a_k its scale and s_k the slip,
//!
//! ```text
//! e_kᵀ (v + ω × l − Rᵀ c) = a_k n_k + s_k + noise
//! ```
//!
//! n is made before it comes here: of revolutions by the advance of the propeller, or of the forces of thrusters by mass and drag
//! (`python/bottomlock/recordings/drives.py`). a, about 1, is a constant of the vehicle, known to
//! a tenth: of the advance, or of the drag; s, what waves, turns and changes of speed make of it, is a Gauss–Markov
//! process of seconds. Both are further states (`filter/gauss_markov.rs`), and c is the current of [`crate::aiding::water`] and
//! [`crate::aiding::current_layers`] with its error, so that no row changes the yaw. At one heading and one speed a and the
//! current ahead cannot be told apart; together they say the speed over ground, and it is what is asked for when the bottom is
//! lost at that heading and speed. Drives at rest say nothing, whatever the vehicle does: a speed of 0 gives no row.
//!
//! # The speed of the Jacobian
//! ∂/∂a is n, and n as it was read holds slip and noise: they would pass for changes of speed that the vehicle did not make, and a
//! would shrink. Nor is it n = û/â of the estimate, which turns with the estimate what a and c leave open. It is n less what slip and noise have
//! in it by the innovation, which the filter knows (`filter/thrust.rs`).

use nalgebra::Vector3;

use crate::aiding::current_layers::CurrentAt;
use crate::aiding::further::{FurtherRows, Process, Processes, block};
use crate::aiding::innovation::Corrects;
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Reading, Scene, Signed, Simulation, TimeConstant, model_section};
use crate::aiding::water::{SpeedThroughWater, WATER};
use crate::aiding::{Innovation, Motion};
use crate::error::{NavError, require_finite, require_magnitude, require_positive};
use crate::frames::{Platform, Vec3};
use crate::layout::{ATTITUDE, GYRO_BIAS};
#[cfg(feature = "simulation")]
use crate::random::Normals;

/// Number of further states.
pub const THRUST: usize = 6;
/// First index of the scale, along surge, sway and heave.
pub const SCALE: usize = 0;
/// First index of the slip, m/s.
pub const SLIP: usize = 3;

/// Time after a ping that determines the whole velocity for which it is held, ns.
pub(crate) const HELD_NS: i64 = 2_000_000_000;

/// Bound of speed and slip, m/s.
const LARGEST: f64 = 1e3;

model_section! {
    /// Speed through the water that the vehicle's drives say, along surge, sway and heave, 1 sigma; an axis without slip is not used.
    pub struct ThrustModel in "thrust" {
        /// Relative uncertainty of the speed.
        pub scale_sd: [f64; 3],
        /// How many times the speed simulated vehicles make of it on average, less 1.
        #[serde(default)]
        pub true_scale_error: Signed,
        /// Slip, m/s.
        pub slip_sd_mps: [f64; 3],
        /// Correlation time of the slip, s.
        pub slip_time_s: TimeConstant,
        /// White noise of a speed, m/s.
        pub noise_sd_mps: f64,
    }
}

impl ThrustModel {
    /// Whether an axis is used.
    #[must_use]
    pub fn has(&self, axis: usize) -> bool {
        self.slip_sd_mps[axis] > 0.0
    }

    /// Scale and slip along the axes that are used.
    pub(crate) fn processes(&self) -> Processes {
        let of_axis = |axis: usize, process: Process| match self.has(axis) {
            true => process,
            false => Process::constant(0.0),
        };
        let scale = |axis: usize| {
            let about_one = Process {
                mean: 1.0,
                ..Process::constant(self.scale_sd[axis])
            };
            of_axis(axis, about_one)
        };
        let slip = |axis: usize| of_axis(axis, Process::lasting(self.slip_sd_mps[axis], self.slip_time_s.0));
        (block::THRUST, (0..3).map(scale).chain((0..3).map(slip)).collect())
    }

    /// Checks what a filter needs that uses the speeds.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the number.
    pub(crate) fn require_usable(&self) -> Result<(), NavError> {
        let most_mps = self.slip_sd_mps.into_iter().fold(0.0, f64::max);
        require_positive("thrust.slip_sd_mps", most_mps)?;
        require_magnitude("thrust.slip_sd_mps", &self.slip_sd_mps, LARGEST, "less than 1000 m/s")?;
        require_magnitude(
            "thrust.scale_sd",
            &self.scale_sd,
            LARGEST,
            "a part of the speed, such as 0.1",
        )
    }
}

/// What the speeds by the drives correct.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThrustUse {
    /// Nothing: they are refused.
    #[default]
    Off,
    /// The states of thrust and water, and where the bottom's beams do not determine it the velocity: a wrong scale then spoils no
    /// attitude and no bias, and nothing at all before the bottom is lost.
    Velocity,
    /// All states.
    All,
}

impl ThrustUse {
    /// The states that a row corrects, and that it does not where the bottom's beams hold the velocity: it then learns scale and
    /// current from it.
    pub(crate) const fn corrects(self, is_velocity_held: bool) -> Corrects {
        match self {
            Self::All => Corrects::All,
            Self::Off | Self::Velocity if is_velocity_held => Corrects::ThroughWater,
            Self::Off | Self::Velocity => Corrects::Velocity,
        }
    }
}

/// Speeds through the water that the drives say.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ThrustSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Speed along surge, sway and heave, m/s; 0 along an axis that is not driven.
    pub speed_p_mps: Vec3<Platform>,
    /// White noise of each, m/s, 1 sigma.
    pub sd_mps: f64,
}

/// The axis of a report; `None` for one of another sensor.
pub(crate) fn thrust_axis(sensor: Sensor) -> Option<usize> {
    let axes = [Sensor::ThrustSurge, Sensor::ThrustSway, Sensor::ThrustHeave];
    axes.into_iter().position(|axis| axis == sensor)
}

impl Reading for ThrustSample {
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        let speed_mps = self.speed_p_mps.to_array();
        require_finite("thrust speed_p_mps", self.time_ns, &speed_mps)?;
        let expected = "less than 1000 m/s: is it a number of revolutions, or a force?";
        require_magnitude("thrust speed_p_mps", &speed_mps, LARGEST, expected)?;
        require_positive("thrust sd_mps", self.sd_mps)
    }

    /// An axis that the drives leave at rest says nothing.
    fn gives(&self, report: Sensor) -> bool {
        thrust_axis(report).is_some_and(|axis| self.speed_p_mps.0[axis] != 0.0)
    }

    fn innovation(&self, sensor: Sensor, motion: &Motion<'_>, lever_p_m: &Vec3<Platform>) -> Innovation {
        thrust_axis(sensor).map_or_else(Innovation::empty, |axis| thrust(axis, motion, self, lever_p_m))
    }

    fn numbers(&self) -> Vec<f64> {
        self.speed_p_mps.to_array().to_vec()
    }
}

impl AidingSensor for ThrustSample {
    const KIND: SensorKind = SensorKind::Thrust;
    const STREAM: &'static str = "thrust";
    const LEVER: Option<&'static str> = Some("thrust_p_m");
    const LOG: &'static [Column] = &[Column::new("thrust_speed_p_mps", 3)];
    const SIMULATION: Option<Simulation> = Some(Simulation {
        name: "thrust",
        offset: Some("thrust_current_mps"),
        // White noise, slip, scale.
        random: &[23, 24, 25],
        columns: Self::LOG,
    });

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        let along = |axis: usize| {
            let row = |at: CurrentAt| SpeedThroughWater::along(&Vector3::ith(axis, 1.0), motion, &at.water);
            motion
                .water
                .map_or(motion.state.velocity_p_mps.0[axis], |at| row(at).speed_mps)
        };
        let speed_mps = std::array::from_fn(|axis| if models.thrust.has(axis) { along(axis) } else { 0.0 });
        Self {
            time_ns: motion.state.time_ns,
            speed_p_mps: Vec3::from_array(speed_mps),
            sd_mps: models.thrust.noise_sd_mps,
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        let speed_mps: [f64; 3] = (*values.first()?)?.try_into().ok()?;
        Some(Self {
            time_ns,
            speed_p_mps: Vec3::from_array(speed_mps),
            sd_mps: models.thrust.noise_sd_mps,
        })
    }

    /// Along surge alone, with scale and slip drawn per run; the offset is the component of the current along it.
    #[cfg(feature = "simulation")]
    fn simulate(scene: &Scene<'_>, random: &mut [Normals]) -> Option<Self> {
        let [noise, slip, scale] = random else { return None };
        let actual = &scene.actual.thrust;
        let own = scale.gauss_markov(actual.scale_sd[0], f64::INFINITY, scene.time_ns);
        let slip_mps = slip.gauss_markov(actual.slip_sd_mps[0], actual.slip_time_s.0, scene.time_ns);
        let speed_mps = scene.truth.velocity_p_mps.x - scene.offset - slip_mps - actual.noise_sd_mps * noise.one();
        let surge_mps = speed_mps / (1.0 + actual.true_scale_error.0 + own);
        Some(Self {
            time_ns: scene.time_ns,
            speed_p_mps: Vec3::new(surge_mps, 0.0, 0.0),
            sd_mps: scene.claimed.thrust.noise_sd_mps,
        })
    }
}

/// z = a n + s − e_kᵀ(v + ω × l − Rᵀc), to which the filter adds a n and s with their columns; no row without the current as states, nor
/// for an axis that is at rest.
#[must_use]
pub fn thrust(axis: usize, motion: &Motion<'_>, sample: &ThrustSample, lever_p_m: &Vec3<Platform>) -> Innovation {
    let mut innovation = Innovation::empty();
    let said_mps = sample.speed_p_mps.0[axis];
    let Some(at) = motion.water.filter(|_| said_mps != 0.0) else {
        return innovation;
    };
    let axis_p = Vector3::ith(axis, 1.0);
    let along = SpeedThroughWater::along(&axis_p, motion, &at.water);
    // e_kᵀ(ω × l) = (l × e_k)ᵀ ω.
    let arm = lever_p_m.0.cross(&axis_p);
    let mut by_state = along.by_state.transpose();
    let mut by_misalignment = by_state.fixed_view_mut::<1, 3>(0, ATTITUDE);
    by_misalignment += arm.transpose() * motion.rate_by_misalignment();
    let mut by_gyro_bias = by_state.fixed_view_mut::<1, 3>(0, GYRO_BIAS);
    by_gyro_bias -= arm.transpose();
    (innovation.rows, innovation.degrees) = (1, 1);
    innovation.residual[0] = -(along.speed_mps + arm.dot(&motion.rate_tp()));
    innovation.jacobian.set_row(0, &by_state);
    innovation.noise[(0, 0)] = sample.sd_mps.powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows.fixed_view_mut::<1, WATER>(0, block::WATER.first)
        .copy_from(&along.by_water.transpose());
    rows[(0, block::THRUST.first + SCALE + axis)] = -said_mps;
    rows[(0, block::THRUST.first + SLIP + axis)] = -1.0;
    at.complete(motion, &Vector3::zeros(), 0, &mut innovation.jacobian, &mut rows);
    innovation.by_further = Some(rows);
    innovation
}

#[cfg(test)]
#[path = "thrust_tests.rs"]
mod tests;
