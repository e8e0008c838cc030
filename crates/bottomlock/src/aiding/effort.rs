//! The forces of thrusters: the speed through the water along each axis of the platform, by the vehicle's drag.
//!
//! With R platform to tangent, c the current at the vehicle's depth, l the place that mass and drag refer to, ω = ω_tp, the velocity
//! of l through the water and the force that is left for the drag are (Fossen 2021, Ch. 6 and 8; one axis by itself)
//!
//! ```text
//! u = v + ω × l − Rᵀ c
//! F = τ − B Rᵀ e_D − M (v̇ + ω̇ × l + ω × Rᵀ c) − ω × M u
//! ```
//!
//! with the force τ, buoyancy less weight B, and M mass and added mass. A steady c turns in platform axes, hence ω × Rᵀ c. The
//! drag law D(n) = d n + q |n| n says the speed n = D⁻¹(F) at which the drag is F, and a row is that of the revolutions
//! ([`crate::aiding::thrust`]) with n for their number:
//!
//! ```text
//! u_k = a_k n_k + s_k + noise
//! ```
//!
//! a, about 1, is what the drag is wrong by: D(u) = F is u = a n with a = 1/√q of a wrong q, and 1/d of a wrong d. In this form n is
//! what the thrusters say, and not what the estimate makes of them, so that a column does not turn with the estimate. s is what waves,
//! a tether and turns make of it. Mass and added mass are wrong by a factor 1 + μ_k. All three are first-order Gauss–Markov processes.
//!
//! n has an infinite slope at rest where a drag is quadratic alone. Slope and noise are therefore those of the chord over ± 1 σ of the force.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::aiding::calibration::MotionChange;
use crate::aiding::declare::model_section;
use crate::aiding::further::{FIRST_EFFORT, FIRST_WATER, FurtherRows};
use crate::aiding::registry::{Sensor, SensorKind, SensorModels};
use crate::aiding::sensor::{AidingSensor, Column, Fraction, Report, Signed, TimeConstant};
use crate::aiding::water::{SpeedThroughWater, WATER};
use crate::aiding::{Innovation, Motion};
use crate::error::{NavError, require_finite, require_magnitude, require_positive};
use crate::frames::{Platform, Vec3, skew};
use crate::layout::{ATTITUDE, DIM, GYRO_BIAS, VELOCITY};

/// Number of further states.
pub const EFFORT: usize = 9;
/// First index of the speed over that by the drag law, along surge, sway and heave.
pub const SPEED_SCALE: usize = 0;
/// First index of the slip, m/s.
pub const SLIP: usize = 3;
/// First index of the relative error of mass and added mass.
pub const INERTIA: usize = 6;

/// Bound of force, N, mass, kg, and drag: a tanker has less.
const LARGEST: f64 = 1e9;
/// Least drag of an axis that has one, kg/s and kg/m: the speed of a force stays a number.
const LEAST_DRAG: f64 = 1e-6;

model_section! {
    /// What the forces of thrusters make of the speed through the water, 1 sigma; an axis without drag gives no row.
    pub struct EffortModel in "effort" {
        /// Mass and added mass along surge, sway and heave, kg.
        pub mass_kg: [f64; 3],
        /// Linear drag, N s/m.
        pub linear_drag_kgps: [f64; 3],
        /// Quadratic drag, N s²/m².
        pub quadratic_drag_kgpm: [f64; 3],
        /// Buoyancy less weight, N.
        pub buoyancy_n: Signed,
        /// Relative uncertainty of the speed at a force: half of that of a quadratic drag, all of that of a linear one.
        pub speed_scale_sd: Fraction,
        /// Its correlation time, s.
        pub speed_scale_time_s: TimeConstant,
        /// Relative uncertainty of mass and added mass.
        pub inertia_sd: Fraction,
        /// Its correlation time, s.
        pub inertia_time_s: TimeConstant,
        /// Slip, m/s.
        pub slip_sd_mps: f64,
        /// Its correlation time, s.
        pub slip_time_s: TimeConstant,
        /// White noise of a force, N.
        pub noise_sd_n: f64,
    }
}

impl EffortModel {
    /// Whether an axis has a drag.
    #[must_use]
    pub fn has(&self, axis: usize) -> bool {
        self.linear_drag_kgps[axis] > 0.0 || self.quadratic_drag_kgpm[axis] > 0.0
    }

    /// Whether any axis has.
    #[must_use]
    pub fn is_given(&self) -> bool {
        (0..3).any(|axis| self.has(axis))
    }

    /// Checks what a filter needs that uses the forces.
    ///
    /// # Errors
    /// [`NavError::OutOfRange`] that names the number.
    pub(crate) fn require_usable(&self) -> Result<(), NavError> {
        require_positive("effort.slip_sd_mps", self.slip_sd_mps)?;
        let expected = "less than 1e9: no vehicle has as much";
        require_magnitude("effort.mass_kg", &self.mass_kg, LARGEST, expected)?;
        require_magnitude("effort.linear_drag_kgps", &self.linear_drag_kgps, LARGEST, expected)?;
        require_magnitude(
            "effort.quadratic_drag_kgpm",
            &self.quadratic_drag_kgpm,
            LARGEST,
            expected,
        )?;
        require_magnitude("effort.buoyancy_n", &[self.buoyancy_n.0], LARGEST, expected)?;
        require_magnitude("effort.slip_sd_mps", &[self.slip_sd_mps], 1e3, "less than 1000 m/s")?;
        for axis in (0..3).filter(|&axis| self.has(axis)) {
            require_positive("effort.mass_kg of an axis with drag", self.mass_kg[axis])?;
            let drag = self.linear_drag_kgps[axis].max(self.quadratic_drag_kgpm[axis]);
            if drag < LEAST_DRAG {
                return Err(NavError::OutOfRange {
                    field: "effort drag of an axis",
                    value: drag,
                    expected: "0, or 1e-6 or more",
                });
            }
        }
        Ok(())
    }

    /// D⁻¹: the speed along an axis at which its drag is a force, m/s.
    fn speed_mps(&self, axis: usize, force_n: f64) -> f64 {
        let (d, q) = (self.linear_drag_kgps[axis], self.quadratic_drag_kgpm[axis]);
        // q n² + d n = F without cancellation.
        2.0 * force_n / (d + (d * d + 4.0 * q * force_n.abs()).sqrt()).max(f64::MIN_POSITIVE)
    }

    /// Slope of the speed by the force, that of the chord over ± `sd_n`, m/s per N.
    fn slope(&self, axis: usize, force_n: f64, sd_n: f64) -> f64 {
        (self.speed_mps(axis, force_n + sd_n) - self.speed_mps(axis, force_n - sd_n)) / (2.0 * sd_n)
    }
}

/// Forces of the thrusters on the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct EffortSample {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Force along surge, sway and heave, N.
    pub force_p_n: Vec3<Platform>,
    /// White noise of each, N, 1 sigma.
    pub sd_n: f64,
}

/// The axis of a report; `None` for one of another sensor.
pub(crate) fn effort_axis(sensor: Sensor) -> Option<usize> {
    EffortSample::REPORTS.iter().position(|report| report.sensor == sensor)
}

const fn report(sensor: Sensor) -> Report {
    Report { sensor, quantity: None }
}

impl AidingSensor for EffortSample {
    const KIND: SensorKind = SensorKind::Effort;
    const STREAM: &'static str = "effort";
    const REPORTS: &'static [Report] = &[
        report(Sensor::EffortSurge),
        report(Sensor::EffortSway),
        report(Sensor::EffortHeave),
    ];
    const LEVER: Option<&'static str> = Some("effort_p_m");
    const LOG: &'static [Column] = &[Column::new("effort_force_p_n", 3)];

    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    fn validate(&self) -> Result<(), NavError> {
        let force_n = self.force_p_n.to_array();
        require_finite("force_p_n", self.time_ns, &force_n)?;
        require_magnitude(
            "force_p_n",
            &force_n,
            LARGEST,
            "less than 1e9 N: no thruster has as much",
        )?;
        require_positive("effort sd_n", self.sd_n)?;
        require_magnitude("effort sd_n", &[self.sd_n], LARGEST, "less than 1e9 N")
    }

    /// None without the vehicle's drag and acceleration, which the filter has (`filter/effort.rs`).
    fn innovation(&self, _: Sensor, _: &Motion<'_>, _: &Vec3<Platform>) -> Innovation {
        Innovation::empty()
    }

    fn of_truth(motion: &Motion<'_>, _: &Vec3<Platform>, models: &SensorModels) -> Self {
        Self {
            time_ns: motion.state.time_ns,
            force_p_n: Vec3::new(0.0, 0.0, 0.0),
            sd_n: models.effort.noise_sd_n,
        }
    }

    fn of_row(time_ns: i64, values: &[Option<&[f64]>], models: &SensorModels) -> Option<Self> {
        let force_n: [f64; 3] = (*values.first()?)?.try_into().ok()?;
        Some(Self {
            time_ns,
            force_p_n: Vec3::from_array(force_n),
            sd_n: models.effort.noise_sd_n,
        })
    }

    fn numbers(&self) -> Vec<f64> {
        self.force_p_n.to_array().to_vec()
    }
}

/// z = a n + s − u along one axis, to which the filter adds a n, s and μ with their columns, `speed_scale` being a as estimated; no
/// row without the current as states, nor for an axis without drag.
pub(crate) fn effort(
    axis: usize,
    motion: &Motion<'_>,
    change: &MotionChange,
    model: &EffortModel,
    sample: &EffortSample,
    lever_p_m: &Vector3<f64>,
    speed_scale: f64,
) -> Innovation {
    let mut innovation = Innovation::empty();
    let Some(at) = motion.water.filter(|_| model.has(axis)) else {
        return innovation;
    };
    let rate = motion.rate_tp();
    let mut rate_by_state = SMatrix::<f64, 3, DIM>::zeros();
    rate_by_state
        .fixed_view_mut::<3, 3>(0, ATTITUDE)
        .copy_from(&motion.rate_by_misalignment());
    rate_by_state
        .fixed_view_mut::<3, 3>(0, GYRO_BIAS)
        .copy_from(&-Matrix3::identity());

    // u, and c in platform axes, with their derivatives by the error state and by the states of the water.
    let mut u = Vector3::zeros();
    let mut u_by_state = SMatrix::<f64, 3, DIM>::zeros();
    let mut u_by_water = SMatrix::<f64, 3, WATER>::zeros();
    for k in 0..3 {
        let along = SpeedThroughWater::along(&Vector3::ith(k, 1.0), motion, &at.water);
        u[k] = along.speed_mps;
        u_by_state.set_row(k, &along.by_state.transpose());
        u_by_water.set_row(k, &along.by_water.transpose());
    }
    let current_p = motion.state.velocity_p_mps.0 - u;
    let mut current_by_state = -u_by_state;
    for k in 0..3 {
        current_by_state[(k, VELOCITY + k)] += 1.0;
    }
    u += rate.cross(lever_p_m);
    u_by_state -= skew(lever_p_m) * rate_by_state;

    // F, with its derivatives.
    let mass = Matrix3::from_diagonal(&Vector3::from(model.mass_kg));
    let turn = skew(&rate);
    let acceleration =
        change.acceleration_p_mps2 + change.angular_acceleration_p_radps2.cross(lever_p_m) + rate.cross(&current_p);
    let acceleration_by_state = change.velocity_by_state + turn * current_by_state - skew(&current_p) * rate_by_state;
    let (rotation, down_t) = (motion.rotation(), motion.level.down_t());
    let buoyancy_n = model.buoyancy_n.0;
    let force =
        sample.force_p_n.0 - rotation.tr_mul(&down_t) * buoyancy_n - mass * acceleration - rate.cross(&(mass * u));
    let mut force_by_state =
        -mass * acceleration_by_state - turn * mass * u_by_state + skew(&(mass * u)) * rate_by_state;
    let mut by_misalignment = force_by_state.fixed_view_mut::<3, 3>(0, ATTITUDE);
    by_misalignment -= rotation.transpose() * skew(&down_t) * buoyancy_n;
    let force_by_water = (mass * turn - turn * mass) * u_by_water;

    let speed_mps = model.speed_mps(axis, force[axis]);
    let by_force = speed_scale * model.slope(axis, force[axis], sample.sd_n);
    (innovation.rows, innovation.degrees) = (1, 1);
    innovation.residual[0] = -u[axis];
    innovation
        .jacobian
        .set_row(0, &(u_by_state.row(axis) - force_by_state.row(axis) * by_force));
    innovation.noise[(0, 0)] = (by_force * sample.sd_n).powi(2);
    let mut rows = Box::new(FurtherRows::zeros());
    rows.fixed_view_mut::<1, WATER>(0, FIRST_WATER)
        .copy_from(&(u_by_water.row(axis) - force_by_water.row(axis) * by_force));
    rows[(0, FIRST_EFFORT + SPEED_SCALE + axis)] = -speed_mps;
    rows[(0, FIRST_EFFORT + SLIP + axis)] = -1.0;
    rows[(0, FIRST_EFFORT + INERTIA + axis)] = by_force * model.mass_kg[axis] * acceleration[axis];
    at.complete(motion, &Vector3::zeros(), 0, &mut innovation.jacobian, &mut rows);
    innovation.by_further = Some(rows);
    innovation
}

#[cfg(test)]
#[path = "effort_tests.rs"]
mod tests;
